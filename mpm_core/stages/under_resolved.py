"""Openings that are narrow for their cells: their walls close too little, as if something propped them.

Walls in different cells have nodes of their own (model/phantom_nodes.py). But rock on both sides of an opening within
one cell is tied together, and an edge without a node of its own (grid/edge_nodes.py) ties two walls. The share of an
opening's volume in cells that are mined wholly shows it; study openings has what that share costs.
"""

import numpy as np

from mpm_core.grid.splitting import code_of
from mpm_core.model.occupancy import ALL_SAMPLES, FinestPieces

# An opening is under-resolved if a smaller share of its volume is in whole cells. Too little rock then fails around it.
MIN_WHOLE_CELL_SHARE = 0.3
# A scene is refused if a smaller share of the volume of all openings, or of one, is in whole cells. Rock in partly
# mined cells then decides where the other rock breaks.
MIN_WHOLE_CELL_SHARE_ACCEPTED = 0.05


def whole_shares(parts: FinestPieces, shape: np.ndarray, later: np.ndarray) -> np.ndarray:
    """Share of each excavation's volume (k,) in finest cells that are mined wholly, by it and others; 0 without parts.

    shape (d,): finest cells along each axis; later (k,) bool: those mined after the first step, which make no cell
    whole for one of the first.
    """
    code = code_of(parts.place, shape)
    mined = np.bitwise_count(parts.samples).astype(float)
    share = np.zeros(len(later))
    for ours, others in ((~later, ~later), (later, np.ones_like(later))):
        there, own = np.flatnonzero(others[parts.excavation]), np.flatnonzero(ours[parts.excavation])
        order = there[np.argsort(code[there], kind="stable")]
        first = np.flatnonzero(np.diff(code[order], prepend=-1))
        if not len(own):
            continue
        whole = code[order][first[np.bitwise_or.reduceat(parts.samples[order], first) == ALL_SAMPLES]]
        size, in_whole = (
            np.bincount(parts.excavation[own], value, minlength=len(later))
            for value in (mined[own], mined[own] * np.isin(code[own], whole))
        )
        share += np.divide(in_whole, size, out=np.zeros(len(later)), where=size > 0.0)
    return share
