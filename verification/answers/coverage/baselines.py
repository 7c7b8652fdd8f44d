"""Coverage of the intervals of the baselines' gains, and false alarms of their T test and of the N test of rates.

Three models place a record of events in bursts, triggered or independent: the pipeline's own, which may run once, and
two of ten runs. Truths are mean gains, over the record's law, of the law that runs are drawn from. The rate of the
record is the same in all months, so that every N test that condemns it is a false one.
"""

from dataclasses import dataclass

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from baselines.map_scores import adjusted
from baselines.models import Counted, score_places
from baselines.month_maps import Periods, Places
from baselines.months import step_rates
from catalogs.compare.exposure import Exposure
from catalogs.compare.locations import box_around, information_gain
from verification.answers.coverage.shares import Coverage, alarm_row
from verification.answers.statistics.samples import branching_events, burst_events, dated
from verification.rows import Row

SPREAD, KERNEL = 30.0, 8.0  # m: standard deviations of clusters, and of events about them, along each axis
RUNS = 10  # of each baseline
TRUTH_RECORDS, TRUTH_EVENTS = 300, 1000  # Records whose events have the record's law, and events of these for a truth.
ERROR, CELL = 10.0, 5.0  # m: location error of the record, finest cell


@dataclass(frozen=True)
class Law:
    """Events of a model: `number` expected in a run, normal about a point `shift` m east of the record's middle."""

    number: float
    shift: float
    runs: int

    def draw(self, generator: np.random.Generator, steps: int, runs: int) -> Counted:
        """So many runs, whose events are spread evenly over the steps."""
        counts = generator.poisson(self.number, runs)
        place = SPREAD * generator.normal(size=(counts.sum(), 3)) + [self.shift, 0.0, 0.0]
        step, run = generator.integers(0, steps, len(place)), np.repeat(np.arange(runs), counts)
        return Counted(place, step, np.ones(len(place)), run, runs)


def answer(settings: dict, allowed: dict) -> tuple[list[Coverage], list[Row]]:
    """Coverages of gains and leads, and false alarms of the T test (equal models) and of the N test (one rate)."""
    chosen = settings["baselines"]
    coverages, alarms = [], []
    for number, case in enumerate(chosen["cases"]):
        found = place_scores(case, chosen, np.random.default_rng([settings["seed"], 5, number]))
        name = f"baselines, {case['name']}"
        coverages += [
            Coverage(f"{name}: {what}", chosen["catalogues"], found.given, share) for what, share in found.held.items()
        ]
        if case["shift"] == 0.0:
            count = round(found.given * chosen["catalogues"])
            alarms.append(alarm_row(f"{name}: T_test", chosen, found.told_apart, allowed["alarms"], count, "records"))
    for number, case in enumerate(chosen["rates"]):
        share, count = rate_alarms(case, chosen, np.random.default_rng([settings["seed"], 6, number]))
        alarms.append(alarm_row(f"rates, {case['name']}: N_test", chosen, share, allowed["alarms"], count, "records"))
    return coverages, alarms


@dataclass(frozen=True)
class PlaceScores:
    """Results over records of one case.

    given: share of records with intervals; held: share of these intervals that hold the truth, by quantity; told_apart:
    share of records with intervals that are said to be placed better or worse by the first model than by another.
    """

    given: float
    held: dict[str, float]
    told_apart: float


def place_scores(case: dict, chosen: dict, generator: np.random.Generator) -> PlaceScores:
    """Gains and leads of three models: the first `shift` m away from the record's middle, the others at it."""
    days, steps = chosen["days"], chosen["steps"]
    edges = dated(np.arange(steps + 1) * days / steps)
    exposure = Exposure(edges[:-1], edges[1:])
    laws = {
        "first": Law(chosen["number"], case["shift"], case["runs"]),
        **{name: Law(chosen["number"], 0.0, RUNS) for name in ("second", "third")},
    }
    lawful = np.concatenate([_record(generator, case, days)[1] for _ in range(TRUTH_RECORDS)])
    held: dict[str, list[bool]] = {"gain": [], "lead": []}
    told_apart: list[bool] = []
    for _ in range(chosen["catalogues"]):
        time, place = _record(generator, case, days)
        if len(time) < 2:
            continue
        values = {"time": ("event", dated(time)), "location": (("event", "xyz"), place)}
        values["resolved"] = ("event", np.ones(len(time), np.int8))
        record = xr.Dataset(values, attrs={"location_error": ERROR})
        models = {name: law.draw(generator, steps, law.runs) for name, law in laws.items()}
        scores = score_places(models, record, np.ones(len(time), bool), exposure, CELL)
        if not scores.has_intervals:
            continue
        deviation = np.hypot(ERROR, CELL) / np.sqrt(3.0)
        box = box_around(place, *(model.place for model in models.values()), margin=3.0 * deviation)
        events = lawful[generator.integers(0, len(lawful), TRUTH_EVENTS)]
        truth = [
            _true_gain(generator, events, law, steps, chosen["truth_runs"], deviation, box) for law in laws.values()
        ]
        leads = [scores.lead("first", name) for name in ("second", "third")]
        gains = scores.interval()[1:]  # one run has no interval of its law
        held["gain"] += [low <= value <= high for (low, high), value in zip(gains, truth[1:], strict=True)]
        held["lead"] += [
            bool(lead.interval[0] <= truth[0] - value <= lead.interval[1])
            for lead, value in zip(leads, truth[1:], strict=True)
        ]
        told_apart.append(bool((adjusted([lead.p_value for lead in leads]) <= chosen["level"]).any()))
    shares = {what: float(np.mean(values)) if values else np.nan for what, values in held.items()}
    given = len(told_apart) / chosen["catalogues"]
    return PlaceScores(given, shares, float(np.mean(told_apart)) if told_apart else np.nan)


def _true_gain(
    generator: np.random.Generator,
    events: NDArray,
    law: Law,
    steps: int,
    runs: int,
    deviation: float,
    box: NDArray,
) -> float:
    """Mean gain, nats, of runs of a law at events (event, 3), m, of the record's law."""
    model = law.draw(generator, steps, runs)
    gains = [
        information_gain(events, model.place[(model.run == run) & (model.step == step)], deviation, box).mean()
        for run in range(runs)
        for step in range(steps)
    ]
    return float(np.mean(gains))


def _record(generator: np.random.Generator, case: dict, days: float) -> tuple[NDArray, NDArray]:
    """Times (event,), days, and places (event, 3), m, of a case's bursts or triggered events."""
    if "bursts" in case:
        each = case["events"] / case["bursts"]
        return burst_events(generator, days, case["bursts"], each, SPREAD, KERNEL)[:2]
    return branching_events(generator, days, case["events"], case["branching"], SPREAD, KERNEL)[:2]


def rate_alarms(case: dict, chosen: dict, generator: np.random.Generator) -> tuple[float, int]:
    """Share of records with an N test of the last month whose p-value is at most `level`, and how many have one."""
    months = case["months"]
    edges = dated(30.0 * np.arange(months + 1))
    periods, p_values = Periods(edges[:-1], edges[1:], months - 1), []
    for _ in range(chosen["catalogues"]):
        time, place = _record(generator, case, 30.0 * months)
        record = Places(dated(time), place[:, :2], np.ones(len(time)))
        p_values.append(step_rates(record, periods, None)[-1].all_earlier["days"].p_value)
    known = np.array(p_values)[np.isfinite(p_values)]
    return (float(np.mean(known <= chosen["level"])) if len(known) else np.nan), len(known)
