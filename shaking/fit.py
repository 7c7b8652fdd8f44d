"""Coefficients of a relation from recorded velocities, with their intervals.

  y_ij = a + b s_i - c log10(max(R_ij, nearest) + R0(s_i)) + e_i + d_ij,

y is log10 of the velocity of event i at sensor j. All velocities of one event share e_i (variance tau^2), and d_ij is
of each (variance phi^2). Ordinary least squares would take the velocities of one event as independent, and its
intervals of a and b would be too narrow. The ratio tau^2 / phi^2 is that of the restricted likelihood (Patterson and
Thompson 1971; of ground motion: Abrahamson and Youngs 1992), the coefficients are those of generalised least squares.
Intervals are of Student's t: for a and b with the degrees of freedom of the events, for c with those of the velocities
within events as far as distances differ within events. The scatter is sqrt(tau^2 + phi^2).
"""

import logging
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import scipy
from numpy.typing import NDArray

from catalogs.records.csv_table import read_table
from catalogs.records.settings import normalized
from catalogs.sources.jackknife import INTERVAL_95
from common.errors import InputError
from common.quantities import factor
from shaking.relations import GroundMotion, saturation
from shaking.settings import FittedRelation

MIN_EVENTS = 5
MIN_VELOCITIES = 8
LOG_RATIO_BOUNDS = (-9.0, 7.0)  # ln of tau^2 / phi^2; below, the events have no variance of their own
COEFFICIENTS = ("a", "b", "c")


@dataclass(frozen=True)
class Velocities:
    """Recorded velocities: number of the event (velocity,), size, distance (m), log10 of the velocity (m/s)."""

    event: NDArray
    size: NDArray
    distance: NDArray
    log_velocity: NDArray


@dataclass(frozen=True)
class Fit:
    """Coefficients (a, b, c), their covariance (3, 3) and 95 % intervals (3, 2), standard deviations between (tau) and
    within (phi) events, numbers of events and of velocities."""

    coefficients: NDArray
    covariance: NDArray
    intervals: NDArray
    between: float
    within: float
    events: int
    velocities: int

    @property
    def scatter(self) -> float:
        """Standard deviation of log10 of the velocity about the relation."""
        return float(np.hypot(self.between, self.within))

    @property
    def text(self) -> str:
        """The coefficients with their intervals, and the scatter, as a sentence."""
        parts = (
            f"{name} = {value:.3g} ({low:.3g} to {high:.3g})"
            for name, value, (low, high) in zip(COEFFICIENTS, self.coefficients, self.intervals, strict=True)
        )
        return (
            f"{self.velocities} velocities of {self.events} events give {', '.join(parts)}, with 95 % intervals, and a "
            f"scatter of {self.scatter:.2g} ({self.between:.2g} between events, {self.within:.2g} within)."
        )


def read_velocities(settings: FittedRelation) -> Velocities:
    """The velocities of a file. Raises InputError, one line: a column that is missing, a value that is none, a velocity
    that is not above 0, or an event of two sizes."""
    columns = settings.named_columns
    names = {"event": columns.event, "size": columns.size, "velocity": columns.velocity}
    if columns.distance is not None:
        names["distance"] = columns.distance
    else:
        for place in ("event_place", "station_place"):
            names |= {f"{place} {axis}": name for axis, name in zip("xyz", getattr(columns, place), strict=True)}
    keys = {key: normalized(name) for key, name in names.items()}
    numeric = [name for key, name in keys.items() if key != "event"]
    table = read_table(Path(settings.file), {name: key for key, name in keys.items()}, numeric, has_keys=False)
    table.decide_decimals(numeric)
    label = table.text(keys["event"])
    table.refuse((label == "").to_numpy(), keys["event"], "is empty", "name the event, or leave the row out")
    event = np.unique(label.to_numpy(str), return_inverse=True)[1].ravel()
    number = {key: table.numbers(keys[key]) for key in keys if key != "event"}
    for key, values in number.items():
        table.refuse(np.isnan(values), keys[key], "is empty", "give a number, or leave the row out")
    metres, speed = factor(settings.distance_unit, "m"), factor(settings.velocity_unit, "m/s")
    if columns.distance is not None:
        distance = number["distance"] * metres
        table.refuse(~(distance > 0.0), keys["distance"], "is no distance above 0", "correct it")
    else:
        apart = [number[f"event_place {axis}"] - number[f"station_place {axis}"] for axis in "xyz"]
        distance = np.linalg.norm(apart, axis=0) * metres
    velocity = number["velocity"] * speed
    table.refuse(~(velocity > 0.0), keys["velocity"], "is no velocity above 0", "correct it, or leave the row out")
    size = number["size"]
    first = np.unique(event, return_index=True)[1][event]
    table.refuse(size != size[first], keys["size"], "is not the size in the event's first row", "correct it")
    return Velocities(event, size, distance, np.log10(velocity))


