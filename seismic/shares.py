"""Shares of the potency: in particles unlike their event, and in events that one increment of the load has caused."""

import numpy as np
from numpy.typing import NDArray

from common.source_tensors import scalar_potency
from common.voigt import tensor_from_voigt
from seismic.families import closeness


def unlike_share(potency: NDArray, event: NDArray, event_potency: NDArray, threshold: float) -> float:
    """Share of the scalar potency in particles whose cosine with their event's tensor is below the threshold.

    potency (particle, 6), event (particle,), event_potency (event, 6) m3.
    """
    own = tensor_from_voigt(potency)
    unlike = closeness(own, tensor_from_voigt(event_potency)[event]) < threshold
    scalar = scalar_potency(own)
    return float(np.sum(scalar[unlike]) / np.sum(scalar)) if len(own) else 0.0


def at_once_share(weight: NDArray, event: NDArray, failure_order: NDArray, least: int) -> float:
    """Share of the scalar potency in events whose rock one increment of the load brought above its strength.

    That is rock that fails before any other of its increment (generation 0), where one event has `least` such particles
    and more. In smaller increments they would fail one after another, some of them never, and form other events.
    weight (particle,) m3; event (particle,); failure_order (particle, 2): increment and generation.
    """
    first = failure_order[:, 1] == 0
    increment = failure_order[:, 0].astype(np.int64)
    key = event * (increment.max(initial=0) + 1) + increment  # families may span increments
    _, own, count = np.unique(key[first], return_inverse=True, return_counts=True)
    total = weight.sum()
    return float(weight[first][count[own] >= least].sum() / total) if total > 0.0 else 0.0
