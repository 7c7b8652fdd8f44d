"""From catalogues to outcomes, from a record to what a calibration needs of it, and mine files with other values."""

import numpy as np
import pytest
import xarray as xr
import yaml

from calibration.fit import CellCorrection, calibrate
from calibration.likelihood import Discrepancy, Recorded
from calibration.mine_files import with_values, write_mine
from calibration.self_test import calibrate_to_trials
from calibration.settings import CalibratedQuantity, CalibrationSettings
from calibration.trials import Outcome, common_cut, has_silent_history, outcome, read_record
from catalogs.exposure import Exposure
from common.errors import InputError

STEPS = ["one", "two"]


def catalogue(sizes: dict[str, list[float]], floor=0.01, before=1.0, resolved=1):
    """Events of these potencies (m3) by step."""
    potency = np.array([value for values in sizes.values() for value in values], float)
    step = np.array([name for name, values in sizes.items() for _ in values], object)
    return xr.Dataset(
        {
            "potency": ("event", potency),
            "resolved": ("event", np.full(len(potency), resolved, np.int8)),
            "step": ("event", step),
        },
        attrs={"potency_floor": floor, "potency_before_record": before},
    )


def record(days: list[float], sizes: list[float]):
    """Recorded events at days of 2019-08 and later."""
    time = np.datetime64("2019-08-01", "ns") + (np.array(days) * 86400e9).astype("timedelta64[ns]")
    return xr.Dataset(
        {
            "time": ("event", time),
            "potency": ("event", np.array(sizes, float)),
            "resolved": ("event", np.ones(len(sizes), np.int8)),
        }
    )


EXPOSURE = Exposure(
    np.array(["2019-08-01", "2019-09-01"], "datetime64[ns]"), np.array(["2019-09-01", "2019-10-01"], "datetime64[ns]")
)


def test_outcome_sums_all_potency_and_counts_resolved_events_above_the_cut():
    """Two runs; a step without anything counts as the cut, and as half an event."""
    runs = [catalogue({"one": [1.0, 2.0, 0.001], "two": []}), catalogue({"one": [0.5], "two": [4.0, 0.1]})]
    made = outcome(runs, STEPS, cut=-1.0)
    np.testing.assert_allclose(np.exp(made.log_potency), [[3.001, 0.1], [0.5, 4.1]])
    np.testing.assert_allclose(np.exp(made.log_number), [[2.0, 0.5], [1.0, 2.0]])
    np.testing.assert_allclose(np.exp(outcome([catalogue({"one": [1.0]}, resolved=0)], STEPS, -1.0).log_number), 0.5)


def test_events_count_from_the_largest_floor_of_all_runs_on():
    """A record that is complete further down does not lower it."""
    sizes = 10.0 ** np.random.default_rng(0).exponential(0.5, 400) * 1e-4
    found = common_cut(
        [catalogue({"one": [1.0]}, floor=0.01), catalogue({"one": [1.0]}, floor=0.03)],
        record(np.linspace(0, 50, 400), sizes),
    )
    np.testing.assert_allclose(found, np.log10(0.03))


def test_record_of_equal_and_of_unequal_sizes():
    """ln of the sum; its variance is 1 / number for equal sizes (a Poisson number), larger where one event rules."""
    generator = np.random.default_rng(3)
    days = np.concatenate([generator.uniform(0, 31, 100), generator.uniform(31, 61, 100)])
    equal = read_record(record(days, [0.1] * 200), EXPOSURE, -2.0, seed=1)
    np.testing.assert_allclose(np.exp(equal.log_potency), 10.0)
    np.testing.assert_array_equal(equal.number, 100)
    np.testing.assert_allclose(np.diag(equal.covariance) / equal.clustering, 0.01, rtol=0.15)
    ruled = read_record(record(days, [10.0, *[0.1] * 199]), EXPOSURE, -2.0, seed=1)
    assert ruled.covariance[0, 0] > 5.0 * ruled.covariance[1, 1]


def test_a_step_without_recorded_events_is_refused():
    """In one line that says what to do."""
    with pytest.raises(InputError, match="no potency in dated step number 2"):
        read_record(record([1.0, 2.0], [1.0, 1.0]), EXPOSURE, -2.0, seed=1)


def test_history_is_silent_where_no_rock_fails_in_any_trial():
    """One trial with failure before the record is enough."""
    silent = catalogue({"one": [1.0]}, before=0.0)
    assert has_silent_history([silent, silent])
    assert not has_silent_history([silent, catalogue({"one": [1.0]})])


def test_cells_are_corrected_by_pairs():
    """A shift that a run's steps share, and one of each step: mean, common and own error are found again."""
    generator = np.random.default_rng(4)
    runs, steps = 400, 3
    coarse = Outcome(generator.normal(size=(runs, steps)), generator.normal(size=(runs, steps)))
    shift = (
        np.array([0.5, 0.2, 0.1]) + 0.3 * generator.normal(size=(runs, 1)) + 0.1 * generator.normal(size=(runs, steps))
    )
    found = CellCorrection.of(coarse, Outcome(coarse.log_potency + shift, coarse.log_number))
    np.testing.assert_allclose(found.log_potency, [0.5, 0.2, 0.1], atol=0.05)
    np.testing.assert_allclose(found.potency_error.common, np.sqrt(0.3**2 + 0.1**2 / 3), rtol=0.1)
    np.testing.assert_allclose(found.potency_error.own, 0.1 * np.sqrt(2 / 3), rtol=0.1)
    assert found.number_error == Discrepancy(0.0, 0.0)


