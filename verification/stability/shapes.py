"""Cases of shapes and of walls within cells, and of numerics that no key of a mine file sets.

The share of the stable time step and single precision are set within this process while a case runs.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from unittest.mock import patch

import numpy as np

from mpm_core.equilibrium import body
from verification.extremes.outcomes import LAST
from verification.rows import KnownMiss
from verification.scenes import (
    ADAPTIVE,
    coulomb,
    failing,
    finer,
    hole,
    mirrored,
    other_scheme,
    replaced_by,
    section,
    tighter,
)
from verification.stability.cases import (
    LOOSE_TOLERANCE_MISS,
    MAX_MOTION_DIFFERENCE,
    Case,
    Knob,
    closure_case,
    front_case,
)
from verification.stability.judges import same_fact, same_motion

MAX_CHANGE_ON_FINER_CELLS = 0.15  # Share of the energy set in motion. Corners of openings converge slowly.
# Share of the largest motion. In perfectly plastic rock the schemes reach different equilibria within the tolerance.
MAX_PLASTIC_DIFFERENCE = 0.05
MOTION = "energy_motion"
BOXES: dict[str, list[tuple[float, float, float, float]]] = {
    # x0, z0, x1, z1, m. The section has finest cells of 1 m and x = 0 in its middle. The boxes are not symmetric.
    "two cells wide": [(-6, 10, -4, 20)],
    "one cell wide": [(-6, 10, -5, 20)],
    "one cell": [(3, 10, 4, 11)],
    "half a cell wide": [(-6, 10, -5.5, 20)],
    "a tenth of a cell wide": [(-6, 10, -5.9, 20)],
    "a thousandth of a cell wide": [(-6, 10, -5.999, 20)],
    "touching at a face": [(-6, 10, -2, 14), (-2, 10, 3, 16)],
    "touching at an edge": [(-6, 10, -2, 14), (-2, 14, 3, 18)],
    "crossing": [(-8, 12, 6, 15), (-3, 6, 1, 22)],
    "one within another": [(-8, 8, 6, 18), (-3, 10, 1, 14)],
    "at the domain's edge": [(-16, 10, -12, 18)],
    "in the domain's corner": [(10, 0, 16, 6)],
    "across the domain's edge": [(12, 10, 20, 18)],
    "outside the domain": [(17, 10, 20, 18)],
    "nearly all of the domain": [(-15, 1, 15, 31)],
    "all but a cell at one side": [(-16, 0, 15, 32)],
    "all of the domain": [(-16, 0, 16, 32)],
    "rock cut in two": [(-16, 12, 16, 16)],
    "a floating block": [(-8, 8, 6, 10), (-8, 16, 6, 18), (-8, 10, -6, 16), (4, 10, 6, 16)],
    "a block on one cell": [(-8, 8, 6, 10), (-8, 16, 6, 18), (-8, 10, -6, 16), (4, 11, 6, 16)],
    "one-cell pillars": [(-9, 10, -5, 16), (-4, 10, 0, 16), (1, 10, 5, 16)],
    "a pillar half a cell wide": [(-9, 10, -5, 16), (-4.5, 10, 0, 16)],
    "a pillar of a tenth of a cell": [(-9, 10, -5, 16), (-4.9, 10, 0, 16)],
}
FREE = {"boundary": {"z_lower": "fixed", "z_upper": "traction", "x": "traction"}}
HANGING = KnownMiss(
    "Explicit steps only: a block that hangs by one cell turns so slowly that forces balance to 1e-5 before it has "
    "turned. Multigrid is within 3e-5; explicit steps within 0.3 % at a tolerance of 1e-7.",
    0.35,
)
ONE_CELL = KnownMiss("An opening of one cell moves as that cell's corners can: two cells across are within 2 %.", 0.35)
SWAYING = KnownMiss(
    "Explicit steps only: a pillar of half a cell sways so slowly that forces balance to 1e-5 before it stands. The "
    "error goes with the tolerance.",
    1.5e-3,
)
SLOW = {"a block on one cell": HANGING, "a pillar half a cell wide": SWAYING}
UNLIKE = ("touching at an edge", "a block on one cell", "one-cell pillars", "a pillar half a cell wide")
AT_CORNERS = KnownMiss(
    "Perfectly plastic rock that dilates below its friction may rest in more than one way: where it hangs by a cell or "
    "less the schemes arrive at two of them, at every tolerance (cascade_tolerance 1e-3 to 1e-5).",
    0.25,
)
CRUMBS = KnownMiss(
    "A pillar thinner than the samples of a cell (an eighth) falls in crumbs; the last one stays, at its foot or top. "
    "Only the nodes of that crumb differ: all others agree to 1e-4.",
    1.5,
)
HALF_WAY = KnownMiss(
    "cut_cells: whole takes cells whose middle is mined: a box of 8 m with walls in the middle of cells becomes 9 m "
    "wide. The grid says by how much its volume is off.",
    0.25,
)
LOST_DIGITS = KnownMiss(
    "Explicit steps in single precision only: what a step adds below the last digit of stress or displacement is lost. "
    "After hundreds of steps the two do not belong together, and the energy balance lacks more than the round-off of "
    "double precision.",
    3e-6,
)
MANY_STEPS_TOLERANCE = 2e-7  # Below it explicit steps are so many that lost digits add up.
WALL_OFFSETS = (0.0, 1e-12, 1e-6, 0.125, 0.25, 0.5, 0.75, 1.0 - 1e-12)  # Shares of a cell. Particles lie at 0.5.


def shapes() -> Iterator[Case]:
    mirror_image, schemes = same_motion(mirrored, turn=-1), same_motion(other_scheme)
    for title, boxes in BOXES.items():
        scene = section(boxes)
        yield Case("beside a tolerance of 1e-9", title, scene, same_motion(tighter), MAX_MOTION_DIFFERENCE)
        explicit = other_scheme(scene)
        yield Case("explicit, beside multigrid", title, explicit, schemes, MAX_MOTION_DIFFERENCE, SLOW.get(title))
        crumbs = CRUMBS if title == "a pillar of a tenth of a cell" else None
        yield Case("beside its mirror image", title, scene, mirror_image, MAX_MOTION_DIFFERENCE, crumbs)
        known = ONE_CELL if title == "one cell" else None
        yield Case("beside finer cells", title, scene, same_fact(MOTION, finer), MAX_CHANGE_ON_FINER_CELLS, known)
        scene = section(boxes, coulomb(cohesion=6e6))
        judge = same_motion(other_scheme, stage=LAST)
        known = AT_CORNERS if title in UNLIKE else None
        yield Case("plastic, beside the other scheme", title, scene, judge, MAX_PLASTIC_DIFFERENCE, known)
        free = section(boxes, domain=FREE)
        yield Case("held at the floor alone, mirror image", title, free, mirror_image, MAX_MOTION_DIFFERENCE, crumbs)
        scene = section(boxes, coulomb(cohesion=6e6, share=0.3), solver={"increments": 0}, grid=ADAPTIVE)
        yield Case("brittle", title, scene, None, 0.0)


def walls() -> Iterator[Case]:
    judge = same_fact(MOTION, replaced_by(section([(-6, 10, 2, 16)])))
    for share in WALL_OFFSETS:
        for cut in ("mean", "whole", "subdivide"):
            scene = section([(-6 + share, 10, 2 + share, 16)], grid={"cut_cells": cut})
            known = HALF_WAY if (cut, share) == ("whole", 0.5) else None
            yield Case(f"box moved along x, {cut}", share, scene, judge, MAX_CHANGE_ON_FINER_CELLS, known)
        scene = section([(-6 + share, 10, 2 + share, 16)], grid={"particles_per_cell": 4})
        yield Case("box moved along x, 4 particles", share, scene, judge, MAX_CHANGE_ON_FINER_CELLS)


@contextmanager
def courant(factor: float, damping: float) -> Iterator[None]:
    """Set the time step to `factor` times its limit without damping, in place of the share that the body takes."""
    with patch.object(body, "TIME_STEP_SHARE", factor * np.sqrt(1.0 + damping)):
        yield


def time_step() -> Iterator[Case]:
    limit = {"scheme": "explicit", "max_iterations": 5000}
    for factor in (0.1, 0.2, 0.4, 0.6, 0.7, 0.75, 0.8, 0.9, 1.0, 1.1, 1.2, 1.5):
        under = partial(courant, factor, 0.7)
        yield closure_case("tunnel", factor, hole(solver=limit), under=under)
        yield front_case("plastic tunnel", factor, failing(coulomb(), solver=limit), under=under)
        moving: dict = {"solver": limit | {"move": True}, "grid": {"particles_per_cell": 4, "cut_cells": "whole"}}
        yield closure_case("tunnel, particles move", factor, hole(**moving), under=under)


def damping() -> Iterator[Case]:
    for share in (0.0, 0.01, 0.1, 0.3, 0.5, 0.7, 0.85, 0.95, 0.99, 1.0):
        solver = {"scheme": "explicit", "damping": share, "max_iterations": 5000}
        yield closure_case("tunnel", share, hole(solver=solver))
        unscaled = solver | {"density_scaling": False}
        yield closure_case("tunnel, densities as they are", share, hole(solver=unscaled))
        yield front_case("plastic tunnel", share, failing(coulomb(), solver=solver))


@contextmanager
def single_precision() -> Iterator[None]:
    """Round stress, displacement and hourglass forces to float32 after every update of stress, in either scheme."""
    update = body.Body.update

    def rounded(self: body.Body, *arguments) -> None:
        update(self, *arguments)
        for array in (self.state.stress, self.state.displacement, self.state.hourglass_force):
            array[...] = array.astype(np.float32)

    with patch.object(body.Body, "update", rounded):
        yield


def float32() -> Iterator[Case]:
    judge = same_motion(replaced_by(hole(solver={"tolerance": 1e-11})))
    for power in range(-1, -11, -1):
        known = LOOSE_TOLERANCE_MISS if power == -1 else None
        solver = {"tolerance": 10.0**power, "scheme": "multigrid", "max_iterations": 5000}
        for scheme in ("multigrid", "explicit"):
            scene = hole(solver=solver | {"scheme": scheme})
            lost = LOST_DIGITS if scheme == "explicit" and 10.0**power < MANY_STEPS_TOLERANCE else None
            yield Case(f"tunnel, {scheme}", 10.0**power, scene, judge, 0.01, known or lost, under=single_precision)
        scene = failing(coulomb(), solver=solver)
        yield front_case("plastic tunnel", 10.0**power, scene, known=known, under=single_precision)


SHAPES = (
    Knob("shapes", "shape of what is mined", "none", "Boxes in a section of 32 m, cells of 1 m.", shapes),
    Knob("walls", "place of walls within a cell", "linear", "A box of 8 by 6 m, moved by parts of a cell, beside the "
         "one whose walls are faces of cells of 1 m: at 0.5 particles lie in its walls.", walls),
    Knob("time_step", "time step over the undamped limit", "linear", "The Courant factor of scheme explicit. No key: "
         "the body takes 0.98 of the limit that damping leaves (0.75 at damping 0.7); driven from within.", time_step),
    Knob("damping", "local damping", "linear", "Of scheme explicit, in 5,000 steps.", damping),
    Knob("float32", "tolerance, numbers rounded to float32", "log", "Not offered: stress, displacement and hourglass "
         "forces rounded after every update, here from within. The V-cycle has always been in single precision.",
         float32),
)  # fmt: skip
