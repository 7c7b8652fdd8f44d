"""The table of what mines cost, from made-up logs, and its figure."""

from types import SimpleNamespace

import numpy as np
import pytest
import xarray as xr
from matplotlib.figure import Figure
from running import DEFAULT, STUDIES

from common.costs import Costs
from common.errors import InputError
from verification.mine_times.study import STUDY, rows_of
from verification.page_tables import Columns
from verification.results import Variant
from verification.studies import load_study

COSTS = {
    "grid": Costs(9.0, 3.0, 1.0, 300.0),
    "elastic": Costs(9.0, 30.0, 25.0, 400.0),
    "steps/history": Costs(99.0, 40.0, 8.0, 500.0),
    "steps/month": Costs(99.0, 88.0, 0.0, 700.0),
    "events": Costs(9.0, 1.0, 0.0, 200.0),
}
GRID = xr.Dataset({"node": ("cell", np.zeros(1000))}, {}, {"fine_cell": 2.0})
STEPS = {"steps/history.nc": xr.Dataset(attrs={"cells": 1500}), "steps/month.nc": xr.Dataset(attrs={"cells": 4000})}


def variant(costs=COSTS) -> Variant:
    mine = SimpleNamespace(name="demo", mined_steps=["history", "month"])
    return Variant(mine, (STEPS | {"grid.nc": GRID}).__getitem__, costs.get)


def test_a_run_counts_processor_time_without_compiling():
    """2 s of the grid, 5 s of the elastic state, 32 s and 88 s of the steps, 1 s of the events."""
    run, steps = rows_of(variant())
    assert run["processor_min"] == pytest.approx(128.0 / 60.0)
    assert (run["steps"], run["cells_at_start"], run["cells_at_end"]) == (2, 1000, 4000)
    assert (run["grid_s"], run["elastic_s"], run["events_s"]) == (2.0, 5.0, 1.0)
    assert (run["step_s"], run["longest_step_s"], run["memory_MiB"]) == (60.0, 88.0, 700.0)
    assert [(step["step"], step["cells"], step["processor_s"]) for step in steps] == [
        ("history", 1500, 32.0),
        ("month", 4000, 88.0),
    ]


def test_a_stage_without_costs_is_named():
    with pytest.raises(InputError, match=r"demo: the log of steps/month does not state its costs"):
        rows_of(variant({stage: costs for stage, costs in COSTS.items() if stage != "steps/month"}))


def test_tables_and_figure_show_every_run_and_step():
    run, steps = rows_of(variant())
    start = {"mine": "demo", "finest_cell_m": 2.0}
    results = {"times_demo": {"runs": [start | run], "steps": [start | step for step in steps]}}
    tables = STUDY.tables(results)
    assert [len(tables[name]) for name in ("table", "steps")] == [1, 2]
    for shown in STUDY.shown:
        assert isinstance(shown, Columns)
        assert len(shown.lines(tables[shown.file])) > 4
    assert isinstance(STUDY.figures(results)["steps"], Figure)


@pytest.mark.parametrize("name", ["times_demo", "times_template"])
def test_runs_of_a_mine_differ_by_their_cells_alone(name):
    """A row of the table stands for a size of cells."""
    mines = list(load_study(STUDIES / f"{name}.yaml", DEFAULT).mines.values())
    cells = [mine.settings.grid.coarse_cell / 2 ** (mine.settings.grid.levels - 1) for mine in mines]
    assert cells == sorted(cells, reverse=True)
    assert all(mine.mined_steps == mines[0].mined_steps for mine in mines)
    assert all(mine.settings.materials == mines[0].settings.materials for mine in mines)
