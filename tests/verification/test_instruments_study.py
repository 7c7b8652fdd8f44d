"""The study of a calibration with instruments, reduced to seconds: two records of a right case and of a broken one."""

import numpy as np
from matplotlib.figure import Figure
from running import run_study

from verification.answers import instruments


def test_the_reduced_study_has_all_rows_and_calls_a_wrong_unit_out(tmp_path):
    """Rows of right and broken instruments and of readings of other values; the wrong unit is called out each time."""
    results = run_study("instruments", tmp_path)
    chosen = results.study.settings
    chosen |= {"records": 2, "broken_records": 2, "trials": 16}
    chosen["cases"] = [case for case in chosen["cases"] if case["name"] == "instruments alone"]
    chosen["broken"] = [case for case in chosen["broken"] if case["name"] == "kPa read as MPa"]
    rows, figure = instruments.answer(results)
    assert isinstance(figure, Figure)
    by_name = {row.quantity.partition(" (")[0]: row for row in rows}
    assert list(by_name) == [
        "right, instruments alone: intervals that hold the truth",
        "right, instruments alone: pages that call one out",
        "broken, kPa read as MPa: pages that call it out",
        "broken, kPa read as MPa: pages that call another out",
        "broken, kPa read as MPa: intervals that hold the truth",
        "broken, kPa read as MPa: shift of the medians",
        "readings of other values than the record: pages that say so",
    ]
    assert by_name["broken, kPa read as MPa: pages that call it out"].obtained == 1.0
    assert by_name["broken, kPa read as MPa: shift of the medians"].obtained < 1.0


def test_readings_are_the_modelled_values_without_errors():
    """No factor, no errors: readings are modelled values and a zero; the fault is in one alone."""
    scene = instruments.Scene(3)
    case = {"errors": {"stress": 0.0, "displacement": 0.0}, "model_error": 0.0, "cells": 0.0}
    truth = np.array([0.3, 0.8])
    table = instruments.readings(scene, truth, case, np.random.default_rng(1))
    off = (table["measured"].values - scene.modelled(truth[None])[0]).reshape(-1, 3)
    np.testing.assert_allclose(off - off[:, :1], 0.0, atol=1e-9)
    np.testing.assert_allclose(off[-1], 0.0, atol=1e-9)  # of the closure, which was not zeroed
    dead = instruments.spoiled(scene, table, {"died": True})["measured"].values
    assert len(set(dead[:3])) == 1
    np.testing.assert_array_equal(dead[3:], table["measured"].values[3:])
