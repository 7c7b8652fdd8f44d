"""Catalogues drawn from states: as many events as recorded, in the form that the comparison takes, and refusals."""

import json
from types import SimpleNamespace

import numpy as np
import pytest
import xarray as xr
from rock_fixtures import QUIET, SLIPPING, STRENGTH, write_block

from baselines import catalogues
from baselines.catalogues import (
    LEFT_OUT,
    RUNS,
    RecordedTargets,
    excess_shear_runs,
    flaw_runs,
    join_runs,
    make_catalogue,
    runs_if_possible,
    split_runs,
)
from baselines.settings import FlawSlice
from catalogs.compare.comparison import compare
from catalogs.settings import DatedStep
from common.errors import InputError
from common.event_table import new_catalog, read_events, write_events

STEPS = (
    DatedStep(name="2019-08", start="2019-08-01", end="2019-09-01"),
    DatedStep(name="2019-09", start="2019-09-01", end="2019-10-01"),
)
SETTINGS = {
    "mine": "block",
    "strength": {name: one.given() for name, one in STRENGTH.items()},
    "steps": [step.given() for step in STEPS],
    "seed": 1,
    "radii": [0.5, 6.0],
    "exponent": 2.0,
}
TARGETS = RecordedTargets(cut=3e-3, floor=2e-3, number=60, sizes=np.geomspace(3e-3, 0.3, 60), weight=np.ones(2))


@pytest.fixture(scope="module")
def states(tmp_path_factory):
    """History and two steps: quiet, then shear in half of the block, then in all of it."""
    folder = tmp_path_factory.mktemp("states")
    half = np.where(np.arange(64)[:, None] < 32, SLIPPING, QUIET)
    return [write_block(folder / f"{n}.nc", stress) for n, stress in enumerate((QUIET, half, SLIPPING))]


def slice_of(**values) -> FlawSlice:
    """The slice of the block."""
    return FlawSlice.of(SETTINGS | values)


@pytest.fixture(scope="module")
def flaws(states):
    """Runs of the seeded flaws."""
    return flaw_runs(states, TARGETS, slice_of())


@pytest.fixture(scope="module")
def excess_shear(states):
    """Runs of excess shear stress."""
    return excess_shear_runs(states, TARGETS, slice_of())


@pytest.mark.parametrize("kind", ["flaws", "excess_shear"])
def test_as_many_events_are_drawn_as_recorded(kind, request):
    """In the mean of all runs, within Poisson error; interaction of flaws may change it by a tenth."""
    runs = request.getfixturevalue(kind)
    counts = [run.sizes["event"] for run in runs]
    room = 0.1 * 60 if kind == "flaws" else 0.0
    assert len(runs) == RUNS
    assert len(set(counts)) > 3
    assert abs(np.mean(counts) - 60) < 3.5 * np.sqrt(60 / RUNS) + room


@pytest.mark.parametrize("kind", ["flaws", "excess_shear"])
def test_events_lie_where_and_when_stress_slips(kind, request):
    """In the half that is loaded in the first step, in the other one in the second step: so 30 events each."""
    every = xr.concat(request.getfixturevalue(kind), "event")
    east = every["location"].values[:, 0]
    step = every["step"].values
    assert np.mean(east[step == "2019-08"] < 20.0) == 1.0
    assert np.mean(east[step == "2019-09"] > 20.0) > 0.9  # slipped flaws may slip again where others load them
    assert np.mean(step == "2019-08") == pytest.approx(0.5, abs=0.08)
    time = every["time"].values
    assert ((time >= np.datetime64("2019-08-01")) & (time < np.datetime64("2019-10-01"))).all()
    assert every["potency"].values.min() >= TARGETS.cut * (1 - 1e-12)


def test_flaws_have_mechanisms_of_slip_and_excess_shear_stress_has_none(flaws, excess_shear):
    """Double couples with the moment of their potency; sizes of the record without tensors."""
    np.testing.assert_allclose(flaws[0]["dc"], 1.0)
    np.testing.assert_allclose(flaws[0]["moment"], 22.8e9 * flaws[0]["potency"])
    assert np.isfinite(flaws[0]["source_size"]).all()
    assert np.isnan(excess_shear[0]["potency_tensor"]).all()
    assert np.isin(excess_shear[0]["potency"].values, TARGETS.sizes).all()


def test_only_the_part_of_a_step_that_the_record_shares_counts(states):
    """Half of the second step: more events are drawn, so that the recorded number falls into the shared time."""
    targets = RecordedTargets(TARGETS.cut, TARGETS.floor, 60, TARGETS.sizes, weight=np.array([1.0, 0.5]))
    runs = excess_shear_runs(states, targets, slice_of())
    assert np.mean([run.sizes["event"] for run in runs]) == pytest.approx(80, abs=3.5 * np.sqrt(80 / RUNS))


def test_a_box_leaves_out_the_rest_of_the_mine(states):
    """All events lie in the box that the record is taken from, as many as recorded."""
    runs = excess_shear_runs(states, TARGETS, slice_of(lower=[0, 0, 0], upper=[40, 40, 20]))
    assert max(run["location"].values[:, 2].max() for run in runs) <= 20.0
    assert np.mean([run.sizes["event"] for run in runs]) == pytest.approx(60, abs=3.5 * np.sqrt(60 / RUNS))


