"""Comparison of modelled with recorded events: location, size and orientation, as numbers with intervals.

Layout of comparison.nc: catalogs.compare.layout.
"""

import json
from collections.abc import Sequence

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from catalogs.compare.blocks import cluster_labels
from catalogs.compare.exposure import Exposure, common_period
from catalogs.compare.face import FACE_AXES
from catalogs.compare.face_measures import MEASURES, WEIGHTS, face_measures
from catalogs.compare.layout import CATALOGUES, described
from catalogs.compare.locations import location_errors
from catalogs.compare.place_and_axis_measures import axes_measures, location_measures
from catalogs.compare.size_measures import SIZE_BIN_WIDTH, size_measures
from catalogs.compare.spread import all_runs
from catalogs.compare.sum_measures import sum_measures
from catalogs.settings import ComparisonSlice
from catalogs.sources import sizes
from catalogs.sources.completeness import MIN_EVENTS_ABOVE_CUT, completeness, fullest_bin, next_edge, rounding
from catalogs.sources.mechanisms import AXIS_NAMES, KAGAN_BIN, KAGAN_PAIRS
from common.errors import InputError
from common.event_table import check_events


def compare(
    catalog: xr.Dataset, record: xr.Dataset, settings: ComparisonSlice, members: Sequence[xr.Dataset] = ()
) -> xr.Dataset:
    """The three comparisons of a synthetic catalogue with a recorded one; layout: catalogs.compare.layout.

    catalog, record: form of common.event_table. settings: or their values. members: catalogues of the ensemble's
    other runs (`catalogs.compare.spread`), as many as settings.members; with the mine's own they are the model's draws.
    Raises InputError for an unknown setting, a catalogue of the wrong form or for another mine, a member too few or too
    many. A catalogue with too few events, or none, gives NaN and a sentence, not an error.
    """
    settings = ComparisonSlice.of(settings, "comparison")
    catalog, record = check_events(catalog, "catalog"), check_events(record, "record")
    members = [check_events(member, f"member {number}") for number, member in enumerate(members, 1)]
    for name, events in (("record", record), *((f"member {number}", one) for number, one in enumerate(members, 1))):
        if catalog.attrs["mine"] != events.attrs["mine"]:
            raise InputError(
                f"comparison: catalog is of mine {catalog.attrs['mine']}, {name} of {events.attrs['mine']}"
            )
    if len(members) != settings.members:
        raise InputError(f"comparison: {len(members)} members are given, and the ensemble has {settings.members}")
    both = (catalog, record)
    x = [sizes.log_potency(events["potency"].values) for events in both]
    resolved = [events["resolved"].values == 1 for events in both]
    rounded = rounding(x[1])  # what is modelled is not
    result, attributes = _cut(catalog, x[1][resolved[1]], rounded)
    cut = float(result["cut"][1])
    exposure = Exposure.of(settings.steps, common_period(record))
    steps = [exposure.step(events["time"].values) for events in both]
    resolved = [good & (step >= 0) for good, step in zip(resolved, steps, strict=True)]
    used = [good & (value >= cut) for good, value in zip(resolved, x, strict=True)]
    clusters = record_clusters(record, resolved[1], steps[1])

    summed, sums_text = sum_measures(both, used, members, clusters, cut, exposure)
    result |= summed | {
        "events_total": ("catalogue", [events.sizes["event"] for events in both]),
        "events_resolved": ("catalogue", [int(good.sum()) for good in resolved]),
        "model_used": ("event_model", used[0].astype(np.int8)),
        "record_used": ("event_record", used[1].astype(np.int8)),
    }
    sized, laws = size_measures(
        [value[good] for value, good in zip(x, resolved, strict=True)],
        [0.0, rounded],
        cut,
        [False, attributes["cut_is"] == "record completeness" and attributes["cut_stable"] == 1],
        settings,
    )
    result |= sized
    # Places and axes are those of all runs of the model: what runs differ by is its chance.
    model, run = all_runs(catalog, members)
    runs = 1 + len(members)
    model_steps = exposure.step(model["time"].values)
    model_used = (model["resolved"].values == 1) & (model_steps >= 0)
    model_used &= sizes.log_potency(model["potency"].values) >= cut
    every, counted, blocks = (model, record), (model_used, used[1]), (run, clusters)
    located, location_attributes = location_measures(every, counted, blocks, runs, (model_steps, steps[1]), settings)
    result |= located
    oriented, axes_attributes = axes_measures(every, counted, blocks, runs, settings)
    oriented["model_axes_used"] = ("event_model", oriented["model_axes_used"][1][: catalog.sizes["event"]])
    result |= oriented
    faced = face_measures(every, counted, blocks, (model_steps, steps[1]), settings)
    result |= faced
    result["blocks"] = ("catalogue", np.array([runs, len(np.unique(clusters[used[1]]))], np.int64))
    coordinates = {
        "catalogue": list(CATALOGUES),
        "interval": ["lower", "upper"],
        "axis_name": list(AXIS_NAMES),
        "pair": ["model_to_record", "record_to_model", "record_to_record"],
        "share": ["iso", "clvd", "dc"],
        "kagan_pair": list(KAGAN_PAIRS),
        **({"face_axis": list(FACE_AXES), "weight": list(WEIGHTS), "measure": list(MEASURES)} if faced else {}),
    }
    dataset = xr.Dataset(result, coords=coordinates)
    dataset.attrs = {
        "mine": catalog.attrs["mine"],
        "record_kind": record.attrs["kind"],
        "period_model": _period(catalog),
        "period_record": _period(record),
        "period_text": _period_text(record, exposure),
        "settings": json.dumps(settings.model_dump(mode="json"), sort_keys=True),
        "size_bin_width": SIZE_BIN_WIDTH,
        "kagan_bin_width": KAGAN_BIN,
        **attributes,
        **sums_text,
        **laws,
        **location_attributes,
        **axes_attributes,
    }
    return described(dataset)


