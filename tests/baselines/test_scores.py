"""Scores of places, the sentences that follow from them, and the page."""

import csv
import json
from dataclasses import replace

import numpy as np
import pytest
import xarray as xr

from baselines.map_scores import MapScores
from baselines.models import Counted, compare_with_record, score_places
from baselines.month_report import map_rows, rate_rows, sentences, write_months, write_rates
from baselines.months import compare_with_months
from baselines.page import INPUT, NO_AXES, measure_rows, step_rows, verdict, write_page, write_table
from baselines.settings import BaselineReportSlice, FlawSlice
from catalogs.compare.comparison import compare
from catalogs.compare.exposure import Exposure
from catalogs.report.text import number
from catalogs.settings import ComparisonSlice, DatedStep
from common.event_table import new_catalog
from common.modelled_events import describe_sources, spread_in_time

STEPS = (
    DatedStep(name="2019-08", start="2019-08-01", end="2019-09-01"),
    DatedStep(name="2019-09", start="2019-09-01", end="2019-10-01"),
)
EXPOSURE = Exposure.of(STEPS, None)
CENTRES = np.array([[20.0, 20, 20], [80.0, 60, 40]])  # of the events of each step
FLAWS = FlawSlice.of(
    {
        "mine": "made_up",
        "strength": {"host": {"friction_angle": 20.0, "cohesion": 2e6}},
        "steps": [step.given() for step in STEPS],
        "seed": 1,
        "radii": [1.0, 12.0],
        "exponent": 2.0,
    }
)


def events(count: int, seed: int, shift=0.0, spread: float = 8.0, kind: str = "synthetic", tensors: bool = True):
    """So many events in each step about its centre, moved by a shift, m."""
    generator = np.random.default_rng(seed)
    times = [spread_in_time((step.start, step.end), count, step.name) for step in STEPS]
    place = np.concatenate([centre + spread * generator.normal(size=(count, 3)) + shift for centre in CENTRES])
    potency = 10.0 ** (generator.exponential(0.6, 2 * count) - 2.0)
    values = {"potency": potency}
    if tensors:
        tensor = np.diag([1.0, -1.0, 0.0]) + 0.2 * generator.normal(size=(2 * count, 3, 3))
        tensor = tensor + tensor.transpose(0, 2, 1)
        tensor *= (potency / np.sqrt(2.0 * np.sum(tensor**2, axis=(1, 2))))[:, None, None]
        values = describe_sources(tensor, 2.0 * tensor)
    attributes = {"mine": "made_up", "kind": kind, "potency_floor": 0.01, "location_error": 6.0}
    attributes |= {"flaws_per_m3": 0.02, "crack_density": 0.5}
    named = np.repeat([step.name for step in STEPS], count).astype(object)
    return new_catalog(
        2 * count,
        attributes,
        time=np.concatenate([one["time"] for one in times]),
        location=place,
        step=named,
        **values,
    )


def scored(*models: xr.Dataset, record: xr.Dataset) -> MapScores:
    """Scores of models of one run each."""
    counted = {str(number): Counted.of([model], EXPOSURE, -2.0) for number, model in enumerate(models)}
    return score_places(counted, record, np.ones(record.sizes["event"], bool), EXPOSURE, 2.0)


@pytest.fixture(scope="module")
def found():
    """A record, the pipeline's own model, flaws that lie elsewhere, and excess shear stress without tensors."""
    record = events(40, 0, kind="recorded")
    settings = ComparisonSlice.of({"steps": [step.given() for step in STEPS], "resamplings": 99})
    own = [events(60, 1)]
    flaws = [events(40, 10 + run, shift=15.0) for run in range(4)]
    excess = [events(40, 20 + run, tensors=False) for run in range(4)]
    return compare_with_record(own, compare(own[0], record, settings), flaws, excess, record, 2.0, settings)


def test_gain_of_a_model_that_draws_from_the_same_law_is_that_of_the_law():
    """A normal distribution of 8 m in a box, smoothed: half the logarithm of the variances, less the entropies."""
    record, model = events(300, 1), events(3000, 2)
    scores = scored(model, record=record)
    error = np.hypot(6.0, 2.0) / np.sqrt(3.0)
    box = np.concatenate([record["location"].values, model["location"].values])
    volume = np.prod(np.ptp(box, axis=0) + 6.0 * error)
    expected = np.log(0.95 * volume) - 1.5 * np.log(2 * np.pi * (64.0 + error**2)) - 1.5 * 64.0 / (64.0 + error**2)
    assert scores.mean()[0] == pytest.approx(expected, abs=0.1)