def record(count: int, seed: int = 0) -> xr.Dataset:
    """Recorded events of both months, anywhere in the block."""
    generator = np.random.default_rng(seed)
    days = np.sort(generator.uniform(0, 61, count))
    return new_catalog(
        count,
        {"mine": "block", "kind": "recorded", "location_error": 3.0},
        time=np.datetime64("2019-08-01", "ns") + (days * 86400e9).astype("timedelta64[ns]"),
        location=generator.uniform(0, 40, (count, 3)),
        potency=10 ** generator.exponential(0.6, count) * 3e-3,
    )


@pytest.mark.parametrize("kind", ["flaws", "excess_shear"])
def test_the_comparison_takes_it_like_any_other_catalogue(kind, request, tmp_path):
    """After a file, with the other runs as members: places have intervals."""
    runs = request.getfixturevalue(kind)
    write_events(runs[0], tmp_path / "flaws.nc")
    write_events(join_runs(runs), tmp_path / "runs.nc")
    again = split_runs(read_events(tmp_path / "runs.nc"))
    assert [run.sizes["event"] for run in again] == [run.sizes["event"] for run in runs]
    np.testing.assert_array_equal(again[3]["location"], runs[3]["location"])
    settings = {"steps": [step.given() for step in STEPS], "resamplings": 99}
    found = compare(read_events(tmp_path / "flaws.nc"), record(60), settings | {"members": RUNS - 1}, again[1:])
    assert np.isfinite(found["energy_distance_interval"]).all()
    assert int(found["model_runs"]) == RUNS


def test_targets_follow_from_record_and_comparison():
    """Number and sizes of those that count; half of the last step is not recorded."""
    events = record(40).assign_attrs(period=json.dumps({"common": ["2019-08-01", "2019-09-16"]}))
    used = np.arange(40) % 2
    comparison = xr.Dataset(
        {"record_used": ("event_record", used), "cut": -2.0, "model_floor": np.nan}, attrs={"cut_text": "log P >= -2"}
    )
    targets = RecordedTargets.of(events, comparison, STEPS)
    assert (targets.cut, targets.number) == (pytest.approx(0.01), 20)
    np.testing.assert_array_equal(targets.sizes, events["potency"].values[used == 1])
    np.testing.assert_allclose(targets.weight, [1.0, 0.5])
    np.testing.assert_allclose(targets.state_weights(4), [0.0, 0.0, 1.0, 0.5])
    with pytest.raises(InputError, match="no event that is compared"):
        RecordedTargets.of(events, comparison.assign(record_used=0 * comparison["record_used"]), STEPS)


def test_times_are_spread_over_each_step_in_the_order_of_slip():
    """By rank, as those of the model's own catalogue."""
    place = np.arange(12.0).reshape(4, 3)
    made = make_catalogue("block", STEPS, np.array([1, 0, 1, 0]), {}, location=place, potency=np.ones(4))
    np.testing.assert_array_equal(made["location"], place[[1, 3, 0, 2]])
    days = (made["time"].values - np.datetime64("2019-08-01")) / np.timedelta64(1, "D")
    np.testing.assert_allclose(days, [31 / 4, 31 * 3 / 4, 31 + 30 / 4, 31 + 30 * 3 / 4], rtol=1e-6)
    assert made["step"].values.tolist() == ["2019-08", "2019-08", "2019-09", "2019-09"]


@pytest.mark.parametrize(
    ("draw", "values", "problem"),
    [
        (flaw_runs, {"radii": [0.01, 0.1]}, "no flaw slips by log P -2.52 or more"),
        (flaw_runs, {"strength": {"host": {"friction_angle": 60.0, "cohesion": 1e6}}}, "no flaw slips"),
        (flaw_runs, {"radii": [0.5, 500.0], "exponent": 0.5}, "many times"),
        (excess_shear_runs, {"strength": {"host": {"friction_angle": 60.0, "cohesion": 1e6}}}, "no dated step raises"),
    ],
)
def test_rock_that_cannot_slip_is_refused(states, draw, values, problem):
    """In one line that names the keys."""
    with pytest.raises(InputError, match=problem) as refused:
        draw(states, TARGETS, slice_of(**values))
    assert "baselines." in str(refused.value)
    assert "\n" not in str(refused.value)


def test_more_flaws_than_memory_holds_are_refused(states, monkeypatch):
    """Before any is sown."""
    monkeypatch.setattr(catalogues, "MAX_SEEDS", 10)
    monkeypatch.setattr(catalogues, "draw_poisson_flaws", SimpleNamespace())
    with pytest.raises(InputError, match="flaws are needed"):
        flaw_runs(states, TARGETS, slice_of())


def test_a_baseline_that_is_not_possible_is_left_out_with_its_reason(states, tmp_path, caplog):
    """A file of one catalogue without events, and one line on the terminal; the other baseline is made."""
    runs = runs_if_possible(flaw_runs, states, TARGETS, slice_of(radii=[0.01, 0.02]))
    (line,) = (one.getMessage() for one in caplog.records if one.levelname == "WARNING")
    assert line.startswith("baselines: no flaw slips by log P")
    assert line.endswith("; this baseline is left out")
    write_events(join_runs(runs), tmp_path / "flaws_runs.nc")
    (alone,) = split_runs(read_events(tmp_path / "flaws_runs.nc"))
    assert alone.sizes["event"] == 0
    assert alone.attrs[LEFT_OUT].startswith("no flaw slips by log P")
    shear = runs_if_possible(excess_shear_runs, states, TARGETS, slice_of())
    assert len(shear) == RUNS
    assert LEFT_OUT not in shear[0].attrs
