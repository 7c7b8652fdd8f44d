"""Sizes of events: potency-frequency plots (paper Fig. 20), and b by its cut and by the rule that makes events.

The template is "sizes.html.j2".
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from catalogs.compare.size_measures import SIZE_BIN_WIDTH, fit
from catalogs.figures import style
from catalogs.report.evidence import MODEL_LABEL, Evidence, shown_catalogues
from catalogs.report.gallery import Gallery
from catalogs.report.sections import section_number
from catalogs.report.text import (
    DASH,
    as_sentence,
    between,
    comparison_row,
    fixed,
    hundredths,
    number,
    percent,
    whole,
    with_unit,
)
from catalogs.settings import ComparisonSettings
from catalogs.sources.size_law import NONE, POWER, TRUNCATED
from catalogs.sources.sizes import B_MAGNITUDE_PER_B_POTENCY, b_by_cut, counts, cut_grid, estimate_b, log_potency

MIN_P_PRINTED = 0.001  # Smaller p-values are printed as smaller than this.


@dataclass(frozen=True)
class Sizes:
    """One catalogue's sizes: label and colour; log_potency (event,) of m3; the fit log10 N = a - b log P above cut.

    b_interval: (lower, upper), 95 %. by_cut: (3, n) rows cut, b, error of b; NaN where too few events remain.
    """

    label: str
    colour: str
    log_potency: np.ndarray
    b: float
    b_interval: tuple[float, float]
    a: float
    cut: float
    by_cut: np.ndarray


def section(evidence: Evidence, gallery: Gallery) -> dict | None:
    """Content of the section on sizes: figures of potency-frequency and of b against the cut, rows of the comparison,
    fits of both catalogues, rows by event rule, sentences on intervals and unlike particles, scales of b, texts of the
    comparison. None without events."""
    shown = shown_catalogues(evidence)
    if not shown:
        return None
    catalogs = [_size_fit(evidence, label, catalog) for label, catalog in shown.items()]
    rows = rule_rows(evidence, catalogs[0].cut) if MODEL_LABEL in shown else []
    return {
        "figure": gallery.add("potency_frequency", potency_frequency(catalogs)),
        "by_cut": gallery.add("b_against_cut", b_against_cut(catalogs)),
        "rows": size_rows(evidence),
        "fits": catalogs,
        "rules": rows,
        "intervals": intervals_contain(evidence, rows),
        "unlike": unlike(evidence),
        "scales": (1.0, B_MAGNITUDE_PER_B_POTENCY),
        "texts": [
            as_sentence(evidence.comparison.attrs[name])
            for name in ("sums_text", "size_text")
            if evidence.comparison is not None
        ],
    }


def _size_fit(evidence: Evidence, label: str, catalog) -> Sizes:
    """b of one catalogue: from the comparison, or above the model's own floor if it stands alone."""
    values = log_potency(catalog["potency"].values)
    modelled, comparison = label == MODEL_LABEL, evidence.comparison
    colour = style.MODELLED if modelled else style.RECORDED
    if comparison is not None:
        here = comparison.sel(catalogue="model" if modelled else "record")
        by_cut = np.stack([comparison["cut_log_potency"], here["b_by_cut"], here["b_by_cut_error"]])
        b, a, interval = float(here["b"]), float(here["a"]), tuple(here["b_interval"].values)
        law, cut = comparison.attrs["law_model" if modelled else "law_record"], float(comparison["cut"])
        if law == TRUNCATED:  # its line through the same number of events at the cut
            a += (float(here["b_truncated"]) - b) * cut
            b, interval = float(here["b_truncated"]), tuple(here["b_truncated_interval"].values)
        elif law == NONE:
            b = a = np.nan
        return Sizes(label, colour, values, b, interval, a, cut, by_cut)
    floor = float(evidence.catalog.attrs["potency_floor"]) if modelled else np.nan
    known = values[np.isfinite(values)]
    cut = np.log10(floor) if floor > 0 else known.min(initial=np.inf)
    one = fit(known, float(cut), 0.0, False, ComparisonSettings())
    value = one.quoted
    b, a, interval = (np.nan,) * 2 + ((np.nan, np.nan),)
    if value is not None:  # its line goes through the number of events at the cut
        b, a, interval = value.b, one.plain.a + (value.b - one.plain.b) * float(cut), (value.lower, value.upper)
    table = [(each.cut, each.b, each.error) for each in b_by_cut(known, cut_grid(known))]
    return Sizes(label, colour, values, b, interval, a, float(cut), np.array(table, float).reshape(-1, 3).T)


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
        comparison_row("sizes follow (tested before b is given)", *laws, "", ""),
        comparison_row("events at or above the cut", *_pair(comparison, "events_above_cut", whole), "", ""),
        comparison_row(
            "events per day compared (interval: the record's)", *_pair(comparison, "event_rate"), "",
            between(comparison["event_rate_interval"].values),
        ),
        comparison_row(f"number of events, {number_name}", "", "", number_value, number_interval),
        comparison_row(
            "potency per day compared (m³; interval: the record's)", *_pair(comparison, "potency_rate"), "",
            between(comparison["potency_rate_interval"].values),
        ),
        comparison_row(
            f"summed potency from the cut on (m³); {potency_name}", *_pair(comparison, "summed_potency"),
            potency_value, potency_interval,
        ),
        comparison_row(
            "b of potency (95 % interval); modelled − recorded", own_free, their_free,
            fixed(float(comparison["b_difference"]), 2),
            between(comparison["b_difference_interval"].values, hundredths),
        ),
        comparison_row("b if no event may be larger than the largest", own_bounded, their_bounded, "", ""),
        comparison_row(
            "completeness, log P: fullest bin", *_pair(comparison, "completeness_curvature", hundredths), "", "",
        ),
        comparison_row("completeness, log P: where b is stable", own_stable, their_stable, "", ""),
    ]  # fmt: skip


