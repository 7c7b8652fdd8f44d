"""Measures of a run, their errors, and the limit that a series of ever finer cells leads to."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import brentq

RELATIVE, DIFFERENCE, ITSELF = "relative", "difference", "itself"
ORDER_BOUNDS = (0.5, 3.0)  # Three values with an order outside of these show no convergence.


@dataclass(frozen=True)
class Measure:
    """A number of a run.

    kind: whether its error is a share of the truth, the difference from the truth, or the number itself. smooth:
    whether it has a limit as cells shrink. The number of events has none, since smaller events appear.
    """

    key: str
    title: str
    unit: str
    kind: str = RELATIVE
    smooth: bool = True

    @property
    def column(self) -> str:
        """Its column of the table, whose name holds the unit."""
        return self.key if self.unit == "1" else f"{self.key}_{self.unit}"

    def error(self, value: float, truth: float) -> float:
        """Error of a value: a share for kind relative, else in the measure's unit. NaN where either is NaN."""
        if self.kind == ITSELF:
            return abs(value)
        off = abs(value - truth)
        if self.kind == DIFFERENCE:
            return off
        return off / abs(truth) if truth else np.nan


MEASURES = {
    measure.key: measure
    for measure in (
        Measure("potency", "seismic potency", "m3"),
        Measure("failed_volume", "failed volume", "m3"),
        Measure("closure", "closure", "mm"),
        Measure("wall_stress", "wall stress", "1", ITSELF),
        Measure("stress", "stress in the rock", "1", ITSELF),
        Measure("events", "resolved events", "1", smooth=False),
        Measure("largest", "largest event, log P", "1", DIFFERENCE, smooth=False),
        Measure("b", "b of log potency", "1", DIFFERENCE, smooth=False),
        Measure("apart", "events' distance from the reference", "m", ITSELF, smooth=False),
    )
}


@dataclass(frozen=True)
class Limit:
    """A limit in the series' unit, and the order of convergence. The order is NaN where the finest value stands in."""

    value: float
    order: float = np.nan


def richardson(cell: ArrayLike, values: ArrayLike) -> Limit:
    """Limit and order of the three finest of a series: x(h) = limit + c h^order.

    Richardson (1911), with the order that the series shows. cell (member,) m, in any order; values (member,). The
    finest value stands for the limit where three values show no order within ORDER_BOUNDS: there are fewer of them,
    they are not monotonic, or they converge too slowly.
    """
    order = np.argsort(np.asarray(cell, float))
    h, x = np.asarray(cell, float)[order][:3], np.asarray(values, float)[order][:3]
    if len(h) == 3 and np.ptp(x) > 0.0 and (x[2] - x[1]) * (x[1] - x[0]) > 0.0:
        ratio = (x[2] - x[1]) / (x[1] - x[0])

        def misfit(p: float) -> float:
            return (h[2] ** p - h[1] ** p) / (h[1] ** p - h[0] ** p) - ratio

        low, high = ORDER_BOUNDS
        if misfit(low) * misfit(high) < 0.0:
            p = brentq(misfit, low, high, xtol=1e-12)
            slope = (x[1] - x[0]) / (h[1] ** p - h[0] ** p)
            return Limit(float(x[0] - slope * h[0] ** p), float(p))
    return Limit(float(x[0]) if len(x) else np.nan)
