"""Each worker of pytest-xdist has a core of its own: more threads would wait for each other, thousands of times a
second. Tests of numbers of threads set their own."""

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # before numpy

import numba
import pytest


@pytest.fixture(autouse=True)
def one_thread():
    """One thread for every test, whatever another test left."""
    numba.set_num_threads(1)
