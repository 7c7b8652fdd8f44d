"""Coverage of the 95 % intervals of the comparison: of b, of angles between mean axes, of places, of sums and ratios.

The functions that draw a catalogue of a case return its interval and the truth by quantity ("" where there is only
one).
"""

from dataclasses import dataclass

import numpy as np
import xarray as xr
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation
from scipy.stats import norm

from catalogs.compare.blocks import cluster_labels
from catalogs.compare.exposure import DAY, Exposure
from catalogs.compare.locations import compare_locations
from catalogs.compare.size_measures import fit
from catalogs.compare.sum_measures import sum_measures
from catalogs.settings import ComparisonSettings
from catalogs.sources import completeness
from catalogs.sources.mechanisms import AxesSample, compare_axes
from verification.answers.coverage.shares import Coverage, Intervals, alarm_row, cover
from verification.answers.statistics.samples import LN10, branching_events, burst_events, dated, simulated_sizes
from verification.rows import Row


def answer(settings: dict, allowed: dict) -> tuple[list[Coverage], list[Row]]:
    """Coverages of sizes, axes, sums and of records and models of one process, and false alarms of the last."""
    coverages, alarms = [], []
    kinds = {"sizes": size_interval, "axes": axes_interval, "sums": sum_intervals}
    for group, (part, draw_intervals) in enumerate(kinds.items()):
        chosen = settings[part]
        for number, case in enumerate(chosen["cases"]):
            coverages += cover(draw_intervals, case, chosen, [settings["seed"], group, number])
    chosen = settings["one_process"]
    for number, case in enumerate(chosen["cases"]):
        pairs = one_process(case, chosen, [settings["seed"], 3, number])
        coverages += [
            Coverage(f"{case['name']}: {what}", chosen["catalogues"], pairs.given, share)
            for what, share in pairs.held.items()
        ]
        alarms += [
            alarm_row(f"{case['name']}: {what}", chosen, share, allowed["alarms"])
            for what, share in pairs.alarms.items()
        ]
    return coverages, alarms


def detected_sizes(generator: np.random.Generator, case: dict) -> NDArray:
    """log10 sizes (count,) with slope b that end at `span`, detected with a normal ramp of deviation `fade` about 0.

    Without `fade` all sizes above 0 are detected. Sizes are rounded to multiples of bin_width, if there is one.
    """
    count, fade, width = case["count"], case.get("fade", 0.0), case.get("bin_width", 0.0)
    lowest = 4.0 * fade
    found = np.empty(0)
    while len(found) < count:
        x = simulated_sizes(generator, 20 * count, case["b"], case.get("span", np.inf)) - lowest
        found = np.append(found, x[generator.random(len(x)) < norm.cdf(x / fade)] if fade else x)
    found = found[:count]
    return np.round(found / width) * width if width else found


def size_interval(case: dict, chosen: dict, generator: np.random.Generator, index: int) -> Intervals:
    """Interval of b of the quoted law, above a cut that is chosen from the sizes, or above the case's own `cut`."""
    x = detected_sizes(generator, case)
    width = completeness.rounding(x)
    cut = case.get("cut", completeness.completeness(x, width))
    settings = ComparisonSettings(resamplings=chosen["resamplings"], seed=index)
    b = fit(x, cut, width, "cut" not in case, settings).quoted if np.isfinite(cut) else None
    return {"": ((b.lower, b.upper) if b else None, case["b"])}


def axes_interval(case: dict, chosen: dict, generator: np.random.Generator, index: int) -> Intervals:
    """Interval of the angle between the mean P axes. The record's are turned by `turn` degrees."""
    model = _axes(generator, case["model"], 1, case["spread"], 0.0)
    days, each = case["record"]
    record = _axes(generator, days, each, case["spread"], case["turn"])
    low, high = compare_axes(model, record, index, chosen["resamplings"])["mean_angle_interval"][0]
    return {"": ((low, high) if np.isfinite(low) else None, case["turn"])}


def _axes(generator: np.random.Generator, days: int, each: int, spread: float, turn: float) -> AxesSample:
    """Frames turned about their B axis by `turn`, then at random for each day and each event, by `spread` degrees."""
    blocks = np.repeat(np.arange(days), each)
    daily = generator.normal(size=(days, 3))[blocks] * (each > 1)
    scatter = Rotation.from_rotvec(np.radians(spread) * daily)
    scatter *= Rotation.from_rotvec(np.radians(spread) * generator.normal(size=(len(blocks), 3)))
    turned = Rotation.from_rotvec([0.0, np.radians(turn), 0.0]).apply(np.eye(3))
    axes = np.einsum("eij,aj->eai", scatter.as_matrix(), turned)
    return AxesSample(axes, generator.normal(size=(len(blocks), 3)), blocks)


