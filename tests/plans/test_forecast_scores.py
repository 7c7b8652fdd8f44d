"""Kept forecasts against a record: what is scored, by how much, and in which words."""

import json

import numpy as np
import pytest
import xarray as xr
from plan_fixtures import (
    MINE,
    OPENINGS,
    STEPS,
    comparison_of,
    drawn_ensemble,
    drawn_events,
    drawn_run,
    made_up_grid,
    made_up_record,
    outcome_slice,
    write_run,
)
from scipy.stats import kstest, nbinom

from catalogs.settings import DatedStep
from common.datasets import read_dataset, write_dataset
from common.errors import InputError
from plans.layout import ANY
from plans.outcome import make_outcome
from plans.record import is_ahead, is_covered, known_until
from plans.scores import (
    KNOWN,
    MINED_OTHERWISE,
    NO_FLOOR,
    NOT_YET,
    SCORED,
    _sizes,
    brier,
    log_score,
    score,
    sentences,
)
from plans.settings import ScoreSlice

GRID = made_up_grid()
THREE_MONTHS = ("2019-08-01", "2019-11-01")


@pytest.fixture(scope="module")
def forecast(tmp_path_factory):
    """Made with a record of August: September is ahead."""
    runs = drawn_ensemble(tmp_path_factory.mktemp("forecast"), 1)
    first = [{**run, "events": run["events"][:1]} for run in runs]
    recorded = {"recorded_steps": [STEPS[0].given()], "recorded_runs": first}
    return make_outcome(outcome_slice(runs, **recorded), GRID, made_up_record(40, 2), comparison_of())


def both_months(second: int, seed: int = 3):
    """A record of August and September, and of ten events in October."""
    parts = [made_up_record(40, 2), made_up_record(second, seed, "2019-09-01", "2019-10-01")]
    parts.append(made_up_record(10, seed, "2019-10-01", "2019-11-01"))
    joined = {name: np.concatenate([part[name].values for part in parts]) for name in ("time", "location", "potency")}
    record = made_up_record(50 + second, 0, known=THREE_MONTHS)
    for name, values in joined.items():
        record[name][:] = values
    period = {"modelled": THREE_MONTHS, "recorded": [str(joined["time"].min()), str(joined["time"].max())[:19]]}
    return record.assign_attrs(period=json.dumps(period | {"common": THREE_MONTHS}))


def scored(forecasts, record, grid=GRID, **mine):
    """The scores of forecasts of a mine that mines as they say."""
    files = [{"file": f"forecasts/{number}.nc"} for number in range(len(forecasts))]
    given = {"mine": MINE, "forecasts": files, "steps": [one.given() for one in STEPS], "openings": list(OPENINGS)}
    return score(forecasts, record, grid, ScoreSlice.of(given | mine, "forecasts"))


def of_september(record) -> np.ndarray:
    """Which events (event,) are of the step that is scored."""
    time = record["time"].values
    return (time >= np.datetime64("2019-09-01")) & (time < np.datetime64("2019-10-01"))


def test_a_step_is_scored_once_it_is_recorded_and_was_ahead(forecast, tmp_path):
    early, late = scored([forecast], made_up_record(40, 2), GRID), scored([forecast], both_months(25), GRID)
    assert early["status"].values.tolist() == [KNOWN, NOT_YET]
    assert late["status"].values.tolist() == [KNOWN, SCORED]
    assert np.isnan(early["recorded"]).all()
    record = both_months(25)
    inside = of_september(record)
    potency = record["potency"].values[inside & (record["potency"].values >= 10.0 ** forecast.attrs["floor"])]
    row = late.isel(row=1)
    np.testing.assert_allclose(row["recorded"], [len(potency), potency.sum(), np.log10(potency.max())])
    for place, name in enumerate(("number", "potency", "largest")):
        draws = forecast[f"forecast_{name}"][1].values
        value = float(row["recorded"][place])
        low, high = np.quantile(draws, [0.025, 0.975], method="nearest")
        assert int(row["inside"][place]) == (low <= value <= high)
        below = np.mean(draws < value) + 0.5 * np.mean(draws == value)
        assert float(row["place"][place]) == pytest.approx(below)
    assert np.isfinite(row["gain"])
    write_dataset(late, tmp_path / "scores.nc")
    assert sentences(read_dataset(tmp_path / "scores.nc")) == sentences(late)


