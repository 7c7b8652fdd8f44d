"""Rock that each step mines, on the grid."""

from collections.abc import Sequence

import numpy as np
import xarray as xr


def volumes_mined(grid: xr.Dataset, steps: Sequence[Sequence[int]]) -> list[float]:
    """Volume that each step mines, m3; steps: indices of the excavations that each mines, in order.

    Where solids overlap it counts once, in the step that comes first; fill that is mined again is no rock.
    """
    lower, upper, edge = (np.asarray(grid.attrs[name]) for name in ("domain_lower", "domain_upper", "fine_cell"))
    cell, end = (np.rint((corner - lower) / edge).astype(np.int64) for corner in (grid["piece_origin"].values, upper))
    _, place = np.unique(np.ravel_multi_index(cell.T, end + 1), return_inverse=True)
    # Each bit is a point of the cell, inside the excavation or not.
    samples, excavation = grid["piece_samples"].values, grid["piece_excavation"].values
    points = 8 * samples.dtype.itemsize
    gone, found = np.zeros(len(place), samples.dtype), []
    volume = float(edge) ** int(grid.attrs["dimension"]) * float(grid.attrs["thickness"])
    for wanted in steps:
        own = np.flatnonzero(np.isin(excavation, wanted))
        here = np.unique(place[own])
        before = gone[here]
        np.bitwise_or.at(gone, place[own], samples[own])
        found.append(float(np.bitwise_count(gone[here] & ~before).sum()) / points * volume)
    return found
