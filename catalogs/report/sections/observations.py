"""Instruments: what the model gives where they are, step by step, beside what they measured.

The template is "observations.html.j2".
"""

from dataclasses import dataclass

import numpy as np
import xarray as xr
from matplotlib.figure import Figure
from numpy.typing import NDArray
from scipy.stats import chi2

from catalogs.figures import style
from catalogs.report.evidence import Evidence
from catalogs.report.gallery import Gallery
from catalogs.report.scanned_voids import shown_scans
from catalogs.report.text import number, percent, plural

MAX_PANELS = 12  # Instruments whose curves are drawn.
MAX_CURVES = 6  # Of an instrument: of its anchors or components.
COLUMNS = 3
STATED_AS_95 = 1.96  # A modelled error is half of a 95 % interval.
LEVEL = 0.95
MIN_WITHIN = 0.8  # Share of an instrument's readings within both errors under which the first page names it.


@dataclass(frozen=True)
class InstrumentLine:
    """An instrument: its quantities, largest cell (m) and whether rock has failed there after the last step in which
    there is rock, NaN and False without one, the number of readings that are compared, their root-mean-square misfit
    with its 95 % interval, in its unit, and the share of readings within the 95 % of both errors together; NaN without
    readings, and without a stated error."""

    name: str
    quantity: str
    unit: str
    cell: float
    failed: bool
    readings: int
    misfit: float
    interval: tuple[float, float]
    within: float


def section(evidence: Evidence, gallery: Gallery) -> dict | None:
    """Content of the section on instruments: lines, the figure of curves or None, the number of instruments that it
    leaves out, and what is shown of scanned voids or None. None without any of them."""
    table, scans = evidence.observations, shown_scans(evidence.scans, gallery)
    if table is None or not table.sizes["row"]:
        return None if scans is None else {"lines": [], "curves": None, "others": 0, "scans": scans}
    names = list(dict.fromkeys(str(name) for name in table["instrument"].values))
    measured = [name for name in names if np.isfinite(table["measured"].values[_of(table, name)]).any()]
    drawn = [*measured, *(name for name in names if name not in measured)][:MAX_PANELS]
    return {
        "lines": [instrument_line(table, name) for name in names],
        "curves": gallery.add("observations", _curves(evidence, drawn)),
        "others": len(names) - len(drawn),
        "scans": scans,
    }


def instrument_line(table: xr.Dataset, name: str) -> InstrumentLine:
    """The line of an instrument."""
    own = _of(table, name)
    known = own[np.isfinite(table["cell"].values[own])]  # nor has a step after a collapse a cell
    last = known[table["step"].values[known] == table["step"].values[known[-1]]] if len(known) else known
    cells = table["cell"].values[last]
    quantities = list(dict.fromkeys(str(one) for one in table["quantity"].values[own]))
    off = table["measured"].values[own] - table["modelled"].values[own]
    known = np.isfinite(off)
    both = np.hypot(table["modelled_error"].values[own] / STATED_AS_95, table["measured_error"].values[own])
    count = int(known.sum())
    misfit = float(np.sqrt(np.mean(off[known] ** 2))) if count else np.nan
    is_stated = count and np.isfinite(both[known]).all()
    within = float(np.mean(np.abs(off[known]) <= STATED_AS_95 * both[known])) if is_stated else np.nan
    return InstrumentLine(
        name, quantities[0] if len(quantities) == 1 else f"{len(quantities)} components",
        str(table["unit"].values[own[0]]), float(np.nanmax(cells)) if np.isfinite(cells).any() else np.nan,
        bool(table["failed"].values[last].any()), count, misfit, misfit_interval(misfit, count), within,
    )  # fmt: skip


