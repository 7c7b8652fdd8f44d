"""A posterior by another sampler: an ensemble of Markov chains (Goodman and Weare 2010) on the same surrogate."""

import emcee
import numpy as np
from numpy.typing import NDArray

from calibration.fit import Fit

WALKERS = 32
STEPS, BURN_IN = 3000, 500  # Of each walker, and those that are left out at the start.


def chain_quantiles(fit: Fit, shares: NDArray, seed: int) -> tuple[NDArray, float]:
    """Quantiles (share, quantity) of the posterior in the unit cube, and the steps after which a chain has forgotten.

    That is the longest integrated autocorrelation time of the quantities.
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
