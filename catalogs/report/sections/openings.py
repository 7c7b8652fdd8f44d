"""Openings: how deep rock has failed around each, how much it has closed, and what its walls bear; profiles of drives.

The template is "openings.html.j2".
"""

from dataclasses import dataclass

import numpy as np
import xarray as xr
from matplotlib.figure import Figure
from numpy.typing import NDArray

from catalogs.figures import style
from catalogs.report.evidence import Evidence
from catalogs.report.gallery import Gallery
from catalogs.report.text import fixed, number
from common.opening_table import ALL, ROOF_FROM, SIDES

MAX_DRAWN = 6  # Drives whose profile is drawn: those in which rock fails deepest.
MAX_LISTED = 40  # Openings of the table: those in which rock fails deepest.
MAX_WORST = 3  # Openings on the first page.
SIDE_COLOURS = {"roof": "#0072b2", "walls": "#d55e00", "floor": "#009e73"}  # Okabe and Ito (2008)


@dataclass(frozen=True)
class OpeningLine:
    """An excavation after the last step: depth of failure (m) that nine tenths of each of SIDES do not exceed, NaN for
    a side that it does not have, and the columns of the table of openings for all of it."""

    name: str
    filled: bool
    sides: tuple[float, ...]
    largest: float
    volume: float
    new: float
    fallen: float
    closure: float
    stress: float
    change: float
    factor: float
    through: float
    modelled: int
    recorded: float


def section(evidence: Evidence, gallery: Gallery) -> dict | None:
    """Content of the section on openings: lines (those with the deepest failure, deepest first), others (how many are
    not listed), step, half a cell (m), figure of profiles or None. None without a table of openings."""
    lines = opening_lines(evidence)
    if not lines:
        return None
    profiles = _profiles(evidence, [line.name for line in lines])
    return {
        "lines": lines[:MAX_LISTED],
        "others": len(lines) - MAX_LISTED,
        "step": last_step(evidence),
        "steepest": ROOF_FROM,
        "half_cell": 0.5 * float(evidence.grid.attrs["fine_cell"]),
        "narrow": [row.name for row in evidence.excavations if row.narrow and not row.planned],
        "profiles": gallery.add("openings", profiles) if profiles else None,
    }


def last_step(evidence: Evidence) -> str:
    """Name of the last step that is computed; those after a collapse are not."""
    computed = [step for step in evidence.steps if int(step.get("computed", 1))]
    return str((computed or evidence.steps)[-1]["step"])


def opening_lines(evidence: Evidence) -> list[OpeningLine]:
    """A line for each excavation that has been mined, the one with the deepest failure first."""
    table = evidence.openings
    if table is None or not table.sizes["row"] or not evidence.steps:
        return []
    last = table["step"].values == last_step(evidence)
    rows = np.flatnonzero(last & np.isnan(table["chainage_from"].values))
    place = {(str(table["excavation"].values[row]), str(table["side"].values[row])): row for row in rows}
    lines = [_line(table, place, name, row) for (name, side), row in place.items() if side == ALL]
    return sorted(lines, key=lambda line: -max(0.0, *(depth for depth in line.sides if np.isfinite(depth))))


def _line(table: xr.Dataset, place: dict[tuple[str, str], int], name: str, row: int) -> OpeningLine:
    """The line of an excavation; row: that of all its sides."""
    deep = table["depth_p90"].values
    sides = tuple(float(deep[place[name, side]]) if (name, side) in place else np.nan for side in SIDES)

    def of(column: str) -> float:
        return float(table[column].values[row])

    return OpeningLine(
        name, bool(of("filled")), sides, of("depth_largest"), of("failed_volume"), of("failed_volume_step"),
        of("fallen_volume"), of("closure_median"), of("major_stress"), of("major_stress_change"), of("strength_factor"),
        of("through_share"), int(of("events_modelled")), of("events_recorded"),
    )  # fmt: skip