def test_calibration_of_a_made_up_simulator_holds_the_truth_and_refuses_another_law():
    """Potency of two steps from two quantities: the truth lies within the 90 % intervals, which take less than seven
    tenths of the prior; a record that no values give is called implausible."""
    generator = np.random.default_rng(6)
    points = generator.uniform(size=(40, 2))

    def simulator(points):
        return np.stack([2 + 2 * points[:, 0] + 0.5 * points[:, 1], 1 + 0.5 * points[:, 0] + 2 * points[:, 1]], axis=1)

    made = simulator(points) + 0.05 * generator.normal(size=(40, 2))
    trials = Outcome(made, np.log(20.0) + made)
    truth = np.array([[0.3, 0.7]])
    expected = simulator(truth)[0]
    number = np.round(20.0 * np.exp(expected)).astype(int)
    fits, misses = (
        calibrate(
            points,
            trials,
            CellCorrection.none(2),
            Recorded(values, 0.01 * np.eye(2), number, 2.0),
            ("potency", "number"),
            0.1,
            seed=1,
        )
        for values in (expected, expected + np.array([3.0, -3.0]))
    )
    assert fits.fits
    low, high = fits.posterior.quantiles(np.array([0.05, 0.95]))
    assert ((low < truth) & (truth < high)).all()
    assert (fits.posterior.width_left() < 0.7).all()
    predicted = fits.intervals()
    assert (predicted[0, :2] < np.exp(expected)).all()
    assert (np.exp(expected) < predicted[2, :2]).all()
    assert not misses.fits
    tested = calibrate_to_trials(fits.surrogate, 0, fits.recorded, fits.terms, fits.model_error, seed=2)
    assert tested.held.shape == (40, 2)
    assert 0.8 < tested.coverage < 0.98
    assert (tested.width.mean(axis=0) < 0.7).all()


@pytest.mark.parametrize(
    ("given", "problem"),
    [
        ({"range": ["2 MPa", "1 MPa"]}, "give the smaller value first"),
        ({"range": ["1 MPa", "2000 kPa"]}, "same unit"),
        ({"range": ["0 MPa", "2 MPa"], "scale": "log"}, "above 0"),
        ({"range": ["one", "2"]}, "is not a number"),
        ({"key": "cohesion"}, "does not match"),
        ({"source": ""}, "source"),
    ],
)
def test_wrong_quantities_are_refused(given, problem):
    """Each in one line."""
    right = {"key": "materials.host.cohesion.residual", "range": ["1 MPa", "2 MPa"], "source": "test"}
    CalibratedQuantity.read(right)
    with pytest.raises(InputError, match=problem):
        CalibratedQuantity.read(right | given)


def test_the_same_key_twice_is_refused():
    """The second would replace the first."""
    one = {"key": "seismic.closeness", "range": [0.7, 0.9], "source": "test"}
    with pytest.raises(InputError, match="stands twice"):
        CalibrationSettings.read({"quantities": [one, one]})


def test_values_of_a_range():
    """Ends, and the middle on both scales, as a mine file has them."""
    linear = CalibratedQuantity.read({"key": "a.b", "range": ["16 deg", "24 deg"], "source": "test"})
    assert [linear.written(share) for share in (0.0, 0.5, 1.0)] == ["16 deg", "20 deg", "24 deg"]
    log = CalibratedQuantity.read({"key": "a.b", "range": [1, 100], "scale": "log", "source": "test"})
    assert log.written(0.5) == 10.0


def test_mine_files_take_the_values_and_nothing_else(tmp_path):
    """Only the named key changes; a key that the mine file lacks is refused with the nearest one."""
    text = {"name": "mine", "materials": {"host": {"cohesion": {"intact": "8 MPa", "residual": "2 MPa"}}}}
    quantity = CalibratedQuantity.read(
        {"key": "materials.host.cohesion.residual", "range": ["1 MPa", "3 MPa"], "source": "test"}
    )
    write_mine(tmp_path / "middle.yaml", text, [quantity], [0.25])
    written = yaml.safe_load((tmp_path / "middle.yaml").read_text())
    assert written["materials"]["host"]["cohesion"] == {"intact": "8 MPa", "residual": "1.5 MPa"}
    assert written["name"] == "mine_middle"
    assert text["materials"]["host"]["cohesion"]["residual"] == "2 MPa"
    slip = CalibratedQuantity.read(
        {"key": "materials.host.cohesion.residul", "range": ["1 MPa", "3 MPa"], "source": "test"}
    )
    with pytest.raises(InputError, match=r"did you mean materials\.host\.cohesion\.residual\?"):
        with_values(text, [slip], [0.5])
