"""Boxes that fill space side by side, as a block model has them: which one holds a point, overlaps and gaps.

Blocks of all sizes lie in bins of one size. A bin lists the blocks that reach into it, so a point is compared with the
few of its own bin. Blocks that only touch a bin are not listed. A point that no block holds is asked for again a little
to each side: it may lie on the last face, or between neighbours whose coordinates are rounded.
"""

import itertools
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numba import njit

MAX_ENTRIES_PER_BLOCK = 8  # Bins are enlarged until no more of them, on average, list one block.
# Neighbours whose coordinates are rounded overlap, or lie apart, by up to this share of their size.
ROUNDED = 0.01
ROUND_OFF = 1e-6  # Share of a bin by which a block may reach into it without being listed.
MAX_PROBES = 1 << 21  # Points at which gaps are looked for.
MAX_ASKED = 100_000  # Blocks that are asked for neighbours.
NO_BLOCK = -1


class Place(NamedTuple):
    """A share, and a point (3,) m that shows it."""

    share: float
    point: np.ndarray


@dataclass(frozen=True, eq=False)
class Blocks:
    """Boxes along three axes that may be turned.

    lower, upper (block, 3) m: corners along these axes from the origin (3,) m; axes (3, 3): orthonormal rows.
    """

    lower: np.ndarray
    upper: np.ndarray
    origin: np.ndarray
    axes: np.ndarray

    @cached_property
    def bounds(self) -> tuple[np.ndarray, np.ndarray]:
        """Lower and upper corner (3,) m of all blocks along their axes."""
        return self.lower.min(axis=0), self.upper.max(axis=0)

    @cached_property
    def volume(self) -> np.ndarray:
        """Volume (block,) m3 of each."""
        return np.prod(self.upper - self.lower, axis=1)

    @cached_property
    def _bins(self) -> "_Bins":
        return _Bins.of(self.lower, self.upper)

    def at(self, points: np.ndarray) -> np.ndarray:
        """The block (point,) int64 that holds each point (point, 3) m, NO_BLOCK where none does.

        Where some overlap it is the last of them, and on a face one of both.
        """
        return self._at((points - self.origin) @ self.axes.T)

    def _at(self, own: np.ndarray) -> np.ndarray:
        """As `at`, of points along the axes."""
        lower, upper = self.bounds
        found = self._bins.blocks_at(own, self.lower, self.upper)
        for side in itertools.product((-1.0, 1.0), repeat=3):
            missing = np.flatnonzero((found == NO_BLOCK) & ((own >= lower) & (own <= upper)).all(axis=1))
            beside = own[missing] + ROUNDED * self._bins.mean_side * side
            found[missing] = self._bins.blocks_at(beside, self.lower, self.upper)
        return found

    def overlaps(self) -> Place:
        """Share of the blocks that overlap one before them by more than round-off, and the middle of the first such."""
        overlapping = _overlapping(*self._bins.lists, self.lower, self.upper)
        found = np.flatnonzero(overlapping)
        first = found[0] if len(found) else 0
        return Place(len(found) / len(self.lower), self._in_space(0.5 * (self.lower[first] + self.upper[first])))

    def gaps(self) -> Place:
        """Share of what lies within the blocks that is in none, and the first point of it.

        Within is what has blocks on both sides along all three axes. It is probed at the points of a lattice.
        """
        lower, upper = self.bounds
        count = np.maximum((upper - lower) / np.cbrt(np.prod(upper - lower) / MAX_PROBES), 1.0).astype(int)
        places = [
            low + (np.arange(n) + 0.5) * (high - low) / n for low, high, n in zip(lower, upper, count, strict=True)
        ]
        points = np.stack(np.meshgrid(*places, indexing="ij"), axis=-1).reshape(-1, 3)
        filled = (self._at(points) != NO_BLOCK).reshape(tuple(count))
        within = np.ones_like(filled)
        for axis in range(3):
            before = np.logical_or.accumulate(filled, axis=axis)
            after = np.flip(np.logical_or.accumulate(np.flip(filled, axis), axis=axis), axis)
            within &= before & after
        missing = np.flatnonzero((within & ~filled).ravel())
        first = points[missing[0]] if len(missing) else lower
        return Place(len(missing) / max(int(within.sum()), 1), self._in_space(first))

    def apart(self) -> float:
        """Share of the blocks that have no neighbour at any of their faces, of up to MAX_ASKED of them."""
        asked = np.arange(0, len(self.lower), -(-len(self.lower) // MAX_ASKED))
        lower, upper = self.lower[asked], self.upper[asked]
        alone = np.ones(len(asked), bool)
        for axis in range(3):
            beyond = (0.5 + 2.0 * ROUNDED) * (upper - lower) * np.eye(3)[axis]
            for side in (-1, 1):
                alone &= self._at(0.5 * (lower + upper) + side * beyond) == NO_BLOCK
        return float(alone.mean()) if len(self.lower) > 1 else 0.0

    def _in_space(self, own: np.ndarray) -> np.ndarray:
        return own @ self.axes + self.origin


@dataclass(frozen=True)
class _Bins:
    """Bins from a corner `lower` (3,) m, of sides `size` (3,) m, `shape` (3,) of them; mean_side (3,) m: of the blocks.

    codes (bin,): number of each bin that lists blocks, ascending; start (bin + 1,): its part of `block`, ascending.
    """

    lower: np.ndarray
    mean_side: np.ndarray
    size: np.ndarray
    shape: np.ndarray
    codes: np.ndarray
    start: np.ndarray
    block: np.ndarray

    @classmethod
    def of(cls, lower: np.ndarray, upper: np.ndarray) -> "_Bins":
        corner, mean = lower.min(axis=0), (upper - lower).mean(axis=0)
        extent, size = upper.max(axis=0) - corner, mean
        while True:
            inset = ROUND_OFF * size
            first, last = (np.floor((place - corner) / size) for place in (lower + inset, upper - inset))
            last = np.maximum(first, last)
            count = np.prod(last - first + 1.0, axis=1)
            if count.sum() <= MAX_ENTRIES_PER_BLOCK * len(lower):
                break
            size = 1.5 * size
        shape = np.floor(extent / size).astype(np.int64) + 1
        code, block = _listed(first.astype(np.int64), last.astype(np.int64), shape, int(count.sum()))
        order = np.argsort(code, kind="stable")
        codes, start = np.unique(code[order], return_index=True)
        return cls(corner, mean, size, shape, codes, np.append(start, len(code)), block[order])

    @property
    def lists(self) -> tuple[np.ndarray, np.ndarray]:
        """start and block."""
        return self.start, self.block

    def blocks_at(self, points: np.ndarray, lower: np.ndarray, upper: np.ndarray) -> np.ndarray:
        """The last block that holds each point, (point,) int64, NO_BLOCK without one."""
        place = np.floor((points - self.lower) / self.size)
        chosen = np.flatnonzero(((place >= 0) & (place < self.shape)).all(axis=1))
        index = place[chosen].astype(np.int64)
        code = (index[:, 0] * self.shape[1] + index[:, 1]) * self.shape[2] + index[:, 2]
        row = np.searchsorted(self.codes, code)
        row[row == len(self.codes)] = 0
        listed = self.codes[row] == code
        found = np.full(len(points), NO_BLOCK, np.int64)
        found[chosen[listed]] = _last_that_holds(*self.lists, row[listed], points[chosen[listed]], lower, upper)
        return found


@njit(cache=True)
def _listed(first, last, shape, total):
    """Number of the bin, and block, of each entry; first, last (block, 3): bins that each block reaches into."""
    code, block = np.empty(total, np.int64), np.empty(total, np.int64)
    entry = 0
    for b in range(len(first)):
        for i in range(first[b, 0], last[b, 0] + 1):
            for j in range(first[b, 1], last[b, 1] + 1):
                for k in range(first[b, 2], last[b, 2] + 1):
                    code[entry], block[entry] = (i * shape[1] + j) * shape[2] + k, b
                    entry += 1
    return code, block


@njit(cache=True)
def _last_that_holds(start, block, row, points, lower, upper):
    """The last block of the list of a bin, row (point,), that holds each point, NO_BLOCK without one."""
    found = np.full(len(points), NO_BLOCK, np.int64)
    for p in range(len(points)):
        for entry in range(start[row[p] + 1] - 1, start[row[p]] - 1, -1):
            b = block[entry]
            holds = True
            for axis in range(3):
                holds &= lower[b, axis] <= points[p, axis] <= upper[b, axis]
            if holds:
                found[p] = b
                break
    return found


@njit(cache=True)
def _overlapping(start, block, lower, upper):
    """(block,) bool: those that overlap one before them by more than ROUNDED of the smaller of both, along each
    axis."""
    found = np.zeros(len(lower), np.bool_)
    for row in range(len(start) - 1):
        for later in range(start[row], start[row + 1]):
            b = block[later]
            for before in range(start[row], later):
                if found[b]:
                    break
                a = block[before]
                overlap = True
                for axis in range(3):
                    depth = min(upper[a, axis], upper[b, axis]) - max(lower[a, axis], lower[b, axis])
                    smaller = min(upper[a, axis] - lower[a, axis], upper[b, axis] - lower[b, axis])
                    overlap &= depth > ROUNDED * smaller
                found[b] = overlap
    return found
