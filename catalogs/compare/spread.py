"""Spread of the runs of an ensemble: the mine's own run and its members.

Brittle failure localises: which rock fails first decides what fails next, and one run is one realisation. Each member
has another random field of strength (mpm_core/model/variability.py), as likely as that of the mine's own run.

Layout of spread.nc
-------------------
Dimensions: run (0: the mine's own, then the members by number), period (the dated steps, then "all" of them),
statistic (mean, standard_deviation, minimum, maximum: of the members alone, NaN left out), size_bin. NaN where a number
does not exist: b of too few events, the standard deviation of one member.

  potency (run, period) m3             summed scalar potency of all events, as the catalogue has it
  particle_potency (run, period) m3    summed over failed particles: it does not depend on how they make events
  failed_volume (run, period) m3       rock that failed in the period
  events (run, period)                 resolved events
  events_above_cut (run, period)       of these those that b is counted from
  b, b_error (run, period)             of log10 potency, resolved events at or above the cut: maximum likelihood without
                                       upper bound (catalogs.sources.sizes.estimate_b), as in comparison.nc
  energy_released, energy_dissipated (run, period) J
  <name>_statistics (period, statistic)   of each of these but b_error and events_above_cut
  size_bin_lower (size_bin) log10 P;  cumulative (run, size_bin)   resolved events of all dated steps at least so large
Attributes: mine, members, collapsed_members (left out, as they found no equilibrium), variability (coefficient of
variation of strength), cut (log10 P in m3, that of the mine's own catalogue, for all runs alike), cut_text, and those
of a job's provenance (common.job).
"""

import json
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from catalogs.settings import ALL_STEPS, SpreadSettings
from catalogs.sources import sizes
from common.datasets import read_dataset
from common.errors import InputError
from common.event_table import NAMES, check_events, read_events


def read_members(folders: Sequence[str | os.PathLike], steps: list[str], mine: str) -> list[xr.Dataset]:
    """One catalogue (form of common.event_table) of each member: events of the dated steps, in order of time. Members
    that have collapsed are left out.

    folders: each with events/<step>.nc. Raises InputError for a missing or unreadable file, or one of another mine.
    """
    found = [_read_member(Path(folder), steps, mine) for folder in folders]
    return [member for member in found if member is not None]


def _read_member(folder: Path, steps: list[str], mine: str) -> xr.Dataset | None:
    parts = []
    for step in steps:
        path = folder / "events" / f"{step}.nc"
        events = read_events(path)
        if events.attrs["mine"] != mine:
            raise InputError(f"{path}: is of mine {events.attrs['mine']}, not of {mine}")
        if events.attrs.get("collapsed"):
            return None
        parts.append(events[list(NAMES)].drop_attrs(deep=False))
    joined = xr.concat(parts, "event").sortby("time")  # stable: ties stay in the order of steps, and of events in one
    return check_events(joined.assign_attrs(mine=mine, kind="synthetic"), str(folder))


def all_runs(catalog: xr.Dataset, members: list[xr.Dataset]) -> tuple[xr.Dataset, NDArray | None]:
    """Events of all runs, the mine's own first, and the number of the run of each (event,); None if there is one."""
    if not members:
        return catalog, None
    runs = [catalog, *members]
    joined = xr.concat([run[list(NAMES)].drop_attrs(deep=False) for run in runs], "event").assign_attrs(catalog.attrs)
    return joined, np.repeat(np.arange(len(runs)), [run.sizes["event"] for run in runs])


STATISTICS = ("mean", "standard_deviation", "minimum", "maximum")
QUANTITY_UNITS = {
    "potency": "m3",
    "particle_potency": "m3",
    "failed_volume": "m3",
    "events": "1",
    "b": "1",
    "energy_released": "J",
    "energy_dissipated": "J",
}
MEANINGS = {
    "potency": "potency of all events",
    "particle_potency": "potency of all failed particles",
    "failed_volume": "rock that failed in the period",
    "events": "resolved events",
    "events_above_cut": "resolved events from the cut on, which b is counted from",
    "b": "b of log10 potency of the resolved events from the cut on",
    "b_error": "standard error of b",
    "energy_released": "energy released in the period",
    "energy_dissipated": "energy dissipated in the period",
}
SPREAD_BIN_WIDTH = 0.1  # Bins of log10 potency in plots.


