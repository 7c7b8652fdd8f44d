"""Errors of runs as shares, compared with a closed form or with a run that must give the same answer.

A judge takes the scene, its outcome, and a function that runs another scene. It returns inf where nothing can be
compared.
"""

from collections.abc import Callable

import numpy as np
import xarray as xr

from verification.cavities.coulomb import CoulombRock, PlasticSphere, PlasticTunnel
from verification.extremes.outcomes import RESTS, Outcome
from verification.scenes import MINED_HEIGHT
from verification.studies import merge

CLOSURE_RADII = 1.5, 3.0  # Distances in radii between which a hole's closure is measured.
Judge = Callable[[dict, Outcome, Callable[[dict], Outcome]], float]


def number(text) -> float:
    """Number of a quantity that is written in its SI unit."""
    return float(str(text).split()[0])


def last(outcome: Outcome) -> xr.Dataset:
    """The state at the end."""
    return list(outcome.stored.values())[-1]


def dimension_of(values: dict) -> int:
    """2 or 3."""
    return 2 if values["plane"] != "none" else 3


def closure_error(values: dict, outcome: Outcome, run=None) -> float:
    """Error of the mean closure of an elastic hole at distances between CLOSURE_RADII, as a share of the empty hole's.

    u r^(d - 1) = (p - q) a^d / (2 (d - 1) G) with q the stress in a fill that is placed at once. It follows from
    (p - q) / (2 (d - 1) G) = q / s, s = 2 (lambda + G) of the fill for a disc in plane strain and 3 lambda + 2 G for a
    ball. The empty hole's closure is the scale, since a stiff fill leaves no closure.
    """
    d = dimension_of(values)
    entry, host = values["excavations"][0], values["materials"]["host"]
    radius, pressure = number(entry["radius"]), -number(values["insitu_stress"]["constant"]["xx"])
    shear = number(host["youngs_modulus"]) / (2 * (1 + number(host["poisson_ratio"])))
    inward, distance = _inward(values, outcome, outcome.stored["elastic"], *CLOSURE_RADII)
    empty = pressure * radius**d / (2 * (d - 1) * shear)
    expected = 1.0
    if entry.get("fill"):
        fill = values["materials"][entry["fill"]]
        young, nu = number(fill["youngs_modulus"]), number(fill["poisson_ratio"])
        bulk = young / ((1 + nu) * (1 - 2 * nu)) * (1.0 if d == 2 else 1.0 + nu)  # 2 (lambda + G), 3 lambda + 2 G
        expected = 1.0 / (1.0 + bulk / (2 * (d - 1) * shear))
    return abs(float((inward * distance ** (d - 1)).mean()) / empty - expected)


def _inward(values: dict, outcome: Outcome, state: xr.Dataset, near: float, out: float) -> tuple:
    """Inward displacement (node,) m of the nodes between so many radii of a hole, and their distance (node,) m."""
    entry, center = values["excavations"][0], np.zeros(3)
    center[[0, 2] if dimension_of(values) == 2 else slice(None)] = [number(value) for value in entry["center"]]
    place = state.node_position.values - center
    distance = np.linalg.norm(place, axis=1)
    ring = (distance > near * number(entry["radius"])) & (distance < out * number(entry["radius"]))
    return -(state.node_displacement.values[ring] * place[ring]).sum(axis=1) / distance[ring], distance[ring]


def plastic_ring(values: dict):
    """Closed form of a scene's hole in Coulomb rock. Friction must be above zero."""
    host = values["materials"]["host"]
    pairs = {
        name: {state: number(value) for state, value in host[name].items()}
        for name in ("friction_angle", "dilation_angle", "cohesion")
    }
    rock = CoulombRock.of(pairs | {name: number(host[name]) for name in ("youngs_modulus", "poisson_ratio")})
    kind = PlasticTunnel if dimension_of(values) == 2 else PlasticSphere
    pressure = -number(values["insitu_stress"]["constant"]["xx"])
    return kind(number(values["excavations"][0]["radius"]), pressure, rock)


def front(values: dict) -> float:
    """Radius, m, up to which rock around the hole fails in closed form.

    Without friction it is the limit N to 1: s_r = n sigma_c ln(r / a) in failed rock, and
    q = ((n + 1) p - n sigma_c) / (n + 1) at the front.
    """
    host, n = values["materials"]["host"], dimension_of(values) - 1
    if number(host["friction_angle"]["intact"]) > 0.0:
        ring = plastic_ring(values)
        return max(ring.plastic_radius, ring.radius)
    pressure, strength = -number(values["insitu_stress"]["constant"]["xx"]), 2 * number(host["cohesion"]["intact"])
    at_front = max(0.0, pressure - n * strength / (n + 1))
    return number(values["excavations"][0]["radius"]) * float(np.exp(at_front / (n * strength)))


