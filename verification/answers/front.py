"""Failed area around a brittle tunnel whose wall lies anywhere in its cells, against its closed form."""

import numpy as np
from matplotlib.figure import Figure

from catalogs.figures import style
from verification.cavities.cavity import plastic_ring
from verification.comparisons import closing_row, truncated_row, vanishing
from verification.page_tables import Pivot
from verification.plots import plot_errors
from verification.results import Results, Variant
from verification.rows import Row

TABLES = (
    Pivot(
        "Failed area over that of theory's ring, mean over places of the tunnel",
        r"(?P<row>\w+ drop, mean): (?P<column>\d+ cells across)",
        "measured",
    ),
    Pivot(
        "Its standard deviation over places",
        r"(?P<row>\w+ drop, standard deviation over places): (?P<column>\d+ cells across)",
        "measured",
    ),
)


def answer(results: Results) -> tuple[list[Row], Figure]:
    """Mean and spread of the failed area by rock and cells across; a figure of all places.

    Settings: rocks, cells, places: parts of the variants' names; judged: the cells whose mean has a bound.
    """
    settings, allowed = results.settings, results.allowed
    areas = {name: failed_over_ring(variant) for name, variant in results.variants.items()}
    rows = []
    for rock in settings["rocks"]:
        for cells in settings["cells"]:
            found = [areas[f"{rock}_{cells}_{place}"] for place in settings["places"]]
            bound = allowed["mean"] if cells == settings["judged"] else None
            remark = f"from {min(found):.3g} to {max(found):.3g} over the places"
            case = f"{cells} cells across"
            rows.append(Row.relative(f"{rock} drop, mean: {case}", 1.0, float(np.mean(found)), bound, remark))
            spread = float(np.std(found, ddof=1))
            rows.append(vanishing(f"{rock} drop, standard deviation over places: {case}", spread))
    states = [variant.last for variant in results.variants.values()]
    rows += [truncated_row("all", states), closing_row("all", states)]
    return rows, draw(settings, areas)


def failed_over_ring(variant: Variant) -> float:
    """Failed area over the area of theory's ring."""
    state, ring = variant.last, plastic_ring(variant)
    area = state.volume.values[state.failed.values >= 0].sum() / variant.grid.attrs["thickness"]
    return float(area / (np.pi * (ring.plastic_radius**2 - ring.radius**2)))


def draw(settings: dict, areas: dict[str, float]) -> Figure:
    """Failed area by place, a panel for each rock; the line is theory's."""
    figure = style.new_figure(height=3.0)
    places = settings["places"]
    panels = figure.subplots(1, len(settings["rocks"]), sharey=True, squeeze=False)[0]
    for panel, rock in zip(panels, settings["rocks"], strict=True):
        series = {
            f"{cells} cells across": [areas[f"{rock}_{cells}_{place}"] for place in places]
            for cells in settings["cells"]
        }
        plot_errors(
            panel, places, series, truth=1.0, legend="lower left", title=f"{rock} drop",
            xlabel="failed area over that of theory's ring",
        )  # fmt: skip
        panel.set_xlim(0.0, 1.08 * max(1.0, panel.dataLim.xmax))
    return figure
