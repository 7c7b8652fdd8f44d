"""Cells that follow the rock: when cells are split, and what a step with them comes to."""

import numba
import numpy as np
import pytest

from common.datasets import write_dataset
from mechanics.killed import Killed, KilledAfter
from mechanics.scenes import (
    COULOMB,
    ball,
    excavation,
    grid_around,
    make_dataset,
    make_model,
    make_scene,
    uniform,
)
from mpm_core.equilibrium import cascade
from mpm_core.equilibrium.brittle import above_strength, find_brittle
from mpm_core.equilibrium.convergence import History, NoEquilibrium
from mpm_core.equilibrium.refinement import RINGS_SPLIT_AT_ONCE, RefinedCells
from mpm_core.grid import build_grid
from mpm_core.grid.adjacency import holding_cells
from mpm_core.grid.splitting import split
from mpm_core.model.occupancy import Unsupported
from mpm_core.stages import step_cells
from mpm_core.stages.checkpoint import Checkpoint
from mpm_core.stages.equilibrium_stages import elastic_stage, mining_step
from mpm_core.stages.ground import Ground

ADAPTIVE = {"rings": 1, "max_cells": 10**6, "bodies": []}
STRESS = uniform(-30e6, -20e6, -18e6, 0.0, 3e6)
HOLES = [ball([26.0, 40.0], 4.9), ball([55.0, 40.0], 4.9)]
BRITTLE = {"scheme": "multigrid", "tolerance": 1e-5, "cascade_tolerance": 1e-3, "increments": 2}
LOOSE = BRITTLE | {"tolerance": 1e-3, "cascade_tolerance": 1e-2}  # for comparisons of bits


def adaptive_scene(mined=(0,), steps=1, **changes):
    """Holes of radius 4.9 m in brittle rock, in plane strain; cells of 1 to 8 m that follow the rock."""
    entries = [excavation(step, name=f"hole_{number}") for number, step in enumerate(mined)]
    options = {"host": COULOMB, "stress": STRESS, "solver": BRITTLE, "refinement": ADAPTIVE} | changes
    return make_scene("xz", excavations=entries, steps=steps, **options)


def grid_of(shapes, rings=1):
    """Fine around these shapes alone."""
    return grid_around(shapes, [10, 10], 4, 8.0, rings=rings)


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
        assert facts["energy_left_share"] < 1e-9
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


def first_step(tmp_path, **changes):
    """A hole, and a step that mines another 29 m away, which has no fine cells before: scene, grid, state before it."""
    first, second = adaptive_scene((0, -1), 1, **changes), adaptive_scene((0, 1), 2, **changes)
    dataset = make_dataset(first, grid_of(HOLES[:1]), HOLES[:1])
    parts = make_dataset(first, grid_of(HOLES), HOLES)
    own = [name for name in parts.variables if name.startswith("piece_")]
    dataset = dataset.drop_dims("piece").assign({name: parts[name] for name in own})
    elastic, _ = elastic_stage(first, dataset, tmp_path / "f.npz")
    before, _ = mining_step(first, dataset, elastic, tmp_path / "f.npz")
    return second, dataset, before


def test_an_opening_has_fine_cells_once_it_is_mined(tmp_path):
    start = first_step(tmp_path)
    before, (after, facts) = start[-1], mining_step(*start, tmp_path / "f.npz")
    mined = after.volume.values == 0.0
    assert (after.cell_level.values[after.cell.values[mined]] == 3).all()
    place = after.position.values[mined][:, [0, 2]]
    assert (np.abs(place - [55.0, 40.0]).max(axis=1) < 6.0).any()
    far = np.abs(before.position.values[:, [0, 2]] - [55.0, 40.0]).max(axis=1) < 3.0
    assert (before.spacing.values[far] > 1.0).all()
    assert facts["energy_left_share"] < 1e-9
    # what failed before has its place, strain and step still
    failed = before.failed.values == 0
    places, strains = before.position.values[failed].tolist(), before.plastic_strain.values[failed]
    was = {tuple(place): strain for place, strain in zip(places, strains, strict=True)}
    now = after.failed.values == 0
    assert now.sum() == failed.sum()
    grown = after.plastic_strain.values - after.plastic_strain_step.values
    for place, strain in zip(after.position.values[now].tolist(), grown[now].tolist(), strict=True):
        np.testing.assert_allclose(strain, was[tuple(place)], rtol=1e-12, atol=1e-15)


