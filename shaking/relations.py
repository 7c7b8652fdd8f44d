"""Peak ground velocity of an event, by its size and distance: the relation of a mine file as one form.

  log10 v = a + b s - c log10(max(R, nearest) + R0),   R0 = length 10^(exponent s),

v in m/s, R in m. s is the moment magnitude, log10 of the potency in m3, or log10 of the moment in N m. The velocity
scatters about it: log10 v is normal with the standard deviation `scatter`, independently from event to event.
Coefficients that were fitted are known to their covariance, which widens the scatter: the chance that one event exceeds
a velocity is then that of the normal distribution with both variances, exactly. No event exceeds `largest`.

R is the distance from the event's centroid. The relations were found from distances of hypocentres, so the extent of a
source is in R0, not in R.
"""

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import ndtr

from common.errors import InputError
from shaking.settings import FittedRelation, GroundMotionSettings, McGarrRelation, MendeckiRelation, SiteRelation

DYN_CM = 7.0  # log10 of the dyn cm in 1 N m
SQUARE_CM = 4.0  # log10 of the cm2 in 1 m2
MCGARR_A, MCGARR_B = -4.68, 0.49  # log10(R v) in cm2/s = A + B log10 M0, M0 in dyn cm
MCGARR_NEAREST, MCGARR_FARTHEST = 50.0, 1600.0  # m
MCGARR_MAGNITUDES = (-0.76, 1.45)  # local magnitudes ML
MCGARR_MOMENT = (17.7, 1.2)  # log10 M0 (dyn cm) = 17.7 + 1.2 ML (Spottiswoode and McGarr 1975)
SOURCE_VELOCITY = (
    0.63  # velocity at the source over S-wave velocity times strain drop (Mendecki 2019, after Brune 1970)
)
SIZE_NAMES = {"mw": "Mw", "log_potency": "log10 P (P in m3)", "log_moment": "log10 M0 (M0 in N m)"}
SOURCES = {
    "site": "coefficients of the mine file",
    "fitted": "coefficients fitted to recorded velocities",
    "mcgarr_1981": (
        "McGarr, A., Green, R. W. E., Spottiswoode, S. M. (1981). Strong ground motion of mine tremors: some "
        "implications for near-source ground motion parameters. Bulletin of the Seismological Society of America "
        "71(1), 295-319"
    ),
    "mendecki_2019": (
        "Mendecki, A. J. (2019). Simple GMPE for underground mines. Acta Geophysica 67(3), 837-847. "
        "doi:10.1007/s11600-019-00289-z"
    ),
}


@dataclass(frozen=True)
class GroundMotion:
    """A relation in the form of this module.

    kind: what its size is; length (m) and exponent of R0; nearest, m; largest, m/s; sizes and distances: smallest and
    largest that it was found from, None where not stated; covariance (3, 3) of a, b, c, None where they are given.
    """

    name: str
    kind: str
    a: float
    b: float
    c: float
    scatter: float
    length: float = 0.0
    exponent: float = 0.0
    nearest: float = 0.0
    largest: float = math.inf
    sizes: tuple[float, float] | None = None
    distances: tuple[float, float] | None = None
    covariance: NDArray | None = field(default=None, compare=False)

    @property
    def log_largest(self) -> float:
        """log10 of the largest velocity, m/s."""
        return math.log10(self.largest) if math.isfinite(self.largest) else math.inf

    @property
    def text(self) -> str:
        """The relation as a line: its equation with numbers, and what it is limited to."""
        saturation = ""
        if self.length:
            grown = f" · 10^({self.exponent:.3g} s)" if self.exponent else ""
            saturation = f" + {self.length:.3g} m{grown}"
        text = (
            f"log10 v = {self.a:.3g} + {self.b:.3g} s - {self.c:.3g} log10(R{saturation}), v in m/s, R in m, "
            f"s = {SIZE_NAMES[self.kind]}; standard deviation {self.scatter:.3g}"
        )
        if self.nearest:
            text += f"; R is {self.nearest:g} m at least"
        if np.isfinite(self.largest):
            text += f"; v is {self.largest:g} m/s at most"
        return text

    def factors(self, size: ArrayLike, distance: ArrayLike) -> NDArray:
        """What a, b and c are multiplied with, (..., 3), for sizes and distances (m) that broadcast."""
        size, distance = np.broadcast_arrays(np.asarray(size, float), np.asarray(distance, float))
        saturation = self.length * 10.0 ** (self.exponent * size)
        return np.stack([np.ones_like(size), size, -np.log10(np.maximum(distance, self.nearest) + saturation)], axis=-1)

    def log_median(self, size: ArrayLike, distance: ArrayLike) -> NDArray:
        """log10 of the median velocity, m/s, for sizes and distances (m) that broadcast."""
        return self.factors(size, distance) @ np.array([self.a, self.b, self.c])

    def deviation(self, size: ArrayLike, distance: ArrayLike) -> NDArray:
        """Standard deviation of log10 of the velocity, that of the coefficients included."""
        factors = self.factors(size, distance)
        if self.covariance is None:
            return np.full(factors.shape[:-1], self.scatter)
        return np.sqrt(self.scatter**2 + np.einsum("...i,ij,...j", factors, self.covariance, factors))

    def is_outside(self, size: NDArray, distance: NDArray) -> NDArray:
        """Events (event,) bool of a size or at a distance (m) that the relation was not found from."""
        outside = np.zeros(np.broadcast_shapes(np.shape(size), np.shape(distance)), bool)
        for values, ends in ((size, self.sizes), (distance, self.distances)):
            if ends is not None:
                outside |= (values < ends[0]) | (values > ends[1])
        return outside

    def check_range(self, size: NDArray) -> None:
        """Raise InputError where none of the sizes (event,) is one that the relation was found from."""
        if self.sizes is None or not len(size):
            return
        low, high = self.sizes
        least, most = float(size.min()), float(size.max())
        if most < low or least > high:
            raise InputError(
                f"ground_motion.relation: {self.name} was found from {SIZE_NAMES[self.kind]} of {low:.2f} to "
                f"{high:.2f}, and all events have {least:.2f} to {most:.2f}; choose another relation"
            )


