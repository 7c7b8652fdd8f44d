"""What the runs of a plan made: counts by opening and distance, floors, and what stands in outcome.nc."""

import json

import numpy as np
import pytest
import xarray as xr
from plan_fixtures import (
    BOXES,
    HAZARD,
    STEPS,
    comparison_of,
    drawn_events,
    drawn_run,
    made_up_grid,
    made_up_record,
    outcome_slice,
    write_run,
)

from common.datasets import write_dataset
from common.errors import InputError
from plans.layout import ANY, read_outcome
from plans.outcome import make_outcome
from plans.settings import HazardSettings


def boxes_away(place: np.ndarray) -> np.ndarray:
    """Distance (event, opening) to each opening, which is one box."""
    found = []
    for lower, upper in BOXES.values():
        outside = np.maximum(np.maximum(np.array(lower) - place, place - np.array(upper)), 0.0)
        found.append(np.linalg.norm(outside, axis=1))
    return np.stack(found, axis=1)


@pytest.fixture(scope="module")
def events():
    generator = np.random.default_rng(5)
    return [drawn_events(count, generator) for count in (60, 45)]


@pytest.fixture(scope="module")
def outcome(events, tmp_path_factory):
    folder = tmp_path_factory.mktemp("outcome")
    return make_outcome(outcome_slice([write_run(folder, "own", events)]), made_up_grid())


def test_events_count_near_openings_that_are_mined_by_then(outcome, events):
    """Slow twin: distances to the boxes. stope_2 is mined in the second step: in the first it has no event."""
    mined = np.array([[True, True, False], [True, True, True]])
    for step, (size, place) in enumerate(events):
        away = np.where(mined[step], boxes_away(place), np.inf)
        nearest = away.argmin(axis=1)
        part = outcome.isel(run=0, step=step)
        np.testing.assert_array_equal(part["number"][:-1], np.bincount(nearest, minlength=3))
        np.testing.assert_allclose(part["potency"][:-1], np.bincount(nearest, 10.0**size, minlength=3))
        np.testing.assert_allclose(part["squares"].sel(opening=ANY), np.sum(10.0 ** (2 * size)))
        np.testing.assert_allclose(part["largest"].sel(opening=ANY), size.max())
        for distance in HAZARD["distances"]:
            within = part["number_within"].sel(distance=distance)
            np.testing.assert_array_equal(within[:-1], (away <= distance).sum(axis=0))
            assert float(within.sel(opening=ANY)) == (away.min(axis=1) <= distance).sum()
            assert float(within.sel(opening=ANY)) <= float(within[:-1].sum())


def test_mined_volumes_days_and_dates(outcome):
    np.testing.assert_allclose(outcome["mined"], [12 * 20 * 30] * 2)
    np.testing.assert_allclose(outcome["days"], [31, 30])
    assert json.loads(outcome.attrs["steps_ahead"]) == [step.name for step in STEPS]
    assert outcome.attrs["recorded_until"] == ""


def test_a_year_has_as_many_events_as_the_rate_of_the_period_makes(outcome):
    """One law for all periods: the number a year over the expected number, times the days, is the same in all."""
    number = outcome["yearly_number"].sel(opening=ANY, distance=30.0, size="felt")
    rate = outcome["expected"].sel(opening=ANY, distance=30.0) * 365.25 / outcome["period_days"]
    share = number / rate
    assert 0.01 < float(share[0]) < 0.9
    np.testing.assert_allclose(share, float(share[0]), rtol=1e-6)
    np.testing.assert_allclose(outcome["expected"][-1], outcome["expected"][:-1].sum("period"))


def test_a_file_holds_what_was_written(outcome, tmp_path):
    write_dataset(outcome, tmp_path / "outcome.nc")
    again = read_outcome(tmp_path / "outcome.nc")
    np.testing.assert_array_equal(again["chance"], outcome["chance"])
    assert list(again["opening"].values) == [*BOXES, ANY]


