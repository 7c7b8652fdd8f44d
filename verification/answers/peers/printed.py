"""Values that CB-Geo prints for a particle beside a hole, and MOOSE for the roof of a coal panel.

CB-Geo's hole in Coulomb rock: stress that its notebooks print for particle 1600, closed form there, and ours.

Facts from cb-geo/mpm-benchmarks, 2d/plate_with_hole/isoparametric/10m and 30m (commit 0b19f1c): particles.txt,
mpm_associated.json, mpm_nonassociated.json, results.ipynb (the last states that it reads: step 195,000 of 200,000, but
95,000 of the 10 m run without dilation). The hole has a radius of 1 m.

The elastic roof of MOOSE's coal panel: its sag and the subsidence above it.

Facts from idaholab/moose, modules/tensor_mechanics/examples/coal_mining: coal_mining.tex (table
elastic.deform.standard: 0.19 m without Cosserat moduli under 400 m) and cosserat_elastic.i, which reports the
displacement of the point (0, 0, 403.003): the surface above the middle of the panel.
"""

import math

import numpy as np
from scipy.spatial import cKDTree

from verification.cavities.cavity import Cavity
from verification.cavities.runs import Run
from verification.comparisons import MPA
from verification.results import Variant
from verification.rows import Row

MOOSE = "MOOSE, coal_mining.tex"
CBGEO = "CB-Geo, 2d/plate_with_hole/isoparametric"
PLANE_PARTICLES = 4  # Nearest particles that a plane is fitted to.


def particle_rows(run: Run, place: list[float], printed: list[float], allowed: float) -> list[Row]:
    """Radial and hoop compression at a place (radii from the centre), MPa: theirs and ours against the closed form."""
    point = run.theory.radius * np.array(place)
    exact = run.theory.stress(np.array([np.hypot(*point)]))[:2]
    found = compression_at(run.cavity, point)
    rows = []
    for kind, stress, theirs, ours in zip(("radial", "hoop"), exact, printed, found, strict=True):
        expected, quantity = -float(stress[0]) * MPA, f"{run.name}: {kind} compression at particle 1600, MPa"
        rows.append(Row.relative(f"{quantity}, {CBGEO} and the closed form", expected, theirs))
        rows.append(Row.relative(f"{quantity}, ours and the closed form", expected, float(ours) * MPA, allowed))
    return rows


def compression_at(cavity: Cavity, point: np.ndarray) -> np.ndarray:
    """Radial and hoop compression (2,), Pa, at a point (2,) m.

    A plane is fitted to each component in the nearest particles, so that the hole's shape does not enter.
    """
    near = cKDTree(cavity.place[:, :2]).query(point, k=PLANE_PARTICLES)[1]
    terms = np.column_stack([np.ones(PLANE_PARTICLES), cavity.place[near, :2] - point])
    at_point = np.linalg.pinv(terms)[0]
    stress = np.einsum("p,pij->ij", at_point, cavity.stress[near, :2, :2])
    outward = point / np.hypot(*point)
    along = np.array([-outward[1], outward[0]])
    return -np.array([outward @ stress @ outward, along @ stress @ along])


def roof_rows(name: str, variant: Variant, printed: float, allowed: float) -> list[Row]:
    """Subsidence of surface and roof above the middle of the panel, m, against the printed value."""
    panel, top = variant.values["excavations"][0]["upper"][1], variant.values["domain"]["upper"][1]
    surface, roof = (float(lowering(variant, height, np.zeros(1))[0]) for height in (top, panel))
    slits = row_of_slits(variant)
    remark = (
        f"not compared: {printed:g} is what the surface comes down by, the point that cosserat_elastic.i reports; "
        f"slits in a row like the panel, in rock without a surface, sag by {slits:.3g}, and a surface adds to it"
    )
    return [
        Row.relative(f"{name}: subsidence above the middle of the panel, m, {MOOSE}", printed, surface, allowed),
        Row(f"{name}: sag of the roof, m, {MOOSE}", printed, roof, abs(roof - printed) / printed, None, remark),
    ]


def lowering(variant: Variant, height: float, x: np.ndarray) -> np.ndarray:
    """Downward displacement (point,) m at a height, interpolated between its nodes at places x (point,) m."""
    place = variant.grid.node_position.values
    line = np.flatnonzero(np.isclose(place[:, 2], height))
    line = line[np.argsort(place[line, 0])]
    return -np.interp(x, place[line, 0], variant.elastic.node_displacement.values[line, 2])


def row_of_slits(variant: Variant) -> float:
    """Sag, m, in the middle of one of many slits in a row, in rock without a surface; rollers make such of the panel.

    2 (1 - nu^2) p / E times W / pi arccosh(1 / cos(pi a / W)) (Westergaard 1939, J. Appl. Mech. 6, A49).
    """
    values, host = variant.values, variant.values["materials"]["host"]
    half, _ = values["excavations"][0]["upper"]
    spacing = 2.0 * values["domain"]["upper"][0]
    above = values["domain"]["upper"][1] - values["excavations"][0]["upper"][1]
    pressure = -values["insitu_stress"]["gradient"]["zz"] * above
    reach = spacing / math.pi * math.acosh(1.0 / math.cos(math.pi * half / spacing))
    return 2.0 * (1.0 - host["poisson_ratio"] ** 2) * pressure / host["youngs_modulus"] * reach
