"""Stiffness by particle: what bounds the explicit scheme's time step, and what hourglass stiffness is in proportion to.

equilibrium/body.py says how the time step follows.
"""

import numpy as np

from mpm_core.model.particles import Particles, shapes_of

# The hourglass stiffness counts lambda up to this multiple of mu, its value at Poisson's ratio 0.45. All of lambda
# would hold the bending that nearly incompressible rock needs to move.
MAX_HOURGLASS_LAME = 9.0


def hourglass_modulus(lame: np.ndarray, shear: np.ndarray) -> np.ndarray:
    """What hourglass stiffness is in proportion to, Pa: lambda + 2 mu (k,), Pa, but for MAX_HOURGLASS_LAME."""
    return np.minimum(lame, MAX_HOURGLASS_LAME * shear) + 2.0 * shear


def step_stiffness(particles: Particles, elastic_constants: np.ndarray, hourglass: float) -> np.ndarray:
    """Stiffness (particle,) Pa that bounds the time step: that of dilation, more for particles off their cells'
    centres.

    elastic_constants (material, 2) lambda, mu, Pa; hourglass: share kappa of the hourglass stiffness.
    """
    lame, shear = elastic_constants[particles.material].T
    stiffness = particles.xi.shape[1] * lame + 2.0 * shear
    lone = particles.sample >= 0
    stiffness[lone] /= 1.0 - np.abs(particles.xi[lone]).max(axis=1, initial=0.0) ** 2
    own = np.flatnonzero(particles.group_table >= particles.shared_rows)
    first = particles.group_start[own]
    share = hourglass * hourglass_modulus(lame[first], shear[first]) / stiffness[first]
    rows = particles.group_table[own]
    stiffness[first] *= own_stiffening(particles.modes[rows], particles.slopes[rows], share)
    return stiffness


def own_stiffening(modes: np.ndarray, slopes: np.ndarray, hourglass: np.ndarray) -> np.ndarray:
    """By what the square of a lone particle's largest frequency may exceed that of one at its cell's centre, (k,).

    The particle's shape functions N and gradients g are means over samples, of modes (k, 2^d) and slopes (k, 2^d, d).
    Its strain adds at most the largest eigenvalue of sum g g^T / N over the corners, which is 4 / h^2 at the centre.
    Its hourglass stiffness acts on all corners alike, and adds the share `hourglass` (k,) of that times the largest
    eigenvalue of sum s s^T / N, with the signs s of the hourglass modes, over its value at the centre: off the centre
    the patterns of both overlap.
    """
    shape, slope = shapes_of(modes, slopes)
    bits = np.arange(modes.shape[1])
    signs = (-1.0) ** np.bitwise_count(~bits[:, None] & bits[np.bitwise_count(bits) > 1])  # (corner, mode)
    strain = np.einsum("kci,kcj,kc->kij", slope, slope, 1.0 / shape)
    patterns = np.einsum("ci,cj,kc->kij", signs, signs, 1.0 / shape) / len(bits) ** 2
    if not len(modes):
        return np.empty(0)
    return np.linalg.eigvalsh(strain)[:, -1] + hourglass * np.linalg.eigvalsh(patterns)[:, -1]
