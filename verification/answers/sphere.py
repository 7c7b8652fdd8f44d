"""Elastic sphere, empty or filled, in all-round and uniaxial stress, against Goodier's and Eshelby's fields."""

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from catalogs.figures import style
from common.voigt import voigt_from_tensor
from verification.cavities.cavity import Cavity, inclusion_of, read_pressure
from verification.cavities.inclusion import SphericalInclusion
from verification.comparisons import MPA, closing_row, tensor_error, vanishing
from verification.field_rows import field_rows, line_points
from verification.page_tables import Pivot
from verification.plots import add_circle, plot_section, plot_series
from verification.results import Results
from verification.rows import Row

TABLES = (
    Pivot(
        "Errors (% of the far stress, or of the quantity itself)",
        r"(?P<column>(?:hydrostatic|uniaxial)\w*): (?P<row>.+)",
        "error, %",
    ),
)

PROFILE_RADII = 3.5  # Length of the profiles in radii.
SECTION_RADII = 2.0  # Width of the sections in radii.
SECTION_ERROR_LIMIT = 3.0  # End of the colours of errors, %.
MIN_POLE_COSINE = 0.95  # Cosine of the angle to an axis above which a direction counts as on it.
LINES, LINE_SEED = 24, 1  # Lines along which fields are compared, in random directions.
INTERIOR_CLEARANCE = 1.0  # Cells next to the wall that the comparison inside the fill leaves out.


def answer(results: Results) -> tuple[list[Row], Figure]:
    """Rows and figure of the study."""
    cavities = {name: Cavity(variant, variant.elastic) for name, variant in results.variants.items()}
    rows = []
    for name, cavity in cavities.items():
        exact, pressure = inclusion_of(results[name]), read_pressure(results[name])
        rows.append(stress_row(name, cavity, exact, pressure, results))
        rows += closure_rows(name, cavity, exact, results.allowed["closure"])
        if not cavity.fill.any():
            rows += line_rows(name, cavity, exact)
        rows += energy_rows(name, cavity.state, exact, results.allowed["energy"])
        if cavity.fill.any():
            rows += inclusion_rows(name, cavity, exact, pressure, results.allowed["stress"])
    rows.append(closing_row("all", (cavity.state for cavity in cavities.values())))
    fields = {name: (cavities[name], inclusion_of(results[name])) for name in cavities}
    return rows, draw(fields)


def stress_row(name: str, cavity: Cavity, exact: SphericalInclusion, pressure: float, results: Results) -> Row:
    """R.m.s. error of the stress in the rock over all components."""
    outer = results.settings["outer_radii"]
    ring = cavity.ring(outer)
    error = tensor_error(cavity.stress[ring] - exact.stress(cavity.place[ring]), cavity.volume[ring]) / pressure
    quantity = f"{name}: stress in the rock, a + 2 h to {outer:g} a, r.m.s. of six components, share of the far stress"
    return vanishing(quantity, error, results.allowed["stress"])


def line_rows(name: str, cavity: Cavity, exact: SphericalInclusion) -> list[Row]:
    """Stress and displacement along lines outward from the sphere, in the eighth that is modelled."""
    directions = np.random.default_rng(LINE_SEED).normal(size=(LINES, 3))
    directions = np.abs(directions) / np.linalg.norm(directions, axis=1)[:, None]
    off = line_points(directions, exact.radius)
    outside = off * (1.0 + 1e-9)  # rock's side of the wall
    stress, moved = voigt_from_tensor(exact.stress(outside)), exact.displacement(outside)
    return field_rows(name, cavity.grid, cavity.state, cavity.center, off, stress, moved)


def energy_rows(name: str, state: xr.Dataset, exact: SphericalInclusion, allowed: float) -> list[Row]:
    """Energy that an eighth of a sphere releases when mined at once, beside theory.

    The mined rock takes V s0 : C^-1 : s0 / 2 with it. Half the work of the support, V s0 : e / 2 with the strain e of
    the wall (u = e x), is set in motion (Salamon 1984, J. South. Afr. Inst. Min. Metall. 84, 233).
    """
    volume, virgin = np.pi / 6 * exact.radius**3, np.asarray(exact.virgin_stress)
    rock = exact.rock
    mean, deviator = np.trace(virgin) / 3, virgin - np.trace(virgin) / 3 * np.eye(3)
    mined = volume * (mean**2 / (2 * rock.bulk_modulus) + (deviator**2).sum() / (4 * rock.shear_modulus))
    motion = 0.5 * volume * float((virgin * exact.strain_inside).sum())
    found = {key: float(state.attrs[f"energy_{key}"]) / 1e6 for key in ("mined", "motion")}
    return [
        Row.relative(f"{name}: elastic energy of the mined rock, MJ", mined / 1e6, found["mined"], allowed),
        Row.relative(f"{name}: energy that mining at once sets in motion, MJ", motion / 1e6, found["motion"], allowed),
    ]


