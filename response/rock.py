"""The rock of a state at any point: which cell and particle are there, whether they are open, failed or intact, and how
far they have moved."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from common.voigt import tensor_from_voigt
from mpm_core.files.state_datasets import read_grid
from mpm_core.geometry.inside import SAMPLES_PER_CELL
from mpm_core.grid.adjacency import NO_CELL, holding_cells
from mpm_core.grid.mesh import BIT_ORDER, EDGE_CORNERS

OUTSIDE, MINED, INTACT, FAILED = range(4)  # What is at a point. Rock that has fallen counts as failed.
NEWTON_STEPS = 6  # For the place in a distorted cell; its corners are moved by less than half of its edge.
ROUND_OFF = 1e-9  # Edges of a cell by which the corners of a cube may seem to be moved.
FACE = 1e-6  # Finest cells by which a point on the domain's upper face may be outside of it.
CONVERGED = 1e-6  # Edges of a cell by which a place may be off.
MIN_JACOBIAN = 1e-3  # Below it a step of Newton's method would lead anywhere.
MAX_CONTINUED = 0.5  # Edges of a cell by which its functions are continued beyond it.
VARIABLES = {
    *("cell_origin", "cell_size", "cell_level", "cell_nodes", "cell_body", "node_position", "node_parents"),
    *("cell", "volume", "excavation", "position", "failed", "stress", "strength_factor", "node_displacement"),
    *("loose_cell", "loose_samples"),
}
"""Variables of a state that Rock reads."""


def is_computed(state: xr.Dataset) -> bool:
    """False for the state of a step after a collapse: it is that of the step before, and nothing is mined in it."""
    return bool(state.attrs.get("computed", 1))


@dataclass(frozen=True)
class Voids:
    """Parts of finest cells that excavations have mined.

    code (k,) int64 ascending, one for each cell; samples (k,) uint64, one bit for each of its 64 sub-cells; shape (d,):
    finest cells of the domain along each axis.
    """

    code: NDArray
    samples: NDArray
    shape: NDArray

    @classmethod
    def of(cls, grid: xr.Dataset, is_mined: NDArray) -> "Voids":
        """Of the excavations of grid.nc that have been mined, and filled or not, is_mined (excavation,) bool."""
        axes, edge = axes_of(grid), float(grid.attrs["fine_cell"])
        lower, upper = (np.asarray(grid.attrs[f"domain_{end}"])[axes] for end in ("lower", "upper"))
        shape = np.rint((upper - lower) / edge).astype(np.int64)
        own = np.flatnonzero(is_mined[grid["piece_excavation"].values])
        place = np.rint((grid["piece_origin"].values[own][:, axes] - lower) / edge).astype(np.int64)
        code, row = np.unique(np.ravel_multi_index(place.T, shape), return_inverse=True)
        samples = np.zeros(len(code), np.uint64)
        np.bitwise_or.at(samples, row, grid["piece_samples"].values[own])
        return cls(code, samples, shape)

    def samples_of(self, cell: NDArray) -> NDArray:
        """Mined parts (n,) uint64 of finest cells (n, d), counted from the lower corner of the domain."""
        if not len(self.code):
            return np.zeros(len(cell), np.uint64)
        code = np.ravel_multi_index(cell.T, self.shape)
        row = np.minimum(np.searchsorted(self.code, code), len(self.code) - 1)
        return np.where(self.code[row] == code, self.samples[row], np.uint64(0))

    def hold(self, place: NDArray) -> NDArray:
        """True (n,) where points (n, d), in finest cells from the lower corner of the domain, are in an opening."""
        dimension = len(self.shape)
        per_edge = round(SAMPLES_PER_CELL ** (1 / dimension))
        cell = np.clip(np.floor(place).astype(np.int64), 0, self.shape - 1)
        sub_cell = np.clip(((place - cell) * per_edge).astype(np.int64), 0, per_edge - 1)
        bit = (sub_cell @ per_edge ** np.arange(dimension)).astype(np.uint64)
        return ((self.samples_of(cell) >> bit) & np.uint64(1)).astype(bool)


def axes_of(dataset: xr.Dataset) -> list[int]:
    """Axes of the computation: all three, or the two of a mine in plane strain."""
    plane = dataset.attrs["plane"]
    return [0, 1, 2] if plane == "none" else ["xyz".index(axis) for axis in plane]


class Rock:
    """A state (elastic.nc or steps/<step>.nc) and the openings that it has."""

    def __init__(self, state: xr.Dataset, voids: Voids):
        self.state, self.voids, self.axes = state, voids, axes_of(state)
        self.grid = read_grid(state)[0]
        self.lower, self.edge = self.grid.origin, float(state.attrs["fine_cell"])

    @cached_property
    def particle_of_cell(self) -> NDArray:
        """Particle of rock that each cell has (cell,); -1 where all rock of the cell is mined or has fallen.

        Of several particles of a cell it is the first that failed, else the first: rock fails by cells.
        """
        volume, cell = self.state["volume"].values, self.state["cell"].values
        found = np.full(len(self.grid.cell_level), -1)
        rock = np.flatnonzero((volume > 0.0) & (self.state["excavation"].values < 0))
        order = rock[np.lexsort((~self.failed[rock], cell[rock]))]
        cells, first = np.unique(cell[order], return_index=True)
        found[cells] = order[first]
        return found

    @cached_property
    def fell(self) -> NDArray:
        """True (cell,) for cells from which rock has come loose and fallen."""
        fell = np.zeros(len(self.grid.cell_level), bool)
        if "loose_cell" in self.state:
            fell[self.state["loose_cell"].values] = True
        return fell

    @cached_property
    def fallen_samples(self) -> NDArray:
        """Parts of each cell that have come loose and fallen, (cell,) uint64: one bit for each of its 64 sub-cells. An
        excavation takes away what it mines."""
        samples = np.zeros(len(self.grid.cell_level), np.uint64)
        if "loose_cell" in self.state:
            np.bitwise_or.at(samples, self.state["loose_cell"].values, self.state["loose_samples"].values)
            own = np.flatnonzero((samples > 0) & (self.grid.cell_width == 1))
            samples[own] &= ~self.voids.samples_of(self.grid.cell_index[own])
        return samples

    def has_fallen(self, point: NDArray) -> NDArray:
        """True (n,) where rock that was at points (n, xyz) m has come loose and fallen."""
        place, dimension = self.in_cells(point), len(self.axes)
        cell = self.cells(place)
        size = self.grid.cell_size[cell, None] / self.edge
        lower = (self.grid.centers(cell) - self.lower) / self.edge - 0.5 * size
        per_edge = round(SAMPLES_PER_CELL ** (1 / dimension))
        sub_cell = np.clip(((place - lower) / size * per_edge).astype(np.int64), 0, per_edge - 1)
        bit = (sub_cell @ per_edge ** np.arange(dimension)).astype(np.uint64)
        fallen = (self.fallen_samples[cell] >> bit) & np.uint64(1)
        return fallen.astype(bool) & (cell != NO_CELL)

    @cached_property
    def failed_volume(self) -> tuple[NDArray, NDArray, NDArray]:
        """Places (k, xyz) m of particles of failed rock that has not fallen, their volumes (k,) m3, and the index (k,)
        of the step in which each failed."""
        state = self.state
        own = np.flatnonzero(self.failed & (state["volume"].values > 0.0) & (state["excavation"].values < 0))
        step = state["failed"].values[own] if len(own) else np.empty(0, np.int32)
        return state["position"].values[own], state["volume"].values[own], step

    @cached_property
    def fallen_volume(self) -> tuple[NDArray, NDArray]:
        """Middles (k, xyz) m of the cells from which rock has fallen, and its volume there (k,) m3, that of cubes.

        Of a mine in plane strain the middle lies at 0 along the third axis.
        """
        own = np.flatnonzero(self.fallen_samples)
        place = np.zeros((len(own), 3))
        place[:, self.axes] = self.grid.centers(own)
        share = np.bitwise_count(self.fallen_samples[own]) / SAMPLES_PER_CELL
        thickness = 1.0 if len(self.axes) == 3 else float(self.state.attrs["thickness"])
        return place, share * self.grid.cell_size[own] ** len(self.axes) * thickness

    @cached_property
    def failed(self) -> NDArray:
        """True (particle,) for particles that have failed; none has in elastic rock."""
        if "failed" not in self.state:
            return np.zeros(self.state.sizes["particle"], bool)
        return self.state["failed"].values >= 0

    def in_cells(self, point: NDArray) -> NDArray:
        """Points (n, xyz) m in finest cells from the lower corner of the domain, (n, d)."""
        place = (point[:, self.axes] - self.lower) / self.edge
        inside = np.nextafter(self.grid.shape.astype(float), 0.0)  # the upper faces of the domain belong to it
        return np.where((place >= inside) & (place <= inside + FACE), inside, place)

    def cells(self, place: NDArray) -> NDArray:
        """Cell (n,) of points (n, d), in finest cells; NO_CELL outside of the domain."""
        return holding_cells(self.grid, np.floor(place).astype(np.int32))

    def what(self, point: NDArray) -> tuple[NDArray, NDArray]:
        """What is at points (n, xyz) m: OUTSIDE, MINED, INTACT or FAILED (n,), and the particle (n,), -1 for none."""
        place = self.in_cells(point)
        cell = self.cells(place)
        particle = np.where(cell == NO_CELL, -1, self.particle_of_cell[cell])
        found = np.where(self.failed[particle], FAILED, INTACT)
        found[particle < 0] = np.where(self.fell[cell[particle < 0]], FAILED, MINED)
        found[self.voids.hold(place)] = MINED
        found[cell == NO_CELL] = OUTSIDE
        return found, particle

    def displacement(self, point: NDArray, inside: NDArray | None = None) -> NDArray:
        """Displacement (n, xyz) m since virgin rock at points (n, xyz) m, by the shape functions of their cells, or of
        the cells that hold the points `inside` (n, xyz) m, which are continued to them.

        NaN where that cell has no rock.
        """
        cell = self.cells(self.in_cells(point if inside is None else inside))
        moved = np.full((len(point), 3), np.nan)
        there = np.flatnonzero((cell != NO_CELL) & (self.particle_of_cell[cell] >= 0))
        nodes = self.state["cell_nodes"].values[cell[there]][:, BIT_ORDER[len(self.axes)]]
        lower = self.grid.centers(cell[there]) - 0.5 * self.grid.cell_size[cell[there], None]
        size = self.grid.cell_size[cell[there], None]
        corners = (self.state["node_position"].values[nodes][:, :, self.axes] - lower[:, None]) / size[:, None]
        shape = shape_functions((point[there][:, self.axes] - lower) / size, corners)
        moved[there] = np.einsum("nc,nci->ni", shape, self.state["node_displacement"].values[nodes])
        return moved

    def difference_across(self, point: NDArray) -> NDArray:
        """Largest difference (n,) m of displacement between the corners of the cells at points (n, xyz) m, along an
        edge: the displacement gradient times the cell. NaN where a point's cell has no rock."""
        cell = self.cells(self.in_cells(point))
        found = np.full(len(point), np.nan)
        there = np.flatnonzero((cell != NO_CELL) & (self.particle_of_cell[cell] >= 0))
        nodes = self.state["cell_nodes"].values[cell[there]]
        edges = EDGE_CORNERS[len(self.axes)]
        apart = self.state["node_displacement"].values[nodes[:, edges[:, 1]]]
        apart = apart - self.state["node_displacement"].values[nodes[:, edges[:, 0]]]
        found[there] = np.linalg.norm(apart, axis=2).max(axis=1, initial=0.0)
        return found

    @cached_property
    def particle_tree(self):
        """Particles (k,) of rock that have a volume, and a KD-tree of their places along the computation's axes."""
        import scipy.spatial

        rock = (self.state["volume"].values > 0.0) & (self.state["excavation"].values < 0)
        own = np.flatnonzero(rock)
        return own, scipy.spatial.cKDTree(self.state["position"].values[own][:, self.axes])

    def stress_of_cells(self, particle: NDArray) -> tuple[NDArray, NDArray]:
        """Principal stresses (n, 3) Pa, the largest compression first, of the mean stress in the cells of particles
        (n,), and the least strength factor (n,) there."""
        own, _ = self.particle_tree
        cell, volume = self.state["cell"].values[own], self.state["volume"].values[own]
        count = len(self.grid.cell_level)
        total = np.bincount(cell, volume, minlength=count)
        chosen, row = np.unique(self.state["cell"].values[particle], return_inverse=True)
        stress = self.state["stress"].values[own]
        means = [np.bincount(cell, volume * column, minlength=count)[chosen] / total[chosen] for column in stress.T]
        factor = np.full(count, np.inf)
        np.minimum.at(factor, cell, self.state["strength_factor"].values[own])
        principal = np.linalg.eigvalsh(tensor_from_voigt(np.stack(means, axis=1)))
        return principal[row], factor[chosen][row]


