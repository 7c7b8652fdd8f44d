"""Centre lines of drives: by their path where the mine file has one, else from the cells that they fill."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy.sparse
import scipy.spatial
import xarray as xr
from numpy.typing import NDArray

from response.settings import MIN_SLENDERNESS

WIDTHS_PER_POINT = 1.0  # Distance of the points of a line that is found from cells, in widths of the drive.
SAMPLES_PER_STRETCH = 8  # Points of a line by which the nearest stretch is looked for, on average.
SAMPLES_TRIED = 12
MAX_OFF_LINE = 1.0  # Widths of a drive that its cells are off its line at most: branches and rings have none.
MIN_SHARE = 0.5  # Of a finest cell that is part of a drive.


@dataclass(frozen=True)
class CentreLine:
    """A polyline, point (k, xyz) m, k >= 2, no two neighbours alike. Chainage is 0 at its first point."""

    point: NDArray

    @property
    def length(self) -> float:
        """Its length, m."""
        return float(np.linalg.norm(np.diff(self.point, axis=0), axis=1).sum())

    def project(self, place: NDArray) -> tuple[NDArray, NDArray]:
        """Chainage (n,) m of the nearest point of the line, which ends where it ends, and the direction (n, xyz) of
        the stretch there, of points (n, xyz) m. Stretches are tried that have one of the nearest SAMPLES_TRIED of
        evenly spaced points of the line."""
        start, stretch = self.point[:-1], np.diff(self.point, axis=0)
        length = np.linalg.norm(stretch, axis=1)
        along = stretch / length[:, None]
        before = np.append(0.0, np.cumsum(length)[:-1])
        samples = (
            (np.arange(SAMPLES_PER_STRETCH * len(start)) + 0.5) / (SAMPLES_PER_STRETCH * len(start)) * length.sum()
        )
        owner = np.searchsorted(before, samples, side="right") - 1
        middles = start + 0.5 * stretch  # and those of stretches so short that they have no sample
        tree = scipy.spatial.cKDTree(np.concatenate([self.at(samples), middles]))
        count = min(SAMPLES_TRIED, tree.n)
        near = np.concatenate([owner, np.arange(len(start))])[tree.query(place, count)[1].reshape(len(place), count)]
        off = place[:, None] - start[near]
        on_line = np.clip(np.einsum("nki,nki->nk", off, along[near]), 0.0, length[near])
        distance = np.linalg.norm(off - on_line[:, :, None] * along[near], axis=2)
        row, best = np.arange(len(place)), distance.argmin(axis=1)
        found = near[row, best]
        return before[found] + on_line[row, best], along[found]

    def at(self, chainage: NDArray) -> NDArray:
        """Points (n, xyz) m of the line at chainages (n,) m."""
        length = np.linalg.norm(np.diff(self.point, axis=0), axis=1)
        knots = np.append(0.0, np.cumsum(length))
        return np.stack([np.interp(chainage, knots, column) for column in self.point.T], axis=1)


def centre_lines(grid: xr.Dataset, paths: Sequence[NDArray | None]) -> list[CentreLine | None]:
    """Centre line of each excavation that is a drive, in the order of grid.nc; None for others.

    paths: points along each excavation that the mine file gives, None where it gives none. An excavation without one is
    a drive if it is MIN_SLENDERNESS times as long as wide or high, and has no branches.
    """
    cells = _cells_by_excavation(grid, len(paths)) if grid.attrs["plane"] == "none" else [None] * len(paths)
    lines: list[CentreLine | None] = []
    for path, own in zip(paths, cells, strict=True):
        if path is not None:
            lines.append(CentreLine(_distinct(np.asarray(path, float))))
        else:
            lines.append(None if own is None else _line_of_cells(grid, own))
    return lines


def _cells_by_excavation(grid: xr.Dataset, count: int) -> list[NDArray]:
    """Finest cells (k, xyz), from the domain's lower corner, of which each excavation has more than MIN_SHARE."""
    edge, corner = float(grid.attrs["fine_cell"]), np.asarray(grid.attrs["domain_lower"])
    held = np.flatnonzero(grid["piece_fraction"].values > MIN_SHARE)
    owner = grid["piece_excavation"].values[held]
    order = np.argsort(owner, kind="stable")
    place = np.rint((grid["piece_origin"].values[held[order]] - corner) / edge).astype(np.int64)
    return np.split(place, np.searchsorted(owner[order], np.arange(1, count)))[:count]