def test_a_step_killed_on_split_cells_ends_in_the_same_bytes(tmp_path):
    start = first_step(tmp_path, solver=LOOSE)
    whole, facts = mining_step(*start, tmp_path / "f.npz")
    assert facts["cell_splits"] > 1
    write_dataset(whole, tmp_path / "whole.nc")
    for generations in (1, 4):
        path = tmp_path / f"{generations}.checkpoint.npz"
        dying = KilledAfter(path, "inputs", pause=0.0)
        dying.left = generations
        with pytest.raises(Killed):
            mining_step(*start, tmp_path / "f.npz", dying)
        resumed, _ = mining_step(*start, tmp_path / "f.npz", Checkpoint(path, "inputs"))
        write_dataset(resumed, tmp_path / "resumed.nc")
        assert (tmp_path / "resumed.nc").read_bytes() == (tmp_path / "whole.nc").read_bytes()


def test_a_step_killed_with_as_many_cells_as_may_be_ends_in_the_same_bytes(tmp_path):
    """It knows that no more may be: asked once more it would have a row more of convergence."""
    grid = grid_of(HOLES[:1], rings=0)
    scene = adaptive_scene(refinement=ADAPTIVE | {"max_cells": len(grid.cell_level) + 30})
    whole, _ = run(scene, grid, tmp_path)
    path = tmp_path / "step.checkpoint.npz"
    dying = KilledAfter(path, "inputs", pause=0.0)
    dying.left = 1
    with pytest.raises(Killed):
        run(scene, grid, tmp_path, checkpoint=dying)
    assert Checkpoint(path, "inputs").read()["full"]
    resumed, _ = run(scene, grid, tmp_path, checkpoint=Checkpoint(path, "inputs"))
    assert whole.identical(resumed)


def test_any_number_of_threads_gives_the_same_bits(tmp_path):
    start, results = first_step(tmp_path, solver=LOOSE), []
    for threads in (1, min(2, numba.config.NUMBA_NUM_THREADS)):
        numba.set_num_threads(threads)
        results.append(mining_step(*start, tmp_path / "f.npz")[0])
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
    model = ground.model(grid, of_cell, Unsupported.none())
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
    assert len(RefinedCells.of(grid).flagged(model, state, brittle, nothing, 1000)[0]) == 0
    state.stress[brittle.coarse[0], 0] = -1e6
    assert len(RefinedCells.of(grid).flagged(model, state, brittle, nothing, 1000)[0])


def around_a_hole():
    """Rock around a hole, what of it may fail, and two of its cells: within the fine ones, and at their edge."""
    model = make_model(adaptive_scene(), grid_of(HOLES[:1], rings=3), HOLES[:1])
    brittle = find_brittle(model, model.volumes(0), 0, np.zeros(len(model.cell_nodes) + 1, int), np.empty(0, int))
    finest = np.flatnonzero(model.grid.cell_level == 3)
    reach = np.abs(model.grid.cell_center[finest] - [26.0, 40.0]).max(axis=1)
    return model, brittle, finest[(reach > 5.0) & (reach < 7.0)][0], finest[reach.argmax()]


def test_rock_at_the_edge_of_the_fine_cells_waits_for_a_split_that_is_worth_it():
    """One family at the edge of the fine cells, in a large mine and in a small one; rock within fails at once."""
    model, brittle, inside, edge = around_a_hole()
    grid, state = model.grid, model.virgin_state()
    fresh, now = np.array([inside, edge]), RefinedCells.of(grid)
    for cells, waiting in ((10**6, [edge]), (10, [inside, edge])):
        places, first = now.flagged(model, state, brittle, fresh, cells)
        assert np.array_equal(places, grid.cell_index[[edge]] >> 1)
        assert set(first) == set(fresh) - set(waiting)
    places, first = now.flagged(model, state, brittle, fresh[:1], 10)
    assert not len(places)
    assert np.array_equal(first, fresh[:1])


