"""Nested dissection: an order in which to eliminate the unknowns of a graph that lies in space, and what it costs."""

import numpy as np

MAX_LEAF_NODES = 32  # So few nodes are not divided further.


def dissect(graph, place: np.ndarray) -> tuple[np.ndarray, float]:
    """(order (n,), entries): nodes in the order of elimination, and entries of the factor's lower triangle, at most.

    graph: sparse (n, n), its pattern symmetric, each node its own neighbour; place (n, d). Halves by place are divided
    by those nodes of one that have neighbours in the other; both halves come first, then what divides them (George
    1973, SIAM J. Numer. Anal. 10, 345). Every node is counted with all that remains of its half and around it.
    """
    entries = 0.0
    order: list[np.ndarray] = []
    on_the_other_side = np.zeros(len(place), bool)

    def neighbours(nodes: np.ndarray):
        count = graph.indptr[nodes + 1] - graph.indptr[nodes]
        first = np.repeat(graph.indptr[nodes] - np.cumsum(count) + count, count)
        return graph.indices[first + np.arange(count.sum())], np.repeat(np.arange(len(nodes)), count)

    def eliminate(nodes: np.ndarray) -> np.ndarray:
        """Put nodes into the order; those around them that are left."""
        nonlocal entries
        halves: list[np.ndarray] = []
        last = nodes
        if len(nodes) > MAX_LEAF_NODES:
            spread = np.ptp(place[nodes], axis=0)
            nodes = nodes[np.argsort(place[nodes, int(np.argmax(spread))], kind="stable")]
            low, high = np.split(nodes, [len(nodes) // 2])
            on_the_other_side[high] = True
            neighbour, of = neighbours(low)
            divides = np.zeros(len(low), bool)
            divides[of[on_the_other_side[neighbour]]] = True
            on_the_other_side[high] = False
            last = low[divides]
            halves = [eliminate(half) for half in (low[~divides], high) if len(half)]
        around = np.setdiff1d(np.concatenate([neighbours(last)[0], *halves]), nodes)
        entries += len(last) * (0.5 * (len(last) + 1) + len(around))
        order.append(last)
        return around

    eliminate(np.arange(len(place)))
    return np.concatenate(order), entries
