"""A tunnel or a sphere in Coulomb rock under all-round virgin stress, perfectly plastic or brittle.

Symmetry leaves one coordinate. With n = 1 (tunnel) or 2 (sphere) equal hoop directions, compression positive:

    equilibrium   d s_r / dr = n (s_t - s_r) / r
    elastic rock  s_r = p - (p - q)(R/r)^(n+1),  s_t = p + (p - q)(R/r)^(n+1) / n,  u = (p - q) R (R/r)^n / (2 n G)
    failed rock   s_t = N s_r + sigma_c (residual),  so  s_r = k ((r/a)^m - 1),  k = sigma_c / (N - 1),  m = n (N - 1)

and the front R is where the elastic hoop stress has come down to the peak strength: q = s_r(R) =
((n + 1) p - n sigma_c) / (n N + 1), intact values. Where residual strength is below the peak, the hoop stress jumps at
R and the radial one does not (Brown, Bray, Ladanyi & Hoek 1983, J. Geotech. Eng. 109, 15).

Displacement in failed rock: the flow of each face that acts is (-N_psi, 1), so with elastic strains since virgin

    du/dr + n N_psi u/r = e_r + N_psi (e_t + e_3),    u inward, all strains compression positive,

where the third direction is the other hoop direction of a sphere, or the tunnel's axis: on the face of s_t and s_r
alone plane strain makes its elastic strain zero. The right side is A (r/a)^m + B, and u follows zone by zone from the
front inward.

Results are tension positive, displacement outward; the cavity bears no pressure. Friction must be above zero.

Tunnel in plane strain. Perfectly plastic: Salencon (1969, Ann. Ponts Chauss. 4, 231); brittle: Brown, Bray, Ladanyi &
Hoek (1983) and Carranza-Torres (2004, Int. J. Rock Mech. Min. Sci. 41, 480) with a residual Coulomb surface. They take
the stress along the axis as intermediate. As hoop stress falls towards the wall, the axial one, p + nu (changes of the
other two), may overtake it; from there inward both are major and rock flows on the edge between two faces (Reed 1988,
Int. J. Numer. Anal. Methods Geomech. 12, 173). Radial and hoop stress and the front stay what they were, since the hoop
stress remains on the surface; axial stress and displacement change. `edge=False` gives the classical solution.

Sphere. Both hoop stresses fail together, on an edge of the Coulomb surface, so there is no intermediate stress.
Perfectly plastic: Yu and Houlsby (1991, Geotechnique 41, 173) at small strains, for a cavity that contracts (first
Salencon 1969); brittle: with a residual surface inside, as Park and Kim (2006, Int. J. Rock Mech. Min. Sci. 43, 616)
have it for a circular opening.
"""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike

from mpm_core.constitutive.coulomb_strength import DILATION_FACTOR, FRICTION_FACTOR, UNCONFINED_STRENGTH, strength_row
from verification.cavities.inclusion import Elastic


@dataclass(frozen=True)
class CoulombRock(Elastic):
    """Elastic constants, N and sigma_c (Pa) of intact and failed rock, and N_psi of failed rock (`dilation`)."""

    intact_friction: float
    intact_strength: float
    residual_friction: float
    residual_strength: float
    dilation: float

    @classmethod
    def of(cls, material: dict) -> "CoulombRock":
        """From a material of the configuration in SI units (angles in degrees)."""
        intact, residual = (
            strength_row(*(material[key][state] for key in ("friction_angle", "dilation_angle", "cohesion")))
            for state in ("intact", "residual")
        )
        return cls(
            material["youngs_modulus"],
            material["poisson_ratio"],
            intact[FRICTION_FACTOR],
            intact[UNCONFINED_STRENGTH],
            residual[FRICTION_FACTOR],
            residual[UNCONFINED_STRENGTH],
            residual[DILATION_FACTOR],
        )

    @property
    def brittle(self) -> bool:
        """True if strength drops on failure."""
        return (self.intact_friction, self.intact_strength) != (self.residual_friction, self.residual_strength)


@dataclass(frozen=True)
class Zone:
    """Failed rock inside radius `outer` (m). Stress changes are power (r/a)^m + constant: radial, hoop, third; Pa."""

    outer: float
    power: tuple[float, float, float]
    constant: tuple[float, float, float]


