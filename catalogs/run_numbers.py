"""How the number of events varies between runs that differ by chance only: a mine's own run and the members of its
ensemble."""

from numpy.typing import NDArray
from scipy.stats import norm, t

from catalogs.compare.sum_measures import MIN_RUNS_FOR_VARIANCE
from catalogs.sources.jackknife import INTERVAL_95


def run_dispersion(number: NDArray) -> float:
    """Variance of the number of events between runs (run,) or (run, step) over its mean, at least 1.

    Of several steps it is that of a step. 1 for fewer runs than a variance needs, or without an event.
    """
    if len(number) < MIN_RUNS_FOR_VARIANCE or not number.any():
        return 1.0
    return max(1.0, float(number.var(axis=0, ddof=1).sum() / number.mean(axis=0).sum()))


def widened(dispersion: float, freedom: int) -> float:
    """A dispersion of runs that is known to so many degrees of freedom, for a normal interval.

    It is raised so that the interval holds as often as one of Student's t; 1 stays 1 of runs that no variance is known
    of (freedom 0).
    """
    return dispersion * float(t.ppf(INTERVAL_95[1], freedom) / norm.ppf(INTERVAL_95[1])) ** 2 if freedom else dispersion
