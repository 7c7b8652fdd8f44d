"""The convergence table of a stage, and the error where equilibrium is not reached."""

import logging
import time
from dataclasses import dataclass, field

import numpy as np
from tqdm import tqdm

from common.errors import InputError

# Seconds between two lines of the log on where a relaxation stands. The terminal shows the latest of them.
SECONDS_BETWEEN_RESIDUALS = 20.0
MIN_UNBALANCED_SHARE = 1e-12  # Unbalanced force below this share of all forces since virgin rock is round-off.
HISTORY_COLUMNS = (
    *("increment", "generation", "iteration", "unbalanced_ratio", "max_ratio", "cells", "load", "new_failures"),
)


class NoEquilibrium(InputError):
    """Rock under these forces does not reach equilibrium within solver.max_iterations, or runs away.

    loose (k,): particles that have come loose (falls.py), of the body that was to reach it.
    """

    def __init__(self, message: str, loose: np.ndarray | None = None):
        super().__init__(message)
        self.loose = np.empty(0, np.int64) if loose is None else loose


def norm(values: np.ndarray) -> float:
    """2-norm with numpy's own pairwise sum: the same bits with any number of threads (BLAS does not promise that)."""
    return float(np.sqrt(np.sum(values * values)))


@dataclass
class History:
    """The convergence table of a stage, one row per check: see HISTORY_COLUMNS. Iterations count through the whole
    stage."""

    tolerance: float
    rows: list[tuple] = field(default_factory=list)
    iteration: int = 0
    increment: int = 0
    generation: int = 0
    cells: int = 0  # that are brought to equilibrium now: all, or a subdomain's
    tightened: int = 0  # how often the tolerance between generations has been tightened in this increment
    splits: int = 0  # how often cells have been split in this stage
    load: float = 0.0  # share of it that acts
    load_before: float = 0.0  # at the end of the increment before
    size: float = np.inf  # parts; of the next increment, where it follows its error
    collapse: str = ""  # why the stage has ended in collapse
    bar: tqdm | None = None
    # The last state in equilibrium, where it may be the result; empty elsewhere.
    last_equilibrium: dict[str, np.ndarray] = field(default_factory=dict)
    equilibrium_increment: int = 0  # of that state
    equilibrium_load: float = 0.0
    since: tuple = (None, 0.0, 0.0)  # generation, clock and ratio from which the pace is computed
    logged: float = field(default_factory=time.perf_counter)  # when the log last said where the stage stands

    @property
    def unbalanced_ratio(self) -> float:
        """Unbalanced force over the reference at the latest check."""
        return self.rows[-1][HISTORY_COLUMNS.index("unbalanced_ratio")]

    def check(self, ratio: float, max_ratio: float) -> None:
        """Note one check of the unbalanced force. Raises InputError if it is not a number."""
        self.rows.append((self.increment, self.generation, self.iteration, ratio, max_ratio, self.cells, self.load, 0))
        if not np.isfinite(ratio):
            raise InputError(
                f"unbalanced force is not a number at iteration {self.iteration} (increment {self.increment}, "
                f"generation {self.generation}): the state is saved next to the output as .failed.npz; "
                "check moduli and loads"
            )
        where = f"increment {self.increment}, generation {self.generation}, unbalanced {ratio:.1e}{self._left(ratio)}"
        if self.bar is not None:
            self.bar.set_postfix_str(where, refresh=False)
        if time.perf_counter() - self.logged > SECONDS_BETWEEN_RESIDUALS:
            logging.info(where)
            self.logged = time.perf_counter()

    def _left(self, ratio: float) -> str:
        """Seconds to full tolerance at the pace since this generation began, as text for the progress bar."""
        now = (self.increment, self.generation)
        if self.since[0] != now:
            self.since = (now, time.perf_counter(), ratio)
        _, began, first = self.since
        if not self.tolerance < ratio < first:
            return ""
        pace = np.log(first / ratio) / max(time.perf_counter() - began, 1e-9)
        return f", equilibrium in about {np.log(ratio / self.tolerance) / pace:.0f} s"

    def failures(self, count: int) -> None:
        """Note how many particles failed after the latest check."""
        *row, _ = self.rows[-1]
        self.rows[-1] = (*row, count)
        logging.info("increment %d, generation %d, iteration %d: unbalanced %.2e, %d particles fail", *row[:4], count)

    def table(self) -> dict[str, np.ndarray]:
        """Columns as arrays, by name."""
        columns = list(zip(*self.rows, strict=True)) or [()] * len(HISTORY_COLUMNS)
        types = (np.int32, np.int32, np.int32, float, float, np.int32, float, np.int32)
        return {
            name: np.array(column, kind) for name, column, kind in zip(HISTORY_COLUMNS, columns, types, strict=True)
        }
