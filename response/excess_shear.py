"""Excess shear stress on planes (Ryder 1988, J. South. Afr. Inst. Min. Metall. 88, 27): what shear stress exceeds
dynamic friction by. Where it is above 0, a plane that has begun to slip goes on."""

import json
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from catalogs.sources.section_planes import Plane
from common.voigt import tensor_from_voigt
from response.field import fitted_stress
from response.loading_settings import ShearPlane
from response.rock import FAILED, INTACT, Rock

MAX_POINTS = 10_000  # Of the part of a plane that counts.


def excess_shear_stress(stress: NDArray, normal: NDArray, friction_angle: float) -> NDArray:
    """Excess shear stress (n,) Pa of stresses (n, 6) on planes with a unit normal (3,): |shear| less tan(friction)
    times normal compression, which is 0 in tension.

    >>> compression = np.array([[-10e6, -30e6, 0, 0, 0, 0]])  # 20 MPa on planes at 45 degrees between both, 10 in shear
    >>> (excess_shear_stress(compression, np.array([1.0, 1.0, 0.0]) / np.sqrt(2.0), 0.0) / 1e6).round(6)
    array([10.])
    """
    traction = tensor_from_voigt(stress) @ normal
    along = traction @ normal
    shear = np.linalg.norm(traction - along[:, None] * normal, axis=1)
    return shear - np.tan(np.radians(friction_angle)) * np.maximum(-along, 0.0)


@dataclass(frozen=True)
class OnPlane:
    """Excess shear stress of a plane, Pa; NaN where it has no rock. at_point; largest, and its place (3,) m; mean, area
    (m2) and volume (m3): of what is above 0, of which a plane has an area and rock with weak planes a volume."""

    at_point: float
    largest: float
    place: NDArray
    mean: float
    area: float
    volume: float


def find_excess(rock: Rock, plane: ShearPlane, friction_angle: float) -> OnPlane:
    """Excess shear stress on a plane after a step."""
    if plane.material is not None:
        return _of_material(rock, plane.material, friction_angle)
    own = Plane.of(plane.point, plane.strike, plane.dip)
    offsets, area = disc_points(plane.radius, rock.edge)
    points = own.places(offsets)
    what, particle = rock.what(points)
    there = np.flatnonzero(((what == INTACT) | (what == FAILED)) & (particle >= 0))  # no particle: rock that has fallen
    found = np.full(len(points), np.nan)
    if len(there):
        stress, _ = fitted_stress(rock, points[there], particle[there])
        found[there] = excess_shear_stress(stress, own.toward, friction_angle)
    return _summary(found, points, np.full(len(points), area), at_point=float(found[0]), is_area=True)


def disc_points(radius: float | None, cell: float) -> tuple[NDArray, float]:
    """Points (n, 2) m of a disc, half of a cell or more apart, the middle first; and the area (m2) of each."""
    if radius is None:
        return np.zeros((1, 2)), np.nan
    spacing = max(0.5 * cell, radius * np.sqrt(np.pi / MAX_POINTS))
    count = int(radius / spacing)
    offsets = spacing * np.stack(np.meshgrid(*2 * (np.arange(-count, count + 1),)), axis=-1).reshape(-1, 2)
    distance = np.linalg.norm(offsets, axis=1)
    offsets = offsets[np.argsort(distance, kind="stable")][: np.count_nonzero(distance <= radius * (1.0 + 1e-9))]
    return offsets, np.pi * radius**2 / len(offsets)


def _of_material(rock: Rock, name: str, friction_angle: float) -> OnPlane:
    """Excess shear stress on the weak planes of all rock of a material."""
    state = rock.state
    names, normals = json.loads(state.attrs["material_names"]), json.loads(state.attrs.get("plane_normals", "{}"))
    is_own = (state["volume"].values > 0.0) & (state["excavation"].values < 0)
    own = np.flatnonzero(is_own & (state["material"].values == (names.index(name) if name in normals else -1)))
    stress, volume = state["stress"].values[own], state["volume"].values[own]
    found = excess_shear_stress(stress, np.array(normals.get(name, [0.0, 0.0, 1.0])), friction_angle)
    return _summary(found, state["position"].values[own], volume, at_point=np.nan, is_area=False)


def _summary(found: NDArray, place: NDArray, size: NDArray, at_point: float, is_area: bool) -> OnPlane:
    """Of excess shear stresses (n,) Pa at places (n, 3) m that stand for sizes (n,), m2 or m3."""
    known = np.isfinite(found)
    if not known.any():
        return OnPlane(at_point, np.nan, np.full(3, np.nan), np.nan, np.nan, np.nan)
    above = known & (found > 0.0)
    total = float(size[above].sum()) if np.isfinite(size).all() else np.nan
    mean = float(np.average(found[above], weights=size[above])) if total > 0.0 else np.nan
    first = int(np.nanargmax(found))
    return OnPlane(
        at_point, float(found[first]), place[first], mean, total if is_area else np.nan, np.nan if is_area else total
    )
