"""Specimens with weak planes under axial compression, against Jaeger's strength by the angle of the planes.

Strength of a specimen with planes of weakness of one orientation (Jaeger 1960, Geol. Mag. 97, 65).
"""

import math
from dataclasses import dataclass

import numpy as np
from matplotlib.figure import Figure

from catalogs.figures import style
from common.voigt import tensor_from_voigt
from verification.answers.fault import normal_of, share_within
from verification.comparisons import MPA, vanishing
from verification.plots import plot_series
from verification.results import Results, Variant
from verification.rows import Row


def jaeger_strength(
    angle: float, confinement: float, rock: tuple[float, float], plane: tuple[float, float]
) -> tuple[float, bool]:
    """Axial minus lateral compression at failure, Pa, and whether the planes slip then.

    angle: from the axis to the planes' normal, degrees; confinement: lateral compression, Pa; rock, plane: cohesion Pa
    and friction angle, degrees. Planes slip at 2 (c + p tan phi) / ((1 - tan phi cot b) sin 2b) where b > phi. The rock
    fails at (N - 1) p + sigma_c. The smaller value counts.
    """
    cohesion, friction = rock[0], math.sin(math.radians(rock[1]))
    factor = (1 + friction) / (1 - friction)
    of_rock = (factor - 1) * confinement + 2 * cohesion * math.sqrt(factor)
    b, slope = math.radians(angle), math.tan(math.radians(plane[1]))
    if math.sin(b) <= slope * math.cos(b) or angle >= 90:
        return of_rock, False
    of_plane = 2 * (plane[0] + confinement * slope) / ((1 - slope / math.tan(b)) * math.sin(2 * b))
    return min(of_rock, of_plane), of_plane < of_rock


@dataclass(frozen=True)
class Specimen:
    """One variant in flow. angle: degrees; expected, found: strengths, Pa; slips: whether its planes should slip.

    brittle: whether strength drops. within: share of plastic strain that is no slip along the planes.
    """

    angle: float
    expected: float
    found: float
    slips: bool
    brittle: bool
    within: float


def answer(results: Results) -> tuple[list[Row], Figure]:
    """Rows and figure of the study."""
    specimens = {name: read_specimen(variant) for name, variant in results.variants.items()}
    rows = []
    for name, specimen in specimens.items():
        quantity = f"{name}: axial less lateral compression in flow, MPa"
        values = specimen.expected * MPA, specimen.found * MPA
        remark = "planes slip" if specimen.slips else "rock fails"
        rows.append(Row.relative(quantity, *values, results.allowed["strength"], remark))
        if specimen.slips:
            quantity = f"{name}: plastic strain within the planes or across them, share of it"
            rows.append(vanishing(quantity, specimen.within, results.allowed["within"]))
    return rows, draw(results, specimens)


def strengths(material: dict, state: str) -> tuple[tuple[float, float], tuple[float, float]]:
    """Cohesion Pa and friction angle, degrees, of rock and planes that are "intact" or "residual"."""
    rock, planes = ((part["cohesion"][state], part["friction_angle"][state]) for part in (material, material["planes"]))
    return rock, planes


def read_specimen(variant: Variant) -> Specimen:
    """The only particle after the last step."""
    material = variant.values["materials"]["host"]
    state = variant.last
    confinement = -variant.values["insitu_stress"]["constant"]["xx"]
    expected, slips = jaeger_strength(material["planes"]["dip"], confinement, *strengths(material, "residual"))
    lateral, _, axial, *_ = state["stress"].values[0]
    strain = tensor_from_voigt(state["plastic_strain"].values[0])
    brittle = strengths(material, "intact") != strengths(material, "residual")
    within = share_within(strain, normal_of(material))
    return Specimen(material["planes"]["dip"], expected, float(lateral - axial), slips, brittle, float(within))


def draw(results: Results, specimens: dict[str, Specimen]) -> Figure:
    """Strength over the angle between the axis and the planes' normal."""
    variant = next(iter(results.variants.values()))
    material, confinement = variant.values["materials"]["host"], -variant.values["insitu_stress"]["constant"]["xx"]
    angles = np.linspace(0.0, 90.0, 361)
    curve = [jaeger_strength(angle, confinement, *strengths(material, "intact"))[0] * MPA for angle in angles]
    found = {}
    for brittle, label in ((False, "cell in flow"), (True, "after a drop")):
        chosen = [specimen for specimen in specimens.values() if specimen.brittle == brittle]
        found[label] = [one.angle for one in chosen], [one.found * MPA for one in chosen]
    figure = style.new_figure(height=4.0)
    axes = figure.subplots()
    labels: dict = {
        "xlabel": "angle from the axis to the planes' normal (degrees)",
        "ylabel": "axial less lateral (MPa)",
        "ylim": (0.0, None),
    }
    plot_series(axes, found, {"Jaeger (1960)": (angles, curve)}, **labels)
    return figure
