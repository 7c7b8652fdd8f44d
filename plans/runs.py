"""What the runs of a plan made: numbers by step and opening, counted from one floor on."""

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from catalogs.comparison_settings import DatedStep
from catalogs.mined_volumes import volumes_mined
from catalogs.nearest_opening import nearest_opening
from catalogs.sizes import log_potency
from common.datasets import read_dataset
from common.errors import InputError
from common.event_table import check_events
from plans.settings import Opening, RunFiles

USED = ("potency", "location", "resolved")


@dataclass(frozen=True)
class StepEvents:
    """Resolved events of one step of one run: potency (event,) m3, location (event, 3) m.

    floor: log10 m3, NaN if nothing failed; whole: potency of all events, resolved or not, m3.
    """

    potency: NDArray
    location: NDArray
    floor: float
    whole: float

    def from_floor(self, floor: float) -> "StepEvents":
        """The events from a floor on; all of them without one (NaN)."""
        kept = ~(log_potency(self.potency) < floor)
        return StepEvents(self.potency[kept], self.location[kept], self.floor, self.whole)


def read_run(run: RunFiles, steps: Sequence[DatedStep], mine: str) -> list[StepEvents]:
    """Events of each step of a run. Raises InputError for files of another mine, of other steps, or too few of them."""
    if len(run.events) != len(steps):
        raise InputError(f"plans: a run ({run.kind}) has events of {len(run.events)} steps, and {len(steps)} are dated")
    found = []
    for path, step in zip(run.events, steps, strict=True):
        events = check_events(read_dataset(path), path)
        has = events.attrs.get("mine"), events.attrs.get("step", step.name)
        if has != (mine, step.name):
            raise InputError(f"{path}: events of step {has[1]} of mine {has[0]}, not of {step.name} of {mine}")
        counted = events["resolved"].values == 1
        potency = events["potency"].values
        found.append(
            StepEvents(
                potency[counted],
                events["location"].values[counted],
                _log_floor(events.attrs),
                float(potency.sum()),
            )
        )
    return found


def run_floor(run: RunFiles, mine: str) -> float:
    """Largest floor (log10 m3) of the steps of a run; NaN if nothing failed. Raises InputError for another mine."""
    floors = [np.nan]
    for path in run.events:
        attributes = read_dataset(path, names=()).attrs
        if attributes.get("mine") != mine:
            raise InputError(f"{path}: events of mine {attributes.get('mine')}, not of {mine}")
        floors.append(_log_floor(attributes))
    return float(np.fmax.reduce(floors))


def _log_floor(attributes: Mapping) -> float:
    """Floor of a file of events, log10 m3; NaN without one."""
    smallest = float(attributes.get("potency_floor", np.nan))
    return float(np.log10(smallest)) if smallest > 0.0 else np.nan


@dataclass(frozen=True)
class States:
    """Of each step of a run: energy released (J), failed volume (m3), and the digest of what the state is made from."""

    energy_released: list[float]
    failed_volume: list[float]
    made_from: list[str]


def read_states(run: RunFiles, steps: Sequence[DatedStep], mine: str) -> States:
    """The states of a run. Raises InputError as read_run."""
    found = States([], [], [])
    if len(run.states) != len(steps):
        raise InputError(f"plans: a run ({run.kind}) has states of {len(run.states)} steps, and {len(steps)} are dated")
    for path, step in zip(run.states, steps, strict=True):
        state = read_dataset(path, names=()).attrs
        if (state.get("mine"), state.get("step")) != (mine, step.name):
            raise InputError(
                f"{path}: state of step {state.get('step')} of mine {state.get('mine')}, not of {step.name} of {mine}"
            )
        found.energy_released.append(float(state["energy_released"]))
        found.failed_volume.append(float(state["failed_volume"]))
        found.made_from.append(str(state.get("made_from", "")))
    return found


def common_floor(runs: Sequence[Sequence[StepEvents]]) -> float:
    """Largest floor (log10 m3) of the steps of runs; NaN if nothing failed in any."""
    return float(np.fmax.reduce([step.floor for run in runs for step in run], initial=np.nan))


def digest(runs: Sequence[Sequence[StepEvents]], states: Sequence[States], kinds: Sequence[str], step: int) -> str:
    """Digest of a step of all runs; empty where a state carries none of its own.

    It is that of states and events, not of the files of events: these depend on the dates of a step too, rock does not.
    """
    found = hashlib.sha256()
    for kind, run, state in zip(kinds, runs, states, strict=True):
        events = run[step]
        if not state.made_from[step]:
            return ""
        found.update(f"{kind} {state.made_from[step]} {events.whole!r}".encode())
        found.update(np.ascontiguousarray(np.column_stack([events.location, events.potency])).tobytes())
    return found.hexdigest()[:16]


