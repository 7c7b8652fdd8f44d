"""Cells that follow the rock: what a split carries over, when cells are split, and what a step with them comes to."""

from dataclasses import replace

import numba
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mechanics.killed import Killed, KilledAfter
from mechanics.scenes import (
    COULOMB,
    HOST,
    ball,
    constrain,
    excavation,
    grid_around,
    host_everywhere,
    make_dataset,
    make_model,
    make_scene,
    random_grid,
    uniform,
)
from mpm_core.carrying import carry, carry_forces, carry_loose, carry_nodes
from mpm_core.checkpoint import Checkpoint
from mpm_core.equilibrium import cascade
from mpm_core.equilibrium.body import Body
from mpm_core.equilibrium.brittle import above_strength, find_brittle
from mpm_core.equilibrium.convergence import NoRest
from mpm_core.equilibrium.energy import elastic_energy
from mpm_core.equilibrium.refinement import RINGS, Refinement
from mpm_core.grid import build_grid
from mpm_core.grid.adjacency import holding_cells
from mpm_core.grid.splitting import split
from mpm_core.ground import Ground
from mpm_core.mining import stored
from mpm_core.model import build_model
from mpm_core.occupancy import FULL, Loose
from mpm_core.stages import elastic_stage, mining_step
from pipeline.datasets import write_dataset

ADAPTIVE = {"rings": 1, "max_cells": 10**6, "bodies": []}
STRESS = uniform(-30e6, -20e6, -18e6, 0.0, 3e6)
HOLES = [ball([26.0, 40.0], 5.0), ball([55.0, 40.0], 5.0)]
BRITTLE = {"scheme": "multigrid", "tolerance": 1e-5, "cascade_tolerance": 1e-3, "increments": 2}


def adaptive_scene(mined=(0,), steps=1, **changes):
    """Holes of 5 m in brittle rock, in plane strain; cells of 1 to 8 m that follow the rock."""
    entries = [excavation(step, name=f"hole_{number}") for number, step in enumerate(mined)]
    options = {"host": COULOMB, "stress": STRESS, "solver": BRITTLE, "refinement": ADAPTIVE} | changes
    return make_scene("xz", excavations=entries, steps=steps, **options)


SEEDS = st.integers(0, 2**32 - 1)
DIMENSIONS = st.sampled_from([2, 3])


def grid_of(shapes, rings=1):
    """Fine around these shapes alone."""
    return grid_around(shapes, [10, 10], 4, 8.0, rings=rings)


def models(seed, dimension, per_edge):
    """An elastic model on a random grid with hanging nodes, and the same with random cells split."""
    random = np.random.default_rng(seed)
    grid = random_grid(random, dimension)
    scene = make_scene("xz" if dimension == 2 else None, particles_per_cell=per_edge)
    shape = grid.shape >> 1
    places = random.integers(0, shape, (3, dimension))
    finer = split(grid, places, int(random.integers(0, 2)), 1)
    return make_model(scene, grid), make_model(scene, finer), random


def strained(model, gradient):
    """The model's body under a homogeneous displacement gradient (d, d), from virgin."""
    body = Body(model, model.virgin_state(), model.volumes(0))
    body.displace((model.grid.node_position - model.grid.origin) @ gradient.T)
    return body


@settings(max_examples=25, deadline=None)
@given(SEEDS, DIMENSIONS, st.sampled_from([1, 2]))
def test_a_linear_field_goes_over_with_stress_and_forces(seed, dimension, per_edge):
    """Stress, energy and total force to round-off, on cells of all sizes with hanging nodes; hourglass forces none."""
    old, new, random = models(seed, dimension, per_edge)
    gradient = 1e-3 * random.standard_normal((old.dimension, old.dimension))
    body = strained(old, gradient)
    state = carry(old, body.state, new)
    exact = strained(new, gradient)
    size = np.abs(exact.state.stress).max()
    np.testing.assert_allclose(state.stress, exact.state.stress, rtol=0, atol=1e-11 * size)
    np.testing.assert_allclose(
        state.displacement, exact.state.displacement, rtol=0, atol=1e-12 * np.abs(exact.state.displacement).max()
    )
    assert np.abs(state.hourglass_force).max() <= 1e-9 * size
    carried = Body(new, state, new.volumes(0))
    force, expected = carried.internal_force(), exact.internal_force()
    np.testing.assert_allclose(force, expected, rtol=0, atol=1e-10 * size * new.grid.fine_cell ** (new.dimension - 1))
    assert stored(carried) == pytest.approx(stored(body), rel=1e-9)


