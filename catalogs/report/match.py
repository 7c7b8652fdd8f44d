"""The comparison as rows of text: what is measured, modelled, recorded, their difference, its 95 % interval."""

from collections.abc import Callable

import numpy as np
import xarray as xr

from catalogs.report.inputs import Evidence
from catalogs.report.text import DASH, between, fixed, number, whole, with_unit
from catalogs.sources.mechanisms import CLUSTER, GIRDLE, UNIFORM, direction
from catalogs.sources.size_law import POWER, TRUNCATED

MIN_P_PRINTED = 0.001  # Smaller p-values are printed as smaller than this.


def _pair(comparison: xr.Dataset, name: str, form: Callable[[float], str] = number) -> tuple[str, str]:
    """A value of the model and of the record."""
    model, record = (form(float(comparison[name].sel(catalogue=which))) for which in ("model", "record"))
    return model, record


def hundredths(value: float) -> str:
    """A number with two decimals: logarithms and b."""
    return fixed(value, 2)


def _row(name: str, modelled: str, recorded: str, value: str, interval: str) -> dict[str, str]:
    return {"name": name, "modelled": modelled, "recorded": recorded, "value": value, "interval": interval}


def location_rows(evidence: Evidence) -> list[dict]:
    """Location: number and 95 % interval of each measure."""
    comparison = evidence.comparison
    if comparison is None:
        return []

    def near(pair: int) -> tuple[str, str]:
        here = comparison["nearest_distance"].isel(pair=pair), comparison["nearest_distance_interval"].isel(pair=pair)
        return with_unit(number(here[0]), " m"), between(here[1].values)

    chance = between(comparison["energy_distance_null"].values)
    return [
        _row(
            "distance between the centroids", "", "", with_unit(number(comparison["centroid_distance"]), " m"),
            between(comparison["centroid_distance_interval"].values),
        ),
        _row(
            "energy distance (0: one distribution" + (")" if chance == DASH else f"; by chance {chance} m)"), "", "",
            with_unit(number(comparison["energy_distance"]), " m"),
            between(comparison["energy_distance_interval"].values),
        ),
        _row("from a modelled event to the nearest recorded, median", "", "", *near(0)),
        _row("from a recorded event to the nearest modelled, median", "", "", *near(1)),
        _row("from a recorded event to the nearest recorded, median", "", "", *near(2)),
    ]  # fmt: skip


def _ratio(comparison: xr.Dataset, name: str, both: str) -> tuple[str, str, str]:
    """Name of a ratio's row, its value and its interval. both: what both expect as much of if the ratio is 1."""
    runs, p_value = int(comparison["model_runs"]), float(comparison[f"{name}_p_value"])
    mean = f"mean of {runs} runs over recorded" if runs > 1 else "modelled over recorded"
    chance = f"p < {MIN_P_PRINTED:g}" if p_value < MIN_P_PRINTED else f"p = {number(p_value, 2)}"
    tested = f" ({chance} if both expect as {both})" if np.isfinite(p_value) else ""
    value, interval = float(comparison[name]), comparison[f"{name}_interval"].values
    return f"{mean}{tested}", number(value), between(interval)


