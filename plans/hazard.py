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

from catalogs.run_numbers import run_dispersion, widened
from catalogs.sources.jackknife import INTERVAL_95
from catalogs.sources.truncated_law import TruncatedLaw
from plans.differences import MIN_RUNS
from plans.factors import Factors, find_factors
from plans.record import LAW, RECORD, RecordedNumbers
from plans.runs import StepResult
from plans.settings import OutcomeSlice
from plans.size_law import size_law

DRAWS = 2000
SEED = 1  # One for all plans: they share the draws of what they have in common.
MAX_EXPECTED = 1e9  # Larger numbers, which few draws of rock may have a long tail of, are as good as this one.
DAYS_OF_YEAR = 365.25


def draw_expected(number: NDArray, runs: int, ratio: float, draws: int, generator: np.random.Generator) -> NDArray:
    """Draws (..., draw) of the expected number, given the sum (...,) over so many runs; ratio: variance over mean.

    The posterior of a Poisson number of equal events under Jeffreys' prior, a gamma distribution.
    """
    number = np.asarray(number, float)[..., None]
    return ratio / runs * generator.standard_gamma(number / ratio + 0.5, size=(*number.shape[:-1], draws))


def chance_of(expected: NDArray, share: NDArray, dispersion: float | NDArray = 1.0) -> NDArray:
    """Chance of an event at least, from the expected number of all and the share that is large enough.

    dispersion: variance over mean of the number of all; above 1 that number is negative binomial.

    >>> round(float(chance_of(np.array(2.0), np.array(0.1))), 4)  # 1 - exp(-0.2)
    0.1813
    """
    excess = np.maximum(np.asarray(dispersion) - 1.0, 1e-9)
    rate = np.log1p(excess * share) / excess
    return -np.expm1(-expected * rate)


def draw_numbers(expected: NDArray, ratio: float | NDArray, generator: np.random.Generator) -> NDArray:
    """Numbers of events (draw,) about the expected ones: Poisson, or negative binomial with this variance over mean."""
    expected = np.minimum(expected, MAX_EXPECTED)
    excess = np.maximum(ratio - 1.0, 1e-9)
    gamma = excess * generator.standard_gamma(np.maximum(expected, 1e-12) / excess)
    return generator.poisson(np.where(excess > 1e-6, gamma, expected))


def find_hazard(
    settings: OutcomeSlice,
    values: Mapping[str, NDArray],
    runs: Sequence[Sequence[StepResult]],
    ahead: NDArray,
    floor: float,
    recorded: RecordedNumbers | None,
    others: Sequence[Sequence[Sequence[StepResult]]] = (),
) -> tuple[dict[str, NDArray], dict[str, Any]]:
    """Expected numbers, chances and forecasts of a plan: variables and attributes of plans.layout.

    values: variables of plans.layout with the results of the runs; runs: events from the floor on of the plan's own run
    and of its members; ahead (step,): steps that begin after the record; others: as runs, of each other plan.
    """
    generator = np.random.default_rng(SEED)
    law, law_attributes = size_law([runs, *others], floor, recorded, DRAWS, generator)
    counted = ahead if ahead.any() else np.ones_like(ahead)
    own = ~np.isnan(values["number"][:, 0, 0])
    within, number = values["number_within"][own], values["number"][own][:, :, -1]
    count = len(number)
    of_step, of_plan = run_dispersion(number), run_dispersion(number[:, counted].sum(axis=1))
    factors = find_factors(settings, values, recorded, counted, DRAWS, generator, of_step)
    dispersion = of_plan if factors.dispersion is None else factors.dispersion
    ratio = widened(of_plan, count - 1) if count >= MIN_RUNS else 1.0
    periods = [*np.eye(len(ahead), dtype=bool), counted]
    days, sizes = values["days"], values["size_log_potency"]
    share = law.share_above(sizes) if law else np.full((len(sizes), DRAWS), np.nan)
    is_open = _is_open(settings)
    rows = []
    for period in periods:
        factor = factors.of(period, number.sum(axis=0))
        open_days = is_open @ np.where(period, days, 0.0)
        years = DAYS_OF_YEAR / np.where(open_days > 0.0, open_days, np.inf)
        row = chances(within[:, period].sum(axis=1), ratio, factor, share, years, generator, dispersion)
        for name, of_period in row.items():
            of_period[open_days == 0.0] = np.nan
            if count < MIN_RUNS and (name.startswith(("chance", "yearly_chance")) or name == "expected_interval"):
                of_period[:] = np.nan  # nothing says how another run would differ
        rows.append(row)
    hazard = {name: np.stack([row[name] for row in rows]) for name in rows[0]}
    hazard["period_days"] = np.array([days[period].sum() for period in periods])
    of_month = widened(of_step, (count - 1) * number.shape[1]) if count >= MIN_RUNS else 1.0
    forecast = _forecasts(number, of_month, factors, law, ahead, generator)
    attributes = {
        "contains": json.dumps([*factors.contains, *([LAW] if law else [])]),
        "lacks": json.dumps(list(factors.lacks)),
        "ratio_text": factors.text,
        "record_factor": _factor_interval(factors, counted, number.sum(axis=0)),
        "runs": count,
        "number_dispersion": float(np.median(factors.dispersion)) if factors.dispersion is not None else of_step,
    }
    return hazard | forecast, attributes | law_attributes


def _factor_interval(factors: Factors, period: NDArray, number: NDArray) -> list[float]:
    """Lower end, median and upper end of the factor of a period (step,) bool; NaN without a record.

    number (step,): events by which its steps are weighed.
    """
    if RECORD not in factors.contains:
        return [np.nan] * 3
    return np.quantile(factors.of(period, number), [INTERVAL_95[0], 0.5, INTERVAL_95[1]]).tolist()


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
    dispersion: float | NDArray = 1.0,
) -> dict[str, NDArray]:
    """Expected numbers (opening, distance) and chances (opening, distance, size) of a period, with intervals.

    number (run, opening, distance); factor (draw,); share (size, draw); years: how often the days of the period on
    which an opening is mined fit into a year, () or (opening,); ratio: variance over mean of the number between runs;
    dispersion, () or (draw,): of numbers of events in the rock.
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
        mean_chance = chance_of(times * mean[:, None], share, dispersion).mean(axis=-1)
        interval = _interval(chance_of(times * drawn[:, None], share, dispersion))
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


def _forecasts(
    number: NDArray,
    ratio: float,
    factors: Factors,
    law: TruncatedLaw | None,
    ahead: NDArray,
    generator: np.random.Generator,
) -> dict[str, NDArray]:
    """Draws of number, potency and largest event of each step that is ahead.

    number (run, step); ratio: variance over mean of the number of a step between runs.
    """
    shape = (len(ahead), DRAWS)
    forecast = {name: np.full(shape, np.nan) for name in ("number", "potency", "largest")}
    spread = ratio if factors.dispersion is None else factors.dispersion
    for step in np.flatnonzero(ahead):
        expected = draw_expected(number[:, step].sum(), len(number), ratio, DRAWS, generator)
        expected = expected * factors.of(np.arange(len(ahead)) == step, number.sum(axis=0))
        drawn = draw_numbers(expected, spread, generator)
        forecast["number"][step] = drawn
        if law is not None:
            forecast["potency"][step], forecast["largest"][step] = law.sizes(drawn, generator)
    return {f"forecast_{name}": draws for name, draws in forecast.items()}