@settings(max_examples=25, deadline=None)
@given(SEEDS, DIMENSIONS, st.just(1))
def test_of_any_field_the_parts_have_the_mean_of_their_cell(seed, dimension, per_edge):
    """Random displacement: parts' stress has the cell's as its mean, unsplit cells keep every bit, and the energy of
    stress can only grow: the parts feel what the one point of their cell did not."""
    old, new, random = models(seed, dimension, per_edge)
    body = Body(old, old.virgin_state(), old.volumes(0))
    body.displace(1e-3 * random.standard_normal(body.state.displacement.shape))
    state = carry(old, body.state, new)
    origin = holding_cells(old.grid, new.grid.cell_index)
    whole = new.grid.cell_level == old.grid.cell_level[origin]
    assert np.array_equal(state.stress[whole], body.state.stress[origin[whole]])
    assert np.array_equal(state.hourglass_force[whole], body.state.hourglass_force[origin[whole]])
    volume = new.volumes(0)
    for component in range(6):
        mean = np.bincount(origin, volume * state.stress[:, component]) / np.bincount(origin, volume)
        size = np.abs(body.state.stress).max()
        np.testing.assert_allclose(mean, body.state.stress[:, component], rtol=0, atol=1e-10 * size)
    before, after = (
        elastic_energy(replace(model, insitu=np.zeros_like(model.insitu)), own, model.volumes(0))
        for model, own in ((old, body.state), (new, state))
    )
    assert after >= before * (1.0 - 1e-12)


@pytest.mark.parametrize("poisson", [0.25, 0.4999])
@pytest.mark.parametrize("dimension", [2, 3])
def test_split_cells_have_the_hourglass_forces_of_rock_that_moved_so(dimension, poisson):
    """Also of rock near Poisson's ratio 0.5, whose hourglass stiffness is not in proportion to lambda + 2 mu."""
    random = np.random.default_rng(3)
    grid = random_grid(random, dimension)
    scene = make_scene("xz" if dimension == 2 else None, host=HOST | {"poisson_ratio": poisson})
    finer = split(grid, random.integers(0, grid.shape >> 1, (3, dimension)), 1, 1)
    old, new = make_model(scene, grid), make_model(scene, finer)
    body = Body(old, old.virgin_state(), old.volumes(0))
    body.displace(1e-3 * random.standard_normal(body.state.displacement.shape))
    state = carry(old, body.state, new)
    exact = Body(new, new.virgin_state(), new.volumes(0))
    exact.displace(state.displacement)
    anew = new.grid.cell_level != old.grid.cell_level[holding_cells(old.grid, new.grid.cell_index)]
    assert anew.any()
    size = np.abs(exact.state.hourglass_force).max()
    np.testing.assert_allclose(state.hourglass_force[anew], exact.state.hourglass_force[anew], rtol=0, atol=1e-9 * size)


@settings(max_examples=25, deadline=None)
@given(SEEDS, DIMENSIONS, st.sampled_from([1, 2]))
def test_nodes_that_stay_keep_value_and_force(seed, dimension, per_edge):
    old, new, random = models(seed, dimension, per_edge)
    values = random.standard_normal((len(old.grid.node_index), 3))
    values = constrain(old.grid, values)
    result = carry_nodes(old, values, new)
    place = {tuple(index): number for number, index in enumerate(new.grid.node_index.tolist())}
    stay = np.array([place[tuple(index)] for index in old.grid.node_index.tolist()])
    np.testing.assert_allclose(result[stay], values, rtol=0, atol=1e-14)
    np.testing.assert_allclose(constrain(new.grid, result), result, rtol=0, atol=1e-14)
    forces = carry_forces(old, values, new)
    assert np.array_equal(forces[stay], values)
    assert np.array_equal(np.sort(np.flatnonzero(forces.any(axis=1))), np.sort(stay[values.any(axis=1)]))


