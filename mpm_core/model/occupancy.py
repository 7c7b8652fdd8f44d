"""The content of each part of a cell, step by step: rock, then void, fill, and void again where fill is mined.

A cell's parts are its 64 samples (geometry/inside.py). In each step rock and fill are mined first; then fill is placed
in all that stands open within its excavation's solid, whichever excavation opened it; last, what is unsupported then
falls.
"""

from dataclasses import dataclass, replace

import numpy as np
from numba import njit

from mpm_core.scene.scene import Excavation

MIN_SAMPLES_KEPT = 2  # Parts of a cell with fewer samples are dropped.
ALL_SAMPLES = np.uint64(2**64 - 1)
NO_SAMPLES = np.uint64(0)
ROCK_OWNER = -1  # Owner of samples that no excavation has mined.
DIG, PLACE, FALL = range(3)  # kinds of events, in their order within a step


@dataclass(frozen=True)
class Pieces:
    """Parts of cells inside excavations: cell, excavation (piece,) indices, samples (piece,) uint64, one bit each."""

    cell: np.ndarray
    excavation: np.ndarray
    samples: np.ndarray

    def of(self, chosen: np.ndarray) -> "Pieces":
        """The chosen pieces, (piece,) bool."""
        return Pieces(self.cell[chosen], self.excavation[chosen], self.samples[chosen])


@dataclass(frozen=True)
class FinestPieces:
    """Pieces independent of the cells of a grid: place (piece, d) int32, lower corners of finest cells, fine units."""

    place: np.ndarray
    excavation: np.ndarray
    samples: np.ndarray

    @classmethod
    def all_of(cls, parts: list["FinestPieces"], dimension: int) -> "FinestPieces":
        """These, one after another."""
        none = cls(np.empty((0, dimension), np.int32), np.empty(0, np.int16), np.empty(0, np.uint64))
        return cls(**{name: np.concatenate([getattr(part, name) for part in (none, *parts)]) for name in vars(none)})

    def and_then(self, other: "FinestPieces") -> "FinestPieces":
        """These, and others behind them, in the order of excavations."""
        both = FinestPieces.all_of([self, other], self.place.shape[1])
        return both._of(np.argsort(both.excavation, kind="stable"))

    def apart(self) -> "FinestPieces":
        """The same parts of cells, divided where excavations overlap: two pieces of one cell then have the same samples
        or none in common. Divisions of a piece stand one after another, in its place."""
        lowest = self.place.min(axis=0, initial=0)
        shape = tuple(self.place.max(axis=0, initial=0) - lowest + 1)
        code = np.ravel_multi_index(tuple((self.place - lowest).T), shape)
        _, cell, count = np.unique(code, return_inverse=True, return_counts=True)
        order = np.argsort(cell, kind="stable")
        number = np.empty(len(cell), np.int64)  # of a piece among those of its cell
        number[order] = np.arange(len(cell)) - np.repeat(np.cumsum(count) - count, count)
        row, samples = np.arange(len(cell)), self.samples
        for divider in range(count.max(initial=1) if count.max(initial=1) > 1 else 0):
            inside, own = np.zeros(len(count), np.uint64), number == divider
            inside[cell[own]] = self.samples[own]
            inside = inside[cell[row]]
            divided = np.stack([samples & inside, samples & ~inside], axis=1).ravel()
            row, samples = np.repeat(row, 2)[divided != 0], divided[divided != 0]
        return FinestPieces(self.place[row], self.excavation[row], samples)

    def together(self) -> "FinestPieces":
        """One piece for each excavation and cell, of pieces of which those divisions stand one after another."""
        same = (self.place[1:] == self.place[:-1]).all(axis=1) & (self.excavation[1:] == self.excavation[:-1])
        first = np.flatnonzero(np.append(True, ~same)[: len(self.place)])
        whole = self._of(first)
        return whole if not len(first) else replace(whole, samples=np.bitwise_or.reduceat(self.samples, first))

    def _of(self, chosen: np.ndarray) -> "FinestPieces":
        """The chosen pieces, indices, in this order."""
        return FinestPieces(self.place[chosen], self.excavation[chosen], self.samples[chosen])


@dataclass(frozen=True)
class Unsupported:
    """Parts of cells that nothing holds from a step on, rock and fill: they are void from then on.

    cell, step (part,) indices, samples (part,) uint64; piece (part,): number of the piece among those of its step,
    first those that no opening leaves a support (unsupported.py), largest first; fall (part,): number of the fall in
    its step, from 1 on, of rock that came loose as it failed (equilibrium/falls.py), 0 of all other.
    """

    cell: np.ndarray
    samples: np.ndarray
    step: np.ndarray
    piece: np.ndarray
    fall: np.ndarray

    @classmethod
    def none(cls) -> "Unsupported":
        """Nothing is unsupported."""
        return cls(np.empty(0, np.int32), np.empty(0, np.uint64), *(np.empty(0, np.int32) for _ in range(3)))

    def falls_in(self, step: int) -> np.ndarray:
        """(part,) bool: what came loose in a step as it failed."""
        return (self.step == step) & (self.fall > 0)

    def of(self, chosen: np.ndarray) -> "Unsupported":
        """The chosen parts, (part,) bool or indices."""
        return Unsupported(**{name: column[chosen] for name, column in vars(self).items()})

    def and_then(self, other: "Unsupported") -> "Unsupported":
        """These parts and those of a later step."""
        return Unsupported(**{name: np.concatenate([own, getattr(other, name)]) for name, own in vars(self).items()})


