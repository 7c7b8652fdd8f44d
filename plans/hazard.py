"""Chance of large events near openings, and the forecast of steps that are ahead of the record.

The number of events from the floor on within a distance of an opening is Lambda on average. Its estimate is the mean of
the plan's own run and its members, times a factor (plans.record). The share S(m) of events as large as m follows from a
power law with an upper end, of which neither the slope nor the end is known. Events are independent, so the chance of
one at least is

  p = 1 - exp(-Lambda S(m)),

and that of a year at the same rate has Lambda times 365.25 days over the duration, of the steps from that on which
mines the opening. The given chance is the mean over draws of the factor and of the law; its interval contains the
chance of the runs too, by Jeffreys' prior: half an event more.
"""

import json
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import norm, t

from catalogs.compare.sum_measures import MIN_RUNS_FOR_VARIANCE
from catalogs.sources.completeness import MIN_EVENTS_ABOVE_CUT
from catalogs.sources.jackknife import INTERVAL_95
from catalogs.sources.sizes import LN10, MIN_EVENTS_FOR_B, log_potency
from catalogs.sources.truncated_law import TruncatedLaw, draw_law
from plans.record import LAW, Factors, RecordedNumbers, find_factors
from plans.runs import StepResult
from plans.settings import OutcomeSlice

DRAWS = 2000
SEED = 1  # One for all plans: they share the draws of what they have in common.
MAX_EXPECTED = 1e9  # Larger numbers, which few draws of rock may have a long tail of, are as good as this one.
DAYS_OF_YEAR = 365.25
# Least room for an upper end above the largest event seen, log10 m3, where all potency of the plan leaves less.
MIN_ROOM = 1.0
SIZE_CLASS = 0.5  # log10 P: an event that two runs share has a size in each, which is not quite the same.


def dispersion_index(number: NDArray) -> float:
    """Variance over mean of the number of events (run,), at least 1; 1 for fewer runs than a variance needs.

    Of few runs the variance is uncertain: it is widened so that a normal interval holds as often as one of Student's t.
    """
    if len(number) < MIN_RUNS_FOR_VARIANCE or not number.any():
        return 1.0
    stretch = t.ppf(INTERVAL_95[1], len(number) - 1) / norm.ppf(INTERVAL_95[1])
    return max(1.0, float(stretch**2 * number.var(ddof=1) / number.mean()))


def draw_expected(number: NDArray, runs: int, ratio: float, draws: int, generator: np.random.Generator) -> NDArray:
    """Draws (..., draw) of the expected number, given the sum (...,) over so many runs; ratio: variance over mean.

    The posterior of a Poisson number of equal events under Jeffreys' prior, a gamma distribution.
    """
    number = np.asarray(number, float)[..., None]
    return ratio / runs * generator.standard_gamma(number / ratio + 0.5, size=(*number.shape[:-1], draws))


def chance_of(expected: NDArray, share: NDArray) -> NDArray:
    """Chance of an event at least, from the expected number of all and the share that is large enough.

    >>> round(float(chance_of(np.array(2.0), np.array(0.1))), 4)  # 1 - exp(-0.2)
    0.1813
    """
    return -np.expm1(-expected * share)


def draw_numbers(expected: NDArray, ratio: float, generator: np.random.Generator) -> NDArray:
    """Numbers of events (draw,) about the expected ones: Poisson, or negative binomial with this variance over mean."""
    expected = np.minimum(expected, MAX_EXPECTED)
    if ratio > 1.0:
        expected = (ratio - 1.0) * generator.standard_gamma(np.maximum(expected, 1e-12) / (ratio - 1.0))
    return generator.poisson(expected)


