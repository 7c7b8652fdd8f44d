"""Intervals, verdicts, chances and forecasts of mining plans, on runs and records drawn from known truths.

Runs make clusters of a geometric number of events, whose sizes follow a power law with or without an upper end. Plans
are compared by the functions that the page of plans uses.
"""

from dataclasses import dataclass

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from catalogs.settings import DatedStep
from plans.comparisons import Comparisons
from plans.differences import NUMBER, POTENCY, paired_interval
from plans.hazard import find_hazard
from plans.layout import ANY, FIELDS, PlanSummary
from plans.record import RecordedSteps
from plans.runs import StepResult
from plans.settings import HazardSettings, OutcomeSlice
from verification.answers.coverage.shares import MARGIN, Coverage, Intervals, alarm_row, cover
from verification.answers.statistics.samples import branching_events, burst_events, dated, simulated_sizes
from verification.rows import Row

DAYS = 30.0  # of a step
DISTANCE, CLASS = 20.0, "large"


def answer(settings: dict, allowed: dict) -> tuple[list[Coverage], list[Row]]:
    """Coverages of ratios, ratios of chances and forecasts; false alarms of equal plans, and calibration of chances."""
    chosen, seed = dict(settings["plans"]), settings["seed"]
    for part in ("ratios", "equal", "chances", "forecasts"):
        chosen[part] = [case | {"name": f"plans, {case['name']}"} for case in chosen[part]]
    coverages: list[Coverage] = []
    others: list[Row] = []
    for number, case in enumerate(chosen["ratios"]):
        coverages += cover(ratio_intervals, case, chosen, [seed, 10, number])
    for number, case in enumerate(chosen["equal"]):
        shares = equal_plans(case, chosen, np.random.default_rng([seed, 11, number]))
        others += [alarm_row(f"{case['name']}: {of}", chosen, one, allowed["alarms"]) for of, one in shares.items()]
    for number, case in enumerate(chosen["chances"]):
        others += calibration_rows(case, chosen, allowed, np.random.default_rng([seed, 12, number]))
    for number, case in enumerate(chosen["forecasts"]):
        widths: list[float] = []
        coverages += cover(forecast_intervals, case | {"widths": widths}, chosen, [seed, 13, number])
        if "widest" in case:
            others.append(width_row(case, widths, np.random.default_rng([seed, 14, number])))
    return coverages, others


def drawn_runs(generator: np.random.Generator, case: dict, events: float) -> list[list[StepResult]]:
    """Runs of a plan of one step, in which so many events are expected."""
    return [[_result(generator, case, _clustered_number(generator, case, events))] for _ in range(case["runs"])]


def _clustered_number(generator: np.random.Generator, case: dict, events: float) -> int:
    """Number of events, in clusters of a geometric number, `clusters` on average."""
    clusters = case.get("clusters", 1.0)
    return int(generator.geometric(1.0 / clusters, generator.poisson(events / clusters)).sum())


def _result(generator: np.random.Generator, case: dict, number: int) -> StepResult:
    potency = 10.0 ** simulated_sizes(generator, number, case["b"], case.get("span", np.inf))
    return StepResult(potency, np.zeros((number, 3)), 0.0, float(potency.sum()))


def plan_of(
    name: str, runs: list[list[StepResult]], others: list[list[StepResult]], size: float, recorded=None, ahead: int = 0
) -> PlanSummary:
    """A plan whose runs have these results by step, and its hazard of events of a class from log10 `size` (m3) on.

    others: runs of the plans that it is compared with; recorded: a record of all steps but the last `ahead` ones.
    """
    steps = dated_steps(len(runs[0]))
    kinds = ["own", *["member"] * (len(runs) - 1)]
    settings = OutcomeSlice.of(
        {
            "mine": "drawn", "plan": name, "steps": [step.given() for step in steps], "openings": [{"name": "drive"}],
            "shear_modulus": 1.0, "runs": [{"kind": kind, "events": []} for kind in kinds],
        }
    )  # fmt: skip
    number = np.array([[len(step.potency) for step in run] for run in runs], float)
    potency = np.array([[step.potency.sum() for step in run] for run in runs])
    values = {
        "number": _near_both(number), "potency": _near_both(potency), "number_within": _near_both(number)[..., None],
        "shared_number": number, "whole_potency": potency, "size_log_potency": np.array([size]),
        "days": np.full(len(steps), DAYS),
    }  # fmt: skip
    is_ahead = np.arange(len(steps)) >= len(steps) - ahead
    hazard, attributes = find_hazard(settings, values, runs, is_ahead, 0.0, recorded, [others] if others else [])
    names = [step.name for step in steps]
    names_of = {
        "run_kind": kinds, "made_by": [f"{name} {step}" for step in names], "step": names, "opening": ["drive", ANY],
        "size": [CLASS], "distance": [DISTANCE], "period": [*names, "all"], "interval": ["lower", "upper"],
    }  # fmt: skip
    dims = {field.name: field.dims for field in FIELDS}
    outcome = xr.Dataset({of: (dims[of], value) for of, value in (values | hazard).items()})
    outcome = outcome.assign({of: (dims[of], value) for of, value in names_of.items()})
    ahead_names = [step for step, one in zip(names, is_ahead, strict=True) if one]
    given = {"plan": name, "mine": "drawn", "floor": 0.0, "shared_floor": 0.0, "steps_ahead": str(ahead_names)}
    return PlanSummary(outcome.assign_attrs(attributes | given | {"steps_ahead": str(ahead_names).replace("'", '"')}))


