"""The stress before mining, where the events are, as axes beside theirs."""

import numpy as np

from catalogs.report.inputs import Evidence
from common.source_tensors import principal_axes
from common.voigt import tensor_from_voigt


def insitu_axes(evidence: Evidence) -> np.ndarray | None:
    """Most, middle and least compressive axis (3, xyz) of the virgin stress at the events' mean elevation, by potency.

    None where the configuration is not known or no event is there.
    """
    stress, events = evidence.insitu, evidence.resolved
    if stress is None or events is None or not events.sizes["event"]:
        return None
    depth = stress.surface - np.average(events["location"].values[:, 2], weights=events["potency"].values)
    return principal_axes(tensor_from_voigt(np.array(stress.constant) + depth * np.array(stress.gradient)))
