"""Bodies stiffer than the host by up to 1e8: cycles, blocks instead of single nodes, a closed form, the scheme."""

import logging

import numpy as np
import pytest

from mpm_core.equilibrium.multigrid_scheme import MultigridScheme
from mpm_core.multigrid import stiff_bodies
from mpm_core.multigrid.coarsening import finest_grid
from mpm_core.multigrid.solver import ElasticSolver
from mpm_core.multigrid.stiff_bodies import StiffBodies, host_shear
from mpm_core.settings import lame_parameters
from tests.mechanics.scenes import COULOMB, HOST, ball, box, excavation, grid_around, make_model, make_scene, uniform
from tests.multigrid.test_iterations import MODULUS, cells_of, solve
from tests.multigrid.test_multigrid_scheme import at_rest

MOST = 20  # iterations to 1e-6; the issue asks for 25


def bodies_2_or_3(kind: str, dimension: int):
    """(grid, cells of the stiff bodies); edges of 1, in a domain of 48 or 16 cells."""
    size = {2: 48.0, 3: 16.0}[dimension]
    middle = np.full(dimension, size / 2)
    across = np.eye(dimension)[-1]
    plate = middle * (1 - across)
    shapes = {
        "ball": [ball(middle + 0.3, size / 6)],
        "block across coarse cells": [box(middle - size / 6 + 1, middle + size / 6 + 2)],
        "dyke of one cell": [box(0.4 * plate + middle * across, 1.6 * plate + (middle + 1) * across)],
        "dyke of two cells": [box(0.4 * plate + (middle - 1) * across, 1.6 * plate + (middle + 1) * across)],
        "dyke through the domain": [box(-1 + (middle + 1) * across, plate * 4 + (middle + 3) * across)],
        "blocks a cell apart": [box(middle - 5, middle), box(middle + 1, middle + 5)]
        + [box(middle + (6 * k - 5) * across + np.eye(dimension)[0] * 1, middle + 6 * k * across) for k in (2,)],
        "touching a held face": [box(middle * 0.6 * (1 - np.eye(dimension)[0]), middle * 1.2)],
    }[kind]
    grid = grid_around([], (int(size),) * dimension, 1, 1.0)
    return grid, np.any([shape(grid.cell_center) for shape in shapes], axis=0)


KINDS = [
    "ball", "block across coarse cells", "dyke of one cell", "dyke of two cells", "dyke through the domain",
    "blocks a cell apart", "touching a held face",
]  # fmt: skip


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("dimension", [2, 3])
def test_cycles_do_not_grow_with_stiffness(dimension, kind):
    """1e2 to 1e8 times the host, a tunnel beside the body, forces on all nodes."""
    grid, stiff = bodies_2_or_3(kind, dimension)
    assert stiff.sum() > 4
    tunnel = ball(np.full(dimension, 4.0), 1.5)(grid.cell_center)
    for ratio in (1e2, 1e4, 1e6, 1e8):
        modulus = np.where(tunnel, 0.0, np.where(stiff, ratio * MODULUS, MODULUS))
        solution = solve(grid, cells_of(grid, modulus))
        assert solution.ratio <= 1e-6
        assert solution.iterations <= MOST, ratio


@pytest.mark.parametrize("kind", ["ball", "dyke of two cells", "blocks a cell apart"])
def test_blocks_of_nodes_where_single_ones_are_too_many(kind, monkeypatch):
    """Larger bodies: a block of nodes moves as one, still within the bound."""
    grid, stiff = bodies_2_or_3(kind, 3)
    monkeypatch.setattr(stiff_bodies, "MAX_FACTOR_ENTRIES", 30_000)
    tried, dissect = [], stiff_bodies.dissect
    monkeypatch.setattr(stiff_bodies, "dissect", lambda *of: tried.append(len(of[1])) or dissect(*of))
    for ratio in (1e2, 1e8):
        solution = solve(grid, cells_of(grid, np.where(stiff, ratio * MODULUS, MODULUS)))
        assert solution.ratio <= 1e-6
        assert solution.iterations <= 25, ratio
    assert tried[-1] < 0.3 * tried[0]  # blocks, after single nodes


