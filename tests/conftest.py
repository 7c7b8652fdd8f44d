"""Each worker of pytest-xdist has a core of its own: more threads would wait for each other, thousands of times a
second. Tests of numbers of threads set their own."""

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # before numpy

import numba
import psutil
import pytest
from hypothesis import settings

# The same examples in each run, in no limited time: machines are busy. `--hypothesis-profile=default` draws others.
settings.register_profile("tests", deadline=None, derandomize=True, print_blob=True)
settings.load_profile("tests")


@pytest.hookimpl(optionalhook=True)  # of pytest-xdist
def pytest_xdist_auto_num_workers() -> int:
    """One worker more than there are cores: the cluster's tests, above all, wait most of their time."""
    return len(psutil.Process().cpu_affinity()) + 1


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """The cluster's tests begin first, so that no other worker waits for them in the end."""
    items.sort(key=lambda item: item.get_closest_marker("slurm") is None)


@pytest.fixture(autouse=True)
def one_thread():
    """One thread for every test, whatever another test left."""
    numba.set_num_threads(1)