@dataclass(frozen=True)
class Changes:
    """Samples that change hands, in the order of steps: cell, owner, step (change,) indices, samples (change,) uint64.

    The owner, ROCK_OWNER or the excavation whose fill it is, loses samples that it holds and gains those that it does
    not: what it holds after a step is the exclusive or of all that it has had until then. Rock starts with all.
    """

    cell: np.ndarray
    owner: np.ndarray
    step: np.ndarray
    samples: np.ndarray

    def until(self, step: int, owned_by_rock: bool) -> np.ndarray:
        """Indices of the changes of rock, or of fill, up to and including a step."""
        return np.flatnonzero(((self.owner == ROCK_OWNER) == owned_by_rock) & (self.step <= step))

    def rock_samples(self, cells: int, step: int) -> np.ndarray:
        """Samples of each cell that are rock once `step` is mined: (cell,) uint64."""
        result = np.full(cells, ALL_SAMPLES)
        now = self.until(step, owned_by_rock=True)
        np.bitwise_xor.at(result, self.cell[now], self.samples[now])
        return result

    def solid_samples(self, cells: int, step: int) -> np.ndarray:
        """Samples of each cell that are rock or fill once `step` is mined and filled: (cell,) uint64."""
        result = np.full(cells, ALL_SAMPLES)
        now = np.flatnonzero(self.step <= step)  # no two owners hold a sample: their exclusive or is all that is held
        np.bitwise_xor.at(result, self.cell[now], self.samples[now])
        return result


def changes_of(pieces: Pieces, excavations: tuple[Excavation, ...], unsupported: Unsupported) -> Changes:
    """The changes of owner of the samples of all cells while these excavations are mined and filled, and unsupported
    parts fall.

    Rock that two solids share goes to the one that mines it first. Slivers are dropped; so is a remainder thinner than
    that: its samples go with what leaves it. No later excavation alters the changes of those before it.
    """
    mined = np.array([excavation.mined for excavation in excavations] or [-1])
    filled = np.array([excavation.filled if excavation.fill else -1 for excavation in excavations] or [-1])
    cell, excavation, samples = pieces.cell, pieces.excavation.astype(np.int64), pieces.samples
    digs, fills = np.flatnonzero(mined[excavation] >= 0), np.flatnonzero(filled[excavation] >= 0)
    piece = np.concatenate([digs, fills])
    kind = np.repeat([DIG, PLACE, FALL], [len(digs), len(fills), len(unsupported.cell)])
    step = np.concatenate([mined[excavation[digs]], filled[excavation[fills]], unsupported.step])
    cell, excavation = (
        np.append(cell[piece], unsupported.cell),
        np.append(excavation[piece], np.full(len(unsupported.cell), ROCK_OWNER)),
    )
    samples = np.append(samples[piece], unsupported.samples)
    order = np.lexsort((excavation, kind, step, cell))
    cell, kind, step, excavation, samples = (column[order] for column in (cell, kind, step, excavation, samples))
    cells, start = np.unique(cell, return_index=True)
    start = np.append(start, len(cell))
    filling = np.add.reduceat(kind == PLACE, start[:-1], dtype=np.int64) if len(cells) else np.zeros(0, np.int64)
    most = np.sum((np.diff(start) - filling) * (1 + filling) + filling)  # every dig may take rock and all fill
    owner, when, what = np.empty(most, np.int16), np.empty(most, np.int32), np.empty(most, np.uint64)
    where = np.empty(most, np.int32)
    held = np.zeros(len(cell), np.uint64)
    count = _follow(cells, start, kind, step, excavation, samples, held, where, owner, when, what)
    order = np.argsort(when[:count], kind="stable")
    return Changes(where[order], owner[order], when[order], what[order])


@njit(cache=True)
def _count(samples):
    """Number of set bits."""
    count = 0
    while samples:
        samples &= samples - np.uint64(1)
        count += 1
    return count


@njit(cache=True)
def _take(wanted, held, least):
    """Samples that go, of those that are wanted and held: none if they are fewer than least, all held if they leave a
    sliver."""
    gone = wanted & held
    if _count(gone) < least:
        return NO_SAMPLES
    return held if _count(held & ~gone) < MIN_SAMPLES_KEPT else gone


@njit(cache=True)
def _follow(cells, start, kind, step, excavation, samples, held, where, owner, when, what):
    """Follow the events of each cell, start (cell + 1,), in order; write its changes and return how many there are.

    kind, step, excavation, samples (event,): DIG, PLACE or FALL, when, of which solid, and what is inside that;
    held (event,) uint64, zeros: what the fill of each event holds; where, owner, when, what (change,): see Changes.
    """
    count = 0
    for i in range(len(cells)):
        rock, void = ALL_SAMPLES, NO_SAMPLES
        for event in range(start[i], start[i + 1]):
            inside = samples[event]
            if kind[event] == PLACE:
                placed = _take(inside, void, MIN_SAMPLES_KEPT)
                held[event] = placed
                void &= ~placed
                if placed:
                    where[count], owner[count], when[count], what[count] = (
                        cells[i],
                        excavation[event],
                        step[event],
                        placed,
                    )
                    count += 1
                continue
            least = 1 if kind[event] == FALL else MIN_SAMPLES_KEPT
            gone = _take(inside, rock, least)
            rock &= ~gone
            void |= gone
            if gone:
                where[count], owner[count], when[count], what[count] = cells[i], ROCK_OWNER, step[event], gone
                count += 1
            for before in range(start[i], event):
                gone = _take(inside, held[before], least)
                held[before] &= ~gone
                void |= gone
                if gone:
                    where[count], owner[count], when[count], what[count] = (
                        cells[i],
                        excavation[before],
                        step[event],
                        gone,
                    )
                    count += 1
    return count
