"""The study of shaking, reduced to seconds, and rows that fail where a formula is wrong."""

import copy
from dataclasses import replace

import numpy as np
import pytest
from matplotlib.figure import Figure
from running import run_study

from shaking import hazard
from verification.answers import shaking


def reduced(folder):
    """The study with few draws, and bounds as much wider."""
    results = run_study("shaking", folder)
    chosen = copy.deepcopy(results.settings)
    chosen["steps"] |= {"drawn": 40000}
    chosen["process"] |= {"catalogues": 30, "cases": chosen["process"]["cases"][2:3]}
    chosen["fit"] |= {"records": 60, "cases": chosen["fit"]["cases"][:1]}
    chosen["line"] |= {"spacing": 0.2}
    wider = {"chance": 0.012, "coverage": 0.09, "bias": 0.5, "closed_form": 4e-3}
    results.study = replace(results.study, settings=chosen, allowed=results.allowed | wider)
    return results


def test_the_reduced_study_passes(tmp_path):
    rows, figure = shaking.answer(reduced(tmp_path))
    assert isinstance(figure, Figure)
    assert [row.quantity for row in rows if row.passed is not True] == []
    assert len({row.quantity for row in rows}) == len(rows) == 2 + 3 + 6 + 6 + 3 + 7


def test_every_row_of_a_table_is_in_it(tmp_path):
    """The patterns of the page's tables find their rows."""
    rows, _ = shaking.answer(reduced(tmp_path))
    placed = [sum(table.place({"quantity": row.quantity}) is not None for row in rows) for table in shaking.TABLES]
    assert placed == [6, 3, 3]


@pytest.mark.parametrize("wrong", ["scatter", "weight", "clusters"])
def test_a_wrong_formula_fails_its_rows(tmp_path, monkeypatch, wrong):
    """Scatter left out; events that count twice; clusters taken as independent."""
    if wrong == "scatter":
        right = hazard.exceedance
        monkeypatch.setattr(hazard, "exceedance", lambda v, m, d, limit: right(v, m, 0.0 * np.asarray(d), limit))
    elif wrong == "weight":
        right_weights = hazard.Shaking.weights
        monkeypatch.setattr(hazard.Shaking, "weights", lambda self, v: 2.0 * right_weights(self, v))
    else:
        monkeypatch.setattr(hazard.Shaking, "rate_of", lambda self, chance: -np.log1p(-np.asarray(chance)))
    failed = {row.quantity.split(":")[0] for row in shaking.answer(reduced(tmp_path))[0] if row.passed is False}
    expected = {"scatter": "line of sources with scatter", "weight": "one source"}
    assert expected.get(wrong, "steps of variance over mean 3") in failed
