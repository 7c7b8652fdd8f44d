"""Edges of a triangulated surface, and how often each is passed which way. Plain arrays."""

from typing import NamedTuple

import numpy as np


class Edges(NamedTuple):
    """The edges of some triangles, each counted once."""

    of_facet: np.ndarray
    """(facet, 3) int64: number of the edge from each corner to the next"""
    count: np.ndarray  # type: ignore[assignment]  # hides the method of tuples, which nothing calls
    """(edge,) int64: how often it is passed"""
    balance: np.ndarray
    """(edge,) int64: passages one way less those the other; 0 everywhere in a closed surface"""


def edges_of(facets: np.ndarray) -> Edges:
    """Edges of triangles (facet, 3), vertices at the same place being one; an edge from a vertex to itself is none."""
    start, end = facets.astype(np.int64).ravel(), np.roll(facets, -1, axis=1).astype(np.int64).ravel()
    key = np.minimum(start, end) * (facets.max(initial=0) + 1) + np.maximum(start, end)
    _, number = np.unique(key, return_inverse=True)
    number = number.reshape(-1)
    real = (start != end).astype(float)
    balance = np.bincount(number, weights=np.sign(end - start))
    count = np.bincount(number, weights=real)
    return Edges(number.reshape(-1, 3), count.astype(np.int64), balance.astype(np.int64))


def unique_rows(rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Different rows (n, d) of an array in order of their columns, and of each row its place in them (row,) int64."""
    order = np.lexsort(rows.T[::-1])
    sorted_rows = rows[order]
    first = np.append(True, (sorted_rows[1:] != sorted_rows[:-1]).any(axis=1))[: len(rows)]
    place = np.empty(len(rows), dtype=np.int64)
    place[order] = np.cumsum(first) - 1
    return sorted_rows[first], place