@pytest.mark.parametrize("scale", [1e-3, 1.0, 777.0])
def test_host_is_what_fills_most_of_the_volume_whatever_the_units(scale):
    """A refined stiff body has most of the cells, the host most of the volume; soft fill makes no body of the rock."""
    body = ball([8.0, 8.0, 8.0], 2.5)
    grid = grid_around([body], (4, 4, 4), 3, 4.0)
    inside = body(grid.cell_center)
    level = finest_grid(grid, grid.vtk_nodes)
    shear = cells_of(grid, np.ones(len(inside))).constants[:, 1] / grid.cell_size[0] * 2.0
    stiff = scale * np.where(inside, 100.0, 1.0) * shear
    soft = scale * np.where(inside, 0.01, 1.0) * shear
    least = stiff[~inside].min() / level.cell_width[~inside][stiff[~inside].argmin()]
    assert least <= host_shear(level, stiff) * (1 + 1e-9) <= 2.0 * least * (1 + 1e-9) ** 2
    assert host_shear(level, soft) == np.inf


@pytest.mark.parametrize("points", [1, 2])
def test_matrices_of_cells_are_those_of_the_operator(points):
    """The stiffness of the blocks, single nodes here, against forces of the elastic operator; hanging nodes, too."""
    body = ball([8.0, 8.0, 8.0], 3.0)
    grid = grid_around([ball([9.5, 8.0, 8.0], 1.5)], (8, 8, 8), 2, 2.0)
    stiff = body(grid.cell_center)
    cells = cells_of(grid, np.where(stiff, 1e3, 1.0), points=points)
    order = [0, 1, 3, 2, 4, 5, 7, 6]
    held = np.zeros((len(grid.node_index), 3), bool)
    held[grid.boundary_nodes(0, 0)] = True
    solver = ElasticSolver(grid, np.ascontiguousarray(grid.vtk_nodes[:, order]), held, cells)
    bodies = solver.cycle.bodies
    motion, forces, solution = (solver.operator.zeros() for _ in range(3))
    motion[bodies.elements] = np.random.default_rng(0).standard_normal(len(bodies.elements))
    solver.operator.apply(motion.copy(), forces)
    bodies.solve(forces, solution)
    np.testing.assert_allclose(solution, motion, atol=1e-9)


