"""Declustered number of a record: events that no earlier event is the likely parent of.

Nearest neighbours in time, space and size (Zaliapin, Gabrielov, Keilis-Borok and Wong 2008, Phys. Rev. Lett. 101,
018501; Zaliapin and Ben-Zion 2013, J. Geophys. Res. 118, 2847). The proximity of event j to an earlier event i is

    eta_ij = t_ij r_ij^d 10^(-b m_i),

with the time t between them, years, the distance r, km, the magnitude m of the earlier one, b = 1 and d = 1.6, as these
papers have them. The parent of an event is the one with the smallest eta. In clusters eta is much smaller than among
events that know nothing of each other: where the logarithms form two groups, a normal mixture of two finds the limit
between them. Events beyond it, and the first one, are the declustered ones.

A modelled catalogue has no times within a step, so it has no such number.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

B_VALUE, DIMENSION = 1.0, 1.6  # of magnitudes; fractal dimension of epicentres
MIN_DISTANCE = 1e-4  # km; events that are nearer count as so far apart, as no location is better.
MIN_TIME = 1e-9  # years
MIN_EVENTS = 50  # Fewer have no two groups to tell apart.
PAIRS_AT_ONCE = 1 << 22
SECONDS_PER_YEAR = 365.25 * 86400.0
# Differences of the means of both groups over the sum of their standard deviations: nearer ones are one group.
MIN_SEPARATION = 1.0


@dataclass(frozen=True)
class Declustered:
    """Number of events used, of those of them that are declustered, limit of log10 eta (NaN where there are no two
    groups), and whether each event is declustered (event,) bool; all are where there are no two groups."""

    count: int
    declustered: int
    limit: float
    independent: NDArray


def nearest_proximity(time: NDArray, location: NDArray, magnitude: NDArray) -> NDArray:
    """log10 of the smallest eta (event,) of each event to an earlier one; infinite for the first.

    time (event,) years, ascending; location (event, 3) km; magnitude (event,).
    """
    found = np.full(len(time), np.inf)
    rows = max(1, PAIRS_AT_ONCE // max(len(time), 1))
    for start in range(1, len(time), rows):
        stop = min(start + rows, len(time))
        own = slice(start, stop)
        distance = np.sqrt(((location[own, None] - location[None, :stop]) ** 2).sum(axis=2))
        since = time[own, None] - time[None, :stop]
        eta = np.log10(np.maximum(since, MIN_TIME)) + DIMENSION * np.log10(np.maximum(distance, MIN_DISTANCE))
        eta = eta - B_VALUE * magnitude[None, :stop]
        eta[np.arange(stop) >= np.arange(start, stop)[:, None]] = np.inf  # itself and later ones
        found[own] = eta.min(axis=1)
    return found


def decluster(time: NDArray, location: NDArray, magnitude: NDArray) -> Declustered:
    """Declustered events of a record.

    time (event,) datetime64; location (event, 3) m; magnitude (event,). Events of which one is not known are left out
    and are not declustered.
    """
    known = ~np.isnat(time) & np.isfinite(location).all(axis=1) & np.isfinite(magnitude)
    rows = np.flatnonzero(known)
    rows = rows[np.argsort(time[rows], kind="stable")]
    independent = np.zeros(len(time), bool)
    independent[rows] = True
    if len(rows) < MIN_EVENTS:
        return Declustered(len(rows), len(rows), np.nan, independent)
    years = (time[rows] - time[rows[0]]) / np.timedelta64(1, "s") / SECONDS_PER_YEAR
    eta = nearest_proximity(years, location[rows] / 1e3, magnitude[rows])
    limit = limit_between(eta[np.isfinite(eta)])
    if np.isfinite(limit):
        independent[rows] = eta >= limit
    return Declustered(len(rows), int(independent.sum()), limit, independent)


def limit_between(values: NDArray) -> float:
    """The value at which both groups of a normal mixture are as likely; NaN where one group is as good (BIC) or where
    the groups overlap so much that they cannot be told apart."""
    from sklearn.mixture import GaussianMixture  # slow to import

    column = values[:, None]
    one, two = (GaussianMixture(number, random_state=0, n_init=3).fit(column) for number in (1, 2))
    mean, spread = two.means_[:, 0], np.sqrt(two.covariances_[:, 0, 0])
    if two.bic(column) >= one.bic(column) or abs(mean[1] - mean[0]) < MIN_SEPARATION * spread.sum():
        return np.nan
    low, high = np.argsort(mean)
    between = np.linspace(mean[low], mean[high], 1001)
    likelier = two.predict_proba(between[:, None])[:, high] >= 0.5
    return float(between[likelier.argmax()])