def front_error(values: dict, outcome: Outcome, run=None) -> float:
    """Error of the radius of failed rock, which follows from its volume, as a share of the closed form's."""
    d, radius = dimension_of(values), number(values["excavations"][0]["radius"])
    shape = np.pi if d == 2 else 4.0 / 3.0 * np.pi
    failed = float(last(outcome).attrs["failed_volume"])
    return abs((failed / shape + radius**d) ** (1 / d) / front(values) - 1.0)


def wall_error(values: dict, outcome: Outcome, run=None) -> float:
    """Mean error of the closure between 1.1 radii and the front, where dilation shows, over the closed form's mean."""
    ring = plastic_ring(values)
    inward, distance = _inward(values, outcome, last(outcome), 1.1, ring.plastic_radius / ring.radius)
    if not len(inward):
        return np.inf
    exact = -ring.displacement(distance)
    return float(np.abs(inward - exact).mean() / np.abs(exact).mean())


def rise_error(values: dict, outcome: Outcome, run=None) -> float:
    """Largest error of a column's rise, u = p z / (lambda + 2 mu) in each layer, over the largest rise."""
    pressure = -number(values["insitu_stress"]["constant"]["zz"])
    state, top = outcome.stored["elastic"], number(values["domain"]["upper"][1])
    stiff = []
    for name in ("host", "upper"):
        young, nu = (number(values["materials"][name][key]) for key in ("youngs_modulus", "poisson_ratio"))
        stiff.append(young * (1 - nu) / ((1 + nu) * (1 - 2 * nu)))
    z, middle = state.node_position.values[:, 2], top // 2
    rock = z <= top - MINED_HEIGHT
    exact = pressure * (np.minimum(z, middle) / stiff[0] + np.maximum(z - middle, 0.0) / stiff[1])
    error = np.abs(state.node_displacement.values[:, 2] - exact)[rock]
    return float(error.max() / exact[rock].max())


def same_motion(change: Callable[[dict], dict], turn: int = 1, stage: str = "elastic") -> Judge:
    """Judge by the motion of the changed scene at the same places: the largest difference over the largest motion.

    turn: -1 where x of the changed scene is mirrored. stage: "elastic", or "last" for the last state.
    """

    def judge(values: dict, outcome: Outcome, run) -> float:
        other = run(change(values))
        if other.kind != RESTS:
            return np.inf
        own, others = (last(each) if stage == "last" else each.stored[stage] for each in (outcome, other))
        turned = np.array([turn, 1.0, 1.0])
        places = own.node_position.values, others.node_position.values * turned
        if len(places[0]) != len(places[1]):
            return np.inf
        order = [np.lexsort(np.round(place - place.min(axis=0), 6).T) for place in places]
        motion = others.node_displacement.values[order[1]] * turned
        largest = np.abs(motion).max()
        return float(np.abs(own.node_displacement.values[order[0]] - motion).max() / max(largest, 1e-300))

    return judge


def same_fact(name: str, change: Callable[[dict], dict], stage: str = "elastic") -> Judge:
    """Judge by an attribute of the changed scene's state: the difference over the larger of the two. stage as above."""

    def judge(values: dict, outcome: Outcome, run) -> float:
        other = run(change(values))
        if other.kind != RESTS:
            return np.inf
        states = [last(each) if stage == "last" else each.stored[stage] for each in (outcome, other)]
        first, second = (float(state.attrs[name]) for state in states)
        return abs(first - second) / max(abs(first), abs(second), 1e-300)

    return judge


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


def mirrored(values: dict) -> dict:
    """A section mirrored in x."""
    boxes = [
        entry | {"lower": [_minus(entry["upper"][0]), entry["lower"][1]],
                 "upper": [_minus(entry["lower"][0]), entry["upper"][1]]}
        for entry in values["excavations"]
    ]  # fmt: skip
    return merge(values, {"excavations": boxes})


def _minus(length: str) -> str:
    return f"{-number(length)!r} m"


def finer(values: dict) -> dict:
    """The scene on cells of half the size everywhere."""
    return merge(values, {"grid": {"coarse_cell": f"{number(values['grid']['coarse_cell']) / 2!r} m"}})
