"""Potency and moment tensors of seismic sources: size, magnitude, principal axes and source shares, defined once.

x east, y north, z up. Opening is positive: the P axis, the most compressive one, belongs to the smallest principal
value (departures.md, correction 5), T to the largest, B to the one between.
"""

import numpy as np
from numpy.typing import NDArray

# Largest vertical component of a horizontal unit vector. It is far above round-off and far below any measured angle.
MAX_HORIZONTAL_COMPONENT = 1e-9
# Principal values that differ by less than this share of the largest leave their axes to chance.
MIN_PRINCIPAL_GAP = 0.1
MAX_PRINCIPAL_TIE = 1e-9  # Principal values that differ by at most this share of the largest are equal.
DOWN_NORTH_EAST = np.array([[0.0, 0.0, -1.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]])


def moment_from_potency(potency: NDArray, lame_lambda: NDArray | float, shear_modulus: NDArray | float) -> NDArray:
    """Moment tensors M_ij = lambda tr(P) delta_ij + 2 mu P_ij, N m, of potency tensors (..., 3, 3) m3.

    lame_lambda, shear_modulus: Pa, of all rock or (...) of each source's own.
    """
    trace = lame_lambda * np.trace(potency, axis1=-2, axis2=-1)
    return trace[..., None, None] * np.eye(3) + 2.0 * np.asarray(shear_modulus)[..., None, None] * np.asarray(potency)


def potency_from_moment(moment: NDArray, lame_lambda: float, shear_modulus: float) -> NDArray:
    """Potency tensors (..., 3, 3) m3 of moment tensors N m: the inverse of moment_from_potency."""
    trace = np.trace(moment, axis1=-2, axis2=-1) / (3.0 * lame_lambda + 2.0 * shear_modulus)
    return (np.asarray(moment) - lame_lambda * trace[..., None, None] * np.eye(3)) / (2.0 * shear_modulus)


def scalar_potency(tensor: NDArray) -> NDArray:
    """Scalar potency sqrt(2 P_ij P_ij), m3, of tensors (..., 3, 3): slip times area for shear."""
    return np.sqrt(2.0 * np.sum(np.square(tensor), axis=(-2, -1)))


def scalar_moment(moment: NDArray) -> NDArray:
    """Scalar moment M0 = sqrt(M_ij M_ij / 2), N m, of moment tensors (..., 3, 3) (Silver and Jordan 1982)."""
    return np.sqrt(0.5 * np.sum(np.square(moment), axis=(-2, -1)))


