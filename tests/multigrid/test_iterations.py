"""Conjugate gradients with the V-cycle: iterations to 1e-6 do not depend on stiffness, grid or quadrature.

Small grids; the bounds are those that the scheme promises for grids of any size.
"""

import numpy as np
import pytest

from mpm_core.multigrid.solver import ElasticSolver, Solution
from mpm_core.multigrid.stiffness import ElasticCells
from mpm_core.settings import lame_parameters
from tests.mechanics.scenes import box, grid_around

MODULUS = 57e9  # Pa


def tunnel_and_stope(base, levels: int, coarse: float = 8.0):
    """A grid around a long and a compact excavation near its middle; (grid, cells inside (cell,) bool)."""
    size = np.array(base) * coarse
    middle = np.floor(size / 2)
    width = np.full(len(base), 2.0)
    along = np.where(np.arange(len(base)) == int(np.argmax(size)), 0.3 * size, 1.0)
    shapes = [box(middle - 2 * width, middle + 2 * width), box(middle + 3 - along, middle + 3 + along)]
    grid = grid_around(shapes, base, levels, coarse)
    return grid, np.any([shape(grid.cell_center) for shape in shapes], axis=0)


def cells_of(grid, modulus, poisson_ratio=0.25, points=1, share=1.0) -> ElasticCells:
    """Constants by cell from Young's modulus (cell,) or one number, Pa."""
    dimension, size = grid.dimension, grid.cell_size
    lame, shear = lame_parameters(modulus, poisson_ratio)
    scale = share * size**dimension * (2 / size / 2**dimension) ** 2
    constants = np.stack([lame * scale, shear * scale, 0 * scale, 0 * scale], axis=1)
    if points == 1:
        constants[:, 2] = modulus / (1 - poisson_ratio**2) / 18 * scale  # a sixth of that of exact bending
    else:
        constants[:, 3] = (1 - 1 / points**2) / 3
    none = np.empty(0, np.int64)
    return ElasticCells(constants, none, None, none, np.empty((0, 1, 4)))


def solve(grid, cells, held_faces=None, seed=1) -> Solution:
    """Displacement under random nodal forces, which excite every motion; all faces held unless told."""
    held = np.zeros((len(grid.node_index), grid.dimension), bool)
    for axis in range(grid.dimension):
        for side in range(2):
            if held_faces is None or (axis, side) in held_faces:
                held[grid.boundary_nodes(axis, side)] = True
    order = [0, 1, 3, 2, 4, 5, 7, 6][: 1 << grid.dimension]
    solver = ElasticSolver(grid, np.ascontiguousarray(grid.vtk_nodes[:, order]), held, cells)
    force = np.random.default_rng(seed).standard_normal(held.shape)
    return solver.solve(force, 1e-6, 40)


@pytest.mark.parametrize(("base", "levels"), [((5, 6, 5), 4), ((37, 23), 3)])
@pytest.mark.parametrize("contrast", [1.0, 1e2, 1e4, 1e8, np.inf])
def test_stiffness_contrast(base, levels, contrast):
    """A filled excavation this much softer than the rock, down to an empty one."""
    grid, inside = tunnel_and_stope(base, levels)
    cells = cells_of(grid, np.where(inside, MODULUS / contrast, MODULUS))
    solution = solve(grid, cells)
    assert solution.ratio <= 1e-6
    assert solution.iterations <= 12


@pytest.mark.parametrize("contrast", [8.0, 12.0, 100.0, np.inf])
@pytest.mark.parametrize("shift", [0, 1])
@pytest.mark.parametrize("pillars", [False, True])
@pytest.mark.parametrize(("dimension", "base"), [(2, 256), (3, 24)])
def test_voids_of_one_cells_thickness(dimension, base, pillars, shift, contrast):
    """A slot or a slab over six tenths of the domain, whole or with pillars, empty or filled: 154 and 14 cells long."""
    solve_thin_void(dimension, base, pillars, shift, contrast)


