"""A circular tunnel in Coulomb rock under all-round stress, plane strain, perfectly plastic or brittle.

Perfectly plastic: Salencon (1969, Ann. Ponts Chauss. 4, 231); brittle: Brown, Bray, Ladanyi & Hoek (1983) and
Carranza-Torres (2004, Int. J. Rock Mech. Min. Sci. 41, 480) with a residual Coulomb surface. They take the stress along
the axis as intermediate. As hoop stress falls towards the wall, the axial one, p + nu (changes of the other two), may
overtake it; from there inward both are major and rock flows on the edge between two faces (Reed 1988, Int. J. Numer.
Anal. Methods Geomech. 12, 173). Radial and hoop stress and the front stay what they were, since the hoop stress remains
on the surface; axial stress and displacement change. `edge=False` gives the classical solution.
"""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from verification.plastic.ring import PlasticRing, Zone


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
