"""The coverage study reduced to seconds."""

import copy
from dataclasses import replace

import numpy as np
from matplotlib.figure import Figure
from running import run_study

from verification.answers import coverage
from verification.answers.coverage import calibration
from verification.answers.coverage.comparison import detected_sizes


def is_of_baselines(row) -> bool:
    """True for rows of the module coverage.baselines."""
    return row.quantity.startswith(("baselines, ", "rates, "))


def is_of_plans(row) -> bool:
    """True for rows of the module coverage.plans."""
    return "plans, " in row.quantity


def is_apart(row) -> bool:
    """True for rows that a few catalogues do not hold."""
    return "hardly one" in row.quantity or is_of_baselines(row) or is_of_plans(row)


def test_the_reduced_study_holds_wider_bounds(tmp_path):
    """40 catalogues of each case: shares to within four Monte Carlo standard errors, 0.14.

    Axes that are hardly one may have no mean: the whole study says how often.
    """
    results = run_study("coverage", tmp_path)
    chosen = copy.deepcopy(results.study.settings)
    for part, count in (("sizes", 20), ("axes", 10), ("one_process", 10), ("sums", 40)):
        chosen[part] |= {"catalogues": count, "resamplings": 99}
    chosen["baselines"] |= {"catalogues": 3, "truth_runs": 2}  # test_coverage_of_baselines.py looks at them
    first_page = chosen["first_page"]
    first_page |= {"catalogues": 4, "cases": [case for case in first_page["cases"] if len(case.get("wrong", ())) > 2]}
    chosen["plans"] |= {"catalogues": 2, "plans": 4, "fewest": 1}  # test_coverage_of_plans.py looks at them
    chosen["calibration"]["cases"] = []  # below
    wider = {"power": 0.0, "coverage": 0.93 - 0.27, "given": 0.6, "alarms": 0.07 + 0.27}
    results.study = replace(results.study, settings=chosen, allowed=results.study.allowed | wider)
    rows, figure = coverage.answer(results)
    assert isinstance(figure, Figure)
    assert [row.quantity for row in rows if row.passed is not True and not is_apart(row)] == []
    intervals, tests = {"sizes": 1, "axes": 1, "sums": 4, "one_process": 3}, {"one_process": 2}
    expected = 2 * sum(each * len(chosen[part]["cases"]) for part, each in intervals.items())
    expected += sum(each * len(chosen[part]["cases"]) for part, each in tests.items())
    rows = [row for row in rows if not is_of_baselines(row) and not is_of_plans(row)]
    expected += sum(3 + len(case["wrong"]) for case in first_page["cases"])
    assert len({row.quantity for row in rows}) == len(rows) == expected


def test_calibrations_of_a_mine_in_closed_form_hold_the_truth_and_warn(tmp_path):
    """A dozen records each: bursts whose truth lies within the ranges, a truth beyond them, and another b."""
    results = run_study("coverage", tmp_path)
    chosen = copy.deepcopy(results.study.settings)
    small = {"catalogues": 12, "trials": 24, "replicates": 4}
    names = {"12 bursts of 5 a step", "truth beyond a range", "another b"}
    cases = [case for case in chosen["calibration"]["cases"] if case["name"] in names]
    for case in cases:
        case.pop("self_tests", None)
    chosen["calibration"] |= small | {"cases": cases}
    allowed = results.study.allowed | {"warned": 0.5, "false_warnings": 0.2}
    coverages, rows = calibration.answer(chosen, allowed)
    assert [coverage.name for coverage in coverages] == ["calibration, 12 bursts of 5 a step"]
    assert coverages[0].given == 1.0
    assert coverages[0].held >= 0.8
    assert len(rows) == 4
    assert [row.quantity for row in rows if row.passed is not True] == []


def test_detected_sizes_are_rounded_and_fade():
    generator = np.random.default_rng(1)
    x = detected_sizes(generator, {"b": 0.67, "count": 4000, "fade": 0.3, "bin_width": 0.15})
    assert len(x) == 4000
    np.testing.assert_allclose(x / 0.15, np.round(x / 0.15), atol=1e-9)
    below = np.mean(x < -0.075)
    assert 0.05 < below < 0.25
    assert detected_sizes(generator, {"b": 1.0, "count": 50}).min() >= 0.0
