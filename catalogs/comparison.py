"""Modelled events beside recorded ones: where, how large, how oriented, each as a number with an interval.

Layout of comparison.nc
-----------------------
Dimensions: catalogue (model, record), interval (lower, upper: 95 %), xyz, axis (x, y, z of a tensor's second index),
axis_name (P, B, T), pair (see nearest), event_model and event_record (events of catalog.nc and record.nc, in their
order), size_bin, trial_cut, distance, angle, kagan_pair. All but xyz, axis, size_bin and angle carry coordinates.
NaN where a number does not exist (too few events, no tensors, no stable completeness).

Which events
  model_used (event_model), record_used (event_record)   int8: resolved and at or above the cut; model_axes_used,
                                       record_axes_used: and with a tensor or axes. 0 = not in the statistics
  events_total, events_resolved, events_above_cut, events_with_axes (catalogue)   counts
  cut                                  log10 P (m3) used for both catalogues; attribute `cut_is`: "model floor" |
                                       "record completeness"; `cut_text`: the sentence
  model_floor, record_completeness     log10 P, the two that `cut` is the larger of

Sum of potency (resolved events at or above the cut; _all: every event)
  summed_potency, summed_potency_all (catalogue) m3;  potency_ratio, potency_ratio_all: model / record;
  potency_ratio_interval (interval): blocks resampled

Location
  centroid (catalogue, xyz) m;  centroid_offset (xyz) model - record, centroid_offset_interval (xyz, interval);
  centroid_distance m, centroid_distance_interval
  energy_distance m, energy_distance_interval (interval), energy_distance_null (interval: what one process with the
  same blocks gives by chance: 0.025 and 0.975 quantile), energy_p_value
  nearest_distance (pair) m: median distance from each modelled event to the nearest recorded one, each recorded to the
  nearest modelled, and each recorded to the nearest recorded; nearest_distance_interval (pair, interval)
  distance (distance) m;  cross_k (distance) m3, cross_k_interval (distance, interval): model-record pairs closer than
  distance, as a volume (Ripley); record_k, model_k (distance): the same within each, pairs of one block left out;
  cross_ratio (distance) = cross_k / sqrt(record_k model_k): 1 = as near to each other as to themselves, 0 = apart;
  cross_ratio_interval (distance, interval)
  blocks (catalogue) number of blocks resampled;  attributes location_blocks, location_error, location_text

Size (log10 of potency in m3)
  b, b_error (catalogue), b_interval (catalogue, interval): maximum likelihood, no upper bound; b_magnitude = 1.5 b
  b_truncated, b_truncated_error, b_truncated_interval, largest_log_potency (catalogue): bounded by the largest event
  a (catalogue): log10 N(>= P) = a - b log10 P
  b_difference, b_difference_error, b_difference_interval (interval), b_difference_p_value: model - record
  completeness_curvature, completeness_stability (catalogue): NaN in the second = no stable completeness
  cut_log_potency (trial_cut);  b_by_cut, b_by_cut_error, events_by_cut (catalogue, trial_cut)
  size_bin_lower (size_bin), attribute size_bin_width;  incremental, cumulative (catalogue, size_bin): all resolved
  events, not only those above the cut

Axes (attribute axes_text says why they are absent or which events they are of; attribute axes_present 0/1)
  mean_axis (catalogue, axis_name, xyz), mean_trend, mean_plunge (catalogue, axis_name) degrees,
  mean_cone (catalogue, axis_name) degrees: half angle of the 95 % bootstrap cone,
  mean_strength (catalogue, axis_name): largest eigenvalue of the orientation matrix, 1/3 uniform, 1 parallel
  mean_angle (axis_name) degrees between the catalogues' mean axes, mean_angle_interval (axis_name, interval)
  summed_tensor (catalogue, xyz, axis) m3, summed_axis (catalogue, axis_name, xyz), summed_trend, summed_plunge,
  summed_angle (axis_name), summed_kagan: Kagan angle between the two summed tensors. Summed over the record's unit
  tensors where the attribute summed_weight is "unit" (orientations only), over potency tensors where it is "potency"
  kagan_lower (angle) degrees, attribute kagan_bin_width;  kagan_share (kagan_pair, angle): share of pairs per bin for
  model_record, nearest (each modelled event and the nearest recorded), record_record and uniform (random frames);
  kagan_median (kagan_pair), kagan_median_interval (kagan_pair, interval)
  source_share (catalogue, share = iso, clvd, dc): mean of the absolute shares

Attributes: mine, record_kind ("recorded" | "twin"), period_model, period_record, settings (JSON, defaults filled in),
size_text, config_hash, source_hash, versions. The *_text attributes are sentences for the reader of the report.
"""

