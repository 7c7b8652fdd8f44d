"""The study of growth: rows of stages from made-up logs, exponents of known growth, and drawn mines that are tiny."""

from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
import xarray as xr
import yaml
from matplotlib.figure import Figure

from common.costs import Costs
from common.errors import InputError
from verification.extremes.tiny_mine import TINY
from verification.page_tables import Columns
from verification.results import Variant
from verification.scale import ARRAYS, arrays, drawn
from verification.scale.study import COLUMNS, HISTORY, LATER, STUDY, growth_of, rows_of_stages

COSTS = {
    "grid": Costs(9.0, 3.0, 1.0, 300.0),
    "elastic": Costs(9.0, 30.0, 25.0, 400.0),
    "steps/history": Costs(99.0, 40.0, 8.0, 500.0),
    "steps/month": Costs(99.0, 88.0, 0.0, 700.0),
}
GRID = xr.Dataset({"node": ("cell", np.zeros(1000))}, {}, {"fine_cell": 2.0})
STEPS = {
    f"steps/{name}.nc": xr.Dataset(attrs={"cells": cells, "failed_particles": failed})
    for name, cells, failed in (("history", 1500, 20), ("month", 4000, 30))
}


def variant(costs=COSTS) -> Variant:
    mine = SimpleNamespace(name="demo", mined_steps=["history", "month"])
    return Variant(mine, (STEPS | {"grid.nc": GRID}).__getitem__, costs.get)


def test_each_stage_has_the_cells_that_it_ends_with_and_no_compiling():
    rows = [tuple(row.values()) for row in rows_of_stages(variant(), "cells", "cell_2")]
    assert rows == [
        ("cells", "cell_2", 1000, "grid", 2.0, 300.0, 0),
        ("cells", "cell_2", 1000, "elastic", 5.0, 400.0, 0),
        ("cells", "cell_2", 1500, HISTORY, 32.0, 500.0, 20),
        ("cells", "cell_2", 4000, LATER, 88.0, 700.0, 30),
    ]


def test_a_stage_without_costs_is_named():
    with pytest.raises(InputError, match=r"demo: the log of elastic does not state its costs"):
        rows_of_stages(variant({"grid": COSTS["grid"]}), "cells", "cell_2")


@pytest.mark.parametrize("exponent", [1.0, 1.7])
def test_exponents_are_those_of_the_growth(exponent):
    """Sizes in any order; later steps of two runs, whose sizes differ little within a run; nothing below a second."""
    sizes = [10_000, 100, 1000]
    single = pd.DataFrame({"case": "openings", "stage": "grid", "size": sizes})
    later = pd.DataFrame({"case": "cells", "stage": LATER, "size": [8000, 9900, 1000, 1010], "run": list("aabb")})
    table = pd.concat([single, later], ignore_index=True)
    table["processor_s"] = 2.0 * (table["size"] / 1000.0) ** exponent
    found = growth_of(table)
    alone = found[found["stage"] == "grid"]
    assert alone["from"].tolist() == [1000]  # of 100 it is 0.2 s or less
    assert alone["exponent"].tolist() == pytest.approx([exponent])
    steps = found[found["stage"] == LATER]
    assert len(steps) == 1
    assert steps["exponent"].item() == pytest.approx(exponent, abs=0.02)


def test_drawn_mines_are_planned_and_have_a_grid(monkeypatch):
    monkeypatch.setitem(drawn.SIZES, "openings", (3, 6))
    rows = drawn.rows_of("openings", threads=1)
    assert [(row["size"], row["stage"]) for row in rows] == [
        (size, stage) for size in (3, 6) for stage in ("plan of jobs", "grid")
    ]
    assert all(row["processor_s"] > 0.1 and row["memory_MiB"] > 30.0 for row in rows)
    tables = STUDY.tables({"openings": rows})
    for shown in STUDY.shown:
        assert isinstance(shown, Columns)
        assert shown.lines(tables[shown.file]) or shown.file == ARRAYS
    assert all(isinstance(figure, Figure) for figure in STUDY.figures({"openings": rows}).values())


def test_catalogues_that_are_drawn_have_their_stages_and_a_page(monkeypatch):
    for name, few in (("OPENINGS_OF_EVENTS", 20), ("STEPS_OF_EVENTS", 4), ("MAX_EVENTS_IN_QUAKEML", 40)):
        monkeypatch.setattr(drawn, name, few)
    monkeypatch.setitem(drawn.SIZES, "events", (50,))
    rows = drawn.rows_of("events", threads=1)
    assert [row["stage"] for row in rows] == list(drawn.STAGES_OF_EVENTS)
    assert rows[-1]["page_MB"] > 0.5


def test_the_memory_of_a_tiny_mine_is_told_by_the_lines_that_take_it(tmp_path, monkeypatch):
    """Most of what is traced has a line of the mechanics; the grid's nodes are among it."""
    mine = tmp_path / "tiny.yaml"
    mine.write_text(yaml.safe_dump({key: value for key, value in TINY.items() if key != "record"}))
    monkeypatch.setattr(arrays, "MINE", mine)
    monkeypatch.setattr(arrays, "PAUSE", 1e-3)
    grid = dict(zip(COLUMNS, ("openings", "", 3, "grid", 1.0, 100.0), strict=False))
    table = STUDY.tables({"openings": [grid], ARRAYS: arrays.rows_of_arrays()})[ARRAYS]
    assert set(table["stage"]) == set(arrays.STAGES)
    assert (table["bytes_per_cell"] >= 0.0).all()
    lines = table[table["file"].str.startswith("mpm_core/")]
    assert lines["code"].str.len().min() > 0
    assert (lines.groupby("stage")["bytes_per_cell"].sum() > 1.0).all()  # short stages are seen at a few moments only


def test_a_command_that_fails_is_named(tmp_path):
    with pytest.raises(InputError, match=r"scale: import sys.*: the reason"):
        drawn._run([drawn.sys.executable, "-c", "import sys; sys.exit('the reason')"], tmp_path)
