"""Errors of runs as shares, compared with a closed form or with a run that must give the same answer.

A judge takes the scene, its outcome, and a function that runs another scene. It returns inf where nothing can be
compared.
"""

from collections.abc import Callable

import numpy as np
import xarray as xr

from verification.cavities.coulomb import CoulombRock, PlasticSphere, PlasticTunnel
from verification.extremes.outcomes import LAST, RESTS, Outcome
from verification.scenes import MINED_HEIGHT, value_of

CLOSURE_RADII = 1.5, 3.0  # Distances in radii between which a hole's closure is measured.
ErrorMeasure = Callable[[dict, Outcome, Callable[[dict], Outcome]], float]


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
    radius, pressure = value_of(entry["radius"]), -value_of(values["insitu_stress"]["constant"]["xx"])
    shear = value_of(host["youngs_modulus"]) / (2 * (1 + value_of(host["poisson_ratio"])))
    inward, distance = _inward(values, outcome.state("elastic"), *CLOSURE_RADII)
    empty = pressure * radius**d / (2 * (d - 1) * shear)
    expected = 1.0
    if entry.get("fill"):
        fill = values["materials"][entry["fill"]]
        young, nu = value_of(fill["youngs_modulus"]), value_of(fill["poisson_ratio"])
        bulk = young / ((1 + nu) * (1 - 2 * nu)) * (1.0 if d == 2 else 1.0 + nu)  # 2 (lambda + G), 3 lambda + 2 G
        expected = 1.0 / (1.0 + bulk / (2 * (d - 1) * shear))
    return abs(float((inward * distance ** (d - 1)).mean()) / empty - expected)


def _inward(values: dict, state: xr.Dataset, near: float, out: float) -> tuple:
    """Inward displacement (node,) m of the nodes between so many radii of a hole, and their distance (node,) m."""
    entry, center = values["excavations"][0], np.zeros(3)
    center[[0, 2] if dimension_of(values) == 2 else slice(None)] = [value_of(value) for value in entry["center"]]
    place = state.node_position.values - center
    distance = np.linalg.norm(place, axis=1)
    ring = (distance > near * value_of(entry["radius"])) & (distance < out * value_of(entry["radius"]))
    return -(state.node_displacement.values[ring] * place[ring]).sum(axis=1) / distance[ring], distance[ring]


def plastic_ring(values: dict):
    """Closed form of a scene's hole in Coulomb rock. Friction must be above zero."""
    host = values["materials"]["host"]
    pairs = {
        name: {state: value_of(value) for state, value in host[name].items()}
        for name in ("friction_angle", "dilation_angle", "cohesion")
    }
    rock = CoulombRock.of(pairs | {name: value_of(host[name]) for name in ("youngs_modulus", "poisson_ratio")})
    kind = PlasticTunnel if dimension_of(values) == 2 else PlasticSphere
    pressure = -value_of(values["insitu_stress"]["constant"]["xx"])
    return kind(value_of(values["excavations"][0]["radius"]), pressure, rock)


def front(values: dict) -> float:
    """Radius, m, up to which rock around the hole fails in closed form.

    Without friction it is the limit N to 1: s_r = n sigma_c ln(r / a) in failed rock, and
    q = ((n + 1) p - n sigma_c) / (n + 1) at the front.
    """
    host, n = values["materials"]["host"], dimension_of(values) - 1
    if value_of(host["friction_angle"]["intact"]) > 0.0:
        ring = plastic_ring(values)
        return max(ring.plastic_radius, ring.radius)
    pressure, strength = -value_of(values["insitu_stress"]["constant"]["xx"]), 2 * value_of(host["cohesion"]["intact"])
    at_front = max(0.0, pressure - n * strength / (n + 1))
    return value_of(values["excavations"][0]["radius"]) * float(np.exp(at_front / (n * strength)))


def front_error(values: dict, outcome: Outcome, run=None) -> float:
    """Error of the radius of failed rock, which follows from its volume, as a share of the closed form's."""
    d, radius = dimension_of(values), value_of(values["excavations"][0]["radius"])
    shape = np.pi if d == 2 else 4.0 / 3.0 * np.pi
    failed = float(outcome.state(LAST).attrs["failed_volume"])
    return abs((failed / shape + radius**d) ** (1 / d) / front(values) - 1.0)


def wall_error(values: dict, outcome: Outcome, run=None) -> float:
    """Mean error of the closure between 1.1 radii and the front, where dilation shows, over the closed form's mean."""
    ring = plastic_ring(values)
    inward, distance = _inward(values, outcome.state(LAST), 1.1, ring.plastic_radius / ring.radius)
    if not len(inward):
        return np.inf
    exact = -ring.displacement(distance)
    return float(np.abs(inward - exact).mean() / np.abs(exact).mean())


def rise_error(values: dict, outcome: Outcome, run=None) -> float:
    """Largest error of a column's rise, u = p z / (lambda + 2 mu) in each layer, over the largest rise."""
    pressure = -value_of(values["insitu_stress"]["constant"]["zz"])
    state, top = outcome.state("elastic"), value_of(values["domain"]["upper"][1])
    stiff = []
    for name in ("host", "upper"):
        young, nu = (value_of(values["materials"][name][key]) for key in ("youngs_modulus", "poisson_ratio"))
        stiff.append(young * (1 - nu) / ((1 + nu) * (1 - 2 * nu)))
    z, middle = state.node_position.values[:, 2], top // 2
    rock = z <= top - MINED_HEIGHT
    exact = pressure * (np.minimum(z, middle) / stiff[0] + np.maximum(z - middle, 0.0) / stiff[1])
    error = np.abs(state.node_displacement.values[:, 2] - exact)[rock]
    return float(error.max() / exact[rock].max())


def compared(
    difference: Callable[[xr.Dataset, xr.Dataset], float], change: Callable[[dict], dict], stage: str
) -> ErrorMeasure:
    """Error by the difference of two states at a stage: the scene's, and the changed scene's if it rests."""

    def judge(values: dict, outcome: Outcome, run) -> float:
        other = run(change(values))
        return difference(outcome.state(stage), other.state(stage)) if other.kind == RESTS else np.inf

    return judge


def same_motion(change: Callable[[dict], dict], turn: int = 1, stage: str = "elastic") -> ErrorMeasure:
    """Error by the motion of the changed scene at the same places: the largest difference over the largest motion.

    turn: -1 where x of the changed scene is mirrored. stage: name of the state, or LAST.
    """
    turned = np.array([turn, 1.0, 1.0])

    def difference(own: xr.Dataset, others: xr.Dataset) -> float:
        places = own.node_position.values, others.node_position.values * turned
        if len(places[0]) != len(places[1]):
            return np.inf
        order = [np.lexsort(np.round(place - place.min(axis=0), 6).T) for place in places]
        motion = others.node_displacement.values[order[1]] * turned
        largest = np.abs(motion).max()
        return float(np.abs(own.node_displacement.values[order[0]] - motion).max() / max(largest, 1e-300))

    return compared(difference, change, stage)


def same_fact(name: str, change: Callable[[dict], dict]) -> ErrorMeasure:
    """Error by an attribute of the changed scene's elastic state: the difference over the larger of the two."""

    def difference(*states: xr.Dataset) -> float:
        first, second = (float(state.attrs[name]) for state in states)
        return abs(first - second) / max(abs(first), abs(second), 1e-300)

    return compared(difference, change, "elastic")