import json
from collections.abc import Mapping

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from catalogs import sizes
from catalogs.locations import block_labels
from catalogs.measures import CATALOGUES, TAILS, axes_measures, location_measures, size_measures
from catalogs.mechanisms import AXIS_NAMES, KAGAN_BIN, KAGAN_PAIRS
from catalogs.schema import check_catalog
from pipeline.errors import InputError

DEFAULTS = {
    "seed": 1,
    "resamplings": 999,
    "blocks": "day",  # what is resampled: day | step | cluster | event (catalogs.locations.block_labels)
    "block_days": 1.0,
    "cluster_radius": 20.0,  # m, with blocks: cluster
    "maximum_events": 3000,  # of each catalogue in the location comparison, drawn at random beyond it
    "size_bin": 0.2,  # of log10 P, in plots
    "cut_step": 0.1,  # of log10 P, in searching completeness and in b against the cut
}


def compare(catalog: xr.Dataset, record: xr.Dataset, settings: Mapping) -> xr.Dataset:
    """The three comparisons of a synthetic catalogue with a recorded one; layout as at the head of this module.

    catalog, record: form of catalogs.schema. settings: any of DEFAULTS. Raises InputError for an unknown setting, a
    catalogue of the wrong form or for another mine. A catalogue with too few events gives NaN, not an error.
    """
    catalog, record = check_catalog(catalog, "catalog"), check_catalog(record, "record")
    unknown = set(settings) - set(DEFAULTS)
    if unknown:
        raise InputError(f"comparison.{sorted(unknown)[0]}: unknown setting; known are {', '.join(DEFAULTS)}")
    if catalog.attrs["mine"] != record.attrs["mine"]:
        raise InputError(f"comparison: catalog is of mine {catalog.attrs['mine']}, record of {record.attrs['mine']}")
    settings = DEFAULTS | {key: value for key, value in settings.items() if value is not None}
    both = (catalog, record)
    x = [sizes.log_potency(events["potency"].values) for events in both]
    resolved = [events["resolved"].values == 1 for events in both]
    result, attributes = _cut(catalog, x[1][resolved[1]], settings)
    cut = float(result["cut"][1])
    used = [good & (value >= cut) for good, value in zip(resolved, x, strict=True)]
    blocks = [_blocks(events, settings) for events in both]

    result |= _sums(both, used, resolved, blocks, settings)
    sized, text = size_measures([value[good] for value, good in zip(x, resolved, strict=True)], cut, settings)
    result |= sized
    located, location_attributes = location_measures(both, used, blocks, settings)
    result |= located
    oriented, axes_attributes = axes_measures(both, used, blocks, settings)
    result |= oriented
    coordinates = {
        "catalogue": list(CATALOGUES),
        "interval": ["lower", "upper"],
        "axis_name": list(AXIS_NAMES),
        "pair": ["model_to_record", "record_to_model", "record_to_record"],
        "share": ["iso", "clvd", "dc"],
        "kagan_pair": list(KAGAN_PAIRS),
    }
    dataset = xr.Dataset(result, coords=coordinates)
    dataset.attrs = {
        "mine": catalog.attrs["mine"],
        "record_kind": record.attrs["kind"],
        "period_model": _period(catalog),
        "period_record": _period(record),
        "settings": json.dumps(settings, sort_keys=True),
        "size_text": text,
        "size_bin_width": float(settings["size_bin"]),
        "kagan_bin_width": KAGAN_BIN,
        **attributes,
        **location_attributes,
        **axes_attributes,
    }
    return dataset


