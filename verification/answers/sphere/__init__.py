"""Elastic sphere, empty or filled, in all-round and uniaxial stress, against Goodier's and Eshelby's fields."""

import numpy as np
from matplotlib.figure import Figure

from verification.answers.sphere.figure import draw
from verification.cavities.cavity import Cavity, read_pressure
from verification.cavities.inclusion import Elastic, SphericalInclusion
from verification.energy_rows import closing_row, sphere_rows
from verification.page_tables import Pivot
from verification.results import Results, Variant
from verification.rows import Row

TABLES = (
    Pivot(
        "Errors (% of the far stress, or of the quantity itself)",
        r"(?P<column>(?:hydrostatic|uniaxial)\w*): (?P<row>.+)",
        "error, %",
    ),
)

MIN_POLE_COSINE = 0.95  # Cosine of the angle to an axis above which a direction counts as on it.
INTERIOR_CLEARANCE = 1.0  # Cells next to the wall that the comparison inside the fill leaves out.


def exact_field(variant: Variant) -> SphericalInclusion:
    """The closed form of a variant."""
    values = variant.values
    hole, constant = values["excavations"][0], values["insitu_stress"]["constant"]
    materials = {
        name: Elastic(material["youngs_modulus"], material["poisson_ratio"])
        for name, material in values["materials"].items()
    }
    virgin = np.diag([constant.get(name, 0.0) for name in ("xx", "yy", "zz")])
    fill = hole.get("fill", "none")
    inclusion = {} if fill == "none" else {"inclusion": materials[fill]}
    return SphericalInclusion(hole["radius"], virgin, materials["host"], **inclusion)


def answer(results: Results) -> tuple[list[Row], Figure]:
    """Rows and figure of the study."""
    cavities = {name: Cavity(variant, variant.elastic) for name, variant in results.variants.items()}
    rows = []
    for name, cavity in cavities.items():
        exact, pressure = exact_field(results[name]), read_pressure(results[name])
        rows.append(stress_row(name, cavity, exact, pressure, results))
        rows += closure_rows(name, cavity, exact, results.allowed["closure"])
        rows += sphere_rows(name, cavity.state, exact, results.allowed["energy"])
        if cavity.fill.any():
            rows += inclusion_rows(name, cavity, exact, pressure, results.allowed["stress"])
    rows.append(closing_row("all", (cavity.state for cavity in cavities.values())))
    fields = {name: (cavities[name], exact_field(results[name])) for name in cavities}
    return rows, draw(fields, results.settings["outer_radii"])


def stress_row(name: str, cavity: Cavity, exact: SphericalInclusion, pressure: float, results: Results) -> Row:
    """R.m.s. error of the stress in the rock over all components."""
    outer = results.settings["outer_radii"]
    ring = cavity.ring(outer)
    square = np.square(cavity.stress[ring] - exact.stress(cavity.place[ring])).sum(axis=(1, 2)) / 6
    error = float(np.sqrt(np.average(square, weights=cavity.volume[ring])) / pressure)
    quantity = f"{name}: stress in the rock, a + 2 h to {outer:g} a, r.m.s. of six components, share of the far stress"
    return Row(quantity, 0.0, error, error, results.allowed["stress"])


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
    expected = -(exact.displacement(cavity.radius * directions) * directions).sum(axis=1)
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
        Row(
            f"{name}: stress in the fill, r.m.s. of six components, share of the far stress", 0.0, share, share, allowed
        ),
        Row(f"{name}: stress in the fill, r.m.s. share of its own", 0.0, own, own, None, reason),
        Row.relative(f"{name}: mean stress of the fill along z, MPa", expected, mean),
    ]
