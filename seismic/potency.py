"""Potency and moment tensors of seismic sources, and what is read from them.

Tension (opening) is positive: the P axis, the most compressive one, belongs to the smallest eigenvalue.
Voigt order xx, yy, zz, yz, xz, xy, with tensor (not engineering) shear.
"""

import numpy as np
from numpy.typing import NDArray

VOIGT = ("xx", "yy", "zz", "yz", "xz", "xy")
ROW = np.array([0, 1, 2, 1, 0, 0])
COLUMN = np.array([0, 1, 2, 2, 2, 1])
VOIGT_INDEX = np.array([[0, 5, 4], [5, 1, 3], [4, 3, 2]])


def tensor_from_voigt(voigt: NDArray) -> NDArray:
    """Symmetric tensors (..., 3, 3) of six components (..., 6) with tensor shear."""
    return np.asarray(voigt)[..., VOIGT_INDEX]


def voigt_from_tensor(tensor: NDArray) -> NDArray:
    """Six components (..., 6) of symmetric tensors (..., 3, 3)."""
    return np.asarray(tensor)[..., ROW, COLUMN]


def particle_potency(seismic_strain: NDArray, volume: NDArray, seismic_fraction: float) -> NDArray:
    """Potency of each failed particle, alpha * strain * V (paper Eqs 12 and 14).

    seismic_strain (particle, 6) 1, tensor shear; volume (particle,) m3, in two dimensions area times thickness;
    seismic_fraction alpha, 0 to 1. Gives (particle, 6) m3.
    """
    return seismic_fraction * (np.asarray(seismic_strain) * np.asarray(volume)[:, None])


def scalar_potency(tensor: NDArray) -> NDArray:
    """Scalar potency sqrt(2 P_ij P_ij), m3, of tensors (..., 3, 3): slip times area for shear (errata 4)."""
    return np.sqrt(2.0 * np.sum(np.square(tensor), axis=(-2, -1)))


def moment_tensor(tensor: NDArray, lame_lambda: float, shear_modulus: float) -> NDArray:
    """Moment tensors M_ij = lambda tr(P) delta_ij + 2 mu P_ij, N m, of potency tensors (..., 3, 3) m3; moduli in Pa."""
    trace = np.trace(tensor, axis1=-2, axis2=-1)
    return lame_lambda * trace[..., None, None] * np.eye(3) + 2.0 * shear_modulus * np.asarray(tensor)


def scalar_moment(moment: NDArray) -> NDArray:
    """Scalar moment M0 = sqrt(M_ij M_ij / 2), N m, of moment tensors (..., 3, 3) (Silver and Jordan 1982)."""
    return np.sqrt(0.5 * np.sum(np.square(moment), axis=(-2, -1)))


def moment_magnitude(scalar: NDArray) -> NDArray:
    """Mw = 2/3 (log10 M0 - 9.1), M0 in N m (Hanks and Kanamori 1979, IASPEI constant); -inf for no moment."""
    with np.errstate(divide="ignore"):
        return 2.0 / 3.0 * (np.log10(scalar) - 9.1)


def principal_axes(tensor: NDArray) -> tuple[NDArray, NDArray, NDArray]:
    """P, B and T axes (..., 3) of tensors (..., 3, 3): unit eigenvectors, smallest eigenvalue first.

    An axis has no sense of direction; it is given pointing down (then south, then west), so that it is unique.
    """
    tensor = np.asarray(tensor)
    size = np.max(np.abs(tensor), axis=(-2, -1), keepdims=True)
    vectors = np.linalg.eigh(tensor / np.where(size > 0.0, size, 1.0)).eigenvectors
    axes = np.swapaxes(vectors, -1, -2)  # (..., axis, xyz)
    x, y, z = axes[..., 0], axes[..., 1], axes[..., 2]
    upward = (z > 0) | ((z == 0) & (y > 0)) | ((z == 0) & (y == 0) & (x > 0))
    axes = np.where(upward[..., None], -axes, axes) + 0.0  # no negative zeros
    return axes[..., 0, :], axes[..., 1, :], axes[..., 2, :]


def source_type(tensor: NDArray) -> tuple[NDArray, NDArray, NDArray]:
    """Isotropic, CLVD and double-couple shares of tensors (..., 3, 3), sum of absolutes 1 (Vavrycuk 2015).

    ISO = tr / 3, CLVD = 2/3 (m1 + m3 - 2 m2), DC = 1/2 (m1 - m3 - |m1 + m3 - 2 m2|), m1 >= m2 >= m3, over the sum of
    their absolutes. ISO and CLVD carry a sign, DC does not. A tensor that is zero has shares NaN.
    """
    m3, m2, m1 = np.moveaxis(np.linalg.eigvalsh(tensor), -1, 0)
    bend = m1 + m3 - 2.0 * m2
    parts = np.stack([(m1 + m2 + m3) / 3.0, 2.0 / 3.0 * bend, 0.5 * (m1 - m3 - np.abs(bend))])
    parts[2] = np.maximum(parts[2], 0.0)  # 1/2 (m1 - m3 - |bend|) is min(m1 - m2, m2 - m3): negative by round-off only
    with np.errstate(invalid="ignore"):
        iso, clvd, double_couple = parts / np.sum(np.abs(parts), axis=0)
    return iso, clvd, double_couple
