"""The record in words: what of it is compared, what was left out, and why a comparison is impossible.

The template is "record.html.j2".
"""

import json

import numpy as np

from catalogs.compare.blocks import MIN_BLOCKS
from catalogs.report.evidence import Evidence
from catalogs.report.gallery import Gallery
from catalogs.report.text import as_sentence, number, percent, plural, typeset, whole
from catalogs.sources.size_law import NONE, POWER, TRUNCATED
from catalogs.sources.sizes import MIN_EVENTS_FOR_B


def section(evidence: Evidence, _: Gallery) -> list[str]:
    """Sentences of the section on the record: the time compared, the events read and left out, and why comparisons are
    impossible. Empty without a record."""
    return sentences(evidence)


def sentences(evidence: Evidence) -> list[str]:
    """Sentences on the events of the record that were read, left out and compared, then on what cannot be compared and
    why. Without dated steps one sentence says that a given record is not compared. Empty without a record."""
    if evidence.record is None:
        if "record" in evidence.config and evidence.steps:
            return [
                "The record is not compared: no step of this mine has dates, so the model has no catalogue to compare "
                "it with. Give steps start and end."
            ]
        return []
    text = evidence.comparison.attrs.get("period_text", "") if evidence.comparison is not None else ""
    return [*([f"Time compared: {text}."] if text else []), _account(evidence), *_impossible(evidence)]


def _account(evidence: Evidence) -> str:
    """Sentences on the number of events in the record's file, the number of them that count, and why others do not."""
    attributes, name = evidence.record.attrs, "record (a twin)" if evidence.is_twin else "record"
    filters = json.loads(attributes.get("filter", "[]"))
    dropped = json.loads(attributes.get("dropped", "{}"))
    text = ""
    if "rows" in attributes:
        text = f"The {name} holds {plural(int(attributes['rows']), 'event')}"
        lacking = [f"{whole(count)} {what}" for what, count in dropped.items()]
        text += f", of which {', '.join(lacking)} are left out. " if lacking else ". "
    crop = next((one for one in filters if one["filter"] == "domain"), None)
    if crop is None:
        return text + f"{plural(evidence.record.sizes['event'], 'recorded event')} are left.{_counted(evidence)}"
    inside, outside = crop["after"], crop["before"] - crop["after"]
    chosen = (evidence.config.get("record") or {}).get("filter") or {}
    dates = "in the dates compared" if chosen.get("start") or chosen.get("end") else "in the modelled months"
    passed = dates if {one["filter"] for one in filters} <= {"start", "end", "domain"} else ""
    passed = passed or "that pass the filters (dates, box, size, quality)"
    if not crop["before"]:
        text += f"No event lies {passed}." if passed.startswith("in") else "No event passes the filters."
    elif not outside:
        text += f"All {plural(inside, 'event')} {passed} lie inside the model's domain."
    else:
        text += f"Of {plural(crop['before'], 'event')} {passed}, {whole(inside)} lie inside the model's domain "
        text += f"and {whole(outside)} outside"
        share = 1 - crop["potency_after"] / crop["potency_before"] if crop["potency_before"] > 0 else np.nan
        text += f", up to {number(crop['farthest'], 2)} m away, with {percent(share)} of their potency"
        text += ". Only those inside are shown."
    text += _counted(evidence)
    if attributes.get("sizes_text"):
        text += f" Magnitudes read: {typeset(str(attributes['sizes_text'])).replace(' - ', ' − ')}."
    if attributes.get("types_text"):
        text += f" Event types of those that have a time, a place and a size: {typeset(str(attributes['types_text']))}."
    if attributes.get("times_text") and not evidence.is_twin:
        text += f" Times read: {attributes['times_text']}."
    return text


def _counted(evidence: Evidence) -> str:
    """Sentence, after a space, on the number of events of either catalogue that are large enough to be compared; empty
    where one of them has none."""
    comparison = evidence.comparison
    if comparison is None or not comparison["events_above_cut"].values.all():
        return ""
    counts = [int(value) for value in comparison["events_above_cut"].values]
    cut = typeset(str(comparison.attrs["cut_text"])).split(",")[0]
    return f" Events of {cut} are compared: {whole(counts[1])} of the record and {whole(counts[0])} of the model."


def _impossible(evidence: Evidence) -> list[str]:
    """Sentences on why places, sizes or axes of the model and the record cannot be compared; empty if all can be, or
    without a comparison."""
    comparison = evidence.comparison
    if comparison is None:
        return []
    attributes = comparison.attrs
    counts = [int(value) for value in comparison["events_above_cut"].values]
    totals = [int(value) for value in comparison["events_total"].values]
    names = ("the model", "the record")
    without = [
        f"{name} has no event" + (f" of such a size (of {whole(total)})" if total else " here")
        for name, count, total in zip(names, counts, totals, strict=True)
        if not count
    ]
    if without:
        cut = typeset(str(attributes.get("cut_text", "")))
        text = f"Places, sizes and axes cannot be compared: {', and '.join(without)}. Events of {cut} are counted."
        return [text, as_sentence(attributes["sums_text"])]
    found = []
    if not np.isfinite(comparison["energy_distance"]):
        found.append(as_sentence(attributes["location_text"]))
    elif not np.isfinite(comparison["energy_distance_interval"]).all():
        runs = int(comparison["blocks"][0])
        found.append(
            f"Most measures of places and axes have no interval and no p-value: fewer than {MIN_BLOCKS} runs of the "
            "model do not show how another run would differ. Set ensemble: 8."
            if runs < MIN_BLOCKS
            else f"Most measures of places have no interval and no p-value: fewer than {MIN_BLOCKS} of the model's "
            f"{runs} runs have events of such a size in a step that the record shares."
        )
    few = [f"{name} has {count}" for name, count in zip(names, counts, strict=True) if count < MIN_EVENTS_FOR_B]
    if not np.isfinite(comparison["b_difference"]):
        laws = [f"those of {name} {_follow(attributes[f'law_{name.split()[1]}'])}" for name in names]
        why = (
            f"{MIN_EVENTS_FOR_B} events are needed in each catalogue, and {' and '.join(few)}"
            if few
            else f"the sizes of both catalogues must follow a power law; {', and '.join(laws)}"
        )
        found.append(f"b is not compared: {why}.")
    if not int(attributes.get("axes_present", 0)):
        found.append(as_sentence(attributes.get("axes_text", "")))
    return found


def _follow(law: str) -> str:
    """Predicate of a sentence on sizes of events, from the name of their law: "follow one", ..., "are too few"."""
    return {POWER: "follow one", TRUNCATED: "follow one that ends at the largest", NONE: "follow none"}.get(
        law, "are too few"
    )
