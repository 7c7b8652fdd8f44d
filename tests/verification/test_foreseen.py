"""What a quote foresees beside what a run takes: rows of a tiny mine, and shares of quotes that are near."""

import numpy as np
import pandas as pd
import pytest
from matplotlib.figure import Figure

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
        row(took_s=6.0, stated_error=0.17),
        row(took_s=30.0, stated_error=np.nan),
        row(took_s=10.0, potency_error=np.nan, volume_error=np.nan, stated_error=np.inf),
    ]
    made = STUDY.tables({"a": rows[:2], "b": rows[2:]})
    assert list(made["table"].columns) == list(COLUMNS)
    shares = held(made["table"]).set_index("what")
    assert shares["share"].tolist() == pytest.approx([3 / 5, 4 / 5, 4 / 5, 5 / 6, 2 / 3])
    assert shares["quotes"].tolist() == [5, 5, 5, 6, 3]
    figure = STUDY.figures({"a": rows})["figure"]
    assert isinstance(figure, Figure)
    assert [panel.get_xlabel() for panel in figure.axes] == ["processor time (s), found", "memory (MB), found"]


def test_each_mine_is_quoted_and_run(monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(study, "mines_of", lambda name: [load_mine(FLAT, {"grid": {"levels": 3}})])
    monkeypatch.setattr(study, "MINES", {"mine_flat": None})
    (found,) = STUDY.measure("mine_flat", {}, 1)
    assert found["mine"] == "flat"
    assert (found["finest_cell_m"], found["pilot_cell_m"]) == (2.5, 5.0)
    assert found["took_s"] > 0.0
    assert found["foreseen_s"] > 0.0
    assert 0.2 < found["foreseen_cells"] / found["cells"] < 5.0
    assert np.isnan(found["potency_error"])
    assert found.keys() | {"foreseen_over_took"} == set(COLUMNS)
    assert len(STUDY.tables({"mine_flat": [found]})["table"]) == 1


def test_the_cases_are_mines_on_the_sizes_that_are_named():
    for name, (_, sizes) in foreseen.MINES.items():
        assert [mine.finest_cell for mine in mines_of(name)] == pytest.approx(list(sizes))
    assert [mine.finest_cell for mine in mines_of("stope")] == [2.5, 1.25]
    assert pd.Series(foreseen.CASES).is_unique
