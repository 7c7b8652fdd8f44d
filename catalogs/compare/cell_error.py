"""Error that cells, and the place of walls in them, leave in potency and failed volume.

Where failed rock ends is known to a part of a cell. So the error grows as the failed zone gets thinner, counted in
cells, whatever the mine. The thickness of the zone is the number of its cells over the number of their faces towards
sound rock: of a layer of even thickness it is just that. In study openings, |ln Q_h / Q| of nine runs of ten is at
most

  U(t) = max(ERROR_AT_ONE_CELL t^-ERROR_ORDER, MIN_ERROR),

where Q is the result of much smaller cells and t the thickness. The runs are nine mines, each at four placements on
its cells, and so U contains the placement, and the chance by which another rock fails first. tests/catalogs recompute
the constants from the study's runs (config/verification/openings/cell_errors.csv).
"""

from collections.abc import Collection

import numpy as np
import xarray as xr

ERROR_AT_ONE_CELL = 0.12
ERROR_ORDER = 2.0
MIN_ERROR = 0.052
MAX_ERROR = 0.5  # Of thinner zones the study says only that most of the failure is missing.
COVERAGE = 0.9  # Share of the study's runs whose error U contains.
FRONT_VARIABLES = ("failed", "cell", "cell_origin", "cell_size")  # of a state, that failed_thickness needs


def error_at(thickness: float) -> float:
    """Half-width of ln of potency or failed volume for failed rock of this thickness (cells); NaN if nothing failed."""
    if not thickness > 0.0:
        return np.nan
    return float(max(ERROR_AT_ONE_CELL * thickness**-ERROR_ORDER, MIN_ERROR))


def failed_thickness(state: xr.Dataset, steps: Collection[int]) -> float:
    """Mean thickness, in finest cells, of the rock that failed in steps (by index); NaN if none did, inf without a face
    towards sound rock.

    state: FRONT_VARIABLES, after the last of the steps.
    """
    size, cell, origin = (state[name].values for name in ("cell_size", "cell", "cell_origin"))
    finest = size.min()
    place = np.rint((origin - origin.min(axis=0)) / finest).astype(np.int64) + 1
    step = state["failed"].values
    failed, ever = (_cells_with(cell[here], len(size)) for here in (np.isin(step, list(steps)), step >= 0))
    sound = _cells_with(cell, len(size)) & ~ever
    is_finest = np.isclose(size, finest)
    stride = np.cumprod([1, *(place.max(axis=0)[:0:-1] + 2)])[::-1]
    number = place @ stride
    inside, outside = number[failed & is_finest], np.sort(number[sound & is_finest])
    if not len(inside):
        return np.nan
    faces = sum(int(np.isin(inside + way * one, outside).sum()) for one in stride for way in (-1, 1))
    return len(inside) / faces if faces else np.inf


def _cells_with(cells: np.ndarray, count: int) -> np.ndarray:
    """Cells (count,) bool that hold any of these particles."""
    return np.bincount(cells, minlength=count) > 0
