"""The table of a verification: what passes, what fails, what is only reported."""

import math

from verification.rows import COLUMNS, Row, read_rows, write_texts


def test_a_row_passes_up_to_its_allowed_error():
    assert Row.relative("closure, m", 2.0, 2.1, allowed=0.05).passed is False  # round-off: 0.05000000000000004
    assert Row.relative("closure, m", 2.0, 2.0999, allowed=0.05).passed is True
    assert Row.relative("closure, m", -2.0, -2.2).error == 0.10000000000000009
    assert Row("closure, m", 2.0, 9.0, 3.5).passed is None


def test_a_row_with_a_lower_bound_states_it_where_no_theory_is_expected():
    """What is lacking is its error; a value that is no number lacks everything."""
    low, high, none = (Row.at_least("order of convergence", value, 1.9, "of all") for value in (1.5, 2.0, math.nan))
    assert (low.passed, high.passed, none.passed) == (False, True, False)
    assert low.error == 1.9 - 1.5
    assert math.isnan(low.expected)
    assert low.remark == "At least 1.9. of all"


def test_an_error_that_is_no_number_never_passes():
    assert Row("closure, m", 1.0, math.nan, math.nan, allowed=1.0).passed is False
    assert Row("closure, m", 1.0, math.inf, math.inf, allowed=math.inf).passed is False


def test_rows_come_back_as_written(tmp_path):
    rows = [Row.relative("stress, Pa", 3.0, 3.3, 0.2, 'a "quoted", remark'), Row("events", 1.0, 2.0, 1.0)]
    write_texts(tmp_path / "rows.csv", [row.texts("kirsch") for row in rows])
    first, second = read_rows(tmp_path / "rows.csv")
    assert tuple(first) == COLUMNS
    assert first == {
        "scene": "kirsch",
        "quantity": "stress, Pa",
        "expected": "3",
        "obtained": "3.3",
        "error": "0.1",
        "allowed": "0.2",
        "passed": "yes",
        "remark": 'a "quoted", remark',
    }
    assert (second["allowed"], second["passed"]) == ("", "")
