"""Two laws in one scene, as one law: each row says first which of the two it is of.

So the code that uses a law need not know how many a scene has, particles keep their order, and what comes out depends
neither on threads nor on which laws others have.
"""

import sys
from types import ModuleType
from typing import Any

import numpy as np
from numba import njit

from mpm_core.constitutive.general import lane_by_lane, lane_sum
from mpm_core.simd.lanes import LANES

FIRST, SECOND = 0.0, 1.0  # number at the beginning of a row


def mix(first: ModuleType, second: ModuleType) -> ModuleType:
    """A law (see laws/__init__.py: its kernels) of two, of which the first may be such a mixture itself.

    row_of(law, row): the mixture's row, (ROW_LENGTH,), of a row of one of its laws.
    """
    name = f"{first.__name__}+{second.__name__.rpartition('.')[2]}"
    if name in sys.modules:
        return sys.modules[name]
    end_1, end_2 = 1 + first.ROW_LENGTH, 1 + second.ROW_LENGTH
    mixture = ModuleType(name, f"{first.NAME} and {second.NAME}")
    vars(mixture).update(NAME=f"{first.NAME}+{second.NAME}", ROW_LENGTH=max(end_1, end_2))

    def row_of(law, row):
        which = SECOND if law is second else FIRST
        inner = row if law in (first, second) else first.row_of(law, row)
        return np.concatenate([[which], inner, np.zeros(mixture.ROW_LENGTH - 1 - len(inner))])

    @njit(error_model="numpy")
    def surely_admissible(xx, yy, zz, yz, xz, xy, row):
        if row[0] == FIRST:
            return first.surely_admissible(xx, yy, zz, yz, xz, xy, row[1:end_1])
        return second.surely_admissible(xx, yy, zz, yz, xz, xy, row[1:end_2])

    @njit(error_model="numpy")
    def overstress(xx, yy, zz, yz, xz, xy, row):
        if row[0] == FIRST:
            return first.overstress(xx, yy, zz, yz, xz, xy, row[1:end_1])
        return second.overstress(xx, yy, zz, yz, xz, xy, row[1:end_2])

    @njit(error_model="numpy")
    def strength_factor(xx, yy, zz, yz, xz, xy, row):
        if row[0] == FIRST:
            return first.strength_factor(xx, yy, zz, yz, xz, xy, row[1:end_1])
        return second.strength_factor(xx, yy, zz, yz, xz, xy, row[1:end_2])

    @njit(error_model="numpy")
    def excess_shear_stress(xx, yy, zz, yz, xz, xy, row):
        if row[0] == FIRST:
            return first.excess_shear_stress(xx, yy, zz, yz, xz, xy, row[1:end_1])
        return second.excess_shear_stress(xx, yy, zz, yz, xz, xy, row[1:end_2])

    @njit(error_model="numpy")
    def return_to_surface(xx, yy, zz, yz, xz, xy, lame_lambda, shear_modulus, row):
        if row[0] == FIRST:
            return first.return_to_surface(xx, yy, zz, yz, xz, xy, lame_lambda, shear_modulus, row[1:end_1])
        return second.return_to_surface(xx, yy, zz, yz, xz, xy, lame_lambda, shear_modulus, row[1:end_2])

    one_by_one = lane_by_lane(return_to_surface)

    @njit(error_model="numpy")
    def return_lanes(xx, yy, zz, yz, xz, xy, lame_lambda, shear_modulus, row):
        of_second = lane_sum(row[0])
        if of_second == LANES * FIRST:
            return first.return_lanes(xx, yy, zz, yz, xz, xy, lame_lambda, shear_modulus, row[1:end_1])
        if of_second == LANES * SECOND:
            return second.return_lanes(xx, yy, zz, yz, xz, xy, lame_lambda, shear_modulus, row[1:end_2])
        return one_by_one(xx, yy, zz, yz, xz, xy, lame_lambda, shear_modulus, row)

    @njit(error_model="numpy")
    def stiffness_reduction(xx, yy, zz, yz, xz, xy, lame_lambda, shear_modulus, row, matrix):
        if row[0] == FIRST:
            return first.stiffness_reduction(xx, yy, zz, yz, xz, xy, lame_lambda, shear_modulus, row[1:end_1], matrix)
        return second.stiffness_reduction(xx, yy, zz, yz, xz, xy, lame_lambda, shear_modulus, row[1:end_2], matrix)

    @njit(error_model="numpy")
    def strength_size(row):
        return first.strength_size(row[1:end_1]) if row[0] == FIRST else second.strength_size(row[1:end_2])

    @njit(error_model="numpy")
    def gains_energy(row):
        return first.gains_energy(row[1:end_1]) if row[0] == FIRST else second.gains_energy(row[1:end_2])

    functions: tuple[Any, ...] = (
        row_of, surely_admissible, overstress, strength_factor, excess_shear_stress, return_to_surface, return_lanes,
        stiffness_reduction, strength_size, gains_energy,
    )  # fmt: skip
    for function in functions:
        setattr(mixture, function.__name__, function)
    sys.modules[name] = mixture  # numba keeps what it compiles by this name
    return mixture
