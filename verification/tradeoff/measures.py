"""What a run is judged by, and how its error is counted."""

from dataclasses import dataclass

import numpy as np

RELATIVE, DIFFERENCE, ITSELF = "relative", "difference", "itself"


@dataclass(frozen=True)
class Measure:
    """A number of a run. kind: its error is a share of what it should be, the difference from it, or the number itself.

    smooth: whether it has a limit as cells shrink (the number of events has none: smaller ones appear).
    """

    key: str
    title: str
    unit: str
    kind: str = RELATIVE
    smooth: bool = True

    @property
    def is_share(self) -> bool:
        """Whether its error is a share, shown in per cent."""
        return self.kind == RELATIVE or (self.kind == ITSELF and self.unit == "1")

    def error(self, value: float, truth: float) -> float:
        """Of a value beside the truth: a share (kind relative), else in the measure's unit; NaN without either."""
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
