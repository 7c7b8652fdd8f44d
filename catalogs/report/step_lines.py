"""Each step in one line: what it mines, modelled beside recorded events, the largest, potency."""

import json
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from catalogs.compare.exposure import DAY, window
from catalogs.report.inputs import Evidence
from catalogs.report.text import magnitude, typeset
from catalogs.sources.openings import volumes_mined
from catalogs.sources.sizes import log_potency

MAX_LINES = 5  # Steps on the first page.


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


def step_lines(evidence: Evidence) -> list[StepLine]:
    """A line for each dated step; none without a catalogue. Events count from the comparison's cut on."""
    if evidence.catalog is None or not evidence.dated:
        return []
    mined, common = mined_volumes(evidence), _common(evidence)
    lines = []
    for step in evidence.dated:
        start, end = window(step)
        begun, ended = (min(max(moment, common[0]), common[1]) for moment in (start, end))
        sides = [_side(evidence, evidence.resolved, evidence.resolved["step"].values == step["step"])]
        if evidence.record is not None:
            time = evidence.record["time"].values
            sides.append(_side(evidence, evidence.record, (time >= start) & (time < end)))
        days, recorded = (end - start) / DAY, (ended - begun) / DAY
        lines.append(StepLine(str(step["step"]), days, recorded, mined[step["step"]], tuple(sides)))
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


def that_matter(lines: Sequence[StepLine], most: int = MAX_LINES) -> list[StepLine]:
    """At most so many of the lines, in their order: the latest step, and those with the largest shares of potency."""
    if len(lines) <= most:
        return list(lines)
    potency = np.array([[side.potency for side in line.sides] for line in lines])
    share = np.max(potency / np.maximum(potency.sum(axis=0), np.finfo(float).tiny), axis=1)
    share[-1] = np.inf
    return [lines[index] for index in np.sort(np.argsort(-share, kind="stable")[:most])]


def mined_volumes(evidence: Evidence) -> dict[str, float]:
    """Rock that each step mines, on the grid, m3. Where solids overlap it counts once, in the step that comes first;
    fill that is mined again is no rock."""
    mined = [
        [index for index, row in enumerate(evidence.excavations) if row.step == step["step"]] for step in evidence.steps
    ]
    names = [step["step"] for step in evidence.steps]
    return dict(zip(names, volumes_mined(evidence.grid, mined), strict=True))


def shear_modulus(evidence: Evidence) -> float:
    """Pa, of the host rock: what potency is a magnitude with."""
    return float(evidence.catalog.attrs["shear_modulus"])


def cut_of(evidence: Evidence) -> float:
    """Smallest log10 potency (m3) that counts in both catalogues; minus infinity where nothing is compared."""
    cut = float(evidence.comparison["cut"]) if evidence.comparison is not None else -np.inf
    return cut if np.isfinite(cut) else -np.inf


def caption(evidence: Evidence) -> str:
    """Which events the table of the appendix counts."""
    if not np.isfinite(cut_of(evidence)):
        return "The table counts events of enough particles."
    cut = typeset(str(evidence.comparison.attrs["cut_text"])).split(",")[0]
    return f"The table counts events of {cut}."


def _common(evidence: Evidence) -> list[np.datetime64]:
    """Start and end of what was recorded of the modelled months; of the record's whole time where it does not say."""
    period = json.loads(evidence.record.attrs.get("period", "{}")) if evidence.record is not None else {}
    return [np.datetime64(text, "ns") for text in period.get("common", ("1678-01-01", "2261-12-31"))]


def _side(evidence: Evidence, catalog: xr.Dataset, chosen: NDArray) -> Side:
    """The chosen events (event,) at or above the cut."""
    kept = chosen & (log_potency(catalog["potency"].values) >= cut_of(evidence))
    potency, largest = (float(getattr(catalog["potency"].values[kept], of)(initial=0.0)) for of in ("sum", "max"))
    as_one, largest = (magnitude(one, shear_modulus(evidence)) for one in (potency, largest))
    return Side(int(kept.sum()), potency, as_one, largest if kept.any() else np.nan)
