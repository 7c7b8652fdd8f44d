"""The Pareto front: runs of which none is both faster and more accurate."""

import numpy as np
from numpy.typing import ArrayLike, NDArray


def pareto_front(cost: ArrayLike, error: ArrayLike) -> NDArray[np.bool_]:
    """Which points (point,) no other beats: none costs as little and errs as little, and less in one of the two.

    Equal points are all on it; points with a cost or error that is not finite are not, and beat none.
    """
    cost, error = np.asarray(cost, float), np.asarray(error, float)
    front = np.zeros(len(cost), bool)
    usable = np.flatnonzero(np.isfinite(cost) & np.isfinite(error))
    best = np.inf  # error of all that cost less
    order = usable[np.lexsort((error[usable], cost[usable]))]
    for index in order:
        same = front & (cost == cost[index]) & (error == error[index])
        front[index] = error[index] < best or same.any()
        best = min(best, error[index])
    return front
