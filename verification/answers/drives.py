"""Table of openings of a round drive in rock that fails, station by station, against closed forms of its ring."""

from dataclasses import dataclass

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from catalogs.figures import style
from common.opening_table import ALL
from response.openings import openings_table
from response.settings import OpeningSlice
from verification.cavities.cavity import read_pressure
from verification.cavities.coulomb import CoulombRock, PlasticTunnel
from verification.comparisons import closing_row, truncated_row, vanishing
from verification.page_tables import Pivot
from verification.results import Results, Variant
from verification.rows import Row

MEASURES = ("depth_mean", "depth_p90", "depth_largest")
TABLES = (
    Pivot(
        "Errors of the worst station: depth in cells, closure as a share",
        r"(?P<row>\w+): (?P<column>.+), worst station",
        "error",
    ),
)


@dataclass(frozen=True)
class Stations:
    """Stretches of a drive: chainage (station,) of their middles, m, and columns of the table of openings by name."""

    chainage: NDArray
    columns: dict[str, NDArray]
    theory: PlasticTunnel
    cell: float

    @property
    def depth(self) -> float:
        """Depth of failure in theory, m."""
        return self.theory.plastic_radius - self.theory.radius

    @property
    def closure(self) -> float:
        """Inward displacement of the wall in theory, m."""
        return -float(self.theory.displacement(self.theory.radius))


def answer(results: Results) -> tuple[list[Row], Figure]:
    """Rows of the worst stations of each variant, and a figure of all stations.

    Settings: left_out: share of the drive at either end that is not compared; judged: cells across from which the
    closure has a bound.
    """
    settings, allowed = results.settings, results.allowed
    found = {name: read_stations(variant, settings["left_out"]) for name, variant in results.variants.items()}
    rows = []
    for name, stations in found.items():
        rows += station_rows(name, stations, settings["judged"], allowed)
    states = [variant.last for variant in results.variants.values()]
    rows += [truncated_row("all", states), closing_row("all", states)]
    return rows, draw(found)


def read_stations(variant: Variant, left_out: float) -> Stations:
    """The stations of a variant, made as the stage `openings` makes them."""
    settings = OpeningSlice.of(variant.mine.openings_slice())
    nothing = [np.empty((0, 3))] * len(settings.steps)
    states = (variant.step(step.name) for step in settings.steps)
    table = openings_table(settings, variant.grid, states, nothing, nothing)
    hole = variant.values["excavations"][0]
    length = float(np.linalg.norm(np.subtract(hole["end"], hole["start"])))
    start, end = table["chainage_from"].values, table["chainage_to"].values
    last = table["step"].values == settings.steps[-1].name
    inside = (table["side"].values == ALL) & last & (start >= left_out * length) & (end <= (1.0 - left_out) * length)
    columns = {
        name: table[name].values[inside] for name in (*MEASURES, "closure_radial", "closure_largest", "wall_area")
    }
    theory = PlasticTunnel(hole["radius"], read_pressure(variant), CoulombRock.of(variant.values["materials"]["host"]))
    return Stations(0.5 * (start + end)[inside], columns, theory, float(variant.grid.attrs["fine_cell"]))


def station_rows(name: str, stations: Stations, judged: int, allowed: dict) -> list[Row]:
    """Rows of the worst station, and of the mean of all, of each measure."""
    rows = []
    across = round(2.0 * stations.theory.radius / stations.cell)
    for measure, bound in zip(MEASURES, (allowed["depth_cells"], allowed["depth_cells"], None), strict=True):
        depth = stations.columns[measure] / stations.cell
        expected = stations.depth / stations.cell
        worst = float(depth[np.abs(depth - expected).argmax()])
        remark = f"{len(depth)} stations, {across} cells across, from {depth.min():.3g} to {depth.max():.3g} cells"
        what = measure.replace("_", ", ").replace("p90", "nine tenths")
        rows.append(Row.absolute(f"{name}: {what} (cells), worst station", expected, worst, bound, remark))
    for measure, expected in (("closure_radial", stations.closure), ("closure_largest", 2.0 * stations.closure)):
        closed = stations.columns[measure]
        worst = float(closed[np.abs(closed - expected).argmax()])
        bound = allowed["closure"] if across >= judged and measure == "closure_radial" else None
        remark = f"from {1e3 * closed.min():.4g} to {1e3 * closed.max():.4g} mm"
        what = measure.replace("_", ", ")
        rows.append(Row.relative(f"{name}: {what} (mm), worst station", 1e3 * expected, 1e3 * worst, bound, remark))
    spread = stations.columns["wall_area"]
    rows.append(
        vanishing(f"{name}: area of wall, standard deviation over its mean", float(spread.std() / spread.mean()))
    )
    return rows


def draw(found: dict[str, Stations]) -> Figure:
    """Depth of failure and closure of all stations over those of theory."""
    figure = style.new_figure(height=4.0)
    deep, closed = figure.subplots(1, 2, sharex=True)
    for number, (name, stations) in enumerate(found.items()):
        across = stations.chainage - stations.chainage.mean()
        line = {"color": f"C{number % 10}", "linewidth": 1.2, "linestyle": "-" if "coarse" not in name else ":"}
        deep.plot(across, stations.columns["depth_mean"] / stations.depth, label=name.replace("_", " "), **line)
        closed.plot(across, stations.columns["closure_radial"] / stations.closure, **line)
    for panel, what in ((deep, "mean depth of failure"), (closed, "mean inward displacement")):
        panel.axhline(1.0, color=style.OUTLINE, linewidth=0.8)
        panel.set_xlabel("distance along the drive from its middle (m)")
        panel.set_ylabel(f"{what}, over theory's")
    figure.legend(*deep.get_legend_handles_labels(), loc="outside lower center", ncols=3)
    return figure