@pytest.mark.parametrize(("dimension", "base", "most"), [(2, 64, 12), (2, 512, 12), (3, 48, 13)])
def test_thin_voids_of_any_length(dimension, base, most):
    """38 and 308 cells, 28 by 28 cells: coarser grids cannot show them. A cell in space twists more easily than it
    bends, which costs an iteration."""
    solve_thin_void(dimension, base, False, 0, np.inf, most)


def solve_thin_void(dimension, base, pillars, shift, contrast, most=12):
    """At most 12 iterations. shift: cells by which the void lies higher; contrast: of rock over its fill."""
    middle, reach, size = 4.0 * base, 2.4 * base, 8.0
    low, high = middle + 2.0 + size * shift, middle + 4.0 + size * shift
    shape = box(
        np.array([middle - reach] * (dimension - 1) + [low]), np.array([middle + reach] * (dimension - 1) + [high])
    )
    grid = grid_around([shape], (base,) * dimension, 1, size)
    inside = shape(grid.cell_center)
    assert len(np.unique(grid.cell_index[inside, -1])) == 1
    if pillars:
        inside &= grid.cell_index[:, 0] % 3 != 0
    solution = solve(grid, cells_of(grid, np.where(inside, MODULUS / contrast, MODULUS)))
    assert solution.ratio <= 1e-6
    assert solution.iterations <= most


@pytest.mark.parametrize(
    ("base", "levels"),
    [((16, 16, 16), 1), ((7, 11, 5), 2), ((13, 5, 7), 3), ((30, 3, 4), 3), ((3, 3, 3), 5), ((2, 3, 2), 6),
     ((61, 67), 1), ((37, 23), 3), ((101, 7), 2), ((5, 5), 6), ((128, 128), 1)],
)  # fmt: skip
def test_base_dimensions_and_levels(base, levels):
    """Odd, prime, long and thin bases; 1 to 6 levels; 2-D, where the stope is a slot one cell thick, and 3-D."""
    grid, inside = tunnel_and_stope(base, levels)
    solution = solve(grid, cells_of(grid, np.where(inside, 0.0, MODULUS)))
    assert solution.ratio <= 1e-6
    assert solution.iterations <= 12


@pytest.mark.parametrize(
    ("poisson_ratio", "points", "most"),
    [(0.0, 1, 12), (0.4, 1, 12), (0.45, 1, 15), (0.45, 2, 15), (0.25, 3, 12)],
)
def test_poisson_ratio_and_particles(poisson_ratio, points, most):
    """The smoother is chosen for the slowest short wave."""
    grid, inside = tunnel_and_stope((5, 4, 6), 3)
    cells = cells_of(grid, np.where(inside, 0.0, MODULUS), poisson_ratio, points)
    solution = solve(grid, cells)
    assert solution.ratio <= 1e-6
    assert solution.iterations <= most


def test_cut_cells():
    """Every cell near the excavation has a share of 3 to 100 % of its volume."""
    grid, inside = tunnel_and_stope((5, 6, 5), 3)
    share = np.where(grid.cell_level == 2, np.random.default_rng(0).uniform(0.03, 1.0, len(inside)), 1.0)
    solution = solve(grid, cells_of(grid, np.where(inside, 0.0, MODULUS), share=share))
    assert solution.ratio <= 1e-6
    assert solution.iterations <= 12


@pytest.mark.parametrize("base", [(8, 8, 8), (7, 5, 9)])
def test_free_faces(base):
    """Held on one face only; the domain ends inside a coarse cell where a base side is odd."""
    grid, inside = tunnel_and_stope(base, 2)
    solution = solve(grid, cells_of(grid, np.where(inside, 0.0, MODULUS)), held_faces={(2, 0)})
    assert solution.ratio <= 1e-6
    assert solution.iterations <= 12