def _near_both(values: NDArray) -> NDArray:
    """Values (run, step) near the only opening, and near any: (run, step, 2)."""
    return np.stack([values, values], axis=-1)


def dated_steps(count: int) -> tuple[DatedStep, ...]:
    """Consecutive steps of DAYS days each."""
    dates = [str(one)[:10] for one in dated(DAYS * np.arange(count + 1))]
    return tuple(DatedStep(name=f"step_{n}", start=dates[n], end=dates[n + 1]) for n in range(count))


def _two_plans(generator: np.random.Generator, case: dict) -> tuple[list[PlanSummary], list]:
    """Two plans, of which the second expects `ratio` times the events of the first."""
    runs = [drawn_runs(generator, case, case["events"] * times) for times in (1.0, case.get("ratio", 1.0))]
    pairs = (("first", runs[0], runs[1]), ("second", runs[1], runs[0]))
    return [plan_of(name, own, others, case["size"]) for name, own, others in pairs], runs


def ratio_intervals(case: dict, chosen: dict, generator: np.random.Generator, index: int) -> Intervals:
    """Intervals of the ratios of number, potency and yearly chance of two plans."""
    plans, _ = _two_plans(generator, case)
    comparisons = Comparisons(plans)
    intervals: Intervals = {}
    for name, quantity in (("ratio of numbers", NUMBER), ("ratio of potencies", POTENCY)):
        low, high = comparisons.whole(plans[1], quantity).interval
        intervals[name] = (low, high) if low < high else None, case["ratio"]
    low, high = comparisons.chance(plans[1], DISTANCE, CLASS).interval
    chance = [_true_chance(case, case["events"] * times * 365.25 / DAYS) for times in (case["ratio"], 1.0)]
    intervals["ratio of chances"] = (low, high) if low < high else None, chance[0] / chance[1]
    return intervals


def _share(case: dict) -> float:
    """Share of the events that are as large as the class."""
    tail = 10.0 ** (-case["b"] * case["span"]) if "span" in case else 0.0
    return (10.0 ** (-case["b"] * case["size"]) - tail) / (1.0 - tail)


def _true_chance(case: dict, events: float) -> float:
    """Chance of one event of the class at least, of so many expected events.

    A cluster of a geometric number with mean c has none with the probability p (1 - S) / (1 - (1 - p)(1 - S)), p = 1/c.
    """
    clusters, below = case.get("clusters", 1.0), 1.0 - _share(case)
    single = 1.0 / clusters
    none = single * below / (1.0 - (1.0 - single) * below)
    return float(-np.expm1(-events / clusters * (1.0 - none)))


def equal_plans(case: dict, chosen: dict, generator: np.random.Generator) -> dict[str, float]:
    """Shares of pairs of equal plans that are told apart.

    By a single ratio of each quantity, on the page as a whole, and by their class of likelihood.
    """
    likelihoods = HazardSettings(likelihoods=chosen["likelihoods"])
    alarms: dict[str, list[bool]] = {"number": [], "potency": [], "page": [], "class": []}
    for _ in range(chosen["catalogues"]):
        plans, runs = _two_plans(generator, case)
        comparisons = Comparisons(plans)
        for name, weigh in (("number", np.size), ("potency", np.sum)):
            first, second = (np.array([float(weigh(run[0].potency)) for run in of]) for of in runs)
            sizes = [
                one.sum() / max(sum(len(run[0].potency) for run in of), 1)
                for one, of in zip((second, first), runs[::-1], strict=True)
            ]
            low, high = paired_interval(second, first, sizes)
            alarms[name].append(bool(low > 1.0 or high < 1.0))
        alarms["page"].append(any(one.is_significant for one in comparisons.every()))
        classes = {likelihoods.likelihood(comparisons.class_chance(plan, DISTANCE, CLASS)) for plan in plans}
        alarms["class"].append(len(classes) > 1)
    return {name: float(np.mean(values)) for name, values in alarms.items()}


