"""Results of a function of rows of numbers, kept for when the same rows are asked for again."""

from collections.abc import Callable

import numpy as np

FACTORS = np.random.default_rng(1).integers(0, 1 << 63, 64, np.uint64) * np.uint64(2) + np.uint64(1)
"""Odd factors of a row's numbers in its key."""


class Remembered:
    """A function of rows (k, n) uint64 to results (k, m) float64, row by row, which keeps the results of so many rows
    at `most`."""

    def __init__(self, function: Callable[[np.ndarray], np.ndarray], most: int):
        self.function, self.most = function, most
        self.forget()

    def forget(self) -> None:
        """Keep no results."""
        self.keys, self.rows, self.results = np.empty(0, np.uint64), np.empty((0, 0)), np.empty((0, 0))

    def __call__(self, rows: np.ndarray) -> np.ndarray:
        """Results (k, m) of rows (k, n); what is not known is calculated once."""
        keys = rows @ FACTORS[: rows.shape[1]]  # modulo 2^64
        place, known = self._find(keys, rows)
        if not known.all():
            new = np.flatnonzero(~known)
            if len(self.keys) + len(new) > self.most:
                self.forget()
                new = np.arange(len(rows))
            self._keep(keys, rows, new)
            place, known = self._find(keys, rows)
        results = self.results[place]
        other = np.flatnonzero(~known)  # rows that differ and have one key: hardly ever any
        if len(other):
            results[other] = self.function(rows[other])
        return results

    def _find(self, keys: np.ndarray, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Where rows are among those kept, if they are (k,) bool."""
        if not len(self.keys):
            return np.zeros(len(rows), int), np.zeros(len(rows), bool)
        place = np.minimum(np.searchsorted(self.keys, keys), len(self.keys) - 1)
        return place, (self.keys[place] == keys) & (self.rows[place] == rows).all(axis=1)

    def _keep(self, keys: np.ndarray, rows: np.ndarray, new: np.ndarray) -> None:
        """Keep the results of new rows, one for each key."""
        _, first = np.unique(keys[new], return_index=True)
        new = new[first]
        new = new[~np.isin(keys[new], self.keys)]
        if not len(new):
            return
        keys, rows, results = keys[new], rows[new], self.function(rows[new])
        if len(self.keys):
            keys, rows = np.concatenate([self.keys, keys]), np.concatenate([self.rows, rows])
            results = np.concatenate([self.results, results])
        order = np.argsort(keys)
        self.keys, self.rows, self.results = keys[order], rows[order], results[order]