@dataclass(frozen=True)
class Geometry:
    """Openings of a plan on the grid: cells of each, and the index of the step that mines it; -1: before the first.

    origin (piece, 3): lower corner, m; edge, m; opening (piece,): index among the plan's openings; mined (opening,);
    volume (opening,) and step_volume (step,): rock that is mined, m3; where solids overlap it counts once in a step.
    """

    origin: NDArray
    edge: float
    opening: NDArray
    mined: NDArray
    volume: NDArray
    step_volume: NDArray

    @classmethod
    def of(cls, grid: xr.Dataset, openings: Sequence[Opening], steps: Sequence[DatedStep]) -> "Geometry":
        """From grid.nc. Raises InputError for an opening or step that does not exist, and in plane strain."""
        if int(grid.attrs["dimension"]) != 3:
            raise InputError(f"plans: mine {grid.attrs['mine']} is two-dimensional; plans need plane: none")
        names = json.loads(grid.attrs["excavation_names"])
        number = {step.name: index for index, step in enumerate(steps)}
        index = np.full(len(names), -1)
        for own, opening in enumerate(openings):
            if opening.name not in names:
                raise InputError(f"plans: the grid has no excavation {opening.name}; it has {', '.join(names)}")
            if opening.step and opening.step not in number:
                raise InputError(
                    f"plans: {opening.name} is mined in {opening.step}, which is no dated step of the plan"
                )
            index[names.index(opening.name)] = own
        own = index[grid["piece_excavation"].values]
        kept = own >= 0
        volume = np.array(json.loads(grid.attrs["excavation_volume_grid"]), float)
        mined = np.array([number.get(opening.step, -1) for opening in openings], int)
        grid_index = np.array([names.index(opening.name) for opening in openings], int)
        by_step = [grid_index[mined == step] for step in range(-1, len(steps))]
        return cls(
            grid["piece_origin"].values[kept],
            float(grid.attrs["fine_cell"]),
            own[kept],
            mined,
            np.array([volume[names.index(opening.name)] for opening in openings]),
            np.array(volumes_mined(grid, by_step)[1:]),
        )

    def nearest(self, location: NDArray, step: int) -> NDArray:
        """Index of the opening nearest to each event of a step (event,), of those mined by then; -1 without any."""
        return nearest_opening(location, self.origin, self.edge, self.opening, self.mined <= step)[0]

    def distances(self, location: NDArray, step: int, farthest: float) -> NDArray:
        """Distance of each event of a step from each opening (event, opening), m; inf beyond `farthest`, and for
        openings that are not mined by then."""
        found = np.full((len(location), len(self.mined)), np.inf)
        if not len(location) or not len(self.origin):
            return found
        order = np.argsort(self.opening, kind="stable")
        starts = np.searchsorted(self.opening[order], np.arange(len(self.mined) + 1))
        for opening in np.flatnonzero(self.mined <= step):
            cells = self.origin[order[starts[opening] : starts[opening + 1]]]
            if not len(cells):
                continue
            lower, upper = cells.min(axis=0) - farthest, cells.max(axis=0) + self.edge + farthest
            near = np.flatnonzero(((location >= lower) & (location <= upper)).all(axis=1))
            if len(near):
                alone = np.zeros(len(cells), int)
                away = nearest_opening(location[near], cells, self.edge, alone, np.array([True]))[1]
                found[near, opening] = np.where(away <= farthest, away, np.inf)
        return found


def counts(events: StepEvents, geometry: Geometry, step: int, distances: Sequence[float]) -> dict[str, NDArray]:
    """Number, potency, sum of squares and largest size by opening (opening + 1,), the last of all events together; and
    number_within (opening + 1, distance), of which the last counts each event once."""
    count = len(geometry.mined)
    nearest = geometry.nearest(events.location, step)
    known = nearest >= 0
    values = {"number": np.ones_like(events.potency), "potency": events.potency, "squares": events.potency**2}
    found = {
        name: np.append(np.bincount(nearest[known], one[known], minlength=count), one.sum())
        for name, one in values.items()
    }
    largest = np.full(count + 1, -np.inf)
    np.maximum.at(largest, nearest[known], log_potency(events.potency[known]))
    largest[-1] = log_potency(events.potency).max(initial=-np.inf)
    found["largest"] = np.where(np.isfinite(largest), largest, np.nan)
    away = geometry.distances(events.location, step, max(distances))
    away = np.column_stack([away, away.min(axis=1, initial=np.inf)])
    found["number_within"] = np.stack([(away <= limit).sum(axis=0) for limit in distances], axis=1).astype(float)
    return found
