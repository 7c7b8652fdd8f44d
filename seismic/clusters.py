"""Spatial separation of each family into events (paper, section 3.2; docs/explanation/method.md).

All families are handled at once: a neighbour graph joins only particles of one family, so one call on the whole graph
does what one call per family would. A distance counts in units of the larger particle spacing of the pair, so that a
coarse particle is as near to its neighbours as a fine one is.
"""

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree
from threadpoolctl import threadpool_limits

from seismic.event_settings import ClusterSettings

# Relative tolerance of the radius: lattice neighbours at the radius count, whatever the origin of the coordinates.
RADIUS_ROUND_OFF = 1e-9
KMEANS_STARTS = 4  # Seedings of k-means, of which the tightest result counts.


def find_clusters(
    position: NDArray, spacing: NDArray, family: NDArray, cluster: ClusterSettings | dict
) -> tuple[NDArray, NDArray]:
    """Cluster of every particle, none across families, and whether each cluster is resolved.

    position (particle, 3) m; spacing (particle,) m; family (particle,) from 0; cluster: the settings, or their values:
    method      dbscan: density-based clusters (Ester et al. 1996); a noise particle is a cluster of its own, not
                resolved.
                single_linkage: all that a chain of steps within the radius joins. Single linkage cut at a distance is
                the connected components of the radius graph, and is computed so.
                kmeans: compact clusters, their number given: `clusters` per family, or, without it, as many as DBSCAN
                finds in that family (at least one), so that the methods can be compared. Distances in metres.
    radius_cells  radius in particle spacings (cells, at one particle per cell)
    min_samples   particles, itself included, within the radius of a DBSCAN core; the fewest of a resolved cluster
    clusters      k-means only, optional: clusters per family, at most the particles it has

    Gives label (particle,) int64 from 0, numbered by each cluster's first particle, and resolved (cluster,) bool.
    Raises InputError.
    """
    cluster = ClusterSettings.of(cluster, "seismic.cluster")
    if len(position) == 0:
        return np.empty(0, np.int64), np.empty(0, bool)
    family = np.asarray(family)
    if cluster.method == "kmeans":
        raw = _kmeans(position, spacing, family, cluster)
    else:
        graph = neighbour_graph(position, spacing, family, cluster.radius_cells)
        if cluster.method == "single_linkage":
            raw = connected_components(graph, directed=False)[1]
        else:
            raw = _dbscan(graph, cluster)
    noise = raw < 0
    raw = np.where(noise, len(raw) + np.arange(len(raw)), raw)  # cluster numbers are below the number of particles
    label = number_by_first(raw)
    resolved = np.bincount(label) >= cluster.min_samples
    if cluster.method == "dbscan":  # one whose border particles went to a neighbour may be small: it has a core
        resolved = np.zeros(len(resolved), bool)
        resolved[label[~noise]] = True
    return label, resolved


def neighbour_graph(position: NDArray, spacing: NDArray, family: NDArray, radius_cells: float) -> csr_matrix:
    """Distances over the larger spacing of the pair, within a family and the radius: symmetric (particle, particle).

    The diagonal and particles at one place are explicit zeros.
    """
    first, second, distance = neighbour_pairs(position, spacing, family, radius_cells)
    itself = np.arange(len(position))
    row = np.concatenate([first, second, itself])
    column = np.concatenate([second, first, itself])
    data = np.concatenate([distance, distance, np.zeros(len(position))])
    return csr_matrix((data, (row, column)), shape=(len(position), len(position)))


def neighbour_pairs(
    position: NDArray, spacing: NDArray, family: NDArray, radius_cells: float
) -> tuple[NDArray, NDArray, NDArray]:
    """Pairs of one family within the radius, each once: both particles and their distance over the larger spacing.

    The family is a fourth coordinate of the search tree, far enough apart that families never meet; each size of
    particle is searched with its own radius.
    """
    position = np.asarray(position, dtype=np.float64)
    sizes, size = np.unique(np.asarray(spacing, dtype=np.float64), return_inverse=True)
    reach = radius_cells * (1.0 + RADIUS_ROUND_OFF)
    apart = 2.0 * reach * sizes[-1]
    point = np.column_stack([position - position.mean(axis=0), family * apart])
    pairs = [np.empty((0, 2), np.intp)]
    for rank, largest in enumerate(sizes):
        # twice RADIUS_ROUND_OFF: the tree only proposes pairs; the distances below decide
        radius = radius_cells * (1.0 + 2.0 * RADIUS_ROUND_OFF) * largest
        own = np.flatnonzero(size == rank)
        tree = cKDTree(point[own])
        pairs.append(own[tree.query_pairs(radius, output_type="ndarray")])
        finer = np.flatnonzero(size < rank)
        if len(finer):
            near = tree.sparse_distance_matrix(cKDTree(point[finer]), radius, output_type="ndarray")
            pairs.append(np.column_stack([own[near["i"]], finer[near["j"]]]))
    first, second = np.concatenate(pairs).T
    distance = np.sqrt(np.sum(np.square(position[first] - position[second]), axis=1))
    distance /= np.maximum(sizes[size[first]], sizes[size[second]])
    kept = distance <= reach
    return first[kept], second[kept], distance[kept]


def number_by_first(label: NDArray) -> NDArray:
    """The partition with labels 0, 1, ... in the order of each label's first particle."""
    _, first, inverse = np.unique(label, return_index=True, return_inverse=True)
    number = np.empty(len(first), np.int64)
    number[np.argsort(first)] = np.arange(len(first))
    return number[inverse]


def _dbscan(graph: csr_matrix, cluster: ClusterSettings) -> NDArray:
    """DBSCAN label of each particle on the graph of all families, -1 for noise."""
    from sklearn.cluster import DBSCAN  # here: regions, the default, do not use it, and it takes long to import

    reach = cluster.radius_cells * (1.0 + RADIUS_ROUND_OFF)
    return DBSCAN(eps=reach, min_samples=cluster.min_samples, metric="precomputed").fit(graph).labels_


def _kmeans(position: NDArray, spacing: NDArray, family: NDArray, cluster: ClusterSettings) -> NDArray:
    """k-means label of each particle, families one after the other."""
    from sklearn.cluster import KMeans

    by_family = np.argsort(family, kind="stable")
    edges = np.flatnonzero(np.diff(family[by_family], prepend=family[by_family[0]] - 1, append=-1))
    wanted = cluster.clusters
    if wanted is None:
        dense = _dbscan(neighbour_graph(position, spacing, family, cluster.radius_cells), cluster)
    label = np.empty(len(position), np.int64)
    used = 0
    with threadpool_limits(1):  # threads would add the centres in any order
        for start, stop in pairwise(edges):
            member = by_family[start:stop]
            count = wanted if wanted is not None else len(np.unique(dense[member][dense[member] >= 0]))
            count = min(max(int(count), 1), len(np.unique(position[member], axis=0)))
            label[member] = used
            if count > 1:
                kmeans = KMeans(count, n_init=KMEANS_STARTS, random_state=0)
                label[member] += kmeans.fit_predict(position[member] - position[member].mean(axis=0))
            used += count
    return label
