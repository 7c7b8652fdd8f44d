"""Cases of rock, stress, size and grid, whose knobs are numbers in a mine file."""

from collections.abc import Iterator

from verification.rows import KnownMiss
from verification.scenes import MODULUS, PRESSURE, column, coulomb, elastic, failing, filled, hole
from verification.stability.cases import Case, Knob
from verification.stability.judges import (
    closure_error,
    front_error,
    replaced_by,
    rise_error,
    same_motion,
    wall_error,
)
from verification.studies import merge

# Allowed errors as shares. In closure and front 0.4 of a cell, an eighth of a tunnel's radius, a quarter of a sphere's.
MAX_TUNNEL_ERROR, MAX_SPHERE_ERROR = 0.05, 0.10
MAX_BRITTLE_ERROR = 0.15  # Brittle fronts are ragged.
MAX_WALL_ERROR = 0.10  # Share of the motion of failed rock. Cells at the wall are cut.
MAX_RISE_ERROR = 1e-3  # Share of the rise. A column is exact but for the tolerance.
MAX_MOTION_DIFFERENCE = 1e-3  # Share of the largest motion between runs that must answer alike.
LOOSE_TOLERANCE_MISS = KnownMiss("The loosest tolerance that is taken leaves a tenth of the load unbalanced.", 0.15)
# Faces keep their virgin traction, so that the hole is that in infinite rock for every Poisson's ratio.
TRACTION_KEPT = {"boundary": "traction"}


def stiffness() -> Iterator[Case]:
    for power in range(-8, 9, 2):
        for dimension, title in ((2, "filled tunnel"), (3, "filled sphere")):
            if dimension == 2 or power in (-8, 0, 8):
                scene = filled(MODULUS * 10.0**power, dimension=dimension)
                yield Case(
                    title, 10.0**power, scene, closure_error, MAX_TUNNEL_ERROR if dimension == 2 else MAX_SPHERE_ERROR
                )
        if abs(power) <= 4:
            scene = filled(MODULUS * 10.0**power, solver={"scheme": "explicit"})
            yield Case("filled tunnel, explicit", 10.0**power, scene, closure_error, MAX_TUNNEL_ERROR)
        pressure = 1e-4 * MODULUS * min(1.0, 10.0**power)  # Strains of the softer layer stay small.
        yield Case("two layers", 10.0**power, column(32, pressure, MODULUS * 10.0**power), rise_error, MAX_RISE_ERROR)


def poisson() -> Iterator[Case]:
    for ratio in (0.0, 0.25, 0.4, 0.45, 0.49, 0.495, 0.499, 0.4999):
        host: dict = {"materials": {"host": elastic(poisson=ratio)}, "domain": TRACTION_KEPT}
        yield Case("tunnel", ratio, hole(**host), closure_error, MAX_TUNNEL_ERROR)
        scene = hole(**host, solver={"scheme": "explicit"})
        yield Case("tunnel, explicit", ratio, scene, closure_error, MAX_TUNNEL_ERROR)
        yield Case(
            "tunnel, 4 particles", ratio, hole(**host, grid={"particles_per_cell": 4}), closure_error, MAX_TUNNEL_ERROR
        )
        if ratio in (0.0, 0.4, 0.4999):
            yield Case("sphere", ratio, hole(3, **host), closure_error, MAX_SPHERE_ERROR)
        scene = hole(frame={"surface": "1000000.0 m"}, materials=host["materials"])
        scene["domain"], scene["grid"] = {}, {"finest_cell": "0.5 m", "refinement": "static", "buffer_cells": 2}
        yield Case("tunnel, domain derived", ratio, scene, closure_error, MAX_TUNNEL_ERROR)
        rock = coulomb(poisson_ratio=ratio)
        yield Case("plastic tunnel", ratio, failing(rock, domain=TRACTION_KEPT), front_error, MAX_TUNNEL_ERROR)
    for ratio in (0.49999, 0.5):
        yield Case("tunnel", ratio, hole(materials={"host": elastic(poisson=ratio)}), closure_error, MAX_TUNNEL_ERROR)


