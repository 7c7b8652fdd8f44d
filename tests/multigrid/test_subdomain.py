"""A part of the mine around fresh failures, the rest held still."""

import logging
from dataclasses import replace

import numba
import numpy as np
import pytest
import xarray as xr

from mpm_core.equilibrium import cascade, subdomain
from mpm_core.equilibrium.brittle import fail, find_brittle, new_failures
from mpm_core.equilibrium.cascade import run_generations
from mpm_core.equilibrium.convergence import History, norm
from mpm_core.equilibrium.multigrid_scheme import MultigridScheme
from mpm_core.equilibrium.subdomain import CUBE_HALVINGS
from mpm_core.grid.adjacency import face_neighbors
from mpm_core.grid.distorted_cells import DistortedCells, corner_offsets
from mpm_core.model.state import ARRAYS
from mpm_core.stages.checkpoint import Checkpoint
from mpm_core.stages.equilibrium_stages import elastic_stage, mining_step
from mpm_core.stages.external_forces import external_force
from tests.mechanics.scenes import (
    COULOMB,
    ball,
    excavation,
    grid_around,
    make_dataset,
    make_model,
    make_scene,
    uniform,
)

STRESS = uniform(-20e6, -14e6, -16e6)


@pytest.fixture(autouse=True)
def small_scenes(monkeypatch):
    """A part may be half of them, its border near."""
    monkeypatch.setattr(subdomain, "MAX_SURROUNDINGS_SHARE", 0.5)
    monkeypatch.setattr(subdomain, "MAX_BORDER_SHARE", 1.0)


def long_mine(dimension: int, **scene):
    """Two voids far apart in brittle rock, one of them filled, on 3 levels: (scene, shapes, grid)."""
    scene = make_scene(
        "xy" if dimension == 2 else None,
        host=COULOMB,
        stress=STRESS,
        excavations=[excavation(fill="fill"), excavation(name="other")],
        **scene,
    )
    shapes = [ball([12.0] + [18.0] * (dimension - 1), 3.0), ball([74.0] + [18.0] * (dimension - 1), 2.5)]
    return scene, shapes, grid_around(shapes, (22, *[9] * (dimension - 1)), levels=3, coarse=4.0, rings=2)


def with_failure(dimension: int, **scene):
    """That mine at rest, but for rock at the filled void that has just failed: (scheme, brittle, fresh, force)."""
    scene, shapes, grid = long_mine(dimension, **scene)
    model = make_model(scene, grid, shapes)
    volume, state = model.volumes(0), model.virgin_state()
    scheme, force = MultigridScheme(model, state, volume), external_force(model, 0)
    scheme.reach_equilibrium(force, 1e-9, norm(force), History(1e-9))
    brittle = find_brittle(model, volume, 0, *face_neighbors(grid))
    fresh = new_failures(model, state, brittle)
    fresh = fresh[model.particles.position[fresh, 0] < 30.0][:7]
    fail(scheme.body, brittle, fresh, 0, 1, 0)
    scheme.set_failed()
    return scheme, brittle, fresh, force


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize(("points", "boundary"), [(1, "traction"), (2, "fixed")])
def test_a_part_at_rest_is_at_rest_in_the_mine_but_for_its_border(dimension, points, boundary):
    """In the whole, only nodes that the part shares with other cells are unbalanced then; no other node has moved."""
    scheme, brittle, fresh, force = with_failure(dimension, particles_per_cell=points, boundary=boundary)
    before = scheme.body.state.displacement.copy()
    part = scheme.subdomain_around(brittle, fresh)
    own = scheme.scheme_of(part)
    assert len(part.cells) < 0.5 * len(scheme.body.model.cell_nodes)
    history = History(1e-9)
    own.reach_equilibrium(force[part.nodes], 1e-9, norm(force), history)
    assert history.iteration <= 60  # 45, 20, 10, 10; up to 1671 if coarse grids move the border
    own.body.commit()
    scheme.take_over(part)

    moved = np.flatnonzero((scheme.body.state.displacement != before).any(axis=1))
    assert set(moved) <= set(part.nodes[~part.model.held.any(axis=1)])
    assert len(moved) > 0.5 * len(part.nodes)
    scheme.body.update(0.0, np.flatnonzero(scheme.stale))
    scheme.body.advance(force, 0.0)
    free = part.nodes[~part.model.held.any(axis=1)]
    assert norm(scheme.body.unbalanced[free]) < 1.1e-9 * norm(force)
    assert norm(scheme.body.unbalanced) > 1e-8 * norm(force)


