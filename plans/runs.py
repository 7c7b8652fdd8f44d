"""Results of a plan's runs: events and energy of each step, and numbers by opening, counted from one floor on."""

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from catalogs.settings import DatedStep
from catalogs.sources.openings import NEVER, ROCK, Mining, latest_first, nearest_opening
from catalogs.sources.sizes import log_potency
from common.datasets import read_dataset
from common.errors import InputError
from common.event_table import check_events
from plans.settings import Opening, RunFiles


@dataclass(frozen=True)
class StepResult:
    """Result of one step of one run: its resolved events, potency (event,) m3, location (event, 3) m, and its sums.

    floor: log10 m3, NaN if nothing failed; whole_potency: of all events, resolved or not, m3; energy_released, J;
    failed_volume and fallen_volume, m3; made_from: digest of the inputs of the state. The last four are NaN and empty
    where the run's states are not read. file: the file of the events, which plans may share. collapsed: rock found no
    equilibrium in this step or before.
    """

    potency: NDArray
    location: NDArray
    floor: float
    whole_potency: float
    energy_released: float = np.nan
    failed_volume: float = np.nan
    fallen_volume: float = np.nan
    made_from: str = ""
    file: str = ""
    collapsed: bool = False

    def from_floor(self, floor: float) -> "StepResult":
        """Result with only the events of log potency from a floor on; with all events if the floor is NaN."""
        counts = ~(log_potency(self.potency) < floor)
        return replace(self, potency=self.potency[counts], location=self.location[counts])


def read_run(run: RunFiles, steps: Sequence[DatedStep], mine: str, has_states: bool = True) -> list[StepResult]:
    """Results of each step of a run; has_states: its states are read, too.

    Raises InputError for files of another mine, of other steps, or too few of them.
    """
    results = []
    for path, step in zip(_checked(run, "events", steps), steps, strict=True):
        name, result = _read_step(path, mine, step.name)
        if name != step.name:
            raise InputError(f"{path}: events of step {name} of mine {mine}, not of {step.name} of {mine}")
        results.append(result)
    return _with_states(results, run, steps, mine) if has_states else results


def read_steps(run: RunFiles, mine: str, known: dict[str, StepResult]) -> list[StepResult]:
    """Results of a run in the steps that it lists, without states; known: by file, those that have been read.

    What is read is added to them. Raises InputError for files of another mine.
    """
    for path in run.events:
        if path not in known:
            known[path] = _read_step(path, mine)[1]
    return [known[path] for path in run.events]


def _read_step(path: str, mine: str, default: str = "") -> tuple[str, StepResult]:
    """Name of a step and its result, of a file of events; default: the name where the file has none.

    Raises InputError for another mine."""
    events = check_events(read_dataset(path), path)
    name = str(events.attrs.get("step", default))
    if events.attrs.get("mine") != mine:
        raise InputError(f"{path}: events of step {name} of mine {events.attrs.get('mine')}, not of {mine}")
    is_resolved, potency = events["resolved"].values == 1, events["potency"].values
    location = events["location"].values[is_resolved]
    whole, collapsed = float(potency.sum()), bool(events.attrs.get("collapsed"))
    return name, StepResult(
        potency[is_resolved], location, _log_floor(events.attrs), whole, file=path, collapsed=collapsed
    )


def _with_states(
    results: Sequence[StepResult], run: RunFiles, steps: Sequence[DatedStep], mine: str
) -> list[StepResult]:
    """Results with energy, failed volume and digest of each state. Raises InputError as read_run."""
    completed = []
    for result, path, step in zip(results, _checked(run, "states", steps), steps, strict=True):
        state = read_dataset(path, names=()).attrs
        if (state.get("mine"), state.get("step")) != (mine, step.name):
            raise InputError(
                f"{path}: state of step {state.get('step')} of mine {state.get('mine')}, not of {step.name} of {mine}"
            )
        energy, failed = (float(state[name]) for name in ("energy_released", "failed_volume"))
        fallen = sum(fall["volume"] for fall in json.loads(state.get("falls", "[]")))
        completed.append(
            replace(
                result,
                energy_released=energy,
                failed_volume=failed,
                fallen_volume=float(fallen),
                made_from=str(state.get("made_from", "")),
            )
        )
    return completed


def _checked(run: RunFiles, kind: str, steps: Sequence[DatedStep]) -> tuple[str, ...]:
    """Files of a run, `events` or `states`. Raises InputError unless there is one for each step."""
    files: tuple[str, ...] = getattr(run, kind)
    if len(files) != len(steps):
        raise InputError(f"plans: a run ({run.kind}) has {kind} of {len(files)} steps, and {len(steps)} are dated")
    return files


def _log_floor(attributes: Mapping) -> float:
    """Floor of a file of events, log10 m3; NaN without one."""
    smallest = float(attributes.get("potency_floor", np.nan))
    return float(np.log10(smallest)) if smallest > 0.0 else np.nan


def has_collapsed(run: Sequence[StepResult]) -> bool:
    """True if rock of a run found no equilibrium in one of these steps or before."""
    return any(step.collapsed for step in run)


