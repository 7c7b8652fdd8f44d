"""Events by opening: those nearest to each stope, drive or panel, modelled beside recorded."""

from dataclasses import dataclass

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from catalogs.compare.exposure import Exposure, window
from catalogs.figures.views import axes_of
from catalogs.report.evidence import Evidence
from catalogs.report.text import number, percent
from catalogs.sources.sizes import log_potency

ROWS_LISTED = 20  # Openings that a long table keeps: those with most potency.
MAX_ROWS = 40  # A longer table keeps ROWS_LISTED of them, and the sum of the others.
PER_VOLUME = 1000.0  # m3 of mined rock that potency is given by.


@dataclass(frozen=True)
class Near:
    """Events of a catalogue that are nearest to one opening: number, potency (m3), share of all potency, potency by
    volume mined (m3 by PER_VOLUME), median distance (m), largest log10 potency. NaN where there is none."""

    number: int
    potency: float
    share: float
    per_volume: float
    distance: float
    largest: float


@dataclass(frozen=True)
class OpeningRow:
    """An opening, its step, the rock that it is the first to mine (m3), and the events nearest to it: modelled, and
    recorded if there are any."""

    name: str
    step: str
    mined: float
    sides: tuple[Near, ...]


def step_of_events(evidence: Evidence, events: xr.Dataset) -> NDArray:
    """Index of the step of each event, (event,); -1 where no step is.

    A modelled event has its step. A recorded one has the step within whose dates it lies, as in the comparison,
    whatever a column of steps says.
    """
    place = {str(step["step"]): place for place, step in enumerate(evidence.steps)}
    if events.attrs["kind"] == "synthetic":
        return np.array([place.get(str(name), -1) for name in events["step"].values], np.int64)
    dated = evidence.dated
    windows = np.array([window(step) for step in dated], "datetime64[ns]").reshape(-1, 2)
    if not len(windows):
        return np.full(events.sizes["event"], -1)
    numbers = np.array([place[str(step["step"])] for step in dated])
    of_dated = Exposure(*windows.T).step(events["time"].values)
    return np.where(of_dated >= 0, numbers[of_dated], -1)


def nearest_mined(evidence: Evidence, events: xr.Dataset) -> tuple[NDArray, NDArray]:
    """Index of the nearest opening that is mined in an event's step or before, (event,), and its distance, m.

    -1 where no step is.
    """
    own, axes = step_of_events(evidence, events), axes_of(evidence.grid)
    found, distance = np.full(len(own), -1), np.full(len(own), np.nan)
    here, edge = np.flatnonzero(own >= 0), float(evidence.grid.attrs["fine_cell"])
    places = events["location"].values[here][:, axes]
    found[here], distance[here] = evidence.mining.nearest_open(places, own[here], edge, axes)
    return found, distance


def opening_rows(evidence: Evidence, catalogues: list[xr.Dataset], counted: list[NDArray]) -> list[OpeningRow]:
    """Openings that have events of either catalogue nearest to them, in the order of the mine file.

    catalogues: the modelled one, and the recorded one if there is one; counted (event,): which of their events count.
    """
    sides, totals = [], []
    for events, chosen in zip(catalogues, counted, strict=True):
        opening, distance = nearest_mined(evidence, events)
        potency, kept = events["potency"].values, np.flatnonzero(chosen & (opening >= 0))
        totals.append(float(np.nansum(potency[kept])))
        kept = kept[np.argsort(opening[kept], kind="stable")]
        bounds = np.searchsorted(opening[kept], np.arange(1, evidence.mining.count))
        sides.append([np.split(values[kept], bounds) for values in (distance, potency)])
    rows = []
    for index, excavation in enumerate(evidence.excavations):
        own = [(distance[index], potency[index]) for distance, potency in sides]
        if any(len(potency) for _, potency in own):
            near = tuple(_near(*one, total, excavation.mined) for one, total in zip(own, totals, strict=True))
            rows.append(OpeningRow(excavation.name, excavation.step, excavation.mined, near))
    return rows


def _near(distance: NDArray, potency: NDArray, total: float, volume: float) -> Near:
    """Events (event,) nearest to an opening; total: potency of all events, m3; volume: that the opening mines, m3."""
    own = float(np.nansum(potency))
    return Near(
        len(potency),
        own,
        own / total if total > 0.0 else np.nan,
        PER_VOLUME * own / volume if volume > 0.0 else np.nan,
        float(np.median(distance)) if len(distance) else np.nan,
        float(np.nanmax(log_potency(potency), initial=-np.inf)) if len(potency) else np.nan,
    )


def with_most_potency(rows: list[OpeningRow]) -> list[OpeningRow]:
    """The rows; where they are many, those with most modelled potency and one row for all others."""
    if len(rows) <= MAX_ROWS:
        return rows
    rows = sorted(rows, key=lambda row: -row.sides[0].potency)
    others = rows[ROWS_LISTED:]
    mined = sum(row.mined for row in others)
    sums = []
    for sides in zip(*(row.sides for row in others), strict=True):
        potency = sum(side.potency for side in sides)
        largest = max((side.largest for side in sides if np.isfinite(side.largest)), default=np.nan)
        sums.append(
            Near(
                sum(side.number for side in sides),
                potency,
                float(np.nansum([side.share for side in sides])),
                PER_VOLUME * potency / mined if mined > 0.0 else np.nan,
                np.nan,
                largest,
            )
        )
    return [*rows[:ROWS_LISTED], OpeningRow(f"{len(others)} others", "", mined, tuple(sums))]


def where(evidence: Evidence) -> list[str]:
    """Sentence on how near modelled events are to excavations, and which excavation has the largest share of potency
    nearest to it; an empty list without modelled events or excavations."""
    events = evidence.resolved
    if events is None or not events.sizes["event"]:
        return []
    rows = opening_rows(evidence, [events], [np.ones(events.sizes["event"], bool)])
    if not rows:
        return []
    distance = nearest_mined(evidence, events)[1]
    distance = distance[np.isfinite(distance)]  # NaN: nothing is open yet
    if not len(distance):
        return []
    first = max(rows, key=lambda row: row.sides[0].potency)
    return [
        f"Half of the events lie within {number(np.median(distance), 2)} m of an excavation; "
        f"{percent(first.sides[0].share)} of the potency is nearest to {first.name}."
    ]
