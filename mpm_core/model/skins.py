"""Skins of rock: finest cells that have a void on both sides, at most MAX_SKIN cells apart along an axis of the grid.

Their rock bends, and has to bend as a plate does: see particles.bending_stiffness.
"""

import numpy as np

from mpm_core.grid.splitting import code_of

MAX_SKIN = 5  # cells, as many as a skin four cells thick may touch; a thicker one hardly bends by its single cells


def find_skins(void: np.ndarray, shape: np.ndarray, free: list[tuple[int, int]]) -> np.ndarray:
    """Places (k, d) of the cells of skins, in finest cells.

    void (n, d): places that are void, each once, of a domain of shape (d,); free: (axis, side) of its faces beyond
    which there is nothing.
    """
    padded = shape + 2 * MAX_SKIN + 2
    codes = np.sort(code_of(void + MAX_SKIN + 1, padded))

    def is_void(places: np.ndarray) -> np.ndarray:
        beyond = np.zeros(len(places), bool)
        for axis, side in free:
            beyond |= places[:, axis] >= shape[axis] if side else places[:, axis] < 0
        return beyond | np.isin(code_of(places + MAX_SKIN + 1, padded), codes)

    found = [np.empty((0, len(shape)), void.dtype)]
    for axis in range(len(shape)):
        for direction in (-1, 1):
            ahead = np.zeros(len(shape), void.dtype)
            ahead[axis] = direction
            start = void[~is_void(void + ahead)]
            for width in range(1, MAX_SKIN + 1):
                across = is_void(start + (width + 1) * ahead)
                found += [start[across] + step * ahead for step in range(1, width + 1)]
                start = start[~across]
    places = np.unique(np.concatenate(found), axis=0)
    return places[((places >= 0) & (places < shape)).all(axis=1)]
