"""Cases of rock, stress, size and grid, whose knobs are numbers in a mine file."""

from collections.abc import Iterator

from verification.scenes import (
    MODULUS,
    PRESSURE,
    RADIUS,
    column,
    coulomb,
    elastic,
    failing,
    filled,
    hole,
    lengths,
    other_scheme,
    quantity,
    replaced_by,
    strengths,
    tighter,
)
from verification.stability.cases import (
    LOOSE_TOLERANCE_MISS,
    MAX_HOLE_ERROR,
    MAX_MOTION_DIFFERENCE,
    Case,
    Knob,
    closure_case,
    front_case,
)
from verification.stability.judges import closure_error, front_error, rise_error, same_motion, wall_error
from verification.studies import merge

# Allowed errors as shares.
MAX_BRITTLE_ERROR = 0.15  # Brittle fronts are ragged.
MAX_WALL_ERROR = 0.10  # Share of the motion of failed rock. Cells at the wall are cut.
MAX_RISE_ERROR = 1e-3  # Share of the rise. A column is exact but for the tolerance.
# Faces keep their virgin traction, so that the hole is that in infinite rock for every Poisson's ratio.
TRACTION_KEPT = {"boundary": "traction"}


def stiffness() -> Iterator[Case]:
    for power in range(-8, 9, 2):
        contrast = 10.0**power
        yield closure_case("filled tunnel", contrast, filled(MODULUS * contrast))
        if power in (-8, 0, 8):
            yield closure_case("filled sphere", contrast, filled(MODULUS * contrast, dimension=3))
        if abs(power) <= 4:
            scene = filled(MODULUS * contrast, solver={"scheme": "explicit"})
            yield closure_case("filled tunnel, explicit", contrast, scene)
        pressure = 1e-4 * MODULUS * min(1.0, contrast)  # Strains of the softer layer stay small.
        yield Case("two layers", contrast, column(32, pressure, MODULUS * contrast), rise_error, MAX_RISE_ERROR)


def poisson() -> Iterator[Case]:
    for ratio in (0.0, 0.25, 0.4, 0.45, 0.49, 0.495, 0.499, 0.4999):
        host: dict = {"materials": {"host": elastic(poisson=ratio)}, "domain": TRACTION_KEPT}
        yield closure_case("tunnel", ratio, hole(**host))
        yield closure_case("tunnel, explicit", ratio, hole(**host, solver={"scheme": "explicit"}))
        yield closure_case("tunnel, 4 particles", ratio, hole(**host, grid={"particles_per_cell": 4}))
        if ratio in (0.0, 0.4, 0.4999):
            yield closure_case("sphere", ratio, hole(3, **host))
        scene = hole(frame={"surface": "1000000.0 m"}, materials=host["materials"])
        scene["domain"], scene["grid"] = {}, {"finest_cell": "0.5 m", "refinement": "static", "buffer_cells": 2}
        yield closure_case("tunnel, domain derived", ratio, scene)
        yield front_case("plastic tunnel", ratio, failing(coulomb(poisson_ratio=ratio), domain=TRACTION_KEPT))
    for ratio in (0.49999, 0.5):
        yield closure_case("tunnel", ratio, hole(materials={"host": elastic(poisson=ratio)}))


def friction() -> Iterator[Case]:
    for angle in (0.0, 1.0, 5.0, 10.0, 20.0, 30.0, 40.0, 50.0, 60.0):
        cohesion = 8e6 if angle < 20.0 else 3e6  # Rock of 3 MPa would fail up to the boundary.
        rock = coulomb(angle, cohesion, min(10.0, angle))
        yield front_case("plastic tunnel", angle, failing(rock))
        yield front_case("plastic tunnel, explicit", angle, failing(rock, solver={"scheme": "explicit"}))
    for angle in (10.0, 30.0, 60.0):
        yield front_case("plastic sphere", angle, failing(coulomb(angle, 6e6, min(10.0, angle)), 3))


def cohesion() -> Iterator[Case]:
    for strength in (0.0, 1e3, 1e5, 3e5, 1e6, 3e6, 1e7, 3e7, 1e8):
        rock = coulomb(cohesion=strength)
        yield front_case("plastic tunnel", strength, failing(rock))
        yield front_case("plastic tunnel, explicit", strength, failing(rock, solver={"scheme": "explicit"}))


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
    rock = coulomb(share=0.0, tension_cutoff=strengths("Pa", 1e6, 0.0), **none)
    yield Case("no strength at all is left", 0.0, failing(rock), None, 0.0)


