"""Cracks one cell thick must give one event each, however they are oriented; two cracks with rock between, two.

A crack is the cells with -t/2 <= n . x - d < t/2 (n its unit normal, x and d in cells). With t = max |n_i| it is as
thin as it can be without a gap (a naive plane), and its cells are connected over faces and edges. With t = sum |n_i| it
is all cells that the plane n . x = d passes through (a standard plane). These are connected through faces, and no two
cells on either side of it touch (Andres et al. 1997).
"""

from itertools import product

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from common.voigt import tensor_from_voigt, voigt_from_tensor
from seismic.event_settings import EventSettings
from seismic.events import find_events
from verification.answers.clustering.known_truth import index_of_clusters, lognormal, make_points, turned
from verification.rows import Row

# Distance from the middle of a crack to the nearest corner of a cell, cells. No crack runs along faces of cells.
PLANE_OFFSET = 0.13
LINK_LENGTHS = (1.0, 2.0, 4.0)  # cells
MIN_LINK_LENGTH = 2.0  # cells; what a mine may have
SHEAR = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 1.0])


def normals(settings: dict) -> NDArray:
    """Unit normals (crack, 3) of all dips and strikes (degrees), turned about two axes by each angle of `turned`."""
    dip, strike, turn = np.array(list(product(settings["dips"], settings["strikes"], settings["turned"]))).T
    dip, strike = np.radians([dip, strike])
    upright = np.stack([np.sin(dip) * np.cos(strike), -np.sin(dip) * np.sin(strike), np.cos(dip)], axis=-1)
    return Rotation.from_euler("xy", np.stack([turn, 2.0 * turn], axis=-1), degrees=True).apply(upright)


def cells(normal: NDArray, radius: float, lower: float, upper: float, size: float = 1.0) -> NDArray:
    """Centres (cell, 3) of the cells of a lattice with lower <= n . x < upper, within a radius; unit: a cell of 1."""
    reach = int(np.ceil(radius / size)) + 1
    place = size * (np.indices((2 * reach,) * 3).reshape(3, -1).T - reach + 0.5)
    along = place @ normal
    within = np.sum(np.square(place), axis=1) - np.square(along) <= radius**2
    return place[within & (along >= lower) & (along < upper)]


def crack(normal: NDArray, radius: float, size: float = 1.0) -> NDArray:
    """A crack one cell thick, through the middle of the lattice."""
    half = 0.5 * size * np.abs(normal).max()
    return cells(normal, radius, PLANE_OFFSET - half, PLANE_OFFSET + half, size)


def two_cracks(normal: NDArray, radius: float) -> NDArray:
    """Two parallel cracks one cell thick, with more rock between them than the largest of LINK_LENGTHS."""
    thick = np.abs(normal).max()
    starts = (PLANE_OFFSET, PLANE_OFFSET + thick + max(LINK_LENGTHS) + 1.0)
    return np.concatenate([cells(normal, radius, start, start + thick) for start in starts])


def two_levels(normal: NDArray, radius: float) -> tuple[NDArray, NDArray]:
    """A crack one cell thick whose cells are twice as large on one side of a plane that it crosses: place, spacing.

    The plane is across the axis along which the crack changes its height least, so both sides of the crack meet at it.
    """
    axis = np.argmin(np.abs(normal))
    fine, coarse = crack(normal, radius), crack(normal, radius, 2.0)
    fine, coarse = fine[fine[:, axis] < 0.0], coarse[coarse[:, axis] > 0.0]
    return np.concatenate([fine, coarse]), np.repeat([1.0, 2.0], [len(fine), len(coarse)])


def crack_rows(settings: dict, allowed: dict) -> list[Row]:
    """Most and fewest events of cracks over all orientations, by method."""
    chosen, closeness = settings["cracks"], settings["families"]["shown_closeness"]
    ways = {_name(length): _stage("simultaneous", closeness, length) for length in LINK_LENGTHS}
    ways["families"] = _stage("families", closeness)
    numbers: dict[tuple, list[int]] = {}
    for normal in normals(chosen):
        single, pair = crack(normal, chosen["radius"]), two_cracks(normal, chosen["radius"])
        scenes = {
            "one crack": (single, np.ones(len(single))),
            "one crack in cells of two sizes": two_levels(normal, chosen["radius"]),
            "two cracks": (pair, np.ones(len(pair))),
        }
        for (method, stage), (scene, (place, spacing)) in product(ways.items(), scenes.items()):
            label = _events(place, spacing, np.tile(SHEAR, (len(place), 1)), stage)
            numbers.setdefault((method, scene), []).append(len(np.unique(label)))
    rows = []
    for (method, scene), found in numbers.items():
        resolved = _name(MIN_LINK_LENGTH) if scene != "one crack in cells of two sizes" else _name(2 * MIN_LINK_LENGTH)
        bound = allowed["exact"] if method in ("families", resolved) else None
        true = 2 if scene == "two cracks" else 1
        for which, number in (("most", max(found)), ("fewest", min(found))):
            quantity = f"{method}: events of {scene}, one cell thick, {which} of {len(found)} ways to lie"
            rows.append(Row.relative(quantity, true, float(number), bound))
    return rows


def body_rows(settings: dict, allowed: dict) -> list[Row]:
    """Regions of bodies of known mechanisms against the truth: mean index of all sets, by scatter and link length."""
    mechanisms = tensor_from_voigt(np.array(settings["families"]["mechanisms"], dtype=float))
    rows = []
    for scatter, length in product(settings["cracks"]["scatter"], LINK_LENGTHS):
        stage = _stage("simultaneous", settings["families"]["shown_closeness"], length * settings["spacing"])
        indices = []
        for number, shape in enumerate(settings["sets"].values()):
            generator = np.random.default_rng([settings["seed"], number, 2])
            points = make_points(shape, settings["spacing"], settings["origin"], generator)
            count = len(points.truth)
            kind = np.where(points.truth < 0, generator.integers(0, len(mechanisms), count), points.truth)
            size = lognormal(count, 1.0, settings["families"]["log_potency_spread"], generator)
            tensor = turned(mechanisms[kind % len(mechanisms)], scatter, generator)
            potency = voigt_from_tensor(size[:, None, None] * tensor)
            label = _events(points.position, points.spacing, potency, stage)
            indices.append(index_of_clusters(points, label))
        bound = allowed["random"] if scatter == 0 and length == MIN_LINK_LENGTH else None  # One set fails at random.
        what = f"adjusted Rand index of bodies of one mechanism, turned by up to {scatter:g} degrees, mean of sets"
        rows.append(Row.relative(f"{_name(length)}: {what}", 1.0, float(np.mean(indices)), bound))
    return rows


def _name(length: float) -> str:
    """Name of the rule with links of this length, cells."""
    return f"regions linked within {length:g} cell{'' if length == 1 else 's'}"


def _stage(method: str, closeness: float, link_length: float | None = None) -> EventSettings:
    """Settings of the event stage; link_length m."""
    given = {"mine": "cracks", "least_particles": 3, "seismic_fraction": 1.0, "frame": {"surface": 0.0}}
    links = {} if link_length is None else {"link_length": link_length}
    return EventSettings.of(given | links | {"method": method, "closeness": closeness}, "seismic")


def _events(place: NDArray, spacing: NDArray, potency: NDArray, stage: EventSettings) -> NDArray:
    """Event of each particle, (particle,), all failed in one part of a step."""
    return find_events(place, spacing, potency, np.zeros(len(place), int), stage)[0]