def test_events_count_from_the_largest_floor_of_own_run_and_members(tmp_path):
    """The companion's floor, larger still, is that of the shared number only."""
    runs = [
        drawn_run(tmp_path / "own", "own", 1, floor=-2.0),
        drawn_run(tmp_path / "member", "member", 2, floor=-1.7),
        drawn_run(tmp_path / "coarse", "coarse", 3, floor=-1.2),
    ]
    outcome = make_outcome(outcome_slice(runs), made_up_grid())
    assert outcome.attrs["floor"] == pytest.approx(-1.7)
    assert outcome.attrs["shared_floor"] == pytest.approx(-1.2)
    own = outcome["event_potency"].values
    assert np.log10(own).min() >= -1.7
    first = (outcome["event_run"].values == 0) & (outcome["event_step"].values == 0)
    assert float(outcome["shared_number"][0, 0]) == np.sum(np.log10(own[first]) >= -1.2)
    assert np.isnan(outcome["number"].sel(run=2)).all()
    assert set(np.unique(outcome["event_run"])) == {0, 1}


def test_a_record_sets_the_floor_and_what_is_ahead(tmp_path):
    """A record of the first step: the second begins after it and is forecast."""
    run = drawn_run(tmp_path, "own", 1)
    recorded = {"recorded_steps": [STEPS[0].given()], "recorded_runs": [{**run, "events": run["events"][:1]}]}
    made = make_outcome(outcome_slice([run], **recorded), made_up_grid(), made_up_record(40, 2), comparison_of(-1.5))
    assert made.attrs["floor"] == pytest.approx(-1.5)
    assert json.loads(made.attrs["steps_ahead"]) == ["2019-09"]
    assert np.isnan(made["forecast_number"][0]).all()
    assert np.isfinite(made["forecast_number"][1]).all()
    assert "record" in json.loads(made.attrs["contains"])
    np.testing.assert_allclose(made["period_days"], [31, 30, 30])


def test_a_record_that_covers_no_step_to_its_end_gives_no_ratio(tmp_path):
    run = drawn_run(tmp_path, "own", 1)
    recorded = {"recorded_steps": [step.given() for step in STEPS], "recorded_runs": [run]}
    record = made_up_record(20, 2, end="2019-08-20")
    made = make_outcome(outcome_slice([run], **recorded), made_up_grid(), record, comparison_of())
    assert json.loads(made.attrs["steps_ahead"]) == ["2019-09"]
    assert {"cells", "record"} <= set(json.loads(made.attrs["lacks"]))
    assert made.attrs["ratio_text"] == ""


def test_mirrored_runs_make_the_same(events, outcome, tmp_path):
    """Mine and events mirrored at x = 16 m: every number by opening and every chance."""
    mirrored = [(size, place * [-1.0, 1.0, 1.0] + [32.0, 0.0, 0.0]) for size, place in events]
    other = make_outcome(outcome_slice([write_run(tmp_path, "own", mirrored)]), made_up_grid(mirrored=True))
    for name in ("number", "potency", "largest", "number_within", "chance", "expected_interval", "mined"):
        np.testing.assert_allclose(other[name], outcome[name], err_msg=name)
    assert not np.allclose(other["event_location"], outcome["event_location"])


def test_files_of_other_mines_and_steps_are_refused(tmp_path):
    run = drawn_run(tmp_path, "own", 1)
    grid = made_up_grid()
    swapped = {**run, "events": run["events"][::-1]}
    for given, reason in (
        (outcome_slice([swapped]), "events of step 2019-09 of mine made_up, not of 2019-08"),
        (outcome_slice([{**run, "events": run["events"][:1]}]), "has events of 1 steps, and 2 are dated"),
        (outcome_slice([{**run, "states": run["states"][::-1]}]), "state of step 2019-09"),
        (outcome_slice([run], mine="another"), "of mine made_up, not of another"),
        (outcome_slice([{**run, "kind": "member"}]), "give its own first, and once"),
        (outcome_slice([run], openings=[{"name": "shaft"}]), "the grid has no excavation shaft"),
        (outcome_slice([run], openings=[{"name": "drive", "step": "2020-01"}]), "which is no dated step of the plan"),
    ):
        with pytest.raises(InputError, match=reason):
            make_outcome(given, grid)
    grid.attrs["dimension"] = 2
    with pytest.raises(InputError, match="plans need plane: none"):
        make_outcome(outcome_slice([run]), grid)


