"""Forecasts of the maps in the form of CSEP's testing centres, which pyCSEP reads (Savran et al. 2022).

A file is one map of one step. A row is a cell: lower and upper longitude, latitude (degrees, WGS 84), depth (km below
sea level, so negative above it) and magnitude, the expected number of events, and 1 for a cell that is tested. Cells
are equally wide in degrees, with latitude changing fastest. There is one class of magnitude, from the cut of the
comparison on.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import scipy
import xarray as xr
from numpy.typing import NDArray

from baselines.alerts import CELLS_PER_DEVIATION, AlertCells, step_densities
from baselines.months import Months
from catalogs.sources.geographic_frame import MineFrame
from common.datasets import atomic_path

METRES_IN_DEGREE = 111_320.0  # of latitude
DEGREE_STEP = 1e-5  # The width of cells is a multiple of it, so that their corners are short decimal numbers.
MAX_MAGNITUDE = 10.0


@dataclass(frozen=True)
class GlobeCells:
    """Cells on the globe whose middles lie in the box in plan: west and south (cell,) and their width in degrees, and
    the middles in plan (cell, xy), m."""

    west: NDArray
    south: NDArray
    width: float
    middle: NDArray

    @classmethod
    def of(cls, cells: AlertCells, frame: MineFrame) -> "GlobeCells":
        """Cells as wide to the north as the smoothing of a map that its own cells resolve."""
        box = cells.box
        corners = np.array([[x, y, 0.0] for x in box[:, 0] for y in box[:, 1]])
        latitude, longitude, _ = frame.to_globe(corners)
        width = max(round(CELLS_PER_DEVIATION * cells.edges.min() / METRES_IN_DEGREE / DEGREE_STEP), 1) * DEGREE_STEP
        first, last = (
            [int(np.floor(one / width)) for one in (function(longitude), function(latitude))]
            for function in (np.min, np.max)
        )
        west, south = (
            one.ravel()
            for one in np.meshgrid(
                *(np.arange(a, b + 1) * width for a, b in zip(first, last, strict=True)), indexing="ij"
            )
        )
        middle = frame.to_map(south + 0.5 * width, west + 0.5 * width, np.zeros(len(west)))[:, :2]
        inside = ((middle >= box[0]) & (middle <= box[1])).all(axis=1)
        return cls(west[inside], south[inside], width, middle[inside])


def rates_on_globe(density: NDArray, cells: AlertCells, globe: GlobeCells, expected: float) -> NDArray:
    """Expected number of events in each cell on the globe (cell,), whose sum is `expected`.

    density (cell,): of a map over the uniform one, on its own cells.
    """
    place = (globe.middle - cells.box[0]) / cells.edges - 0.5
    value = scipy.ndimage.map_coordinates(density.reshape(cells.shape), place.T, order=1, mode="nearest")
    weight = value * np.cos(np.radians(globe.south + 0.5 * globe.width))  # cells narrow toward the poles
    return expected * weight / weight.sum()


def rigidity(record: xr.Dataset) -> float:
    """Median of moment over potency of recorded events, Pa: what the record's magnitudes take for rigidity."""
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = record["moment"].values / record["potency"].values
    return float(np.median(ratio[np.isfinite(ratio)]))


def write_csep(folder: Path, months: Months, frame: Mapping, depths: tuple[float, float], magnitude: float) -> int:
    """Write <map>_<step>.dat for each map that forecasts a step whose number is expected, too; the number of files.

    frame: place of the mine on Earth; depths: top and bottom of the domain, m below sea level; magnitude: Mw of cut.
    """
    folder.mkdir(parents=True, exist_ok=True)
    system, written = MineFrame(frame), 0
    for step, name in enumerate(months.steps):
        expected = months.expected_number(step)
        if not np.isfinite(expected):
            continue
        cells, densities = step_densities(months.maps, step)
        globe = GlobeCells.of(cells, system)
        for label, runs in densities.items():
            rate = rates_on_globe(runs.mean(axis=0), cells, globe, expected)
            file = folder / f"{label.lower().replace(' ', '_')}_{name}.dat"
            with atomic_path(file) as temporary:
                _write(temporary, globe, rate, depths, magnitude)
            written += 1
    return written


def _write(path: Path, globe: GlobeCells, rate: NDArray, depths: tuple[float, float], magnitude: float) -> None:
    """Write one forecast."""
    ones = np.ones(len(rate))
    ends = [0.001 * depths[0] * ones, 0.001 * depths[1] * ones, magnitude * ones, MAX_MAGNITUDE * ones]
    columns = [globe.west, globe.west + globe.width, globe.south, globe.south + globe.width, *ends, rate, ones]
    formats = ["%.5f"] * 4 + ["%.3f"] * 2 + ["%.4f"] * 2 + ["%.6e", "%d"]
    np.savetxt(path, np.column_stack(columns), fmt=formats)
