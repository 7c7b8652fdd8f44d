"""Closure of a panel on elastic gob against a slit on springs, by height, stiffness, cells and dip."""

import numpy as np
from matplotlib.figure import Figure

from catalogs.figures import style
from verification.answers.slit.closed_form import Slit
from verification.page_tables import Pivot
from verification.results import Results, Variant
from verification.rows import Row

TABLES = (
    Pivot("Error against the slit (%)", r"(?P<row>(?:level|stiff|thin)_\w+): (?P<column>[^,]+), (?:m2|mm)", "error, %"),
    Pivot(
        "Error of a dipping opening against a level one (%)",
        r"(?P<row>dip_\w+): (?P<column>closed area)[^,]*, m2",
        "error, %",
    ),
)

MILLI = 1e3


def exact_slit(variant: Variant) -> Slit:
    """The slit of a variant: as wide as its opening, on springs as stiff as its gob in uniaxial strain."""
    values = variant.values
    opening, rock = values["excavations"][0], values["materials"]["host"]
    gob = variant.mine.settings.materials[opening["fill"]]
    corners = np.array(opening["points"] if "points" in opening else [opening["lower"], opening["upper"]])
    height = corners[-1, 1] - corners[0, 1]
    return Slit(
        half_width=0.5 * float(np.ptp(corners[:, 0])),
        pressure=-values["insitu_stress"]["constant"]["zz"],
        modulus=rock["youngs_modulus"] / (1.0 - rock["poisson_ratio"] ** 2),
        spring=(gob.lame_lambda + 2.0 * gob.shear_modulus) / height,
    )


def closed_area(variant: Variant) -> float:
    """Area by which the opening closes, m2: twice the energy that mining at once sets in motion, over the pressure."""
    return 2.0 * float(variant.elastic.attrs["energy_motion"]) / exact_slit(variant).pressure


def closure(variant: Variant) -> tuple[np.ndarray, np.ndarray]:
    """Places x (k,) m of the nodes of a level opening's roof and floor, and how much the two approach there (k,) m."""
    opening = variant.values["excavations"][0]
    place, moved = variant.elastic.node_position.values, variant.elastic.node_displacement.values
    (left, floor), (right, roof) = opening["lower"], opening["upper"]
    at = {}
    for name, height in (("floor", floor), ("roof", roof)):
        nodes = np.flatnonzero((place[:, 2] == height) & (place[:, 0] >= left) & (place[:, 0] <= right))
        at[name] = nodes[np.argsort(place[nodes, 0])]
    return place[at["roof"], 0], moved[at["floor"], 2] - moved[at["roof"], 2]


def answer(results: Results) -> tuple[list[Row], Figure]:
    """Rows and figure of the study."""
    allowed, rows = results.allowed, []
    level = {name: variant for name, variant in results.variants.items() if not name.startswith("dip")}
    for name, variant in level.items():
        exact, (place, found) = exact_slit(variant), closure(variant)
        bounds = [allowed["thin"]] * 2 if name.startswith("thin") else [allowed["area"], allowed["middle"]]
        middle = float(found[np.argmin(np.abs(place))])
        expected = float(exact.closure(np.zeros(1))[0])
        rows += [
            Row.relative(f"{name}: closed area, m2", exact.closed_area, closed_area(variant), bounds[0]),
            Row.relative(f"{name}: closure at the middle, mm", MILLI * expected, MILLI * middle, bounds[1]),
        ]
    for name, variant in results.variants.items():
        if name in level:
            continue
        cell = name.split("_")[1]
        bound = None if name.endswith("mean") else allowed["dip"]
        of_level = closed_area(results[f"level_{cell}"])
        rows.append(
            Row.relative(f"{name}: closed area against the level one's, m2", of_level, closed_area(variant), bound)
        )
    return rows, draw(level)


def draw(level: dict[str, Variant]) -> Figure:
    """Closure along soft and stiff gob, for each size of cell, with the closed form."""
    figure = style.new_figure(height=3.6)
    for axes, kind in zip(figure.subplots(1, 2), ("level", "stiff"), strict=True):
        shown = {name: variant for name, variant in level.items() if name.startswith(kind)}
        exact = exact_slit(next(iter(shown.values())))
        x = np.linspace(-exact.half_width, exact.half_width, 400)
        axes.plot(x, MILLI * exact.closure(x), color=style.OUTLINE, linewidth=1.2, label="slit, exact")
        colours = style.step_colours([True] * len(shown))
        for (name, variant), mark, colour in zip(shown.items(), "os^", colours, strict=False):
            place, found = closure(variant)
            label = f"{name.split('_')[1]} m cells"
            axes.plot(place, MILLI * found, mark, color=colour, markersize=3.5, fillstyle="none", label=label)
        modulus = next(iter(shown.values())).values["materials"]["gob"]["youngs_modulus"]
        axes.set(title=f"gob of {modulus / 1e6:g} MPa", xlabel="x (m)", ylabel="closure (mm)")
        axes.legend()
    return figure
