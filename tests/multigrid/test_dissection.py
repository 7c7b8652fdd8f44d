"""Nested dissection against plain symbolic elimination."""

import numpy as np
import pytest
import scipy.sparse as sparse
from hypothesis import given, settings
from hypothesis import strategies as st

from mpm_core.multigrid.stiff_bodies import dissect


def grid_graph(shape: tuple[int, ...]):
    """(graph, place): nodes of a grid, neighbours of all that share a cell with them."""
    place = np.stack(np.meshgrid(*map(np.arange, shape), indexing="ij"), axis=-1).reshape(-1, len(shape))
    near = np.abs(place[:, None] - place[None]).max(axis=2) <= 1
    return sparse.csr_array(near.astype(np.int8)), place.astype(float)


def entries_of(graph, order: np.ndarray) -> int:
    """Entries of the lower triangle of the factor, by eliminating node after node."""
    pattern = graph.toarray()[np.ix_(order, order)] != 0
    total = 0
    for k in range(len(order)):
        below = np.flatnonzero(pattern[k + 1 :, k]) + k + 1
        pattern[np.ix_(below, below)] = True
        total += 1 + len(below)
    return total


@pytest.mark.parametrize(("shape", "share"), [((24, 24, 2), 0.8), ((9, 9, 9), 0.9), ((40, 40), 0.65)])
def test_less_fill_than_layer_by_layer(shape, share):
    graph, place = grid_graph(shape)
    order, entries = dissect(graph, place)
    found = entries_of(graph, order)
    assert found <= entries <= 1.5 * found
    layers = np.lexsort(place.T[np.argsort(-np.array(shape))][::-1])  # a band, as narrow as can be
    assert found <= share * entries_of(graph, layers)


@given(st.integers(0, 2**32 - 1), st.integers(0, 120))
@settings(max_examples=40, deadline=None)
def test_every_node_once_and_never_more_entries_than_said(seed, count):
    rng = np.random.default_rng(seed)
    place = np.round(rng.random((count, 2)) * 3)  # many of them in one place
    links = rng.integers(0, max(count, 1), (2, count * int(rng.integers(0, 4)))) if count else np.empty((2, 0), int)
    graph = sparse.csr_array((np.ones(links.shape[1], np.int8), tuple(links)), shape=(count, count))
    graph = ((graph + graph.T + sparse.eye_array(count)) > 0).astype(np.int8).tocsr()
    order, entries = dissect(graph, place)
    assert sorted(order) == list(range(count))
    assert entries_of(graph, order) <= entries
