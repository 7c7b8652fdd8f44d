"""By what the numbers of a plan's runs are multiplied, with its uncertainty: the record's ratio, or cells and rock.

With a record the factor is the number recorded over that modelled in the recorded steps. It contains what the cells and
the model get wrong in all steps alike. Steps differ, too: ln of the ratio scatters about its mean mu with a standard
deviation tau, whose prior is half-normal with STEP_SCATTER. A step that is ahead has its own scatter. Without a record
the factor is 1, and uncertain by what cells of twice the size change. Rock of the posterior multiplies either.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.special import logsumexp
from scipy.stats import norm

from catalogs.grid_convergence import MIN_ERROR_SHARE, SAFETY_FACTOR
from catalogs.jackknife import INTERVAL_95
from plans.layout import COARSE, DRAW, OWN
from plans.record import RecordedNumbers
from plans.settings import OutcomeSlice

STEP_SCATTER = 0.5  # Standard deviation of the half-normal prior of the scatter of ln ratio between steps.
SCATTERS = np.linspace(0.0, 4.0 * STEP_SCATTER, 201)
MIN_DRAWS = 3  # Draws of the rock that a spread needs.
CHANCE, CELLS, RECORD, ROCK, RUNS, LAW = "chance", "cells", "record", "rock", "runs", "law"


@dataclass(frozen=True)
class Factors:
    """Draws of the factor: ln of the part that all steps share (draw,) and of that of each step (step, draw).

    contains, lacks: which of CHANCE, CELLS, RECORD, ROCK and RUNS; text: a sentence, empty without a record.
    """

    common: NDArray
    own: NDArray
    contains: tuple[str, ...]
    lacks: tuple[str, ...]
    text: str = ""

    def of(self, period: NDArray, number: NDArray) -> NDArray:
        """The factor (draw,) of a period (step,) bool; number (step,): events by which its steps are weighed."""
        weights = number[period] + 1e-9  # without an event all steps weigh alike
        return np.exp(self.common) * ((weights / weights.sum()) @ np.exp(self.own[period]))


def find_factors(
    settings: OutcomeSlice,
    data: dict[str, Any],
    recorded: RecordedNumbers | None,
    counted: NDArray,
    draws: int,
    generator: np.random.Generator,
) -> Factors:
    """The factor of a plan; data: what its runs made (plans.layout); counted (step,): the steps that it is for."""
    kinds = np.array([run.kind for run in settings.runs])
    shared = data["shared_number"][1][:, counted].sum(axis=1)
    steps = len(settings.steps)
    common, own = np.zeros(draws), np.zeros((steps, draws))
    contains, lacks, text = [CHANCE], [], ""
    if np.sum(~np.isnan(data["number"][1][:, 0, 0])) < 2:
        lacks.append(RUNS)
    if recorded is not None and recorded.modelled.any() and recorded.recorded.size:
        ratio = step_ratios(recorded)
        common, tau = draw_ratio(*ratio, draws, generator)
        own = tau * generator.standard_normal((steps, draws))
        contains.append(RECORD)
        text = ratio_text(recorded, common)
    elif (kinds == COARSE).any():
        change = abs(np.log((shared[kinds == OWN][0] + 0.5) / (shared[kinds == COARSE][0] + 0.5)))
        half = max(SAFETY_FACTOR * change, np.log1p(MIN_ERROR_SHARE))
        common = half / norm.ppf(INTERVAL_95[1]) * generator.standard_normal(draws)
        contains.append(CELLS)
    else:
        lacks += [CELLS, RECORD]
    rock = _rock(shared[kinds == DRAW], shared[kinds == OWN][0], recorded if RECORD in contains else None)
    if rock is not None:
        shift, deviation, freedom = rock
        common = common + shift + deviation * generator.standard_t(freedom, draws)
        contains.append(ROCK)
    else:
        lacks.append(ROCK)
    return Factors(common, own, tuple(contains), tuple(lacks), text)


def _rock(draws: NDArray, own: float, recorded: RecordedNumbers | None) -> tuple[float, float, int] | None:
    """Mean and standard deviation of ln of the number (draw,) over that of the mine's own rock, for one more draw, and
    degrees of freedom. With a record: of that ratio over the same of the recorded steps. Numbers are from the shared
    floor on."""
    if len(draws) < MIN_DRAWS:
        return None
    values = np.log((draws + 0.5) / (own + 0.5))
    if recorded is not None:
        if len(recorded.draws) != len(draws):
            return None
        # the record's ratio is that of the mine's own rock: other rock makes both, the plan and the recorded steps
        values -= np.log((recorded.draws.sum(axis=1) + 0.5) / (recorded.own + 0.5))
    return float(values.mean()), float(values.std(ddof=1) * np.sqrt(1.0 + 1.0 / len(draws))), len(draws) - 1


def step_ratios(recorded: RecordedNumbers) -> tuple[NDArray, NDArray]:
    """ln of recorded over modelled number of each step (step,), and its variance by chance; half an event more each.

    The variance is that of the number which the ratio of all steps makes expected: by its own number, a step with few
    events would count less because they are few.
    """
    number, modelled = recorded.recorded + 0.5, recorded.modelled.sum(axis=0) + 0.5
    mean = modelled / len(recorded.modelled)
    expected = mean * number.sum() / mean.sum()
    return np.log(number / mean), recorded.clustering / expected + 1.0 / modelled


def draw_ratio(
    value: NDArray, variance: NDArray, draws: int, generator: np.random.Generator
) -> tuple[NDArray, NDArray]:
    """Draws of the mean mu (draw,) and scatter tau (draw,) of values (step,) that have these variances by chance.

    Value_j is normal about mu with the variance tau^2 + v_j. The prior of mu is uniform, that of tau half-normal.
    """
    total = SCATTERS[:, None] ** 2 + variance
    weight = 1.0 / total
    mean = (weight * value).sum(axis=1) / weight.sum(axis=1)
    log_posterior = -0.5 * (
        np.log(total).sum(axis=1)
        + np.log(weight.sum(axis=1))
        + (weight * (value - mean[:, None]) ** 2).sum(axis=1)
        + (SCATTERS / STEP_SCATTER) ** 2
    )
    chosen = generator.choice(len(SCATTERS), draws, p=np.exp(log_posterior - logsumexp(log_posterior)))
    spread = np.sqrt(1.0 / weight.sum(axis=1))[chosen]
    return mean[chosen] + spread * generator.standard_normal(draws), SCATTERS[chosen]


def ratio_text(recorded: RecordedNumbers, common: NDArray) -> str:
    """How many events are recorded for each modelled one, in a sentence."""
    low, middle, high = np.exp(np.quantile(common, [INTERVAL_95[0], 0.5, INTERVAL_95[1]]))
    steps = len(recorded.recorded)
    return (
        f"In {steps} recorded step{'s' * (steps != 1)} {recorded.recorded.sum():.0f} events are recorded and "
        f"{recorded.modelled.mean(axis=0).sum():.0f} modelled. Numbers of the plans are multiplied by {middle:.2g} "
        f"({low:.2g} to {high:.2g})"
    )
