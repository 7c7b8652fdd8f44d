"""Scores of Elk Creek's instruments on made readings whose truth is known; the recorded data are not needed."""

import math

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from verification.answers import elk_creek as study
from workflow.mines.elk_creek_instruments import Instrument
from workflow.mines.longwall import Panel, seconds

STAGES = np.array([-300.0, -100.0, -50.0, 0.0])
DAY = pd.Timestamp("2010-01-01")


def panel(name: str, y: float) -> Panel:
    """A face 200 m long that advances along x from -400 to 100 m, 10 m a day."""
    x = np.array([-400.0, 100.0])
    dates = np.array([seconds(DAY), seconds(DAY + pd.Timedelta(days=50))])
    return Panel(name, dates, np.column_stack([x, [y, y]]), np.column_stack([x, [y + 200.0] * 2]))


def cell(name: str, place: tuple[float, float], change, reach: float = 80.0, kind: str = "cell") -> Instrument:
    """An instrument at x near 0 whose reading (MPa, or mm) follows `change` of the face's distance, up to a reach."""
    days = np.arange(0.0, 48.0, 0.25)
    face = -400.0 + 10.0 * days
    keep = face <= reach
    value = np.array([change(distance) for distance in face]) * (1e6 if kind == "cell" else 1e-3)
    table = pd.DataFrame({"face": face, "value": value}, index=DAY + pd.to_timedelta(days, unit="D"))[keep]
    return Instrument("2N Inby", name, kind, np.array(place), table, "1")


def rising(scale: float):
    return lambda distance: 5.0 + scale * math.exp(distance / 100.0)


def test_changes_count_from_the_first_stage():
    """Readings that end earlier have no later stage; a cell that is read from -100 m on counts from there."""
    whole, short = cell("A", (0.0, -20.0), rising(3.0)), cell("B", (2.0, 230.0), rising(1.0), reach=-60.0)
    late = cell("C", (0.0, -5.0), rising(2.0))
    late = Instrument(**{**vars(late), "readings": late.readings[late.readings["face"] > -120.0]})
    found = study.passing(panel("1", 0.0), [whole, short, late], [whole, short, late], STAGES)
    expected = 3.0 * (np.exp(STAGES / 100.0) - math.exp(-3.0))
    np.testing.assert_allclose(found.change[0], expected, rtol=1e-6)
    np.testing.assert_allclose(found.change[1, :2], [0.0, expected[1] / 3.0], rtol=1e-6)
    assert np.isnan(found.change[1, 2:]).all()
    assert found.first.tolist() == [0, 0, 1]
    np.testing.assert_allclose(found.rib, [20.0, 30.0, 5.0])
    assert found.compared.tolist() == [
        [False, True, True, True],
        [False, True, False, False],
        [False, False, True, True],
    ]


def test_closures_are_read_at_the_times_of_the_face():
    """A few readings of a closure station, between which time decides."""
    at_site = cell("A", (0.0, -20.0), rising(3.0))
    days = [5.0, 15.0, 45.0]
    table = pd.DataFrame({"value": [0.0, 0.010, 0.040]}, index=DAY + pd.to_timedelta(days, unit="D"))
    station = Instrument("2N Inby", "D", "closure", np.array([0.0, 0.0]), table)
    found = study.passing(panel("1", 0.0), [station], [at_site], STAGES)
    np.testing.assert_allclose(found.change, [[0.0, 20.0, 25.0, 30.0]], atol=1e-6)  # mm; stages on days 10, 30, 35, 40


@settings(max_examples=50, deadline=None)
@given(st.lists(st.tuples(st.floats(-10, 10), st.floats(0.1, 10)), min_size=1, max_size=12))
def test_the_factor_has_the_least_error(pairs):
    measured, modelled = np.array(pairs).T
    found = study.factor_of(measured, modelled)
    error = lambda factor: float(np.abs(measured - factor * modelled).sum())  # noqa: E731
    assert error(found) <= min(error(ratio) for ratio in measured / modelled) + 1e-9


