"""Small scenes run faster on one thread; the tests of thread counts set their own."""

import numba
import pytest


@pytest.fixture(autouse=True)
def one_thread():
    """One thread for every test here, whatever another test left."""
    before = numba.get_num_threads()
    numba.set_num_threads(1)
    yield
    numba.set_num_threads(before)
