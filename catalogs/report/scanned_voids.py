"""Scanned voids in the report: overbreak of each wall beside the rock that the model has failed there.

The section on instruments shows them; its template is "sections/observations.html.j2".
"""

from dataclasses import dataclass

import numpy as np
import xarray as xr
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from numpy.typing import NDArray

from catalogs.figures import style
from catalogs.report.gallery import Gallery
from common.scan_table import ALL

MAX_SCANS = 4  # Scans whose walls are drawn.
COLOUR_SHARE = 98.0  # Percentile of both measures at which colours end.


@dataclass(frozen=True)
class ScanLine:
    """A side of a scan: the columns of the table of scanned voids that the report lists, and the share that is seen."""

    scan: str
    step: str
    side: str
    seen: float
    mean: float
    deepest: float
    elos: float
    under: float
    depth: float
    depth_p90: float
    fallen: float
    misfit: float
    low: float
    high: float


def shown_scans(table: xr.Dataset | None, gallery: Gallery) -> dict | None:
    """What the section shows of scanned voids: lines, half a cell (m), figures of the walls of the first scans, and how
    many scans these leave out. None without scans."""
    if table is None or not table.sizes["row"]:
        return None
    scans = list(dict.fromkeys(str(name) for name in table["scan"].values))
    return {
        "lines": [_line(table, row) for row in range(table.sizes["row"])],
        "half_cell": 0.5 * float(table["cell"].values.max()),
        "figures": [
            gallery.add(f"scan_{number + 1}", walls_figure(table, name)) | {"scan": name}
            for number, name in enumerate(scans[:MAX_SCANS])
        ],
        "others": len(scans) - MAX_SCANS,
    }


def _line(table: xr.Dataset, row: int) -> ScanLine:
    """The line of a row of the table."""

    def of(column: str) -> float:
        return float(table[column].values[row])

    scan, step, side = (str(table[column].values[row]) for column in ("scan", "step", "side"))
    return ScanLine(
        scan, step, side, of("seen_area") / of("wall_area") if of("wall_area") > 0.0 else np.nan,
        *map(of, ("overbreak_mean", "overbreak_p90", "elos", "underbreak_mean", "depth_mean", "depth_p90")),
        *map(of, ("fallen_mean", "misfit", "misfit_low", "misfit_high")),
    )  # fmt: skip


def walls_figure(table: xr.Dataset, scan: str) -> Figure:
    """Each side of a scan, seen from within the opening, roof and floor from above: scanned overbreak above, modelled
    depth of failure below, in one scale."""
    rows = [
        row for row in np.flatnonzero(table["scan"].values == scan).tolist() if str(table["side"].values[row]) != ALL
    ]
    rows = [row for row in rows if (table["point_row"].values == row).any()]
    values = {"scanned": table["scanned"].values, "depth": table["depth"].values}
    shown = np.concatenate([column[np.isin(table["point_row"].values, rows)] for column in values.values()])
    largest = float(np.nanpercentile(np.abs(shown), COLOUR_SHARE)) if np.isfinite(shown).any() else 0.0
    scale = Normalize(-max(largest, 0.1), max(largest, 0.1))
    figure = style.new_figure(height=5.2)
    panels = figure.subplots(2, max(len(rows), 1), squeeze=False, sharex="col", sharey="col")
    told = ""
    for column, row in enumerate(rows):
        own = np.flatnonzero(table["point_row"].values == row)
        along, across, labels = _in_plane(table, row, own)
        for panel, measure in zip(panels[:, column], values.values(), strict=True):
            _draw(panel, along, across, measure[own], float(table["cell"].values[row]), scale)
        panels[0, column].set_title(str(table["side"].values[row]))
        panels[1, column].set_xlabel(labels[0])
        for panel in panels[:, column] if labels[1] != told else ():
            panel.set_ylabel(labels[1])
        told = labels[1]
    for panel, text in zip(panels[:, 0], ("scanned", "modelled"), strict=True):
        panel.annotate(
            text, (0.0, 0.5), (-46, 0), xycoords="axes fraction", textcoords="offset points", rotation=90,
            va="center", ha="right", weight="bold",
        )  # fmt: skip
    bar = figure.colorbar(ScalarMappable(scale, "RdBu_r"), ax=panels, extend="both", shrink=0.8)
    bar.set_label("beyond the design: overbreak, depth of failure (m)")
    return figure


def _in_plane(table: xr.Dataset, row: int, own: NDArray) -> tuple[NDArray, NDArray, tuple[str, str]]:
    """Coordinates (k,), (k,) m of points in the plane of their side, and their names with units."""
    place, bearing = table["place"].values[own], float(table["bearing"].values[row])
    if str(table["side"].values[row]) in ("roof", "floor"):
        return place[:, 0], place[:, 1], ("east (m)", "north (m)")
    if not np.isfinite(bearing):  # the faces of a drive
        return place[:, 0], place[:, 2], ("east (m)", "elevation (m)")
    to_the_right = np.array([np.cos(np.radians(bearing)), -np.sin(np.radians(bearing))])
    along = place[:, :2] @ to_the_right
    return along - along.min(), place[:, 2], ("along the wall (m)", "elevation (m)")


def _draw(panel, along: NDArray, across: NDArray, values: NDArray, cell: float, scale: Normalize) -> None:
    """Means of the values in squares of a cell; grey where a wall has no value."""
    column, line = (np.floor((one - one.min()) / cell).astype(int) for one in (along, across))
    shape = (line.max() + 1, column.max() + 1)
    known = np.isfinite(values)
    total, count, every = np.zeros(shape), np.zeros(shape), np.zeros(shape)
    np.add.at(total, (line[known], column[known]), values[known])
    np.add.at(count, (line[known], column[known]), 1.0)
    np.add.at(every, (line, column), 1.0)
    edges = [one.min() + cell * np.arange(most + 1) for one, most in ((along, shape[1]), (across, shape[0]))]
    unseen = np.where((every > 0) & (count == 0), 0.5, np.nan)
    panel.pcolormesh(*edges, unseen, cmap="Greys", vmin=0.0, vmax=1.0, rasterized=True)
    means = np.divide(total, count, out=np.full(shape, np.nan), where=count > 0)
    panel.pcolormesh(*edges, means, cmap="RdBu_r", norm=scale, rasterized=True)
    panel.set_aspect("equal")
