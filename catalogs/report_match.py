"""The comparison as rows of text: what is measured, modelled, recorded, their difference, its 95 % interval."""

import xarray as xr

from catalogs.report_inputs import Evidence
from catalogs.report_text import MISSING, between, fixed, number, whole


def _pair(comparison: xr.Dataset, name: str, form=number) -> list[str]:
    """A value of the model and of the record."""
    return [form(float(comparison[name].sel(catalogue=which))) for which in ("model", "record")]


def _row(name: str, modelled: str, recorded: str, value: str, interval: str) -> dict[str, str]:
    return {"name": name, "modelled": modelled, "recorded": recorded, "value": value, "interval": interval}


def location_rows(evidence: Evidence) -> list[dict]:
    """Location: number and 95 % interval of each measure."""
    comparison = evidence.comparison
    if comparison is None:
        return []

    def near(pair: int) -> tuple[str, str]:
        here = comparison["nearest_distance"].isel(pair=pair), comparison["nearest_distance_interval"].isel(pair=pair)
        return f"{number(here[0])} m", between(here[1].values)

    chance = between(comparison["energy_distance_null"].values)
    return [
        _row(
            "distance between the centroids", "", "", f"{number(comparison['centroid_distance'])} m",
            between(comparison["centroid_distance_interval"].values),
        ),
        _row(
            f"energy distance (by chance {chance} m)", "", "", f"{number(comparison['energy_distance'])} m",
            between(comparison["energy_distance_interval"].values),
        ),
        _row("from a modelled event to the nearest recorded, median", "", "", *near(0)),
        _row("from a recorded event to the nearest modelled, median", "", "", *near(1)),
        _row("from a recorded event to the nearest recorded, median", "", "", *near(2)),
    ]  # fmt: skip


def size_rows(evidence: Evidence) -> list[dict]:
    """Sizes: both catalogues and their difference with 95 % interval."""
    comparison = evidence.comparison
    if comparison is None:
        return []
    bounded = [
        f"{number(comparison['b_truncated'].sel(catalogue=which))} ± {number(comparison['b_truncated_error'].sel(catalogue=which), 2)}"
        for which in ("model", "record")
    ]
    free = [
        f"{number(comparison['b'].sel(catalogue=which))} ± {number(comparison['b_error'].sel(catalogue=which), 2)}"
        for which in ("model", "record")
    ]
    stable = [
        text if text != MISSING else "no stable value"
        for text in _pair(comparison, "completeness_stability", lambda value: fixed(value, 2))
    ]
    return [
        _row("events at or above the cut", *_pair(comparison, "events_above_cut", whole), "", ""),
        _row(
            "summed potency above the cut (m³); modelled over recorded", *_pair(comparison, "summed_potency"),
            number(comparison["potency_ratio"]), between(comparison["potency_ratio_interval"].values),
        ),
        _row(
            "b of potency; modelled − recorded", *free, fixed(float(comparison["b_difference"]), 2),
            between(comparison["b_difference_interval"].values),
        ),
        _row("b if no event may be larger than the largest", *bounded, "", ""),
        _row("completeness, log P: fullest bin", *_pair(comparison, "completeness_curvature", lambda v: fixed(v, 2)), "", ""),
        _row("completeness, log P: where b is stable", *stable, "", ""),
    ]  # fmt: skip


def axis_rows(evidence: Evidence) -> list[dict]:
    """Axes: mean trend and plunge of both, the angle between them with 95 % interval, and Kagan angles."""
    comparison = evidence.comparison
    rows = []
    for axis in comparison["axis_name"].values:
        here = comparison.sel(axis_name=axis)
        means = [
            f"{float(here['mean_trend'].sel(catalogue=which)):03.0f}°/{float(here['mean_plunge'].sel(catalogue=which)):.0f}° "
            f"± {number(here['mean_cone'].sel(catalogue=which), 2)}°"
            for which in ("model", "record")
        ]
        interval = between(here["mean_angle_interval"].values)
        rows.append(
            _row(f"mean {axis} axis (trend/plunge), angle between", *means, f"{number(here['mean_angle'])}°", interval)
        )
        means = [
            f"{float(here['summed_trend'].sel(catalogue=which)):03.0f}°/{float(here['summed_plunge'].sel(catalogue=which)):.0f}°"
            for which in ("model", "record")
        ]
        rows.append(_row(f"{axis} axis of the summed tensor", *means, f"{number(here['summed_angle'])}°", ""))
    rows.append(_row("Kagan angle of the summed tensors", "", "", f"{number(comparison['summed_kagan'])}°", ""))
    for pair, name in (("model_record", "all pairs"), ("nearest", "each modelled and its nearest recorded")):
        here = comparison.sel(kagan_pair=pair)
        interval = between(here["kagan_median_interval"].values)
        rows.append(_row(f"median Kagan angle, {name}", "", "", f"{number(here['kagan_median'])}°", interval))
    return rows


def match_rows(evidence: Evidence) -> list[dict]:
    """The few numbers of the headline: where, how large, how oriented."""
    if evidence.comparison is None:
        return []
    rows = size_rows(evidence)[:3] + location_rows(evidence)[:2]
    if int(evidence.comparison.attrs.get("axes_present", 0)):
        rows += [row for row in axis_rows(evidence) if row["name"].startswith(("mean P", "mean T"))]
    return rows
