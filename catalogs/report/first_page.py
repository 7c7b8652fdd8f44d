"""The first page: what a decision needs, on one screen and one sheet of paper."""

from collections.abc import Iterator, Sequence

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from catalogs.compare.locations import location_errors
from catalogs.figures import style
from catalogs.figures.first_page_figure import Mined, box_of, first_page, within_reach
from catalogs.figures.step_bars import Bars, step_bars
from catalogs.report.by_opening import opening_rows
from catalogs.report.evidence import MODEL_LABEL, Evidence, compared_events, shown_catalogues
from catalogs.report.gallery import Gallery
from catalogs.report.look_first import look_first
from catalogs.report.sections import observations, shaking
from catalogs.report.sections.openings import worst
from catalogs.report.sections.steps import StepLine, cut_of, latest_and_largest, step_lines, total
from catalogs.report.sections.warnings import Advice, Banner, banners
from catalogs.report.text import plural, whole
from catalogs.report.uncertainty import Source, sources
from catalogs.report.verdict import differs, size_of_cut, verdict

PLANNED = "#ffffff"
MAX_DRAWN_EVENTS = 10  # Events of each catalogue in the picture.
TWIN = "The record is a twin: this pipeline made it with other settings, and nothing in it was measured."
MAX_BRIEF = 3  # Warnings that the first page names.
MAX_NEXT = 3
MAX_NAMED_OPENINGS = 3  # Openings that the picture names.


def section(evidence: Evidence, gallery: Gallery) -> dict:
    """Content of the first page: period, notice of a twin, warning, picture, lines of the chosen steps, total, number
    of steps not shown, size from which events count, verdict, sources of uncertainty, next steps."""
    warnings, lines, uncertain = banners(evidence), step_lines(evidence), sources(evidence)
    chosen = latest_and_largest(lines)
    return {
        "when": _when(evidence),
        "notice": TWIN if evidence.is_twin else "",
        "warning": _warning(warnings),
        "picture": _picture(evidence, gallery),
        "bars": _bars(evidence, gallery, lines) if len(lines) > 1 else None,
        "lines": chosen,
        "total": total(evidence, lines) if len(lines) > 1 else None,
        "others": len(lines) - len(chosen),
        "counted": f"of {size_of_cut(evidence)} and more" if lines and np.isfinite(cut_of(evidence)) else "",
        "verdict": verdict(evidence),
        "look_first": look_first(evidence),
        "facts": " ".join(
            fact for fact in (worst(evidence), observations.brief(evidence), shaking.brief(evidence)) if fact
        ),
        "sources": [one for one in uncertain if not np.isnan(one.factor)],
        "unmeasured": [one for one in uncertain if np.isnan(one.factor)],
        "next": next_steps(evidence, [one for one in warnings if one.brief], uncertain),
    }


def _when(evidence: Evidence) -> str:
    """Number of dated steps, with the first and the last day; empty without dated steps."""
    dated = evidence.dated
    if not dated:
        return ""
    return f"{plural(len(dated), 'step')}, {dated[0]['start'][:10]} to {dated[-1]['end'][:10]}"


def _warning(warnings: Sequence[Banner]) -> dict | None:
    """Warning of the first page: invalid (the numbers must not be used), text (the first MAX_BRIEF clauses) and more
    (how many others there are); None without a warning that has a clause."""
    brief = [one for one in warnings if one.brief]
    if not brief:
        return None
    more = len(brief) - MAX_BRIEF
    text = "; ".join(one.brief for one in brief[:MAX_BRIEF])
    return {"invalid": brief[0].invalid, "text": text, "more": f"{whole(more)} more" if more > 0 else ""}


def _picture(evidence: Evidence, gallery: Gallery) -> dict:
    """The figure, and what its caption says."""
    rows = evidence.excavations
    focus = [index for index, row in enumerate(rows) if row.dated] or [
        index for index, row in enumerate(rows) if not row.planned
    ]
    largest = _largest(evidence)
    label, worst = worst_openings(evidence)
    numbers = {row.name: index for index, row in enumerate(rows)}
    first = dict.fromkeys(numbers[place.opening] for place in look_first(evidence))
    named = [*first, *(index for index in worst if index not in first)][:MAX_NAMED_OPENINGS]
    names = {index: rows[index].name for index in named}
    drawn = first_page(evidence.grid, _openings(evidence), focus, evidence.planned, largest, names)
    return gallery.add("first_page", drawn) | {
        "caption": _caption(evidence, focus, largest, label, (len(first), len(named)))
    }


def _bars(evidence: Evidence, gallery: Gallery, lines: Sequence[StepLine]) -> dict:
    """Number and potency of events of all dated steps as bars."""
    labels = [MODEL_LABEL] if evidence.record is None else [MODEL_LABEL, evidence.record_label]
    colour = {str(step["step"]): one for step, one in zip(evidence.steps, _step_colours(evidence), strict=True)}

    def of(name: str) -> dict[str, NDArray]:
        return {
            label: np.array([getattr(line.sides[side], name) for line in lines]) for side, label in enumerate(labels)
        }

    figure = step_bars(
        [line.name for line in lines],
        [colour[line.name] for line in lines],
        [Bars("events", of("number")), Bars("potency\n(m³)", of("potency"))],
        dict(zip(labels, (style.MODELLED, style.RECORDED), strict=False)),
        np.array([evidence.record is None or line.recorded_days > 0 for line in lines]),
    )
    return gallery.add("first_page_steps", figure)