@pytest.mark.parametrize(("dimension", "cut_cells"), [(3, "mean"), (2, "subdivide")])
def test_tables_of_a_part_are_those_of_the_mine(dimension, cut_cells):
    """Each cell has the same place, corners, particles, neighbours in the part, and rock that may fail."""
    scheme, brittle, fresh, _ = with_failure(dimension, cut_cells=cut_cells)
    whole, state = scheme.body.model, scheme.body.state
    part = scheme.subdomain_around(brittle, fresh)
    model, tables = part.model, whole.particles
    assert 0 < part.model.particles.count < tables.count
    for name in ("cell_index", "cell_level"):
        np.testing.assert_array_equal(getattr(model.grid, name), getattr(whole.grid, name)[part.cells])
    np.testing.assert_array_equal(part.nodes[model.cell_nodes], whole.cell_nodes[part.cells])
    free = ~model.held.any(axis=1)
    own, parents = model.grid.node_parents[free], whole.grid.node_parents[part.nodes][free]
    assert (own >= 0).any()
    np.testing.assert_array_equal(own >= 0, parents >= 0)
    np.testing.assert_array_equal(part.nodes[own[own >= 0]], parents[own >= 0])
    for name in ("excavation", "material", "position", "spacing", "full_volume", "sample"):
        np.testing.assert_array_equal(getattr(model.particles, name), getattr(tables, name)[part.particles])
    np.testing.assert_array_equal(part.cells[model.particles.cell], tables.cell[part.particles])
    np.testing.assert_array_equal(model.volumes(0), part.volume)
    np.testing.assert_array_equal(replace(model).step_stiffness, model.step_stiffness)  # a copy finds it anew
    for name, array in ARRAYS.items():
        if array.dims[0] == "particle" and name != "cell":
            np.testing.assert_array_equal(getattr(part.state, name), getattr(state, name)[part.particles])
    for kind in ("sound", "sliver"):
        mine = getattr(brittle, kind)
        np.testing.assert_array_equal(part.particles[getattr(part.brittle, kind)], mine[np.isin(mine, part.particles)])
    for cell in range(0, len(part.cells), 7):
        first, end = part.brittle.neighbor_start[cell : cell + 2]
        first_of_all, end_of_all = brittle.neighbor_start[part.cells[cell] : part.cells[cell] + 2]
        beside = brittle.neighbors[first_of_all:end_of_all]
        np.testing.assert_array_equal(
            part.cells[part.brittle.neighbors[first:end]], beside[np.isin(beside, part.cells)]
        )


def test_hourglass_patterns_of_a_part_are_those_of_the_mine():
    """Of every third cell with one particle, bent at random; the part has some of them."""
    scheme, brittle, fresh, _ = with_failure(3)
    whole = scheme.body.model
    cells = np.arange(0, len(whole.cell_nodes), 3, dtype=np.int32)
    corners = corner_offsets(3) + np.random.default_rng(3).uniform(-0.2, 0.2, (len(cells), 8, 3))
    scheme.model = replace(whole, particles=replace(whole.particles, distorted=DistortedCells(cells, corners)))
    model = scheme.subdomain_around(brittle, fresh).model
    assert 0 < len(model.particles.distorted.cell) < len(cells)
    np.testing.assert_array_equal(replace(model).hourglass_patterns, model.hourglass_patterns)


def test_no_part_of_most_of_a_mine():
    """Rock that fails everywhere comes to rest in the whole."""
    scheme, brittle, _, _ = with_failure(2)
    assert scheme.subdomain_around(brittle, brittle.sound) is None


