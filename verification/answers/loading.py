"""Loading measures of a widening slit and of a sphere, against their closed forms.

A slit of half-width a in plane strain under the pressure p, with E' = E / (1 - nu^2), releases pi p^2 a^2 / E' per
metre, as its walls close by 4 p sqrt(a^2 - x^2) / E' (Salamon 1968, Int. J. Rock Mech. Min. Sci. 5, 159); so
widening releases the difference, and its stiffness, p over the mean motion of a wall, is 2 E' / (pi a).

A sphere of radius a takes V s0 : C^-1 : s0 / 2 along and releases V s0 : e / 2 through its wall, with the strain e of
Eshelby's sphere that has the wall's motion u = e x (Salamon 1984). Its stiffness is the integral of t . t over that of
t . u, t = s0 n: tr(s0 s0) / (a tr(s0 e)), 4 G / a in all-round compression, whatever was mined within it before or is
filled into it.
"""

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from catalogs.figures import style
from catalogs.sources.section_planes import Plane
from common.voigt import voigt_from_tensor
from response.excess_shear import disc_points, excess_shear_stress
from response.loading import loading_table
from response.loading_settings import LoadingSlice
from verification.cavities.cavity import inclusion_of
from verification.cavities.inclusion import SphericalInclusion
from verification.page_tables import Pivot
from verification.results import Results, Variant
from verification.rows import Row

MEGA = 1e6
TABLES = (
    Pivot(
        "Errors (%)",
        r"(?P<row>(?:slit|sphere)_?\w*): (?P<column>energy released|release rate|energy of the mined rock|loading "
        r"stiffness), [^,]+",
        "error, %",
    ),
    Pivot(
        "Excess shear stress (error, % of the largest virgin compression)",
        r"(?P<row>\w+): excess shear stress, (?P<column>.+), MPa",
        "error, %",
    ),
)


def measured(variant: Variant) -> xr.Dataset:
    """The table of loading measures of a variant."""
    settings = LoadingSlice.of(variant.mine.loading_slice())
    return loading_table(settings, variant.grid, variant.elastic, [variant.step(name) for name in variant.step_names])


def value(table: xr.Dataset, column: str, step: str = "history", name: str = "all") -> float:
    """A value of the table of loading measures."""
    row = np.flatnonzero((table["step"].values == step) & (table["name"].values == name))
    return float(table[column].values[row[0]])


def slit_of(variant: Variant) -> tuple[float, float, float]:
    """Pressure (Pa), E' (Pa) and the half-width (m) that its last step leaves."""
    values = variant.values
    rock = values["materials"]["host"]
    ends = [entry[end][0] for entry in values["excavations"] for end in ("lower", "upper")]
    modulus = rock["youngs_modulus"] / (1.0 - rock["poisson_ratio"] ** 2)
    return -values["insitu_stress"]["constant"]["zz"], modulus, max(ends)


def slit_energy(pressure: float, modulus: float, half_width: float) -> float:
    """Energy that a slit releases, MJ per metre."""
    return np.pi * pressure**2 * half_width**2 / modulus / MEGA


def slit_rows(name: str, variant: Variant, allowed: dict[str, float]) -> list[Row]:
    """Energy through the walls and stiffness of a panel that is mined at once; what widening releases."""
    table, (pressure, modulus, half_width) = measured(variant), slit_of(variant)
    if "wider" in variant.step_names:
        before = variant.values["excavations"][0]["upper"][0]
        released = slit_energy(pressure, modulus, half_width) - slit_energy(pressure, modulus, before)
        rate = released / (2.0 * (half_width - before))
        bound = allowed["widening"]
        return [
            Row.relative(f"{name}: energy released, MJ/m", released, value(table, "energy_released", "wider"), bound),
            Row.relative(f"{name}: release rate, MJ/m2", rate, value(table, "release_rate", "wider"), bound),
        ]
    bound = allowed["slit" if name == "slit_10" else "thin"]
    through = value(table, "energy_released") - value(table, "energy_mined")
    stiffness = 2.0 * modulus / (np.pi * half_width) / MEGA
    return [
        Row.relative(f"{name}: energy released, MJ/m", slit_energy(pressure, modulus, half_width), through, bound,
                     "Without the energy of the mined rock, of which a slit has none."),
        Row.relative(f"{name}: loading stiffness, MPa/m", stiffness, value(table, "loading_stiffness"), bound),
    ]  # fmt: skip


def energy_of(sphere: SphericalInclusion, radius: float) -> tuple[float, float]:
    """Energy (MJ) of an eighth of a sphere of this radius (m): in its rock, and released through its wall."""
    volume, virgin, rock = np.pi / 6.0 * radius**3, np.asarray(sphere.virgin_stress), sphere.rock
    mean = np.trace(virgin) / 3.0
    deviator = virgin - mean * np.eye(3)
    mined = mean**2 / (2.0 * rock.bulk_modulus) + (deviator**2).sum() / (4.0 * rock.shear_modulus)
    return volume * mined / MEGA, 0.5 * volume * float((virgin * sphere.strain_inside).sum()) / MEGA


