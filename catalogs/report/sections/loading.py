"""Loading measures: energy that mining releases, plastic work, loading stiffness and excess shear stress.

The template is "loading.html.j2".
"""

from dataclasses import dataclass

import numpy as np
import xarray as xr
from matplotlib.figure import Figure
from numpy.typing import NDArray

from catalogs.figures import style
from catalogs.report.evidence import Evidence
from catalogs.report.gallery import Gallery
from catalogs.report.text import number
from common.loading_table import FIELDS, OPENING, PLANE, STEP

MAX_LISTED = 40  # Openings of the table: those that release most.
MAX_DRAWN = 8  # Planes whose curves are drawn.
NUMBERS = tuple(field.name for field in FIELDS[3:] if field.dtype.kind == "f")
COLOURS = {"energy released": "#999999", "plastic work": "#d55e00"}


@dataclass(frozen=True)
class LoadingLine:
    """A row of the table of loading measures: its step, name, numbers by column, and the opening nearest to the largest
    excess shear stress."""

    step: str
    name: str
    values: dict[str, float]
    nearest: str


def section(evidence: Evidence, gallery: Gallery) -> dict | None:
    """Content of the section on loading measures: most (a sentence), lines of steps, of openings in the step that mines
    them (those that release most per area first, and others: how many are not listed), and of planes after the last
    step; figure. None without a table."""
    table = evidence.loading
    if table is None or not table.sizes["row"]:
        return None
    steps = loading_lines(table, STEP)
    openings = [line for line in loading_lines(table, OPENING) if line.values["mined_volume"] > 0.0]
    openings.sort(key=lambda line: -np.nan_to_num(line.values["release_rate"], nan=-np.inf))
    planes = [line for line in loading_lines(table, PLANE) if line.step == steps[-1].step]
    return {
        "most": most_loaded(openings),
        "steps": steps,
        "openings": openings[:MAX_LISTED],
        "others": len(openings) - MAX_LISTED,
        "planes": planes,
        "narrow": [row.name for row in evidence.excavations if row.narrow and not row.planned],
        "figure": gallery.add("loading", _figure(table, steps)),
    }


def loading_lines(table: xr.Dataset, kind: str) -> list[LoadingLine]:
    """Rows of a kind, in order."""
    columns = {name: table[name].values for name in NUMBERS}
    rows = np.flatnonzero(table["kind"].values == kind)
    texts = {name: table[name].values for name in ("step", "name", "nearest_opening")}
    return [
        LoadingLine(
            str(texts["step"][row]), str(texts["name"][row]),
            {name: float(column[row]) for name, column in columns.items()}, str(texts["nearest_opening"][row]),
        )
        for row in rows
    ]  # fmt: skip


def most_loaded(openings: list[LoadingLine]) -> str:
    """Sentences on the openings that release most energy per area and whose rock is softest; empty without either."""
    found = []
    known = [line for line in openings if np.isfinite(line.values["release_rate"])]
    if known:
        most = max(known, key=lambda line: line.values["release_rate"])
        rate = number(most.values["release_rate"], 2)
        found.append(f"{most.name} ({most.step}) releases most energy for its area, {rate} MJ/m².")
    known = [line for line in openings if np.isfinite(line.values["loading_stiffness"])]
    if known:
        soft = min(known, key=lambda line: line.values["loading_stiffness"])
        stiffness = number(soft.values["loading_stiffness"], 2)
        found.append(f"The rock around {soft.name} ({soft.step}) is softest, {stiffness} MPa/m.")
    return " ".join(found)


def _figure(table: xr.Dataset, steps: list[LoadingLine]) -> Figure:
    """Bars of energy released and plastic work by step; release rate of each opening in the step that mines it; largest
    excess shear stress of planes by step. What was not asked for has no panel."""
    names = [line.step for line in steps]
    drawers = {
        _draw_energy: ("energy_released", "plastic_work"),
        _draw_rates: ("release_rate",),
        _draw_shear: ("ess_largest", "ess_at_point"),
    }
    shown = [draw for draw, columns in drawers.items() if any(np.isfinite(table[name]).any() for name in columns)]
    figure = style.new_figure(height=0.7 + 1.9 * max(len(shown), 1))
    panels = figure.subplots(max(len(shown), 1), 1, sharex=True, squeeze=False)[:, 0]
    for draw, panel in zip(shown, panels, strict=False):
        draw(panel, table, names)
        panel.set_xlim(-0.6, len(names) - 0.4)
    every = -(-len(names) // 12)
    panels[-1].set_xticks(range(0, len(names), every), names[::every], rotation=30, ha="right")
    panels[-1].set_xlabel("step")
    return figure


def _of_kind(table: xr.Dataset, kind: str, names: list[str]) -> tuple[NDArray, NDArray]:
    """Rows of a kind, and the place of their step among the names."""
    rows = np.flatnonzero(table["kind"].values == kind)
    place = {name: index for index, name in enumerate(names)}
    return rows, np.array([place[str(step)] for step in table["step"].values[rows]], int)


def _draw_energy(panel, table: xr.Dataset, names: list[str]) -> None:
    rows, place = _of_kind(table, STEP, names)
    for label, column, width in (
        ("energy released", "energy_released", 0.8),
        ("plastic work", "plastic_work", 0.4),
    ):
        panel.bar(place, np.nan_to_num(table[column].values[rows]), width, color=COLOURS[label], label=label)
    panel.set_ylabel("energy (MJ)")
    panel.legend(fontsize="x-small")


def _draw_rates(panel, table: xr.Dataset, names: list[str]) -> None:
    rows, place = _of_kind(table, OPENING, names)
    panel.plot(place, table["release_rate"].values[rows], "o", color=style.OUTLINE, markersize=4)
    panel.set_ylim(bottom=0.0)
    panel.set_ylabel("release rate\n(MJ/m²)")


def _draw_shear(panel, table: xr.Dataset, names: list[str]) -> None:
    rows, place = _of_kind(table, PLANE, names)
    own = table["name"].values[rows].astype(str)
    largest = {name: float(np.nanmax(np.append(table["ess_largest"].values[rows[own == name]], -np.inf)))
               for name in dict.fromkeys(own)}  # fmt: skip
    for number_of, name in enumerate(sorted(largest, key=lambda name: -largest[name])[:MAX_DRAWN]):
        chosen = own == name
        panel.plot(
            place[chosen], table["ess_largest"].values[rows[chosen]], color=f"C{number_of}", marker=".", label=name
        )
    panel.axhline(0.0, color=style.OUTLINE, linewidth=0.6)
    panel.set_ylabel("largest excess\nshear stress (MPa)")
    panel.legend(fontsize="x-small", ncols=2)
