"""A spherical cavity in Coulomb rock under all-round stress, perfectly plastic or brittle.

Both hoop stresses fail together, on an edge of the Coulomb surface, so there is no intermediate stress. Perfectly
plastic: Yu and Houlsby (1991, Geotechnique 41, 173) at small strains, for a cavity that contracts (first Salencon 1969,
Ann. Ponts Chauss. 4, 231); brittle: with a residual surface inside, as Park and Kim (2006, Int. J. Rock Mech. Min. Sci.
43, 616) have it for a circular opening.
"""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from verification.plastic.ring import PlasticRing, Zone


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