def find_hazard(
    settings: OutcomeSlice,
    values: Mapping[str, NDArray],
    runs: Sequence[Sequence[StepResult]],
    ahead: NDArray,
    floor: float,
    recorded: RecordedNumbers | None,
) -> tuple[dict[str, NDArray], dict[str, Any]]:
    """Expected numbers, chances and forecasts of a plan: variables and attributes of plans.layout.

    values: variables of plans.layout with the results of the runs; runs: events from the floor on of the plan's own run
    and of its members; ahead (step,): steps that begin after the record.
    """
    generator = np.random.default_rng(SEED)
    law, law_attributes = _law(runs, values["whole_potency"], floor, recorded, generator)
    counted = ahead if ahead.any() else np.ones_like(ahead)
    factors = find_factors(settings, values, recorded, counted, DRAWS, generator)
    own = ~np.isnan(values["number"][:, 0, 0])
    within, number = values["number_within"][own], values["number"][own][:, :, -1]
    ratio = dispersion_index(number[:, counted].sum(axis=1))
    periods = [*np.eye(len(ahead), dtype=bool), counted]
    days, sizes = values["days"], values["size_log_potency"]
    share = law.share_above(sizes) if law else np.full((len(sizes), DRAWS), np.nan)
    is_open = _is_open(settings)
    rows = []
    for period in periods:
        factor = factors.of(period, number.sum(axis=0))
        open_days = is_open @ np.where(period, days, 0.0)
        years = DAYS_OF_YEAR / np.where(open_days > 0.0, open_days, np.inf)
        row = chances(within[:, period].sum(axis=1), ratio, factor, share, years, generator)
        for of_period in row.values():
            of_period[open_days == 0.0] = np.nan
        rows.append(row)
    hazard = {name: np.stack([row[name] for row in rows]) for name in rows[0]}
    hazard["period_days"] = np.array([days[period].sum() for period in periods])
    forecast, spread = _forecasts(number, ratio, factors, law, ahead, recorded, generator)
    attributes = {
        "contains": json.dumps([*factors.contains, *([LAW] if law else [])]),
        "lacks": json.dumps(list(factors.lacks)),
        "ratio_text": factors.text,
        "runs": int(own.sum()),
        "number_dispersion": spread,
    }
    return hazard | forecast, attributes | law_attributes


def _is_open(settings: OutcomeSlice) -> NDArray:
    """Openings mined by each step (opening + 1, step) bool; the last row: any of them."""
    names = ["", *(step.name for step in settings.steps)]  # an opening without a step is mined before the first
    mined = np.array([names.index(opening.step) - 1 for opening in settings.openings], int)
    is_mined = mined[:, None] <= np.arange(len(settings.steps))
    return np.vstack([is_mined, is_mined.any(axis=0)])


def chances(
    number: NDArray,
    ratio: float,
    factor: NDArray,
    share: NDArray,
    years: float | NDArray,
    generator: np.random.Generator,
) -> dict[str, NDArray]:
    """Expected numbers (opening, distance) and chances (opening, distance, size) of a period, with intervals.

    number (run, opening, distance); factor (draw,); share (size, draw); years: how often the days of the period on
    which an opening is mined fit into a year, () or (opening,).
    """
    runs, shape = len(number), number.shape[1:]
    pairs = np.stack(np.broadcast_arrays(number.sum(axis=0), np.asarray(years, float)[..., None]))
    # most openings have no event, or the same few
    (values, often), place = np.unique(pairs.reshape(2, -1), axis=1, return_inverse=True)
    often, place = often[:, None, None], place.reshape(shape)
    drawn = draw_expected(values, runs, ratio, len(factor), generator) * factor
    mean = values[:, None] / runs * factor
    values_of_period = {"expected": np.median(mean, axis=-1), "expected_interval": _interval(drawn)}
    for name, times in (("chance", 1.0), ("yearly_chance", often)):
        mean_chance = chance_of(times * mean[:, None], share).mean(axis=-1)
        interval = _interval(chance_of(times * drawn[:, None], share))
        # where few draws of the law reach a size, the mean of its chance may lie beyond nearly all of them
        values_of_period[name] = mean_chance
        values_of_period[f"{name}_interval"] = np.stack(
            [np.minimum(interval[..., 0], mean_chance), np.maximum(interval[..., 1], mean_chance)], axis=-1
        )
    values_of_period["yearly_number"] = (often * mean[:, None] * share).mean(axis=-1)
    return {name: one[place] for name, one in values_of_period.items()}