def _period(events: xr.Dataset) -> str:
    """First and last time of a catalogue, as text."""
    time = events["time"].values[~np.isnat(events["time"].values)]
    return f"{str(time.min())[:19]} to {str(time.max())[:19]}" if time.size else "no dated events"


def _period_text(record: xr.Dataset, exposure: Exposure) -> str:
    """The time that is compared, as text."""
    period = json.loads(record.attrs.get("period", "{}"))
    if not period or not np.isfinite(exposure.days):
        return "all, since no step has dates; there are no rates"
    modelled, common = period["modelled"], period["common"]
    days = f"{exposure.days:.3g} days"
    if common == modelled:
        return f"{modelled[0][:10]} to {modelled[1][:10]}, {days}, both catalogues"
    return (
        f"only {common[0][:10]} to {common[1][:10]}, {days}: the record ({period['recorded'][0][:10]} to "
        f"{period['recorded'][1][:10]}, as filtered) does not cover all modelled months ({modelled[0][:10]} to "
        f"{modelled[1][:10]}), and both catalogues are restricted to the time that they share"
    )


def record_clusters(record: xr.Dataset, known: NDArray, step: NDArray) -> NDArray:
    """Cluster (event,) of each resolved event of the steps, known (event,) bool, -1 for the others; step (event,).

    Events below the cut are among them, since small events show which of the large ones belong together.
    """
    labels = np.full(record.sizes["event"], -1)
    error = float(np.median(location_errors(record)[known])) if known.any() else 0.0
    labels[known] = cluster_labels(record["time"].values[known], record["location"].values[known], step[known], error)
    return labels


def _cut(catalog: xr.Dataset, recorded: NDArray, rounded: float) -> tuple[dict, dict]:
    """The cut of both catalogues, log10 P, and what sets it; the edge of a bin if sizes are rounded.

    It is the larger of the model's floor and the size from which the record is complete. If the record is too small to
    estimate that size, its smallest event replaces it.
    """
    recorded = recorded[np.isfinite(recorded)]
    floor = float(catalog.attrs.get("potency_floor", np.nan))
    floor = float(np.log10(floor)) if floor > 0 else np.nan
    stable = completeness(recorded, rounded)
    complete = fullest_bin(recorded, rounded) if np.isnan(stable) else stable
    if np.isfinite(complete):
        other, which = complete, "record completeness"
        how = (
            "b is stable above it"
            if np.isfinite(stable)
            else "no cut has a stable b: this is the bin with the most events"
        )
        called, record = f"the record's completeness ({how})", f"the record is complete from {complete:.2f}: {how}"
    elif recorded.size:
        other, which = float(recorded.min()) - 0.5 * rounded, "smallest recorded"
        few = f"{recorded.size} event{'s' * (recorded.size > 1)} of {MIN_EVENTS_ABOVE_CUT} needed"
        record = f"the record has {few} to estimate from which size on it is complete"
        called = f"the smallest recorded event ({record})"
    else:
        other, record = np.nan, "the record has no event to estimate from which size on it is complete"
    model = f"the model's floor is {floor:.2f}" if np.isfinite(floor) else "the model has no failed rock to set a floor"
    if np.isnan(floor) and np.isnan(other):
        cut, which = np.nan, "nothing"
        text = "no cut, as the model has no failed rock to set a floor, and the record no event"
    elif np.isnan(other) or floor >= other:
        cut, which = next_edge(recorded, floor, rounded), "model floor"
        text = f"log P >= {cut:.2f}, the model's floor ({record})"
    else:
        cut, text = other, f"log P >= {other:.2f}, {called}; {model}"
    return (
        {"cut": ((), cut), "model_floor": ((), floor), "record_completeness": ((), complete)},
        {"cut_is": which, "cut_text": text, "cut_stable": int(np.isfinite(stable))},
    )
