"""Random configurations by seed. Sizes, stresses, strengths, boundaries and openings span many orders."""

import numpy as np

from verification.scenes import box, elastic, lengths, quantity, strengths, value_of

STEPS = ("history", "first", "second")
VARIED = 3  # One in so many mines has rock whose strength varies, and rock that may fall.
CONDITIONS = ("fixed", "roller", "traction", "free")
FACES = {
    dimension: [f"{axis}_{side}" for axis in axes for side in ("lower", "upper")]
    for dimension, axes in ((2, "xz"), (3, "xyz"))
}


def random_mine(seed: int) -> dict:
    """Configuration of the scene of this seed, as a mine file would hold it. Some configurations must be refused."""
    random = np.random.default_rng([2026, seed])
    plane = str(random.choice(["xz", "xy", "none"], p=[0.4, 0.3, 0.3]))
    dimension = 3 if plane == "none" else 2
    coarse = float(random.choice([0.1, 0.3, 1.0, 1.25, 7.0, 10.0, 33.3]))
    base = random.integers(3, 9 if dimension == 2 else 5, dimension)
    lower = np.full(dimension, float(random.choice([0.0, -57.3, 1000.1, 1e6])))
    upper = lower + base * coarse
    height = upper[-1] - lower[-1]
    surface = upper[-1] + height * float(random.choice([0.0, 1.0, 20.0]))
    size = 10.0 ** random.uniform(3.0, 8.5)  # Virgin stress, Pa.
    weight = plane != "xy" and random.random() < 0.6
    boundary = "fixed" if random.random() < 0.5 else _faces(random, FACES[dimension])
    if weight and isinstance(boundary, dict):
        boundary["z_lower"] = str(random.choice(["fixed", "roller"]))
    if plane == "xy" and isinstance(boundary, dict):
        boundary = {face.replace("z", "y"): condition for face, condition in boundary.items()}
    materials = {"host": _rock(random, size), "fill": _elastic(random, size * 10.0 ** random.uniform(0.5, 3.0))}
    bodies = []
    for number in range(random.integers(0, 3)):
        stiff = size * 10.0 ** random.uniform(2.0, 4.0) * 10.0 ** random.uniform(-6.0, 6.0)
        materials[f"body_{number}"] = _elastic(random, stiff) if random.random() < 0.5 else _rock(random, size)
        bodies.append({"name": f"rock_{number}", "material": f"body_{number}"} | _box(random, lower, upper))
    excavations = []
    for number in range(random.integers(1, 5)):
        mined = int(random.integers(0, 3))
        entry = {"name": f"opening_{number}", "step": STEPS[mined]}
        if random.random() < 0.5:
            entry |= {"fill": "fill", "filled": STEPS[int(random.integers(mined, 3))]}
        entry |= _ball(random, lower, upper, dimension) if random.random() < 0.4 else _box(random, lower, upper)
        excavations.append(entry)
    mine = {
        "name": f"scene_{seed}",
        "plane": plane,
        "frame": {"surface": quantity(surface, "m")},
        "domain": {"lower": lengths(lower), "upper": lengths(upper), "boundary": boundary},
        "grid": {
            "coarse_cell": quantity(coarse, "m"),
            "levels": int(random.integers(1, 4 if dimension == 2 else 3)),
            "buffer_cells": int(random.integers(1, 3)),
            "particles_per_cell": int(random.choice([1, 2**dimension], p=[0.8, 0.2])),
            "cut_cells": str(random.choice(["mean", "whole", "subdivide"], p=[0.7, 0.15, 0.15])),
            "volume_error": 1.0 if seed % 2 else 0.2,  # Every other scene may have openings thinner than its cells.
        },
        "insitu_stress": _stress(random, size, height, weight),
        "materials": materials,
        "rock_bodies": bodies,
        "excavations": excavations,
        "steps": [{"name": name} for name in STEPS],
        "solver": {
            "scheme": str(random.choice(["multigrid", "explicit"], p=[0.9, 0.1])),
            "tolerance": 1e-4,
            "increments": int(random.choice([0, 1, 2, 5])),
            "weakest_first": float(random.choice([0.0, 0.5], p=[0.9, 0.1])),
        },
    }
    return mine if seed % VARIED else _varied(mine, seed)


