"""Beremi's slope: the factor of strength above which it finds no equilibrium, and the iterations that it takes.

Facts from Beremi/slope_stability_petsc4py (commit ce5abae): benchmarks/run_2D_homo_SSR_capture/report.md (factors,
Newton steps and seconds of its PETSc run) and case.toml (triangles of 1 m with six nodes, Davis' approach B),
meshes/2d_homo_slope (strength, moduli, weight, boundary), src/slope_stability/constitutive/reduction.py.

The bound that both are compared with is kinematic: a rigid block of a slope of Coulomb rock with associated flow turns
on a log spiral. The block slides off along r = r0 exp((theta - theta_0) tan(phi)) around a centre, from the ground
behind the crest to the toe, as a weightless centre's arm turns; angles are from the horizontal downwards. Per unit of
rotation its weight works gamma times the first moment of its area, and cohesion takes c r0^2 (exp(2 (theta_h -
theta_0) tan(phi)) - 1) / (2 tan(phi)). The height at which both are equal is an upper bound of the stable height; the
least of all is Chen's (1975, Limit Analysis and Soil Plasticity, ch. 9), and Taylor's (1937, J. Boston Soc. Civ. Eng.
24, 337) but for the shape of his arc.

Strength without dilation, reduced by a factor, becomes that of rock with associated flow by Davis' approach B
(Tschuchnigg, Schweiger & Sloan 2015, Comput. Geotech. 70, 178): reduced first, then taken times cos(phi).
"""

import math
from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq, minimize

from verification.results import Results, Variant
from verification.rows import Row

SOURCE = "Beremi, run_2D_homo_SSR_capture"
SPIRAL_POINTS = 400
# First and last angles, degrees. The search for the worst spiral starts from the best pair.
START_ANGLES = [(first, last) for first in range(10, 90, 8) for last in range(60, 170, 8)]
FACTOR_BOUNDS = 0.5, 4.0  # Factors of strength between which a limit is sought.
UNREACHABLE_HEIGHT = 1e9  # Dimensionless height at which what is no mechanism slides.


@dataclass(frozen=True)
class Spiral:
    """A log spiral. centre: from the toe, m, into the rock and up; first, last: angles, rad; radius: at `first`, m."""

    centre: tuple[float, float]
    first: float
    last: float
    radius: float
    friction: float

    def points(self) -> np.ndarray:
        """From the ground behind the crest to the toe (point, 2), m from the toe."""
        angle = np.linspace(self.first, self.last, SPIRAL_POINTS)
        arm = self.radius * np.exp((angle - self.first) * math.tan(self.friction))
        return np.stack([self.centre[0] + arm * np.cos(angle), self.centre[1] - arm * np.sin(angle)], axis=1)


@dataclass(frozen=True)
class Slope:
    """Cohesion Pa, friction angle degrees, no dilation; unit weight N/m3, height m, inclination degrees."""

    cohesion: float
    friction_angle: float
    unit_weight: float
    height: float
    slope: float

    def reduced(self, factor: float) -> tuple[float, float]:
        """Cohesion Pa and friction angle, degrees, of rock with associated flow at a factor: Davis' approach B."""
        friction = math.atan(math.tan(math.radians(self.friction_angle)) / factor)
        share = math.cos(friction)
        return share * self.cohesion / factor, math.degrees(math.atan(share * math.tan(friction)))

    def excess(self, factor: float) -> float:
        """Share by which the slope is higher than the worst spiral allows at a factor."""
        cohesion, friction = self.reduced(factor)
        height, _ = worst_spiral(math.radians(friction), math.radians(self.slope))
        return self.unit_weight * self.height / cohesion / height - 1.0

    def limit(self) -> float:
        """The largest factor at which the slope stands by the worst spiral."""
        return brentq(self.excess, *FACTOR_BOUNDS, xtol=1e-6)

    def spiral(self) -> Spiral:
        """The worst spiral at the limit."""
        _, friction = self.reduced(self.limit())
        _, unit = worst_spiral(math.radians(friction), math.radians(self.slope))
        centre = self.height * unit.centre[0], self.height * unit.centre[1]
        return Spiral(centre, unit.first, unit.last, self.height * unit.radius, unit.friction)