def test_events_count_for_their_own_step_alone():
    """A model with the steps in the wrong order gains less than none."""
    record, model = events(60, 3), events(60, 4)
    wrong = model.assign(time=("event", np.roll(model["time"].values, 60)))
    right, other = scored(model, wrong, record=record).mean()
    assert right > 1.0
    assert other < 0.0


def test_steps_average_to_the_whole_and_a_step_without_events_has_no_score():
    """Weighted by recorded events."""
    record = events(40, 5).isel(event=np.r_[0:40, 50:60])
    scores = scored(events(50, 6), record=record)
    np.testing.assert_allclose(scores.mean(), (40 * scores.mean(0) + 10 * scores.mean(1)) / 50)
    empty = scored(events(50, 6), record=record.isel(event=slice(0, 40)))
    assert np.isnan(empty.mean(1)).all()
    assert np.isnan(empty.interval(1)).all()


def test_runs_are_counted_with_their_cut_and_their_time():
    """Resolved events from the cut on within the steps; sums are means of runs."""
    one, two = events(10, 11), events(10, 12)
    one["resolved"][0], one["time"][1] = 0, np.datetime64("2020-01-01", "ns")
    counted = Counted.of([one, two], EXPOSURE, -1.5)
    count, potency = counted.by_step(2)
    large = [run["potency"].values >= 10**-1.5 for run in (one, two)]
    large[0][:2] = False
    step = np.repeat([0, 1], 10)
    np.testing.assert_allclose(count, [sum(np.sum(kept[step == n]) for kept in large) / 2 for n in (0, 1)])
    sizes = np.concatenate([run["potency"].values[kept] for run, kept in zip((one, two), large, strict=True)])
    assert potency.sum() == pytest.approx(sizes.sum() / 2)


def test_the_first_sentence_compares_the_pipeline_with_each_baseline(found):
    """Its model lies where the record does, as excess shear stress does; flaws lie elsewhere."""
    first, gain, flaws, stress = verdict(found.models, found.scores)
    assert first == (
        "The pipeline's own model places recorded events better than seeded flaws, and neither better nor worse than "
        "excess shear stress, as far as this record can tell."
    )
    mean, lead = found.scores.mean()[0], found.scores.lead("Pipeline", "Seeded flaws")
    assert f"on average {number(np.exp(mean), 2)} times as probable as under a uniform rate (95 % interval " in gain
    assert f"information gain {mean:.2f} nats)" in gain
    assert flaws.startswith(f"It is {number(np.exp(lead.value), 2)} times as probable as under seeded flaws (95 % ")
    low, high = flaws.partition("interval ")[2].partition(")")[0].split(" to ")
    assert 1.0 < float(low) <= np.exp(lead.interval[0])
    assert float(high) >= np.exp(lead.interval[1])
    assert "which is more than chance explains (T test, p" in flaws
    assert "as under excess shear stress (95 % interval 0." in stress
    assert "which is no more than chance explains (T test, p = " in stress


