"""A circular tunnel in Hoek-Brown rock under all-round stress, with pressure inside: perfectly plastic or brittle.

Carranza-Torres & Fairhurst (1999, Int. J. Rock Mech. Min. Sci. 36, 777) and, for any exponent, Sharan (2008, Int. J.
Rock Mech. Min. Sci. 45, 78). Compression positive, w = mb s_r / sigma_ci + s of failed (residual) rock:

    failed rock   d s_r / dr = sigma_ci w^a / r,  so  w^(1 - a) = w_wall^(1 - a) + (1 - a) mb ln(r / radius)
                  (w = w_wall (r / radius)^mb for a = 1),   s_t = s_r + sigma_ci w^a
    front         2 (p - q) = sigma_ci (mb q / sigma_ci + s)^a  of intact rock: the elastic hoop stress is at strength
    elastic rock  s_r = p - (p - q)(R / r)^2,  s_t = p + (p - q)(R / r)^2,  u = (p - q) R^2 / (2 G r)

The wall fails where the pressure inside is below q. Where residual strength is below the peak the hoop stress jumps at
R. Axial stress is p + nu (changes of the other two) until that is a major one: from there inward rock flows on the edge
between two faces, where it equals the hoop stress (Reed 1988, Int. J. Numer. Anal. Methods Geomech. 12, 173).
Displacement in failed rock, u inward, strains compression positive:

    du/dr + N_psi u/r = e_r + N_psi (e_t + e_z),    e elastic strains of the changes of stress,

integrated from the front inward by Gauss's rule. Results are tension positive, displacement outward.
"""

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import brentq

from verification.cavities.inclusion import Elastic

QUADRATURE_POINTS = 60  # Points of Gauss's rule on the edge, and as many on the face.


@dataclass(frozen=True)
class Curve:
    """A strength curve: sigma_ci Pa, mb, s and a."""

    sigma_ci: float
    mb: float
    s: float
    a: float

    def room(self, confinement):
        """Largest difference of the principal stresses at a confinement, Pa. Compression is positive."""
        return self.sigma_ci * (self.mb * confinement / self.sigma_ci + self.s) ** self.a


@dataclass(frozen=True)
class HoekBrownRock(Elastic):
    """Elastic constants, strength curves of intact and failed rock, and N_psi of failed rock (`dilation`)."""

    intact: Curve
    residual: Curve
    dilation: float

    @classmethod
    def of(cls, material: dict) -> "HoekBrownRock":
        """From a material of the configuration in SI units that gives mb, s and a (angles in degrees)."""
        intact, residual = (
            Curve(*(material[key][state] for key in ("sigma_ci", "mb", "s", "a"))) for state in ("intact", "residual")
        )
        sine = math.sin(math.radians(material["dilation_angle"]["residual"]))
        return cls(material["youngs_modulus"], material["poisson_ratio"], intact, residual, (1 + sine) / (1 - sine))

    @property
    def brittle(self) -> bool:
        """True if strength drops on failure."""
        return self.intact != self.residual


@dataclass(frozen=True)
class HoekBrownTunnel:
    """A tunnel of `radius` m in `rock` under virgin compression of `pressure` Pa, with `inside` Pa on its wall."""

    radius: float
    pressure: float
    rock: HoekBrownRock
    inside: float = 0.0

    @cached_property
    def critical_pressure(self) -> float:
        """q, Pa: pressure inside below which the wall fails; 0 where it stands without pressure."""

        def excess(q: float) -> float:
            return 2 * (self.pressure - q) - self.rock.intact.room(q)

        return brentq(excess, 0.0, self.pressure, xtol=1e-6) if excess(0.0) > 0.0 else 0.0

    @property
    def front_pressure(self) -> float:
        """Radial compression where elastic rock begins, Pa: q at the front, or the pressure on an elastic wall."""
        return max(self.critical_pressure, self.inside)

    @property
    def plastic_radius(self) -> float:
        """R, m; the tunnel's own radius where nothing fails."""
        if self.inside >= self.critical_pressure:
            return self.radius
        curve = self.rock.residual
        front, wall = (curve.mb * stress / curve.sigma_ci + curve.s for stress in (self.front_pressure, self.inside))
        if curve.a == 1.0:
            return self.radius * (front / wall) ** (1 / curve.mb)
        power = 1 - curve.a
        return self.radius * math.exp((front**power - wall**power) / (power * curve.mb))

    def _failed(self, r: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Radial, hoop and axial compression of failed rock, Pa."""
        curve, power = self.rock.residual, 1 - self.rock.residual.a
        wall, way = curve.mb * self.inside / curve.sigma_ci + curve.s, np.log(r / self.radius)
        w = wall * np.exp(curve.mb * way) if power == 0.0 else (wall**power + power * curve.mb * way) ** (1 / power)
        radial = (w - curve.s) * curve.sigma_ci / curve.mb
        hoop = radial + curve.sigma_ci * w**curve.a
        return radial, hoop, np.minimum(self._axial(radial, hoop), hoop)

    @property
    def edge_radius(self) -> float:
        """Radius up to which axial stress is a major one, m: the wall's radius if it is nowhere."""

        def above(r: float) -> float:
            radial, hoop, _ = self._failed(np.array(r))
            return float(self._axial(radial, hoop) - hoop)

        if self.plastic_radius == self.radius or above(self.radius) <= 0.0:
            return self.radius
        return brentq(above, self.radius, self.plastic_radius, rtol=1e-14)

    def _axial(self, radial, hoop):
        return self.pressure + self.rock.poisson_ratio * (radial + hoop - 2 * self.pressure)

    def stress(self, r: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Radial, hoop and axial stress, Pa, tension positive; r >= radius, m."""
        r, front = np.asarray(r, float), self.plastic_radius
        decay = (self.pressure - self.front_pressure) * (front / r) ** 2
        radial, hoop = self.pressure - decay, self.pressure + decay
        elastic = radial, hoop, self._axial(radial, hoop)
        failed = self._failed(np.clip(r, self.radius, front))
        inside = (r < front) & (front > self.radius)
        radial, hoop, axial = (-np.where(inside, *pair) for pair in zip(failed, elastic, strict=True))
        return radial, hoop, axial

    def displacement(self, r: ArrayLike) -> np.ndarray:
        """Outward displacement since virgin at r >= radius, m."""
        r, front, m = np.asarray(r, float), self.plastic_radius, self.rock.dilation
        edge = (self.pressure - self.front_pressure) * front / (2 * self.rock.shear_modulus)
        knots, weights = np.polynomial.legendre.leggauss(QUADRATURE_POINTS)
        inner = np.minimum(r, front)
        kink = np.maximum(inner, self.edge_radius)
        driven = np.zeros_like(inner)
        for low, high in ((inner, kink), (kink, front)):
            for knot, weight in zip(knots, weights, strict=True):
                x = 0.5 * (low + high) + 0.5 * (high - low) * knot
                driven += weight * 0.5 * (high - low) * self._drive(x) * x**m
        failed = (edge * front**m - driven) / inner**m
        return -np.where(r < front, failed, edge * front / r)

    def _drive(self, r: np.ndarray) -> np.ndarray:
        """e_r + N_psi (e_t + e_z) of the changes of stress in failed rock."""
        change = [part - self.pressure for part in self._failed(r)]
        nu, total = self.rock.poisson_ratio, sum(change)
        radial, hoop, axial = (((1 + nu) * part - nu * total) / self.rock.youngs_modulus for part in change)
        return radial + self.rock.dilation * (hoop + axial)