def test_places_of_the_forecast_gain_more_than_places_elsewhere(forecast):
    """Recorded where the model has its events, and 25 m above."""
    own = forecast["event_step"].values == 1
    places = forecast["event_location"].values[own]
    gains = []
    for shift in (0.0, 25.0):
        record = both_months(int(own.sum()))
        record["location"][of_september(record)] = places + np.array([0.0, 0.0, shift])
        gains.append(float(scored([forecast], record, GRID)["gain"][1]))
    assert gains[0] > gains[1] + 0.5


def test_no_event_of_a_forecast_and_no_number_of_runs_buys_gain(forecast):
    """An event far away, which would widen a box of its own, costs; the same runs twice change nothing."""
    own = np.flatnonzero(forecast["event_step"].values == 1)
    record = both_months(len(own))
    record["location"][of_september(record)] = forecast["event_location"].values[own]
    found = float(scored([forecast], record)["gain"][1])
    away = forecast.copy(deep=True)
    away["event_location"][own[0]] += np.array([2000.0, 0.0, 0.0])
    assert float(scored([away], record)["gain"][1]) <= found
    of_events = [name for name in forecast.variables if "event" in forecast[name].dims]
    twice = xr.concat([forecast[of_events]] * 2, dim="event")
    twice["event_run"][len(forecast["event_run"]) :] += forecast.sizes["run"]
    runs = xr.concat([forecast.drop_vars(of_events)] * 2, dim="run", data_vars="minimal")
    assert float(scored([runs.merge(twice).assign_attrs(forecast.attrs)], record)["gain"][1]) == pytest.approx(found)


def test_chances_are_set_against_what_happened(forecast):
    """Slow twin of what happened near all openings together; a chance is given for each opening that is mined."""
    record = both_months(30)
    found = scored([forecast], record, GRID)
    inside = of_september(record)
    place, size = record["location"].values[inside], np.log10(record["potency"].values[inside])
    cells = GRID["piece_origin"].values
    outside = np.maximum(np.maximum(cells - place[:, None], place[:, None] - cells - 2.0), 0.0)
    away = np.linalg.norm(outside, axis=2).min(axis=1)
    near = found.isel(chance=np.flatnonzero(found["chance_opening"].values == ANY))
    assert near.sizes["chance"] == 4
    assert found.sizes["chance"] == 4 * 4
    for one in range(4):
        part = near.isel(chance=one)
        smallest = float(forecast["size_log_potency"].sel(size=str(part["chance_size"].values)))
        happened = ((away <= float(part["chance_distance"])) & (size >= smallest)).any()
        assert int(part["occurred"]) == happened
        given = forecast["chance"].sel(period="2019-09", opening=ANY, distance=float(part["chance_distance"]))
        assert float(part["forecast_probability"]) == float(given.sel(size=str(part["chance_size"].values)))
    assert ((found["rate_probability"].values >= 0.0) & (found["rate_probability"].values <= 1.0)).all()


def test_the_constant_rate_is_that_of_the_record_that_the_forecast_had(forecast):
    """n events of the class near in the days up to the last event of then: 30 days have one with
    1 - exp(-n 30 / days)."""
    record = both_months(30)
    found = scored([forecast], record)
    part = found.isel(chance=np.flatnonzero(found["chance_opening"].values == ANY)[2])
    until = np.datetime64(forecast.attrs["recorded_until"])
    days = (until - np.datetime64("2019-08-01")) / np.timedelta64(1, "D")
    before = record["time"].values <= until
    place, size = record["location"].values[before], np.log10(record["potency"].values[before])
    cells = GRID["piece_origin"].values
    outside = np.maximum(np.maximum(cells - place[:, None], place[:, None] - cells - 2.0), 0.0)
    away = np.linalg.norm(outside, axis=2).min(axis=1)
    smallest = float(forecast["size_log_potency"].sel(size=str(part["chance_size"].values)))
    number = ((away <= float(part["chance_distance"])) & (size >= smallest)).sum()
    assert float(part["rate_probability"]) == pytest.approx(-np.expm1(-number * 30.0 / days))
    earlier = forecast.assign_attrs(recorded_until="2019-08-01T00:00:00")
    assert np.isnan(scored([earlier], record)["rate_probability"]).all()
    assert np.isnan(scored([forecast.assign_attrs(recorded_until="")], record)["rate_probability"]).all()