def test_fallen_cells_stay_fallen_with_all_their_parts():
    grid = build_grid(np.zeros(2), 4.0, np.array([2, 2]), 3, lambda level, index: np.zeros(len(index), bool), 0)
    scene = make_scene("xz")
    loose = Loose(np.array([1], np.int32), np.array([FULL]), np.array([0], np.int32), np.array([0], np.int32))
    model = build_model(scene, grid, host_everywhere(grid), make_model(scene, grid).pieces, loose, all_fallen=True)
    finer = split(grid, np.array([[2, 0]]), 0, 1)
    carried = carry_loose(model, finer.cell_index)
    origin = holding_cells(grid, finer.cell_index)
    assert np.array_equal(carried.cell, np.flatnonzero(origin == 1))
    assert len(carried.cell) > 1
    assert (carried.samples == FULL).all()


def run(scene, grid, tmp_path, shapes=HOLES[:1], checkpoint=None):
    """Elastic history and all steps that follow."""
    dataset = make_dataset(scene, grid, shapes)
    state, _ = elastic_stage(scene, dataset, tmp_path / "f.npz")
    return mining_step(scene, dataset, state, tmp_path / "f.npz", checkpoint)


def test_rock_fails_as_on_a_grid_that_is_fine_everywhere_it_fails(tmp_path):
    """One hole with 0, 1 and 3 rings of fine cells to start from, against a grid that is fine within 22 m: volume
    within 3 %; nothing is truncated, and more than a third of the fine cells fail."""
    _, few = run(adaptive_scene(refinement=None), grid_of(HOLES[:1], rings=1), tmp_path)
    _, limit = run(adaptive_scene(refinement=None), grid_of([ball([26.0, 40.0], 20.0)], rings=2), tmp_path)
    assert few["truncated"] == 1
    assert limit["truncated"] == 0
    for rings in (0, 1, 3):
        state, facts = run(adaptive_scene(), grid_of(HOLES[:1], rings=rings), tmp_path)
        assert facts["truncated"] == 0
        assert facts["failed_volume"] == pytest.approx(limit["failed_volume"], rel=0.03)
        assert facts["failed_particles"] > 0.35 * facts["finest_cells"]
        assert facts["energy_left_share"] < 0.01
        level = state.cell_level.values[state.cell.values]
        assert (level[state.failed.values >= 0] == 3).all()
        if rings == 0:
            assert facts["cell_splits"] > 0


def test_no_rock_above_strength_is_left_in_coarse_cells(tmp_path):
    scene = adaptive_scene()
    grid = grid_of(HOLES[:1], rings=0)
    state, _ = run(scene, grid, tmp_path)
    coarse = np.flatnonzero(state.cell_level.values[state.cell.values] < 3)
    assert len(coarse)
    assert (state.strength_factor.values[coarse] >= 1.0).all()


def test_the_most_cells_are_kept_and_what_they_keep_from_failing_is_named(tmp_path, caplog):
    grid = grid_of(HOLES[:1], rings=0)
    most = len(grid.cell_level) + 30
    scene = adaptive_scene(refinement=ADAPTIVE | {"max_cells": most})
    _, facts = run(scene, grid, tmp_path)
    assert facts["cells"] <= most
    assert facts["truncated"] == 1
    assert "more grid.max_cells would let it fail" in facts["truncated_where"]
    assert "more than grid.max_cells" in caplog.text


def two_steps(tmp_path, checkpoint=None, first_grid=None, **changes):
    """A hole, then another 29 m away that has no fine cells until it is mined; both states."""
    first, second = adaptive_scene((0, -1), 1, **changes), adaptive_scene((0, 1), 2, **changes)
    grid = first_grid or grid_of(HOLES[:1])
    both = grid_of(HOLES)
    dataset = make_dataset(first, grid, HOLES[:1])
    parts = make_dataset(first, both, HOLES)
    own = [name for name in parts.variables if name.startswith("piece_")]
    dataset = dataset.drop_dims("piece").assign({name: parts[name] for name in own})
    elastic, _ = elastic_stage(first, dataset, tmp_path / "f.npz")
    before, _ = mining_step(first, dataset, elastic, tmp_path / "f.npz")
    return before, mining_step(second, dataset, before, tmp_path / "f.npz", checkpoint)


