"""What the reader must know before anything else."""

import json

from catalogs.report.inputs import Evidence
from catalogs.report.section_numbers import section_number
from catalogs.report.text import MAX_NAMED, number, percent, plural, typeset

MAX_OPEN_SHARE = 0.05  # Share of an excavation's volume that may depend on how its surface is closed without a banner.
MAX_VOLUME_ERROR = 0.05  # Relative error of an excavation's volume on the grid without a banner.


def banners(evidence: Evidence) -> list[tuple[str, str]]:
    """What the reader must know before anything else: (kind, text)."""
    found = []
    if evidence.config.get("accuracy") == "draft":
        found.append(("draft", draft(evidence)))
    if text := off_volume(evidence):
        found.append(("volume", text))
    if text := open_surfaces(evidence):
        found.append(("volume", text))
    if text := narrow(evidence):
        found.append(("truncated", text))
    if text := at_boundary(evidence):
        found.append(("truncated", text))
    for step in evidence.steps or [stage.attrs for stage in evidence.stages]:
        if int(step.get("loose_pieces", 0)):
            text = f"Unsupported rock in step {step['step']}: {plural(int(step['loose_pieces']), 'piece')}, "
            text += f"{number(step['loose_volume'])} m³, "
            text += f"{typeset(step['loose_where']).replace(' m3 ', ' m³ ')}, counts as excavated"
            kind = "note" if step["loose_volume"] < _finest_volume(evidence) else "truncated"
            found.append((kind, text + " from then on, since nothing held it. Check the solids there."))
    at_once = [row.name for row in evidence.excavations if row.dated and row.filled_at_once]
    if at_once:
        first, more = ", ".join(at_once[:MAX_NAMED]), len(at_once) - MAX_NAMED
        text = f"These excavations are filled while they are mined: {first}{f' and {more} more' if more > 0 else ''}. "
        text += "Their fill is in place while their own step unloads the rock, and it supports walls and failed rock. "
        found.append(("note", text + "An opening that is filled in a later step (key filled) makes more events."))
    if evidence.is_twin:
        text = "The record shown is a twin: a catalogue that this pipeline made itself with other settings. "
        found.append(("twin", text + "It was not measured."))
    if evidence.record is None and evidence.steps and "record" not in evidence.config:
        found.append(("note", "No recorded catalogue was given, so this report cannot say how well the model fits."))
    if evidence.comparison is not None and evidence.comparison["events_above_cut"].values.all():
        found.append(("note", f"Model and record are compared from {typeset(evidence.comparison.attrs['cut_text'])}."))
    return found


def draft(evidence: Evidence) -> str:
    """What a draft changes in the settings of the mine file."""
    lost = json.loads(evidence.grid.attrs.get("draft_would_lose", "[]"))
    cells = "" if lost else "cells of twice the size, "
    text = (
        f"A draft has {cells}looser tolerances and larger increments than section {section_number('config')} states. "
    )
    if lost:
        text += "It keeps the cells of the mine file, since hardly any cell of twice the size would lie wholly in "
        text += f"{lost[0]}" + (f" and {plural(len(lost) - 1, 'other excavation')}. " if len(lost) > 1 else ". ")
    return text + "Its numbers are preliminary. Compute the mine without accuracy: draft for numbers to use."


def off_volume(evidence: Evidence) -> str:
    """Which mined excavations have another volume on the grid than as solids; empty if none has."""
    rows = [row for row in evidence.excavations if not row.planned and row.solid > 0]
    off = [(row.drawn / row.solid - 1, row.name) for row in rows if abs(row.drawn / row.solid - 1) > MAX_VOLUME_ERROR]
    if not off:
        return ""
    off.sort(key=lambda entry: -abs(entry[0]))
    named = ", ".join(f"{name} {100 * error:+.0f} %".replace("-", "−") for error, name in off[:MAX_NAMED])
    more = f" and {len(off) - MAX_NAMED} more" if len(off) > MAX_NAMED else ""
    return (
        f"The grid misses the volume of {plural(len(off), 'excavation')} by more than {percent(MAX_VOLUME_ERROR)}: "
        f"{named}{more}. Refine the grid, or check whether these solids are closed (section {section_number('scene')})."
    )


def open_surfaces(evidence: Evidence) -> str:
    """Which mined excavations have a surface whose holes leave their volume open; empty if none has."""
    rows = [(row.open, row.name) for row in evidence.excavations if not row.planned and row.open > MAX_OPEN_SHARE]
    rows.sort(reverse=True)
    if not rows:
        return ""
    named = ", ".join(f"{name} {percent(share)}" for share, name in rows[:MAX_NAMED])
    more = f" and {len(rows) - MAX_NAMED} more" if len(rows) > MAX_NAMED else ""
    return (
        f"Large parts of the surface are missing or look the other way: {named}{more} of the volume depends on how it "
        "is closed. Export these solids again as closed surfaces."
    )


def narrow(evidence: Evidence) -> str:
    """Which mined excavations are so narrow for the cells that their walls close too little; empty if none is."""
    least = evidence.grid.attrs["narrow_whole_share"]
    rows = sorted((row.whole, row.name) for row in evidence.excavations if not row.planned and row.whole < least)
    if not rows:
        return ""
    named = ", ".join(f"{name} {percent(whole)}" for whole, name in rows[:MAX_NAMED])
    more = f" and {len(rows) - MAX_NAMED} more" if len(rows) > MAX_NAMED else ""
    return (
        f"Narrow for cells of {number(float(evidence.grid.attrs['fine_cell']))} m: {named}{more} of the volume lies in "
        "whole cells. In such an opening partly mined cells connect opposite walls: the walls close too little, and "
        "far too little rock fails. Use smaller cells there."
    )


def at_boundary(evidence: Evidence) -> str:
    """Whether failed rock has reached a face of the domain that is held or loaded; empty if not."""
    reached = [step for step in evidence.steps if step.get("boundary_failed_faces")]
    if not reached:
        return ""
    last = max(reached, key=lambda step: step["boundary_failed_volume"])
    return (
        f"Failed rock has reached the domain's boundary ({last['boundary_failed_faces']}; "
        f"{number(last['boundary_failed_volume'])} m³ of its cells lie there in step {last['step']}): the "
        "boundary condition decides what fails there. Make the domain larger, or check whether the rock is as weak as "
        "assumed. On a plane of symmetry this is no error."
    )


def _finest_volume(evidence: Evidence) -> float:
    """Volume of a finest cell, m3."""
    attributes = evidence.grid.attrs
    volume = float(attributes["fine_cell"]) ** int(attributes.get("dimension", 3))
    return volume * float(attributes.get("thickness", 1.0))
