"""Scenes of studies that drive the numerics to their limits, as mine files would hold them, and changes of scenes."""

from collections.abc import Callable

import numpy as np

from verification.studies import merge

RADIUS, PRESSURE, MODULUS, POISSON = 4.0, 20e6, 20e9, 0.25  # The hole and its rock; m, Pa, Pa.
HALF_WIDTH = {2: 48.0, 3: 24.0}  # Half the domain's width, m.
FINEST_CELL = {2: 0.5, 3: 1.0}  # m
LEVELS = {2: 4, 3: 3}
SECTION_SIDE, SECTION_CELL = 32.0, 1.0  # Section that shapes are mined in, and its finest cells, m.
SECTION_STRESS = {"xx": "-10e6 Pa", "yy": "-12e6 Pa", "zz": "-20e6 Pa"}
ADAPTIVE = {"refinement": "adaptive", "max_cells": 3000}
MINED_HEIGHT = 4.0  # Height of what is mined at the top of a column, m.


def quantity(value: float, unit: str) -> str:
    """A quantity of the mine file, with every digit."""
    return f"{float(value)!r} {unit}"


def value_of(text: str | float) -> float:
    """Number of a quantity of the mine file, in the unit that it is written in."""
    return float(str(text).split()[0])


def lengths(values) -> list[str]:
    """A point of the mine file."""
    return [quantity(value, "m") for value in values]


def box(lower, upper) -> dict:
    """A box between two corners, m, as keys of an entry of the mine file."""
    return {"shape": "box", "lower": lengths(lower), "upper": lengths(upper)}


def strengths(unit: str, intact: float, residual: float) -> dict[str, str]:
    """A strength of the mine file before and after failure."""
    return {"intact": quantity(intact, unit), "residual": quantity(residual, unit)}


def elastic(modulus: float = MODULUS, poisson: float = POISSON) -> dict:
    """Elastic rock. modulus: Pa."""
    return {
        "model": "elastic", "youngs_modulus": quantity(modulus, "Pa"), "poisson_ratio": float(poisson),
        "density": "2700 kg/m^3",
    }  # fmt: skip


def coulomb(
    friction: float = 30.0, cohesion: float = 3e6, dilation: float = 10.0, share: float = 1.0, **changes
) -> dict:
    """Coulomb rock without a tension cut-off. Angles in degrees, cohesion in Pa.

    share: of cohesion that failed rock keeps (1: perfectly plastic).
    """
    rock = elastic() | {
        "model": "coulomb",
        "friction_angle": strengths("deg", friction, friction),
        "dilation_angle": strengths("deg", dilation, dilation),
        "cohesion": strengths("Pa", cohesion, cohesion * share),
        "tension_cutoff": "none",
    }
    return merge(rock, changes)


def isotropic(pressure: float) -> dict[str, str]:
    """Components of an all-round stress. pressure: Pa, compression positive."""
    return {component: quantity(-pressure, "Pa") for component in ("xx", "yy", "zz")}


def hole(dimension: int = 2, scale: float = 1.0, offset: float = 0.0, pressure: float = PRESSURE, **changes) -> dict:
    """A round hole (a tunnel's section, or a sphere) of RADIUS under all-round stress.

    scale: factor of all lengths. offset: shift along x, m. pressure: Pa. changes: merged over the scene.
    """
    half, finest = HALF_WIDTH[dimension] * scale, FINEST_CELL[dimension] * scale
    middle = np.zeros(dimension)
    middle[0] = offset
    values = {
        "name": "hole",
        "plane": "xz" if dimension == 2 else "none",
        "frame": {"surface": quantity(2 * half, "m")},
        "domain": {"lower": lengths(middle - half), "upper": lengths(middle + half), "boundary": "fixed"},
        "grid": {
            "coarse_cell": quantity(finest * 2 ** (LEVELS[dimension] - 1), "m"), "levels": LEVELS[dimension],
            "buffer_cells": 2, "refinement": "static",
        },
        "insitu_stress": {"constant": isotropic(pressure)},
        "materials": {"host": elastic()},
        "excavations": [
            {"name": "hole", "step": "history", "shape": "circle" if dimension == 2 else "sphere",
             "center": lengths(middle), "radius": quantity(RADIUS * scale, "m")}
        ],
        "steps": [{"name": "history"}],
        "solver": {"tolerance": 1e-5, "increments": 4},
    }  # fmt: skip
    return merge(values, changes)


