"""Sets of failed particles with known clusters, and measures of how close a separation is to the truth."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree
from sklearn.metrics import adjusted_rand_score

NOISE = -1


@dataclass(frozen=True)
class PointSet:
    """position (particle, 3) m; spacing (particle,) m; truth (particle,): cluster from 0, NOISE for scattered ones."""

    position: NDArray
    spacing: NDArray
    truth: NDArray

    @property
    def clusters(self) -> int:
        """Number of true clusters."""
        return int(self.truth.max()) + 1


def make_points(shape: dict, spacing: float, origin: list[float], generator: np.random.Generator) -> PointSet:
    """The set that `shape` describes, its lengths in cells of `spacing` m, its zero at `origin` (3,) m.

    shape: bodies, each an ellipsoid (centre, semi_axes) or a box (lower, cells) of cells `cell` wide of which `share`
    failed, and optionally noise: boxes of scattered failures outside the bodies.
    """
    places = [_thinned(_cells(body), body.get("share", 1.0), generator) for body in shape["bodies"]]
    sizes = [
        np.full(len(place), float(body.get("cell", 1))) for place, body in zip(places, shape["bodies"], strict=True)
    ]
    truth = [np.full(len(place), cluster) for cluster, place in enumerate(places)]
    solid = [(_cells(body), float(body.get("cell", 1))) for body in shape["bodies"]]
    for box in shape.get("noise", []):
        place = _cells(box)
        for cells, size in solid:  # A cell within a body belongs to it, failed or not.
            gap = cKDTree(cells).query(place, p=np.inf)[0]
            place = place[gap >= 0.5 * (1.0 + size)]
        place = _thinned(place, box["share"], generator)
        places.append(place)
        sizes.append(np.ones(len(place)))
        truth.append(np.full(len(place), NOISE))
    position = np.asarray(origin) + spacing * np.concatenate(places)
    return PointSet(position, spacing * np.concatenate(sizes), np.concatenate(truth))


def balls(count: int, semi_axes: list[float], apart: float, spacing: float) -> PointSet:
    """At least `count` particles in equal ellipsoids on a cubic arrangement, centres `apart` cells from each other."""
    one = _cells({"centre": [0, 0, 0], "semi_axes": semi_axes})
    wanted = -(-count // len(one))
    edge = int(np.ceil(np.cbrt(wanted)))
    centre = apart * np.stack(np.unravel_index(np.arange(wanted), (edge, edge, edge)), axis=-1)
    position = spacing * (centre[:, None] + one).reshape(-1, 3)
    return PointSet(position, np.full(len(position), spacing), np.repeat(np.arange(wanted), len(one)))


def index_of_clusters(points: PointSet, label: NDArray) -> float:
    """Adjusted Rand index (Hubert and Arabie 1985) of the particles that belong to a true cluster; 1 = the truth."""
    own = points.truth != NOISE
    return float(adjusted_rand_score(points.truth[own], label[own]))


def share_of_noise_taken(points: PointSet, label: NDArray) -> float:
    """Share of the scattered particles that share a cluster with another particle; NaN without any."""
    noise = points.truth == NOISE
    return float(np.mean(np.bincount(label)[label[noise]] > 1)) if noise.any() else np.nan


def elongations(points: PointSet, label: NDArray) -> tuple[NDArray, NDArray]:
    """Elongation of each true cluster (cluster,) and of the found one that holds most of its particles (cluster,)."""
    true, found = [], []
    for cluster in range(points.clusters):
        own = points.truth == cluster
        true.append(elongation(points.position[own], points.spacing[own]))
        most = label == np.bincount(label[own]).argmax()
        found.append(elongation(points.position[most], points.spacing[most]))
    return np.array(true), np.array(found)


def elongation(position: NDArray, spacing: NDArray) -> float:
    """Longest over shortest principal standard deviation of cubes of `spacing` m at position (particle, 3) m.

    For a uniform ellipsoid this is its longest over its shortest semi-axis. Each particle is a cube, whose variance is
    spacing^2 / 12 in every direction, so that a single layer has a thickness.
    """
    volume = spacing**3
    centred = position - np.average(position, axis=0, weights=volume)
    square = np.einsum("p,pi,pj->ij", volume, centred, centred) / volume.sum()
    variance = np.linalg.eigvalsh(square) + np.average(spacing**2, weights=volume) / 12.0
    return float(np.sqrt(variance[2] / variance[0]))


def _cells(shape: dict) -> NDArray:
    """Centres (cell, 3) of the cells of an ellipsoid or a box, in cells."""
    size = float(shape.get("cell", 1))
    if "lower" in shape:
        return np.asarray(shape["lower"]) + size * np.indices(shape["cells"]).reshape(3, -1).T
    semi_axes = np.asarray(shape["semi_axes"], dtype=float)
    reach = np.floor(semi_axes / size).astype(int)
    lattice = size * (np.indices(tuple(2 * reach + 1)).reshape(3, -1).T - reach)
    return np.asarray(shape["centre"]) + lattice[np.sum(np.square(lattice / semi_axes), axis=1) <= 1.0]


def _thinned(place: NDArray, share: float, generator: np.random.Generator) -> NDArray:
    """A share of the cells at random; all of them, and no number drawn, for a share of 1."""
    return place if share >= 1.0 else place[generator.random(len(place)) < share]