def _interval(draws: NDArray) -> NDArray:
    """95 % interval (..., 2) of draws (..., draw)."""
    return np.moveaxis(np.quantile(draws, INTERVAL_95, axis=-1), 0, -1)


def independent_share(runs: Sequence[Sequence[StepResult]]) -> float:
    """Number of independent sizes that each event of these runs counts as: 1 for runs that share nothing, one over
    their number if all are the same.

    Numbers by step and class of size vary between runs that share a part rho of their events by 1 - rho of their mean,
    and K such runs are worth K / (1 + (K - 1) rho) independent ones (Kish 1965).
    """
    classes = [np.floor(log_potency(step.potency) / SIZE_CLASS).astype(int) for run in runs for step in run]
    every = np.concatenate(classes)
    if len(runs) < 2 or not len(every):
        return 1.0
    counted = np.array([np.bincount(one - every.min(), minlength=np.ptp(every) + 1) for one in classes], float)
    counted = counted.reshape(len(runs), -1)
    shared = float(np.clip(1.0 - counted.var(axis=0, ddof=1).sum() / counted.mean(axis=0).sum(), 0.0, 1.0))
    return 1.0 / (1.0 + (len(runs) - 1) * shared)


def _law(
    runs: Sequence[Sequence[StepResult]],
    whole_potency: NDArray,
    floor: float,
    recorded: RecordedNumbers | None,
    generator: np.random.Generator,
) -> tuple[TruncatedLaw | None, dict[str, Any]]:
    """The law of sizes of the record where it has enough events, else of all runs, and its attributes; None without.

    whole_potency (run, step): that of all events of a step, m3.
    """
    modelled = log_potency(np.concatenate([step.potency for run in runs for step in run]))
    x, width, source = modelled, 0.0, "model"
    whole = float(np.nansum(whole_potency, axis=1).max())
    if recorded is not None:
        whole = max(whole, recorded.potency)
        if len(recorded.sizes) >= MIN_EVENTS_ABOVE_CUT:
            x, width, source = recorded.sizes, recorded.width, "record"
    if len(x) < MIN_EVENTS_FOR_B or not np.isfinite(floor):
        missing = {
            "law_b": np.nan,
            "law_bound": np.nan,
            "law_b_interval": [np.nan] * 2,
            "law_bound_interval": [np.nan] * 2,
        }
        return None, {"law_source": "none", "law_events": len(x), **missing}
    cap = max(np.log10(whole), float(max(x.max(), modelled.max(initial=-np.inf))) + MIN_ROOM)
    weight = independent_share(runs) if source == "model" else 1.0
    law = draw_law(x, floor, cap, DRAWS, generator, width, weight)
    return law, {
        "law_source": source,
        "law_events": len(x),
        "law_b": float(np.median(law.rate) / LN10),
        "law_b_interval": _interval(law.rate / LN10),
        "law_bound": float(np.median(law.bound)),
        "law_bound_interval": _interval(law.bound),
    }


def _forecasts(
    number: NDArray,
    ratio: float,
    factors: Factors,
    law: TruncatedLaw | None,
    ahead: NDArray,
    recorded: RecordedNumbers | None,
    generator: np.random.Generator,
) -> tuple[dict[str, NDArray], float]:
    """Draws of number, potency and largest event of each step that is ahead; and the dispersion index of the number."""
    shape = (len(ahead), DRAWS)
    forecast = {name: np.full(shape, np.nan) for name in ("number", "potency", "largest")}
    spread = recorded.dispersion_index if recorded is not None and recorded.recorded.any() else ratio
    for step in np.flatnonzero(ahead):
        expected = draw_expected(number[:, step].sum(), len(number), ratio, DRAWS, generator)
        expected = expected * factors.of(np.arange(len(ahead)) == step, number.sum(axis=0))
        drawn = draw_numbers(expected, max(1.0, spread), generator)
        forecast["number"][step] = drawn
        if law is not None:
            forecast["potency"][step], forecast["largest"][step] = law.sizes(drawn, generator)
    return {f"forecast_{name}": draws for name, draws in forecast.items()}, float(max(1.0, spread))
