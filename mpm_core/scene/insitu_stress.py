"""Virgin stress, linear in depth, and the body force that balances it."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike


@dataclass(frozen=True)
class InsituStress:
    """sigma0 = constant + gradient * D, with depth D = surface - z (paper, Table 2; tension positive).

    constant (6,) Pa, gradient (6,) Pa/m in Voigt order xx, yy, zz, yz, xz, xy; surface: elevation of D = 0, m.
    """

    constant: np.ndarray
    gradient: np.ndarray
    surface: float

    def at(self, elevation: ArrayLike) -> np.ndarray:
        """Virgin stress (..., 6) Pa at elevations z (...) m."""
        depth = self.surface - np.asarray(elevation, float)
        stress = self.gradient * depth[..., None]
        stress += self.constant
        return stress

    @property
    def body_force(self) -> np.ndarray:
        """b = -div sigma0, (3,) N/m3: what keeps the virgin field in equilibrium, whether or not it equals gravity.

        With D = surface - z only z derivatives remain: d sigma/dz = -gradient, so b_i = gradient_iz.
        """
        return self.gradient[[4, 3, 2]].copy()

    @property
    def weightless(self) -> bool:
        """Whether the field is uniform, so that nothing weighs anything."""
        return not np.any(self.gradient)