def test_an_opening_has_fine_cells_once_it_is_mined(tmp_path):
    before, (after, facts) = two_steps(tmp_path)
    mined = after.volume.values == 0.0
    assert (after.cell_level.values[after.cell.values[mined]] == 3).all()
    place = after.position.values[mined][:, [0, 2]]
    assert (np.abs(place - [55.0, 40.0]).max(axis=1) < 6.0).any()
    far = np.abs(before.position.values[:, [0, 2]] - [55.0, 40.0]).max(axis=1) < 3.0
    assert (before.spacing.values[far] > 1.0).all()
    assert facts["energy_left_share"] < 0.01
    # what failed before has its place, strain and step still
    failed = before.failed.values == 0
    places, strains = before.position.values[failed].tolist(), before.plastic_strain.values[failed]
    was = {tuple(place): strain for place, strain in zip(places, strains, strict=True)}
    now = after.failed.values == 0
    assert now.sum() == failed.sum()
    grown = after.plastic_strain.values - after.plastic_strain_step.values
    for place, strain in zip(after.position.values[now].tolist(), grown[now].tolist(), strict=True):
        np.testing.assert_allclose(strain, was[tuple(place)], rtol=1e-12, atol=1e-15)


@pytest.mark.parametrize("generations", [1, 4])
def test_a_step_killed_on_split_cells_ends_in_the_same_bytes(generations, tmp_path):
    _, (whole, facts) = two_steps(tmp_path)
    assert facts["cell_splits"] > 1
    path = tmp_path / "step.checkpoint.npz"
    dying = KilledAfter(path, "inputs", pause=0.0)
    dying.left = generations
    with pytest.raises(Killed):
        two_steps(tmp_path, dying)
    _, (resumed, _) = two_steps(tmp_path, Checkpoint(path, "inputs"))
    for dataset, name in ((whole, "a.nc"), (resumed, "b.nc")):
        write_dataset(dataset, tmp_path / name)
    assert (tmp_path / "a.nc").read_bytes() == (tmp_path / "b.nc").read_bytes()


def test_any_number_of_threads_gives_the_same_bits(tmp_path):
    results = []
    for threads in (1, 2):
        numba.set_num_threads(threads)
        results.append(two_steps(tmp_path)[1][0])
    assert results[0].identical(results[1])


def test_parts_of_a_coarse_cell_are_of_the_rock_body_they_lie_in(tmp_path):
    """A dyke across coarse cells: children on either side of its wall differ, whatever their cell was."""
    body = {"name": "dyke", "shape": "box", "lower": [36.7, 0.0], "upper": [44.5, 80.0]}
    materials = {"host": COULOMB, "dyke": COULOMB | {"youngs_modulus": 20e9}, "fill": COULOMB}
    scene = adaptive_scene(
        materials=materials, rock_bodies=[{"material": "dyke"}], refinement=ADAPTIVE | {"bodies": [body]}
    )
    grid = grid_of(HOLES[:1])
    centre = grid.cell_center[:, 0]
    of_cell = np.where((centre > 36.7) & (centre < 44.5), 0, -1).astype(np.int16)
    ground = Ground.of(scene, make_dataset(scene, grid, HOLES[:1], of_cell))
    model = ground.model(grid, of_cell, Loose.none())
    finer = split(grid, np.array([[20, 30]]), 2, 1)
    new = ground.on(finer, model)
    parts = new.grid.cell_level != grid.cell_level[holding_cells(grid, finer.cell_index)]
    x = new.grid.cell_center[:, 0]
    assert parts.any()
    assert np.array_equal(new.body[parts], np.where((x > 36.7) & (x < 44.5), 0, -1)[parts])


