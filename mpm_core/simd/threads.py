"""The number of threads: those that a stage may have, or one where waking more takes longer than the work."""

from collections.abc import Iterator
from contextlib import contextmanager

import numba

MAX_CELLS_ON_ONE_THREAD = 4000  # For kernels over so few cells, waking a thread takes as long as the work.


def use_threads(threads: int) -> None:
    """Let numba use so many threads, or all there are if fewer."""
    numba.set_num_threads(max(1, min(threads, numba.config.NUMBA_NUM_THREADS)))  # type: ignore[attr-defined]  # set as numba starts


@contextmanager
def threads_for(cells: int) -> Iterator[None]:
    """One thread while kernels go over few cells. No result depends on it (see siblings.py, block_scatter.py)."""
    before = numba.get_num_threads()
    if before == 1 or cells > MAX_CELLS_ON_ONE_THREAD:
        yield
        return
    numba.set_num_threads(1)
    try:
        yield
    finally:
        numba.set_num_threads(before)
