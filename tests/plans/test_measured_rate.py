"""Numbers of a plan's steps ahead from measures of its own run, by laws of the recorded steps."""

import json

import numpy as np
import pytest
import xarray as xr
from plan_fixtures import (
    HAZARD,
    MINE,
    STEPS,
    comparison_of,
    drawn_ensemble,
    made_up_grid,
    made_up_record,
    outcome_slice,
)

from catalogs.settings import DatedStep
from common.datasets import write_dataset
from common.errors import InputError
from plans.layout import PlanSummary
from plans.measured_rate import rates_by_measures, read_amounts
from plans.outcome import make_outcome
from plans.page import write_report
from plans.record import RecordedNumbers
from plans.settings import PlansReportSlice
from plans.tables import forecast_rows, measured_text

MONTHS = tuple(
    DatedStep(name=f"{2018 + month // 12}-{month % 12 + 1:02d}", start=f"{2018 + month // 12}-{month % 12 + 1:02d}-01",
              end=f"{2018 + (month + 1) // 12}-{(month + 1) % 12 + 1:02d}-01")
    for month in range(16)
)  # fmt: skip


def recorded_by(volume: np.ndarray, seed: int = 0) -> RecordedNumbers:
    """Numbers that follow a law: 3 a day, and 0.5 for each m3 of failed volume."""
    number = np.random.default_rng(seed).poisson(3.0 * 30.4 + 0.5 * volume).astype(float)
    nothing = np.zeros((1, len(volume)))
    days = 15.0 + 30.4 * np.arange(len(volume))
    return RecordedNumbers(number, nothing, nothing, 0.0, 1.0, np.zeros(0), 0.1, 1.0, days + 17_532.0)


def test_numbers_ahead_follow_the_law_of_the_recorded_steps():
    """A month that fails twice the rock, one without mining; the right measure weighs most."""
    generator = np.random.default_rng(1)
    volume = generator.uniform(50.0, 800.0, 14)
    own = {"failed_volume": volume, "plastic_work": generator.uniform(1e6, 9e6, 14)}
    plan = {"failed_volume": np.append(volume, [1600.0, 0.0]), "plastic_work": np.full(16, 4e6)}
    ahead = np.arange(16) >= 14
    rates, weights = rates_by_measures(recorded_by(volume), MONTHS[:14], own, MONTHS, plan, ahead)
    assert list(rates) == [MONTHS[14].name, MONTHS[15].name]
    assert weights["failed_volume"] > 0.95
    double, none = rates.values()
    assert double.value == pytest.approx(91.2 + 800.0, rel=0.1)
    assert none.value == pytest.approx(91.2, rel=0.25)
    assert double.lower < double.value < double.upper


def test_intervals_of_numbers_ahead_hold_as_often_as_stated():
    """Of 150 records, 95 % intervals hold the number of the month to come in 91 % at least."""
    held = []
    for seed in range(150):
        volume = np.random.default_rng(1000 + seed).uniform(50.0, 800.0, 15)
        recorded = recorded_by(volume, seed)
        known = RecordedNumbers(
            recorded.recorded[:14], recorded.modelled[:, :14], recorded.draws, 0.0, 1.0, recorded.sizes, 0.1, 1.0,
            recorded.middles[:14],
        )  # fmt: skip
        rates, _ = rates_by_measures(
            known,
            MONTHS[:14],
            {"failed_volume": volume[:14]},
            MONTHS[:15],
            {"failed_volume": volume},
            np.arange(15) == 14,
        )
        (rate,) = rates.values()
        held.append(rate.lower <= recorded.recorded[14] <= rate.upper)
    assert 0.91 <= np.mean(held)


def test_a_record_of_one_step_and_measures_of_nothing_have_no_rate():
    """Nor do plans whose own run has collapsed by then."""
    one = np.array([100.0])
    nothing = rates_by_measures(recorded_by(one), MONTHS[:1], {"failed_volume": one}, MONTHS[:2],
                                {"failed_volume": np.array([1.0, 2.0])}, np.array([False, True]))  # fmt: skip
    assert nothing == ({}, {})
    volume = np.zeros(5)
    ahead = np.arange(6) == 5
    zero = rates_by_measures(recorded_by(volume), MONTHS[:5], {"failed_volume": volume}, MONTHS[:6],
                             {"failed_volume": np.zeros(6)}, ahead)  # fmt: skip
    assert zero == ({}, {})
    volume = np.arange(1.0, 6.0)
    collapsed, _ = rates_by_measures(recorded_by(volume), MONTHS[:5], {"failed_volume": volume}, MONTHS[:6],
                                     {"failed_volume": np.append(volume, np.nan)}, ahead)  # fmt: skip
    assert collapsed == {}


