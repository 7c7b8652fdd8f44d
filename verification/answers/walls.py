"""One stope whose walls lie anywhere in their cells, against the same stope with walls on cell faces."""

import itertools

import numpy as np
from matplotlib.figure import Figure

from catalogs.figures import style
from verification.comparisons import released_potency, reported, vanishing
from verification.page_tables import Pivot
from verification.plots import plot_errors
from verification.results import Results, Variant
from verification.rows import Row

TABLES = (
    Pivot(
        "Potency by place of the walls (m3)",
        r"(?P<row>\w+, \d+ cells across, \w+), (?P<column>\w+): potency, m3",
        "measured",
    ),
    Pivot(
        "Spread of potency over the places of one scene (%)",
        r"(?P<row>\w+, \d+ cells across, \w+), (?P<column>\w+): spread of potency over placements",
        "error, %",
    ),
)

STEP = "mined"
FACES = "faces"


def answer(results: Results) -> tuple[list[Row], Figure]:
    """Potency of each placement against the limit, its spread and its extrapolation; a figure of all placements."""
    settings, allowed = results.settings, results.allowed
    found = {name: released(variant) for name, variant in results.variants.items()}
    rows = []
    limits = {}
    for fill, (coarse, fine) in settings["limit"].items():
        limits[fill] = limit = 2.0 * found[fine] - found[coarse]
        remark = f"twice {found[fine]:.4g} of {fine} less {found[coarse]:.4g} of {coarse}"
        rows.append(reported(f"{fill}: limit of the potency of ever smaller cells, m3", limit, remark))
        for cells in settings["cells"][fill]:
            on_faces = found[f"{fill}_{FACES}_{cells}"]
            rows.append(Row.relative(f"{fill}, {cells} cells across, walls on faces: potency, m3", limit, on_faces))
    placed = itertools.product(panels_of(settings), settings["treatments"])
    for (fill, cells), treatment in placed:
        judged = treatment == settings["judged"]
        name = f"{fill}, {cells} cells across, {treatment}"
        bound = allowed[f"limit_{cells}"] if judged else None
        unturned, turned = (
            [found[f"{fill}_{place}_{cells}_{treatment}"] for place in settings[part]]
            for part in ("unturned", "turned")
        )
        for place, value in zip(settings["unturned"], unturned, strict=True):
            rows.append(Row.relative(f"{name}, {place}: potency, m3", limits[fill], value, bound))
        for place, value in zip(settings["turned"], turned, strict=True):
            rows.append(reported(f"{name}, {place}: potency, m3", value))
        bound = allowed[f"spread_{cells}"] if judged else None
        for scene, every in (("unturned", [found[f"{fill}_{FACES}_{cells}"], *unturned]), ("turned", turned)):
            spread = float(np.ptp(every) / np.mean(every))
            rows.append(vanishing(f"{name}, {scene}: spread of potency over placements", spread, bound))
    for fill, cells in settings["cells"].items():
        for place in settings["unturned"] if len(cells) == 2 else ():
            coarse, fine = (found[f"{fill}_{place}_{number}_{settings['judged']}"] for number in cells)
            quantity = f"{fill}, {place}, {settings['judged']}: potency extrapolated, m3"
            rows.append(Row.relative(quantity, limits[fill], 2.0 * fine - coarse, allowed["extrapolated"]))
    for name, case in settings["other_fill"].items():
        rows.append(reported(f"{case}: potency, m3", found[name]))
    return rows, draw(settings, found, limits)


def released(variant: Variant) -> float:
    """Seismic potency of the step, m3, summed over rock that failed in it."""
    return released_potency(variant.step(STEP))


def panels_of(settings: dict) -> list[tuple[str, int]]:
    """Fill and cells across of each group of placements."""
    return [(fill, cells) for fill, numbers in settings["cells"].items() for cells in numbers]


def draw(settings: dict, found: dict[str, float], limits: dict[str, float]) -> Figure:
    """Potency by placement, a panel for each fill and number of cells; the line is the limit."""
    panels = panels_of(settings)
    figure = style.new_figure(height=3.4)
    places = [*settings["unturned"], *settings["turned"]]
    names = [FACES, *(place.replace("_", " ") for place in places)]
    for panel, (fill, cells) in zip(figure.subplots(1, len(panels), sharey=True), panels, strict=True):
        on_faces = found[f"{fill}_{FACES}_{cells}"]
        series = {
            treatment: [on_faces, *(found[f"{fill}_{place}_{cells}_{treatment}"] for place in places)]
            for treatment in settings["treatments"]
        }
        labels: dict = {"title": f"{fill}, {cells} cells across", "xlabel": "seismic potency of the step (m³)"}
        plot_errors(panel, names, series, truth=limits[fill], legend="lower left", **labels)
        panel.set_xlim(0.0, 1.08 * panel.dataLim.xmax)
    return figure