def stress() -> Iterator[Case]:
    for power in range(3, 11):
        pressure = 10.0**power
        yield closure_case("tunnel", pressure, hole(pressure=pressure))
        yield closure_case("sphere", pressure, hole(3, pressure=pressure))
        factor = pressure / PRESSURE
        rock = coulomb(cohesion=3e6 * factor, youngs_modulus=quantity(MODULUS * factor, "Pa"))
        yield front_case("plastic tunnel, rock to match", pressure, failing(rock, pressure=pressure))
        yield front_case("plastic tunnel, rock as it is", pressure, failing(coulomb(), pressure=pressure))


def size() -> Iterator[Case]:
    for width in (1e-3, 1e-2, 1.0, 96.0, 1e3, 1e4, 1e5):
        scale = width / 96.0
        yield closure_case("tunnel", width, hole(scale=scale))
        yield front_case("plastic tunnel", width, failing(coulomb(), scale=scale))
        if width in (1e-3, 1e5):
            yield closure_case("sphere", width, hole(3, scale=scale))


def offset() -> Iterator[Case]:
    for distance in (1e3, 1e4, 1e5, 1e6, 1e7, 9e7):
        for scale, series in ((1.0, "tunnel, cells exact in binary"), (0.1, "tunnel, cells of 0.05 m")):
            judge = same_motion(replaced_by(hole(scale=scale)))
            yield Case(series, distance, hole(scale=scale, offset=distance), judge, MAX_MOTION_DIFFERENCE)
        yield front_case("plastic tunnel", distance, failing(coulomb(), offset=distance))


def levels() -> Iterator[Case]:
    for count in range(1, 11):
        for buffer in (1, 3):
            grid = {"coarse_cell": "32.0 m", "levels": count, "buffer_cells": buffer}
            cell = 32.0 / 2 ** (count - 1)
            allowed = max(MAX_HOLE_ERROR[2], 0.4 * cell / RADIUS)  # A wall may be wrong by 0.4 of a cell.
            yield Case(f"tunnel, {buffer} rings", count, hole(grid=grid), closure_error, allowed)
    for count in (2, 3, 4):
        coarse = 2.0 ** (count - 1)
        yield closure_case("sphere", count, hole(3, grid={"coarse_cell": quantity(coarse, "m"), "levels": count}))


def length() -> Iterator[Case]:
    for height in (8, 32, 128, 512, 2048, 8192):
        scene = column(height, PRESSURE * min(1.0, 128 / height))  # It must not rise by more than a cell.
        yield Case("column of 2 cells", height, scene, rise_error, MAX_RISE_ERROR)
        yield Case("the same to 1e-9", height, tighter(scene), rise_error, MAX_RISE_ERROR)
        if height <= 128:
            yield Case("the same, explicit", height, other_scheme(scene), rise_error, MAX_RISE_ERROR)
    for width in (8.0, 64.0, 512.0):
        scene = hole(domain={"lower": lengths([-4 * width, -16]), "upper": lengths([4 * width, 16])})
        judge = same_motion(lambda values: merge(values, {"solver": {"scheme": "multigrid", "tolerance": 1e-9}}))
        yield Case("tunnel in a strip, beside 1e-9", width / 4, scene, judge, 0.01)


def tolerance() -> Iterator[Case]:
    judge = same_motion(lambda values: merge(values, {"solver": {"tolerance": 1e-11, "scheme": "multigrid"}}))
    for power in range(-1, -16, -1):
        known = LOOSE_TOLERANCE_MISS if power == -1 else None
        for scheme in ("multigrid", "explicit"):
            scene = hole(solver={"tolerance": 10.0**power, "scheme": scheme, "max_iterations": 20000})
            yield Case(f"tunnel, {scheme}", 10.0**power, scene, judge, 0.01, known)
        scene = failing(coulomb(), solver={"tolerance": 10.0**power, "max_iterations": 5000})
        yield front_case("plastic tunnel", 10.0**power, scene, known=known)
    yield closure_case("tunnel, multigrid", 1e-16, hole(solver={"tolerance": 1e-16}))


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
