"""Metres of drives that stand open in a step, on the cells of maps in plan."""

import json
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from baselines.settings import Drive
from response.centre_lines import CentreLine, centre_lines

PIECES_PER_CELL = 8  # Pieces of a drive that is as long as the edge of the finest cell.
NEVER = 1 << 30


@dataclass(frozen=True)
class DriveMetres:
    """Pieces of drives along their centre lines.

    place (piece, xy): middle in plan, m; metres (piece,): length in space; mined, filled (piece,): index of the dated
    step that mines and fills it, -1 before the first, NEVER for none.
    """

    place: NDArray
    metres: NDArray
    mined: NDArray
    filled: NDArray

    @classmethod
    def of(cls, grid: xr.Dataset, drives: Sequence[Drive], steps: Sequence[str]) -> "DriveMetres | None":
        """Pieces of the mined excavations that have a centre line; None without any. steps: names of the dated ones."""
        names = json.loads(grid.attrs["excavation_names"])
        given = {drive.name: drive for drive in drives}
        paths = [np.array(given[name].path) if name in given and given[name].path else None for name in names]
        index = {"": -1} | {step: number for number, step in enumerate(steps)}
        found = []
        for name, line in zip(names, centre_lines(grid, paths), strict=True):
            if line is not None and name in given:
                drive = given[name]
                filled = NEVER if drive.filled is None else index[drive.filled]
                place, metres = pieces(line, float(grid.attrs["fine_cell"]) / PIECES_PER_CELL)
                found.append((place, metres, np.full(len(metres), index[drive.step]), np.full(len(metres), filled)))
        if not found:
            return None
        return cls(*(np.concatenate(column) for column in zip(*found, strict=True)))

    def in_cells(self, cell: NDArray, count: int, step: int) -> NDArray:
        """Metres (cell,) of drives that stand open in a step; cell (piece,): of each piece, -1 outside of all."""
        is_open = (self.mined <= step) & (step < self.filled) & (cell >= 0)
        return np.bincount(cell[is_open], self.metres[is_open], minlength=count)


def pieces(line: CentreLine, largest: float) -> tuple[NDArray, NDArray]:
    """Middles in plan (piece, xy), m, and lengths (piece,), m, of equal pieces of each straight part of a line, which
    are no longer than `largest`, m."""
    start, stretch = line.point[:-1], np.diff(line.point, axis=0)
    length = np.linalg.norm(stretch, axis=1)
    count = np.maximum(np.ceil(length / largest).astype(int), 1)
    part = np.repeat(np.arange(len(count)), count)
    number = np.arange(len(part)) - np.repeat(np.cumsum(count) - count, count)
    share = (number + 0.5) / count[part]
    return (start[part] + share[:, None] * stretch[part])[:, :2], (length / count)[part]
