"""The stiffness that rock cells at a sharp edge of an opening need, from the singular field at the edge alone.

At an edge rock fills an angle w > 180 degrees, and displacement goes with r^l, l < 1 (Williams 1952). Cells whose
strain is nearly uniform cannot follow it. They hold too much energy, the opening releases too little, and the error is
of order 2 l in the size of the cells wherever else they are small. A factor on the stiffness of the cells around the
edge takes it away (Zenger and Gietl 1978; Egger, Ruede and Wohlmuth 2014), and it follows from the singular field: with
it, a patch of cells around the edge whose outer nodes move as the field does holds the energy of the field.

The patch is PATCH cells wide: at an opening four cells across it reaches half-way to the next edge. In a wider one the
factor is nearer to 1, since cells further away add errors of their own, of second order. Where nodes carry the motion
of both walls of an edge (edge_points.py), no inner node of such a patch can follow the field: its width is one cell.
"""

import functools
from dataclasses import dataclass

import numpy as np
import scipy  # imports its parts as they are used, which small stages would wait for

from mpm_core.grid.octree import all_cells
from mpm_core.model.particles import MASSIVE_BENDING_SHARE, bending_stiffness

MAX_POISSON_RATIO = 0.4
PATCH = 2  # cells; width of the patch, from the edge to its border
PATCH_OF_SHARED_NODES = 1  # cells; the same where nodes carry the motion of both walls
SECTORS = 3  # of the patch, each of rhombic cells: those of a lattice around a right-angled opening
GAUSS_POINTS = 12  # of the energy of the field, in each half of a sector
CORNERS = np.array([(0, 0), (1, 0), (1, 1), (0, 1)])  # of a cell, along the two sides of its sector


@dataclass(frozen=True)
class SingularField:
    """The field that opens a wedge of rock, symmetric to its bisector, x > 0; its shear modulus is 1.

    2 u = k phi - z conj(phi') - conj(psi), phi = z^l, psi = b z^l (Muskhelishvili), k = 3 - 4 nu in plane strain.
    """

    angle: float
    poisson_ratio: float
    exponent: float
    b: complex

    @classmethod
    def of(cls, angle: float, poisson_ratio: float) -> "SingularField":
        """The field in a wedge of this angle, radians, pi to 2 pi, whose faces are free of traction."""
        power, half = opening_exponent(angle), 0.5 * angle
        at_face = np.exp(1j * power * half) + power * np.exp(1j * (2.0 - power) * half)
        return cls(angle, poisson_ratio, power, -np.conj(at_face * np.exp(1j * power * half)))

    def displacement(self, z: np.ndarray) -> np.ndarray:
        """Displacement (k,) complex at places z (k,) complex, 0 at the edge."""
        power, edge = self.exponent, z == 0.0
        z = np.where(edge, 1.0, z)
        twice = (
            (3.0 - 4.0 * self.poisson_ratio) * z**power
            - z * np.conj(power * z ** (power - 1.0))
            - np.conj(self.b * z**power)
        )
        return np.where(edge, 0.0, 0.5 * twice)

    def density(self, z: np.ndarray) -> np.ndarray:
        """Energy density (k,) at places z (k,) complex."""
        power = self.exponent
        mean = 2.0 * (power * z ** (power - 1.0)).real
        shear = np.abs(np.conj(z) * power * (power - 1.0) * z ** (power - 2.0) + self.b * power * z ** (power - 1.0))
        return 0.5 * (1.0 - 2.0 * self.poisson_ratio) * mean**2 + 0.5 * shear**2

    def energy(self, start: float, width: float, size: float) -> float:
        """Energy in a rhombus with a corner at the edge, sides of this size, the first in direction start, radians, the
        other one width further: the density goes with r^(2 l - 2)."""
        power = self.exponent
        point, weight = np.polynomial.legendre.leggauss(GAUSS_POINTS)
        turn = 0.25 * width * np.concatenate([point + 1.0, point + 3.0])  # the outer sides meet half-way
        reach = size * np.sin(width) / np.maximum(np.sin(turn), np.sin(width - turn))
        density = self.density(np.exp(1j * (start + turn)))
        return float(np.sum(0.25 * width * np.tile(weight, 2) * reach ** (2.0 * power) * density)) / (2.0 * power)