def _varied(mine: dict, seed: int) -> dict:
    """The mine with strength that varies where rock loses any, and with falls. It draws from numbers of its own, so
    that the rest of the mine is what its seed always made it."""
    random = np.random.default_rng([2026, seed, 1])
    finest = value_of(mine["grid"]["coarse_cell"]) / 2 ** (mine["grid"]["levels"] - 1)
    for rock in mine["materials"].values():
        if rock["model"] == "coulomb" and _loses_strength(rock):
            length = finest * float(random.choice([2.0, 4.0, 20.0]))
            rock["variability"] = {"share": float(random.choice([0.05, 0.1, 0.3])), "length": quantity(length, "m")}
    mine["solver"]["collapse"] = "fall"
    return mine


def _loses_strength(rock: dict) -> bool:
    """True if a strength of the rock is smaller once it has failed."""
    pairs = [pair for pair in rock.values() if isinstance(pair, dict) and "residual" in pair]
    return any(value_of(pair["residual"]) < value_of(pair["intact"]) for pair in pairs)


def _faces(random, faces) -> dict:
    return {face: str(random.choice(CONDITIONS)) for face in faces}


def _box(random, lower, upper) -> dict:
    """A box within the domain or across its faces. It may be as thin as 3 % of the domain."""
    side = (upper - lower) * 10.0 ** random.uniform(-1.5, -0.2, len(lower))
    start = lower - 0.1 * side + random.random(len(lower)) * (upper - lower - 0.8 * side)
    return box(start, start + side)


def _ball(random, lower, upper, dimension: int) -> dict:
    radius = float((upper - lower).min() * 10.0 ** random.uniform(-1.5, -0.4))
    center = random.uniform(lower + 0.1 * (upper - lower), upper - 0.1 * (upper - lower))
    shape = "sphere" if dimension == 3 else "circle"
    return {"shape": shape, "center": lengths(center), "radius": quantity(radius, "m")}


def _elastic(random, modulus: float) -> dict:
    rock = elastic(modulus, random.uniform(0.0, 0.45))
    return rock | {"density": quantity(random.uniform(500.0, 4000.0), "kg/m^3")}


def _rock(random, size: float) -> dict:
    """Coulomb rock of a strength near the stress, far from it, or zero. Residual strength is within the intact one."""
    friction = float(random.uniform(10.0, 50.0))
    cohesion = float(random.choice([0.0, size * 10.0 ** random.uniform(-1.0, 1.0)], p=[0.1, 0.9]))
    friction_left = friction * float(random.choice([0.3, random.random(), 1.0]))
    cohesion_left = cohesion * float(random.choice([0.0, random.random(), 1.0]))
    cutoff: dict[str, str] | str = strengths("Pa", 0.5 * cohesion, 0.0)
    if random.random() < 0.3:  # The tip of the residual cone must not lie beyond the intact one.
        slope, slope_left = np.tan(np.radians([friction, friction_left]))
        cutoff, cohesion_left = "none", float(min(cohesion_left, 0.99 * cohesion * slope_left / slope))
    return _elastic(random, size * 10.0 ** random.uniform(2.0, 4.0)) | {
        "model": "coulomb",
        "friction_angle": strengths("deg", friction, friction_left),
        "dilation_angle": strengths("deg", friction * random.random(), friction_left * random.random()),
        "cohesion": strengths("Pa", cohesion, cohesion_left),
        "tension_cutoff": cutoff,
    }


def _stress(random, size: float, height: float, weight: bool) -> dict:
    ratios = random.uniform(0.5, 1.2, 2)
    values = {"xx": -size * ratios[0], "yy": -size * ratios[1], "zz": -size}
    if weight:
        slope = float(random.choice([0.1, 1.0])) / height
        return {
            "constant": {"zz": "0 Pa"},
            "gradient": {name: quantity(value * slope, "Pa/m") for name, value in values.items()},
        }
    values |= {"xz": 0.1 * size * random.uniform(-1.0, 1.0), "xy": 0.1 * size * random.uniform(-1.0, 1.0)}
    return {"constant": {name: quantity(value, "Pa") for name, value in values.items()}}
