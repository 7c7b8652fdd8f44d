"""Cut cells whose rock acts where it is: `cut_cells: mean`."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mechanics.scenes import FILL, HOST, box, excavation, grid_around, make_dataset, make_model, make_scene, uniform
from mpm_core.equilibrium.body import Body
from mpm_core.geometry.inside import SAMPLES_PER_CELL
from mpm_core.model.occupancy import ALL_SAMPLES
from mpm_core.model.particles import (
    centroids,
    mean_modes,
    mode_table,
    own_stiffening,
    point_table,
    shapes_of,
    slopes_of,
)
from mpm_core.stages.equilibrium_stages import elastic_stage, mining_step
from mpm_core.stages.external_forces import external_force

SAMPLE_SETS = st.integers(1, 2**64 - 1)


def mirrored(samples: int, axis: int, dimension: int) -> int:
    """The samples of a cell mirrored across its middle along an axis."""
    per_edge = round(SAMPLES_PER_CELL ** (1 / dimension))
    result = 0
    for bit in range(SAMPLES_PER_CELL):
        place = bit // per_edge**axis % per_edge
        other = bit + (per_edge - 1 - 2 * place) * per_edge**axis
        result |= (samples >> bit & 1) << other
    return result


@given(SAMPLE_SETS, st.sampled_from([2, 3]), st.integers(0, 2))
def test_means_of_a_mirrored_set_are_mirrored(samples, dimension, axis):
    """To the bit: modes that are odd along the axis change their sign, the others stay."""
    axis %= dimension
    both = np.array([samples, mirrored(samples, axis, dimension)], np.uint64)
    own, other = mean_modes(both, dimension)
    sign = np.where(np.arange(1 << dimension) >> axis & 1, -1.0, 1.0)
    np.testing.assert_array_equal(other, sign * own)


@pytest.mark.parametrize("dimension", [2, 3])
def test_all_samples_stand_for_the_centre(dimension):
    modes = mean_modes(np.array([ALL_SAMPLES]), dimension)
    np.testing.assert_array_equal(modes, mode_table(np.zeros((1, dimension))))
    assert own_stiffening(modes, slopes_of(modes), np.array([0.3])) == pytest.approx(1.3)


@given(SAMPLE_SETS, st.sampled_from([2, 3]))
def test_shape_functions_are_means_that_add_up_to_one(samples, dimension):
    """Beside a plain sum over the samples; a linear field has its value at the centroid, and its gradient."""
    points = point_table(round(SAMPLES_PER_CELL ** (1 / dimension)), dimension)
    points = points[[bit for bit in range(SAMPLES_PER_CELL) if samples >> bit & 1]]
    modes = mean_modes(np.array([samples], np.uint64), dimension)
    shape, slope = shapes_of(modes, slopes_of(modes))
    corners = np.array([[1 if c >> k & 1 else -1 for k in range(dimension)] for c in range(1 << dimension)])
    plain = np.mean([np.prod(0.5 * (1 + corners * point), axis=1) for point in points], axis=0)
    np.testing.assert_allclose(shape[0], plain, atol=1e-14)
    assert shape.sum() == pytest.approx(1.0)
    np.testing.assert_allclose(centroids(modes)[0], points.mean(axis=0), atol=1e-14)
    np.testing.assert_allclose(shape[0] @ corners, points.mean(axis=0), atol=1e-14)
    np.testing.assert_allclose(slope[0].T @ corners, np.eye(dimension), atol=1e-14)


@pytest.mark.parametrize(("plane", "dimension"), [("xz", 2), (None, 3)])
def test_a_uniform_strain_gives_a_uniform_stress(plane, dimension):
    """The patch test, with walls anywhere in their cells: to round-off, in every particle."""
    shape = box([14.7, *[15.3] * (dimension - 1)], [22.1, *[24.4] * (dimension - 1)])
    grid = grid_around([shape], [5] * dimension, 2, 8.0)
    model = make_model(make_scene(plane, excavations=[excavation()]), grid, [shape])
    body = Body(model, model.virgin_state(), model.volumes(0))
    strain = 1e-4 * np.array([[1.0, 0.3, -0.2], [0.3, -2.0, 0.5], [-0.2, 0.5, 0.7]])[:dimension, :dimension]
    body.displace(grid.node_position @ strain)
    stress = body.state.stress[body.volume > 0.0]
    assert (model.particles.group_table >= model.particles.shared_rows).any()
    np.testing.assert_allclose(stress, np.broadcast_to(stress[0], stress.shape), atol=1e-12 * np.abs(stress).max())


def closure_energy(offset: float, folder: Path) -> float:
    """Energy released by a square opening of four cells in a domain nine times as wide, moved by `offset` m."""
    lower = np.array([56.0, 56.0]) + offset
    shape = box(lower, lower + 32.0)
    scene = make_scene(
        "xz", stress=uniform(-20e6, -20e6, -20e6), excavations=[excavation()],
        solver={"scheme": "multigrid", "tolerance": 1e-6},
    )  # fmt: skip
    grid = make_dataset(scene, grid_around([shape], [18, 18], 2, 16.0, origin=np.full(2, -72.0)), [shape])
    return elastic_stage(scene, grid, folder / "failed.npz")[1]["energy_released"]


@pytest.mark.parametrize("share", [0.25, 0.5, 0.75])
def test_an_opening_releases_the_same_energy_wherever_its_walls_lie(share, tmp_path):
    """Within 11 % at four cells across; rock at its cells' centres would be off by 15 %."""
    assert closure_energy(8.0 * share, tmp_path) == pytest.approx(closure_energy(0.0, tmp_path), rel=0.11)


