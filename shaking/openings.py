"""Openings on the grid, and how far events are from the nearest part of each."""

import json
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from catalogs.settings import DatedStep
from catalogs.sources.openings import NEVER, NOTHING, Mining, nearest_opening
from common.errors import InputError
from shaking.settings import ShakenOpening

BEFORE = -1  # Index of the step of what is mined or filled before the first dated one.


@dataclass(frozen=True)
class Openings:
    """Openings that are mined and have a surface of their own.

    names; mined, filled (opening,): index of the step, BEFORE the first, NEVER for what is not filled; cells: lower
    corners (cell, 3) m of the cells of each; edge: of these cells, m.
    """

    names: list[str]
    mined: NDArray
    filled: NDArray
    cells: list[NDArray]
    edge: float

    @classmethod
    def of(cls, grid: xr.Dataset, openings: Sequence[ShakenOpening], steps: Sequence[DatedStep]) -> "Openings":
        """Openings of grid.nc. One that mines nothing, as others have mined all of it, is left out.

        Raises InputError in plane strain, and for an excavation or a step that does not exist.
        """
        if int(grid.attrs["dimension"]) != 3:
            raise InputError(
                "ground_motion: sources of a plane-strain mine are as long as its thickness, and have no distance; "
                "leave it out, or give plane: none"
            )
        names = json.loads(grid.attrs["excavation_names"])
        place = {"": BEFORE} | {step.name: number for number, step in enumerate(steps)}
        mined, filled = np.full(len(names), NEVER), np.full(len(names), NEVER)
        for opening in openings:
            if opening.name not in names:
                raise InputError(f"ground_motion: the grid has no excavation {opening.name}; it has {', '.join(names)}")
            for step in (opening.step, opening.filled):
                if step is not None and step not in place:
                    raise InputError(f"ground_motion: {opening.name}: {step!r} is no dated step")
            number = names.index(opening.name)
            mined[number] = place[opening.step]
            filled[number] = NEVER if opening.filled is None else place[opening.filled]
        mining = Mining.of(grid, mined, filled)
        own = np.flatnonzero((mining.takes != NOTHING) & (mining.step != NEVER))
        cells = [np.unique(mining.origin[own[mining.excavation[own] == one]], axis=0) for one in range(len(names))]
        kept = [number for number in range(len(names)) if len(cells[number])]
        return cls(
            [names[number] for number in kept],
            mined[kept],
            filled[kept],
            [cells[number] for number in kept],
            float(grid.attrs["fine_cell"]),
        )

    def distances(self, opening: int, points: NDArray) -> NDArray:
        """Distance of points (point, 3), m, from the nearest cell of an opening, m; 0 inside."""
        cells = self.cells[opening]
        number = np.zeros(len(cells), np.int64)
        return nearest_opening(points, cells, self.edge, number, np.array([True]), np.array([0]))[1]

    def is_mined(self, step: int) -> NDArray:
        """Openings (opening,) bool that are mined in a step or before."""
        return self.mined <= step

    def is_filled(self, step: int) -> NDArray:
        """Openings (opening,) bool that are filled in a step or before."""
        return self.filled <= step
