"""Steps, one line for each: excavations mined, modelled and recorded events, the largest, potency; all in sentences.

The template is "steps.html.j2".
"""

import json
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from catalogs.compare.exposure import DAY, window
from catalogs.report.by_opening import step_of_events, where
from catalogs.report.evidence import Evidence
from catalogs.report.gallery import Gallery
from catalogs.report.text import MAX_NAMED, fixed, magnitude, number, plural, typeset, whole
from catalogs.sources.sizes import log_potency
from common.event_table import ON_PLANES

MAX_LINES = 4  # Steps on the first page.
MAX_STEPS_LISTED = 12  # Steps that one sentence lists.


@dataclass(frozen=True)
class Side:
    """Events of one catalogue that count: how many, their potency (m3), Mw of one event of all of it, the largest Mw.
    Magnitudes are those of potency in the host rock.

    NaN where there is none.
    """

    number: int
    potency: float
    as_one: float
    largest: float


@dataclass(frozen=True)
class StepLine:
    """A step, or all: its days, for how many of them there is a record, rock mined (m3), the modelled events that count
    and the recorded ones, if there is a record."""

    name: str
    days: float
    recorded_days: float
    mined: float
    sides: tuple[Side, ...]


def section(evidence: Evidence, _: Gallery) -> dict:
    """Content of the section on steps: headline (sentences), a line for each step, and the table's caption."""
    lines = step_lines(evidence)
    return {"headline": headline(evidence), "lines": lines, "caption": caption(evidence) if lines else ""}


def step_lines(evidence: Evidence) -> list[StepLine]:
    """A line for each dated step; none without a catalogue. Events count from the comparison's cut on."""
    if evidence.catalog is None or not evidence.dated:
        return []
    mined, common = mined_volumes(evidence), _common(evidence)
    both = [one for one in (evidence.resolved, evidence.record) if one is not None]
    lines = []
    for step, *potencies in zip(evidence.steps, *(_counted(evidence, one) for one in both), strict=True):
        if not int(step["dated"]):
            continue
        start, end = window(step)
        begun, ended = (min(max(moment, common[0]), common[1]) for moment in (start, end))
        sides = tuple(_side(evidence, potency) for potency in potencies)
        days, recorded = (end - start) / DAY, (ended - begun) / DAY
        lines.append(StepLine(str(step["step"]), days, recorded, mined[step["step"]], sides))
    return lines


def total(evidence: Evidence, lines: Sequence[StepLine]) -> StepLine:
    """All of these steps as one line."""
    sides = []
    for parts in zip(*(line.sides for line in lines), strict=True):
        potency = sum(part.potency for part in parts)
        largest = max((part.largest for part in parts if np.isfinite(part.largest)), default=np.nan)
        as_one = magnitude(potency, shear_modulus(evidence))
        sides.append(Side(sum(part.number for part in parts), potency, as_one, largest))
    days, recorded, mined = (sum(getattr(line, name) for line in lines) for name in ("days", "recorded_days", "mined"))
    return StepLine(f"all {len(lines)} steps", days, recorded, mined, tuple(sides))


def latest_and_largest(lines: Sequence[StepLine], most: int = MAX_LINES) -> list[StepLine]:
    """Lines of the latest step and of those with the largest shares of potency, at most `most`, in their order."""
    if len(lines) <= most:
        return list(lines)
    potency = np.array([[side.potency for side in line.sides] for line in lines])
    share = np.max(potency / np.maximum(potency.sum(axis=0), np.finfo(float).tiny), axis=1)
    share[-1] = np.inf
    return [lines[index] for index in np.sort(np.argsort(-share, kind="stable")[:most])]


def mined_volumes(evidence: Evidence) -> dict[str, float]:
    """Rock that each step mines, on the grid, m3. Where solids overlap it counts once, in the step that comes first;
    fill that is mined again is no rock."""
    found = {step["step"]: 0.0 for step in evidence.steps}
    for row in evidence.excavations:
        if row.step in found:
            found[row.step] += row.mined
    return found


def shear_modulus(evidence: Evidence) -> float:
    """Pa, of the host rock: what potency is a magnitude with."""
    return float(evidence.catalog.attrs["shear_modulus"])


def cut_of(evidence: Evidence) -> float:
    """Smallest log10 potency (m3) that counts in both catalogues; minus infinity where nothing is compared."""
    cut = float(evidence.comparison["cut"]) if evidence.comparison is not None else -np.inf
    return cut if np.isfinite(cut) else -np.inf