def filled(width: float, **fill):
    """A model of a filled opening so many m wide, 20 m high, moved by a part of a cell; fill: other values of it."""
    shape = box([13.0, 10.9], [13.0 + width, 30.9])
    weight = {"constant": [0.0] * 6, "gradient": [-0.0149e6, -0.0149e6, -0.0278e6, 0.0, 0.0, 0.0]}
    materials = {"host": HOST, "fill": FILL | fill}
    scene = make_scene("xz", stress=weight, materials=materials, excavations=[excavation(fill="fill")])
    return make_model(scene, grid_around([shape], [5, 5], 2, 8.0), [shape])


@pytest.mark.parametrize("stiffness", [HOST["youngs_modulus"], 1e3 * HOST["youngs_modulus"]])
def test_fill_as_stiff_as_the_rock_beside_it_bears(stiffness):
    """A ring of cells without it would let the rock close around it."""
    model = filled(14.0, youngs_modulus=stiffness)
    np.testing.assert_array_equal(model.volumes(0), model.material_volumes(0))


def test_fill_beside_whole_cells_of_it_weighs_and_bears_nothing():
    model = filled(14.0)
    fill = ~model.particles.is_rock
    there, bearing = model.material_volumes(0), model.volumes(0)
    beside = fill & (there > 0.0) & (bearing == 0.0)
    rock = np.bincount(model.particles.cell, np.where(fill, 0.0, there), len(model.cell_nodes))
    assert beside.any()
    assert (rock[model.particles.cell[beside]] > 0.0).all()
    assert (rock[model.particles.cell[fill & (bearing > 0.0)]] == 0.0).all()
    np.testing.assert_array_equal(bearing[~fill], there[~fill])
    lost = np.where(fill, 0.0, model.particles.full_volume - there).sum()
    weight = 0.0278e6 * (lost - 1750.0 / 2850.0 * there[fill].sum())
    force = external_force(model, 0)
    held = model.held.any(axis=1)
    assert not held[np.abs(force).max(axis=1) > 0.0].any()
    assert force[:, 1].sum() == pytest.approx(weight, rel=1e-9)


def test_fill_of_an_opening_without_a_whole_cell_bears():
    model = filled(2.5)
    fill = ~model.particles.is_rock
    np.testing.assert_array_equal(model.volumes(0)[fill], model.material_volumes(0)[fill])
    assert model.volumes(0)[fill].sum() > 0.0


def test_stress_follows_a_wall_that_moves_within_its_cells(tmp_path):
    """Mined in two steps whose wall stands in the same cells: elastic rock is as if mined at once (1e-6)."""
    shapes = [box([13.0, 13.0], [25.0, 25.0]), box([25.0, 13.0], [26.5, 25.0])]
    grid, states = None, {}
    for way, mined in {"once": (0, 0), "twice": (0, 1)}.items():
        state = None
        for last in range(max(mined) + 1):
            entries = [excavation(m if m <= last else -1, name=f"e{i}") for i, m in enumerate(mined)]
            scene = make_scene(
                "xz", stress=uniform(-20e6, -12e6, -10e6, 0, 3e6), excavations=entries, steps=last + 1,
                solver={"tolerance": 1e-9},
            )  # fmt: skip
            grid = make_dataset(scene, grid_around(shapes, [5, 5], 2, 8.0), shapes) if grid is None else grid
            state = elastic_stage(scene, grid, tmp_path / "f.npz")[0] if state is None else state
            state, facts = mining_step(scene, grid, state, tmp_path / "f.npz")
        states[way] = state
        assert abs(facts["energy_left_share"]) < 1e-6
    once, twice = (states[way] for way in ("once", "twice"))
    there = once.volume.values > 0.0
    np.testing.assert_array_equal(twice.position.values[there], once.position.values[there])
    np.testing.assert_allclose(twice.stress.values[there], once.stress.values[there], rtol=0, atol=1e-6 * 20e6)
