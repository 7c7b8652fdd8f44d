"""The report's sentences and tables, from the datasets."""

import json
import re

import numpy as np
import xarray as xr
import yaml

from catalogs.report.by_opening import nearest_mined, opening_rows
from catalogs.report.inputs import Evidence
from catalogs.sources.sizes import log_potency
from common.event_table import ON_PLANES
from common.source_tensors import moment_magnitude

DASH = "–"  # Stands for a value that is not known.
MAX_NAMED = 5  # Excavations that one sentence names.
MAX_STEPS_LISTED = 12  # Steps that one sentence lists.
DUMPER = getattr(yaml, "CSafeDumper", yaml.SafeDumper)  # ten times as fast where PyYAML was built with libyaml
SUPERSCRIPT = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
BUDGET_ROWS = {
    "events": "events",
    "aseismic_share": "seismic strain not taken as events (1 − α)",
    "overshoot": "overshoot before the drop (aseismic)",
    "later": "later flow of failed rock (aseismic)",
    "plastic": "all plastic strain of these steps",
}


def number(value, digits: int = 3) -> str:
    """A number for a reader: significant digits, a true minus sign, thousands apart; a dash where there is none."""
    value = float(value) if value is not None else np.nan
    if not np.isfinite(value):
        return DASH
    if value == 0:
        return "0"
    if 1e-3 <= abs(value) < 1e6:
        decimals = max(digits - 1 - int(np.floor(np.log10(abs(value)))), 0)
        return f"{value:,.{decimals}f}".replace(",", "\u202f").replace("-", "−")
    mantissa, exponent = f"{value:.{digits - 1}e}".split("e")
    return f"{mantissa}·10".replace("-", "−") + str(int(exponent)).translate(SUPERSCRIPT)


def whole(value) -> str:
    """A count with its thousands apart."""
    return f"{int(value):,}".replace(",", "\u202f")


def fixed(value, decimals: int) -> str:
    """A number with so many decimals; a dash where there is none."""
    return f"{round(value, decimals) + 0.0:.{decimals}f}".replace("-", "−") if np.isfinite(value) else DASH


def percent(share) -> str:
    """A share as per cent."""
    return f"{number(100 * float(share), 2)} %" if np.isfinite(float(share)) else DASH


def between(interval, form=number) -> str:
    """An interval as text; a dash if it is not known."""
    low, high = (float(value) for value in interval)
    if np.isfinite(low) and high == np.inf:
        return f"{form(low)} or more"
    return f"{form(low)} to {form(high)}" if np.isfinite([low, high]).all() else DASH


def typeset(text: str) -> str:
    """Plain text of a dataset with true minus and comparison signs."""
    return re.sub(r"(?<![\w-])-(?=\d)", "−", text.replace(">=", "≥"))


def with_unit(text: str, unit: str) -> str:
    """A number as text with its unit; a dash stays a dash."""
    return text if text == DASH else f"{text}{unit}"


def magnitude(potency: float, shear_modulus: float) -> float:
    """Mw of shear of this potency (m3) in rock of this shear modulus (Pa); NaN for none."""
    return float(moment_magnitude(np.array(shear_modulus * potency))) if potency > 0 else np.nan


def plural(count: int, name: str) -> str:
    return f"{whole(count)} {name}" + ("" if count == 1 else "s")


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
    counts = events_by_step([(int((step == name).sum()), name) for name in names])
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
    """How many events each step has, of (number, step); of many steps those with most, in order of time."""
    if len(counts) > MAX_STEPS_LISTED:
        least = sorted(counts, reverse=True)[MAX_NAMED - 1][0]
        most = [(count, name) for count, name in counts if count >= least][:MAX_NAMED]
        return f"most in these, {events_by_step(most)}"
    return ", ".join(f"{whole(count)} in {name}" for count, name in counts)


def where(evidence: Evidence) -> list[str]:
    """How near to excavations events are, and which one has most potency nearest to it."""
    events = evidence.resolved
    if events is None or not events.sizes["event"]:
        return []
    rows = opening_rows(evidence, [events], [np.ones(events.sizes["event"], bool)])
    if not rows:
        return []
    first = max(rows, key=lambda row: row.sides[0].potency)
    return [
        f"Half of the events lie within {number(np.median(nearest_mined(evidence, events)[1]), 2)} m of an excavation; "
        f"{percent(first.sides[0].share)} of the potency is nearest to {first.name}."
    ]


def budget_rows(evidence: Evidence) -> tuple[list[str], list[dict], dict]:
    """The catalogue's potency budget: component names, rows of text, and the scalars; empty without a budget."""
    budget = json.loads(evidence.catalog.attrs.get("budget", "{}")) if evidence.catalog is not None else {}
    rows = [
        {"name": text, "values": [number(value) for value in budget[name]]}
        for name, text in BUDGET_ROWS.items()
        if name in budget
    ]
    if "closure" in budget:
        rows.append(
            {
                "name": "remainder, relative",
                "values": [f"{value:.0e}".replace("-", "−") for value in budget["closure"]],
            }
        )
    return budget.get("components", []), rows, budget


def config_lines(config: dict, default: dict | None, indent: int = 0) -> list[tuple[str, bool]]:
    """YAML of the resolved config, line by line, each with whether its value differs from the default's."""
    lines = []
    for name, value in config.items():
        known = isinstance(default, dict) and name in default
        other = default[name] if known else None
        if isinstance(value, dict) and value:
            lines.append((" " * indent + f"{name}:", False))
            lines += config_lines(value, other if isinstance(other, dict) else {}, indent + 2)
            continue
        text = yaml.dump(
            {name: value}, Dumper=DUMPER, sort_keys=False, allow_unicode=True, width=110,
            default_flow_style=None if isinstance(value, list) else False,
        )  # fmt: skip
        changed = default is not None and not (known and other == value)
        lines += [(" " * indent + line, changed) for line in text.splitlines()]
    return lines


def largest_events(catalog: xr.Dataset, count: int) -> np.ndarray:
    """Indices of the events with the largest potency, largest first (ties: the earlier), tensors known."""
    known = np.isfinite(catalog["potency_tensor"].values).all(axis=(1, 2))
    potency = np.where(known, np.nan_to_num(catalog["potency"].values, nan=-1.0), -1.0)
    order = np.argsort(-potency, kind="stable")[:count]
    return order[known[order]]


def ball_rows(events: xr.Dataset) -> list[dict]:
    """One row of text per event, in the given order."""
    rows = []
    for index in range(events.sizes["event"]):
        event = events.isel(event=index)
        rows.append(
            {
                "rank": index + 1,
                "date": str(event["time"].values.astype("datetime64[D]")).replace("NaT", DASH),
                "step": str(event["step"].values),
                "location": ", ".join(fixed(value, 0) for value in event["location"].values),
                "log_potency": fixed(float(np.log10(event["potency"].values)), 2),
                "mw": fixed(float(event["mw"].values), 2),
                "particles": whole(event["particles"].values),
                "shares": [
                    f"{100 * float(event[name].values):.0f} %".replace("-", "−") for name in ("iso", "clvd", "dc")
                ],
            }
        )
    return rows
