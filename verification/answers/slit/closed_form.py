"""A slit in elastic rock in plane strain, held open by springs.

The slit |x| < a has no height. The far stress p presses on it, and springs of stiffness k (Pa/m) push back, so that its
walls close by c(x), with E' = E / (1 - nu^2):

    E' / (4 pi) f.p. integral c(s) / (x - s)^2 ds  =  k c(x) - p      on |x| < a, c(+-a) = 0.

With c = sqrt(1 - t^2) sum_n b_n U_n(t), t = x / a and Chebyshev polynomials U_n, the left side is
-E' / (4 a) sum_n (n + 1) b_n U_n (Sneddon and Lowengrub 1969, Crack Problems in the Classical Theory of Elasticity;
Kaya and Erdogan 1987, Q. Appl. Math. 45, 105). Multiplied by sqrt(1 - t^2) U_m and integrated, it is a linear system,
whose matrix converges faster than any power of the number of terms. Without springs c = 4 p sqrt(a^2 - x^2) / E', a
mined seam without fill (Salamon 1968); with stiff ones c = p / k but at the ends.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

TERMS = 60


@dataclass(frozen=True)
class Slit:
    """half_width m; pressure Pa, positive in compression; modulus E' Pa; spring Pa/m."""

    half_width: float
    pressure: float
    modulus: float
    spring: float

    @cached_property
    def _coefficients(self) -> np.ndarray:
        """b_n (TERMS,) m."""
        number = np.arange(TERMS)
        rock = np.diag(self.modulus / (4.0 * self.half_width) * (number + 1) * np.pi / 2.0)
        # integral (1 - t^2) U_n U_m dt = integral sin((n + 1) q) sin((m + 1) q) sin(q) dq, 0 to pi
        total, apart = number[:, None] + number + 2, number[:, None] - number
        with np.errstate(divide="ignore"):
            springs = np.where(total % 2 == 0, 1.0 / (1.0 - apart**2.0) - 1.0 / (1.0 - total**2.0), 0.0)
        load = np.zeros(TERMS)
        load[0] = self.pressure * np.pi / 2.0
        return np.linalg.solve(rock + self.spring * springs, load)

    def closure(self, x: np.ndarray) -> np.ndarray:
        """How much the walls close at x (k,) m from the middle: (k,) m, 0 beyond the ends."""
        angle = np.arccos(np.clip(np.asarray(x, float) / self.half_width, -1.0, 1.0))
        return np.sin(np.outer(angle, np.arange(TERMS) + 1)) @ self._coefficients

    @property
    def closed_area(self) -> float:
        """Integral of the closure over the width, m2."""
        return float(self.half_width * np.pi / 2.0 * self._coefficients[0])