def test_a_plan_without_an_event_has_numbers_and_no_chance(tmp_path):
    nothing = [(np.empty(0), np.empty((0, 3)))] * 2
    made = make_outcome(outcome_slice([write_run(tmp_path, "own", nothing)]), made_up_grid())
    assert float(made["number"].sum()) == 0.0
    assert np.isnan(made["chance"]).all()
    assert made.attrs["law_source"] == "none"
    assert (made["forecast_number"].quantile(0.5) <= 1).all()


@pytest.mark.parametrize(
    ("given", "reason"),
    [
        ({"distances": ["50 m", "20 m"]}, r"hazard.distances\[1\]: 20 m is not larger than 50 m"),
        ({"distances": ["0 m"]}, r"hazard.distances\[0\]: 0 m is out of range"),
        ({"magnitudes": {"felt": 0.0, "heard": 0.0}}, "hazard.magnitudes.heard: begins at 0 as felt does"),
        ({"magnitudes": {}}, "hazard.magnitudes: there is no class"),
        ({"likelihoods": {"likely": 0.5}}, "hazard.likelihoods: no class begins at 0"),
        ({"likelihoods": {"rare": 0, "sure": 1.5}}, "hazard.likelihoods.sure: 1.5 is greater than the maximum of 1"),
    ],
)
def test_wrong_classes_are_refused(given, reason):
    with pytest.raises(InputError, match=reason):
        HazardSettings.read(given, "hazard")


def test_a_plan_that_mines_nothing_more_has_an_outcome(events, tmp_path):
    """All of its openings are mined before the first dated step."""
    made = make_outcome(
        outcome_slice([write_run(tmp_path, "own", events)], openings=[{"name": "drive"}]), made_up_grid()
    )
    assert made["mined"].values.tolist() == [0.0, 0.0]
    assert float(made["number"].sel(opening=ANY).sum()) == 105.0


def test_a_year_near_an_opening_has_the_days_on_which_it_is_mined(outcome):
    """stope_2 is mined in the second of two steps: its events of that step a year, over 30 days. It has no chance
    before."""
    at = {"opening": "stope_2", "distance": 30.0, "size": "felt"}
    whole, step = (outcome["yearly_number"].sel(period=period, **at) for period in ("all", "2019-09"))
    assert float(step) > 0.0
    assert float(whole) == pytest.approx(float(step))
    assert np.isnan(outcome["chance"].sel(period="2019-08", opening="stope_2")).all()
    both = outcome["yearly_number"].sel(period="all", opening="stope_1", distance=30.0, size="felt")
    share = float(step) / (float(outcome["number_within"].sel(opening="stope_2", distance=30.0)[0, 1]) / 30.0)
    near = float(outcome["number_within"].sel(opening="stope_1", distance=30.0)[0].sum())
    assert float(both) == pytest.approx(share * near / 61.0)


def test_rock_that_two_openings_share_is_mined_once(events, tmp_path):
    """Half of the first stope's cells are of the drive too, which is mined before: they are none of the stope's."""
    grid = made_up_grid()
    first = np.flatnonzero(grid["piece_excavation"].values == 1)
    shared = grid.isel(piece=first[::2]).copy(deep=True)
    shared["piece_excavation"][:] = 0
    both = xr.concat([grid, shared], dim="piece", data_vars="minimal")
    made = make_outcome(outcome_slice([write_run(tmp_path, "own", events)]), both)
    np.testing.assert_allclose(made["mined"], [12 * 20 * 30 / 2, 12 * 20 * 30])
    np.testing.assert_allclose(made["opening_volume"].sel(opening="stope_1"), 12 * 20 * 30 / 2)
