"""Where a series of ever finer cells is going: Richardson's limit (1911), with the order that the series shows."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import brentq

ORDERS = (0.5, 3.0)  # outside of these three values show no order: the limit would be a guess


@dataclass(frozen=True)
class Limit:
    """value: of the limit, in the series' unit; order: of convergence, NaN where the value is the finest one itself."""

    value: float
    order: float = np.nan


def richardson(cell: ArrayLike, values: ArrayLike) -> Limit:
    """Limit and order of the three finest of a series: x(h) = limit + c h^order.

    cell (member,) m, in any order, and ratio; values (member,). Where three values do not say an order within ORDERS
    (fewer of them, not monotonic, converging too slowly) the finest value stands for the limit.
    """
    order = np.argsort(np.asarray(cell, float))
    h, x = np.asarray(cell, float)[order][:3], np.asarray(values, float)[order][:3]
    if len(h) == 3 and np.ptp(x) > 0.0 and (x[2] - x[1]) * (x[1] - x[0]) > 0.0:
        ratio = (x[2] - x[1]) / (x[1] - x[0])

        def misfit(p: float) -> float:
            return (h[2] ** p - h[1] ** p) / (h[1] ** p - h[0] ** p) - ratio

        low, high = ORDERS
        if misfit(low) * misfit(high) < 0.0:
            p = brentq(misfit, low, high, xtol=1e-12)
            slope = (x[1] - x[0]) / (h[1] ** p - h[0] ** p)
            return Limit(float(x[0] - slope * h[0] ** p), float(p))
    return Limit(float(x[0]) if len(x) else np.nan)
