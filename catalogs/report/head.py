"""What matters first: how much potency is missing, and each step's modelled and recorded events."""

import json

import numpy as np
import xarray as xr

from catalogs.exposure import DAY, window
from catalogs.report.inputs import Evidence
from catalogs.report.section_numbers import section_number
from catalogs.report.text import number, percent, plural, typeset, whole
from catalogs.sizes import log_potency


def missing_potency(evidence: Evidence) -> list[str]:
    """One sentence or two on rock in cells that were too coarse to fail; empty if there is none.

    The missing potency of a step is estimated from its truncated share s, that of rock above its strength in coarse
    cells. This rock is assumed to release as much per volume as the rock that failed, so s / (1 - s) of the step's
    potency. The estimate has not been compared with a run without coarse rock.
    """
    short = [step for step in evidence.dated if int(step["truncated"])]
    before = [stage.attrs for stage in evidence.stages if int(stage.attrs["truncated"]) and stage.attrs not in short]
    if not short and not before:
        return []
    worst = max(short or before, key=lambda step: step["truncated_share"])
    shares = sorted(float(step["truncated_share"]) for step in short or before)
    span = percent(shares[0]) if len(shares) == 1 else f"{number(100 * shares[0], 2)} to {percent(shares[-1])}"
    where = typeset(worst["truncated_where"]).split(";")[0]
    which = "the dated steps" if short else "the steps before the record" if evidence.steps else "the elastic stage"
    text = f"In {which}, {span} of the rock that reached its strength lies in cells too coarse to fail"
    place = f"; most in {worst['step']}, {where}. Refine the grid there (section {section_number('truncated')})."
    if not short or evidence.catalog is None:
        return [text + place]
    sums = [_potency(evidence.catalog, step["step"]) for step in short]
    more = sum(
        potency * step["truncated_share"] / (1 - step["truncated_share"])
        for potency, step in zip(sums, short, strict=True)
        if step["truncated_share"] < 1
    )
    whole_sum = float(evidence.catalog["potency"].values.sum())
    lead = f"About {number(more, 2)} m³ of potency is missing from the {number(whole_sum)} m³ of the model's events: "
    return [lead + text[0].lower() + text[1:] + place]


def _potency(catalog: xr.Dataset, step: str) -> float:
    return float(catalog["potency"].values[catalog["step"].values == step].sum())


def step_rows(evidence: Evidence) -> list[dict]:
    """A row for each dated step: days, volume mined, and number and potency of both catalogues from the cut on."""
    if evidence.catalog is None or not evidence.dated:
        return []
    cut = float(evidence.comparison["cut"]) if evidence.comparison is not None else -np.inf
    cut = cut if np.isfinite(cut) else -np.inf
    mined = mined_volumes(evidence)
    rows, common = [], _common(evidence)
    for step in evidence.dated:
        start, end = window(step)
        begun, ended = (min(max(moment, common[0]), common[1]) for moment in (start, end))
        row = {
            "step": step["step"],
            "days": number((end - start) / DAY, 3),
            "recorded_days": number((ended - begun) / DAY, 3),
            "mined": number(mined[step["step"]], 4),
            "modelled": _count(evidence.resolved, evidence.resolved["step"].values == step["step"], cut),
        }
        if evidence.record is not None:
            time = evidence.record["time"].values
            row["recorded"] = _count(evidence.record, (time >= start) & (time < end), cut)
        rows.append(row)
    return rows


def mined_volumes(evidence: Evidence) -> dict[str, float]:
    """Rock that each step mines, on the grid, m3. Where solids overlap it counts once, in the step that comes first;
    fill that is mined again is no rock."""
    grid = evidence.grid
    lower, upper, edge = (np.asarray(grid.attrs[name]) for name in ("domain_lower", "domain_upper", "fine_cell"))
    cell, end = (np.rint((corner - lower) / edge).astype(np.int64) for corner in (grid["piece_origin"].values, upper))
    _, place = np.unique(np.ravel_multi_index(cell.T, end + 1), return_inverse=True)
    # Each bit is a point of the cell, inside the excavation or not.
    samples, excavation = grid["piece_samples"].values, grid["piece_excavation"].values
    points = 8 * samples.dtype.itemsize
    gone, found = np.zeros(len(place), samples.dtype), {}
    volume = float(edge) ** int(grid.attrs["dimension"]) * float(grid.attrs["thickness"])
    for step in evidence.steps:
        wanted = [index for index, row in enumerate(evidence.excavations) if row.step == step["step"]]
        own = np.flatnonzero(np.isin(excavation, wanted))
        here = np.unique(place[own])
        before = gone[here]
        np.bitwise_or.at(gone, place[own], samples[own])
        found[step["step"]] = float(np.bitwise_count(gone[here] & ~before).sum()) / points * volume
    return found


def _common(evidence: Evidence) -> list[np.datetime64]:
    """Start and end of what was recorded of the modelled months; of the record's whole time where it does not say."""
    period = json.loads(evidence.record.attrs.get("period", "{}")) if evidence.record is not None else {}
    return [np.datetime64(text, "ns") for text in period.get("common", ("1678-01-01", "2261-12-31"))]


def _count(catalog: xr.Dataset, chosen: np.ndarray, cut: float) -> tuple[str, str]:
    """Number and summed potency (m3) of the chosen events at or above the cut."""
    size = log_potency(catalog["potency"].values)
    kept = chosen & (size >= cut)
    return whole(int(kept.sum())), number(float(catalog["potency"].values[kept].sum()))


def caption(evidence: Evidence) -> str:
    """Which events the table counts."""
    if evidence.comparison is None or not np.isfinite(evidence.comparison["cut"]):
        return f"The table counts events of enough particles in {plural(len(evidence.dated), 'dated step')}."
    cut = typeset(str(evidence.comparison.attrs["cut_text"])).split(",")[0]
    return f"The table counts events of {cut}."
