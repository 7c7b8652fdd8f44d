"""Bands of failed rock: their directions, and whether they lie along the grid more often than along its mirror image.

Rock breaks in planes at an angle to the axis of compression P. Two such planes bear the same stress, mirror images of
each other in the plane through P and the intermediate axis. The grid must not choose between them. So of the bands that
lie along cells, or whose mirror images would, as many do the one as the other, but for chance.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import xarray as xr
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from common.part_centers import part_centers
from common.voigt import tensor_from_voigt

RADIUS = 4.0  # Cells: of the surroundings that give a band its direction.
MIN_NEIGHBOURS = 5  # Failed particles in the surroundings of one, without which it has no direction.
MAX_FILLED_SHARE = 0.55  # A larger share of its surroundings that has failed is no band,
MIN_ELONGATION = 3.0  # nor is a smaller ratio of the variances along and across.
TOLERANCE = 7.5  # Largest angle between directions that count as one, degrees.
MAX_RATIO = 1.25  # Of bands along the grid over mirrored ones: more is a preference,
SIGNIFICANCE = 0.1  # if chance makes as many less often than this.
MIN_APART = 30.0  # Degrees between a band and its mirror image: one that opens is nearly its own.
DRAWS, SEED = 10_000, 1
AT_ONCE = 20_000  # Particles whose neighbours are held in memory.


def band_normals(place: NDArray, cell: float, radius: float = RADIUS) -> tuple[NDArray, NDArray]:
    """Particles (band,) of failed rock at (k, d) m that are in a band, and the unit normal (band, d) of each band.

    A band fills little of the surroundings of its particle, and is much longer than wide. cell: edge of a finest cell,
    m; radius: of the surroundings, cells.
    """
    dimension = place.shape[1]
    full = (np.pi if dimension == 2 else 4.0 / 3.0 * np.pi) * radius**dimension
    tree = cKDTree(place) if len(place) else None
    found, normals = [np.empty(0, np.int64)], [np.empty((0, dimension))]
    for first in range(0, len(place), AT_ONCE):
        assert tree is not None
        own = np.arange(first, min(first + AT_ONCE, len(place)))
        count = tree.query_ball_point(place[own], radius * cell, return_length=True)
        own = own[(count >= MIN_NEIGHBOURS) & (count <= MAX_FILLED_SHARE * full)]
        if not len(own):
            continue
        near = tree.query_ball_point(place[own], radius * cell)
        count = np.array([len(one) for one in near])
        start = np.cumsum([0, *count[:-1]])
        apart = place[np.concatenate(near).astype(np.int64)] - np.repeat(place[own], count, axis=0)
        mean = np.add.reduceat(apart, start) / count[:, None]
        products = np.add.reduceat(apart[:, :, None] * apart[:, None, :], start) / count[:, None, None]
        variance, axes = np.linalg.eigh(
            products - mean[:, :, None] * mean[:, None, :] + np.eye(dimension) * cell**2 / 12.0
        )
        flat = variance[:, 1] > MIN_ELONGATION * variance[:, 0]
        found.append(own[flat])
        normals.append(axes[flat, :, 0])
    return np.concatenate(found), np.concatenate(normals)


@dataclass(frozen=True)
class GridPreference:
    """Failed particles in bands along the axes of the grid, and in bands whose mirror images are, by band: (band,)."""

    along: NDArray
    mirrored: NDArray

    @cached_property
    def chance(self) -> float:
        """Chance of as many particles along the grid, or more, if MAX_RATIO times as many bands lie there as along
        mirror images. A band is one choice, however long it is."""
        sizes, generator, as_many = np.concatenate([self.along, self.mirrored]), np.random.default_rng(SEED), 0
        for _ in range(DRAWS if len(sizes) else 0):
            lies = generator.random(len(sizes)) < MAX_RATIO / (1.0 + MAX_RATIO)
            as_many += bool(sizes[lies].sum() >= self.along.sum())
        return (1 + as_many) / (1 + DRAWS) if len(sizes) else 1.0

    @property
    def is_told(self) -> bool:
        """True if bands prefer the grid: chance seldom puts so many along it."""
        return self.chance < SIGNIFICANCE


def bands_of(state: xr.Dataset, cell: float) -> GridPreference:
    """Bands of the failed rock of a state, of whatever step; cell: edge of a finest cell, m."""
    failed = np.flatnonzero((state["failed"].values >= 0) & (state["volume"].values > 0.0))
    plane = state.attrs.get("plane", "none")
    place, strain = part_centers(state)[failed], tensor_from_voigt(state["plastic_strain"].values[failed])
    if "cell" in state:  # which may hold several particles
        place, strain = (_means(one, state["cell"].values[failed]) for one in (place, strain))
    return grid_preference(place, strain, cell, "xyz" if plane == "none" else plane)


def _means(values: NDArray, group: NDArray) -> NDArray:
    """Means (group, ...) of values (k, ...) by group (k,), in the order of the groups."""
    names, index, count = np.unique(group, return_inverse=True, return_counts=True)
    total = np.zeros((len(names), *values.shape[1:]))
    np.add.at(total, index, values)
    return total / count.reshape(-1, *[1] * (values.ndim - 1))


def grid_preference(place: NDArray, strain: NDArray, cell: float, axes: str = "xyz") -> GridPreference:
    """Count bands of failed rock along the axes of the grid and mirrored ones.

    place (k, 3) m; strain (k, 3, 3): plastic strain of each particle, one in a cell; cell: edge of a finest cell, m;
    axes: of the grid, two in plane strain. The mechanism of a band is that of its particle's surroundings. Bands within
    MIN_APART of their mirror image, as cracks and skins that open are, count for neither.
    """
    own = ["xyz".index(axis) for axis in axes]
    chosen, in_plane = band_normals(place[:, own], cell)
    normal = np.zeros((len(chosen), 3))
    normal[:, own] = in_plane
    tension = np.linalg.eigh(_strain_around(chosen, place, strain, cell))[1][:, :, 2]
    mirrored = normal - 2.0 * (normal * tension).sum(axis=1, keepdims=True) * tension
    least = np.cos(np.radians(TOLERANCE))
    lies, would = (np.abs(one[:, own]).max(axis=1, initial=0.0) >= least for one in (normal, mirrored))
    is_sheared = np.abs((normal * mirrored).sum(axis=1)) < np.cos(np.radians(MIN_APART))
    here, there = place[chosen[lies & ~would & is_sheared]], place[chosen[would & ~lies & is_sheared]]
    return GridPreference(_bands(here, cell), _bands(there, cell))


def _strain_around(chosen: NDArray, place: NDArray, strain: NDArray, cell: float) -> NDArray:
    """Summed strain (band, 3, 3) of the failed rock around chosen particles (band,)."""
    found, tree = [np.empty((0, 3, 3))], cKDTree(place) if len(chosen) else None
    for first in range(0, len(chosen), AT_ONCE):
        assert tree is not None
        near = tree.query_ball_point(place[chosen[first : first + AT_ONCE]], RADIUS * cell)
        start = np.cumsum([0, *(len(one) for one in near[:-1])])
        found.append(np.add.reduceat(strain[np.concatenate(near).astype(np.int64)], start))
    return np.concatenate(found)


def _bands(place: NDArray, cell: float) -> NDArray:
    """Particles of each band (band,) that particles (k, d) m form: those within RADIUS of each other are one band."""
    if not len(place):
        return np.empty(0, int)
    pairs = cKDTree(place).query_pairs(RADIUS * cell, output_type="ndarray")
    links = coo_array((np.ones(len(pairs), bool), pairs.T), shape=(len(place), len(place)))
    return np.bincount(connected_components(links, directed=False)[1])
