"""Walls so near each other that their cells share nodes: each has its own, and what must hold then."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.ndimage import generate_binary_structure, label

from mechanics.scenes import (
    TABLE_2,
    box,
    excavation,
    grid_around,
    make_dataset,
    make_model,
    make_scene,
    uniform,
)
from mpm_core.equilibrium.body import Body
from mpm_core.files.state_datasets import read_grid
from mpm_core.geometry.inside import SAMPLES_PER_CELL
from mpm_core.model import phantom_nodes
from mpm_core.model.occupancy import ALL_SAMPLES
from mpm_core.model.phantom_nodes import PhantomNodes
from mpm_core.stages.equilibrium_stages import elastic_stage, mining_step
from mpm_core.stages.external_forces import external_force

STRESS = uniform(-20e6, -15e6, -30e6, 2e6, -1e6, 3e6)
MULTIGRID = {"scheme": "multigrid", "tolerance": 1e-8, "cascade_tolerance": 1e-8}


def dipping(center, size, dip):
    """A slot in the first two axes, of any extent along others."""
    c, s = np.cos(np.radians(dip)), np.sin(np.radians(dip))

    def inside(x):
        d = x[..., :2] - np.asarray(center)
        along, across = c * d[..., 0] + s * d[..., 1], -s * d[..., 0] + c * d[..., 1]
        return (np.abs(along) < size[0] / 2) & (np.abs(across) < size[1] / 2)

    return inside


SLOT = dipping([36.3, 35.2], [24.0, 2.6], 35.0)  # cells are 2 m wide


def scene_of(plane="xy", steps=1, mined=(0,), **more):
    return make_scene(
        plane, stress=STRESS, steps=steps, solver=MULTIGRID, excavations=[excavation(step) for step in mined], **more
    )


def grid_of(shapes, dimension=2):
    return grid_around(shapes, [9] * dimension, 3, 8.0, rings=2)


@settings(deadline=None)
@given(st.lists(st.sampled_from([0, 1, 2, 3]), min_size=8, max_size=8), st.integers(0, 2**32), st.sampled_from([2, 3]))
def test_groups_are_those_of_an_image_of_the_samples(kinds, seed, dimension):
    """Beside labels of the whole image: here cells are one piece each, there each cell's samples are filled to one."""
    random = np.random.default_rng(seed)
    octants, edge = 1 << dimension, round(SAMPLES_PER_CELL ** (1 / dimension))
    layers = [0, int(ALL_SAMPLES), None, None]
    solid = np.zeros((1, octants), np.uint64)
    for octant in range(octants):
        kind = layers[kinds[octant]]
        if kind is None:  # a half space of samples, cut across an axis
            axis, at, low = random.integers(dimension), random.integers(1, edge), random.integers(2)
            place = (np.arange(SAMPLES_PER_CELL) // edge**axis) % edge
            kind = sum(1 << int(bit) for bit in np.flatnonzero((place < at) == low))
        solid[0, octant] = kind
    groups = phantom_nodes._groups(solid)[0]
    image = np.zeros([2 * edge] * dimension, bool)
    bits = np.array([[int(cell) >> bit & 1 for bit in range(SAMPLES_PER_CELL)] for cell in solid[0]], bool)
    for octant in range(octants):
        place = tuple(slice(edge * (octant >> k & 1), edge * (1 + (octant >> k & 1))) for k in range(dimension))
        image[place] = bits[octant].reshape([edge] * dimension, order="F")
    labels, _ = label(image, generate_binary_structure(dimension, 1))
    for one in range(octants):
        assert (groups[one] < 0) == (not bits[one].any())
        for other in range(octants):
            if groups[one] < 0 or groups[other] < 0:
                continue
            found = [
                labels[tuple(slice(edge * (o >> k & 1), edge * (1 + (o >> k & 1))) for k in range(dimension))].max()
                for o in (one, other)
            ]
            assert (groups[one] == groups[other]) == (found[0] == found[1])


@pytest.mark.parametrize("plane", ["xy", None])
def test_walls_of_a_dipping_slot_have_nodes_of_their_own(plane):
    """Beside a grid with one node at each corner: the same cells and places, a few more nodes; without them again."""
    dimension = 3 if plane is None else 2
    grid = grid_of([SLOT], dimension)
    model = make_model(scene_of(plane), grid, [SLOT])
    assert model.grid.phantoms > 10
    assert len(model.grid.node_index) == len(grid.node_index) + model.grid.phantoms
    np.testing.assert_array_equal(model.grid.node_index[model.grid.vtk_nodes], grid.node_index[grid.vtk_nodes])
    virgin = model.at(-1)
    assert virgin.grid.phantoms == 0
    np.testing.assert_array_equal(virgin.cell_nodes, make_model(scene_of(plane), grid).cell_nodes)
    np.testing.assert_array_equal(virgin.at(0).cell_nodes, model.cell_nodes)


def test_a_wide_opening_has_none():
    shape = box([21.3, 22.4], [47.1, 45.2])
    assert make_model(scene_of(), grid_of([shape]), [shape]).grid.phantoms == 0


@pytest.mark.parametrize("plane", ["xz", None])
def test_a_uniform_strain_gives_a_uniform_stress(plane):
    """The patch test, to round-off; and the forces of that stress are those of the virgin stress that is gone."""
    dimension = 3 if plane is None else 2
    model = make_model(scene_of(plane), grid_of([SLOT], dimension), [SLOT])
    body = Body(model, model.virgin_state(), model.volumes(0))
    strain = 1e-4 * np.array([[1.0, 0.3, -0.2], [0.3, -2.0, 0.5], [-0.2, 0.5, 0.7]])[:dimension, :dimension]
    body.displace(model.grid.node_position @ strain)
    stress = body.state.stress[body.volume > 0.0]
    np.testing.assert_allclose(stress, np.broadcast_to(stress[0], stress.shape), atol=1e-12 * np.abs(stress).max())


def test_virgin_stress_holds_what_is_taken_away():
    """Rock whose stress falls by the virgin one pulls at each node with what mining puts on it: each wall by itself."""
    model = make_model(scene_of(None), grid_of([SLOT], 3), [SLOT])
    state = model.virgin_state()
    body = Body(model, state, model.volumes(0))
    state.stress[:] = model.insitu
    force = external_force(model, 0)
    held = np.where(model.held, 0.0, body.internal_force())
    np.testing.assert_allclose(held, force, atol=1e-9 * np.abs(force).max())


@pytest.mark.parametrize("slot", [SLOT, dipping([36.3, 36.0], [24.0, 2.0], 0.0)])
def test_forces_add_up_to_the_weight_that_is_gone(slot):
    """With stress that is linear in depth; the slots are upright, one of them along a face of cells."""
    scene = make_scene(None, stress=TABLE_2, surface=1000.0, excavations=[excavation()])
    model = make_model(
        scene,
        grid_of([lambda x: slot(x) & (x[..., 2] > 20.3) & (x[..., 2] < 49.7)], 3),
        [lambda x: slot(x) & (x[..., 2] > 20.3) & (x[..., 2] < 49.7)],
    )
    assert model.grid.phantoms > 10
    gone = (model.particles.full_volume - model.material_volumes(0)).sum()
    total = external_force(model, 0).sum(axis=0)
    np.testing.assert_allclose(total, -gone * scene.insitu.body_force, rtol=1e-6)


def energy(shape, scene, tmp_path, levels=3) -> float:
    grid = grid_around([shape], [9, 9], levels, 8.0, rings=3)
    return elastic_stage(scene, make_dataset(scene, grid, [shape]), tmp_path / "failed.npz")[1]["energy_motion"]


def test_a_narrow_slot_releases_what_fine_cells_do(tmp_path, monkeypatch):
    """Within 8 %; with shared nodes it is a third too little at least."""
    fine, own = (energy(SLOT, scene_of(), tmp_path, levels) for levels in (6, 3))
    monkeypatch.setattr(
        "mpm_core.model.model.with_phantom_nodes", lambda grid, *rest: PhantomNodes(grid, np.empty((0, 3), np.int64), 0)
    )
    shared = energy(SLOT, scene_of(), tmp_path)
    assert own == pytest.approx(fine, rel=0.08)
    assert shared < 0.65 * fine


def test_a_mirrored_slot_releases_the_same_energy(tmp_path):
    """Whichever wall keeps the node that was there."""
    even = {"stress": uniform(-20e6, -15e6, -30e6), "solver": MULTIGRID, "excavations": [excavation()]}
    scene = make_scene("xy", **even)
    mirrored = energy(lambda x: SLOT(np.stack([72.0 - x[..., 0], x[..., 1]], axis=-1)), scene, tmp_path)
    upside_down = energy(lambda x: SLOT(72.0 - x), scene, tmp_path)
    assert mirrored == pytest.approx(energy(SLOT, scene, tmp_path), rel=1e-7)
    assert upside_down == pytest.approx(energy(SLOT, scene, tmp_path), rel=1e-7)


def below(x):
    """How far points lie below the middle of SLOT, in its own direction, m."""
    s, c = np.sin(np.radians(35.0)), np.cos(np.radians(35.0))
    return (x[..., 0] - 36.3) * s - (x[..., 1] - 35.2) * c


CUTS = {  # two solids, the second of which may be mined a step later
    "the slot goes on": [lambda x: SLOT(x) & (x[..., 0] < 35.1), lambda x: SLOT(x) & (x[..., 0] >= 35.1)],
    "one wall goes": [SLOT, lambda x: (np.abs(x[..., 0] - 36.3) < 5.1) & (below(x) > -1.7) & (below(x) < 6.2)],
    "the other wall goes": [SLOT, lambda x: (np.abs(x[..., 0] - 36.3) < 5.1) & (below(x) < 1.7) & (below(x) > -6.2)],
    "a slot beside it": [SLOT, lambda x: (np.abs(x[..., 0] - 36.3) < 8.0) & (np.abs(below(x) - 3.4) < 0.9)],
}


def mirrored(shape, axes):
    """A shape turned round along some of the first two axes, about the middle of the domain."""
    return lambda x: shape(np.where(np.isin(np.arange(x.shape[-1]), axes), 72.0 - x, x))


@pytest.mark.parametrize(
    ("plane", "case", "axes"),
    [(None, "one wall goes", [])] + [("xy", case, axes) for case in CUTS for axes in ([], [0], [1], [0, 1])],
)
def test_elastic_rock_does_not_depend_on_the_number_of_steps(plane, case, axes, tmp_path):
    """Both solids mined at once, and the second a step later, whichever wall keeps the node that was there."""
    dimension = 3 if plane is None else 2
    shapes = [mirrored(shape, axes) for shape in CUTS[case]]
    grid = grid_around(shapes, [7] * dimension, 3, 8.0, origin=[8.0] * dimension, rings=1)
    states = []
    for mined in ((0, 0), (0, 1)):
        state = None
        for step in range(mined[1] + 1):
            now = scene_of(plane, step + 1, mined)
            dataset = make_dataset(now, grid, shapes)
            if state is None:
                state = elastic_stage(now, dataset, tmp_path / "failed.npz")[0]
            state, facts = mining_step(now, dataset, state, tmp_path / "failed.npz")
            assert facts["energy_left_share"] < 1e-9
        states.append(state)
    one, two = states
    assert read_grid(two)[0].phantoms > 5
    moved, motion = np.zeros((2, *one.stress.shape[:1], 3))
    for state, values in ((one, moved), (two, motion)):
        here = state.volume.values > 0.0
        nodes = state.cell_nodes.values[state.cell.values[here]]
        values[here] = state.node_displacement.values[nodes].mean(axis=1)
    np.testing.assert_allclose(motion, moved, atol=1e-5 * np.abs(moved).max())
    np.testing.assert_allclose(two.stress.values, one.stress.values, atol=1e-5 * np.abs(one.stress.values).max())


@pytest.mark.parametrize("since", [0, 1])
def test_pressure_in_a_slot_is_that_of_the_stress_that_is_gone(since, tmp_path):
    """With 20 MPa inside, rock under 20 MPa all round is as it was; from a step later on, as if from the start."""
    states = []
    for begins in (0, since):
        state = None
        for step in range(since + 1):
            pressed = excavation() | {"pressure": [[begins, 20e6]]} if begins <= step else excavation()
            stress = uniform(-20e6, -20e6, -20e6)
            now = make_scene("xy", stress=stress, steps=step + 1, solver=MULTIGRID, excavations=[pressed])
            dataset = make_dataset(now, grid_of([SLOT]), [SLOT])
            if state is None:
                state = elastic_stage(now, dataset, tmp_path / "failed.npz")[0]
            state, _ = mining_step(now, dataset, state, tmp_path / "failed.npz")
        states.append(state)
    assert read_grid(states[0])[0].phantoms > 5
    for state in states:
        here = state.volume.values > 0.0
        assert np.abs(state.stress.values[here, :3] + 20e6).max() < 20.0


def test_fill_beside_parted_walls_bears_as_beside_any():
    """Whether fill shares a place with a cell of it is asked of places: no more of it bears than with shared nodes."""
    wide = dipping([36.3, 35.2], [24.0, 4.4], 35.0)
    scene = make_scene("xy", stress=STRESS, excavations=[excavation(fill="fill")])
    model = make_model(scene, grid_of([wide]), [wide])
    np.testing.assert_array_equal(model.volumes(0), replace(model, cell_nodes=model.plain.vtk_nodes).volumes(0))
    jacket = (model.volumes(0) == 0.0) & (model.material_volumes(0) > 0.0)
    assert jacket.any()


def test_walls_that_were_parted_stay_parted_when_fill_comes(tmp_path, caplog):
    """Open for a step, filled in the next: nothing moves but by the fill's weight, and the walls keep their nodes."""
    state = None
    caplog.set_level("WARNING")
    for step in range(2):
        now = make_scene(
            "xy", stress=STRESS, steps=step + 1, solver=MULTIGRID,
            excavations=[excavation(0, fill="fill", filled=1) if step else excavation(0)],
        )  # fmt: skip
        dataset = make_dataset(now, grid_of([SLOT]), [SLOT])
        if state is None:
            state = elastic_stage(now, dataset, tmp_path / "failed.npz")[0]
        before = state
        state = mining_step(now, dataset, state, tmp_path / "failed.npz")[0]
    assert read_grid(state)[0].phantoms == read_grid(before)[0].phantoms > 5
    scale = np.abs(before.node_displacement.values).max()
    np.testing.assert_allclose(state.node_displacement.values, before.node_displacement.values, atol=1e-6 * scale)
    assert "fill lies between walls" in caplog.text