def friction() -> Iterator[Case]:
    for angle in (0.0, 1.0, 5.0, 10.0, 20.0, 30.0, 40.0, 50.0, 60.0):
        cohesion = 8e6 if angle < 20.0 else 3e6  # Rock of 3 MPa would fail up to the boundary.
        rock = coulomb(angle, cohesion, min(10.0, angle))
        yield Case("plastic tunnel", angle, failing(rock), front_error, MAX_TUNNEL_ERROR)
        scene = failing(rock, solver={"scheme": "explicit"})
        yield Case("plastic tunnel, explicit", angle, scene, front_error, MAX_TUNNEL_ERROR)
    for angle in (10.0, 30.0, 60.0):
        rock = coulomb(angle, 6e6, min(10.0, angle))
        yield Case("plastic sphere", angle, failing(rock, 3), front_error, MAX_SPHERE_ERROR)


def cohesion() -> Iterator[Case]:
    for strength in (0.0, 1e3, 1e5, 3e5, 1e6, 3e6, 1e7, 3e7, 1e8):
        rock = coulomb(cohesion=strength)
        yield Case("plastic tunnel", strength, failing(rock), front_error, MAX_TUNNEL_ERROR)
        scene = failing(rock, solver={"scheme": "explicit"})
        yield Case("plastic tunnel, explicit", strength, scene, front_error, MAX_TUNNEL_ERROR)


def dilation() -> Iterator[Case]:
    for angle in (0.0, 10.0, 20.0, 30.0):
        for scheme in ("multigrid", "explicit"):
            scene = failing(coulomb(dilation=angle), solver={"scheme": scheme})
            yield Case(f"plastic tunnel, {scheme}", angle, scene, wall_error, MAX_WALL_ERROR)
    for angle in (40.0, 50.0):
        yield Case("above friction", angle, failing(coulomb(dilation=angle)), wall_error, MAX_WALL_ERROR)
        scene = failing(coulomb(dilation=angle, allow_psi_above_phi=True))
        yield Case("above friction, allowed", angle, scene, wall_error, MAX_WALL_ERROR)


def residual() -> Iterator[Case]:
    for share in (0.0, 0.1, 0.3, 0.5, 0.7, 0.9, 1.0):
        scene = failing(coulomb(share=share), pressure=12e6)
        yield Case("brittle tunnel, 12 MPa", share, scene, front_error, MAX_BRITTLE_ERROR)
    none: dict = {"friction_angle": {"residual": "0.0 deg"}, "dilation_angle": {"residual": "0.0 deg"}}
    rock = coulomb(share=0.0, tension_cutoff={"intact": "1e6 Pa", "residual": "0.0 Pa"}, **none)
    yield Case("no strength at all is left", 0.0, failing(rock), None, 0.0)


def stress() -> Iterator[Case]:
    for power in range(3, 11):
        pressure = 10.0**power
        yield Case("tunnel", pressure, hole(pressure=pressure), closure_error, MAX_TUNNEL_ERROR)
        yield Case("sphere", pressure, hole(3, pressure=pressure), closure_error, MAX_SPHERE_ERROR)
        factor = pressure / PRESSURE
        rock = coulomb(cohesion=3e6 * factor, youngs_modulus=f"{MODULUS * factor!r} Pa")
        scene = failing(rock, pressure=pressure)
        yield Case("plastic tunnel, rock to match", pressure, scene, front_error, MAX_TUNNEL_ERROR)
        scene = failing(coulomb(), pressure=pressure)
        yield Case("plastic tunnel, rock as it is", pressure, scene, front_error, MAX_TUNNEL_ERROR)


def size() -> Iterator[Case]:
    for width in (1e-3, 1e-2, 1.0, 96.0, 1e3, 1e4, 1e5):
        scale = width / 96.0
        yield Case("tunnel", width, hole(scale=scale), closure_error, MAX_TUNNEL_ERROR)
        yield Case("plastic tunnel", width, failing(coulomb(), scale=scale), front_error, MAX_TUNNEL_ERROR)
        if width in (1e-3, 1e5):
            yield Case("sphere", width, hole(3, scale=scale), closure_error, MAX_SPHERE_ERROR)


def offset() -> Iterator[Case]:
    for distance in (1e3, 1e4, 1e5, 1e6, 1e7, 9e7):
        judge = same_motion(replaced_by(hole()))
        yield Case("tunnel, cells exact in binary", distance, hole(offset=distance), judge, MAX_MOTION_DIFFERENCE)
        judge = same_motion(replaced_by(hole(scale=0.1)))
        yield Case("tunnel, cells of 0.05 m", distance, hole(scale=0.1, offset=distance), judge, MAX_MOTION_DIFFERENCE)
        yield Case("plastic tunnel", distance, failing(coulomb(), offset=distance), front_error, MAX_TUNNEL_ERROR)