def test_sentences_say_what_was_said_and_what_came(forecast):
    said = sentences(scored([forecast], both_months(25), GRID))
    assert said[0].startswith("Forecast for 2019-09 (plan as_planned, 0.nc): ")
    assert "25 were recorded, within the range" in said[0] or "recorded, outside of the range" in said[0]
    assert "Brier score" in said[0]
    assert said[-1].startswith("Forecast of plan as_planned, 0.nc: steps up to 2019-08 are no forecasts")
    waiting = sentences(scored([forecast], made_up_record(40, 2), GRID))
    assert waiting[0] == "Forecast of plan as_planned, 0.nc: 2019-09 is not recorded to the end yet."
    many = sentences(scored([forecast], both_months(900), GRID))
    assert "outside of the range" in many[0]


def test_a_quiet_month_is_scored(forecast):
    found = scored([forecast], both_months(0), GRID)
    row = found.isel(row=1)
    assert row["recorded"].values.tolist()[:2] == [0.0, 0.0]
    assert np.isneginf(row["recorded"].values[2])
    assert np.isnan(row["gain"])
    assert not found["occurred"].any()
    assert "0 were recorded" in sentences(found)[0]
    assert "none recorded" in sentences(found)[0]


def test_forecasts_that_are_none_are_refused(forecast, tmp_path):
    made = drawn_run(tmp_path, "own", 1)
    recorded = {"recorded_steps": [step.given() for step in STEPS], "recorded_runs": [made]}
    after = make_outcome(outcome_slice([made], **recorded), GRID, both_months(25), comparison_of())
    with pytest.raises(
        InputError, match=r"forecasts\.0: forecasts/0\.nc: holds no forecast: the record had reached all steps"
    ):
        scored([after], both_months(25), GRID)
    with pytest.raises(InputError, match=r"forecasts\.0: forecasts/0\.nc: of mine another, not of made_up"):
        scored([forecast.assign_attrs(mine="another")], both_months(25), GRID)
    grid = GRID.assign_attrs(excavation_names=json.dumps(["drive", "stope_1", "stope_two"]))
    with pytest.raises(InputError, match=r"forecasts\.0: forecasts/0\.nc: .*the grid has no excavation stope_2"):
        scored([forecast], both_months(25), grid)


def test_a_good_forecaster_has_uniform_places(tmp_path):
    """A plan of known rates, forecast from one run and scored by a Poisson month of the same rate, 40 times: numbers
    lie anywhere in their draws (Kolmogorov and Smirnov at one in a thousand), and 0.95 within the range (three standard
    errors: 0.103)."""
    generator = np.random.default_rng(11)
    places, inside = [], []
    for number in range(40):
        events = [drawn_events(generator.poisson(40), generator) for _ in STEPS]
        made = make_outcome(outcome_slice([write_run(tmp_path / str(number), "own", events)]), GRID)
        month = made_up_record(generator.poisson(40), number, "2019-09-01", "2019-10-01", known=THREE_MONTHS)
        month.attrs["stated_end"] = THREE_MONTHS[1]
        row = scored([made], month, GRID).isel(row=1)
        places.append(float(row["place"][0]))
        inside.append(row["inside"].values)
    assert kstest(places, "uniform").pvalue > 1e-3
    assert (np.mean(inside, axis=0) >= 0.95 - 0.103).all()


