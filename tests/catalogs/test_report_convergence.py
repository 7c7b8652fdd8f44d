"""The convergence panels: what the line shows."""

import io

import numpy as np
import pytest
import xarray as xr
from report_fixtures import make_page

from catalogs.report.sections.convergence import convergence, running_iteration
from common.datasets import read_dataset, write_dataset


def stage_of(**columns) -> xr.Dataset:
    """A step with these columns of its table of convergence."""
    return xr.Dataset(
        {f"convergence_{name}": ("iteration", np.array(values)) for name, values in columns.items()},
        attrs={"stage": "step", "step": "2019-08", "tolerance": 1e-4},
    )


@pytest.mark.filterwarnings("error")
def test_a_stage_that_has_nothing_to_solve_says_so():
    """One that mines nothing is in equilibrium from the start: zero has no place on the axis."""
    zero = {"increment": [1, 1], "generation": [0, 1], "iteration": [0, 0], "unbalanced_ratio": [0.0, 0.0]}
    idle = stage_of(**zero, max_ratio=[0.0, 0.0], cells=[100, 100], new_failures=[0, 0])
    figure = convergence([idle])
    figure.savefig(io.BytesIO(), format="svg")
    assert [text.get_text() for text in figure.get_axes()[0].texts] == ["nothing to solve"]


def test_line_is_of_the_whole_mine_and_bars_of_all_that_fails():
    """A part of the mine reaches equilibrium between two checks of the whole: only its failures count."""
    columns = {
        "increment": [1, 1, 1, 1, 1],
        "generation": [0, 1, 2, 2, 2],
        "iteration": [3, 5, 8, 9, 11],
        "unbalanced_ratio": [1e-3, 1e-6, 1e-6, 2e-3, 1e-5],
        "max_ratio": [1e-4] * 5,
        "cells": [100, 20, 20, 100, 100],
        "new_failures": [4, 2, 0, 0, 0],
    }
    stage = stage_of(**columns)
    axes, bars = convergence([stage]).get_axes()
    assert axes.get_lines()[0].get_xydata().tolist() == [[3, 1e-3], [9, 2e-3], [11, 1e-5]]
    assert [path[1][1] for path in bars.collections[0].get_segments()] == [4, 2]


def test_increments_are_marked_from_bottom_to_top_and_generations_at_the_bottom():
    """Each where it begins; where both begin, the increment."""
    columns = {
        "increment": [1, 1, 2, 2, 3],
        "generation": [0, 1, 0, 1, 1],
        "iteration": [3, 5, 8, 9, 11],
        "unbalanced_ratio": [1e-3] * 5,
        "max_ratio": [1e-4] * 5,
        "cells": [100] * 5,
        "new_failures": [0] * 5,
    }
    axes = convergence([stage_of(**columns)]).get_axes()[0]
    increments, generations = (np.array(marks.get_segments()) for marks in axes.collections)
    assert increments.tolist() == [[[8, 0], [8, 1]], [[11, 0], [11, 1]]]
    assert generations[:, 0].tolist() == [[5, 0], [9, 0]]
    assert 0.0 < generations[:, 1, 1].max() < 0.1


def test_iterations_run_on_where_the_counter_starts_anew():
    restarting = [0, 1, 2, 0, 1, 0, 5]
    assert list(running_iteration(np.array(restarting))) == [0, 1, 2, 3, 4, 5, 10]
    assert list(running_iteration(np.array([1, 2, 3, 1, 2]))) == [1, 2, 3, 4, 5]


@pytest.mark.filterwarnings("error::RuntimeWarning")
def test_a_stage_that_mines_nothing_has_no_finest_cells(mine, tmp_path):
    """Nothing is a share of them."""
    write_dataset(read_dataset(mine.elastic).assign_attrs(finest_cells=0), tmp_path / "elastic.nc")
    alone = {"steps": [], "events": [], "catalog": None, "record": None, "comparison": None}
    content = make_page(mine, tmp_path, elastic=tmp_path / "elastic.nc", **alone)
    assert "nan" not in content.sections["convergence"]