def test_little_rock_waits_without_a_split_while_another_look_follows(tmp_path, monkeypatch):
    """A family at the edge waits while it is little enough, rock within fails; a coarse cell near its strength counts
    as all the finest ones in it. In the end nothing has waited: no rock above strength is coarse."""
    model, brittle, inside, edge = around_a_hole()
    grid, state = model.grid, model.virgin_state()
    fresh, now = np.array([inside, edge]), RefinedCells.of(grid)
    places, first = now.flagged(model, state, brittle, fresh, 10**6, patience=1.0)
    assert not len(places)
    assert np.array_equal(first, [inside])
    assert len(now.flagged(model, state, brittle, fresh, 10**6, patience=0.9)[0])
    state.stress[brittle.coarse[0], 0] = -100e6
    parts = float(grid.cell_width[model.particles.cell[brittle.coarse[0]]]) ** 2
    assert not len(now.flagged(model, state, brittle, fresh, 10**6, patience=parts + 1.0)[0])
    assert len(now.flagged(model, state, brittle, fresh, 10**6, patience=parts + 0.9)[0])

    results = []
    for patience in (0.0, 0.1):
        monkeypatch.setattr(step_cells, "MAX_WAITING_SHARE", patience)
        results.append(run(adaptive_scene(solver=BRITTLE), grid_of(HOLES[:1], rings=0), tmp_path)[1])
    impatient, patient = results
    assert patient["cell_splits"] < impatient["cell_splits"]
    assert patient["truncated"] == impatient["truncated"] == 0
    assert patient["failed_volume"] == pytest.approx(impatient["failed_volume"], rel=0.05)


def test_a_grid_without_fine_cells_gets_them_where_rock_is_near_its_strength():
    """Nothing mined yet, as in a mine whose boundary is strained."""
    grid = build_grid(np.zeros(2), 8.0, np.array([4, 4]), 4, lambda level, index: np.zeros(len(index), bool), 0)
    model = make_model(adaptive_scene(mined=()), grid)
    brittle = find_brittle(model, model.volumes(0), 0, np.zeros(len(model.cell_nodes) + 1, int), np.empty(0, int))
    state = model.virgin_state()
    cell = np.flatnonzero((grid.cell_index == 8).all(axis=1))[0]
    state.stress[cell, 0] = -100e6
    places, _ = RefinedCells.of(grid).flagged(model, state, brittle, np.empty(0, np.int64), len(grid.cell_level))
    finer = split(grid, places, RINGS_SPLIT_AT_ONCE, 1)
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
            raise NoEquilibrium("never")
        return real(scheme, external, tolerance, reference, history)

    real = cascade.balance_split_cells
    monkeypatch.setattr(cascade, "balance_split_cells", no_rest)
    scene = adaptive_scene(solver=BRITTLE | {"collapse": "keep"})
    state, facts = run(scene, grid_of(HOLES[:1], rings=0), tmp_path)
    assert facts["collapsed"] == 1
    assert facts["cells"] == state.sizes["cell"]


def test_early_checks_save_cycles_and_fail_the_same_rock(tmp_path, monkeypatch):
    """From no ring of fine cells on, rock fails in cells that have been split at a small tolerance."""
    solver = BRITTLE | {"cascade_tolerance": 3e-2}
    found = {}
    for share in (0.0, cascade.EARLY_SHARE):
        monkeypatch.setattr(cascade, "EARLY_SHARE", share)
        _, found[share] = run(adaptive_scene(solver=solver), grid_of(HOLES[:1], rings=0), tmp_path)
    without, early = found.values()
    assert early["unbalanced_ratio"] <= BRITTLE["tolerance"]
    assert early["failed_volume"] == pytest.approx(without["failed_volume"], rel=0.02)
    assert early["iterations"] < without["iterations"]


def test_a_first_check_leaves_a_share_of_the_unbalanced_force_and_no_less_than_the_tolerance():
    class Halving:
        """Reaches each tolerance exactly, and notes it."""

        def __init__(self, ratio):
            self.ratio, self.asked = ratio, []

        def reach_equilibrium(self, external, tolerance, reference, history):
            self.asked.append(tolerance)
            self.ratio = min(self.ratio, tolerance)
            history.check(self.ratio, self.ratio)

    for ratio, tolerance, expected in ((1.0, 1e-5, 3e-3), (1e-3, 1e-5, 3e-4), (1e-3, 8e-4, 8e-4)):
        scheme = Halving(ratio)
        reached = cascade.approach(scheme, np.zeros((1, 2)), tolerance, 1e-2, 1.0, History(tolerance))
        assert reached == pytest.approx(expected)
        assert scheme.asked == [1e-2, reached]