def test_draws_of_the_number_are_those_of_the_closed_form(tmp_path):
    """n events in one run: negative binomial with r = n + 1/2 and p = 1/2, by chance alone."""
    made = make_outcome(outcome_slice([drawn_run(tmp_path, "own", 1)]), GRID)
    number = float(made["number"].sel(opening=ANY)[0, 1])
    quantiles = nbinom(number + 0.5, 0.5).ppf([0.1, 0.5, 0.9])
    np.testing.assert_allclose(np.quantile(made["forecast_number"][1], [0.1, 0.5, 0.9]), quantiles, atol=1.5)


def test_scores_of_chances():
    """All sure and right: 0. Always one half: 0.25 and ln 2. Sure and wrong: 1 and the logarithm of the least."""
    happened = np.array([1, 0, 1, 0])
    assert brier(happened, happened) == 0.0
    assert brier(np.full(4, 0.5), happened) == 0.25
    assert log_score(np.full(4, 0.5), happened) == pytest.approx(np.log(2.0))
    assert brier(1 - happened, happened) == 1.0
    assert log_score(1 - happened, happened) == pytest.approx(-np.log(1e-4))


def record_of(*days: str, known: tuple[str, str] = THREE_MONTHS, **attributes):
    """A record of one event on each of these days."""
    record = made_up_record(len(days), 1, known=known)
    record["time"][:] = np.array(days, "datetime64[ns]")
    period = {"modelled": known, "recorded": [f"{days[0]}T00:00:00", f"{days[-1]}T00:00:00"], "common": known}
    return record.assign_attrs(period=json.dumps(period), **attributes)


EVERY_FIVE_DAYS = [str(day) for day in np.arange("2019-08-03", "2019-09-28", 5, "datetime64[D]")]  # the last: the 27th
OCTOBER = DatedStep(name="2019-10", start="2019-10-01", end="2019-11-01")


def test_silence_after_the_last_event_is_no_record_of_a_month_without_events():
    """The common period holds the silence that chance may leave, which is more than October here."""
    record = record_of(*EVERY_FIVE_DAYS)
    assert [is_covered(record, step) for step in (*STEPS, OCTOBER)] == [True, True, False]
    assert is_ahead(OCTOBER, known_until(record))


def test_a_month_that_ends_quietly_is_covered():
    """Within the mean wait, five days, at the end of the file; in any case once there are later events."""
    early = record_of(*EVERY_FIVE_DAYS[:-1])  # the last: 22 September
    assert not is_covered(early, STEPS[1])
    assert not is_ahead(STEPS[1], known_until(early))
    assert is_covered(record_of(*EVERY_FIVE_DAYS[:-1], "2019-10-20"), STEPS[1])


def test_a_stated_end_makes_a_quiet_month_known():
    """It is then neither ahead nor left out, as far as chance may leave that silence."""
    record = record_of(*EVERY_FIVE_DAYS, stated_end="2019-11-01")
    assert is_covered(record, OCTOBER)
    assert not is_ahead(OCTOBER, known_until(record))
    shorter = record_of(*EVERY_FIVE_DAYS, known=("2019-08-01", "2019-10-15"), stated_end="2019-11-01")
    assert not is_covered(shorter, OCTOBER)


@pytest.mark.parametrize("stated", [{}, {"stated_end": "2019-11-01"}])
def test_no_step_is_ahead_and_covered(stated):
    for last in range(1, len(EVERY_FIVE_DAYS)):
        record = record_of(*EVERY_FIVE_DAYS[: last + 1], **stated)
        for step in (*STEPS, OCTOBER):
            assert not (is_covered(record, step) and is_ahead(step, known_until(record)))


