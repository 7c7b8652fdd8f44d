"""A law of failure that only tests know: von Mises, associated, with a residual yield stress. No cut-off.

Its kernels are compiled by numba with those of the package, which find it as a module. The folder of compiled kernels
knows the package's sources only: after a change here remove .numba_cache.
"""

import math
from typing import Annotated, Literal, Self

import numpy as np
from numba import njit
from pydantic import model_validator

from common.setting_types import Settings, Unit, refusal
from mpm_core.constitutive.elastic import ADMISSIBLE_ROUND_OFF, ELASTIC, FACE, STRENGTH_FACTOR_CAP
from mpm_core.constitutive.general import lane_by_lane, tangent_by_differences
from mpm_core.constitutive.principal import split_deviator
from mpm_core.settings import MaterialSettings

NAME = "von_mises"
ROW_LENGTH = 1


class YieldStress(Settings):
    """Of intact rock, and of rock that has failed."""

    intact: Annotated[float, Unit("Pa", gt=0)]
    residual: Annotated[float, Unit("Pa", gt=0)]


class Material(MaterialSettings):
    """Rock that yields at one shear stress."""

    model: Literal["von_mises"]
    yield_stress: YieldStress

    @model_validator(mode="after")
    def _gains_nothing_by_failing(self) -> Self:
        if self.yield_stress.residual > self.yield_stress.intact:
            raise refusal("residual is above intact", "yield_stress")
        return self


def strength_rows(material, axes):
    return np.array([material.yield_stress.intact]), np.array([material.yield_stress.residual])


def overstress_of_tensor(tensor, row):
    deviator = tensor - np.trace(tensor) / 3.0 * np.eye(3)
    return math.sqrt(1.5 * np.sum(deviator**2)) - row[0]


@njit(error_model="numpy")
def shear_size(xx, yy, zz, yz, xz, xy):
    """Von Mises stress, Pa."""
    return math.sqrt(3.0 * split_deviator(xx, yy, zz, yz, xz, xy)[4])


@njit(error_model="numpy")
def surely_admissible(xx, yy, zz, yz, xz, xy, row):
    return False


@njit(error_model="numpy")
def overstress(xx, yy, zz, yz, xz, xy, row):
    return shear_size(xx, yy, zz, yz, xz, xy) - row[0]


@njit(error_model="numpy")
def return_to_surface(xx, yy, zz, yz, xz, xy, lame_lambda, shear_modulus, row):
    size = max(abs(xx), abs(yy), abs(zz), abs(yz), abs(xz), abs(xy))
    mean, dx, dy, dz, j2 = split_deviator(xx, yy, zz, yz, xz, xy)
    if math.sqrt(3.0 * j2) - row[0] <= 10.0 * ADMISSIBLE_ROUND_OFF * size:
        return xx, yy, zz, yz, xz, xy, ELASTIC
    share = row[0] / math.sqrt(3.0 * j2)
    return mean + share * dx, mean + share * dy, mean + share * dz, share * yz, share * xz, share * xy, FACE


return_lanes = lane_by_lane(return_to_surface)
stiffness_reduction = tangent_by_differences(return_to_surface)


@njit(error_model="numpy")
def strength_factor(xx, yy, zz, yz, xz, xy, row):
    return min(STRENGTH_FACTOR_CAP, row[0] / shear_size(xx, yy, zz, yz, xz, xy))


@njit(error_model="numpy")
def excess_shear_stress(xx, yy, zz, yz, xz, xy, row):
    return (shear_size(xx, yy, zz, yz, xz, xy) - row[0]) / math.sqrt(3.0)


@njit(error_model="numpy")
def strength_size(row):
    return row[0]


@njit(error_model="numpy")
def gains_energy(row):
    return False