@dataclass(frozen=True)
class PlasticRing(ABC):
    """A cavity of `radius` m in `rock` under all-round virgin compression of `pressure` Pa (positive)."""

    radius: float
    pressure: float
    rock: CoulombRock
    hoop_directions: ClassVar[int]

    @property
    def exponent(self) -> float:
        """m: radial stress in failed rock grows as (r/a)^m."""
        return self.hoop_directions * (self.rock.residual_friction - 1)

    @property
    def attraction(self) -> float:
        """k = sigma_c / (N - 1) of failed rock, Pa."""
        return self.rock.residual_strength / (self.rock.residual_friction - 1)

    @property
    def front_pressure(self) -> float:
        """q, radial compression at the front, Pa; 0 where the wall does not fail."""
        n, rock = self.hoop_directions, self.rock
        return max(0.0, ((n + 1) * self.pressure - n * rock.intact_strength) / (n * rock.intact_friction + 1))

    @property
    def plastic_radius(self) -> float:
        """R, m; the cavity's own radius where nothing fails."""
        return self.radius * (self.front_pressure / self.attraction + 1) ** (1 / self.exponent)

    @abstractmethod
    def zones(self) -> list[Zone]:
        """Zones of failed rock from the front inward."""

    @abstractmethod
    def elastic_third(self, radial: np.ndarray, hoop: np.ndarray) -> np.ndarray:
        """Third stress in elastic rock (compression positive) from the other two."""

    def _failed_zones(self) -> list[Zone]:
        return self.zones() if self.plastic_radius > self.radius else []

    def stress(self, r: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Radial, hoop, third stress (along a tunnel, a sphere's other hoop), Pa, tension positive; r >= radius, m."""
        r = np.asarray(r, float)
        n, decrease = self.hoop_directions, self.pressure - self.front_pressure
        decay = (self.plastic_radius / r) ** (n + 1)
        radial, hoop = self.pressure - decrease * decay, self.pressure + decrease / n * decay
        parts = [radial, hoop, self.elastic_third(radial, hoop)]
        x = (r / self.radius) ** self.exponent
        for zone in self._failed_zones():
            inside = r <= zone.outer
            for i, (power, constant) in enumerate(zip(zone.power, zone.constant, strict=True)):
                parts[i] = np.where(inside, self.pressure + power * x + constant, parts[i])
        return -parts[0], -parts[1], -parts[2]

    def displacement(self, r: ArrayLike) -> np.ndarray:
        """Outward displacement since virgin at r >= radius, m."""
        r = np.asarray(r, float)
        n, front = self.hoop_directions, self.plastic_radius
        edge = (self.pressure - self.front_pressure) * front / (2 * n * self.rock.shear_modulus)
        inward = edge * (front / r) ** n
        beta = n * self.rock.dilation
        for zone in self._failed_zones():
            particular, at_edge = self._particular(zone, r, beta), self._particular(zone, zone.outer, beta)
            value = particular + (edge - at_edge) * (zone.outer / r) ** beta
            inward = np.where(r <= zone.outer, value, inward)
            following = [other.outer for other in self._failed_zones() if other.outer < zone.outer]
            if following:
                inner = following[0]
                edge = float(self._particular(zone, inner, beta) + (edge - at_edge) * (zone.outer / inner) ** beta)
        return -inward

    def _particular(self, zone: Zone, r, beta: float):
        """Particular solution for u driven by the elastic strains: A r x / (m + 1 + beta) + B r / (1 + beta)."""
        power, constant = (self._drive(part) for part in (zone.power, zone.constant))
        x = (r / self.radius) ** self.exponent
        return r * (power * x / (self.exponent + 1 + beta) + constant / (1 + beta))

    def _drive(self, stress: tuple[float, float, float]) -> float:
        """e_r + N_psi (e_t + e_3) of a stress change, by Hooke."""
        nu, total = self.rock.poisson_ratio, sum(stress)
        radial, hoop, third = (((1 + nu) * part - nu * total) / self.rock.youngs_modulus for part in stress)
        return radial + self.rock.dilation * (hoop + third)


@dataclass(frozen=True)
class PlasticSphere(PlasticRing):
    """The spherical cavity, with two equal hoop directions."""

    hoop_directions: ClassVar[int] = 2

    def zones(self) -> list[Zone]:
        """One zone, on the edge where both hoop stresses are major."""
        k, hoop = self.attraction, self.rock.residual_friction * self.attraction
        rest = -(k + self.pressure)
        return [Zone(self.plastic_radius, (k, hoop, hoop), (rest, rest, rest))]

    def elastic_third(self, radial: np.ndarray, hoop: np.ndarray) -> np.ndarray:
        """The other hoop stress."""
        return hoop


@dataclass(frozen=True)
class PlasticTunnel(PlasticRing):
    """The tunnel; the third direction is its axis. edge: whether axial stress may become a major one."""

    edge: bool = True
    hoop_directions: ClassVar[int] = 1

    @property
    def edge_radius(self) -> float:
        """Radius at which axial stress reaches the hoop stress of failed rock, m: between the wall's radius and R.

        p + nu (ds_r + ds_t) = p + ds_t with ds_r = k x - k - p, ds_t = N k x - k - p, x = (r/a)^m.
        """
        nu, k, friction = self.rock.poisson_ratio, self.attraction, self.rock.residual_friction
        x = (1 - 2 * nu) * (k + self.pressure) / (k * ((1 - nu) * friction - nu))
        return self.radius * min(max(x, 1.0), (self.plastic_radius / self.radius) ** self.exponent) ** (
            1 / self.exponent
        )

    def zones(self) -> list[Zone]:
        """One zone on the face of hoop and radial stress, and one on the edge inside `edge_radius`."""
        nu, k, hoop = self.rock.poisson_ratio, self.attraction, self.rock.residual_friction * self.attraction
        rest = -(k + self.pressure)
        zones = [Zone(self.plastic_radius, (k, hoop, nu * (k + hoop)), (rest, rest, 2 * nu * rest))]
        if self.edge and self.edge_radius > self.radius:
            zones.append(Zone(self.edge_radius, (k, hoop, hoop), (rest, rest, rest)))
        return zones

    def elastic_third(self, radial: np.ndarray, hoop: np.ndarray) -> np.ndarray:
        """Axial stress in plane strain."""
        return self.pressure + self.rock.poisson_ratio * (radial + hoop - 2 * self.pressure)
