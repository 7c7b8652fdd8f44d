"""Which part of the model's source types is an input: the isotropic share that the dilation angle sets."""

from catalogs.report.inputs import Evidence
from catalogs.report.text import number
from common.quantities import parse_quantity
from common.source_tensors import shear_iso_share

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
