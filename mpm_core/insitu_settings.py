"""The section `insitu_stress` of a mine file: components, or principal stresses with trend and plunge."""

from itertools import combinations
from typing import Annotated, Generic, Self, TypeVar

import numpy as np
from numpy.typing import NDArray
from pydantic import model_validator

from common.setting_types import Settings, Unit, refusal
from common.voigt import NAMES, voigt_from_tensor

MAX_AXIS_ERROR = 3.0  # Degrees by which two axes may miss the right angle: measured ones are rounded.
Stress = Annotated[float, Unit("Pa", ge=-1e13, le=1e13)]
Gradient = Annotated[float, Unit("Pa/m", ge=-1e12, le=1e12)]
Quantity = TypeVar("Quantity")


class SymmetricTensor(Settings, Generic[Quantity]):
    """The six components of a symmetric tensor. Components that are not given are zero."""

    xx: Quantity = None
    yy: Quantity = None
    zz: Quantity = None
    yz: Quantity = None
    xz: Quantity = None
    xy: Quantity = None

    def voigt(self) -> list[float]:
        """The components in the order of common.voigt; zero where they are not given."""
        return [getattr(self, name) or 0.0 for name in NAMES]


class StressComponents(SymmetricTensor[Stress]):
    """Components of the stress at frame.surface along x, y and z of the mine file, tension positive. Components that
    are not given are zero."""


class GradientComponents(SymmetricTensor[Gradient]):
    """Change of the components per metre of depth below frame.surface. Compression is negative."""


class PrincipalStress(Settings):
    """A principal stress and its axis. One of the three may leave its axis out: it is at right angles to the others."""

    trend: Annotated[float, Unit("deg", ge=-360, le=360)] = None
    """Direction of the axis in plan, clockwise from the map's north. A vertical axis needs none."""
    plunge: Annotated[float, Unit("deg", ge=-90, le=90)] = None
    """Angle of the axis below the horizontal, in the direction of its trend. 90 deg: the axis is vertical."""
    constant: Stress = None
    """Stress along the axis at frame.surface. Compression is negative. Default: zero."""
    gradient: Gradient = None
    """Its change per metre of depth below frame.surface. Compression is negative. Default: zero."""

    @model_validator(mode="after")
    def _whole(self) -> Self:
        if self.constant is None and self.gradient is None:
            raise refusal("has no size; give constant, gradient or both")
        if self.trend is not None and self.plunge is None:
            raise refusal("missing; give 0 deg for a horizontal axis", "plunge")
        if self.plunge is not None and abs(self.plunge) != 90 and self.trend is None:
            raise refusal("missing; an axis that is not vertical needs one", "trend")
        return self

    @property
    def axis(self) -> NDArray | None:
        """Unit vector along the axis (3,), x east, y north, z up; None where it follows from the other axes."""
        if self.plunge is None:
            return None
        trend, plunge = np.radians(self.trend or 0.0), np.radians(self.plunge)
        return np.array([np.sin(trend) * np.cos(plunge), np.cos(trend) * np.cos(plunge), -np.sin(plunge)])


class PrincipalStresses(Settings):
    """The three principal stresses. Their axes are the same at all depths, and at right angles to each other within 3
    degrees. Which one is the largest does not matter, and may change with depth."""

    sigma_1: PrincipalStress
    """A principal stress."""
    sigma_2: PrincipalStress
    """The second one."""
    sigma_3: PrincipalStress
    """The third one."""

    @property
    def _each(self) -> dict[str, PrincipalStress]:
        return {name: getattr(self, name) for name in PrincipalStresses.model_fields}

    @model_validator(mode="after")
    def _right_angles(self) -> Self:
        axes = {name: one.axis for name, one in self._each.items() if one.axis is not None}
        without = [name for name in self._each if name not in axes]
        if len(without) > 1:
            raise refusal(f"give trend and plunge, as of two of the three at least; {without[0]} has none", without[1])
        for first, second in combinations(axes, 2):
            angle = np.degrees(np.arccos(np.clip(abs(axes[first] @ axes[second]), 0.0, 1.0)))
            if 90.0 - angle > MAX_AXIS_ERROR:
                raise refusal(
                    f"its axis and that of {first} are {angle:.1f} degrees apart; principal axes are at right angles, "
                    f"within {MAX_AXIS_ERROR:g} degrees: check trend (clockwise from north) and plunge (downwards)",
                    second,
                )
        return self

    def axes(self) -> NDArray:
        """Unit vectors along the axes (3, 3), a row each: the right angles that are nearest to those given."""
        given = [one.axis for one in self._each.values()]
        known = [axis for axis in given if axis is not None]
        left, _, right = np.linalg.svd([np.cross(known[0], known[1]) if axis is None else axis for axis in given])
        return left @ right

    def voigt(self, name: str) -> list[float]:
        """Six components of `constant` (Pa) or `gradient` (Pa/m), in the order of common.voigt."""
        sizes = np.array([getattr(one, name) or 0.0 for one in self._each.values()])
        axes = self.axes()
        return voigt_from_tensor((axes.T * sizes) @ axes).tolist()


class InsituSettings(Settings):
    """Stress before mining: constant + gradient x depth below frame.surface, by components or by principal stresses."""

    constant: StressComponents = None
    gradient: GradientComponents = None
    principal: PrincipalStresses = None

    @model_validator(mode="after")
    def _one_kind(self) -> Self:
        if self.principal is None and self.constant is None:
            raise refusal("missing key", "constant")
        if self.principal is not None and (self.constant or self.gradient):
            raise refusal("stands beside components; give the stress in one of the two forms", "principal")
        return self

    def voigt(self, name: str) -> list[float]:
        """Six components of `constant` (Pa) or `gradient` (Pa/m), in the order of common.voigt."""
        if self.principal is not None:
            return self.principal.voigt(name)
        part: StressComponents | GradientComponents | None = getattr(self, name)
        return part.voigt() if part is not None else [0.0] * len(NAMES)
