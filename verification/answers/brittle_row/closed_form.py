"""A column of Coulomb rock between smooth rigid sides whose top is mined: failed depth, stress and closure by hand.

Uniaxial strain, x and y held, z down from the new free face as depth d (m). The virgin stress is linear in depth; its
gradient along z is the weight. Whatever fails, the vertical stress is the weight above: statically determined. So

    zz(d) = g_z d                                                                  all rock
    xx(d) = virgin + nu / (1 - nu) (zz - virgin zz), yy likewise                   elastic rock
    N zz - xx > sigma_c (intact)                                                   fails: linear in d, to one depth
    xx(d) = N zz - sigma_c, yy = virgin + nu (change of xx + change of zz)         failed on the face of x and z
                            yy = xx if both are virgin equals                      failed on the edge
    e_z = elastic e_z + N_psi (elastic e_x + elastic e_y)                          failed: e_x = e_y = 0 in total

(residual N and sigma_c in failed rock), and the face rises by the integral of e_z. Failure of one cell does not depend
on another, so it does not localise. Stress and strain are tension positive.
"""

from dataclasses import dataclass

import numpy as np

from verification.cavities.coulomb import CoulombRock


@dataclass(frozen=True)
class BrittleRow:
    """rock; face, gradient (3,) virgin xx, yy, zz at the new free face (Pa) and their change per metre of depth (Pa/m).

    xx is the most compressive after unloading; yy equals it in virgin rock, or stays intermediate throughout.
    """

    rock: CoulombRock
    face: np.ndarray
    gradient: np.ndarray

    @property
    def _aside(self) -> float:
        """nu / (1 - nu): change of side stress over that of vertical stress, elastic."""
        return self.rock.poisson_ratio / (1 - self.rock.poisson_ratio)

    @property
    def failed_depth(self) -> float:
        """Depth to which intact strength is exceeded, m; 0 where the face itself stands."""
        rock = self.rock
        at_face = -self.face[0] + self._aside * self.face[2] - rock.intact_strength  # N zz - xx - sigma_c at d = 0
        per_metre = rock.intact_friction * self.gradient[2] - self.gradient[0]
        return max(0.0, float(-at_face / per_metre))

    def stress(self, depth: np.ndarray) -> np.ndarray:
        """xx, yy, zz (3, point) Pa at depths (point,) m below the new face."""
        depth = np.asarray(depth, float)
        virgin = self.face[:, None] + self.gradient[:, None] * depth
        zz = self.gradient[2] * depth
        xx, yy = virgin[:2] + self._aside * (zz - virgin[2])
        failed = depth < self.failed_depth
        residual = self.rock.residual_friction * zz - self.rock.residual_strength
        if self.face[0] == self.face[1] and self.gradient[0] == self.gradient[1]:
            beside = residual
        else:
            beside = virgin[1] + self.rock.poisson_ratio * (residual - virgin[0] + zz - virgin[2])
        return np.array([np.where(failed, residual, xx), np.where(failed, beside, yy), zz])

    def vertical_strain(self, depth: np.ndarray) -> np.ndarray:
        """e_z (point,) since virgin."""
        depth = np.asarray(depth, float)
        change = self.stress(depth) - self.face[:, None] - self.gradient[:, None] * depth
        nu = self.rock.poisson_ratio
        elastic = ((1 + nu) * change - nu * change.sum(axis=0)) / self.rock.youngs_modulus
        plastic = self.rock.dilation * (elastic[0] + elastic[1])
        return elastic[2] + np.where(depth < self.failed_depth, plastic, 0.0)

    def rise(self, length: float) -> float:
        """Upward displacement of the free face, m, of a column of this length (m) on a rigid base.

        Strain is linear in depth within failed and within intact rock: the middle of each times its length is exact.
        """
        failed = min(self.failed_depth, length)
        middles = np.array([0.5 * failed, 0.5 * (failed + length)])
        return float(np.dot(self.vertical_strain(middles), [failed, length - failed]))