def fit_relation(
    records: Velocities, nearest: float = 0.0, length: float = 0.0, exponent: float = 0.0, where: str = "velocities"
) -> Fit:
    """Coefficients from recorded velocities; nearest (m), length (m) and exponent of R0 are given.

    where: names the velocities in errors. Raises InputError for too few velocities, and for such that leave a
    coefficient open: of one size, or at one distance.
    """
    event, counts = np.unique(records.event, return_inverse=True, return_counts=True)[1:]
    total, number = len(event), len(counts)
    if total < MIN_VELOCITIES or number < MIN_EVENTS:
        raise InputError(
            f"{where}: {total} velocities of {number} events are too few to fit three coefficients; give "
            f"{MIN_VELOCITIES} or more of {MIN_EVENTS} events or more, or the coefficients"
        )
    form = GroundMotion("fitted", "", 0.0, 0.0, 0.0, 0.0, length=length, exponent=exponent, nearest=nearest)
    x, y = form.factors(records.size, records.distance), records.log_velocity
    for column, what, name in ((1, "sizes", "b"), (2, "distances", "c")):
        if np.ptp(x[:, column]) < 1e-9:
            raise InputError(
                f"{where}: all {what} are alike, which leaves {name} open; give velocities of several {what}"
            )
    middle = x[:, 1:].mean(axis=0)  # centred columns: those of large sizes are nearly parallel to the constant
    centred = np.column_stack([x[:, 0], x[:, 1:] - middle])
    if np.linalg.matrix_rank(centred, tol=1e-9 * np.linalg.norm(centred)) < 3:
        raise InputError(
            f"{where}: the distance follows from the size, which leaves b and c open; give more velocities"
        )
    solved = _Solver(centred, y, event, counts)
    ratio = 0.0
    if counts.max() > 1:  # with one velocity for each event the two variances cannot be told apart
        found = scipy.optimize.minimize_scalar(
            lambda log_ratio: solved.at(np.exp(log_ratio))[0], bounds=LOG_RATIO_BOUNDS, method="bounded"
        )
        ratio = float(np.exp(found.x)) if found.fun < solved.at(0.0)[0] else 0.0
    _, coefficients, covariance, within = solved.at(ratio)
    back = np.eye(3)
    back[0, 1:] = -middle
    coefficients, covariance = back @ coefficients, back @ covariance @ back.T
    of_events = max(number - 3, 1)
    freedom = [of_events, of_events, _freedom_of_distance(x[:, 2], event, within**2 / covariance[2, 2], of_events)]
    half = scipy.stats.t.ppf(INTERVAL_95[1], freedom) * np.sqrt(np.diag(covariance))
    intervals = np.column_stack([coefficients - half, coefficients + half])
    return Fit(coefficients, covariance, intervals, float(within * np.sqrt(ratio)), float(within), number, total)


def _freedom_of_distance(distance: NDArray, event: NDArray, known: float, of_events: int) -> float:
    """Degrees of freedom of the coefficient of the distance (Satterthwaite 1946).

    distance (velocity,): its column of the matrix; known: what all velocities tell of it, over what one within an
    event tells at a unit of the column. What differs between events alone has the degrees of freedom of the events.
    """
    counts = np.bincount(event)
    inside = distance - (np.bincount(event, distance) / counts)[event]
    share = float(np.clip(inside @ inside / known, 0.0, 1.0))
    of_velocities = max(len(event) - len(counts) - 1, 1)
    return 1.0 / (share**2 / of_velocities + (1.0 - share) ** 2 / of_events)


class _Solver:
    """Generalised least squares with a given ratio of the variances between and within events."""

    def __init__(self, x: NDArray, y: NDArray, event: NDArray, counts: NDArray):
        self.x, self.y, self.event, self.counts = x, y, event, counts

    def at(self, ratio: float) -> tuple[float, NDArray, NDArray, float]:
        """Minus twice the restricted log-likelihood (but for a constant), coefficients, covariance, and the standard
        deviation within events."""
        weight = ratio / (1.0 + self.counts * ratio)
        sums = np.array([np.bincount(self.event, column) for column in (*self.x.T, self.y)]).T
        inner = np.column_stack([self.x, self.y])
        product = inner.T @ inner - sums.T @ (weight[:, None] * sums)
        normal, right = product[:3, :3], product[:3, 3]
        coefficients = np.linalg.solve(normal, right)
        freedom = len(self.y) - 3
        variance = max(float(product[3, 3] - right @ coefficients) / freedom, 1e-30)
        likelihood = (
            freedom * np.log(variance)
            + np.sum(np.log1p(self.counts * ratio))
            + np.linalg.slogdet(normal)[1]
        )  # fmt: skip
        return float(likelihood), coefficients, variance * np.linalg.inv(normal), float(np.sqrt(variance))


def fitted_relation(settings: FittedRelation, largest: float) -> tuple[GroundMotion, Fit]:
    """The relation of a file of velocities, and its fit; largest: velocity that none exceeds, m/s.

    Raises InputError as read_velocities and fit_relation, and where the velocities grow with the distance or shrink
    with the size.
    """
    where = f"ground_motion.relation: {settings.file}"
    records, curve = read_velocities(settings), saturation(settings)
    fit = fit_relation(records, settings.nearest or 0.0, where=where, **curve)
    a, b, c = (float(value) for value in fit.coefficients)
    for value, what in ((b, "shrink with the size (b"), (c, "grow with the distance (c")):
        if not value > 0.0:
            raise InputError(f"{where}: the velocities {what} = {value:.2g}): check the columns and their units")
    logging.info("%s", fit.text)
    ends = [(float(values.min()), float(values.max())) for values in (records.size, records.distance)]
    relation = GroundMotion(
        "fitted", settings.size, a, b, c, fit.scatter, nearest=settings.nearest or 0.0, largest=largest,
        sizes=ends[0], distances=ends[1], covariance=fit.covariance, **curve,
    )  # fmt: skip
    return (relation if settings.scatter is None else replace(relation, scatter=settings.scatter)), fit
