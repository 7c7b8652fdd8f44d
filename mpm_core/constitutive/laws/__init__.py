"""Laws of failure. Each is one module here and one entry of LAWS; all other code calls the law.

A law is brittle: intact rock that stands above its strength drops to its intact surface and from there to its residual
one (general.brittle_drop); failed rock returns to the residual one. What a law's module offers:

| name | what |
|---|---|
| NAME | value of `model` in a mine file |
| Material | settings of a rock with this law: keys with their units; validators refuse what cannot be, above all a residual surface that leaves the intact one. What may differ between intact and residual rock is a pair {intact, residual} |
| ROW_LENGTH | numbers in a strength row |
| strength_rows(material, axes) | intact and residual row, float64 (ROW_LENGTH,); axes: see Scene.frame_axes |
| overstress_of_tensor(tensor, row) | `overstress` of (3, 3), Pa, by numpy: to check a configuration without waiting for numba |
| surely_admissible(*stress, row) | whether cheap bounds prove stress admissible |
| overstress(*stress, row) | how far stress is above strength, Pa; at most 0 where admissible. What is admissible is convex |
| return_to_surface(*stress, lame_lambda, shear_modulus, row) | plastic return of an elastic trial stress: six components and where it ended (elastic.py). ELASTIC: bit for bit the trial, also for a stress that was returned |
| return_lanes(the same) | six components of lanes (simd/lanes.py), to round-off the same; general.lane_by_lane makes it |
| stiffness_reduction(the same, matrix) | see isotropic.py; general.tangent_by_differences makes it |
| strength_factor(*stress, row) | strength over stress: 0 to STRENGTH_FACTOR_CAP, at least 1 where admissible |
| excess_shear_stress(*stress, row) | Pa, negative below strength |
| strength_size(row) | Pa: what a margin above strength is in proportion to |
| gains_energy(row) | whether flow may gain energy |
| plane_normal(material) | only where a law has weak planes: their unit normal (3,) in the mine's frame |

Those from surely_admissible on are compiled by numba: scalar, without allocation (but for stiffness_reduction) or
fastmath; *stress is xx, yy, zz, yz, xz, xy, Pa, tension positive, in the axes of the computation; row is a tuple. For
isotropic laws isotropic.py makes three of them from a return of principal stresses.

Kernels are made for a law, as a module, and a dimension. numba finds its functions as it compiles and keeps what it
compiled by the module's name, so other processes find it: functions themselves would be kept by a random number.
"""  # noqa: E501

from collections.abc import Iterable, Mapping
from functools import reduce
from types import ModuleType
from typing import Any

import numpy as np

from common.setting_types import Settings, one_of
from mpm_core.constitutive.laws import coulomb, hoek_brown, weak_planes
from mpm_core.constitutive.mixture import mix
from mpm_core.settings import ElasticMaterial, MaterialSettings

ELASTIC_MODEL = "elastic"
LAWS = (coulomb, hoek_brown, weak_planes)


def any_material(laws: Iterable[ModuleType]) -> Any:
    """The type of one rock or fill: elastic, or of one of these laws, as its `model` says."""
    return one_of("model", {ELASTIC_MODEL: ElasticMaterial} | {law.NAME: law.Material for law in laws})


AnyMaterial = any_material(LAWS)


class Materials(Settings):
    """Materials as a stage's slice has them."""

    materials: dict[str, AnyMaterial]


def can_fail(material: MaterialSettings | Mapping) -> bool:
    """True if a material, or its section of a slice, has a law of failure."""
    model = material.get("model") if isinstance(material, Mapping) else getattr(material, "model", ELASTIC_MODEL)
    return model != ELASTIC_MODEL


def variability_of(material: MaterialSettings) -> tuple[float, float]:
    """Coefficient of variation of a material's strength, and its length, m; 0 and 0 for one that does not vary."""
    given = getattr(material, "variability", None)
    return (given.share, given.length) if given is not None and given.share > 0.0 else (0.0, 0.0)


def loses_strength(material: MaterialSettings) -> bool:
    """True if a material can fail and has another strength then."""
    return can_fail(material) and not np.array_equal(
        *law_of(material).strength_rows(material, (0, 1, 2)), equal_nan=True
    )


def law_of(material: MaterialSettings) -> ModuleType:
    """The law of a material that can fail."""
    return next(law for law in LAWS if material.model == law.NAME)


def plane_normals(materials: Mapping[str, MaterialSettings]) -> dict[str, list[float]]:
    """Unit normal in the mine's frame of the weak planes of those materials that have some, by name."""
    weak = {name: material for name, material in materials.items() if can_fail(material)}
    weak = {name: material for name, material in weak.items() if hasattr(law_of(material), "plane_normal")}
    return {name: law_of(material).plane_normal(material).tolist() for name, material in weak.items()}


def law_of_all(materials: Iterable[MaterialSettings]) -> ModuleType:
    """One law for all rock of a scene: a mixture where there are several, in the order of LAWS; LAWS[0] for none."""
    names = {material.model for material in materials if can_fail(material)}
    return reduce(mix, [law for law in LAWS if law.NAME in names] or LAWS[:1])


def rows_of_all(
    law: ModuleType, materials: Iterable[MaterialSettings], axes: tuple[int, int, int]
) -> tuple[np.ndarray, np.ndarray]:
    """Intact and residual strength rows of materials, (material, law.ROW_LENGTH); NaN for one that cannot fail.

    law: from law_of_all; axes: see Scene.frame_axes.
    """
    materials = list(materials)
    rows = np.full((2, len(materials), law.ROW_LENGTH), np.nan)
    for number, material in enumerate(materials):
        if can_fail(material):
            own = law_of(material)
            for kind, row in enumerate(own.strength_rows(material, axes)):
                rows[kind, number] = row if own is law else law.row_of(own, row)
    return rows[0], rows[1]