def shape_functions(place: NDArray, corners: NDArray) -> NDArray:
    """Values (n, 2^d) of the shape functions at points (n, d) of cells with corners (n, 2^d, d), in bit order.

    Both are in edges of the cell, from the lower corner that it has as a cube. In a distorted cell the reference place
    is found by Newton's method. Where that does not converge, or the point is more than MAX_CONTINUED from the cell,
    the values are those of the affine field that fits the corners best: it takes any linear field, and grows no faster.
    """
    dimension = place.shape[1]
    bits = (np.arange(1 << dimension)[:, None] >> np.arange(dimension) & 1).astype(float)
    local = place.copy()
    bent = np.flatnonzero(np.abs(corners - bits).max(axis=(1, 2), initial=0.0) > ROUND_OFF)
    found = local[bent]
    for _ in range(NEWTON_STEPS):
        factor = np.where(bits == 1.0, found[:, None, :], 1.0 - found[:, None, :])
        off = place[bent] - np.einsum("nc,nci->ni", factor.prod(axis=2), corners[bent])
        slope = np.empty((len(bent), 1 << dimension, dimension))
        for axis in range(dimension):
            others = [other for other in range(dimension) if other != axis]
            slope[:, :, axis] = (2.0 * bits[:, axis] - 1.0) * factor[:, :, others].prod(axis=2)
        jacobian = np.einsum("nci,nca->nia", corners[bent], slope)
        regular = np.abs(np.linalg.det(jacobian)) > MIN_JACOBIAN
        jacobian[~regular] = np.eye(dimension)
        found = found + np.linalg.solve(jacobian, off[:, :, None])[:, :, 0]
        found = np.clip(found, -2.0 * MAX_CONTINUED, 1.0 + 2.0 * MAX_CONTINUED)
    factor = np.where(bits == 1.0, found[:, None, :], 1.0 - found[:, None, :])
    off = np.abs(place[bent] - np.einsum("nc,nci->ni", factor.prod(axis=2), corners[bent])).max(axis=1, initial=0.0)
    local[bent] = np.where(off[:, None] < CONVERGED, found, np.inf)
    value = np.where(bits == 1.0, local[:, None, :], 1.0 - local[:, None, :])
    far = np.flatnonzero(np.abs(local - 0.5).max(axis=1, initial=0.0) > 0.5 + MAX_CONTINUED)
    value[far] = 0.0
    value = value.prod(axis=2)
    ones = np.ones((len(far), 1 << dimension, 1))
    fitted = np.linalg.pinv(np.concatenate([ones, corners[far]], axis=2))  # (far, d + 1, corner)
    value[far] = np.einsum("nk,nkc->nc", np.concatenate([ones[:, 0], place[far]], axis=1), fitted)
    return value