@pytest.mark.parametrize("ratio", [1e2, 1e4, 1e8])
@pytest.mark.parametrize("shear", [False, True])
def test_stress_in_a_stiff_cylinder_is_eshelbys(ratio, shear):
    """Plane strain, far strain held: the stress inside over the far one, G1 of the host, G2 of the cylinder.

    All-round G2 (k1 + 1) / (2 G2 + G1 (k2 - 1)), in shear G2 (k1 + 1) / (k1 G2 + G1), k = 3 - 4 nu (Eshelby 1957 in the
    form of Dundurs 1967). Radius 6, domain 192, cells of 1/2 about the cylinder: 3 % (5 % in a domain of 96, whose
    sides are held). The forces are those of
    host rock, so a residual in them is one of the host, not of the body.
    """
    radius, size, poisson_ratio = 6.0, 192, 0.25
    middle = np.full(2, size / 2)
    disc = ball(middle, radius)
    grid = grid_around([ball(middle, radius + 2)], (size // 4,) * 2, 4, 4.0)
    inside = disc(grid.cell_center)
    held = np.zeros((len(grid.node_index), 2), bool)
    for axis in range(2):
        for side in range(2):
            held[grid.boundary_nodes(axis, side)] = True
    corners = np.ascontiguousarray(grid.vtk_nodes[:, [0, 1, 3, 2]])
    cells = cells_of(grid, np.where(inside, ratio, 1.0))
    solver = ElasticSolver(grid, corners, held, cells)
    place = grid.node_position - middle
    far = place * ([1.0, -1.0] if shear else [1.0, 1.0])
    far[np.isin(np.arange(len(place)), grid.vtk_nodes[inside])] = 0.0  # the body unstrained: no forces in it
    motion, forces = solver.operator.zeros(), solver.operator.zeros()
    rows = solver.finest.siblings.node_row[:, None] * solver.operator.width + np.arange(2)
    motion[rows] = far
    solver.operator.apply(motion, forces)
    pull = np.empty_like(far)
    forces *= -1.0
    for k in range(2):
        pull[:, k] = forces[rows[:, k]]
    solution = solver.solve(pull, 1e-8, 60)
    assert solution.ratio <= 1e-8
    solver.operator.spread(solution.displacement)
    moved = far + solution.displacement[rows]
    lame, modulus = lame_parameters(1, poisson_ratio)
    slope = np.array([[-1, -1], [1, -1], [-1, 1], [1, 1]]) / (2 * grid.cell_size[inside, None, None])
    strain = np.einsum("cki,ckj->cij", moved[corners[inside]], slope)
    along = np.trace(strain, axis1=1, axis2=2)
    area = grid.cell_size[inside] ** 2
    kappa = 3 - 4 * poisson_ratio
    if shear:
        stress = ratio * modulus * (strain[:, 0, 0] - strain[:, 1, 1])
        expected = 2 * modulus * ratio * (kappa + 1) / (kappa * ratio + 1)
    else:
        stress = ratio * (lame + modulus) * along
        expected = 2 * (lame + modulus) * ratio * (kappa + 1) / (2 * ratio + kappa - 1)
    assert np.average(stress, weights=area) == pytest.approx(expected, rel=0.03)


def scheme_scene(dimension: int, ratio: float, host: dict):
    """A tunnel through rock beside a stiff dyke and a stiff ball; (model, volume, cells of both (cell,))."""
    stiff = HOST | {"youngs_modulus": HOST["youngs_modulus"] * ratio}
    scene = make_scene(
        "xy" if dimension == 2 else None,
        host=host,
        stress=uniform(-30e6, -21e6, -24e6),
        excavations=[excavation()],
        materials={"host": host, "dyke": stiff},
        rock_bodies=[{"material": "dyke"}],
    )
    shapes = [ball([16.0] * dimension, 3.0)]
    grid = grid_around(shapes, (8,) * dimension, levels=3, coarse=4.0, rings=2)
    center = grid.cell_center
    body = (abs(center[:, 0] - 21.5) < 1.0) | ball([9.0] * dimension, 3.0)(center)
    model = make_model(scene, grid, shapes, body=np.where(body, 0, -1).astype(np.int16))
    return model, model.volumes(0), body


@pytest.mark.parametrize("dimension", [2, 3])
def test_scheme_beside_stiff_bodies(dimension, caplog):
    """1e8: no explicit steps; a hundredth of the tolerance moves rock by a ten thousandth: soft rock is solved, too."""
    displacements = []
    for tolerance in (1e-5, 1e-7):
        model, volume, _ = scheme_scene(dimension, 1e8, HOST)
        with caplog.at_level(logging.WARNING):
            scheme, history = at_rest(MultigridScheme, model, volume, model.virgin_state(), tolerance)
        assert not caplog.records
        assert history.iteration <= 25
        displacements.append(scheme.body.state.displacement)
    largest = np.abs(displacements[1]).max()
    assert np.abs(displacements[0] - displacements[1]).max() < 1e-4 * largest


@pytest.mark.parametrize("dimension", [2, 3])
def test_failed_rock_beside_stiff_bodies(dimension, caplog):
    """Anderson acceleration has the same V-cycle: no explicit steps, and no more cycles at 1e8 than 1.5 times 1's."""
    host = COULOMB | {"cohesion": {"intact": 5e6, "residual": 5e6}}
    cycles = []
    for ratio in (1.0, 1e8):
        model, volume, body = scheme_scene(dimension, ratio, host)
        state = model.virgin_state()
        near = (model.grid.cell_level == 2) & ~body
        state.failed[near[model.particles.cell] & (volume > 0.0)] = 0
        with caplog.at_level(logging.WARNING):
            scheme, history = at_rest(MultigridScheme, model, volume, state, tolerance=1e-5)
        assert not caplog.records
        assert (scheme.body.state.later_strain != 0.0).any()
        cycles.append(history.iteration)
    assert cycles[1] <= 1.5 * cycles[0] + 5


def test_bodies_are_absent_without_contrast():
    """Uniform rock with a tunnel: single precision, no blocks."""
    grid, stiff = bodies_2_or_3("ball", 2)
    held = np.zeros((len(grid.node_index), 2), bool)
    solver = ElasticSolver(grid, grid.vtk_nodes, held, cells_of(grid, np.where(stiff, 0.0, MODULUS)))
    assert solver.cycle.bodies is None
    assert solver.finest.residual.dtype == np.float32
    solver = ElasticSolver(grid, grid.vtk_nodes, held, cells_of(grid, np.where(stiff, 1e4 * MODULUS, MODULUS)))
    assert isinstance(solver.cycle.bodies, StiffBodies)
    assert solver.finest.residual.dtype == np.float64