def worst_spiral(friction: float, slope: float) -> tuple[float, Spiral]:
    """Unit weight times height over cohesion at which the worst spiral through the toe just slides, and that spiral.

    The spiral is that of a slope of height 1. Angles in radians; friction above zero.
    """

    def height(angles: np.ndarray) -> float:
        spiral = through_toe(angles, friction)
        return UNREACHABLE_HEIGHT if spiral is None else height_of(spiral, slope)

    start = min((np.radians(angles) for angles in START_ANGLES), key=height)
    best = minimize(height, start, method="Nelder-Mead", tol=1e-8)
    worst = through_toe(best.x, friction)
    assert worst is not None  # the search starts at a spiral through the toe and goes to none that is not
    return float(best.fun), worst


def through_toe(angles: np.ndarray, friction: float) -> Spiral | None:
    """The spiral between two angles that ends at the toe of a slope of height 1; None where there is none."""
    first, last = (float(angle) for angle in angles)
    if not 0.0 < first < last < math.pi:
        return None
    growth = math.exp((last - first) * math.tan(friction))
    fall = growth * math.sin(last) - math.sin(first)
    if fall <= 0.0:
        return None
    arm = growth / fall
    return Spiral((-arm * math.cos(last), arm * math.sin(last)), first, last, 1.0 / fall, friction)


def height_of(spiral: Spiral, slope: float) -> float:
    """Unit weight times height over cohesion at which a spiral through the toe of a slope of height 1 slides."""
    arc, crest = spiral.points(), np.array([[1.0 / math.tan(slope), 1.0]])
    if arc[0, 0] <= crest[0, 0]:
        return UNREACHABLE_HEIGHT
    outline = np.concatenate([arc, crest]) - np.array(spiral.centre)
    x, z = outline.T
    after_x, after_z = np.roll(x, -1), np.roll(z, -1)
    moment = -np.sum((x + after_x) * (x * after_z - after_x * z)) / 6.0  # The outline runs clockwise.
    if moment <= 0.0:
        return UNREACHABLE_HEIGHT
    tangent = math.tan(spiral.friction)
    cohesive = spiral.radius**2 * (math.exp(2.0 * (spiral.last - spiral.first) * tangent) - 1.0) / (2.0 * tangent)
    return cohesive / moment


def rests(variant: Variant) -> bool:
    """True if the slope has reached equilibrium under its whole weight."""
    return not variant.last.attrs["collapsed"]


def limits(results: Results) -> tuple[float, float]:
    """Largest factor with an equilibrium below the smallest without one, and that smallest factor (inf if none)."""
    factors = results.settings["slope"]["factors"]
    by_rest = {True: [], False: [float("inf")]}
    for name in results.present(factors):
        by_rest[rests(results[name])].append(factors[name])
    falls = min(by_rest[False])
    return max((factor for factor in by_rest[True] if factor < falls), default=0.0), falls


def slope_rows(results: Results) -> list[Row]:
    """The limit against the log spiral's and theirs, and iterations against their Newton steps."""
    settings = results.settings["slope"]
    bound, (stands, falls) = Slope(**settings["rock"]).limit(), limits(results)
    theirs = settings["limit"]
    above = f"{100.0 * (theirs / bound - 1.0):.1f} %"
    rows = [
        Row.relative(f"slope: factor at its limit, {SOURCE} and the log spiral", bound, theirs, None,
                     f"{above} above a bound that no exact limit is above; {settings['seconds']:.1f} s for "
                     "14 factors in 8 processes"),
        Row.relative("slope: largest factor that comes to rest, ours and the log spiral", bound, stands,
                     results.allowed["limit"], f"at {falls:g} it moves by more than a cell, which counts as collapse"),
        Row.relative(f"slope: the same beside theirs, {SOURCE}", theirs, stands, None,
                     f"not compared: theirs is {above} above the log spiral's"),
    ]  # fmt: skip
    rows += [work_row(name, results) for name in results.present(settings["factors"])]
    return rows


def work_row(name: str, results: Results) -> Row:
    """Iterations of one run against the Newton steps of their nearest factor."""
    settings, variant = results.settings["slope"], results[name]
    factor, newton = settings["factors"][name], settings["newton"]
    nearest = min(newton, key=lambda one: abs(one - factor))
    iterations, seconds = variant.last.attrs["iterations"], variant.seconds(variant.stages[-1])
    took = "" if seconds is None else f" in {seconds:.0f} s"
    remark = f"{'comes to rest' if rests(variant) else 'finds no rest'}{took}; theirs at a factor of {nearest:g}"
    quantity = f"{name}: iterations of the step, and their Newton steps"
    return Row.relative(quantity, newton[nearest], float(iterations), None, remark)