def _distinct(points: NDArray) -> NDArray:
    """Points (k, xyz) without those that repeat the one before."""
    return points[np.append(True, (np.diff(points, axis=0) != 0).any(axis=1))]


def _line_of_cells(grid: xr.Dataset, cells: NDArray) -> CentreLine | None:
    """Centre line through cells (k, xyz) of an excavation: their middles at equal distances along it, from end to end.

    The distance of a cell from one end runs through the cells of the excavation. Both ends are found by going to the
    farthest cell twice. Chainage begins at the end that comes first by x, then y.
    """
    edge, corner = float(grid.attrs["fine_cell"]), np.asarray(grid.attrs["domain_lower"])
    if len(cells) < MIN_SLENDERNESS:
        return None
    cell = np.unique(cells, axis=0)
    graph = _neighbours(cell)
    first = int(np.argmax(_from(graph, 0)))
    away = _from(graph, first)
    last = int(np.argmax(np.where(np.isfinite(away), away, -1.0)))
    away, length = away * edge, away[last] * edge
    if not np.isfinite(away).all() or length <= 0.0:
        return None  # in several parts
    width = np.sqrt(len(cell) * edge**3 / length)
    if length < MIN_SLENDERNESS * width:
        return None
    middle = corner + (cell + 0.5) * edge
    count = max(int(length / (WIDTHS_PER_POINT * width)), 2)
    bin_of = np.minimum((away / length * count).astype(int), count - 1)
    size = np.bincount(bin_of, minlength=count)
    points = np.stack([np.bincount(bin_of, column, minlength=count) for column in middle.T], axis=1)
    means: NDArray = points[size > 0] / size[size > 0][:, None]
    points = np.concatenate([[2 * means[0] - means[1]], means, [2 * means[-1] - means[-2]]])  # to the ends
    points[0], points[-1] = 0.5 * (points[0] + points[1]), 0.5 * (points[-1] + points[-2])
    line = CentreLine(points if tuple(points[0]) < tuple(points[-1]) else points[::-1].copy())
    chainage, _ = line.project(middle)
    off = np.linalg.norm(middle - line.at(chainage), axis=1)
    across = 2.0 * float(off.max()) + edge  # a flat body is as wide as it reaches from its line
    is_drive = line.length >= MIN_SLENDERNESS * across and across <= 2.0 * MAX_OFF_LINE * width + edge
    return line if is_drive else None


def _neighbours(cell: NDArray) -> scipy.sparse.csr_matrix:
    """Graph of cells (cell, xyz) that touch, weighted by the distance of their middles, in cells."""
    pairs = scipy.spatial.cKDTree(cell).query_pairs(1.8, output_type="ndarray")  # faces, edges and corners: sqrt(3)
    apart = np.linalg.norm((cell[pairs[:, 0]] - cell[pairs[:, 1]]).astype(float), axis=1)
    return scipy.sparse.csr_matrix((apart, (pairs[:, 0], pairs[:, 1])), shape=(len(cell), len(cell)))


def _from(graph: scipy.sparse.csr_matrix, start: int) -> NDArray:
    """Distance (cell,) of each cell from one of them along the graph, in cells; infinite where there is no way."""
    import scipy.sparse.csgraph

    return scipy.sparse.csgraph.dijkstra(graph, directed=False, indices=start)