def worst_openings(evidence: Evidence) -> tuple[str, list[int]]:
    """Openings with most modelled potency nearest to them, or recorded potency where the model has none: the label of
    that catalogue, and their indices, at most MAX_NAMED_OPENINGS, the first one the worst. Both are empty without
    events."""
    shown = shown_catalogues(evidence)
    if not shown:
        return "", []
    counted = compared_events(evidence, shown)
    rows = opening_rows(evidence, list(shown.values()), list(counted.values()))
    side = next((side for side in range(len(shown)) if any(row.sides[side].potency > 0 for row in rows)), None)
    if side is None:
        return "", []
    rows = sorted((row for row in rows if row.sides[side].potency > 0), key=lambda row: -row.sides[side].potency)
    index = {row.name: number for number, row in enumerate(evidence.excavations)}
    return list(shown)[side], [index[row.name] for row in rows[:MAX_NAMED_OPENINGS]]


def _step_colours(evidence: Evidence) -> list:
    """A colour for each step."""
    return style.step_colours([bool(int(step["dated"])) for step in evidence.steps])


def _openings(evidence: Evidence) -> list[Mined]:
    """Excavations by step, in the order of mining and in the colours of the steps; the planned ones are no step's."""
    rows, names = evidence.excavations, [str(step["step"]) for step in evidence.steps]
    found = [Mined("planned", style.mpl.colors.to_rgb(PLANNED), evidence.planned, is_step=False)]
    early = [index for index, row in enumerate(rows) if not row.planned and row.step not in names]
    found.append(Mined("earlier", style.mpl.colors.to_rgb(style.BEFORE_RECORD), early, is_step=False))
    for name, colour in zip(names, _step_colours(evidence), strict=True):
        found.append(Mined(name, tuple(colour), [index for index, row in enumerate(rows) if row.step == name]))
    return found


def _caption(
    evidence: Evidence,
    focus: Sequence[int],
    largest: dict[str, tuple[str, xr.Dataset]],
    label: str,
    named: tuple[int, int],
) -> str:
    """Caption of the picture: the events drawn, the number of those beyond its edges, and which openings are named.

    largest: by label of the catalogue, the colour and the events to be drawn; named: number of openings to look at
    first, and with those that have most potency in the catalogue of this label.
    """
    drawn = {label: events for label, (_, events) in largest.items() if events.sizes["event"]}
    if not drawn:
        return "Openings by step. There are no events to draw."
    counts = [
        f"the {MAX_DRAWN_EVENTS} largest {label.lower()}" if events.sizes["event"] == MAX_DRAWN_EVENTS
        else f"{whole(events.sizes['event'])} {label.lower()}"
        for label, events in drawn.items()
    ]  # fmt: skip
    text = f"Openings by step, and events: {' and '.join(counts)}."
    box, places = box_of(evidence.grid, focus), [events["location"].values for events in drawn.values()]
    outside = 0 if box is None else sum(int((~within_reach(place, *box)).sum()) for place in places)
    text += f" {plural(outside, 'event')} farther away not shown." if outside else ""
    first, more = named[0], named[1] - named[0]
    said = [plural(first, "opening") + " to look at first"] if first else []
    potency = f"{label.lower().replace(' (twin)', '')} potency nearby"
    said += [(f"{more} more" if said else plural(more, "opening")) + f" with most {potency}"] if more else []
    return text + (f" Named: {' and '.join(said)}." if said else "")


def _largest(evidence: Evidence) -> dict[str, tuple[str, xr.Dataset]]:
    """Colour and largest counted events of each catalogue, by label."""
    shown = shown_catalogues(evidence)
    counted = compared_events(evidence, shown)
    found = {}
    for label, events in shown.items():
        own = events.isel(event=np.flatnonzero(counted[label]))
        order = np.argsort(-np.nan_to_num(own["potency"].values), kind="stable")[:MAX_DRAWN_EVENTS]
        found[label] = (style.MODELLED if label == MODEL_LABEL else style.RECORDED, own.isel(event=order))
    return found


def next_steps(evidence: Evidence, warnings: Sequence[Banner], uncertain: Sequence[Source]) -> list[Advice]:
    """Advice on the next steps, each once and at most MAX_NEXT, the most urgent first: mend what is wrong; get
    something to compare with; correct a potency that is off; make what is most uncertain less so; state what is
    missing; look ahead."""
    found: dict[str, Advice] = {}  # in order, each once: two warnings may ask for cells of two sizes
    for advice in _all(evidence, warnings, uncertain):
        found.setdefault(advice.text, advice)
    return list(found.values())[:MAX_NEXT]


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
    """Advice to fit the rock to the record, for which the mine file has to name what is uncertain."""
    named = evidence.config.get("calibration", {}).get("quantities")
    text = "Fit the properties of the rock to the record"
    return Advice(f"{text}:" if named else f"{text}, by naming them in the section calibration:", "snakemake calibrate")


def _is_off(evidence: Evidence) -> bool:
    """True if the record has events and the model's potency or number of events differs by more than chance.

    Needs a comparison.
    """
    recorded = int(evidence.comparison["events_above_cut"].sel(catalogue="record"))
    return recorded > 0 and any(differs(evidence, name) for name in ("potency_ratio", "event_ratio"))
