"""The elastic roof of MOOSE's coal panel: its sag and the subsidence above it.

Facts from idaholab/moose, modules/tensor_mechanics/examples/coal_mining: coal_mining.tex (table
elastic.deform.standard: 0.19 m without Cosserat moduli under 400 m) and cosserat_elastic.i, which reports the
displacement of the point (0, 0, 403.003): the surface above the middle of the panel.
"""

import math

import numpy as np

from verification.results import Variant
from verification.rows import Row

SOURCE = "MOOSE, coal_mining.tex"


def roof_rows(name: str, variant: Variant, printed: float, allowed: float) -> list[Row]:
    """Subsidence of surface and roof above the middle of the panel, m, against the printed value."""
    panel, top = variant.values["excavations"][0]["upper"][1], variant.values["domain"]["upper"][1]
    surface, roof = (float(lowering(variant, height, np.zeros(1))[0]) for height in (top, panel))
    slits = row_of_slits(variant)
    remark = (
        f"not compared: {printed:g} is what the surface comes down by, the point that cosserat_elastic.i reports; "
        f"slits in a row like the panel, in rock without a surface, sag by {slits:.3g}, and a surface adds to it"
    )
    return [
        Row.relative(f"{name}: subsidence above the middle of the panel, m, {SOURCE}", printed, surface, allowed),
        Row(f"{name}: sag of the roof, m, {SOURCE}", printed, roof, abs(roof - printed) / printed, None, remark),
    ]


def lowering(variant: Variant, height: float, x: np.ndarray) -> np.ndarray:
    """Downward displacement (point,) m at a height, interpolated between its nodes at places x (point,) m."""
    place = variant.grid.node_position.values
    line = np.flatnonzero(np.isclose(place[:, 2], height))
    line = line[np.argsort(place[line, 0])]
    return -np.interp(x, place[line, 0], variant.elastic.node_displacement.values[line, 2])


def row_of_slits(variant: Variant) -> float:
    """Sag, m, in the middle of one of many slits in a row, in rock without a surface; rollers make such of the panel.

    2 (1 - nu^2) p / E times W / pi arccosh(1 / cos(pi a / W)) (Westergaard 1939, J. Appl. Mech. 6, A49).
    """
    values, host = variant.values, variant.values["materials"]["host"]
    half, _ = values["excavations"][0]["upper"]
    spacing = 2.0 * values["domain"]["upper"][0]
    above = values["domain"]["upper"][1] - values["excavations"][0]["upper"][1]
    pressure = -values["insitu_stress"]["gradient"]["zz"] * above
    reach = spacing / math.pi * math.acosh(1.0 / math.cos(math.pi * half / spacing))
    return 2.0 * (1.0 - host["poisson_ratio"] ** 2) * pressure / host["youngs_modulus"] * reach
