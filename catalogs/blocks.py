"""Blocks of events that belong together (days, steps): what is resampled, as events are not independent."""

import numpy as np
from numpy.typing import NDArray

from pipeline.errors import InputError

BLOCK_KINDS = ("day", "step", "event")


def block_labels(kind: str, time: NDArray, step: NDArray) -> NDArray:
    """Block number (event,) of each event, 0, 1, ... in order of appearance in time.

    kind: day: the day (UTC) of its time; step: the mining step's name; event: each its own, right only for independent
    events. Events without a time form one day. Raises InputError for an unknown kind.
    """
    if kind not in BLOCK_KINDS:
        raise InputError(f"comparison.blocks: {kind!r} is not one of {', '.join(BLOCK_KINDS)}")
    if kind == "event":
        return np.arange(len(time))
    window = np.asarray(step, str) if kind == "step" else np.asarray(time, "datetime64[D]")
    return np.unique(window, return_inverse=True)[1]
