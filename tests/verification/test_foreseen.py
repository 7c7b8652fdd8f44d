"""What a quote foresees beside what a run takes: rows of a tiny mine, and shares of quotes that are near."""

import os

import numpy as np
import pandas as pd
import pytest
from matplotlib.figure import Figure

from common.errors import InputError
from verification import foreseen
from verification.foreseen import study
from verification.foreseen.study import COLUMNS, STUDY, held, mines_of
from workflow.configuration import load_mine

FLAT = study.BASE / "tests/golden/mines/flat.yaml"


def row(**changes) -> dict:
    """A quote that is right."""
    values = {"mine": "made_up", "finest_cell_m": 2.0, "pilot_cell_m": 4.0, "quote_s": 1.0, "foreseen_s": 10.0,
              "took_s": 10.0, "foreseen_cells": 900, "cells": 900, "foreseen_MB": 500.0, "memory_MB": 500.0,
              "stated_error": 0.1, "potency_error": 0.08, "volume_error": 0.06}  # fmt: skip
    return values | changes


def test_shares_of_quotes_within_factors_and_of_errors_within_what_was_stated():
    rows = [
        row(),
        row(took_s=14.0, memory_MB=700.0, volume_error=0.11),
        row(took_s=6.0, stated_error=0.17, pilot_cell_m=2.0),  # tried on its own cells
        row(took_s=30.0, stated_error=np.nan),
        row(took_s=10.0, potency_error=np.nan, volume_error=np.nan, stated_error=np.inf),
        row(potency_error=np.inf, volume_error=np.inf),  # nothing failed in the run: not within any error
    ]
    request = {"mine": "raise", "asked": "error 10 %", "finest_cell_m": 2.0, "cells": 9, "took_s": 30.0}
    asked = [request | {"potency_error": 0.04, "volume_error": 0.02}, request | {"took_over_asked": 0.5}]
    made = STUDY.tables({"a": rows[:2], "b": rows[2:], f"{foreseen.REQUESTS}-raise": asked})
    assert list(made["requested"].columns) == list(study.REQUEST_COLUMNS)
    assert made["requested"]["largest_error"].tolist() == pytest.approx([0.04, np.nan], nan_ok=True)
    assert list(made["table"].columns) == list(COLUMNS)
    shares = held(made["table"]).set_index("what")
    assert shares["share"].tolist() == pytest.approx([4 / 6, 5 / 6, 4 / 5, 4 / 5, 5 / 6, 5 / 8, 3 / 4])
    assert shares["quotes"].tolist() == [6, 6, 5, 5, 6, 8, 4]
    figure = STUDY.figures({"a": rows, f"{foreseen.REQUESTS}-raise": asked})["figure"]
    assert isinstance(figure, Figure)
    labels = [panel.get_xlabel() for panel in figure.axes]
    assert labels == ["processor time (s), found", "memory (MB), found", "processor time (s)"]


def test_each_mine_is_quoted_and_run(monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(study, "mines_of", lambda name: [load_mine(FLAT, {"grid": {"levels": 3}})])
    monkeypatch.setattr(study, "MINES", {"mine_flat": None})
    (found,) = STUDY.measure("mine_flat", {}, 1)
    assert found["mine"] == "flat"
    assert found["finest_cell_m"] == 2.5
    assert found["pilot_cell_m"] in (2.5, 5.0)
    assert found["took_s"] > 0.0
    assert found["foreseen_s"] > 0.0
    assert 0.2 < found["foreseen_cells"] / found["cells"] < 5.0
    assert np.isnan(found["potency_error"])
    assert found.keys() | {"foreseen_over_took"} == set(COLUMNS)
    assert len(STUDY.tables({"mine_flat": [found]})["table"]) == 1


def test_a_mine_that_asks_for_its_cells_is_run_on_them_and_on_smaller_ones(monkeypatch):
    monkeypatch.setattr(os, "sched_setaffinity", lambda *_: None)  # or the tests that follow have one core
    monkeypatch.setattr(study, "on_requested_cells", lambda mine, request, file: mine)
    ran = []

    def run(mine):
        ran.append(mine.finest_cell)
        return 9, float(len(ran)), 2.0

    monkeypatch.setattr(study, "run", run)
    by_error, by_time = STUDY.measure(f"{foreseen.REQUESTS}-raise", {}, 1)
    assert (by_error["asked"], by_time["asked"]) == ("error 10 %", "time 1 min")
    assert ran == pytest.approx([2.0, 2.0 / study.FINER, 2.0])
    assert by_error["potency_error"] == pytest.approx(2.0 / 3.0)  # 1 on the cells, 2 on half of them, 3 in the limit
    assert by_time["took_over_asked"] == pytest.approx(study.REPORT_SECONDS / 60.0, rel=0.2)


def test_the_cases_are_mines_on_the_sizes_that_are_named():
    for name, (_, sizes) in foreseen.MINES.items():
        found = [mine.finest_cell for mine in mines_of(name)]
        assert found == pytest.approx(list(sizes)) or (name == "mine_elk_creek" and not found)  # data of others
    assert [mine.finest_cell for mine in mines_of("stope")] == [2.5, 1.25]
    assert [mine.finest_cell for mine in mines_of(foreseen.SECTION)] == list(foreseen.SECTION_SIZES)


def test_only_the_mine_whose_data_are_of_others_may_be_left_out(monkeypatch):
    """A mistake in the file of any other one took it from table and page."""

    def load_mine(path):
        raise InputError("wrong")

    monkeypatch.setattr(study, "load_mine", load_mine)
    assert not list(mines_of("mine_elk_creek"))
    with pytest.raises(InputError, match="wrong"):
        list(mines_of("mine_demo"))


def test_cases_are_named_once():
    assert pd.Series(foreseen.CASES).is_unique