def opening_exponent(angle: float) -> float:
    """Exponent l of the displacement r^l that opens a wedge of this angle, radians, pi to 2 pi (Williams 1952)."""
    return scipy.optimize.brentq(lambda power: np.sin(power * angle) + power * np.sin(angle), 0.4, 1.0)


def cell_stiffness(start: float, width: float, poisson_ratio: float) -> np.ndarray:
    """Stiffness (8, 8) of a rhombic cell of side 1 and shear modulus 1: of its uniform strain and its hourglass mode.

    Its sides: see SingularField.energy; its unknowns: both components at each of CORNERS.
    """
    lame = 2.0 * poisson_ratio / (1.0 - 2.0 * poisson_ratio)
    directions = np.array([start, start + width])
    sides = np.stack([np.cos(directions), np.sin(directions)], axis=1)
    slopes = np.linalg.solve(sides, (CORNERS - 0.5).T)  # (axis, corner), of the shape functions at the centre
    strain = np.zeros((3, 8))
    strain[0, 0::2], strain[1, 1::2], strain[2, 0::2], strain[2, 1::2] = slopes[0], slopes[1], slopes[1], slopes[0]
    elastic = np.array([[lame + 2.0, lame, 0.0], [lame, lame + 2.0, 0.0], [0.0, 0.0, 1.0]])
    mode = np.kron([0.25, -0.25, 0.25, -0.25], np.eye(2))
    bending = MASSIVE_BENDING_SHARE * float(bending_stiffness(np.array(lame), np.array(1.0)))
    return np.sin(width) * (strain.T @ elastic @ strain + bending * mode.T @ mode)


@functools.cache
def edge_factor(angle: float, poisson_ratio: float, patch: int = PATCH) -> float:
    """Factor on the stiffness of rock cells around an edge at which rock fills this angle, radians, pi to 2 pi.

    patch: its width, cells. 1 where the patch holds no more energy than the field. Of rock with a larger Poisson's
    ratio than MAX_POISSON_RATIO it is the factor of that: the patch is stiff there because its corners cannot move as
    rock does that keeps its volume, which no factor takes away.
    """
    poisson_ratio = min(poisson_ratio, MAX_POISSON_RATIO)
    field, width = SingularField.of(angle, poisson_ratio), angle / SECTORS
    corners = (all_cells((patch, patch))[:, None, :] + CORNERS).reshape(-1, 2)
    places, matrices, energy = [], [], 0.0
    for start in -0.5 * angle + width * np.arange(SECTORS):
        places.append(corners @ np.exp(1j * np.array([start, start + width])))
        matrices += patch**2 * [cell_stiffness(start, width, poisson_ratio)]
        energy += field.energy(start, width, patch)
    place, first, nodes = np.unique(np.concatenate(places).round(9), return_index=True, return_inverse=True)
    at_edge = (place[nodes] == 0.0).reshape(-1, 4).any(axis=1)
    rows = (2 * nodes.reshape(-1, 4, 1) + np.arange(2)).reshape(-1, 8)
    moves = field.displacement(place).view(float)  # both components of each node
    free = np.repeat(np.tile(corners.max(axis=1), SECTORS)[first] < patch, 2)

    def excess(factor: float) -> float:
        stiffness = np.zeros((len(moves), len(moves)))
        scaled = np.array(matrices) * np.where(at_edge, factor, 1.0)[:, None, None]
        np.add.at(stiffness, (rows[:, :, None], rows[:, None, :]), scaled)
        u = moves.copy()
        u[free] = np.linalg.solve(stiffness[np.ix_(free, free)], -stiffness[np.ix_(free, ~free)] @ u[~free])
        return 0.5 * float(u @ stiffness @ u) - energy

    return scipy.optimize.brentq(excess, 0.01, 1.0) if excess(1.0) > 0.0 else 1.0
