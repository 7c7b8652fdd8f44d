"""Results that are kept: as the function gives them, each calculated once."""

import numpy as np
import pytest

from mpm_core.grid import distorted_cells
from mpm_core.grid.distorted_cells import RowCache


@pytest.fixture
def summed():
    """A function of rows to their sum and product, and how many rows it was asked for."""
    asked = []

    def function(rows: np.ndarray) -> np.ndarray:
        asked.append(len(rows))
        return np.stack([rows.sum(axis=1), rows.prod(axis=1)], axis=1).astype(float)

    return function, asked


def rows(*values) -> np.ndarray:
    return np.array(values, np.uint64)


def test_each_row_is_calculated_once(summed):
    """Whatever the order of rows, and if one is there twice."""
    function, asked = summed
    known = RowCache(function, 100)
    first = rows([1, 2, 3], [4, 5, 6], [1, 2, 3])
    np.testing.assert_array_equal(known(first), [[6, 6], [15, 120], [6, 6]])
    np.testing.assert_array_equal(known(rows([7, 1, 1], [4, 5, 6], [3, 2, 1])), [[9, 7], [15, 120], [6, 6]])
    np.testing.assert_array_equal(known(first), [[6, 6], [15, 120], [6, 6]])
    assert asked == [2, 2]


def test_it_begins_anew_where_there_would_be_too_many(summed):
    function, asked = summed
    known = RowCache(function, 3)
    known(rows([1, 1], [2, 2], [3, 3]))
    np.testing.assert_array_equal(known(rows([1, 1], [4, 4])), [[2, 1], [8, 16]])
    known(rows([4, 4]))
    assert asked == [3, 2]


def test_rows_of_one_key_are_told_apart(summed, monkeypatch):
    """Every row has key 0: the first is kept, the others are calculated each time."""
    monkeypatch.setattr(distorted_cells, "FACTORS", np.zeros(4, np.uint64))
    function, asked = summed
    known = RowCache(function, 100)
    for _ in range(2):
        np.testing.assert_array_equal(known(rows([1, 2], [3, 4], [1, 2])), [[3, 2], [7, 12], [3, 2]])
    assert asked == [1, 1, 1]
