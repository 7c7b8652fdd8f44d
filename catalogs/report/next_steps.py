"""What to do next, the most useful first, each with its key or command."""

from collections.abc import Iterator, Sequence

import numpy as np

from catalogs.compare.locations import location_errors
from catalogs.report.banners import Advice, Banner
from catalogs.report.inputs import Evidence
from catalogs.report.uncertainty import Source
from catalogs.report.verdict import differs

MAX_NEXT = 3


def next_steps(evidence: Evidence, warnings: Sequence[Banner], uncertain: Sequence[Source]) -> list[Advice]:
    """At most MAX_NEXT: mend what is wrong; get something to compare with; correct a potency that is off; make what is
    most uncertain less so; state what is missing; look ahead."""
    found: dict[Advice, None] = {}  # in order, each once
    for advice in _all(evidence, warnings, uncertain):
        found.setdefault(advice)
    return list(found)[:MAX_NEXT]


def _all(evidence: Evidence, warnings: Sequence[Banner], uncertain: Sequence[Source]) -> Iterator[Advice]:
    yield from (one.mend for one in warnings if one.mend is not None)
    if not evidence.steps:
        yield Advice("Mine the excavations in steps with dates:", "steps")
    elif not evidence.dated:
        yield Advice("Give each step that is to be compared its dates:", "steps: start, end")
    if evidence.record is None and "record" not in evidence.config:
        yield Advice("Give the events that were recorded, to check the model with:", "record")
    if evidence.is_twin:
        yield Advice("Compare with events that were measured:", "record")
    if evidence.dated and evidence.catalog is not None and not evidence.catalog.sizes["event"]:
        yield Advice("Check signs and sizes of stress and strength, since no rock failed:", "insitu_stress, materials")
    if evidence.comparison is not None and _is_off(evidence):
        yield _calibrate(evidence)
    # First what was never measured, then the largest of what was.
    unknown = [one for one in uncertain if not np.isfinite(one.factor)]
    known = [one for one in uncertain if np.isfinite(one.factor) and one.matters]
    yield from (one.advice for one in [*unknown, *known] if one.advice is not None)
    if evidence.record is not None and not location_errors(evidence.record).any() and evidence.record.sizes["event"]:
        yield Advice("State how well recorded events are located:", "record.location_error")
    if evidence.config.get("plans"):
        yield Advice("Compare the mining plans:", "snakemake plans")
    planned = [row.name for row in evidence.excavations if row.planned]
    if planned and evidence.dated:
        yield Advice(f"See what mining {planned[0]} would do, by giving it a step:", f"excavations.{planned[0]}.step")


def _calibrate(evidence: Evidence) -> Advice:
    """To fit the rock to the record, for which the mine file has to name what is uncertain."""
    named = evidence.config.get("calibration", {}).get("quantities")
    text = "Fit the properties of the rock to the record"
    return Advice(f"{text}:" if named else f"{text}, by naming them in the section calibration:", "snakemake calibrate")


def _is_off(evidence: Evidence) -> bool:
    """Whether the record has events, and the model's potency or number differs from theirs by more than chance."""
    recorded = int(evidence.comparison["events_above_cut"].sel(catalogue="record"))
    return recorded > 0 and any(differs(evidence, name) for name in ("potency_ratio", "event_ratio"))
