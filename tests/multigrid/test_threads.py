"""Small levels and small mines are one thread's work; what is left afterwards is what a stage may have."""

import numba
import pytest

from mpm_core.simd.threads import MAX_CELLS_ON_ONE_THREAD, threads_for, use_threads


@pytest.fixture
def two_threads():
    """Two threads."""
    use_threads(2)
    if numba.get_num_threads() < 2:
        pytest.skip("one core")


def _work(cells: int, fail: bool) -> int:
    """Threads that large work inside work on so many cells has."""
    with threads_for(cells), threads_for(MAX_CELLS_ON_ONE_THREAD + 1):
        if fail:
            raise ZeroDivisionError
        return numba.get_num_threads()


@pytest.mark.parametrize(("cells", "threads"), [(MAX_CELLS_ON_ONE_THREAD, 1), (MAX_CELLS_ON_ONE_THREAD + 1, 2)])
def test_few_cells_are_one_threads_work(two_threads, cells, threads):
    """Larger work inside, too; afterwards, whatever has happened, there are as many threads as before."""
    assert _work(cells, fail=False) == threads
    assert numba.get_num_threads() == 2
    with pytest.raises(ZeroDivisionError):
        _work(cells, fail=True)
    assert numba.get_num_threads() == 2


def test_no_more_threads_than_there_are():
    """Whatever is asked for, from none to a thousand."""
    for asked, given in ((0, 1), (1, 1), (1000, numba.config.NUMBA_NUM_THREADS)):
        use_threads(asked)
        assert numba.get_num_threads() == given