def sum_intervals(case: dict, chosen: dict, generator: np.random.Generator, index: int) -> Intervals:
    """Intervals of the record's expected number and potency, and of the model's ratios to them, for one law of sizes.

    The record has `events` expected in `days`. They trigger each other (`branching`; 0: independent) or come in
    `bursts`. The model has `modelled` events expected, in `runs` that scatter by the share `scatter` more than
    independent events do. Potency is that of events up to the largest recorded, as the interval states; without an
    upper end the whole potency would be infinite.
    """
    days, expected, ratio = chosen["days"], case["events"], case["modelled"] / case["events"]
    start = dated(np.zeros(1))
    exposure = Exposure(start, start + days * DAY)
    runs, scatter = case.get("runs", 1), case.get("scatter", 0.0)
    time, place, _ = _clustered_events(generator, case, days)
    clusters = cluster_labels(dated(time), place, np.zeros(len(time)))
    rates = case["modelled"] * (generator.gamma(scatter**-2, scatter**2, runs) if scatter else np.ones(runs))
    record = _events(generator, dated(time), case)
    model, *members = (_events(generator, dated(np.zeros(generator.poisson(rate))), case) for rate in rates)
    both = (model, record)
    used = [np.ones(events.sizes["event"], bool) for events in both]
    found = sum_measures(both, used, members, clusters, 0.0, exposure)[0]
    largest = np.log10(record["potency"].values.max(initial=1.0))
    potency = expected * mean_potency(case["b"], case.get("span", np.inf), largest) / days
    truths = {
        "number": ("event_rate", expected / days),
        "potency": ("potency_rate", potency),
        "ratio of numbers": ("event_ratio", ratio),
        "ratio of potencies": ("potency_ratio", ratio),
    }
    intervals: Intervals = {}
    for name, (variable, truth) in truths.items():
        low, high = found[f"{variable}_interval"][1]
        intervals[name] = (low, high) if low < high else None, truth
    return intervals


def _clustered_events(generator: np.random.Generator, case: dict, days: float) -> tuple[NDArray, NDArray, NDArray]:
    """Times (event,), locations (event, 3) and clusters (event,) of a case's triggered events or bursts."""
    if "bursts" in case:
        return burst_events(generator, days, case["bursts"], case["events"] / case["bursts"])
    return branching_events(generator, days, case["events"], case.get("branching", 0.0))


def _events(generator: np.random.Generator, time: NDArray, case: dict) -> xr.Dataset:
    """Events at these times (event,), whose sizes follow the case's law from 1 m3 on."""
    potency = 10.0 ** simulated_sizes(generator, len(time), case["b"], case.get("span", np.inf))
    resolved = np.ones(len(time), np.int8)
    return xr.Dataset({"time": ("event", time), "potency": ("event", potency), "resolved": ("event", resolved)})


def mean_potency(b: float, span: float, largest: float) -> float:
    """Potency of events up to log10 `largest`, m3, as a mean over all events.

    Sizes start at 1 m3, have slope b (not 1) and end at `span`.
    """
    rate = b * LN10
    return rate / (LN10 - rate) * np.expm1((LN10 - rate) * largest) / -np.expm1(-rate * span)


@dataclass(frozen=True)
class Run:
    """Events of a run or a record: days (event,), location (event, 3) m, axes (event, 3, 3) with rows P, B and T."""

    days: NDArray
    location: NDArray
    axes: NDArray


@dataclass(frozen=True)
class OneProcess:
    """Results over pairs of a record and an ensemble of one process.

    given: share of pairs with a comparison. held: share of these whose interval holds the truth, for offset, distance
    and axes. alarms: share of these that are said to differ, in places and in axes.
    """

    given: float
    held: dict[str, float]
    alarms: dict[str, float]


def one_process(case: dict, chosen: dict, seed: list[int]) -> OneProcess:
    """Compare runs of a model with a record, all drawn from one process of clustered events in several steps."""
    generator = np.random.default_rng(seed)
    held: dict[str, list[float]] = {"offset": [], "distance": [], "axes": []}
    alarms: dict[str, list[float]] = {"places": [], "axes": []}
    given = 0
    for index in range(chosen["catalogues"]):
        runs = [_run(generator, case, chosen) for _ in range(chosen["runs"])]
        record = _run(generator, case, chosen)
        errors = case.get("error", 0.0) * np.exp(case.get("scatter", 0.0) * generator.normal(size=len(record.days)))
        seen = record.location + generator.normal(size=record.location.shape) * errors[:, None] / np.sqrt(3)
        width = chosen["days"] / chosen["steps"]
        number = np.repeat(np.arange(len(runs)), [len(run.days) for run in runs])
        step = np.concatenate([run.days for run in runs]) // width
        clusters = cluster_labels(dated(record.days), seen, record.days // width, float(np.median(errors)))
        places = compare_locations(
            np.concatenate([run.location for run in runs]), seen, number, clusters,
            seed=index, location_error=errors, draws=1, resamplings=chosen["resamplings"], distances=np.array([20.0]),
            model_steps=step.astype(int), record_steps=(record.days // width).astype(int),
        )  # fmt: skip
        if places is None:
            continue
        given += 1
        model = AxesSample(np.concatenate([run.axes for run in runs]), np.zeros((len(number), 3)), number)
        axes = compare_axes(model, AxesSample(record.axes, seen, clusters), index, chosen["resamplings"])
        low, high = places.offset_interval.T
        held["offset"].append(np.mean((low <= 0.0) & (high >= 0.0)))
        held["distance"].append(places.offset_distance_interval[0] <= 0.0)
        held["axes"].append(axes["mean_angle_interval"][0, 0] <= 0.0)
        alarms["places"].append(places.energy_p_value <= chosen["level"])
        alarms["axes"].append(axes["mean_angle_p_value"][0] <= chosen["level"])
    shares = ({name: float(np.mean(values)) for name, values in of.items()} for of in (held, alarms))
    return OneProcess(given / chosen["catalogues"], *shares)


def _run(generator: np.random.Generator, case: dict, chosen: dict) -> Run:
    """One draw of triggered events (`branching`; 0: independent) or bursts. Axes differ by cluster and by event."""
    days, location, cluster = _clustered_events(generator, case, chosen["days"])
    of_cluster = generator.normal(size=(cluster.max(initial=-1) + 1, 3))[cluster]
    turns = Rotation.from_rotvec(np.radians(chosen["spread"]) * of_cluster)
    turns *= Rotation.from_rotvec(np.radians(chosen["spread"]) * generator.normal(size=(len(days), 3)))
    return Run(days, location, np.swapaxes(turns.as_matrix(), 1, 2))
