"""Homogeneous states, a column under its weight, and a smooth field with the body force that it requires.

Tension positive; displacement counts from virgin rock. Points (n, d) m and gradients (d, d) stand in the axes of the
computation; stress is a full tensor in the order of those axes, the axis out of a plane section last.
"""

from dataclasses import dataclass

import numpy as np

from verification.cavities import inclusion


@dataclass(frozen=True)
class Elastic(inclusion.Elastic):
    """An isotropic elastic material, also in plane strain and in uniaxial strain."""

    @property
    def confined_modulus(self) -> float:
        """Modulus of uniaxial strain, lambda + 2 mu, Pa."""
        lame, shear = self.lame
        return lame + 2 * shear

    @property
    def confined_ratio(self) -> float:
        """Lateral over axial stress in uniaxial strain: nu / (1 - nu)."""
        return self.poisson_ratio / (1 - self.poisson_ratio)

    def stress(self, gradient: np.ndarray) -> np.ndarray:
        """Stress (..., 3, 3) of a displacement gradient (..., d, d); in a plane there is no strain across it."""
        d = gradient.shape[-1]
        strain = np.zeros((*gradient.shape[:-2], 3, 3))
        strain[..., :d, :d] = 0.5 * (gradient + np.swapaxes(gradient, -1, -2))
        lame, shear = self.lame
        trace = np.trace(strain, axis1=-2, axis2=-1)
        return lame * trace[..., None, None] * np.eye(3) + 2 * shear * strain


@dataclass(frozen=True)
class Column:
    """Fill on rock between smooth sides, both elastic; height z counts from the held foot, m.

    The rock bore `rock_weight` N/m3 from `top` down in virgin state (the part above `joint` has been replaced by fill
    of weight `fill_weight`, which was without stress when placed). Only vertical strain, so
    rock  changes by d = (rock_weight - fill_weight) (top - joint) everywhere:  u = d z / M
    fill  bears s = -fill_weight (top - z), M u' = s:
          u = u(joint) - fill_weight (z - joint) (top - (z + joint) / 2) / M
    with M the confined moduli.
    """

    rock: Elastic
    fill: Elastic
    rock_weight: float
    fill_weight: float
    joint: float
    top: float

    @property
    def change(self) -> float:
        """Change of vertical stress in the rock, Pa."""
        return (self.rock_weight - self.fill_weight) * (self.top - self.joint)

    def displacement(self, z: np.ndarray) -> np.ndarray:
        """Vertical displacement at heights z, m."""
        above = np.maximum(z - self.joint, 0.0)
        settled = -self.fill_weight * above * (self.top - self.joint - 0.5 * above)
        return (
            self.change * np.minimum(z, self.joint) / self.rock.confined_modulus + settled / self.fill.confined_modulus
        )

    def fill_stress(self, z: np.ndarray) -> np.ndarray:
        """Vertical stress in the fill, Pa; lateral ones are `fill.confined_ratio` times it."""
        return -self.fill_weight * (self.top - z)


@dataclass(frozen=True)
class Smooth:
    """u_i = sin(k_i . x + p_i): waves k (d, d) 1/m, phases p (d,). Body force -div sigma in closed form.

    With t_j = k_j . x + p_j:  div u = sum_j k_jj cos t_j,
    b_i = (lambda + mu) sum_j k_jj k_ji sin t_j + mu |k_i|^2 sin t_i   (Navier's equation).
    """

    waves: np.ndarray
    phases: np.ndarray

    def _angles(self, x: np.ndarray) -> np.ndarray:
        return np.sum(x[:, None, :] * self.waves, axis=2) + self.phases

    def displacement(self, x: np.ndarray) -> np.ndarray:
        """u (n, d) at points (n, d)."""
        return np.sin(self._angles(x))

    def gradient(self, x: np.ndarray) -> np.ndarray:
        """du_i/dx_j (n, d, d)."""
        return np.cos(self._angles(x))[:, :, None] * self.waves

    def body_force(self, x: np.ndarray, rock: Elastic) -> np.ndarray:
        """b (n, d) N/m3 for which u is in equilibrium."""
        lame, shear = rock.lame
        sine = np.sin(self._angles(x))
        dilated = np.diagonal(self.waves) * sine
        gradient_of_dilation = np.sum(dilated[:, :, None] * self.waves, axis=1)
        return (lame + shear) * gradient_of_dilation + shear * np.sum(self.waves**2, axis=1) * sine
