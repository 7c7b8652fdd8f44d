"""Slip on a flaw: the potency of a penny-shaped crack, and the stress that it adds around it.

A flaw is a point source, a double couple in an infinite elastic body (Kelvin's solution), smeared over its size by a
normal distribution. So stress is finite everywhere, and falls with the cube of distance as that of a point source
(docs/explanation/baselines.md). Stress is tension positive and in voigt order (common.voigt).
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import gamma, gammainc

from common.voigt import tensor_from_voigt, voigt_from_tensor

MIN_STRESS_SHARE = 0.01  # A source reaches as far as it adds this share of its stress drop or more.
ORDERS = 5  # Boys functions that the fourth derivatives of distance need.
MIN_ARGUMENT = 1e-12  # Boys functions of smaller arguments are those of 0.


def crack_factor(poisson_ratio: ArrayLike) -> NDArray:
    """Potency over stress drop / G * a^3 of a penny-shaped crack that slips in shear: 16 (1 - nu) / (3 (2 - nu))."""
    ratio = np.asarray(poisson_ratio, float)
    return 16.0 * (1.0 - ratio) / (3.0 * (2.0 - ratio))


def slip_tensor(normal: NDArray, direction: NDArray) -> NDArray:
    """(s_i n_j + s_j n_i) / 2 (..., 3, 3) of unit normals and unit directions of slip (..., 3)."""
    product = direction[..., :, None] * normal[..., None, :]
    return 0.5 * (product + np.swapaxes(product, -1, -2))


def traction(stress: NDArray, normal: NDArray) -> NDArray:
    """Traction (n, 3), Pa, of stresses (n, 6) on planes with unit normals (n, 3)."""
    return np.einsum("nij,nj->ni", tensor_from_voigt(stress), normal)


def smearing(poisson_ratio: ArrayLike) -> NDArray:
    """Standard deviation along each axis, over the radius of a crack, of the normal distribution that smears it.

    With it the stress that a crack takes off its own plane, averaged with the same weights, is its stress drop. Shear
    stress in smeared slip is (7 - 5 nu) / (15 (1 - nu)) of G times slip per volume (Eshelby 1957).
    """
    ratio = np.asarray(poisson_ratio, float)
    own = crack_factor(ratio) * (7.0 - 5.0 * ratio) / (15.0 * (1.0 - ratio))
    return np.cbrt(own) / np.sqrt(4.0 * np.pi)


def reach(radius: ArrayLike, poisson_ratio: ArrayLike) -> NDArray:
    """Distance, m, beyond which slip on a crack adds less than MIN_STRESS_SHARE of its stress drop to any component.

    The largest is normal stress along the P and T axes, G P (5 - nu) / (4 pi (1 - nu) r^3).
    """
    ratio = np.asarray(poisson_ratio, float)
    largest = (5.0 - ratio) / (4.0 * np.pi * (1.0 - ratio)) * crack_factor(ratio)
    return np.asarray(radius) * np.cbrt(largest / MIN_STRESS_SHARE)


def boys(argument: NDArray) -> list[NDArray]:
    """Boys functions F_0 to F_4 (n,) of arguments (n,), F_k(T) = integral of t^2k exp(-T t^2) from 0 to 1."""
    last = ORDERS - 0.5
    safe = np.maximum(argument, MIN_ARGUMENT)
    highest = np.where(argument > MIN_ARGUMENT, gamma(last) * gammainc(last, safe) / (2.0 * safe**last), 0.5 / last)
    functions, falling = [highest], np.exp(-argument)
    for order in reversed(range(ORDERS - 1)):
        functions.insert(0, (2.0 * argument * functions[0] + falling) / (2 * order + 1))
    return functions


def source_stress(
    offset: NDArray, potency: NDArray, shear_modulus: float, poisson_ratio: float, width: NDArray
) -> NDArray:
    """Stress (place, 6), Pa, that a smeared source without volume change adds in an infinite elastic body.

    offset (place, 3): from its centre, m; potency (3, 3): its potency tensor, m3; width (place,): standard deviation
    along each axis, m, of the normal distribution that smears source and place together. Derivatives of the smeared
    distance psi and of phi, the smeared 1 / distance, follow from each other: the operator (1 / r) d/dr lowers phi from
    F_k to F_k+1, and psi's is F_k - F_k+1.
    """
    square = np.sum(offset**2, axis=1)
    inverse = 1.0 / width**2
    functions = boys(0.5 * square * inverse)
    scale = np.sqrt(2.0 / np.pi) / width
    phi_1, phi_2 = -scale * inverse * functions[1], scale * inverse**2 * functions[2]
    psi_2, psi_3, psi_4 = (
        scale * (-inverse) ** order * (functions[order] - functions[order + 1]) for order in (1, 2, 3)
    )
    bend = 0.5 / (1.0 - poisson_ratio)
    along = offset @ potency
    across = np.sum(along * offset, axis=1)
    pair = offset[:, :, None] * along[:, None, :]
    # -4 pi times the strain, its trace, and 4 pi times the slip per volume
    strain = (
        _each(2.0 * (phi_1 - bend * psi_2)) * potency
        + _each(phi_2 - 2.0 * bend * psi_3) * (pair + np.swapaxes(pair, 1, 2))
        - _each(bend * psi_3 * across) * np.eye(3)
        - _each(bend * psi_4 * across) * offset[:, :, None] * offset[:, None, :]
    )
    trace = 2.0 * (1.0 - bend) * phi_2 * across
    slip = scale * inverse * np.exp(-0.5 * square * inverse)
    stress = 2.0 * (strain + _each(slip) * potency)
    stress += _each(2.0 * poisson_ratio / (1.0 - 2.0 * poisson_ratio) * trace) * np.eye(3)
    return voigt_from_tensor(-shear_modulus / (4.0 * np.pi) * stress)


def _each(values: NDArray) -> NDArray:
    """Values (place,) as factors of tensors (place, 3, 3)."""
    return values[:, None, None]