def moment_magnitude(scalar: NDArray) -> NDArray:
    """Mw = 2/3 (log10 M0 - 9.1), M0 in N m (Hanks and Kanamori 1979, IASPEI constant); -inf for no moment.

    >>> round(float(moment_magnitude(1e12)), 2)
    1.93
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        return 2.0 / 3.0 * (np.log10(scalar) - 9.1)


def moment_of_magnitude(magnitude: NDArray) -> NDArray:
    """Scalar moment, N m, of moment magnitudes: the inverse of moment_magnitude; infinite beyond all numbers."""
    with np.errstate(over="ignore"):
        return 10.0 ** (1.5 * np.asarray(magnitude) + 9.1)


def principal_axes(tensor: NDArray) -> NDArray:
    """Principal axes (..., 3, 3), rows P, B, T, of symmetric tensors (..., 3, 3): unit vectors, see point_down.

    Where two principal values are equal to MAX_PRINCIPAL_TIE of the largest, as of rock that has merely opened, any two
    axes of their plane would do. Given are its steepest line, then its level one (of a level plane north, then east);
    where all three are equal: down, north, east. So neither round-off nor a library decides.
    """
    values, vectors = np.linalg.eigh(np.asarray(tensor, float))
    axes = np.swapaxes(vectors, -1, -2)
    tied = np.diff(values, axis=-1) <= MAX_PRINCIPAL_TIE * np.max(np.abs(values), axis=-1, keepdims=True)
    for row, across in ((0, 2), (1, 0)):  # P and B lie across T, B and T across P
        normal = axes[tied[..., row], across]
        level = np.stack([-normal[:, 1], normal[:, 0], np.zeros(len(normal))], axis=-1)
        length = np.linalg.norm(level, axis=-1, keepdims=True)
        level = np.where(
            length > MAX_HORIZONTAL_COMPONENT, level / np.maximum(length, MAX_HORIZONTAL_COMPONENT), [1.0, 0.0, 0.0]
        )
        axes[tied[..., row], row] = np.cross(level, normal)
        axes[tied[..., row], row + 1] = level
    axes[tied.all(axis=-1)] = DOWN_NORTH_EAST
    return point_down(axes)


def clear_axes(tensor: NDArray) -> NDArray:
    """Principal axes (..., 3, 3), rows P, B, T, NaN where the principal value is within MIN_PRINCIPAL_GAP of another.

    A crack that opens has a T axis, and any two lines across it are as good a P and B axis: none is given.
    """
    axes = principal_axes(tensor)
    values = np.linalg.eigvalsh(np.asarray(tensor, float))
    near = np.diff(values, axis=-1) <= MIN_PRINCIPAL_GAP * np.max(
        np.abs(values), axis=-1, keepdims=True
    )  # P to B, B to T
    unclear = np.stack([near[..., 0], near[..., 0] | near[..., 1], near[..., 1]], axis=-1)
    return np.where(unclear[..., None], np.nan, axes)


def point_down(axes: NDArray) -> NDArray:
    """Unit axes (..., 3), reversed where they point up, as all files have them: an axis and its opposite are one.

    Down: z < 0. Within MAX_HORIZONTAL_COMPONENT of the horizontal z is 0, and the axis points north: y > 0. One that
    runs east and west within the same points east: x > 0. So round-off does not decide.
    """
    axes = np.asarray(axes, float)
    x, y, z = (np.where(np.abs(axes[..., row]) <= MAX_HORIZONTAL_COMPONENT, 0.0, axes[..., row]) for row in range(3))
    opposite = (z > 0) | ((z == 0) & ((y < 0) | ((y == 0) & (x < 0))))
    axes = np.where(opposite[..., None], -axes, axes)
    axes[..., 2] = np.where(z == 0, 0.0, axes[..., 2])
    return axes + 0.0  # no negative zeros


def source_shares(tensor: NDArray) -> NDArray:
    """Isotropic, CLVD and double-couple share (..., 3) of tensors (..., 3, 3); absolutes sum to 1 (Vavrycuk 2015).

    ISO = tr / 3, CLVD = 2/3 (m1 + m3 - 2 m2), DC = 1/2 (m1 - m3 - |m1 + m3 - 2 m2|), m1 >= m2 >= m3, over the sum of
    their absolutes. ISO and CLVD carry a sign, DC does not. A tensor that is zero has shares NaN.

    Slip along a plane, and a crack that opens in rock with Poisson's ratio 0.25:

    >>> source_shares([[0, 0, 1], [0, 0, 0], [1, 0, 0]]).round(3).tolist()
    [0.0, 0.0, 1.0]
    >>> source_shares(np.diag([1, 1, 3])).round(3).tolist()
    [0.556, 0.444, 0.0]
    """
    m3, m2, m1 = np.moveaxis(np.linalg.eigvalsh(np.asarray(tensor, float)), -1, 0)
    bend = m1 + m3 - 2.0 * m2
    # 1/2 (m1 - m3 - |bend|) is min(m1 - m2, m2 - m3): negative by round-off only
    double_couple = np.maximum(0.5 * (m1 - m3 - np.abs(bend)), 0.0)
    parts = np.stack([(m1 + m2 + m3) / 3.0, 2.0 / 3.0 * bend, double_couple], axis=-1)
    with np.errstate(invalid="ignore"):
        return parts / np.sum(np.abs(parts), axis=-1, keepdims=True)


def shear_iso_share(dilation_angle: float) -> tuple[float, float]:
    """Smallest and largest isotropic share of shear flow with a dilation angle, degrees (Coulomb, Hoek-Brown).

    Flow on a face has principal strains (N, 0, -1), N = (1 + sin psi) / (1 - sin psi): tr / 3 = (N - 1) / 3 over a sum
    of sizes of N, a share of (N - 1) / (3 N) = 2 sin psi / (3 (1 + sin psi)). It is the same on the edge at which the
    two larger compressions are equal, (N, -t, t - 1). On the other edge, (N (1 - t), N t, -1), the sum of sizes falls
    to (2 N + 1) / 3, and the share grows to (N - 1) / (2 N + 1) = 2 sin psi / (3 + sin psi). A sum of such tensors may
    have more: traces add up, and deviators that differ cancel in part.
    """
    sine = np.sin(np.radians(dilation_angle))
    return float(2.0 * sine / (3.0 * (1.0 + sine))), float(2.0 * sine / (3.0 + sine))
