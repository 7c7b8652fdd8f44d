"""Source parameters: radius, stress drop, energy, apparent stress and energy index; declustered number; largest
possible event.

The template is "parameters.html.j2".
"""

from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.figure import Figure
from numpy.typing import NDArray

from catalogs.figures import style
from catalogs.report.evidence import MODEL_LABEL, Evidence
from catalogs.report.gallery import Gallery
from catalogs.report.text import DASH, fixed, number, plural, whole
from catalogs.sources.completeness import completeness, rounding
from catalogs.sources.declustering import MIN_EVENTS, decluster
from catalogs.sources.largest_possible import largest_possible
from catalogs.sources.sizes import log_potency
from catalogs.sources.source_parameters import parameters
from common.event_table import RADIATED_ENERGY, SOURCE_RADIUS, STATIC_STRESS_DROP
from common.source_tensors import moment_magnitude

ROWS = {  # of the table: variable, its name, factor to the unit shown
    "source_radius": ("source radius (m)", 1.0),
    "static_stress_drop": ("static stress drop (MPa)", 1e-6),
    "drop_energy": ("energy (kJ): modelled, of the drop of strength; recorded, radiated", 1e-3),
    "apparent_stress": ("apparent stress (MPa)", 1e-6),
    "energy_index": ("energy index (1)", 1.0),
}
MAX_DECLUSTERED = 20_000  # Events: the time goes with the square of their number. Of more, the largest are taken.
ROUND_OFF = 1e-9  # log10 m3
SHARES = (16, 50, 84)  # percent of the events that are below the numbers of a row


def section(evidence: Evidence, gallery: Gallery) -> dict | None:
    """Rows of the table by quantity, sentences on energy, declustering and largest possible event, and a figure. None
    without events or with results of an earlier version."""
    found = by_catalogue(evidence)
    if not found:
        return None
    shown: dict[str, Any] = {
        "labels": list(found),
        "rows": [
            {
                "name": name,
                "values": [_spread(values[field].values[counted] * factor) for values, _, counted in found.values()],
            }
            for field, (name, factor) in ROWS.items()
        ],
        "fits": [sentence for label, (values, _, _) in found.items() if (sentence := _fit(label, values))],
        "declustered": declustered(evidence.record, evidence.record_label) if evidence.record is not None else [],
        "largest": [
            *(possible(label, events, cut_of(label, events)) for label, (_, events, _) in found.items()),
            *contradicted({label: events for label, (_, events, _) in found.items()}),
        ],
        "figure": None,
    }
    if any(np.isfinite(values["drop_energy"].values[counted]).any() for values, _, counted in found.values()):
        shown["figure"] = gallery.add("source_parameters", draw(found))
    return shown


def by_catalogue(evidence: Evidence) -> dict[str, tuple[xr.Dataset, xr.Dataset, NDArray]]:
    """By label of the catalogue the parameters, the events, and which of them count (event,) bool."""
    found = {}
    catalog, values, record = evidence.catalog, evidence.source_parameters, evidence.record
    if catalog is not None and values is not None and catalog.sizes["event"] == values.sizes["event"]:
        if (catalog["resolved"].values == 1).any():
            found[MODEL_LABEL] = values, catalog, catalog["resolved"].values == 1
    if record is not None and record.sizes["event"]:
        count, flat = record.sizes["event"], evidence.grid.attrs["plane"] != "none"
        energy = record[RADIATED_ENERGY.name].values if RADIATED_ENERGY.name in record else np.full(count, np.nan)
        own = parameters(record, energy, 2 if flat else 3, evidence.grid.attrs["thickness"] if flat else None)
        for field in (SOURCE_RADIUS, STATIC_STRESS_DROP):
            if field.name in record:
                own[field.name].values[:] = record[field.name].values
        found[evidence.record_label] = own, record, np.ones(count, bool)
    return found


def _spread(values: NDArray) -> str:
    """Median of values with the range of the middle 68 %; a dash where none is known."""
    values = values[np.isfinite(values)]
    if not len(values):
        return DASH
    low, middle, high = np.percentile(values, SHARES)
    return f"{number(middle, 3)} ({number(low, 2)} to {number(high, 2)})"


def _fit(label: str, values: xr.Dataset) -> str:
    """Sentence on the mean energy by moment, to which the energy index refers; empty where it is not known."""
    about = values.attrs
    if not np.isfinite(about["energy_slope"]):
        return ""
    sign = "−" if about["energy_offset"] < 0 else "+"
    return (
        f"{label}: log E = {fixed(about['energy_slope'], 2)} log M0 {sign} {fixed(abs(about['energy_offset']), 2)} "
        f"(E in J, M0 in N m), with a scatter of {fixed(about['energy_scatter'], 2)} about it, by "
        f"{whole(about['energy_count'])} events."
    )