def brief(evidence: Evidence) -> str:
    """Sentence on how many readings lie within the errors of model and reading, and which instrument is farthest out;
    empty without readings."""
    table = evidence.observations
    if table is None or not table.sizes["row"]:
        return ""
    names = list(dict.fromkeys(str(name) for name in table["instrument"].values))
    lines = [line for line in (instrument_line(table, name) for name in names) if line.readings]
    stated = [line for line in lines if np.isfinite(line.within)]
    if not stated:
        return f"The readings of {plural(len(lines), 'instrument')} have no stated error." if lines else ""
    count = sum(line.readings for line in stated)
    inside = sum(line.readings * line.within for line in stated)
    farthest = min(stated, key=lambda line: line.within)
    text = f"{percent(inside / count)} of {plural(count, 'reading')} of {plural(len(stated), 'instrument')} lie within"
    text += " the errors of model and reading"
    if farthest.within < MIN_WITHIN:
        text += f"; farthest off: {farthest.name}, {number(farthest.misfit, 2)} {farthest.unit} (r.m.s.)"
    return f"{text}."


def misfit_interval(misfit: float, count: int) -> tuple[float, float]:
    """95 % interval of a root-mean-square misfit of so many readings, if their misfits are normal and independent
    (chi-squared); readings of one instrument seldom are, so it is too narrow rather than too wide. NaN without any."""
    if not count:
        return np.nan, np.nan
    low, high = chi2.ppf([(1.0 - LEVEL) / 2.0, (1.0 + LEVEL) / 2.0], count)
    return misfit * float(np.sqrt(count / high)), misfit * float(np.sqrt(count / low))


def _of(table: xr.Dataset, name: str) -> NDArray:
    """Rows of an instrument."""
    return np.flatnonzero(table["instrument"].values == name)


def _curves(evidence: Evidence, names: list[str]) -> Figure:
    """A panel for each instrument: modelled values by step with their 95 % intervals, readings as points."""
    table, steps = evidence.observations, [str(step["step"]) for step in evidence.steps]
    rows = -(-len(names) // COLUMNS)
    figure = style.new_figure(height=0.6 + 2.2 * rows)
    panels = figure.subplots(rows, COLUMNS, squeeze=False).ravel()
    for panel, name in zip(panels, names, strict=False):
        own = _of(table, name)
        curves = _curves_of(table, own)
        for index, (label, chosen) in enumerate(_spread(curves)):
            place = np.array([steps.index(str(step)) for step in table["step"].values[chosen]])
            value, error = table["modelled"].values[chosen], table["modelled_error"].values[chosen]
            colour = f"C{index}"
            panel.plot(place, value, color=colour, linewidth=1.2, marker=".", markersize=3, label=label)
            panel.fill_between(place, value - error, value + error, color=colour, alpha=0.15, linewidth=0)
            reading = table["measured"].values[chosen]
            panel.plot(place, reading, color=colour, linestyle="none", marker="o", fillstyle="none", markersize=5)
        panel.set_title(name, loc="left")
        panel.set_ylabel(str(table["unit"].values[own[0]]))
        panel.set_xticks(*_ticks(steps), rotation=30, ha="right")
        if len(curves) > 1:
            panel.legend(fontsize="x-small", ncols=2)
    for panel in panels[len(names) :]:
        panel.set_axis_off()
    return figure


def _curves_of(table: xr.Dataset, own: NDArray) -> list[tuple[str, NDArray]]:
    """Label and rows of each curve of an instrument: of stress the principal compressions, along a line the major one;
    else each component, or each distance."""
    quantity, distance = table["quantity"].values[own].astype(str), table["distance"].values[own]
    shown = [one for one in dict.fromkeys(quantity.tolist()) if not one.startswith("stress ")]
    if np.isfinite(distance).any():
        of_line = quantity == shown[0]
        return [(f"{one:g} m", own[of_line & (distance == one)]) for one in np.unique(distance[of_line])]
    return [(one, own[quantity == one]) for one in shown]


def _spread(curves: list[tuple[str, NDArray]]) -> list[tuple[str, NDArray]]:
    """At most MAX_CURVES of the curves, from the first to the last at equal distances."""
    if len(curves) <= MAX_CURVES:
        return curves
    return [curves[place] for place in np.linspace(0, len(curves) - 1, MAX_CURVES).astype(int)]


def _ticks(steps: list[str]) -> tuple[list[int], list[str]]:
    """Places and names of some of the steps."""
    every = -(-len(steps) // 6)
    return list(range(0, len(steps), every)), steps[::every]
