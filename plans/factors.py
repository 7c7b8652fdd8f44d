"""The factor that multiplies the numbers of a plan's runs, from the record where there is one.

**With a record.** N_j events are recorded in step j, and the runs make m_j on average. The expected number Lambda_j has

  ln Lambda_j = ln m_j + x_j + e_j,

where the level x_j contains what the cells and the model get wrong in all steps alike. The record may drift from the
model, so the level walks at random, by a standard deviation sigma in a month (local-level model: Durbin and Koopman
2012). The scatter e_j of single steps has the standard deviation tau, and the variance by which m_j is not known. N_j
is negative binomial with variance over mean kappa, since events come in clusters. kappa is known between bounds, with a
prior density of kappa^-2, since clusters that are joined make it too large. tau and sigma may be 0 or not, each with
the same prior probability (George and McCulloch 1993), and the steps decide. The posterior is exact on a grid of
levels: a filter forward in time, and draws backward. A step that is ahead continues the walk from the last recorded
step.

**Without a record** the factor is 1, and uncertain by what cells of twice the size change. Rock of the posterior
multiplies either.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import gammaln
from scipy.stats import norm

from catalogs.sources.jackknife import INTERVAL_95
from plans.layout import COARSE, DRAW, OWN
from plans.record import (
    CELL_CHANGE_FACTOR,
    CELLS,
    CHANCE,
    MIN_CELL_CHANGE,
    MIN_DRAWS,
    MONTH,
    RECORD,
    ROCK,
    RUNS,
    RecordedNumbers,
    middles,
)
from plans.settings import OutcomeSlice

SPIKE = 0.5  # Prior probability that steps do not scatter, and that the level does not drift.
STEP_SCATTER = 0.5  # Standard deviation of the half-normal prior of the scatter tau of single steps.
DRIFT = 0.25  # The same of the drift sigma in a month.
SCATTERS = np.array([0.0, 0.1, 0.2, 0.3, 0.45, 0.65, 0.9, 1.25])
DRIFTS = np.array([0.0, 0.05, 0.1, 0.2, 0.3, 0.45, 0.65])
DISPERSIONS = 5  # values of kappa between its bounds
LEVELS = 151
MARGIN = 6.0  # of the grid of levels beyond those of single steps, standard deviations of these
MIN_DISPERSION = 1.001  # the negative binomial distribution with this kappa is a Poisson distribution


@dataclass(frozen=True)
class Factors:
    """Draws of the factor: ln of it in each step of the plan (step, draw), and kappa of numbers about it (draw,).

    contains, lacks: those of CHANCE, CELLS, RECORD, ROCK and RUNS that it does; text: a sentence, empty without record.
    dispersion: None without a record.
    """

    log: NDArray
    dispersion: NDArray | None
    contains: tuple[str, ...]
    lacks: tuple[str, ...]
    text: str = ""

    def of(self, period: NDArray, number: NDArray) -> NDArray:
        """The factor (draw,) of a period (step,) bool; number (step,): events by which its steps are weighed."""
        weights = number[period] + 1e-9  # without an event all steps weigh alike
        return (weights / weights.sum()) @ np.exp(self.log[period])


@dataclass(frozen=True)
class Levels:
    """Draws from the posterior of the record: level x (step, draw), tau, sigma and kappa (draw,)."""

    level: NDArray
    scatter: NDArray
    drift: NDArray
    dispersion: NDArray


def find_factors(
    settings: OutcomeSlice,
    values: Mapping[str, NDArray],
    recorded: RecordedNumbers | None,
    counted: NDArray,
    draws: int,
    generator: np.random.Generator,
    model_dispersion: float = 1.0,
) -> Factors:
    """The factor of a plan; values: results of its runs (plans.layout); counted (step,): the steps that it is for.

    model_dispersion: variance over mean of the number of a step between runs of the model.
    """
    kinds = np.array([run.kind for run in settings.runs])
    shared = values["shared_number"][:, counted].sum(axis=1)
    log, dispersion = np.zeros((len(settings.steps), draws)), None
    contains, lacks, text = [CHANCE], [], ""
    if np.sum(~np.isnan(values["number"][:, 0, 0])) < 2:
        lacks.append(RUNS)
    if recorded is not None and recorded.modelled.any() and recorded.recorded.size:
        levels = draw_levels(recorded, draws, generator, model_dispersion)
        log, dispersion = steps_of_plan(levels, recorded.middles, middles(settings.steps), generator), levels.dispersion
        contains.append(RECORD)
        text = ratio_text(recorded)
    elif np.isfinite(shared[kinds == COARSE]).any():
        change = abs(np.log((shared[kinds == OWN][0] + 0.5) / (shared[kinds == COARSE][0] + 0.5)))
        half = max(CELL_CHANGE_FACTOR * change, np.log1p(MIN_CELL_CHANGE))
        log = log + half / norm.ppf(INTERVAL_95[1]) * generator.standard_normal(draws)
        contains.append(CELLS)
    else:
        lacks += [CELLS, RECORD]
    rock = _rock(shared[kinds == DRAW], shared[kinds == OWN][0], recorded if RECORD in contains else None)
    if rock is not None:
        shift, deviation, freedom = rock
        log = log + shift + deviation * generator.standard_t(freedom, draws)
        contains.append(ROCK)
    else:
        lacks.append(ROCK)
    return Factors(log, dispersion, tuple(contains), tuple(lacks), text)


def draw_levels(
    recorded: RecordedNumbers, draws: int, generator: np.random.Generator, model_dispersion: float = 1.0
) -> Levels:
    """Draws from the posterior of a record; see the head of this module.

    model_dispersion: variance over mean of the number of a step between runs of the model.
    """
    number, modelled = recorded.recorded, recorded.modelled.sum(axis=0) + 0.5
    mean = modelled / len(recorded.modelled)
    error = model_dispersion / modelled
    ratio = np.log((number + 0.5) / mean)
    margin = MARGIN * np.sqrt((recorded.dispersion_index / (number + 0.5) + error).clip(max=1.0).max())
    grid, spacing = np.linspace(ratio.min() - margin, ratio.max() + margin, LEVELS, retstep=True)
    least, most = (max(one, MIN_DISPERSION) for one in recorded.dispersion_bounds)
    kappa = np.geomspace(least, most, DISPERSIONS)
    walks = [np.sqrt(max(days, 0.0) / MONTH) for days in np.diff(recorded.middles)]
    # of tau, kappa, sigma and level; at the beginning Jeffreys' prior of a rate
    density = np.broadcast_to(np.exp(0.5 * (grid - grid[0])), (len(SCATTERS), DISPERSIONS, len(DRIFTS), LEVELS))
    log_evidence, filtered = np.zeros(density.shape[:3]), []
    for step in range(len(number)):
        if step:
            moves = [_kernel(grid, sigma * walks[step - 1]) for sigma in DRIFTS]
            density = np.stack([density[:, :, place] @ move for place, move in enumerate(moves)], axis=2)
        chance = _number_likelihood(number[step], mean[step] * np.exp(grid), kappa)
        deviation = np.sqrt(SCATTERS**2 + error[step] + (0.5 * spacing) ** 2)  # the grid resolves no less
        seen = np.stack([chance @ _kernel(grid, one) for one in deviation])
        density = density * seen[:, :, None]
        total = density.sum(axis=-1)
        is_possible = total > 0.0  # a jump between two steps may be too rare for a double without scatter and drift
        log_evidence = log_evidence + np.log(total, out=np.full(total.shape, -np.inf), where=is_possible)
        density = density / np.where(is_possible, total, 1.0)[..., None]
        filtered.append(density)
    prior = _spike_and_slab(SCATTERS, STEP_SCATTER)[:, None, None] * _spike_and_slab(DRIFTS, DRIFT)
    log_posterior = log_evidence + np.log(prior) - np.log(kappa)[:, None]
    posterior = np.exp(log_posterior - log_posterior.max()).ravel()
    place = np.unravel_index(generator.choice(posterior.size, draws, p=posterior / posterior.sum()), log_evidence.shape)
    sigma = DRIFTS[place[2]]
    level = np.empty((len(number), draws), int)
    level[-1] = _drawn(filtered[-1][place], generator)
    for step in range(len(number) - 2, -1, -1):
        width = np.maximum(sigma * walks[step], 1e-3 * spacing)[:, None]
        weight = filtered[step][place] * np.exp(-0.5 * ((grid - grid[level[step + 1]][:, None]) / width) ** 2)
        level[step] = _drawn(weight, generator)
    apart = spacing * generator.uniform(-0.5, 0.5, draws)
    return Levels(grid[level] + apart, SCATTERS[place[0]], sigma, kappa[place[1]])


def _spike_and_slab(values: NDArray, deviation: float) -> NDArray:
    """Prior probability of deviations (value,): of 0, the first, SPIKE, the others half-normal."""
    slab = np.exp(-0.5 * (values[1:] / deviation) ** 2) * np.gradient(values)[1:]
    return np.append(SPIKE, (1.0 - SPIKE) * slab / slab.sum())


def _kernel(grid: NDArray, deviation: float) -> NDArray:
    """Matrix (level, level) that spreads values on a grid by a normal distribution."""
    if deviation < 1e-3 * (grid[1] - grid[0]):
        return np.eye(len(grid))
    kernel = np.exp(-0.5 * ((grid[:, None] - grid) / deviation) ** 2)
    return kernel / kernel.sum(axis=0)


def _number_likelihood(number: float, expected: NDArray, kappa: NDArray) -> NDArray:
    """Probability (kappa, level) of a number, negative binomial about expected ones (level,), up to a factor."""
    excess = kappa[:, None] - 1.0
    shape = expected / excess
    log = gammaln(number + shape) - gammaln(shape) - gammaln(number + 1.0) - shape * np.log(kappa[:, None])
    log = log + number * np.log(excess / kappa[:, None])
    return np.exp(log)


def _drawn(weight: NDArray, generator: np.random.Generator) -> NDArray:
    """Index (draw,) of a level drawn by weights (draw, level)."""
    cumulative = np.cumsum(weight, axis=1)
    share = generator.random(len(weight)) * cumulative[:, -1]
    return np.minimum((cumulative < share[:, None]).sum(axis=1), weight.shape[1] - 1)


def steps_of_plan(levels: Levels, recorded: NDArray, steps: NDArray, generator: np.random.Generator) -> NDArray:
    """ln of the factor (step, draw) of a plan's steps; recorded, steps: middles of recorded steps and of these, days.

    A step after the last recorded one continues the walk; another has the level of the recorded step nearest in time.
    """
    log = np.empty((len(steps), levels.level.shape[1]))
    time, level = recorded[-1], levels.level[-1]
    for step in np.argsort(steps, kind="stable"):
        if steps[step] > time:
            walk = levels.drift * np.sqrt((steps[step] - time) / MONTH)
            time, level = steps[step], level + walk * generator.standard_normal(len(level))
            log[step] = level
        else:
            log[step] = levels.level[np.abs(recorded - steps[step]).argmin()]
    return log + levels.scatter * generator.standard_normal(log.shape)


def _rock(draws: NDArray, own: float, recorded: RecordedNumbers | None) -> tuple[float, float, int] | None:
    """Mean and standard deviation of ln of the number (draw,) over that of the mine's own rock, for one more draw, and
    degrees of freedom. With a record: those of this ratio over the ratio of the recorded steps. Numbers count from the
    shared floor on, and are NaN of draws in which rock found no equilibrium."""
    values = np.log((draws + 0.5) / (own + 0.5))
    if recorded is not None:
        if len(recorded.draws) != len(draws):
            return None
        # the record's ratio is that of the mine's own rock: other rock makes both, the plan and the recorded steps
        values -= np.log((recorded.draws.sum(axis=1) + 0.5) / (recorded.own + 0.5))
    values = values[np.isfinite(values)]
    if len(values) < MIN_DRAWS:
        return None
    return float(values.mean()), float(values.std(ddof=1) * np.sqrt(1.0 + 1.0 / len(values))), len(values) - 1


def ratio_text(recorded: RecordedNumbers) -> str:
    """State the numbers that the factor follows from, in a sentence."""
    steps = len(recorded.recorded)
    return (
        f"In {steps} recorded step{'s' * (steps != 1)} {recorded.recorded.sum():.0f} events are recorded and "
        f"{recorded.modelled.mean(axis=0).sum():.0f} modelled"
    )
