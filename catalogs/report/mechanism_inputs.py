"""Inputs that the model's mechanisms are compared with: the ISO share that dilation sets, and axes of virgin stress."""

import numpy as np

from catalogs.report.inputs import Evidence
from catalogs.report.text import number
from common.quantities import parse_quantity
from common.source_tensors import principal_axes, shear_iso_share
from common.voigt import tensor_from_voigt

MAX_ROCKS_NAMED = 4  # Rocks that the sentence names.


def iso_share(evidence: Evidence) -> str:
    """The isotropic share that follows from the rocks' dilation angles, in sentences; empty if no rock has one."""
    materials = evidence.config.get("materials", {})
    rocks = []
    for name in sorted(materials, key=lambda name: name != "host"):
        if "dilation_angle" in materials[name]:
            angle = _of_the_drop(materials[name])
            span = dict.fromkeys(number(100.0 * share, 2) for share in shear_iso_share(angle))
            rocks.append(f"{' to '.join(span)} % in a cell of {name} ({angle:g}°)")
        if materials[name].get("planes"):  # slip along a plane is flow on a face
            angle = _of_the_drop(materials[name]["planes"])
            share = number(100.0 * shear_iso_share(angle)[0], 2)
            rocks.append(f"{share} % in slip on the planes of {name} ({angle:g}°)")
    if not rocks:
        return ""
    shares = ", ".join(rocks[:MAX_ROCKS_NAMED])
    return (
        f"The ISO share of rock that fails in shear follows from its dilation angle, an input: {shares}. "
        "In an event of cells whose mechanisms differ it is somewhat larger, and where rock tears it is a third. "
        "If the ISO share is near the record's, this reflects the chosen angle and is no evidence for the model. The "
        "tensor does not include openings that close in an event, the implosive part of many sources in mines (McGarr "
        "1992)."
    )


def _of_the_drop(strength: dict) -> float:
    """Dilation angle, degrees, with which rock or planes drop to their residual strength: that part is seismic."""
    return parse_quantity(strength["dilation_angle"]["residual"], "deg")


def insitu_axes(evidence: Evidence) -> np.ndarray | None:
    """Most, middle and least compressive axis (3, xyz) of the virgin stress at the events' mean elevation, by potency.

    None where the configuration is not known or no event is there.
    """
    stress, events = evidence.insitu, evidence.resolved
    if stress is None or events is None or not events.sizes["event"]:
        return None
    depth = stress.surface - np.average(events["location"].values[:, 2], weights=events["potency"].values)
    return principal_axes(tensor_from_voigt(np.array(stress.constant) + depth * np.array(stress.gradient)))
