"""Spatial separation: three methods on arrangements with a known answer, and DBSCAN family by family as a twin."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from sklearn.cluster import DBSCAN

from common.errors import InputError
from seismic.clusters import find_clusters, neighbour_graph, number_by_first

DBSCAN_SETTINGS = {"method": "dbscan", "radius_cells": 1.8, "min_samples": 3}


def cube(corner, edge, spacing=1.0):
    """Particles of a cube of edge x edge x edge on a lattice."""
    lattice = np.stack(np.meshgrid(*[np.arange(edge)] * 3, indexing="ij"), -1).reshape(-1, 3)
    return np.asarray(corner, dtype=float) + spacing * lattice


def dumbbell():
    """Two cubes of 27 joined by a line of seven, one particle thick (the paper's Fig. 12: a single link too many)."""
    bridge = np.array([[x, 1.0, 1.0] for x in range(3, 10)])
    return np.concatenate([cube([0, 0, 0], 3), cube([10, 0, 0], 3), bridge])


def mixed_particles(seed, count=200):
    """Particles at random places, of three sizes and four families, some at the same place."""
    rng = np.random.default_rng(seed)
    position = rng.uniform(0, 12, (count, 3)) * [1, 1, 0.3] + 1e5
    position[:10] = position[10:20]
    return position, rng.choice([0.5, 1.0, 2.0], count), rng.integers(0, 4, count)


def scaled_distance(position, spacing):
    """All distances over the larger spacing of the pair, the obvious way."""
    distance = np.linalg.norm(position[:, None] - position[None], axis=-1)
    return distance / np.maximum(spacing[:, None], spacing[None])


def test_dbscan_finds_two_blobs_and_leaves_a_loner_unresolved():
    position = np.concatenate([[[50.0, 0, 0]], cube([0, 0, 0], 3), cube([6, 0, 0], 2)])
    label, resolved = find_clusters(position, np.ones(36), np.zeros(36, int), DBSCAN_SETTINGS)
    assert_array_equal(label, [0] + [1] * 27 + [2] * 8)
    assert_array_equal(resolved, [False, True, True])


def test_each_noise_particle_is_an_event_of_its_own():
    position = np.array([[0.0, 0, 0], [1, 0, 0], [10, 0, 0]])  # a pair is too few for min_samples 3
    label, resolved = find_clusters(position, np.ones(3), np.zeros(3, int), DBSCAN_SETTINGS)
    assert_array_equal(label, [0, 1, 2])
    assert not resolved.any()


def test_families_side_by_side_stay_apart():
    position = cube([0, 0, 0], 4)
    family = (position[:, 0] >= 2).astype(int)
    for method in ("dbscan", "single_linkage"):
        label, resolved = find_clusters(position, np.ones(64), family, DBSCAN_SETTINGS | {"method": method})
        assert_array_equal(label, family)
        assert resolved.all()


def test_single_linkage_joins_what_dbscan_separates():
    """Dumbbell: with itself, a bridge particle has three neighbours across faces, a corner of a cube four: a core."""
    position = dumbbell()
    family, spacing = np.zeros(len(position), int), np.ones(len(position))
    settings = {"radius_cells": 1.1, "min_samples": 4}  # face neighbours only
    label, resolved = find_clusters(position, spacing, family, settings | {"method": "single_linkage"})
    assert_array_equal(label, np.zeros(61))
    assert resolved.all()
    label, resolved = find_clusters(position, spacing, family, settings | {"method": "dbscan"})
    assert resolved.sum() == 2
    assert len(np.unique(label[:27])) == len(np.unique(label[27:54])) == 1
    assert label[0] != label[27]
    assert (~resolved).sum() == 5  # the middle of the bridge; its ends border the cubes


def test_kmeans_splits_the_dumbbell_in_the_middle():
    position = dumbbell()
    settings = DBSCAN_SETTINGS | {"method": "kmeans", "clusters": 2}
    label, resolved = find_clusters(position, np.ones(61), np.zeros(61, int), settings)
    assert_array_equal(label[position[:, 0] < 5.5], 0)
    assert_array_equal(label[position[:, 0] > 6.5], 1)
    assert resolved.all()


def test_kmeans_without_a_number_takes_that_of_dbscan_in_each_family():
    """Family 0: two blobs; family 1: one pair, noise for DBSCAN, one cluster for k-means, too small to be resolved."""
    position = np.concatenate([cube([0, 0, 0], 3), cube([9, 0, 0], 3), [[0.0, 20, 0], [1, 20, 0]]])
    family = np.array([0] * 54 + [1] * 2)
    label, resolved = find_clusters(position, np.ones(56), family, DBSCAN_SETTINGS | {"method": "kmeans"})
    assert_array_equal(label, [0] * 27 + [1] * 27 + [2] * 2)
    assert_array_equal(resolved, [True, True, False])


def test_kmeans_never_makes_more_clusters_than_places():
    position = np.array([[0.0, 0, 0], [0, 0, 0], [1, 0, 0]])
    settings = DBSCAN_SETTINGS | {"method": "kmeans", "clusters": 5}
    label, _ = find_clusters(position, np.ones(3), np.zeros(3, int), settings)
    assert_array_equal(label, [0, 0, 1])


@pytest.mark.parametrize("seed", range(6))
def test_neighbour_graph_as_by_all_pairs(seed):
    position, spacing, family = mixed_particles(seed)
    graph = neighbour_graph(position, spacing, family, 1.8)
    distance = scaled_distance(position, spacing)
    near = (distance <= 1.8) & (family[:, None] == family[None])
    stored = np.zeros_like(near)
    stored[graph.nonzero()] = True
    rows = np.repeat(np.arange(len(position)), np.diff(graph.indptr))
    stored[rows, graph.indices] = True  # explicit zeros too: particles at one place, and the diagonal
    assert_array_equal(stored, near)
    assert graph.nnz == near.sum()
    assert_allclose(graph.toarray()[near], distance[near], atol=1e-9)


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("min_samples", [1, 3, 5])
def test_dbscan_is_that_of_each_family_alone(seed, min_samples):
    position, spacing, family = mixed_particles(seed)
    label, resolved = find_clusters(position, spacing, family, DBSCAN_SETTINGS | {"min_samples": min_samples})
    offset, expected, noise = 0, np.empty(len(position), int), np.zeros(len(position), bool)
    for name in np.unique(family):
        member = np.flatnonzero(family == name)
        distance = scaled_distance(position[member], spacing[member])
        alone = DBSCAN(eps=1.8, min_samples=min_samples, metric="precomputed").fit(distance).labels_
        noise[member] = alone < 0
        expected[member] = offset + np.where(alone < 0, len(member) + np.arange(len(member)), alone)
        offset += 2 * len(member)
    assert_array_equal(label, number_by_first(expected))
    assert_array_equal(resolved[label], ~noise)


def test_distance_counts_in_the_larger_spacing_of_the_pair():
    """Two 10 m particles, one of 1.25 m 8 m on (near the coarse one), and one 12 m further (20 m from the coarse)."""
    position = np.array([[0.0, 0, 0], [10, 0, 0], [18, 0, 0], [30, 0, 0]])
    spacing = np.array([10, 10, 1.25, 1.25])
    label, resolved = find_clusters(position, spacing, np.zeros(4, int), DBSCAN_SETTINGS | {"method": "single_linkage"})
    assert_array_equal(label, [0, 0, 0, 1])
    assert_array_equal(resolved, [True, False])


def test_neighbours_exactly_at_the_radius_count_in_mine_coordinates():
    """Spacing 0.1 m at an origin of 10^5 m: lattice distances are off by 10^-11 m, either way."""
    position = cube([123456.7, 654321.1, -987.3], 4, spacing=0.1)
    settings = {"method": "single_linkage", "radius_cells": 1.0, "min_samples": 3}
    label, _ = find_clusters(position, np.full(64, 0.1), np.zeros(64, int), settings)
    assert_array_equal(label, 0)


@pytest.mark.parametrize("method", ["dbscan", "single_linkage", "kmeans"])
def test_labels_are_numbered_by_first_particle_and_families_kept(method):
    position, spacing, family = mixed_particles(1)
    label, resolved = find_clusters(position, spacing, family, DBSCAN_SETTINGS | {"method": method})
    _, first = np.unique(label, return_index=True)
    assert np.all(np.diff(first) > 0)
    assert len(resolved) == len(first) == label.max() + 1
    for cluster in range(len(resolved)):
        assert len(np.unique(family[label == cluster])) == 1
    again, _ = find_clusters(position, spacing, family, DBSCAN_SETTINGS | {"method": method})
    assert_array_equal(again, label)


@pytest.mark.parametrize("method", ["dbscan", "single_linkage", "kmeans"])
def test_no_particles_no_clusters(method):
    empty = np.empty(0)
    label, resolved = find_clusters(np.empty((0, 3)), empty, empty, DBSCAN_SETTINGS | {"method": method})
    assert label.shape == resolved.shape == (0,)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"method": "optics"}, r"seismic\.cluster\.method: 'optics' is not one of dbscan, single_linkage, kmeans"),
        ({"radius_cells": 0.0}, r"seismic\.cluster\.radius_cells: 0\.0"),
        ({"min_samples": 2.5}, r"seismic\.cluster\.min_samples: 2\.5"),
        ({"clusters": 0}, r"seismic\.cluster\.clusters: 0"),
        ({"radius": 1.0}, r"seismic\.cluster\.radius: unknown key"),
    ],
)
def test_impossible_settings_are_refused(change, message):
    with pytest.raises(InputError, match=message):
        find_clusters(np.zeros((2, 3)), np.ones(2), np.zeros(2, int), DBSCAN_SETTINGS | change)