def _pair(comparison: xr.Dataset, name: str, form: Callable[[float], str] = number) -> tuple[str, str]:
    """A value of the model and of the record."""
    model, record = (form(float(comparison[name].sel(catalogue=which))) for which in ("model", "record"))
    return model, record


def _ratio(comparison: xr.Dataset, name: str, both: str) -> tuple[str, str, str]:
    """Name of a ratio's row, its value and its interval. both: what both expect as much of if the ratio is 1."""
    runs, p_value = int(comparison["model_runs"]), float(comparison[f"{name}_p_value"])
    mean = f"mean of {runs} runs over recorded" if runs > 1 else "modelled over recorded"
    chance = f"p < {MIN_P_PRINTED:g}" if p_value < MIN_P_PRINTED else f"p = {number(p_value, 2)}"
    tested = f" ({chance} if both expect as {both})" if np.isfinite(p_value) else ""
    value, interval = float(comparison[name]), comparison[f"{name}_interval"].values
    return f"{mean}{tested}", number(value), between(interval)


def rule_rows(evidence: Evidence, cut: float) -> list[dict]:
    """A row for each rule tried: events, those from the cut (log10 m3) on, their b, the largest log P."""
    found = evidence.event_rules
    if found is None or not found.sizes["event"]:
        return []
    size, rule, rows = log_potency(found["potency"].values), found["rule"].values, []
    rules = (found[name].values.tolist() for name in ("closeness", "link_length", "parts"))
    for index, (closeness, length, parts) in enumerate(zip(*rules, strict=True)):
        own = size[rule == index]
        fit = estimate_b(own, cut)
        rows.append(
            {
                "closeness": f"{closeness:g}",
                "link_length": f"{length:g}" if length else "",
                "parts": whole(parts),
                "own": index == 0,
                "events": whole(len(own)),
                "above": whole(fit.events),
                "b": fit.b,
                "b_text": with_unit(fixed(fit.b, 2), f" ± {fixed(fit.error, 2)}"),
                "largest": fixed(own.max(initial=-np.inf), 2),
            }
        )
    return rows


def intervals_contain(evidence: Evidence, rows: list[dict]) -> list[str]:
    """Sentences on what the interval of the model's b reflects and what it does not, with the range of b over the rules
    tried; an empty list if b is known in none of the rows."""
    known = [row for row in rows if np.isfinite(row["b"])]
    law = "" if evidence.comparison is None else evidence.comparison.attrs.get("law_model", "")
    if not known:
        return []
    low, high = (pick(known, key=lambda row: row["b"]) for pick in (min, max))
    range_of_b = f"{fixed(low['b'], 2)} to {fixed(high['b'], 2)} (section {section_number('sizes')})."
    if law == NONE:
        text = "No power law describes the sizes of the model's events. "
        return [text + f"If it is fitted nevertheless, to the same failed rock by the rules tried, b is {range_of_b}"]
    return [
        "The interval of the model's b reflects the finite number of its events only, not the choice of the rule that "
        f"makes events, or of cell size. For the same failed rock by the rules tried, b is {range_of_b}"
    ]