def collapsed_in(run: Sequence[StepResult], steps: Sequence[DatedStep]) -> str:
    """Name of the first step of a run in which, or before which, rock found no equilibrium; empty if there is none."""
    return next((step.name for result, step in zip(run, steps, strict=True) if result.collapsed), "")


def common_floor(runs: Sequence[Sequence[StepResult]]) -> float:
    """Largest floor (log10 m3) of the steps of runs; NaN if nothing failed in any."""
    return float(np.fmax.reduce([step.floor for run in runs for step in run], initial=np.nan))


def digest(runs: Sequence[Sequence[StepResult]], kinds: Sequence[str], step: int) -> str:
    """Digest of a step of all runs; empty where a state carries none of its own.

    It is that of states and events, not of the files of events: these depend on the dates of a step too, rock does not.
    """
    sha = hashlib.sha256()
    for kind, run in zip(kinds, runs, strict=True):
        result = run[step]
        if not result.made_from:
            return ""
        sha.update(f"{kind} {result.made_from} {result.whole_potency!r}".encode())
        sha.update(np.ascontiguousarray(np.column_stack([result.location, result.potency])).tobytes())
    return sha.hexdigest()[:16]


@dataclass(frozen=True)
class Geometry:
    """Openings of a plan on the grid: cells of each, and the index of the step that mines it; -1: before the first.

    origin (piece, 3): lower corner, m; edge, m; opening (piece,): index among the plan's openings; mined (opening,);
    volume (opening,) and step_volume (step,): rock that each is the first to mine, m3; mining: by excavations of
    grid.nc; opening_of (excavation,): index among the plan's openings, -1 for none.
    """

    origin: NDArray
    edge: float
    opening: NDArray
    mined: NDArray
    volume: NDArray
    step_volume: NDArray
    mining: Mining
    opening_of: NDArray

    @classmethod
    def of(cls, grid: xr.Dataset, openings: Sequence[Opening], steps: Sequence[DatedStep]) -> "Geometry":
        """Geometry of the openings in grid.nc. Raises InputError for an opening or step that does not exist, and in
        plane strain."""
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
        number_of_piece = index[grid["piece_excavation"].values]
        is_mined = number_of_piece >= 0
        mined, filled = np.full((2, len(names)), NEVER)
        for opening in openings:
            mined[names.index(opening.name)] = number.get(opening.step, -1)
            if opening.filled is not None:
                filled[names.index(opening.name)] = number.get(opening.filled, -1)
        mining = Mining.of(grid, mined, filled)
        grid_index = np.array([names.index(opening.name) for opening in openings], int)
        volume, mined = mining.volumes(ROCK)[grid_index], mined[grid_index]
        return cls(
            grid["piece_origin"].values[is_mined],
            float(grid.attrs["fine_cell"]),
            number_of_piece[is_mined],
            mined,
            volume,
            np.array([volume[mined == step].sum() for step in range(len(steps))]),
            mining,
            index,
        )

    def nearest(self, location: NDArray, step: int) -> NDArray:
        """Index of the opening nearest to each event of a step (event,), of those mined by then; -1 without any."""
        origin, excavation = self.mining.cells_open(step)
        is_open, rank = np.ones(len(self.mined), bool), latest_first(self.mined)
        return nearest_opening(location, origin, self.edge, self.opening_of[excavation], is_open, rank)[0]

    def distances(self, location: NDArray, step: int, farthest: float) -> NDArray:
        """Distance of each event of a step from each opening (event, opening), m; inf beyond `farthest`, and for
        openings that are not mined by then."""
        away_from = np.full((len(location), len(self.mined)), np.inf)
        if not len(location) or not len(self.origin):
            return away_from
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
                away = nearest_opening(location[near], cells, self.edge, alone, np.array([True]), alone[:1])[1]
                away_from[near, opening] = np.where(away <= farthest, away, np.inf)
        return away_from


def counts(events: StepResult, geometry: Geometry, step: int, distances: Sequence[float]) -> dict[str, NDArray]:
    """Number, potency, sum of squares and largest size by opening (opening + 1,), the last of all events together; and
    number_within (opening + 1, distance), of which the last counts each event once."""
    count = len(geometry.mined)
    nearest = geometry.nearest(events.location, step)
    known = nearest >= 0
    values = {"number": np.ones_like(events.potency), "potency": events.potency, "squares": events.potency**2}
    by_opening = {
        name: np.append(np.bincount(nearest[known], one[known], minlength=count), one.sum())
        for name, one in values.items()
    }
    largest = np.full(count + 1, -np.inf)
    np.maximum.at(largest, nearest[known], log_potency(events.potency[known]))
    largest[-1] = log_potency(events.potency).max(initial=-np.inf)
    by_opening["largest"] = np.where(np.isfinite(largest), largest, np.nan)
    away = geometry.distances(events.location, step, max(distances))
    away = np.column_stack([away, away.min(axis=1, initial=np.inf)])
    by_opening["number_within"] = np.stack([(away <= limit).sum(axis=0) for limit in distances], axis=1).astype(float)
    return by_opening