def write_states(folder, steps, volume, **others) -> list[str]:
    """States of steps with failed volumes."""
    paths = []
    for step, value in zip(steps, volume, strict=True):
        attributes = {"mine": MINE, "step": step.name, "failed_volume": value, "energy_released": 2e6 * value} | others
        write_dataset(xr.Dataset(attrs=attributes), folder / f"{step.name}.nc")
        paths.append(str(folder / f"{step.name}.nc"))
    return paths


def test_states_of_another_mine_or_too_few_are_refused(tmp_path):
    """In one line. What a state does not have is not known."""
    paths = write_states(tmp_path, STEPS, [10.0, 20.0])
    found = read_amounts(paths, STEPS, MINE)
    assert found["failed_volume"].tolist() == [10.0, 20.0]
    assert np.isnan(found["plastic_work"]).all()
    with pytest.raises(InputError, match="state of step 2019-08 of mine made_up, not of 2019-08 of other"):
        read_amounts(paths, STEPS, "other")
    with pytest.raises(InputError, match="states of 1 steps, and 2 are dated"):
        read_amounts(paths[:1], STEPS, MINE)
    gone = write_states(tmp_path / "gone", STEPS, [10.0, 20.0], collapsed=1)
    assert np.isnan(read_amounts(gone, STEPS, MINE)["failed_volume"]).all()


def test_the_outcome_and_the_page_have_the_number_by_measures(tmp_path):
    """Two recorded months and one ahead; an outcome without recorded states has none."""
    steps = (*STEPS, DatedStep(name="2019-10", start="2019-10-01", end="2019-11-01"))
    runs = drawn_ensemble(tmp_path / "plan", 1, (40, 25, 30), steps=steps)
    recorded_runs = [{"kind": run["kind"], "events": run["events"][:2]} for run in runs]
    for step, value in zip(steps, (100.0, 60.0, 80.0), strict=True):
        write_states(tmp_path / "mine", [step], [value])
        state = xr.load_dataset(tmp_path / "plan/0/steps" / f"{step.name}.nc")
        write_dataset(state.assign_attrs(failed_volume=value), tmp_path / "plan/0/steps" / f"{step.name}.nc")
    given = {
        "steps": [step.given() for step in steps],
        "recorded_steps": [step.given() for step in STEPS],
        "recorded_runs": recorded_runs,
        "recorded_states": [str(tmp_path / "mine" / f"{step.name}.nc") for step in STEPS],
    }
    record = made_up_record(70, 3, "2019-08-01", "2019-10-01")
    plan = PlanSummary(make_outcome(outcome_slice(runs, **given), made_up_grid(), record, comparison_of()))
    rates, weights = plan.measured_rates
    assert list(rates) == ["2019-10"]
    assert sum(weights.values()) == pytest.approx(1.0)
    (row,) = forecast_rows([plan])
    assert (
        row["measured"]
        == f"{rates['2019-10'].value:.0f} ({rates['2019-10'].lower:.0f} to {rates['2019-10'].upper:.0f})"
    )
    assert "has forecast the recorded steps best" in measured_text([plan])
    settings = PlansReportSlice.of({"mine": MINE, "hazard": HAZARD})
    write_report([plan.outcome], made_up_grid(), settings, tmp_path / "report.html", tmp_path / "plans.csv")
    page = (tmp_path / "report.html").read_text()
    assert "<th>events, by measures</th>" in page
    assert f"<td>{row['measured']}</td>" in page
    assert "Numbers by measures do not go by the events of the runs." in page
    without = make_outcome(
        outcome_slice(runs, **given | {"recorded_states": []}), made_up_grid(), record, comparison_of()
    )
    assert PlanSummary(without).measured_rates == ({}, {})
    assert measured_text([PlanSummary(without)]) == ""
    write_report([without], made_up_grid(), settings, tmp_path / "report.html", tmp_path / "plans.csv")
    assert "by measures" not in (tmp_path / "report.html").read_text()
    old = without.assign_attrs({key: value for key, value in without.attrs.items() if key != "rate_by_measures"})
    del old.attrs["rate_by_measures"]
    assert PlanSummary(old).measured_rates == ({}, {})
    assert json.loads(plan.outcome.attrs["steps_ahead"]) == ["2019-10"]
