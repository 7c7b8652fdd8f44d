"""How many threads work: those that a stage may have, or one where waking more takes longer than the work."""

from collections.abc import Iterator
from contextlib import contextmanager

import numba

FEW_CELLS = 4000  # a kernel over as many takes 20 to 50 us, a thread that sleeps 50 us to wake


def use_threads(threads: int) -> None:
    """Let numba use so many threads, or all there are if fewer."""
    numba.set_num_threads(max(1, min(threads, numba.config.NUMBA_NUM_THREADS)))  # type: ignore[attr-defined]  # set as numba starts


@contextmanager
def threads_for(cells: int) -> Iterator[None]:
    """One thread while kernels go over few cells. No result depends on it (see siblings.py, block_scatter.py)."""
    before = numba.get_num_threads()
    if before == 1 or cells > FEW_CELLS:
        yield
        return
    numba.set_num_threads(1)
    try:
        yield
    finally:
        numba.set_num_threads(before)