def unlike(evidence: Evidence) -> str:
    """Sentence on the share of potency in particles whose tensor is unlike their event's; empty without events."""
    if evidence.catalog is None or "unlike_share" not in evidence.catalog.attrs or not evidence.catalog.sizes["event"]:
        return ""
    share = percent(evidence.catalog.attrs["unlike_share"])
    return f"{share} of the potency is in particles whose closeness to their event's tensor is below the threshold."


def potency_frequency(catalogs: list[Sizes]) -> Figure:
    """Per catalogue: events per bin (bars), those at least so large (circles), fitted line, cut (dashed)."""
    figure = style.new_figure(width=style.PAGE_WIDTH * (1 if len(catalogs) > 1 else 0.6), height=4.0)
    array = figure.subplots(1, len(catalogs), squeeze=False, sharex=True, sharey=True).ravel()
    for axes, sizes in zip(array, catalogs, strict=True):
        _panel(axes, sizes)
    array[0].set_ylim(0.7, None)  # of all panels, once all are drawn: what is set stays, however many events follow
    array[0].set_ylabel("number of events")
    return figure


def _panel(axes: Axes, sizes: Sizes) -> None:
    values = np.sort(sizes.log_potency[np.isfinite(sizes.log_potency)])
    axes.set_title(sizes.label)
    axes.set_xlabel("log P (P in m³)")
    axes.set_yscale("log")
    if not len(values):
        axes.text(0.5, 0.5, "no events", transform=axes.transAxes, ha="center", color=style.OUTLINE)
        return
    edges = cut_grid(values, SIZE_BIN_WIDTH)
    count, cumulative = counts(values, edges, SIZE_BIN_WIDTH)
    axes.bar(
        edges, count, SIZE_BIN_WIDTH, align="edge", color=sizes.colour, alpha=0.35, edgecolor="white", linewidth=0.5,
        label="per bin",
    )  # fmt: skip
    axes.plot(
        edges, cumulative, "o", markersize=4.5, markerfacecolor="white", markeredgecolor=sizes.colour,
        markeredgewidth=1.2, label="at least so large",
    )  # fmt: skip
    if np.isfinite(sizes.cut):
        axes.axvline(sizes.cut, color="k", linewidth=0.9, linestyle="--", label=f"cut {_number(sizes.cut)}")
    if np.isfinite(sizes.b):
        span = np.array([sizes.cut, max(values[-1], sizes.cut + SIZE_BIN_WIDTH)])
        text = f"b = {hundredths(sizes.b)} ({between(sizes.b_interval, hundredths)})"
        axes.plot(span, 10 ** (sizes.a - sizes.b * span), color="k", linewidth=1.6, label=text)
    axes.legend(loc="upper right")


def b_against_cut(catalogs: list[Sizes]) -> Figure:
    """b with its error against the cut from which it is counted: a stable b shows as a level stretch."""
    figure = style.new_figure(width=0.6 * style.PAGE_WIDTH, height=3.2)
    axes = figure.subplots()
    for sizes in catalogs:
        cut, b, error = sizes.by_cut
        known = np.isfinite(b)
        axes.fill_between(
            cut[known], (b - error)[known], (b + error)[known], color=sizes.colour, alpha=0.2, linewidth=0
        )
        axes.plot(cut[known], b[known], color=sizes.colour, marker="o", markersize=3, label=f"{sizes.label}, ± error")
    cuts = {sizes.cut for sizes in catalogs if np.isfinite(sizes.cut)}
    for index, cut in enumerate(sorted(cuts)):
        axes.axvline(cut, color="k", linewidth=0.9, linestyle="--", label=None if index else "cut used")
    axes.set_ylim(0, None)
    axes.set_xlabel("cut, log P (P in m³)")
    axes.set_ylabel("b of potency (1)")
    axes.legend()
    return figure


def _number(value: float) -> str:
    return f"{value:.2f}".replace("-", "−")
