"""Names of openings in the view that can be turned: where each stands, and how deep rock has failed around it by step.

"browser/view_names.js" places the names on the screen.
"""

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from catalogs.report.evidence import Evidence
from catalogs.sources.openings import NOTHING
from common.opening_table import ALL, SIDES

MAX_PLACES = 16  # Cells of an opening by which a click finds it; the first one has the name.


def opening_places(evidence: Evidence) -> list[tuple[int, NDArray, float]]:
    """Openings that mine something, the largest first: index, places in it (place, xyz) m, and their reach, m.

    The first place is the middle of the cell that is nearest to the centroid, so that it lies in a bent opening, too.
    The others are each as far from those before as can be. All of the opening is within the reach of one of them.
    """
    mining, edge = evidence.mining, float(evidence.grid.attrs["fine_cell"])
    taken = np.flatnonzero(mining.takes != NOTHING)
    taken = taken[np.argsort(mining.excavation[taken], kind="stable")]
    indices, first = np.unique(mining.excavation[taken], return_index=True)
    volume = np.bincount(mining.excavation[taken], mining.volume[taken], minlength=mining.count)
    found = {
        int(index): _spread(mining.origin[own] + edge / 2, mining.volume[own])
        for index, own in zip(indices, np.split(taken, first[1:]), strict=True)
    }
    half_diagonal = edge * np.sqrt(3) / 2
    order = sorted(found, key=lambda index: -volume[index])
    return [(index, found[index][0], found[index][1] + half_diagonal) for index in order]


def _spread(centres: NDArray, volume: NDArray) -> tuple[NDArray, float]:
    """Up to MAX_PLACES of the centres (cell, xyz), and the largest distance of a centre from the nearest of them."""
    middle = np.average(centres, axis=0, weights=volume)
    chosen = [int(np.argmin(np.linalg.norm(centres - middle, axis=1)))]
    apart = np.linalg.norm(centres - centres[chosen[0]], axis=1)
    while len(chosen) < MAX_PLACES and apart.max() > 0.0:
        chosen.append(int(np.argmax(apart)))
        apart = np.minimum(apart, np.linalg.norm(centres - centres[chosen[-1]], axis=1))
    return centres[chosen], float(apart.max())


def responses(table: xr.Dataset | None, names: list[str], steps: list[str]) -> tuple[NDArray, NDArray, NDArray]:
    """Depth of failure, m, its side, and closure, m, of openings after steps, each (opening, step).

    The depth is that which nine tenths of the side with the deepest failure do not exceed; the side is its place among
    SIDES, the closure the median of opposite walls. NaN and -1 where the table of openings says nothing.
    """
    shape = (len(names), len(steps))
    depth, closure = np.full((len(SIDES), *shape), np.nan), np.full(shape, np.nan)
    if table is not None and names:
        whole = np.isnan(table["chainage_from"].values)
        opening, step = _places(table["excavation"].values, names), _places(table["step"].values, steps)
        kept, side = whole & (opening >= 0) & (step >= 0), table["side"].values
        for place, name in enumerate(SIDES):
            own = kept & (side == name)
            depth[place, opening[own], step[own]] = table["depth_p90"].values[own]
        own = kept & (side == ALL)
        closure[opening[own], step[own]] = table["closure_median"].values[own]
    known = np.isfinite(depth).any(axis=0)
    filled = np.where(np.isfinite(depth), depth, -np.inf)
    return np.where(known, filled.max(axis=0), np.nan), np.where(known, filled.argmax(axis=0), -1), closure


def _places(values: NDArray, wanted: list[str]) -> NDArray:
    """Place of each value (row,) in a list, -1 for a value that is not there."""
    place = {name: number for number, name in enumerate(wanted)}
    distinct, inverse = np.unique(np.asarray(values, str), return_inverse=True)
    return np.array([place.get(str(one), -1) for one in distinct], int)[inverse]