@pytest.mark.parametrize(
    ("mine", "difference"),
    [
        ({"steps": [STEPS[0].given()]}, "the mine file has no step 2019-09"),
        (
            {"steps": [STEPS[0].given(), STEPS[1].given() | {"end": "2019-09-16"}]},
            "2019-09 was from 2019-09-01 to 2019-10-01, and is from 2019-09-01 to 2019-09-16",
        ),
        (
            {"openings": list(OPENINGS[:2])},
            "stope_2 is mined in 2019-09 in the forecast, and not mined by then in the mine file",
        ),
        (
            {"openings": [*OPENINGS[:2], {"name": "stope_2", "step": "2019-08"}]},
            "stope_2 is mined in 2019-09 in the forecast, and mined in 2019-08 in the mine file",
        ),
        (
            {"openings": [*OPENINGS, {"name": "stope_3"}]},
            "stope_3 is not mined by then in the forecast, and mined before in the mine file",
        ),
        ({"openings": [*OPENINGS, {"name": "stope_3", "step": "2019-10"}]}, ""),
        ({"steps": [STEPS[0].given(), STEPS[1].given() | {"start": "2019-09-01T00:00:00Z"}]}, ""),  # the same instant
    ],
)
def test_a_forecast_of_what_was_mined_otherwise_is_not_scored(forecast, mine, difference):
    """What a later month mines does not count."""
    if "stope_3" in str(mine) and not difference:
        mine = mine | {"steps": [one.given() for one in (*STEPS, OCTOBER)]}
    found = scored([forecast], both_months(25), **mine)
    assert found["status"].values.tolist() == [KNOWN, MINED_OTHERWISE if difference else SCORED]
    assert str(found["difference"].values[1]) == difference
    assert found.sizes["chance"] == (0 if difference else 16)
    if difference:
        assert sentences(found)[0] == f"Forecast of plan as_planned, 0.nc: 2019-09 is not scored, since {difference}."


def test_two_forecasts_of_one_plan_stand_apart(forecast, tmp_path):
    """They know other steps: each is named by its file."""
    other = make_outcome(outcome_slice([drawn_run(tmp_path, "own", 1)]), GRID)
    other = other.assign_attrs(steps_ahead=json.dumps(["2019-08"]))
    found = scored([forecast, other], both_months(25))
    assert found["forecast"].values.tolist() == [0, 0, 1, 1]
    assert found["file"].values.tolist()[1:3] == ["forecasts/0.nc", "forecasts/1.nc"]
    known = [one for one in sentences(found) if "are no forecasts" in one]
    assert [one.split(",")[1].split(":")[0] for one in known] == [" 0.nc", " 1.nc"]
    assert "up to 2019-08 " in known[0]
    assert "up to 2019-09 " in known[1]


def test_a_forecast_without_an_event_is_not_scored(forecast):
    found = scored([forecast.assign_attrs(floor=np.nan)], both_months(25))
    assert found["status"].values.tolist() == [KNOWN, NO_FLOOR]
    assert "2019-09 cannot be scored. Runs of the plan make no event" in sentences(found)[0]


def test_a_month_after_the_last_of_rare_events_is_not_covered():
    """The mean wait, 40 days, is longer than the rest of October; but October is ahead."""
    assert not is_covered(record_of("2019-08-18", "2019-09-27"), OCTOBER)


@pytest.mark.parametrize(
    ("ends", "recorded", "texts"),
    [
        ((0.42, 3.71), 3.74, ("log P 0.42 to 3.71", "log P 3.74")),
        ((0.42, 3.71), 3.69, ("log P 0.4 to 3.8", "log P 3.7")),
        ((0.42, 3.71), 4.2, ("log P 0.4 to 3.7", "log P 4.2")),
        ((-np.inf, 3.71), 3.74, ("none to log P 3.71", "log P 3.74")),
        ((-np.inf, 3.71), 2.0, ("none to log P 3.8", "log P 2.0")),
        ((-np.inf, 3.71), -np.inf, ("none to log P 3.8", "none")),
        ((0.42, 3.71), -np.inf, ("log P 0.4 to log P 3.8", "none")),
        ((-np.inf, -np.inf), 1.0, ("none", "log P 1.0")),
    ],
)
def test_a_range_and_what_is_recorded_agree_with_what_is_said_of_them(ends, recorded, texts):
    """The range is rounded outward where it holds what is recorded; what lies outside is shown outside."""
    assert _sizes(*ends, recorded) == texts
