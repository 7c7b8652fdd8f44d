"""Which part of the model's source types is an input: the isotropic share that the dilation angle sets."""

from catalogs.report.inputs import Evidence
from catalogs.report.text import number
from pipeline.quantities import parse_quantity
from pipeline.source_tensors import shear_iso_share

NAMED = 4  # rocks in the sentence


def iso_share(evidence: Evidence) -> str:
    """What the rocks' dilation angles make of the isotropic share, in sentences; empty where no rock has one."""
    angles = {
        name: parse_quantity(material["dilation_angle"]["residual"], "deg")  # of the drop, which is what is seismic
        for name, material in evidence.config.get("materials", {}).items()
        if "dilation_angle" in material
    }
    if not angles:
        return ""
    rocks = []
    for name, angle in sorted(angles.items(), key=lambda item: item[0] != "host")[:NAMED]:
        shares = dict.fromkeys(number(100.0 * share, 2) for share in shear_iso_share(angle))
        rocks.append(f"{' to '.join(shares)} % in a cell of {name} ({number(angle, 2)}°)")
    return (
        f"The ISO share of rock that fails in shear follows from its dilation angle, an input: {', '.join(rocks)}. "
        "In an event of cells whose mechanisms differ it is somewhat larger, and where rock tears it is a third. "
        "An ISO share near the record's is no agreement of model and record: it says which angle was chosen. Openings "
        "that close in an event, the implosive part of many sources in mines (McGarr 1992), are not in the tensor."
    )