def exceedance(log_velocity: ArrayLike, log_median: NDArray, deviation: NDArray, log_largest: float) -> NDArray:
    """Chance that an event exceeds a velocity, log10 m/s; arguments broadcast.

    >>> exceedance(-1.0, np.array([-1.0, -0.7]), np.array([0.3, 0.0]), np.inf)
    array([0.5, 1. ])
    """
    excess = log_median - np.asarray(log_velocity, float)
    deviation = np.broadcast_to(deviation, excess.shape)
    known = deviation > 0.0
    chance = np.where(known, ndtr(np.divide(excess, deviation, out=np.zeros_like(excess), where=known)), excess > 0.0)
    return np.where(np.asarray(log_velocity, float) < log_largest, chance, 0.0)


def sizes_of(kind: str, potency: NDArray, moment: NDArray) -> NDArray:
    """Sizes of events of a kind, from potency (event,) m3 and scalar moment (event,) N m."""
    if kind == "log_potency":
        return np.log10(potency)
    log_moment = np.log10(moment)
    return log_moment if kind == "log_moment" else 2.0 / 3.0 * (log_moment - 9.1)


def relation_of(settings: GroundMotionSettings, fitted: "GroundMotion | None" = None) -> GroundMotion:
    """The relation of a mine file; `fitted`: that of its recorded velocities, which `shaking.fit` makes."""
    given: Any = settings.relation
    largest = settings.largest or math.inf
    common: dict[str, Any] = {"name": given.name, "scatter": given.scatter, "largest": largest}
    if isinstance(given, SiteRelation):
        return GroundMotion(
            kind=given.size, a=given.a, b=given.b, c=given.c, nearest=given.nearest or 0.0,
            sizes=given.sizes, distances=given.distances,  # type: ignore[arg-type]
            **saturation(given), **common,
        )  # fmt: skip
    if isinstance(given, McGarrRelation):
        intercept, slope = MCGARR_MOMENT
        least, most = (intercept + slope * magnitude - DYN_CM for magnitude in MCGARR_MAGNITUDES)
        return GroundMotion(
            kind="log_moment", a=MCGARR_A + MCGARR_B * DYN_CM - SQUARE_CM, b=MCGARR_B, c=1.0,
            nearest=given.nearest or MCGARR_NEAREST, sizes=(least, most),
            distances=(MCGARR_NEAREST, MCGARR_FARTHEST), **common,
        )  # fmt: skip
    if isinstance(given, MendeckiRelation):
        at_source = SOURCE_VELOCITY * given.s_wave_velocity * given.strain_drop
        return GroundMotion(
            kind="log_potency", a=math.log10(at_source) + given.c_r * math.log10(given.c_l), b=given.c_r / 3.0,
            c=given.c_r, length=given.c_l, exponent=1.0 / 3.0, nearest=given.nearest or 0.0, **common,
        )  # fmt: skip
    assert isinstance(given, FittedRelation), given
    assert fitted is not None, "the stage fits it first"
    return fitted


def saturation(given: SiteRelation | FittedRelation) -> dict[str, Any]:
    """Length (m) and exponent of R0, as GroundMotion takes them."""
    stated = given.saturation
    return {} if stated is None else {"length": stated.length, "exponent": stated.exponent}