def test_virgin_rock_near_its_strength_asks_for_nothing():
    """However close: what asks is the change of stress by mining."""
    close = uniform(-3.0 * 10e6 - 6.9e6, -10e6, -20e6)
    scene = adaptive_scene(stress=close)
    grid = grid_of(HOLES[:1])
    model = make_model(scene, grid, HOLES[:1])
    brittle = find_brittle(model, model.volumes(0), 0, np.zeros(len(model.cell_nodes) + 1, int), np.empty(0, int))
    state = model.virgin_state()
    assert len(brittle.coarse)
    assert len(above_strength(model, state, brittle.coarse)) == 0
    nothing = np.empty(0, np.int64)
    assert len(Refinement.of(grid).asked(model, state, brittle, nothing, 1000)[0]) == 0
    state.stress[brittle.coarse[0], 0] = -1e6
    assert len(Refinement.of(grid).asked(model, state, brittle, nothing, 1000)[0])


def test_rock_at_the_edge_of_the_fine_cells_waits_for_a_split_that_is_worth_it():
    """One family at the edge of the fine cells, in a large mine and in a small one; rock within fails at once."""
    scene = adaptive_scene()
    grid = grid_of(HOLES[:1], rings=3)
    model = make_model(scene, grid, HOLES[:1])
    brittle = find_brittle(model, model.volumes(0), 0, np.zeros(len(model.cell_nodes) + 1, int), np.empty(0, int))
    finest = np.flatnonzero(grid.cell_level == 3)
    reach = np.abs(grid.cell_center[finest] - [26.0, 40.0]).max(axis=1)
    edge, inside = finest[reach.argmax()], finest[(reach > 5.0) & (reach < 7.0)][0]
    fresh, state, now = np.array([inside, edge]), model.virgin_state(), Refinement.of(grid)
    for cells, waiting in ((10**6, [edge]), (10, [inside, edge])):
        places, first = now.asked(model, state, brittle, fresh, cells)
        assert np.array_equal(places, grid.cell_index[[edge]] >> 1)
        assert set(first) == set(fresh) - set(waiting)
    places, first = now.asked(model, state, brittle, fresh[:1], 10)
    assert not len(places)
    assert np.array_equal(first, fresh[:1])


def test_a_grid_without_fine_cells_gets_them_where_rock_is_near_its_strength():
    """Nothing mined yet, as in a mine whose boundary is strained."""
    grid = build_grid(np.zeros(2), 8.0, np.array([4, 4]), 4, lambda level, index: np.zeros(len(index), bool), 0)
    model = make_model(adaptive_scene(mined=()), grid)
    brittle = find_brittle(model, model.volumes(0), 0, np.zeros(len(model.cell_nodes) + 1, int), np.empty(0, int))
    state = model.virgin_state()
    cell = np.flatnonzero((grid.cell_index == 8).all(axis=1))[0]
    state.stress[cell, 0] = -100e6
    places, _ = Refinement.of(grid).asked(model, state, brittle, np.empty(0, np.int64), len(grid.cell_level))
    finer = split(grid, places, RINGS, 1)
    inside = ((finer.cell_index >= 8) & (finer.cell_index < 16)).all(axis=1)
    assert (finer.cell_level[inside] == 3).all()
    # mirrored in its middle the grid is itself: no side of the cell is favoured
    centre = finer.cell_index + 0.5 * finer.cell_width[:, None]
    near = (np.abs(centre - 12.0) < 12.0).all(axis=1)
    cells = {
        (*place, width) for place, width in zip(centre[near].tolist(), finer.cell_width[near].tolist(), strict=True)
    }
    assert {(24.0 - x, y, width) for x, y, width in cells} == cells


def test_a_collapse_right_after_a_split_goes_back_to_the_cells_of_now(tmp_path, monkeypatch):
    """No rest on cells that have just been split: the last state of rest is on these cells, not on those before."""

    def no_rest(scheme, external, tolerance, reference, history):
        if history.splits > 1:
            raise NoRest("never")
        return real(scheme, external, tolerance, reference, history)

    real = cascade.come_to_rest_on
    monkeypatch.setattr(cascade, "come_to_rest_on", no_rest)
    scene = adaptive_scene(solver=BRITTLE | {"collapse": "keep"})
    state, facts = run(scene, grid_of(HOLES[:1], rings=0), tmp_path)
    assert facts["collapsed"] == 1
    assert facts["cells"] == state.sizes["cell"]