def test_as_the_earlier_panel_saw_it():
    """Nearest in distance from the rib; where nothing was measured nothing changes."""
    many = [cell(f"A{n}", (0.0, -10.0 - n), rising(1.0)) for n in range(5)] + [cell("B", (0.0, -150.0), rising(9.0))]
    earlier = study.passing(panel("1", 0.0), many, many, STAGES)
    one = [cell("C", (0.0, -12.0), rising(4.0)), cell("D", (0.0, -149.0), rising(4.0))]
    later = study.passing(panel("2", 0.0), one, one, STAGES)
    found = study.as_earlier(earlier, later)
    np.testing.assert_allclose(found[0], earlier.change[0], atol=1e-9)
    np.testing.assert_allclose(found[1], (3 * earlier.change[0] + earlier.change[5]) / 4, atol=1e-9)
    nothing = study.Passing(earlier.panel, earlier.instruments, earlier.rib, np.full((6, 4), np.nan), earlier.first)
    assert not study.as_earlier(nothing, later).any()


def made(seed: int, factor: float = 1.6, error: float = 0.2) -> tuple[list, study.Shown]:
    """Scores where the brittle model is true but for a factor, and elastic rock is not."""
    random = np.random.default_rng(seed)
    true = {name: np.cumsum(random.gamma(1.0, 1.0, (20, 4)), axis=1) for name in "12"}
    wrong = {name: np.cumsum(random.gamma(1.0, 1.0, (20, 4)), axis=1) for name in "12"}
    for values in (*true.values(), *wrong.values()):
        values -= values[:, :1].copy()
    passed = {}
    for name in "12":
        change = factor * true[name] + random.normal(0.0, error, (20, 4))
        change[:, 0] = 0.0
        names = [cell(f"A{n}", (0.0, -float(n)), rising(1.0)) for n in range(20)]
        passed[name] = study.Passing(panel(name, 0.0), names, np.arange(20.0), change, np.zeros(20, int))
    return study.scores("stress (MPa)", passed, {("elastic", "30"): wrong, ("brittle", "30"): true})


def value(rows, start: str):
    (row,) = [row for row in rows if row.quantity.startswith(start)]
    return row


def test_the_true_model_is_chosen_and_wins():
    rows, shown = made(1)
    remark = value(rows, "panel 2, brittle rock: mean error").remark
    assert remark.startswith("gob of 30 MPa, factor ")
    assert "chosen on panel 1" in remark
    assert float(remark.split("factor ")[1].split(",")[0]) == pytest.approx(1.6, abs=0.1)
    assert value(rows, "panel 2, brittle rock: mean error").obtained == pytest.approx(
        0.2 * math.sqrt(2 / math.pi), rel=0.3
    )
    for other in ("elastic rock", "mine file, factor 1", "as panel 1", "no change"):
        less = value(rows, f"panel 2, brittle rock (chosen) less {other}: mean error")
        assert less.obtained < 0.0
        assert float(less.remark.split(" to ")[1]) < 0.0
    assert value(rows, "panel 2, brittle rock: rank correlation").obtained > 0.95
    assert set(shown.predicted) == {"brittle rock", "elastic rock", "mine file, factor 1", "as panel 1", "no change"}
    assert shown.chosen == "brittle rock"


def test_the_interval_of_panel_1_holds_panel_2():
    """Over many made mines, near its level: 20 residuals at each stage know the tails badly."""
    shares = [value(made(seed)[0], "panel 2, brittle rock: share").obtained for seed in range(40)]
    assert 0.86 < np.mean(shares) < 0.96


def test_without_a_difference_the_interval_says_so():
    """Two models that are equally wrong: over many made mines the interval of their difference holds zero."""
    held = []
    for seed in range(60):
        random = np.random.default_rng(seed)
        difference = np.where(
            np.arange(4) > 0, random.normal(0.0, 1.0, (20, 1)) + random.normal(0.0, 0.3, (20, 4)), np.nan
        )
        low, high = (float(text) for text in study._interval(difference).split("instruments ")[1].split(" to "))
        held.append(low <= 0.0 <= high)
    assert np.mean(held) > 0.85