def levels() -> Iterator[Case]:
    for count in range(1, 11):
        for buffer in (1, 3):
            grid = {"coarse_cell": "32.0 m", "levels": count, "buffer_cells": buffer}
            cell = 32.0 / 2 ** (count - 1)
            allowed = max(MAX_TUNNEL_ERROR, 0.4 * cell / 4.0)  # A wall may be wrong by 0.4 of a cell.
            yield Case(f"tunnel, {buffer} rings", count, hole(grid=grid), closure_error, allowed)
    for count in (2, 3, 4):
        scene = hole(3, grid={"coarse_cell": f"{2.0 ** (count - 1)!r} m", "levels": count})
        if 48 % 2 ** (count - 1) == 0:
            yield Case("sphere", count, scene, closure_error, MAX_SPHERE_ERROR)


def length() -> Iterator[Case]:
    for height in (8, 32, 128, 512, 2048, 8192):
        pressure = PRESSURE * min(1.0, 128 / height)  # The column must not rise by more than a cell.
        yield Case("column of 2 cells", height, column(height, pressure), rise_error, MAX_RISE_ERROR)
        tight = merge(column(height, pressure), {"solver": {"tolerance": 1e-9}})
        yield Case("the same to 1e-9", height, tight, rise_error, MAX_RISE_ERROR)
        if height <= 128:
            explicit = merge(column(height), {"solver": {"scheme": "explicit"}})
            yield Case("the same, explicit", height, explicit, rise_error, MAX_RISE_ERROR)
    for width in (8.0, 64.0, 512.0):
        scene = hole(domain={"lower": [f"{-4 * width!r} m", "-16.0 m"], "upper": [f"{4 * width!r} m", "16.0 m"]})
        judge = same_motion(lambda values: merge(values, {"solver": {"scheme": "multigrid", "tolerance": 1e-9}}))
        yield Case("tunnel in a strip, beside 1e-9", width / 4, scene, judge, 0.01)


def tolerance() -> Iterator[Case]:
    for power in range(-1, -16, -1):
        for scheme in ("multigrid", "explicit"):
            scene = hole(solver={"tolerance": 10.0**power, "scheme": scheme, "max_iterations": 20000})
            judge = same_motion(lambda values: merge(values, {"solver": {"tolerance": 1e-11, "scheme": "multigrid"}}))
            known = LOOSE_TOLERANCE_MISS if power == -1 else None
            yield Case(f"tunnel, {scheme}", 10.0**power, scene, judge, 0.01, known)
        solver = {"tolerance": 10.0**power, "max_iterations": 5000}
        yield Case(
            "plastic tunnel", 10.0**power, failing(coulomb(), solver=solver), front_error, MAX_TUNNEL_ERROR, known
        )
    yield Case("tunnel, multigrid", 1e-16, hole(solver={"tolerance": 1e-16}), closure_error, MAX_TUNNEL_ERROR)


ROCK = (
    Knob("stiffness", "stiffness contrast", "log", "Fill, or the upper of two layers, so many times as stiff as the "
         "rock; closed forms of both.", stiffness),
    Knob("poisson", "Poisson's ratio", "words", "A tunnel whose far stress stays, and one in a domain that is derived; "
         "closed forms.", poisson),
    Knob("friction", "friction angle (deg)", "linear", "A tunnel and a sphere in perfectly plastic rock: where its "
         "front stands.", friction),
    Knob("cohesion", "cohesion (Pa)", "words", "The plastic tunnel at 20 MPa: from rock that cannot stand to rock that "
         "does not fail.", cohesion),
    Knob("dilation", "dilation angle (deg)", "linear", "The plastic tunnel, friction 30 degrees: how failed rock "
         "moves.", dilation),
    Knob("residual", "residual cohesion over peak", "linear", "A brittle tunnel: where its front stands. From the peak "
         "to nothing.", residual),
    Knob("stress", "stress (Pa)", "log", "Elastic and plastic holes.", stress),
    Knob("size", "width of the domain (m)", "log", "The same scene, all lengths in proportion.", size),
    Knob("offset", "offset of coordinates (m)", "log", "The tunnel moved along x: it must answer as at zero.", offset),
    Knob("levels", "levels of cells", "linear", "The tunnel, from cells of 32 m down.", levels),
    Knob("length", "length over width of the domain", "log", "Columns that rise as their top is mined, exact on any "
         "grid; a tunnel in a long strip.", length),
    Knob("tolerance", "tolerance", "log", "Beside the motion at 1e-11.", tolerance),
)  # fmt: skip