def failing(rock: dict, dimension: int = 2, **changes) -> dict:
    """The hole in rock that fails, on cells that follow the rock, with a smaller limit of iterations."""
    base = {"materials": {"host": rock}, "grid": ADAPTIVE, "solver": {"max_iterations": 1500}}
    return hole(dimension, **merge(base, changes))


def filled(modulus: float, poisson: float = POISSON, dimension: int = 2, **changes) -> dict:
    """The hole with a fill of this modulus (Pa) that is placed at once."""
    values = hole(dimension, **changes)
    values["excavations"][0]["fill"] = "fill"
    return merge(values, {"materials": {"fill": elastic(modulus, poisson)}})


def column(height: int, pressure: float = PRESSURE, upper: float = MODULUS, **changes) -> dict:
    """A column between rollers, two cells of 1 m wide and `height` such cells high, whose top is mined.

    The rest rises in uniaxial strain. Its displacement is linear in each layer, and so exact on any grid. upper:
    modulus of the upper half, Pa.
    """
    values = {
        "name": "column",
        "plane": "xz",
        "frame": {"surface": quantity(height, "m")},
        "domain": {
            "lower": lengths([0, 0]), "upper": lengths([2, height]),
            "boundary": {"x": "roller", "z_lower": "fixed", "z_upper": "roller"},
        },
        "grid": {"coarse_cell": "1 m", "levels": 1, "buffer_cells": 1, "refinement": "static"},
        "insitu_stress": {"constant": isotropic(pressure)},
        "materials": {"host": elastic(), "upper": elastic(upper)},
        "rock_bodies": [{"name": "cap", "material": "upper"} | box([0, height // 2], [2, height])],
        "excavations": [{"name": "top", "step": "history"} | box([0, height - MINED_HEIGHT], [2, height])],
        "steps": [{"name": "history"}],
        "solver": {"tolerance": 1e-5, "increments": 1},
    }  # fmt: skip
    return merge(values, changes)


def section(boxes: list, host: dict | None = None, cell: float = SECTION_CELL, **changes) -> dict:
    """A weightless section of SECTION_SIDE. boxes (x0, z0, x1, z1), m, are mined at once. cell: the finest, m."""
    values = {
        "name": "section",
        "plane": "xz",
        "frame": {"surface": quantity(SECTION_SIDE, "m")},
        "domain": {
            "lower": lengths([-SECTION_SIDE / 2, 0]), "upper": lengths([SECTION_SIDE / 2, SECTION_SIDE]),
            "boundary": "fixed",
        },
        "grid": {"coarse_cell": quantity(4 * cell, "m"), "levels": 3, "buffer_cells": 1, "refinement": "static"},
        "insitu_stress": {"constant": dict(SECTION_STRESS)},
        "materials": {"host": host or elastic()},
        "excavations": [
            {"name": f"box_{number}", "step": "history"} | box(corners[:2], corners[2:])
            for number, corners in enumerate(boxes)
        ],
        "steps": [{"name": "history"}],
        "solver": {"tolerance": 1e-5, "increments": 4},
    }  # fmt: skip
    return merge(values, changes)


def replaced_by(scene: dict) -> Callable[[dict], dict]:
    """The change of any scene into this one."""
    return lambda values: scene


def other_scheme(values: dict) -> dict:
    """The scene by the other scheme."""
    scheme = values["solver"].get("scheme", "multigrid")
    return merge(values, {"solver": {"scheme": "explicit" if scheme == "multigrid" else "multigrid"}})


def tighter(values: dict) -> dict:
    """The scene at a tolerance of 1e-9."""
    return merge(values, {"solver": {"tolerance": 1e-9}})


def finer(values: dict) -> dict:
    """The scene on cells of half the size everywhere."""
    return merge(values, {"grid": {"coarse_cell": quantity(value_of(values["grid"]["coarse_cell"]) / 2, "m")}})


def mirrored(values: dict) -> dict:
    """A section mirrored in x."""
    boxes = []
    for entry in values["excavations"]:
        (left, bottom), (right, top) = entry["lower"], entry["upper"]
        corners = {"lower": [*lengths([-value_of(right)]), bottom], "upper": [*lengths([-value_of(left)]), top]}
        boxes.append(entry | corners)
    return merge(values, {"excavations": boxes})
