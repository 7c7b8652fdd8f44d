"""The comparisons of places and axes as variables of comparison.nc (their layout: catalogs.compare.layout).

`both` is (model, record) in the form of common.event_table, the model with the events of all its runs, `used` which
of their events count, `blocks` (run of each modelled event, None of a model that ran once; cluster of each recorded
one), `runs` how many the model has, those without an event included. Every function returns the variables, and the
sentences that go with them.
"""

import json
from dataclasses import replace

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from catalogs.compare.blocks import MIN_BLOCKS, cluster_labels
from catalogs.compare.locations import LocationComparison, compare_locations, location_errors
from catalogs.settings import ComparisonSettings
from catalogs.sources.jackknife import INTERVAL_95
from catalogs.sources.mean_mechanism import mechanism_turn
from catalogs.sources.mechanisms import (
    AXIS_NAMES,
    GIRDLE,
    KAGAN_BIN,
    KAGAN_LIMIT,
    KAGAN_PAIRS,
    UNIFORM,
    AxesSample,
    angle_between_axes,
    compare_axes,
    direction,
    kagan_angle,
    trend_plunge,
)
from common.fields import TEXT
from common.source_tensors import MIN_PRINCIPAL_GAP, clear_axes, principal_axes, scalar_potency, source_shares

# Events of each catalogue whose places are compared. Of more events so many are drawn, since memory grows as the
# square.
MAX_EVENTS_COMPARED = 3000
MAX_DRAWS_PER_EVENT = 4  # Largest number of smeared copies of a modelled event.
DISTANCE_COUNT = 12  # Number of distances at which the catalogues are compared.
MIN_EVENTS_WITH_AXES = 2  # Events with axes that each catalogue needs.
MIN_SHARE_LEFT_OUT_TOLD = 5e-4  # A smaller share of events without a clear axis is not mentioned.
MAX_AXES_RESAMPLINGS = 499


