"""A spherical cavity or inclusion in elastic rock under uniform virgin stress.

Eshelby (1957, Proc. R. Soc. A 241, 376): an elastic sphere in elastic rock strains uniformly, as a sphere of the rock
itself would with a uniform eigenstrain. Here the rock carries virgin stress and the inclusion is placed without stress
in the virgin geometry, so with strains counted from the virgin state

    C_inclusion e = sigma_0 + C_rock (e - e*),    e = S e*    inside.

Two numbers solve this, since S of a sphere is isotropic: S = alpha (volumetric) + beta (deviatoric). A cavity is an
inclusion without stiffness (Goodier 1933, Trans. ASME 55, 39). Outside, a volumetric eigenstrain moves rock as x/r^3, a
deviatoric one d as

    u = P (a/r)^3 [2 (1 - 2 nu) d.x + 3 x (n.d.n)] + Q (a/r)^5 [2 d.x - 5 x (n.d.n)],    n = x/r,
    P = 1 / (6 (1 - nu)),  Q = 1 / (10 (1 - nu)):

a dipole of Kelvin's forces and the gradient of a solid harmonic of order 2, joined to u = beta d.x at r = a.

Stress and strain are tension positive, tensors (..., 3, 3); points (point, 3) in metres from the centre; displacement
counts from the virgin state.
"""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Elastic:
    """An isotropic elastic material: Young's modulus Pa (0 for a cavity), Poisson's ratio."""

    youngs_modulus: float
    poisson_ratio: float

    @property
    def lame(self) -> tuple[float, float]:
        """lambda and shear modulus, Pa."""
        shear = self.shear_modulus
        return 2 * shear * self.poisson_ratio / (1 - 2 * self.poisson_ratio), shear

    @property
    def bulk_modulus(self) -> float:
        """Pa."""
        return self.youngs_modulus / (3 * (1 - 2 * self.poisson_ratio))

    @property
    def shear_modulus(self) -> float:
        """Pa."""
        return self.youngs_modulus / (2 * (1 + self.poisson_ratio))

    def stress(self, strain: np.ndarray) -> np.ndarray:
        """Stress (..., 3, 3) Pa of a strain (..., 3, 3)."""
        volumetric, deviator = split(strain)
        return 3 * self.bulk_modulus * volumetric + 2 * self.shear_modulus * deviator


def split(tensor: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Volumetric part and deviator of tensors (..., 3, 3)."""
    volumetric = np.trace(tensor, axis1=-2, axis2=-1)[..., None, None] / 3 * np.eye(3)
    return volumetric, tensor - volumetric


@dataclass(frozen=True)
class SphericalInclusion:
    """A sphere of `radius` m in `rock` under `virgin_stress` (3, 3) Pa; its `inclusion` is placed without stress."""

    radius: float
    virgin_stress: np.ndarray
    rock: Elastic
    inclusion: Elastic = Elastic(0.0, 0.0)

    @property
    def _shape_factors(self) -> tuple[float, float]:
        """Eshelby's tensor of a sphere: volumetric and deviatoric factor."""
        nu = self.rock.poisson_ratio
        return (1 + nu) / (3 * (1 - nu)), 2 * (4 - 5 * nu) / (15 * (1 - nu))

    @property
    def eigenstrain(self) -> tuple[np.ndarray, np.ndarray]:
        """e*, volumetric part and deviator (3, 3): that of the equivalent inclusion."""
        alpha, beta = self._shape_factors
        volumetric, deviator = split(np.asarray(self.virgin_stress, float))
        rock, inclusion = self.rock, self.inclusion
        return (
            volumetric / (3 * (inclusion.bulk_modulus * alpha + rock.bulk_modulus * (1 - alpha))),
            deviator / (2 * (inclusion.shear_modulus * beta + rock.shear_modulus * (1 - beta))),
        )

    @property
    def strain_inside(self) -> np.ndarray:
        """Uniform strain (3, 3) of the inclusion. In a cavity it gives the displacement of the wall, u = strain x."""
        alpha, beta = self._shape_factors
        volumetric, deviator = self.eigenstrain
        return alpha * volumetric + beta * deviator

    @property
    def stress_inside(self) -> np.ndarray:
        """Uniform stress (3, 3) Pa of the inclusion; zero in a cavity."""
        return self.inclusion.stress(self.strain_inside)

    def _outside(self, points: np.ndarray) -> tuple:
        """Terms of both fields: r, n, w = d.n, q = n.d.n, and radial functions of both parts."""
        r = np.linalg.norm(points, axis=-1)
        n = points / r[:, None]
        w = n @ self.eigenstrain[1]
        nu = self.rock.poisson_ratio
        dipole = (self.radius / r) ** 3 / (6 * (1 - nu))
        harmonic = (self.radius / r) ** 5 / (10 * (1 - nu))
        along_d = 2 * (1 - 2 * nu) * dipole + 2 * harmonic  # F: u = F d.x + H x q
        along_x = 3 * dipole - 5 * harmonic  # H
        slope_d = -6 * (1 - 2 * nu) * dipole - 10 * harmonic  # r dF/dr
        slope_x = -9 * dipole + 25 * harmonic  # r dH/dr
        shrink = self._shape_factors[0] * self.eigenstrain[0][0, 0] * (self.radius / r) ** 3
        return r, n, w, (n * w).sum(axis=-1), along_d, along_x, slope_d, slope_x, shrink

    def displacement(self, points: np.ndarray) -> np.ndarray:
        """Displacement (point, 3) m. Inside a cavity the displacement of the wall is continued."""
        points = np.asarray(points, float)
        inside = np.linalg.norm(points, axis=-1) < self.radius
        result = points @ self.strain_inside
        r, n, w, q, along_d, along_x, _, _, shrink = self._outside(points[~inside])
        result[~inside] = r[:, None] * (along_d[:, None] * w + (along_x * q + shrink)[:, None] * n)
        return result

    def wall_displacement(self, directions: np.ndarray) -> np.ndarray:
        """Outward displacement (point,) m of the wall in these directions (point, 3)."""
        return (self.displacement(self.radius * directions) * directions).sum(axis=1)

    def stress(self, points: np.ndarray) -> np.ndarray:
        """Whole stress (point, 3, 3) Pa; zero inside a cavity."""
        points = np.asarray(points, float)
        inside = np.linalg.norm(points, axis=-1) < self.radius
        result = np.broadcast_to(self.stress_inside, (len(points), 3, 3)).copy()
        _, n, w, q, along_d, along_x, slope_d, slope_x, shrink = self._outside(points[~inside])
        both = 0.5 * (n[:, :, None] * w[:, None, :] + w[:, :, None] * n[:, None, :])
        outward = n[:, :, None] * n[:, None, :]

        def times(factor, tensor):
            return factor[:, None, None] * tensor

        strain = (
            times(along_d, self.eigenstrain[1])
            + times(slope_d + 2 * along_x, both)
            + times(along_x * q + shrink, np.eye(3))
            + times((slope_x - 2 * along_x) * q - 3 * shrink, outward)
        )
        result[~inside] = self.virgin_stress + self.rock.stress(strain)
        return result