def test_verdict_of_models_that_place_nothing_right_and_of_few_clusters(found):
    """All are worse than a uniform rate; with two clusters there is no verdict."""
    gains = tuple(np.full((1, 40), value) + 0.1 * np.arange(40) / 40 for value in (-1.0, -2.0, -3.0))
    labels = tuple(model.label for model in found.models)
    many, few = (MapScores(labels, gains, np.zeros(40, int), np.arange(40) // size) for size in (1, 20))
    assert "No model places them better than a uniform rate." in verdict(found.models, many)
    first, *rest = verdict(found.models, few)
    assert first.startswith("The recorded events form 2 clusters, which are worth 2.0 of one size; 4 are needed.")
    assert "too few independent clusters to say" in first
    assert not any("better than" in text or "chance" in text for text in rest)


def test_inputs_are_marked_and_what_has_no_axes_has_none(found):
    """Number of both baselines, sizes of excess shear stress; in the rows of steps the split is their own."""
    rows = {row["name"]: row["cells"] for row in measure_rows(found.models, found.scores)}
    assert rows["number of events, modelled over recorded"][1:] == [INPUT, INPUT]
    ratio = len(found.models[0].counted.place) / len(found.recorded.place)
    assert rows["number of events, modelled over recorded"][0].startswith(number(ratio))
    assert [cell == INPUT for cell in rows["summed potency, modelled over recorded"]] == [False, False, True]
    assert rows["M test of the sizes (b), p-value"][1:] == [INPUT, INPUT]  # b of flaws follows from their exponent
    assert rows["M test of the sizes (b), p-value"][0] != INPUT
    assert [cell == NO_AXES for cell in rows["angle between the mean P axes"]] == [False, False, True]
    assert "(" not in rows["energy distance of the places (0: alike)"][0]  # one run has no interval
    assert all("(" in cell for cell in rows["distance between the centroids"])  # whose interval is of the record
    assert all("(" in cell for cell in rows["energy distance of the places (0: alike)"][1:])
    steps = step_rows(found.models, found.recorded, found.scores, found.steps)
    assert [row["number"] for row in steps] == [str(count) for count in np.bincount(found.recorded.step)]
    counts = [np.count_nonzero(model.counted.step == 0) / model.counted.runs for model in found.models]
    assert steps[0]["numbers"] == [number(count) for count in counts]
    assert steps[1]["potencies"][2] == INPUT


def grid() -> xr.Dataset:
    """A grid with one excavation that is mined and one that is planned."""
    origin = np.array([[30.0, 30, 30], [50.0, 30, 30]])
    values = {
        "piece_origin": (("piece", "xyz"), origin),
        "piece_fraction": ("piece", np.ones(2)),
        "piece_excavation": ("piece", np.arange(2)),
    }
    corners = {"domain_lower": np.full(3, -100.0), "domain_upper": np.full(3, 200.0)}
    names = json.dumps(["stope", "later"])
    return xr.Dataset(values, attrs={"fine_cell": 10.0, "dimension": 3, "excavation_names": names, **corners})


@pytest.mark.parametrize("kind", ["recorded", "twin"])
def test_page_and_table_need_nothing_else(found, tmp_path, kind):
    """A twin is said to favour the model that made it; every figure is within the page."""
    shown = type(found)(
        found.record.assign_attrs(kind=kind),
        *[getattr(found, name) for name in ("recorded", "models", "scores", "steps")],
    )
    attributes = events(1, 0).attrs
    settings = BaselineReportSlice.of(
        {
            "mine": "made_up",
            "comparison": {"steps": [step.given() for step in STEPS]},
            "flaws": FLAWS.given(),
            "box": [[-100.0, -100.0], [200.0, 200.0]],
        }
    )
    months = compare_with_months(shown, shown.record, 2.0, settings)
    write_page(tmp_path / "report.html", "made_up", shown, attributes, grid(), ["later"], FLAWS, months)
    write_table(tmp_path / "scores.csv", shown)
    page = (tmp_path / "report.html").read_text()
    assert ("The record is a twin" in page) == (kind == "twin")
    assert page.count("<img") == page.count("data:image/svg+xml") == 2
    assert "of the rock on alert, the map with the largest area skill" in page
    assert "Forecasts for pyCSEP need a place on Earth" in page
    assert "input, not scored" in page
    assert "radii of 1 to 12 m" in page
    assert "gives no <code>face</code>" in page
    assert "last month, as they are" in page
    with open(tmp_path / "scores.csv") as file:
        rows = list(csv.DictReader(file))
    assert [row["step"] for row in rows] == ["2019-08", "2019-09", "all"] * 3
    assert float(rows[2]["gain, nats per event"]) == pytest.approx(found.scores.mean()[0], rel=1e-4)
    assert float(rows[2]["recorded events"]) == len(found.recorded.place)
    assert float(rows[5]["events"]) == pytest.approx(len(found.models[1].counted.place) / 4)


def months_of(shown, steps=STEPS, complete_above=None, **given):
    """Months beside a made-up mine whose record begins with its first step."""
    values = {
        "mine": "made_up",
        "comparison": {"steps": [step.given() for step in steps]} | given,
        "flaws": FLAWS.given(),
        "box": [[-100.0, -100.0], [200.0, 200.0]],
    }
    values |= {} if complete_above is None else {"complete_above": complete_above}
    return compare_with_months(shown, shown.record, 2.0, BaselineReportSlice.of(values))


def test_months_say_whether_the_model_beats_the_record_and_whether_a_rate_fits(found, tmp_path):
    """Events of both steps lie at different places, so the record as it is foretells nothing; the model does."""
    months = months_of(found)
    first, *rest = sentences(months)
    gain = dict(zip(months.scores.labels, months.scores.mean(), strict=True))
    assert gain["Pipeline"] > gain["last"]
    named = [f"{number(np.exp(gain[one]), 2)} times" for one in ("Pipeline", "last")]
    assert first.startswith(
        "In 1 step with earlier months, the place of a recorded event is on average "
        f"{named[0]} as probable under the pipeline's map as under a uniform rate, and {named[1]} under the best map"
    )
    assert "Under the pipeline's map it is " in first
    assert "nats" not in first
    assert "which is more than chance explains" in first
    assert any(
        text.startswith("By days, the rate of all earlier months fits the number of 1 of 1 step") for text in rest
    )
    assert not any("By metres" in text or "line of the face" in text for text in (first, *rest))
    rows = map_rows(months)
    assert rows[0]["steps"][0] == "–"
    assert "(" in rows[0]["all"]
    assert rate_rows(months)[0]["expected"] == ["–"] * 4
    write_months(tmp_path / "months.csv", months)
    write_rates(tmp_path / "rates.csv", months)
    with open(tmp_path / "months.csv") as file:
        table = {(row["map"], row["step"]): row for row in csv.DictReader(file)}
    assert float(table["Pipeline", "all"]["gain, nats per event"]) == pytest.approx(gain["Pipeline"], rel=1e-4)
    assert table["last", "2019-08"]["gain, nats per event"] == ""
    with open(tmp_path / "rates.csv") as file:
        assert [row["step"] for row in csv.DictReader(file)] == ["2019-08", "2019-09"]


def test_a_record_without_earlier_months_says_what_to_give(found):
    """One step, and nothing before it."""
    shown = type(found)(found.record, found.recorded, found.models, found.scores, ("2019-08",))
    early = found.record["time"].values < np.datetime64("2019-09-01")
    used = shown.models[0].comparison["record_used"].values * early
    comparison = shown.models[0].comparison.assign(record_used=("event_record", used))
    models = (replace(shown.models[0], comparison=comparison), *shown.models[1:])
    (line,) = sentences(months_of(replace(shown, models=models), STEPS[:1]))
    assert "Give baselines.since" in line


def test_recorded_events_count_from_where_the_record_is_complete(found):
    """In maps and numbers, whatever the cut of the comparison; the scores of the models keep the latter."""
    own = months_of(found)
    sizes = found.record["potency"].values
    larger = float(np.quantile(sizes, 0.7))
    for complete_above in (larger, float(sizes.min())):
        months = months_of(found, complete_above=complete_above)
        expected = int((sizes >= complete_above).sum())
        assert len(months.maps.step) == len(months.maps.record.time) == expected
        assert sum(row.number for row in months.rates) == months.numbers.number.sum() == expected
        assert len(months.maps.cluster) == len(months.maps.deviation) == expected
    cut = 10.0 ** float(found.models[0].comparison["cut"])
    same = months_of(found, complete_above=cut)
    np.testing.assert_allclose(same.scores.gain, own.scores.gain)
    np.testing.assert_array_equal(same.maps.cluster, own.maps.cluster)


@pytest.mark.parametrize("missing", [("Seeded flaws",), ("Seeded flaws", "Excess shear stress")])
def test_a_page_without_a_baseline_says_why(tmp_path, missing):
    """The other models are compared as ever."""
    record = events(40, 0, kind="recorded")
    settings = ComparisonSlice.of({"steps": [step.given() for step in STEPS], "resamplings": 99})
    nothing = [events(40, 9).isel(event=slice(0, 0)).assign_attrs(left_out="no flaw slips; give larger radii")]
    shear = nothing if len(missing) == 2 else [events(40, 20 + run, tensors=False) for run in range(4)]
    own = [events(60, 1)]
    shown = compare_with_record(own, compare(own[0], record, settings), nothing, shear, record, 2.0, settings)
    assert not {model.label for model in shown.models} & set(missing)
    months = months_of(shown)
    write_page(tmp_path / "report.html", "made_up", shown, nothing[0].attrs, grid(), ["later"], FLAWS, months)
    write_table(tmp_path / "scores.csv", shown)
    page = (tmp_path / "report.html").read_text()
    assert page.count("no flaw slips; give larger radii") == len(missing)
    assert "There is no baseline of seeded flaws: " in page
    assert "Flaws have radii" not in page
    with open(tmp_path / "scores.csv") as file:
        assert len(list(csv.DictReader(file))) == 3 * (3 - len(missing))
