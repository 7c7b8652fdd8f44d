"""CB-Geo's hole in Coulomb rock: stress that its notebooks print for particle 1600, closed form there, and ours.

Facts from cb-geo/mpm-benchmarks, 2d/plate_with_hole/isoparametric/10m and 30m (commit 0b19f1c): particles.txt,
mpm_associated.json, mpm_nonassociated.json, results.ipynb (the last states that it reads: step 195,000 of 200,000, but
95,000 of the 10 m run without dilation). The hole has a radius of 1 m.
"""

import numpy as np
from scipy.spatial import cKDTree

from verification.cavities.cavity import Cavity
from verification.cavities.runs import Run
from verification.rows import Row

MPA = 1e-6
SOURCE = "CB-Geo, 2d/plate_with_hole/isoparametric"
PLANE_PARTICLES = 4  # Nearest particles that a plane is fitted to.


def particle_rows(run: Run, place: list[float], printed: list[float], allowed: float) -> list[Row]:
    """Radial and hoop compression at a place (radii from the centre), MPa: theirs and ours against the closed form."""
    point = run.theory.radius * np.array(place)
    exact = run.theory.stress(np.array([np.hypot(*point)]))[:2]
    found = compression_at(run.cavity, point)
    rows = []
    for kind, stress, theirs, ours in zip(("radial", "hoop"), exact, printed, found, strict=True):
        expected, quantity = -float(stress[0]) * MPA, f"{run.name}: {kind} compression at particle 1600, MPa"
        rows.append(Row.relative(f"{quantity}, {SOURCE} and the closed form", expected, theirs))
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