def test_rock_near_the_border_of_a_part_waits_for_the_whole(monkeypatch):
    """2-D, a lone cell, border two cubes away: its neighbour may fail, a cell in the outermost cubes may not.

    With nothing else to fail the cascade in the part ends, and what waits has not failed.
    """
    monkeypatch.setattr(subdomain, "MAX_BORDER_SHARE", 0.02)
    monkeypatch.setattr(subdomain, "REACH_CELLS", (8,))
    scheme, brittle, fresh, force = with_failure(2)
    part = scheme.subdomain_around(brittle, fresh[:1])
    index, cell = part.model.grid.cell_index >> CUBE_HALVINGS[2], part.model.particles.cell
    whole = scheme.body.model
    away = np.abs(index - (whole.grid.cell_index[whole.particles.cell[fresh[0]]] >> CUBE_HALVINGS[2])).max(axis=1)
    intact = part.state.failed < 0
    here = whole.grid.cell_center[whole.particles.cell[fresh[0]]]
    distance = np.linalg.norm(part.model.grid.cell_center[cell] - here, axis=1)
    near, far = np.argmin(np.where(intact, distance, np.inf)), np.flatnonzero(intact & (away[cell] == 2))[0]
    assert part.far_from_border(np.array([near, far])).tolist() == [near]
    monkeypatch.setattr(cascade, "new_failures", lambda *_: np.array([far]))
    own, history = scheme.scheme_of(part), History(1e-9)
    run_generations(own, part.brittle, force[part.nodes], 1e-9, norm(force), 0, history, part)
    assert part.state.failed[far] == -1
    assert history.rows[-1][-1] == 0


def test_no_part_with_a_border_beside_a_ring_that_fails(monkeypatch):
    """Rock all round a void, 10 cells wide: 2-D asks for a border 30 cells away."""
    monkeypatch.setattr(subdomain, "MAX_BORDER_SHARE", 0.02)
    scheme, brittle, _, _ = with_failure(2)
    ring = brittle.sound[scheme.body.model.particles.position[brittle.sound, 0] < 20.0]
    assert scheme.subdomain_around(brittle, ring) is None


@pytest.mark.parametrize("dimension", [2, 3])
def test_failure_spreads_alike_with_and_without_parts(dimension, monkeypatch, tmp_path, caplog):
    """Coulomb switched on: rest to the same tolerance with nothing above strength; failed volume within 2 %."""
    caplog.set_level(logging.INFO)
    scene, shapes, grid = long_mine(dimension, solver={"scheme": "multigrid", "tolerance": 1e-6})
    grid = make_dataset(scene, grid, shapes)
    elastic, _ = elastic_stage(scene, grid, tmp_path / "state.npz")
    volumes = []
    for largest in (0.5, 0.0):
        monkeypatch.setattr(subdomain, "MAX_SURROUNDINGS_SHARE", largest)
        caplog.clear()
        _, facts = mining_step(scene, grid, elastic, tmp_path / "state.npz")
        assert ("in a subdomain of" in caplog.text) == (largest > 0.0)
        assert facts["unbalanced_ratio"] <= 1e-6
        volumes.append(facts["failed_volume"])
    assert volumes[0] == pytest.approx(volumes[1], rel=0.02)
    assert volumes[0] > 0.0


class Killed(Exception):
    """The stage is gone."""


class Dying(Checkpoint):
    """Saves whenever it may, and kills the stage at a save."""

    saves, last_save = 0, np.inf

    def save(self, *arguments):
        self.cost = 0.0
        super().save(*arguments)
        self.saves += 1
        if self.saves == self.last_save:
            raise Killed


def test_a_step_with_parts_is_the_same_on_two_threads_and_after_a_kill(tmp_path):
    """Killed between two rounds of the whole mine; parts are begun anew only where none was under way."""
    scene, shapes, grid = long_mine(2, solver={"scheme": "multigrid", "tolerance": 1e-6})
    grid = make_dataset(scene, grid, shapes)
    elastic, _ = elastic_stage(scene, grid, tmp_path / "state.npz")

    def step(checkpoint):
        return mining_step(scene, grid, elastic, tmp_path / "state.npz", checkpoint)[0]

    counting = Dying(tmp_path / "step.npz", "key", pause=0.0)
    once = step(counting)
    assert counting.saves > 2
    numba.set_num_threads(min(2, numba.config.NUMBA_NUM_THREADS))
    xr.testing.assert_identical(once, step(None))
    dying = Dying(tmp_path / "step.npz", "key", pause=0.0)
    dying.last_save = counting.saves - 1
    with pytest.raises(Killed):
        step(dying)
    going_on = Dying(tmp_path / "step.npz", "key", pause=0.0)
    xr.testing.assert_identical(once, step(going_on))
    assert going_on.saves == 1
