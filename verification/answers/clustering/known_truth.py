"""Known truth: mechanisms with scatter, whole steps for the event stage, sets of failed particles in known clusters.

Measures of how close a separation is to the truth stand beside the sets.
"""

import json
from dataclasses import dataclass

import numpy as np
import xarray as xr
from numpy.typing import NDArray
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation
from sklearn.metrics import adjusted_rand_score

NOISE = -1  # Cluster of scattered particles.
LAME_LAMBDA, SHEAR_MODULUS = 22.8e9, 22.8e9  # Of 57 GPa and a Poisson's ratio of 0.25, Pa.


def turned(tensor: NDArray, largest: float, generator: np.random.Generator) -> NDArray:
    """Each tensor (..., 3, 3) turned about a random axis by a random angle, uniform from 0 to `largest` degrees."""
    shape = np.shape(tensor)[:-2]
    axis = generator.normal(size=(*shape, 3))
    axis /= np.linalg.norm(axis, axis=-1, keepdims=True)
    angle = np.radians(largest) * generator.random(shape)
    turn = Rotation.from_rotvec((angle[..., None] * axis).reshape(-1, 3)).as_matrix().reshape(*shape, 3, 3)
    return turn @ tensor @ np.swapaxes(turn, -1, -2)


def lognormal(count: int, median: float, spread: float, generator: np.random.Generator) -> NDArray:
    """Sizes (count,) whose log10 is normal with this spread."""
    return median * 10.0 ** generator.normal(0.0, spread, count)


def synthetic_step(
    position,
    seismic_strain,
    *,
    spacing=1.25,
    volume=None,
    failure_order=None,
    failed=True,
    overshoot_strain=0.0,
    later_strain=0.0,
    step="2019-08",
    step_index=2,
    parts=4,
    start="2019-08-01",
    end="2019-09-01",
    dated=1,
    mine="testmine",
) -> xr.Dataset:
    """A mining step of particles at position (particle, 3) m with seismic_strain (particle, 6), all else as given."""
    position = np.asarray(position, dtype=float).reshape(-1, 3)
    count = len(position)
    spacing = np.broadcast_to(np.asarray(spacing, dtype=float), count)
    volume = spacing**3 if volume is None else np.broadcast_to(np.asarray(volume, dtype=float), count)
    order = np.zeros((count, 2)) if failure_order is None else np.asarray(failure_order).reshape(-1, 2)
    strains = [
        np.broadcast_to(np.asarray(strain, dtype=float), (count, 6))
        for strain in (seismic_strain, overshoot_strain, later_strain)
    ]
    voigt = ("particle", "voigt")
    increments = np.arange(1, int(order[:, 0].max(initial=0)) + 1)
    return xr.Dataset(
        {
            "position": (("particle", "xyz"), position),
            "spacing": ("particle", spacing),
            "volume": ("particle", volume),
            "material": ("particle", np.zeros(count, np.int16)),
            "failed": ("particle", np.where(np.broadcast_to(failed, count), step_index, -1).astype(np.int32)),
            "failure_order": (("particle", "order"), order.astype(np.int32)),
            "seismic_strain": (voigt, strains[0]),
            "overshoot_strain": (voigt, strains[1]),
            "later_strain": (voigt, strains[2]),
            "plastic_strain_step": (voigt, strains[0] + strains[1] + strains[2]),
            "convergence_increment": ("iteration", increments.astype(np.int32)),
            "convergence_load": ("iteration", increments / max(len(increments), 1)),
        },
        attrs={
            "mine": mine,
            "stage": "step",
            "step": step,
            "step_index": step_index,
            "parts": parts,
            "start": start,
            "end": end,
            "dated": dated,
            "lame_lambda": LAME_LAMBDA,
            "shear_modulus": SHEAR_MODULUS,
            "material_names": json.dumps(["host"]),
            "elastic_moduli": json.dumps({"host": [LAME_LAMBDA, SHEAR_MODULUS]}),
            "truncated": 0,
            "collapsed": 0,
            "truncated_share": 0.0,
            "truncated_where": "",
        },
    )


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