def size_rows(evidence: Evidence) -> list[dict]:
    """Sizes: both catalogues and their difference with 95 % interval."""
    comparison = evidence.comparison
    if comparison is None:
        return []
    free, bounded = (
        [
            with_unit(b, f" ({between(interval, hundredths)})")
            for b, interval in zip(
                _pair(comparison, name, hundredths), comparison[f"{name}_interval"].values, strict=True
            )
        ]
        for name in ("b", "b_truncated")
    )
    laws = str(comparison.attrs["law_model"]), str(comparison.attrs["law_record"])
    # b of a law that the sizes do not follow is no result
    own_free, their_free = (b if law == POWER else DASH for b, law in zip(free, laws, strict=True))
    own_bounded, their_bounded = (
        b if law in (POWER, TRUNCATED) else DASH for b, law in zip(bounded, laws, strict=True)
    )
    own_stable, their_stable = (
        text if text != DASH else "no stable value" for text in _pair(comparison, "completeness_stability", hundredths)
    )
    number_name, number_value, number_interval = _ratio(comparison, "event_ratio", "many")
    potency_name, potency_value, potency_interval = _ratio(comparison, "potency_ratio", "much")
    return [
        _row("sizes follow (tested before b is given)", *laws, "", ""),
        _row("events at or above the cut", *_pair(comparison, "events_above_cut", whole), "", ""),
        _row(
            "events per day compared (interval: the record's)", *_pair(comparison, "event_rate"), "",
            between(comparison["event_rate_interval"].values),
        ),
        _row(f"number of events, {number_name}", "", "", number_value, number_interval),
        _row(
            "potency per day compared (m³; interval: the record's)", *_pair(comparison, "potency_rate"), "",
            between(comparison["potency_rate_interval"].values),
        ),
        _row(
            f"summed potency from the cut on (m³); {potency_name}", *_pair(comparison, "summed_potency"),
            potency_value, potency_interval,
        ),
        _row(
            "b of potency (95 % interval); modelled − recorded", own_free, their_free,
            fixed(float(comparison["b_difference"]), 2),
            between(comparison["b_difference_interval"].values, hundredths),
        ),
        _row("b if no event may be larger than the largest", own_bounded, their_bounded, "", ""),
        _row("completeness, log P: fullest bin", *_pair(comparison, "completeness_curvature", hundredths), "", ""),
        _row("completeness, log P: where b is stable", own_stable, their_stable, "", ""),
    ]  # fmt: skip


def _means(comparison: xr.Dataset) -> tuple[str, str]:
    """Mean axis of the model and of the record with its cone; of axes without a mean what they form."""
    texts = []
    for which in ("model", "record"):
        here = comparison.sel(catalogue=which)
        shape, cone = str(here["axis_shape"].values), float(here["mean_cone"])
        if shape == GIRDLE:
            texts.append(f"girdle, pole {direction(float(here['pole_trend']), float(here['pole_plunge']))}")
        elif shape == UNIFORM:
            texts.append(UNIFORM)
        elif shape == CLUSTER:
            mean = direction(float(here["mean_trend"]), float(here["mean_plunge"]))
            texts.append(mean + (f" ± {number(cone, 2)}°" if np.isfinite(cone) else ""))
        else:
            texts.append(DASH)
    model, record = texts
    return model, record


def _directions(comparison: xr.Dataset, kind: str) -> tuple[str, str]:
    """Trend/plunge of the model's and the record's axis of one kind.

    kind: what the variables' names begin with.
    """
    trends, plunges = (comparison[f"{kind}_{name}"] for name in ("trend", "plunge"))
    model, record = (
        direction(float(trends.sel(catalogue=which)), float(plunges.sel(catalogue=which)))
        if np.isfinite(trends.sel(catalogue=which))
        else DASH
        for which in ("model", "record")
    )
    return model, record


def axis_rows(evidence: Evidence) -> list[dict]:
    """Axes: mean axes of both or what axes form instead, the angle between them with 95 % interval, Kagan angles."""
    comparison = evidence.comparison
    rows = []
    for axis in comparison["axis_name"].values:
        here = comparison.sel(axis_name=axis)
        chance = float(here["mean_angle_p_value"])
        interval = between(here["mean_angle_interval"].values)
        rows.append(
            _row(
                f"mean {axis} axis (trend/plunge), angle between"
                + (f" (p = {number(chance, 2)} if one)" if np.isfinite(chance) else ""),
                *_means(here),
                with_unit(number(here["mean_angle"]), "°"),
                interval,
            )
        )
        summed = _directions(here, "summed")
        rows.append(
            _row(f"{axis} axis of the summed tensor", *summed, with_unit(number(here["summed_angle"]), "°"), "")
        )
    rows.append(
        _row("Kagan angle of the summed tensors", "", "", with_unit(number(comparison["summed_kagan"]), "°"), "")
    )
    for pair, name in (("model_record", "all pairs"), ("nearest", "each modelled and its nearest recorded")):
        here = comparison.sel(kagan_pair=pair)
        interval = between(here["kagan_median_interval"].values)
        rows.append(_row(f"median Kagan angle, {name}", "", "", with_unit(number(here["kagan_median"]), "°"), interval))
    return rows