def location_measures(both, used, blocks, runs: int, steps, settings: ComparisonSettings) -> tuple[dict, dict]:
    """Centroids, energy distance, nearest distances and cross-K, with the record's location errors in the model."""
    generator = np.random.default_rng([settings.seed, 1])
    errors = location_errors(both[1])[used[1]]
    chosen = [_thin(np.flatnonzero(kept), MAX_EVENTS_COMPARED, generator) for kept in used]
    points = [events["location"].values[index] for events, index in zip(both, chosen, strict=True)]
    draws = int(np.clip(MAX_EVENTS_COMPARED // max(len(points[0]), 1), 1, MAX_DRAWS_PER_EVENT))
    found = None
    if min(map(len, points)):
        found = compare_locations(
            points[0],
            points[1],
            None if blocks[0] is None else blocks[0][chosen[0]],
            blocks[1][chosen[1]],
            model_steps=steps[0][chosen[0]],
            record_steps=steps[1][chosen[1]],
            seed=settings.seed,
            location_error=errors,
            draws=draws,
            resamplings=settings.resamplings,
        )
    shapes = {
        "centroid": ("centroids", ("catalogue", "xyz"), (2, 3)),
        "centroid_offset": ("offset", ("xyz",), (3,)),
        "centroid_offset_interval": ("offset_interval", ("xyz", "interval"), (3, 2)),
        "centroid_distance": ("offset_distance", (), ()),
        "centroid_distance_interval": ("offset_distance_interval", ("interval",), (2,)),
        "energy_distance": ("energy_distance", (), ()),
        "energy_distance_interval": ("energy_interval", ("interval",), (2,)),
        "energy_distance_null": ("energy_null", ("interval",), (2,)),
        "energy_p_value": ("energy_p_value", (), ()),
        "shift_noticed": ("shift_noticed", (), ()),
        "nearest_distance": ("nearest", ("pair",), (3,)),
        "nearest_distance_interval": ("nearest_interval", ("pair", "interval"), (3, 2)),
        "distance": ("distance", ("distance",), (DISTANCE_COUNT,)),
        "cross_k": ("cross_k", ("distance",), (DISTANCE_COUNT,)),
        "cross_k_interval": ("cross_k_interval", ("distance", "interval"), (DISTANCE_COUNT, 2)),
        "model_k": ("model_k", ("distance",), (DISTANCE_COUNT,)),
        "record_k": ("record_k", ("distance",), (DISTANCE_COUNT,)),
        "cross_ratio": ("cross_ratio", ("distance",), (DISTANCE_COUNT,)),
        "cross_ratio_interval": ("cross_ratio_interval", ("distance", "interval"), (DISTANCE_COUNT, 2)),
    }
    variables = {
        name: (dims, np.full(shape, np.nan) if found is None else np.broadcast_to(getattr(found, key), shape).copy())
        for name, (key, dims, shape) in shapes.items()
    }
    if found is None:
        count = [int(np.sum(used[0])), len(np.unique(blocks[1][used[1]]))]
        of_runs = " of two runs" if runs > 1 else ""
        text = (
            f"locations cannot be compared: the comparison needs two modelled events{of_runs} above the cut and two "
            f"clusters of recorded events in one step, and {MIN_BLOCKS} clusters in all. The model has "
            f"{plural(count[0], 'event')}, and the record has {plural(count[1], 'cluster')}"
        )
    else:
        text = _location_text(found, runs, errors)
    return variables, {"location_error": float(np.median(errors)) if len(errors) else np.nan, "location_text": text}


def _location_text(found: LocationComparison, runs: int, errors: NDArray) -> str:
    """The numbers in sentences, what they are computed from, and why they have no interval."""
    smeared = f"Modelled events were first moved at random by the record's location error, {np.median(errors):g} m"
    if np.ptp(errors) > 0:
        low, high = np.quantile(errors, INTERVAL_95)
        smeared = (
            f"Modelled events were first moved at random by the location errors of recorded ones, {low:.3g} to "
            f"{high:.3g} m"
        )
    basis = f"{smeared}. Locations are compared within {'each of ' if found.steps > 1 else ''}"
    basis += f"{plural(found.steps, 'step')}"
    if found.blocks[0] < MIN_BLOCKS:
        lacking = "events above the cut in a step shared with the record"
        untested = _untested(runs, found.blocks[0], "places", lacking, "The offset and the p-value take")
        near, far = found.offset_distance_interval
        return (
            f"the energy distance is {found.energy_distance:.1f} m, p = {found.energy_p_value:.3f}. The centroids are "
            f"{found.offset_distance:.0f} m apart ({near:.0f} to {far:.0f}). {basis}. {untested}"
        )
    (low, high), (near, far) = found.energy_interval, found.offset_distance_interval
    return (
        f"the energy distance is {found.energy_distance:.1f} m ({low:.1f} to {high:.1f}), p = "
        f"{found.energy_p_value:.3f}. The centroids are {found.offset_distance:.0f} m apart ({near:.0f} to {far:.0f}). "
        f"{basis}. {_resampled(found.blocks[0], found.blocks[1])}"
    )


def _resampled(runs: int, clusters: int) -> str:
    """Sentence without full stop on the runs and the clusters of recorded events that intervals are resampled from."""
    return f"Intervals come from resampling {runs} runs of the model and {clusters} clusters of recorded events"


def plural(count: int, name: str) -> str:
    """A count with its noun."""
    return f"{count} {name}{'s' * (count != 1)}"


def _untested(runs: int, counting: int, what: str, lacking: str, tested: str) -> str:
    """Sentences, without the last full stop, on the measures with a test, and why the others have no interval: the
    model has too few runs, or too few of them (`counting`) have events that count. what: "places" or "axes"; lacking:
    what the other runs lack; tested: measures with a test and their verb, empty where there are none."""
    if runs < MIN_BLOCKS:
        why = (
            f"the model ran {'once' if runs == 1 else f'{runs} times'}, and {MIN_BLOCKS} runs are needed to "
            f"distinguish chance from a difference. Set ensemble to {MIN_BLOCKS - 1} or more, better to 8"
        )
    else:
        have = {0: "none has", 1: "only 1 has"}.get(counting, f"only {counting} have")
        why = (
            f"of the model's {runs} runs {have} {lacking}, and {MIN_BLOCKS} are needed to distinguish chance from a "
            "difference"
        )
    basis = f"{tested} the model's events to be as clustered as recorded ones. Other m" if tested else "M"
    return f"{basis}easures of {what} have no interval and no p-value: {why}"


def _thin(index: NDArray, most: int, generator: np.random.Generator) -> NDArray:
    """Indices of at most `most` of the events `index` (event,), drawn without replacement, in ascending order."""
    return index if len(index) <= most else np.sort(generator.choice(index, most, replace=False))


def axes_measures(both, used, blocks, runs: int, settings: ComparisonSettings) -> tuple[dict, dict]:
    """Mean axes, summed tensors, Kagan angles and source shares; NaN where the record has no tensors."""
    model, record = both
    tensors = [events["potency_tensor"].values for events in both]
    known = [kept & np.isfinite(tensor).all(axis=(1, 2)) for kept, tensor in zip(used, tensors, strict=True)]
    apart = "orientation_tensor" in record
    weight, text = "potency", "the axes are those of the potency tensors of the events compared"
    record_tensors = tensors[1][known[1]]
    if apart:
        known[0] = known[0] & _during(model["time"].values, record.attrs.get("orientation_filter"))
        known[1] = np.zeros_like(known[1])
        record_tensors = record["orientation_tensor"].values
        weight = "unit"
        time, location = record["orientation_time"].values, record["orientation_location"].values
        error = float(record.attrs.get("location_error", 0.0))
        labels = cluster_labels(time, location, np.zeros(len(time), int), error if np.isfinite(error) else 0.0)
        samples = [AxesSample(clear_axes(record_tensors), location, labels)]
        days = time.astype("datetime64[D]")
        period = f"{days.min()} to {days.max()}" if days.size else "no time"
        text = (
            f"recorded orientations are from a catalogue of their own, {period}. They are compared with modelled "
            "events of that time. All tensors have unit size"
        )
    else:
        samples = [_sample(record, tensors[1], known[1], blocks[1])]
    samples.insert(0, _sample(model, tensors[0], known[0], blocks[0]))
    counting = _clear_blocks(samples[0])
    tested = counting >= MIN_BLOCKS
    if not tested:
        samples[0] = replace(samples[0], blocks=None)
    count = [len(sample.axes) for sample in samples]
    clusters = len(np.unique(np.asarray(samples[1].blocks)))
    present = min(count) >= MIN_EVENTS_WITH_AXES and clusters >= MIN_BLOCKS
    if not np.isfinite(record_tensors).any():
        text = "the record has no tensors: axes cannot be compared"
    elif min(count) < MIN_EVENTS_WITH_AXES:
        text = (
            f"axes are not compared: {MIN_EVENTS_WITH_AXES} events with tensors are needed in each catalogue, and "
            f"{count[0]} modelled and {count[1]} recorded ones have tensors"
        )
    elif not present:
        text = (
            f"axes are not compared: the {count[1]} recorded events with tensors are of {plural(clusters, 'cluster')}, "
            f"and {MIN_BLOCKS} are needed to estimate the error of their mean"
        )

    variables = _absent_axes()
    if present:
        dims = {name: value[0] for name, value in variables.items()}
        found = compare_axes(
            samples[0], samples[1], seed=settings.seed, resamplings=min(settings.resamplings, MAX_AXES_RESAMPLINGS)
        )
        turn = mechanism_turn(samples[0], samples[1], np.random.default_rng([settings.seed, 5]))
        found |= turn
        found |= _summed(tensors[0][known[0]], record_tensors, weight, runs)
        variables |= {name: (dims[name], value) for name, value in found.items()}
        size = [
            scalar_potency(tensors[0][known[0]]),
            np.ones(len(samples[1].axes)) if apart else scalar_potency(record_tensors),
        ]
        clear = np.array([one.clear_share(weight) for one, weight in zip(samples, size, strict=True)])
        variables["axis_clear_share"] = (dims["axis_clear_share"], clear)
        text += _left_out(clear, "events" if apart else "potency") + _shapes_text(found)
        if tested:
            text += f". {_resampled(counting, clusters)}"
        else:
            taken = "The turn of the mean mechanism takes" if turn else ""
            text += f". {_untested(runs, counting, 'axes', 'events with clear axes', taken)}"
    variables |= {
        "events_with_axes": ("catalogue", np.array(count, np.int64)),
        "model_axes_used": ("event_model", known[0].astype(np.int8)),
        "record_axes_used": ("event_record", known[1].astype(np.int8)),
    }
    return variables, {"axes_present": int(present), "axes_text": text, "summed_weight": weight}


def _left_out(clear: NDArray, of: str) -> str:
    """The shares of both catalogues without clear axes, as a sentence; empty if all have clear axes."""
    if (clear > 1.0 - MIN_SHARE_LEFT_OUT_TOLD).all():
        return ""
    shares = [
        ", ".join(f"{name} {100 * max(1 - share, 0):.1f} %" for name, share in zip(AXIS_NAMES, row, strict=True))
        for row in clear
    ]
    return (
        ". An axis is left out where its principal value differs from another one by less than "
        f"{100 * MIN_PRINCIPAL_GAP:g} % of the largest. These are, of the model's potency, {shares[0]}; of the "
        f"record's {of}, {shares[1]}. Kagan angles are computed for sources with three clear axes"
    )


def _shapes_text(found: dict[str, NDArray]) -> str:
    """Sentences, without the last full stop, on axes that have no mean and the pattern that they form; empty if all
    have a mean. found: fields of the comparison, (catalogue, axis)."""
    said = []
    for row, which in enumerate(("modelled", "recorded")):
        for column, name in enumerate(AXIS_NAMES):
            shape, k = found["axis_shape"][row, column], found["axis_k"][row, column]
            if shape == GIRDLE:
                pole = direction(found["pole_trend"][row, column], found["pole_plunge"][row, column])
                said.append(f"{which} {name} axes lie in a girdle about {pole} (Woodcock K {k:.2f})")
            elif shape == UNIFORM:
                said.append(f"{which} {name} axes have no preferred direction")
    said[:1] = [one[:1].upper() + one[1:] for one in said[:1]]
    return f". {', '.join(said)}. These axes have no mean" if said else ""


def _sample(events: xr.Dataset, tensor: NDArray, kept: NDArray, blocks: NDArray | None) -> AxesSample:
    own = None if blocks is None else blocks[kept]
    return AxesSample(clear_axes(tensor[kept]), events["location"].values[kept], own)


def _clear_blocks(sample: AxesSample) -> int:
    """Number of blocks with clear axes: the smallest nonzero number among P, B and T axes; 0 without blocks."""
    if sample.blocks is None:
        return 0
    counts = [len(np.unique(sample.blocks[clear])) for clear in np.isfinite(sample.axes).all(axis=-1).T]
    return min((count for count in counts if count), default=0)


def _during(time: NDArray, window: str | None) -> NDArray:
    """True (event,) for times (event,) datetime64 within the window of the record's orientations, its end excluded.

    window: JSON with start and end, either of which may be null; None: no limits.
    """
    limits = json.loads(window or "{}")
    inside = np.ones(len(time), bool)
    if limits.get("start"):
        inside &= time >= np.datetime64(limits["start"], "ns")
    if limits.get("end"):
        inside &= time < np.datetime64(limits["end"], "ns")
    return inside


def _summed(model: NDArray, record: NDArray, weight: str, runs: int) -> dict[str, NDArray]:
    """Summed tensors, the model's as its runs have it on average, their axes, and how far those lie apart."""
    if weight == "unit":
        model, record = (part / np.sqrt(np.sum(part**2, axis=(1, 2), keepdims=True)) for part in (model, record))
    summed = np.array([model.sum(axis=0) / runs, record.sum(axis=0)])
    axes = principal_axes(summed)
    trend, plunge = trend_plunge(axes)
    return {
        "summed_tensor": summed,
        "summed_axis": axes,
        "summed_trend": trend,
        "summed_plunge": plunge,
        "summed_angle": angle_between_axes(axes[0], axes[1]),
        "summed_kagan": kagan_angle(axes[0], axes[1]),
        "source_share": np.array([np.abs(source_shares(part)).mean(axis=0) for part in (model, record)]),
    }


def _absent_axes() -> dict:
    """Every variable of the axes comparison, NaN."""
    length = {"catalogue": 2, "axis_name": len(AXIS_NAMES), "xyz": 3, "axis": 3, "interval": 2, "share": 3}
    length |= {"eigenvalue": 3, "kagan_pair": len(KAGAN_PAIRS), "angle": round(KAGAN_LIMIT / KAGAN_BIN)}
    dims = {
        "mean_axis": "catalogue axis_name xyz",
        "mean_trend": "catalogue axis_name",
        "mean_plunge": "catalogue axis_name",
        "mean_cone": "catalogue axis_name",
        "axis_eigenvalue": "catalogue axis_name eigenvalue",
        "axis_k": "catalogue axis_name",
        "axis_shape": "catalogue axis_name",
        "pole_trend": "catalogue axis_name",
        "pole_plunge": "catalogue axis_name",
        "axis_clear_share": "catalogue axis_name",
        "mean_angle": "axis_name",
        "mean_angle_interval": "axis_name interval",
        "mean_angle_p_value": "axis_name",
        "summed_tensor": "catalogue xyz axis",
        "summed_axis": "catalogue axis_name xyz",
        "summed_trend": "catalogue axis_name",
        "summed_plunge": "catalogue axis_name",
        "summed_angle": "axis_name",
        "summed_kagan": "",
        "mechanism_turn": "",
        "mechanism_turn_interval": "interval",
        "mechanism_turn_p_value": "",
        "mechanism_turn_random_p_value": "",
        "mechanism_turn_noticed": "",
        "kagan_lower": "angle",
        "kagan_share": "kagan_pair angle",
        "kagan_median": "kagan_pair",
        "kagan_median_interval": "kagan_pair interval",
        "source_share": "catalogue share",
    }
    absent = {
        name: (tuple(text.split()), np.full([length[dim] for dim in text.split()], np.nan))
        for name, text in dims.items()
    }
    return absent | {"axis_shape": (("catalogue", "axis_name"), np.full((2, len(AXIS_NAMES)), "", TEXT))}