def caption(evidence: Evidence) -> str:
    """Caption of the appendix's table of steps, on the events that it counts."""
    if not np.isfinite(cut_of(evidence)):
        return "The table counts events of enough particles."
    cut = typeset(str(evidence.comparison.attrs["cut_text"])).split(",")[0]
    return f"The table counts events of {cut}."


def _common(evidence: Evidence) -> list[np.datetime64]:
    """Start and end of what was recorded of the modelled months; of the record's whole time where it does not say."""
    period = json.loads(evidence.record.attrs.get("period", "{}")) if evidence.record is not None else {}
    return [np.datetime64(text, "ns") for text in period.get("common", ("1678-01-01", "2261-12-31"))]


def _counted(evidence: Evidence, catalog: xr.Dataset) -> list[NDArray]:
    """Potency (event,), m3, of the events of each step that are at or above the cut."""
    step, potency = step_of_events(evidence, catalog), catalog["potency"].values
    kept = np.flatnonzero((step >= 0) & (log_potency(potency) >= cut_of(evidence)))
    kept = kept[np.argsort(step[kept], kind="stable")]
    return np.split(potency[kept], np.searchsorted(step[kept], np.arange(1, len(evidence.steps))))


def _side(evidence: Evidence, potency: NDArray) -> Side:
    """Events of these potencies (event,), m3."""
    total, largest = float(potency.sum(initial=0.0)), float(potency.max(initial=0.0))
    as_one, largest = (magnitude(one, shear_modulus(evidence)) for one in (total, largest))
    return Side(len(potency), total, as_one, largest if len(potency) else np.nan)


def headline(evidence: Evidence) -> list[str]:
    """The result in plain sentences."""
    if not evidence.steps:
        return ["This scene has no mining steps: it stops at elastic equilibrium, and the model makes no events."]
    if evidence.catalog is None:
        return ["The mining steps are computed; no catalogue of events was requested."]
    catalog, names = evidence.catalog, [step["step"] for step in evidence.dated]
    if not names:
        return ["No mining step has dates: what fails here failed before the record begins, and enters no catalogue."]
    if not catalog.sizes["event"]:
        which = ", ".join(names) if len(names) <= MAX_STEPS_LISTED else f"{names[0]} to {names[-1]}"
        return [f"The model made no events in its {plural(len(names), 'dated step')} ({which})."]
    step = catalog["step"].values
    events_in = Counter(step.tolist())
    counts = events_by_step([(events_in[name], name) for name in names])
    potency, resolved = catalog["potency"].values, evidence.resolved
    unresolved = catalog.sizes["event"] - resolved.sizes["event"]
    text = f"The model made {plural(len(step), 'event')} in {plural(len(names), 'dated step')}: {counts}. "
    if unresolved:
        text += f"{plural(unresolved, 'event')} of too few particles count in the potency budget only. "
    size, mw = log_potency(resolved["potency"].values), resolved["mw"].values
    if len(size):
        largest = int(np.argmax(size))
        place = ", ".join(
            f"{axis} {fixed(value, 0)}" for axis, value in zip("xyz", resolved["location"].values[largest], strict=True)
        )
        text += (
            f"In the other events log P runs from {fixed(size.min(), 1)} to {fixed(size.max(), 1)} "
            f"(Mw {fixed(mw.min(), 1)} to {fixed(mw.max(), 1)}); "
            f"the largest lies at {place} m in step {resolved['step'].values[largest]}. "
        )
    text += f"All events together release {number(potency.sum())} m³ of potency."
    if ON_PLANES.name in catalog:
        share = catalog[ON_PLANES.name].values
        text += (
            f" {plural(int((share > 0.5).sum()), 'event')} slipped mostly on weak planes: "
            f"{fixed(100 * float((share * potency).sum() / potency.sum()), 0)} % of all potency."
        )
    return [text, *where(evidence)]


def events_by_step(counts: list[tuple[int, str]]) -> str:
    """Numbers of events by step, in a list for a sentence; of many steps only those with most events.

    counts: (number of events, name of the step) in order of time, which is kept.
    """
    if len(counts) > MAX_STEPS_LISTED:
        least = sorted(counts, reverse=True)[MAX_NAMED - 1][0]
        most = [(count, name) for count, name in counts if count >= least][:MAX_NAMED]
        return f"most in these, {events_by_step(most)}"
    return ", ".join(f"{whole(count)} in {name}" for count, name in counts)