def gather(
    runs: Sequence[str | os.PathLike], catalog: xr.Dataset, comparison: xr.Dataset | None, settings: SpreadSettings
) -> xr.Dataset:
    """The spread of an ensemble; layout as at the head of this module.

    runs: folders with steps/<step>.nc and events/<step>.nc, the mine's own first, then the members by number; catalog,
    comparison (None without a record): the mine's own, for the cut. settings: or their values.
    Raises InputError for a missing or unreadable file, another mine's, or without members.
    """
    settings = SpreadSettings.of(settings)
    if len(runs) < 2:
        raise InputError("ensemble: there are no members, and nothing to compare; set ensemble to 1 or more")
    steps = list(settings.steps)
    cut, cut_text = _cut(catalog, comparison)
    read = [_read_run(Path(folder), steps, settings.mine) for folder in runs]
    collapsed = [any(run.pop("collapsed")) for run in read]
    found = [read[0], *(run for run, lost in zip(read[1:], collapsed[1:], strict=True) if not lost)]
    if len(found) < 2:
        raise InputError(
            f"ensemble: all {len(runs) - 1} members ended in collapse, and there is nothing to compare; see the log of "
            "their last step, or set ensemble to 0"
        )
    table = {name: np.array([_totals(run, name) for run in found]) for name in found[0] if name != "sizes"}
    groups = [[*run["sizes"], np.concatenate(run["sizes"])] for run in found]
    table["events"] = np.array([[len(x) for x in group] for group in groups])
    fits = [[sizes.estimate_b(x, cut) for x in group] for group in groups]
    fitted = {
        key: np.array([[getattr(fit, name) for fit in row] for row in fits])
        for key, name in (("b", "b"), ("b_error", "error"), ("events_above_cut", "events"))
    }
    edges = sizes.cut_grid(np.concatenate([group[-1] for group in groups]), SPREAD_BIN_WIDTH)
    result: dict[str, Any] = {
        name: (("run", "period"), values, {"units": QUANTITY_UNITS.get(name, "1"), "long_name": MEANINGS[name]})
        for name, values in (table | fitted).items()
    }
    for name, unit in QUANTITY_UNITS.items():
        values = statistics(np.asarray(result[name][1], float)[1:])
        result[f"{name}_statistics"] = (
            ("period", "statistic"),
            values,
            {"units": unit, "long_name": f"{MEANINGS[name]}: statistics over the members"},
        )
    result |= {
        "size_bin_lower": ("size_bin", edges, {"units": "1", "long_name": "lower edge of a bin, log10 of m3"}),
        "cumulative": (
            ("run", "size_bin"),
            np.array([sizes.counts(g[-1], edges, SPREAD_BIN_WIDTH)[1] for g in groups]),
            {"units": "1", "long_name": "resolved events of all dated steps from this size on"},
        ),
    }
    coordinates = {
        "run": ("run", np.arange(len(found)), {"long_name": "0: the mine's own run, then the members by number"}),
        "period": ("period", [*steps, ALL_STEPS], {"long_name": "dated step, or all of them"}),
        "statistic": ("statistic", list(STATISTICS), {"long_name": "statistic over the members"}),
    }
    attributes = {"mine": settings.mine, "members": len(found) - 1, "cut": cut, "cut_text": cut_text}
    attributes["collapsed_members"] = len(runs) - len(found)
    attributes["variability"] = settings.variability
    return xr.Dataset(result, coords=coordinates, attrs=attributes)


def statistics(values: NDArray) -> NDArray:
    """Mean, standard deviation, least and largest of values (member, period) along members: (period, statistic)."""
    result = np.full((values.shape[1], len(STATISTICS)), np.nan)
    for period, column in enumerate(values.T):
        known = column[np.isfinite(column)]
        if known.size:
            deviation = known.std(ddof=1) if known.size > 1 else np.nan
            result[period] = known.mean(), deviation, known.min(), known.max()
    return result


def _cut(catalog: xr.Dataset, comparison: xr.Dataset | None) -> tuple[float, str]:
    """The cut of the mine's own catalogue, log10 P, and where it comes from."""
    if comparison is not None:
        return float(comparison["cut"]), comparison.attrs["cut_text"]
    floor = float(catalog.attrs["potency_floor"])
    if not floor > 0:
        return np.nan, "no cut, as the model has no failed rock to set a floor"
    return float(np.log10(floor)), f"log P >= {np.log10(floor):.2f}, the model's floor"


def _read_run(folder: Path, steps: list[str], mine: str) -> dict[str, list]:
    """Numbers of each step of a run, and the sizes (log10 P) of its resolved events."""
    found: dict[str, list] = {
        name: []
        for name in ("potency", "particle_potency", "failed_volume", "energy_released", "energy_dissipated", "sizes")
    } | {"collapsed": []}
    for step in steps:
        state = read_dataset(folder / "steps" / f"{step}.nc", names=()).attrs
        events = read_events(folder / "events" / f"{step}.nc")
        for attributes, name in ((state, "steps"), (events.attrs, "events")):
            if attributes.get("mine") != mine:
                raise InputError(f"{folder / name / step}.nc: is of mine {attributes.get('mine')}, not of {mine}")
        found["collapsed"].append(bool(state.get("collapsed")))
        found["potency"].append(float(events["potency"].values.sum()))
        found["particle_potency"].append(json.loads(events.attrs["budget"])["particle_scalars"])
        for name in ("failed_volume", "energy_released", "energy_dissipated"):
            found[name].append(float(state[name]))
        found["sizes"].append(sizes.log_potency(events["potency"].values[events["resolved"].values == 1]))
    return found


def _totals(run: dict[str, list], name: str) -> list[float]:
    """Values of a quantity by period: the steps, then their sum."""
    return [*run[name], float(np.sum(run[name]))]