def _period(events: xr.Dataset) -> str:
    """First and last time of a catalogue, as text."""
    time = events["time"].values[~np.isnat(events["time"].values)]
    return f"{str(time.min())[:19]} to {str(time.max())[:19]}" if time.size else "no dated events"


def _blocks(events: xr.Dataset, settings: Mapping) -> NDArray:
    return block_labels(
        settings["blocks"],
        events["time"].values,
        events["location"].values,
        events["step"].values,
        settings["block_days"],
        settings["cluster_radius"],
    )


def _cut(catalog: xr.Dataset, recorded: NDArray, settings: Mapping) -> tuple[dict, dict]:
    """The cut both catalogues take, log10 P, and which of the two catalogues sets it."""
    floor = float(catalog.attrs.get("potency_floor", np.nan))
    floor = float(np.log10(floor)) if floor > 0 else np.nan
    stable = sizes.completeness_by_stability(recorded, settings["cut_step"])
    complete = sizes.completeness_by_curvature(recorded, settings["cut_step"]) if np.isnan(stable) else stable
    how = "b is stable above it" if np.isfinite(stable) else "no stable completeness: the fullest bin instead"
    if np.isnan(floor) and np.isnan(complete):
        raise InputError("comparison: neither the model has a potency floor nor the record a size; nothing to compare")
    if np.isnan(complete) or floor >= complete:
        cut, which = floor, "model floor"
        record = f"complete from {complete:.2f}: {how}" if np.isfinite(complete) else "without enough events to tell"
        text = f"log P >= {cut:.2f}, the model's floor (the record is {record})"
    else:
        cut, which = complete, "record completeness"
        model = (
            f"the model's floor is {floor:.2f}" if np.isfinite(floor) else "the model has no failed rock to set a floor"
        )
        text = f"log P >= {cut:.2f}, the record's completeness ({how}); {model}"
    return (
        {"cut": ((), cut), "model_floor": ((), floor), "record_completeness": ((), complete)},
        {"cut_is": which, "cut_text": text},
    )


def _sums(both, used, resolved, blocks, settings) -> dict:
    """Counts and summed potency, and their ratio with an interval from resampled blocks."""
    generator = np.random.default_rng(settings["seed"])
    potency = [events["potency"].values for events in both]
    summed = [float(value[kept].sum()) for value, kept in zip(potency, used, strict=True)]
    whole = [float(np.nansum(value)) for value in potency]
    drawn = []
    for value, kept, labels in zip(potency, used, blocks, strict=True):
        per_block = np.bincount(labels[kept], weights=value[kept], minlength=int(labels.max(initial=-1)) + 1)
        count = per_block.size
        if count == 0:
            drawn.append(np.zeros(settings["resamplings"]))
            continue
        weights = generator.multinomial(count, np.full(count, 1 / count), size=settings["resamplings"])
        drawn.append(np.einsum("rb,b->r", weights.astype(float), per_block))
    counts = {
        "events_total": [events.sizes["event"] for events in both],
        "events_resolved": [int(good.sum()) for good in resolved],
        "events_above_cut": [int(kept.sum()) for kept in used],
        "blocks": [len(np.unique(labels[kept])) for labels, kept in zip(blocks, used, strict=True)],
    }
    interval = np.full(2, np.nan)
    if summed[0] > 0 and summed[1] > 0:
        possible = drawn[1] > 0
        interval = np.quantile(drawn[0][possible] / drawn[1][possible], TAILS)
    return {
        **{name: ("catalogue", np.array(value, np.int64)) for name, value in counts.items()},
        "model_used": ("event_model", used[0].astype(np.int8)),
        "record_used": ("event_record", used[1].astype(np.int8)),
        "summed_potency": ("catalogue", summed, {"units": "m3"}),
        "summed_potency_all": ("catalogue", whole, {"units": "m3"}),
        "potency_ratio": ((), summed[0] / summed[1] if summed[1] > 0 else np.nan),
        "potency_ratio_all": ((), whole[0] / whole[1] if whole[1] > 0 else np.nan),
        "potency_ratio_interval": ("interval", interval),
    }