def calibration_rows(case: dict, chosen: dict, allowed: dict, generator: np.random.Generator) -> list[Row]:
    """Stated chance and share of outcomes, by class of the stated chance, of plans whose rate is drawn from a range."""
    stated, true = [], []
    for _ in range(chosen["plans"]):
        events = float(np.exp(generator.uniform(*np.log(case["events"]))))
        others = drawn_runs(generator, case, case["others"])
        plan = plan_of("plan", drawn_runs(generator, case, events), others, case["size"])
        stated.append(plan.chance(ANY, DISTANCE, CLASS, yearly=False)[0])
        true.append(_true_chance(case, events))
    known = np.isfinite(stated)
    said, happens = np.array(stated)[known], np.array(true)[known]
    rows = []
    for low, high in chosen["classes"]:
        inside = (said >= low) & (said < high)
        if inside.sum() < chosen["fewest"]:
            continue
        mean, share = said[inside].mean(), happens[inside].mean()
        off = float(abs(np.log(share / mean)))
        error = float(np.std(happens[inside] - said[inside])) / np.sqrt(inside.sum()) / share
        name = f"{case['name']}: chances stated as {100 * low:g} to {100 * high:g} % (error: ln of true over stated)"
        remark = f"{inside.sum()} plans of {len(said)}, Monte Carlo standard error of ln {error:.4f}"
        rows.append(Row(name, float(mean), float(share), off, allowed["calibration"] + MARGIN * error, remark))
    return rows


@dataclass(frozen=True)
class Truth:
    """A record of a truth, the model's runs, and the expected number of the step ahead."""

    recorded: RecordedSteps
    runs: list[list[StepResult]]
    ahead: float


def drawn_truth(generator: np.random.Generator, case: dict) -> Truth:
    """Runs and a record of `steps` steps, whose ratio to the model is `ratio` in the first step.

    ln of the ratio walks by `drift` a step, and scatters by `scatter`.
    """
    count = case["steps"]
    walk = np.log(case["ratio"]) + np.cumsum(case.get("drift", 0.0) * generator.normal(size=count + 1))
    expected = case["events"] * np.exp(walk + case.get("scatter", 0.0) * generator.normal(size=count + 1))
    months = [_month(generator, case, mean) for mean in expected[:-1]]
    time = np.concatenate([DAYS * place + month[0] for place, month in enumerate(months)])
    order = np.argsort(time)
    number = len(time)
    potency = 10.0 ** simulated_sizes(generator, number, case["b"], case.get("span", np.inf))
    record = xr.Dataset(
        {
            "time": ("event", dated(time[order])), "potency": ("event", potency),
            "location": (("event", "xyz"), np.concatenate([month[1] for month in months])[order]),
            "resolved": ("event", np.ones(number, np.int8)), "location_error": ("event", np.ones(number)),
        }
    )  # fmt: skip
    runs = [
        [_result(generator, case, generator.poisson(case["events"])) for _ in expected] for _ in range(case["runs"])
    ]
    kinds = ["own", *["member"] * (case["runs"] - 1)]
    steps, until = dated_steps(count), dated(np.array([DAYS * count]))[0]
    recorded = RecordedSteps(record, steps, until, 0.0, [run[:-1] for run in runs], kinds)
    return Truth(recorded, runs, float(expected[-1]))


def _month(generator: np.random.Generator, case: dict, expected: float) -> tuple[NDArray, NDArray]:
    """Times (event,) in days and places (event, 3) m of a month: independent, in bursts of `each`, or triggered."""
    if "each" in case:
        return burst_events(generator, DAYS, expected / case["each"], case["each"])[:2]
    return branching_events(generator, DAYS, expected, case.get("branching", 0.0))[:2]


def forecast_intervals(case: dict, chosen: dict, generator: np.random.Generator, index: int) -> Intervals:
    """Ranges of number, potency and largest event of the step ahead, and what it brings. Appends to case["widths"]."""
    truth = drawn_truth(generator, case)
    plan = plan_of("plan", truth.runs, [], 1.0, truth.recorded.numbers(0.0, 0.0), ahead=1)
    number = len(_month(generator, case, truth.ahead)[0])
    size = simulated_sizes(generator, number, case["b"], case.get("span", np.inf))
    outcomes = {
        "number": float(number),
        "potency": float(np.sum(10.0**size)),
        "largest": float(size.max(initial=-np.inf)),
    }
    intervals: Intervals = {}
    for name, value in outcomes.items():
        draws = plan.outcome[f"forecast_{name}"].values[-1]
        low, high = np.quantile(draws, [0.025, 0.975], method="nearest")
        intervals[f"forecast {name}"] = ((low, high) if np.isfinite(draws).any() else None), value
        if name == "number":
            case["widths"].append(float(high - low))
    return intervals


def width_row(case: dict, widths: list[float], generator: np.random.Generator) -> Row:
    """Row of the median width of the range of numbers over that of the truth's own law, of a constant ratio."""
    drawn = [len(_month(generator, case, case["events"] * case["ratio"])[0]) for _ in range(4000)]
    ideal = float(np.subtract(*np.quantile(drawn, [0.975, 0.025])))
    ratio = float(np.median(widths)) / ideal
    error = 1.25 * float(np.std(widths)) / np.sqrt(len(widths)) / ideal
    name = f"forecast number, {case['name']}: width over that of the truth's law (error: above {case['widest']:g})"
    return Row(
        name,
        1.0,
        ratio,
        max(0.0, ratio - case["widest"]),
        MARGIN * error,
        f"{len(widths)} records, Monte Carlo standard error {error:.4f}",
    )