def deepest_stretch(evidence: Evidence, name: str, side: str) -> tuple[float, float] | None:
    """Chainage (m) between which the failure of a side of a drive is deepest after the last step, the first such
    stretch of several; None where the excavation is no drive or the side does not fail."""
    table = evidence.openings
    own = (table["excavation"].values == name) & (table["side"].values == side)
    own &= (table["step"].values == last_step(evidence)) & np.isfinite(table["chainage_from"].values)
    if not own.any():
        return None
    depths, edges = _stairs(table, np.flatnonzero(own), "depth_p90")
    deepest = np.nanmax(depths, initial=0.0)
    if not deepest > 0.0:
        return None
    is_deepest = depths == deepest
    first = int(is_deepest.argmax())
    end = first + int(np.append(~is_deepest[first:], True).argmax())
    return float(edges[first]), float(edges[end])


def worst(evidence: Evidence) -> str:
    """Sentence on the openings in which rock fails deepest after the last step, MAX_WORST at most: the side, its depth,
    in a drive the chainage at which it is deepest, and the closure; empty where rock fails in no wall. Openings that
    are filled count where none stands open."""
    clauses, lines = [], opening_lines(evidence)
    open_ones = [line for line in lines if not line.filled]
    for line in (open_ones or lines)[:MAX_WORST]:
        depths = {side: depth for side, depth in zip(SIDES, line.sides, strict=True) if depth > 0.0}
        if depths:
            side = max(depths, key=lambda one: depths[one])
            stretch = deepest_stretch(evidence, line.name, side)
            place = f" (deepest {fixed(stretch[0], 0)} to {fixed(stretch[1], 0)} m along it)" if stretch else ""
            closed = f", closure {number(1e3 * line.closure, 2)} mm" if np.isfinite(line.closure) else ""
            clauses.append(f"{line.name}, {side} {number(depths[side], 2)} m{place}{closed}")
    where = "Of what stands open, rock" if 0 < len(open_ones) < len(lines) else "Rock"
    return f"{where} has failed deepest at {'; '.join(clauses)}." if clauses else ""


def _profiles(evidence: Evidence, names: list[str]) -> Figure | None:
    """Depth of failure of roof, walls and floor along the first drives of `names`, and their closure; None without
    drives."""
    table = evidence.openings
    last = table["step"].values == last_step(evidence)
    stretches = last & np.isfinite(table["chainage_from"].values)
    drives = [name for name in names if (stretches & (table["excavation"].values == name)).any()][:MAX_DRAWN]
    if not drives:
        return None
    figure = style.new_figure(height=1.0 + 1.6 * len(drives))
    panels = figure.subplots(len(drives), 2, sharex="row", squeeze=False, width_ratios=(3, 2))
    for name, (deep, closed) in zip(drives, panels, strict=True):
        own = stretches & (table["excavation"].values == name)
        for side, colour in SIDE_COLOURS.items():
            rows = np.flatnonzero(own & (table["side"].values == side))
            if len(rows):
                deep.stairs(*_stairs(table, rows, "depth_p90"), color=colour, label=side, baseline=None, linewidth=1.4)
        rows = np.flatnonzero(own & (table["side"].values == ALL))
        values, edges = _stairs(table, rows, "closure_median")
        closed.stairs(1e3 * values, edges, color=style.OUTLINE, baseline=None, linewidth=1.4)
        deep.set_title(name, loc="left")
        deep.set_ylabel("depth of\nfailure (m)")
        closed.set_ylabel("closure (mm)")
        for panel in (deep, closed):
            panel.set_ylim(bottom=0.0)
    sides = {
        label: handle
        for panel in panels[:, 0]
        for handle, label in zip(*panel.get_legend_handles_labels(), strict=True)
    }
    panels[0, 0].legend(sides.values(), sides.keys(), loc="upper right", ncols=3)
    for panel in panels[-1]:
        panel.set_xlabel("chainage (m)")
    return figure


def _stairs(table: xr.Dataset, rows: NDArray, column: str) -> tuple[NDArray, NDArray]:
    """Values (k,) and edges (k + 1,) of stretches, in order; NaN in gaps between them."""
    rows = rows[np.argsort(table["chainage_from"].values[rows])]
    start, end = table["chainage_from"].values[rows], table["chainage_to"].values[rows]
    edges = np.unique(np.concatenate([start, end]))
    values = np.full(len(edges) - 1, np.nan)
    values[np.searchsorted(edges, start)] = table[column].values[rows]
    return values, edges