def declustered(record: xr.Dataset, label: str) -> list[str]:
    """Sentence on the declustered number of a record: of the events from its cut on, if there is one."""
    if record.attrs["kind"] == "twin":
        return [f"{label}: a twin has the times of a model, which are evenly spread over each step."]
    cut, _ = cut_of(label, record)
    size = log_potency(record["potency"].values)
    if np.isfinite(size).sum() > MAX_DECLUSTERED:
        cut = np.fmax(cut, np.sort(size[np.isfinite(size)])[-MAX_DECLUSTERED])
    used = record.isel(event=np.flatnonzero(size >= cut - ROUND_OFF)) if np.isfinite(cut) else record
    found = decluster(used["time"].values, used["location"].values, used["mw"].values)
    events = plural(found.count, "event") + (f" from log P {fixed(cut, 2)} on" if np.isfinite(cut) else "")
    if found.count < MIN_EVENTS:
        return [f"{label}: {events}, too few to tell clusters from other events (at least {MIN_EVENTS})."]
    if not np.isfinite(found.limit):
        return [f"{label}: {events}; nearest neighbours form one group, so no event is taken for an aftershock."]
    return [
        f"{label}: of {events} {whole(found.declustered)} remain declustered; the others follow an earlier one more "
        f"closely in time, place and size than log10 η = {fixed(found.limit, 1)}."
    ]


def cut_of(label: str, events: xr.Dataset) -> tuple[float, float]:
    """log10 potency from which a catalogue is complete, and the width of its bins: of the model the floor of the cells,
    of a record as its sizes show: of rounded sizes the lower edge of a bin."""
    if label == MODEL_LABEL:
        floor = float(events.attrs.get("potency_floor", np.nan))
        return (np.log10(floor) if floor > 0 else np.nan), 0.0
    sizes = log_potency(events["potency"].values)
    sizes = sizes[np.isfinite(sizes)]
    if not len(sizes):
        return np.nan, 0.0
    width = rounding(sizes)
    return completeness(sizes, width), width


def possible(label: str, events: xr.Dataset, cut: tuple[float, float]) -> str:
    """Sentence on the largest possible event of the catalogue's period."""
    counted = events["resolved"].values == 1
    if not np.isfinite(cut[0]):
        return f"{label}: it is complete from no size on, so it has no law of sizes and no largest possible event."
    edge, width = cut
    found = largest_possible(log_potency(events["potency"].values[counted]), edge + 0.5 * width, width)
    if not np.isfinite(found.seen):
        return f"{label}: too few events above the cut to tell the largest possible one."
    shear = float(events.attrs["shear_modulus"])

    def told(size: float) -> str:
        magnitude = float(moment_magnitude(np.array([shear * 10.0**size]))[0])
        return f"log P {fixed(size, 2)} (Mw {fixed(magnitude, 2)})"

    start = f"{label}: the largest of {plural(found.count, 'event')} above the cut has {told(found.seen)}."
    if not np.isfinite(found.upper):
        return f"{start} The sizes do not bound the largest possible event: 95 % intervals of it have no upper end."
    best = f" Estimate of the largest possible one: {told(found.estimate)}." if np.isfinite(found.estimate) else ""
    return f"{start}{best} With 95 % confidence it is not above {told(found.upper)}."


def contradicted(catalogues: Mapping[str, xr.Dataset]) -> list[str]:
    """Sentence on a recorded event that is larger than the model's law of sizes allows for; none where none is."""
    model = catalogues.get(MODEL_LABEL)
    if model is None:
        return []
    cut = cut_of(MODEL_LABEL, model)
    sizes = log_potency(model["potency"].values[model["resolved"].values == 1])
    bound = largest_possible(sizes, *cut).upper if np.isfinite(cut[0]) else np.nan
    largest = {
        label: np.nanmax(log_potency(events["potency"].values), initial=-np.inf)
        for label, events in catalogues.items()
        if label != MODEL_LABEL
    }
    return [
        f"{label}: its largest event, log P {fixed(size, 2)}, is above what the modelled sizes allow for, so their law "
        "does not hold for it."
        for label, size in largest.items()
        if size > bound
    ]


def draw(found: dict[str, tuple[xr.Dataset, xr.Dataset, NDArray]]) -> Figure:
    """Energy and static stress drop by moment, of all catalogues that have them, with the fits of energy."""
    figure = style.new_figure(height=4.2)
    left, right = figure.subplots(1, 2)
    for (label, (values, events, counted)), colour in zip(
        found.items(), (style.MODELLED, style.RECORDED), strict=False
    ):
        moment = events["moment"].values[counted]
        many = len(moment) > 300
        for axes, field, factor in ((left, "drop_energy", 1.0), (right, "static_stress_drop", 1e-6)):
            column = values[field].values[counted] * factor
            known = (column > 0) & (moment > 0)
            if known.any():
                axes.loglog(moment[known], column[known], "o", color=colour, markersize=3, alpha=0.6, label=label,
                            markeredgewidth=0, rasterized=many)  # fmt: skip
                if field == "drop_energy" and np.isfinite(values.attrs["energy_slope"]):
                    ends = np.array([moment[known].min(), moment[known].max()])
                    fit = 10.0 ** (values.attrs["energy_slope"] * np.log10(ends) + values.attrs["energy_offset"])
                    axes.plot(ends, fit, color=colour, linewidth=1.2)
    left.set_ylabel("energy (J)")
    right.set_ylabel("static stress drop (MPa)")
    for axes in (left, right):
        axes.set_xlabel("moment (N m)")
        if axes.has_data():
            axes.legend()
    return figure