def closure_rows(name: str, cavity: Cavity, exact: SphericalInclusion, allowed: float) -> list[Row]:
    """Inward displacement of the wall, all round; in uniaxial stress near the pole and near the equator."""
    directions = cavity.wall_directions()
    along = directions[:, 2]
    places = {"wall": np.ones(len(along), bool)}
    if np.ptp(np.diag(exact.virgin_stress)) > 0.0:
        places = {
            "wall at the pole": along > MIN_POLE_COSINE,
            "wall at the equator": along < np.sqrt(1 - MIN_POLE_COSINE**2),
        }
    found = -cavity.wall_displacement(directions)
    expected = -exact.wall_displacement(directions)
    return [
        Row.relative(
            f"{name}: inward displacement of the {place}, mm",
            1e3 * expected[at].mean(),
            1e3 * found[at].mean(),
            allowed,
        )
        for place, at in places.items()
    ]


def inclusion_rows(name: str, cavity: Cavity, exact: SphericalInclusion, pressure: float, allowed: float) -> list[Row]:
    """Error of the stress inside the fill, which is uniform in theory, over the far stress and over itself."""
    inside = cavity.fill & (cavity.distance < cavity.radius - INTERIOR_CLEARANCE * cavity.cell)
    error = np.square(cavity.stress[inside] - exact.stress_inside).sum(axis=(1, 2))
    size = float(np.sqrt(np.average(error, weights=cavity.volume[inside])))
    share = size / np.sqrt(6) / pressure
    own = size / float(np.linalg.norm(exact.stress_inside))
    expected = float(exact.stress_inside[2, 2]) / 1e6
    mean = float(np.average(cavity.stress[inside, 2, 2], weights=cavity.volume[inside])) / 1e6
    reason = (
        "A cut cell has one strain for rock and fill, so the stiff rock in it carries the displacement half a cell "
        "into the fill: strain there is too large by about 3 (h/2) / a, first order in h."
    )
    return [
        vanishing(f"{name}: stress in the fill, r.m.s. of six components, share of the far stress", share, allowed),
        vanishing(f"{name}: stress in the fill, r.m.s. share of its own", own, remark=reason),
        Row.relative(f"{name}: mean stress of the fill along z, MPa", expected, mean),
    ]


def draw(fields: dict[str, tuple[Cavity, SphericalInclusion]]) -> Figure:
    """Profiles of stress along z and x with theory, and sections of stress and of its error; a row for each variant."""
    figure = style.new_figure(height=3.1 * len(fields))
    grid = figure.subplots(len(fields), 4, squeeze=False, width_ratios=[1.2, 1.2, 0.9, 0.9])
    for axes, (name, (cavity, exact)) in zip(grid, fields.items(), strict=True):
        profile(axes[0], f"{name}, along z", cavity, exact, 2)
        profile(axes[1], f"{name}, along x", cavity, exact, 0)
        sections(figure, axes[2:], cavity, exact)
    return figure


def profile(axes, title: str, cavity: Cavity, exact: SphericalInclusion, axis: int) -> None:
    """zz and xx along an axis: particles of the first row of cells beside it, and the exact lines."""
    off = np.delete(cavity.place, axis, axis=1)
    size = cavity.grid.cell_size.values[cavity.particle_cell]
    shown = cavity.fill | (cavity.distance > cavity.radius)  # Particles of cut cells may lie in the void.
    near = np.flatnonzero((off < size[:, None]).all(axis=1) & shown & (cavity.distance < PROFILE_RADII * cavity.radius))
    line = np.zeros((500, 3))
    line[:, axis] = np.linspace(1e-3, PROFILE_RADII, 500) * cavity.radius
    theory = exact.stress(line)
    theory[np.abs(line[:, axis] - cavity.radius) < 0.005 * cavity.radius] = np.nan  # Stress jumps at the wall.
    axes.axvline(cavity.radius, color=style.OUTLINE, linewidth=0.6, linestyle=":")
    plot_series(
        axes,
        {name: (cavity.distance[near], cavity.stress[near, i, i] * MPA) for name, i in (("xx", 0), ("zz", 2))},
        {name: (line[:, axis], theory[:, i, i] * MPA) for name, i in (("xx", 0), ("zz", 2))},
        title=title,
        xlabel="distance from the centre (m)",
        ylabel="stress (MPa)",
    )


def sections(figure: Figure, panels, cavity: Cavity, exact: SphericalInclusion) -> None:
    """zz beside the plane y = 0, and its error."""
    near = cavity.place[:, 1] < cavity.grid.cell_size.values[cavity.particle_cell]
    place, found = cavity.place[near][:, [0, 2]], cavity.stress[near, 2, 2]
    error = (found - exact.stress(cavity.place[near])[:, 2, 2]) / np.abs(exact.virgin_stress).max()
    limits = {"cmap": "RdBu_r", "vmin": -SECTION_ERROR_LIMIT, "vmax": SECTION_ERROR_LIMIT}
    void = 0.0 if cavity.fill.any() else cavity.radius
    for axes, values, title, look in (
        (panels[0], found * MPA, "zz (MPa)", {}),
        (panels[1], 100 * error, "error (%)", limits),
    ):
        drawn = plot_section(axes, place, values, (0.0, SECTION_RADII * cavity.radius), void, **look)
        add_circle(axes, cavity.radius)
        axes.set(title=title, xlabel="x (m)", ylabel="z (m)")
        figure.colorbar(drawn, ax=axes, shrink=0.8, extend="both" if look else "neither")
