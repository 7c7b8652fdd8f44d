"""Claims of a calibration compared with what is known: one row for each claim."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import emcee
import numpy as np
import xarray as xr
from numpy.typing import NDArray

from calibration.fit import INTERVAL_SHARE, SHARES, Fit, SelfTest, fit_likelihood
from calibration.likelihood import MAX_IMPLAUSIBILITY
from calibration.posterior import Posterior, shortest_intervals
from calibration.stages import Calibration
from calibration.tradeoffs import CONFINEMENTS, PRIOR_POINTS, best_known_strengths, strengths
from calibration.trials import (
    NUMBER,
    PLACES,
    POTENCY,
    SIZES,
    CellCorrection,
    Outputs,
    Places,
    counted_events,
    gains,
    outputs,
)
from seismic.catalog import extractions

COVERAGE = (0.80, 0.97)  # Of 90 % intervals.
MAX_WIDTH = 0.7  # Over that of the prior, in the coordinate that the record tells best.
MAX_CHAIN_DIFFERENCE = 0.05  # Of quantiles of two samplers, over the range.
WALKERS = 32
STEPS, BURN_IN = 3000, 500  # Of each walker, and those that are left out at the start.


@dataclass(frozen=True)
class Claim:
    """A row but for its terms: the claim, the record that it is about, the quantity, what is wanted and found."""

    claim: str
    record: str
    quantity: str
    wanted: str
    measured: str
    holds: bool


def self_test_claims(found: Calibration, tested: SelfTest, trials: NDArray) -> list[Claim]:
    """Each designed trial in turn as the record: coverage, and widths, of all quantities and of the strength."""
    low, high = COVERAGE
    parts = [("all quantities", tested.held, tested.width, True)]  # The last says whether the coverage is judged.
    for number, quantity in enumerate(found.settings.quantities):
        parts.append((quantity.title, tested.held[:, number], tested.width[:, number], False))
    parts += [(*strength, True) for strength in strength_coverage(found, tested, trials)]
    rows = []
    for name, held, _, is_judged in parts:
        share = float(held.mean())
        wanted = f"{100 * low:.0f} to {100 * high:.0f} %" if is_judged else ""
        holds = low <= share <= high or not is_judged
        rows.append(Claim("intervals hold it", "trials", name, wanted, f"{100 * share:.0f} %", holds))
    widths = {name: float(width.mean()) for name, _, width, _ in parts}
    best = min(list(widths)[1:], key=widths.__getitem__)
    for name, left in widths.items():
        wanted = f"at most {MAX_WIDTH:g}" if name == best else ""
        rows.append(Claim("width left", "trials", name, wanted, f"{left:.2f}", left <= MAX_WIDTH or name != best))
    return rows


def strength_coverage(found: Calibration, tested: SelfTest, trials: NDArray) -> list[tuple[str, NDArray, NDArray]]:
    """Name, coverage and width of intervals for each strength that the record tells best.

    Coverage (trial,) bool: the interval holds the true strength. Width (trial,): over that of the prior's 90 %.
    """
    quantities, result = found.settings.quantities, []
    true_at = true_points(found, trials)
    prior_at = np.random.default_rng(0).uniform(size=(PRIOR_POINTS, len(quantities)))
    for known in best_known_strengths(found.fit, quantities):
        at = int(np.argmin(np.abs(CONFINEMENTS - known.confinement)))
        true, prior, *sampled = (
            strengths(points, quantities, known.pair)[:, at]
            for points in (true_at, prior_at, *(posterior.points for posterior in tested.posteriors))
        )
        bounds = [
            posterior.intervals(INTERVAL_SHARE, strength[:, None])[:, 0]
            for posterior, strength in zip(tested.posteriors, sampled, strict=True)
        ]
        low, _, high = np.array(bounds).T
        start, end = shortest_intervals(prior[:, None], np.full(len(prior), 1.0 / len(prior)), INTERVAL_SHARE)[:, 0]
        width = (high - low) / (end - start)
        name = f"{known.material}: {known.state} strength under {known.confinement:.1f} MPa"
        result.append((name, (low <= true) & (true <= high), width))
    return result


def true_points(found: Calibration, trials: NDArray) -> NDArray:
    """Values (trial, quantity) that made these trials, in the unit cube."""
    return found.rows.points[[np.flatnonzero(found.rows.trials == trial)[0] for trial in trials]]


def twin_claims(found: Calibration, record: str, truth: Sequence[float], fit: Fit, wanted_flag: bool) -> list[Claim]:
    """Claims of a fit: that each interval holds its true value, and that the record is or is not called implausible.

    wanted_flag: the record should be called implausible; then what the intervals hold is reported only.
    """
    rows = []
    intervals = fit.posterior.intervals(INTERVAL_SHARE).T
    for quantity, true, ends in zip(found.settings.quantities, truth, intervals, strict=True):
        low, middle, high = map(quantity.value, ends)
        wanted = "" if wanted_flag else f"{quantity.value(true):.4g} inside"
        text = f"{low:.4g} to {high:.4g}, median {middle:.4g}"
        holds = bool(ends[0] <= true <= ends[-1]) or wanted_flag
        rows.append(Claim("truth inside", record, quantity.title, wanted, text, holds))
    return [*rows, flag_claim(record, fit.posterior, wanted_flag)]


def flag_claim(record: str, posterior: Posterior, wanted_flag: bool) -> Claim:
    """Claim that the smallest implausibility of a record is above its limit (wanted_flag) or below it."""
    flagged = bool(posterior.implausibility > MAX_IMPLAUSIBILITY)
    wanted = f"{'more' if wanted_flag else 'less'} than {MAX_IMPLAUSIBILITY:g}"
    found = f"{posterior.implausibility:.1f}"
    return Claim("smallest implausibility", record, "", wanted, found, flagged == wanted_flag)


def fit_to_catalogue(found: Calibration, catalogue: xr.Dataset) -> Fit:
    """Fit of a calibration's trials to a modelled catalogue on their own cells, as uncertain as the mine's record."""
    (events,) = extractions(catalogue)
    made = outputs([events], found.steps, found.cut, found.places)
    recorded = replace(
        found.fit.recorded,
        log_potency=made.by_term[POTENCY][0],
        number=np.round(np.exp(made.by_term[NUMBER][0])).astype(int),
        log_excess=float(made.by_term[SIZES][0, 0]),
    )
    by_term = dict(found.rows.outputs.by_term)
    if found.places is not None and PLACES in by_term:
        location, step = counted_events(events, found.steps, found.cut)
        places = Places.of_events(location, step, found.places, np.random.default_rng(found.settings.seed))
        by_term[PLACES] = gains(found.catalogues, found.steps, found.cut, places)
    trials = Outputs(by_term)
    correction = CellCorrection.none(trials)
    surrogate = found.fit.surrogate.of(found.rows.points, trials.all, found.rows.trials)
    likelihood = replace(found.fit.likelihood, recorded=recorded, correction=correction)
    return fit_likelihood(surrogate, likelihood, found.rows.points.shape[1], found.settings.seed)


def chain_claims(found: Calibration) -> list[Claim]:
    """Largest difference of the quantiles of both samplers, over the range, of each quantity."""
    chains, forgotten = chain_quantiles(found.fit, SHARES, found.settings.seed)
    difference = np.abs(chains - found.fit.posterior.quantiles(SHARES)).max(axis=0)
    rows = []
    for quantity, off in zip(found.settings.quantities, difference, strict=True):
        wanted, holds = f"at most {MAX_CHAIN_DIFFERENCE:g}", bool(off <= MAX_CHAIN_DIFFERENCE)
        rows.append(Claim("quantiles of another sampler", "record", quantity.title, wanted, f"{off:.3f}", holds))
    return [*rows, Claim("steps until a chain has forgotten", "record", "", "", f"{forgotten:.0f}", True)]


def chain_quantiles(fit: Fit, shares: NDArray, seed: int) -> tuple[NDArray, float]:
    """Quantiles (share, quantity) of a posterior in the unit cube, and the steps after which a chain has forgotten.

    The sampler is an ensemble of Markov chains (Goodman and Weare 2010). The steps are the longest integrated
    autocorrelation time of the quantities.
    """
    quantities = fit.posterior.points.shape[1]

    def log_probability(points: NDArray) -> NDArray:
        inside = ((points >= 0.0) & (points <= 1.0)).all(axis=1)
        return np.where(inside, fit.log_likelihood(np.clip(points, 0.0, 1.0)), -np.inf)

    sampler = emcee.EnsembleSampler(WALKERS, quantities, log_probability, vectorize=True)
    # The sampler takes no generator, only the state of numpy's older one.
    state = np.random.RandomState(seed).get_state()
    sampler.random_state = state
    sampler.run_mcmc(fit.posterior.draws(WALKERS, seed), STEPS, skip_initial_state_check=True)
    kept = sampler.get_chain(discard=BURN_IN, flat=True)
    forgotten = float(np.max(sampler.get_autocorr_time(tol=0)))
    return np.quantile(kept, shares, axis=0), forgotten
