"""Warnings of a calibration: values beyond a range, another law of sizes than the model's, and when there are none."""

import numpy as np
import pytest

from calibration.limits import beyond_range, compare_b
from verification.answers.coverage import closed_form_mine as mine
from verification.answers.coverage.calibration import MinedTrials

CHOSEN = {"trials": 32, "replicates": 4, "b": 0.67, "span": 2.0}
RECORDS = 8


@pytest.fixture(scope="module")
def case():
    """Trials of the mine in closed form; no record yet."""
    return MinedTrials(CHOSEN, {"events": 200}, np.random.default_rng(1))


def fits(case, truth, **values):
    """Calibrations to records of these true values; values: keys of the case of the record."""
    generator = np.random.default_rng(3)
    records = [mine.record(np.array(truth), case.case | values, generator) for _ in range(RECORDS)]
    return [case.calibrated(record)[0] for record in records]


@pytest.mark.parametrize(("share", "side"), [(1.4, 1), (-0.5, -1)])
def test_a_truth_beyond_a_range_is_told_with_the_end_that_holds_it_back(case, share, side):
    """Most records say so, and name the first quantity and the right end."""
    found = [beyond_range(fit, 1) for fit in fits(case, [share, 0.5])]
    told = [one for one in found if one.is_told]
    assert len(told) >= 0.7 * RECORDS, found
    assert all(one.ends.get(0) == side and one.improvement > 1.0 for one in told)


def test_a_truth_within_the_ranges_is_hardly_ever_said_to_be_beyond(case):
    """In the middle and near an end, eight records each: two false ones at most."""
    found = [beyond_range(fit, 1).is_told for truth in ([0.5, 0.5], [0.95, 0.5]) for fit in fits(case, truth)]
    assert sum(found) <= 2


def test_another_b_is_told_although_sizes_are_no_term(case):
    """b of 1.2 against 0.67 of the model: told with both values. The model's own b is not."""
    other = [compare_b(fit, 1) for fit in fits(case, [0.5, 0.5], record_b=1.2)]
    assert sum(one.is_told for one in other) >= 0.7 * RECORDS, other
    assert all(one.recorded > one.modelled[1] for one in other if one.is_told)
    assert all(one.modelled[0] < one.modelled[1] for one in other)
    assert sum(compare_b(fit, 1).is_told for fit in fits(case, [0.5, 0.5])) <= 1


def test_few_events_have_the_b_of_the_model_too():
    """The one event more that each mean has made the b of three events that of a law with fewer small ones."""
    few = MinedTrials(CHOSEN | {"b": 1.2}, {"events": 200, "terms": ["potency"]}, np.random.default_rng(4))
    generator = np.random.default_rng(5)
    records = [mine.record(np.array([0.5, 0.5]), few.case | {"events": 1}, generator) for _ in range(40)]
    found = [compare_b(few.calibrated(one)[0], 1) for one in records]
    assert np.mean([one.is_told for one in found]) <= 0.05
    without = [one.p_value for one in found if np.isnan(one.recorded)]  # an event
    assert without == [1.0] * len(without)
    assert 0 < len(without) < 10
