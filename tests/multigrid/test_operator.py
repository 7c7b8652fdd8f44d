"""The elastic operator against scheme `explicit`, which is the definition of the discretisation."""

import numba
import numpy as np
import pytest

from mpm_core.equilibrium.explicit_scheme import ExplicitScheme
from mpm_core.multigrid import stiffness
from mpm_core.multigrid.solver import ElasticSolver
from mpm_core.multigrid.stiffness import elastic_cells
from tests.mechanics.scenes import HOST, ball, box, excavation, grid_around, make_model, make_scene, uniform


def scene_with_everything(dimension: int, points: int, cut_cells: str, boundary="fixed", host=HOST):
    """A filled and an empty excavation in a multi-level grid whose base has odd sides; (model, volume)."""
    scene = make_scene(
        "xz" if dimension == 2 else None,
        host=host,
        stress=uniform(-10e6, -20e6, -30e6),
        excavations=[excavation(fill="fill", name="filled"), excavation(name="empty")],
        boundary=boundary,
        particles_per_cell=points,
        cut_cells=cut_cells,
    )
    shapes = [ball([21.3] * dimension, 6.2), box([30.0] * dimension, [38.7] * dimension)]
    grid = grid_around(shapes, (7, 6, 5)[:dimension], levels=3, coarse=10.0)
    model = make_model(scene, grid, shapes)
    return model, model.volumes(0)


def explicit_force(model, volume, motion):
    """Internal force (node, d) at free nodes of the stress that a motion of the nodes makes."""
    scheme = ExplicitScheme(model, model.virgin_state(), volume)
    scheme.body.displace(motion)
    return scheme.body.internal_force(), scheme


def solver_of(model, volume, scheme) -> ElasticSolver:
    free = scheme.body.free.at(model.node_position)
    cells = elastic_cells(model, volume, scheme.body.hourglass)
    return ElasticSolver(model.grid, model.cell_nodes, model.held, cells, free)


def operator_force(solver, motion, grid):
    """C^T K C of a motion (node, d), 0 at hanging nodes and held components."""
    values, forces = solver.to_rows(motion), solver.operator.zeros()
    solver.operator.apply(values, forces)
    forces[solver.finest.inverse_diagonal == 0.0] = 0.0
    result = np.empty_like(motion)
    solver.to_nodes(forces, result)
    result[grid.is_hanging] = 0.0
    return result


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize(("points", "cut_cells"), [(1, "mean"), (2, "mean"), (3, "whole"), (1, "subdivide")])
def test_forces_are_those_of_the_explicit_scheme(dimension, points, cut_cells):
    """Random motion of the free nodes: same forces to round-off, with hourglass stiffness, fill, void, cut cells."""
    model, volume = scene_with_everything(dimension, points, cut_cells)
    motion = np.random.default_rng(1).standard_normal(model.held.shape) * ~model.held
    motion[model.grid.is_hanging] = 0.0
    expected, scheme = explicit_force(model, volume, motion)
    solver = solver_of(model, volume, scheme)
    attached = scheme.body.mass > 0.0
    obtained = -operator_force(solver, motion * attached[:, None], model.grid)
    assert np.abs(obtained - expected).max() < 1e-13 * np.abs(expected).max()


@pytest.mark.parametrize("dimension", [2, 3])
def test_operator_is_symmetric_and_lets_rigid_bodies_move(dimension):
    """a . K b = b . K a, and no force for translation and rotation where no face is held."""
    model, volume = scene_with_everything(dimension, 1, "subdivide", boundary="free")
    solver = solver_of(model, volume, ExplicitScheme(model, model.virgin_state(), volume))
    rng = np.random.default_rng(2)
    a, b = rng.standard_normal((2, *model.held.shape))
    a[model.grid.is_hanging] = b[model.grid.is_hanging] = 0.0
    ka, kb = operator_force(solver, a, model.grid), operator_force(solver, b, model.grid)
    assert np.sum(a * kb) == pytest.approx(np.sum(b * ka), rel=1e-12)
    turned = np.roll(model.grid.node_position, 1, axis=1) * ([1.0, -1.0, 0.0][:dimension])
    turned = turned if dimension == 2 else turned[:, [0, 1, 2]]
    x = model.grid.node_position
    turned = np.zeros_like(x)
    turned[:, 0], turned[:, 1] = 3.0 - x[:, 1], x[:, 0]
    assert np.abs(operator_force(solver, turned, model.grid)).max() < 1e-12 * np.abs(ka).max() * np.abs(turned).max()


def test_threads_do_not_change_a_bit():
    """Solution with one thread and with two."""
    if numba.config.NUMBA_NUM_THREADS < 2:
        pytest.skip("one thread only")
    model, volume = scene_with_everything(3, 1, "mean")
    force = np.random.default_rng(3).standard_normal(model.held.shape)
    found = []
    for threads in (1, 2):
        numba.set_num_threads(threads)
        solver = solver_of(model, volume, ExplicitScheme(model, model.virgin_state(), volume))
        found.append(solver.solve(force, 1e-6, 20).displacement)
    assert np.array_equal(*found)


@pytest.mark.parametrize("cut_cells", ["mean", "subdivide"])
def test_row_sums_are_the_same_however_many_cells_are_at_once(cut_cells, monkeypatch):
    """The largest sum of sizes along the rows of a corner, of each cell's matrix."""
    model, volume = scene_with_everything(3, 1, cut_cells)
    cells = elastic_cells(model, volume, ExplicitScheme(model, model.virgin_state(), volume).body.hourglass)
    sums = np.abs(cells.parts.stiffness()).sum(axis=2).reshape(-1, 8, 3).max(axis=2)
    assert len(sums) > 20
    for number in (1, 7, 10_000):
        monkeypatch.setattr(stiffness, "CELLS_AT_ONCE", number)
        np.testing.assert_allclose(cells.row_sums(), sums, rtol=1e-12)