def sphere_rows(name: str, variant: Variant, allowed: dict[str, float]) -> list[Row]:
    """Energies and stiffness of a sphere; of the last step, where there are two."""
    table, sphere, step = measured(variant), inclusion_of(variant), variant.step_names[-1]
    radius = max(entry["radius"] for entry in variant.values["excavations"])
    mined, through = energy_of(sphere, radius)
    released = mined + through
    virgin, is_filled = np.asarray(sphere.virgin_stress), sphere.inclusion.youngs_modulus > 0.0
    empty = SphericalInclusion(sphere.radius, sphere.virgin_stress, sphere.rock)
    stiffness = float((virgin**2).sum() / (radius * (virgin * empty.strain_inside).sum())) / MEGA
    found = value(table, "loading_stiffness", step)
    if step == "wider":
        first, before = energy_of(sphere, sphere.radius)
        released -= first + before
        rows = []
    else:
        rows = [Row.relative(f"{name}: energy of the mined rock, MJ", mined, value(table, "energy_mined"),
                             allowed["sphere"])]  # fmt: skip
    bound = allowed["filled" if is_filled else "wider_stiffness" if step == "wider" else "sphere"]
    rows.append(
        Row.relative(f"{name}: energy released, MJ", released, value(table, "energy_released", step), allowed["sphere"])
    )
    rows.append(Row.relative(f"{name}: loading stiffness, MPa/m", stiffness, found, bound))
    return rows


def shear_rows(name: str, variant: Variant, allowed: dict[str, float]) -> list[Row]:
    """Excess shear stress on the planes of a variant, in MPa, against the exact field at the same points."""
    table, sphere = measured(variant), inclusion_of(variant)
    settings, cell = variant.mine.settings.loading_measures, float(variant.grid.attrs["fine_cell"])
    scale, rows = float(np.abs(sphere.virgin_stress).max()) / MEGA, []
    for plane in settings.planes:
        own = Plane.of(plane.point, plane.strike, plane.dip)
        points = own.places(disc_points(plane.radius, cell)[0])
        points = points[(np.linalg.norm(points, axis=1) > sphere.radius) & (points > 0.0).all(axis=1)]
        exact = excess_shear_stress(voigt_from_tensor(sphere.stress(points)), own.toward, settings.dynamic_friction)
        above = exact[exact > 0.0]
        known = {"ess_largest": exact.max(), "ess_mean": above.mean()}
        if plane.radius is None:
            known = {"ess_at_point": exact[0]}
        for column, expected in known.items():
            obtained = value(table, column, name=plane.name)
            quantity = (
                f"{name}: excess shear stress, {column.removeprefix('ess_').replace('_', ' ')} of {plane.name}, MPa"
            )
            error = abs(obtained - expected / MEGA) / scale
            bound = allowed["shear_largest" if column == "ess_largest" else "shear"]
            rows.append(Row(quantity, expected / MEGA, obtained, error, bound, "Share of the largest compression."))
    return rows


def split_rows(results: Results) -> list[Row]:
    """Sum over two steps against one, and how much of it the mined rock takes along; doubled stress."""
    rows, tables = [], {name: measured(variant) for name, variant in results.variants.items()}
    for once, split in (("slit_2", "slit_2_wider"), ("sphere", "sphere_wider")):
        if {once, split} <= set(tables):
            total, mined = (
                [value(tables[split], column, step) for step in results[split].step_names]
                for column in ("energy_released", "energy_mined")
            )
            whole = value(tables[once], "energy_released")
            shares = (value(tables[once], "energy_mined") / whole, sum(mined) / sum(total))
            remark = "The mined rock takes {:.1%} of it along at once, {:.1%} in two steps.".format(*shares)
            quantity = f"{split}: energy released by both steps against one, MJ"
            rows.append(Row.relative(quantity, whole, sum(total), results.allowed["split"], remark))
    if {"sphere", "sphere_doubled"} <= set(tables):
        found = value(tables["sphere_doubled"], "energy_released")
        expected = 4.0 * value(tables["sphere"], "energy_released")
        rows.append(Row.relative("sphere_doubled: four times the energy of half the stress, MJ", expected, found, 1e-4))
    return rows


def answer(results: Results) -> tuple[list[Row], Figure]:
    """Rows and figure of the study."""
    rows = []
    for name, variant in results.variants.items():
        rows += (slit_rows if name.startswith("slit") else sphere_rows)(name, variant, results.allowed)
        if name.startswith("sphere_triaxial"):
            rows += shear_rows(name, variant, results.allowed)
    return rows + split_rows(results), draw(rows)


def draw(rows: list[Row]) -> Figure:
    """Errors of energies and stiffness by variant, signed, in per cent."""
    shown = [row for row in rows if "excess shear" not in row.quantity]
    figure = style.new_figure(height=0.6 + 0.24 * len(shown))
    axes = figure.subplots()
    error = [100.0 * (row.obtained / row.expected - 1.0) for row in shown]
    place = -np.arange(len(shown))
    axes.barh(place, error, height=0.6, color=[style.OUTLINE if row.passed else "#d55e00" for row in shown])
    axes.set_yticks(place, [row.quantity.rpartition(",")[0] for row in shown])
    axes.axvline(0.0, color=style.OUTLINE, linewidth=0.6)
    axes.set_xlabel("error (%)")
    return figure
