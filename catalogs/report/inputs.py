"""What the report is made from: of the datasets of one mine what it shows, and what follows from them directly."""

import json
import os
import re
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
import xarray as xr

from catalogs.settings import InsituStress, Scheduled
from common.costs import cost_of
from common.datasets import read_dataset
from common.errors import InputError
from common.event_table import check_events

CONVERGENCE_COLUMNS = ("increment", "generation", "iteration", "unbalanced_ratio", "max_ratio", "cells", "new_failures")
CONVERGENCE_VARIABLES = tuple(f"convergence_{name}" for name in CONVERGENCE_COLUMNS)
CELL_VARIABLES = ("cell_origin", "cell_size", "cell_level", "cell_body")
STATE_VARIABLES = (
    *("position", "cell", "spacing", "volume", "excavation", "displacement", "failed", "strength_factor"),
    *CELL_VARIABLES,
)
# Folders of the runs besides the mine's own: on cells of twice the size, in elastic rock, members of an ensemble.
COMPANION_FOLDERS = re.compile(r"(coarse|elastic_rock|ensemble/(\d+))/")
OTHER_PAGES = ("baselines", "calibration", "drawn_rock", "plans")  # folders of what has a page of its own
UNDATED = {"start": "", "end": "", "dated": 0}
MODEL_LABEL = "Modelled"
RECORD_LABELS = {"twin": "Recorded (twin)", "recorded": "Recorded"}


@dataclass(frozen=True)
class Excavation:
    """One row of the config's excavations with the grid's numbers, NaN where not known: volumes in m3; whole: share
    of its volume in cells that are mined wholly; open: share that hangs on how its surface is closed."""

    name: str
    step: str
    fill: str
    filled: str
    solid: float
    drawn: float
    planned: bool
    dated: bool
    whole: float = np.nan
    open: float = np.nan

    @property
    def filled_at_once(self) -> bool:
        """Whether fill stands in it while its own step unloads the rock."""
        return self.fill != "none" and self.filled == self.step


@dataclass
class Evidence:
    """Everything that the report shows.

    stages: elastic, then the steps in order, each with its convergence table and attributes only; state: what is
    STATE_VARIABLES of the last of them; catalog, record, comparison, spread, closeness, grid_convergence,
    forecast_scores: None where there is none; files: {path: attributes} of all read.
    """

    config: dict
    default: dict | None
    listed: list[Scheduled]
    grid: xr.Dataset
    stages: list[xr.Dataset]
    state: xr.Dataset | None
    events: list[dict]
    catalog: xr.Dataset | None
    record: xr.Dataset | None
    comparison: xr.Dataset | None
    spread: xr.Dataset | None
    closeness: xr.Dataset | None
    grid_convergence: xr.Dataset | None
    forecast_scores: xr.Dataset | None
    files: dict[str, dict]
    resources: list[dict]
    insitu: InsituStress | None

    @property
    def steps(self) -> list[dict]:
        """Attributes of the mining steps, in order."""
        return [stage.attrs for stage in self.stages if stage.attrs["stage"] == "step"]

    @property
    def dated(self) -> list[dict]:
        return [step for step in self.steps if int(step["dated"])]

    @property
    def resolved(self) -> xr.Dataset | None:
        """The modelled events that count: enough particles (resolved)."""
        if self.catalog is None:
            return None
        return self.catalog.isel(event=np.flatnonzero(self.catalog["resolved"].values == 1))

    @property
    def record_label(self) -> str:
        return RECORD_LABELS[self.record.attrs["kind"]]

    @property
    def is_twin(self) -> bool:
        return self.record is not None and self.record.attrs["kind"] == "twin"

    @property
    def excavations(self) -> list[Excavation]:
        """Excavations in the grid's order; planned: not mined by any stage of the run.

        Without steps only the elastic stage is there, which mines what has no date: the history.
        """
        names = json.loads(self.grid.attrs["excavation_names"])
        wanted = {row.name: row for row in self.listed}
        run = {step["step"]: bool(int(step["dated"])) for step in self.steps}
        undated = [str(step["name"]) for step in self.config.get("steps") or [] if not step.get("start")]
        mined = run or dict.fromkeys(["history", *undated], False)
        keys = ("excavation_volume", "excavation_volume_grid", "excavation_whole_share", "excavation_open_share")
        numbers = [_by_name(self.grid.attrs.get(key), names) for key in keys]
        rows = []
        for index, name in enumerate(names):
            row = wanted.get(name, Scheduled(name=name))
            planned, dated = name in wanted and row.step not in mined, run.get(row.step, False)
            when = (name, row.step, row.fill, row.filled or row.step)
            solid, drawn, *shares = (known[index] for known in numbers)
            rows.append(Excavation(*when, solid, drawn, planned, dated, *shares))
        return rows

    @property
    def planned(self) -> list[int]:
        """Indices of the excavations that no step of the run mines."""
        return [index for index, excavation in enumerate(self.excavations) if excavation.planned]


def _by_name(text: str | None, names: list[str]) -> list[float]:
    """Numbers of a JSON attribute, a list in the order of `names` or a dictionary by name; NaN where missing."""
    values = json.loads(text) if text else {}
    values = dict(zip(names, values, strict=False)) if isinstance(values, list) else values
    return [float(values.get(name, np.nan)) for name in names]


def read_evidence(
    config: dict,
    default: dict | None,
    grid,
    elastic,
    steps: list,
    events: list,
    catalog,
    record,
    comparison,
    spread,
    closeness,
    grid_convergence,
    logs,
    excavations: Sequence[Scheduled] | None,
    insitu: InsituStress | None,
    forecast_scores=None,
) -> Evidence:
    """Read the files of one mine; paths that are None do not exist in this scene. Raises InputError (unreadable)."""
    files: dict[str, dict] = {}

    def read(path, check: bool = False, names: tuple[str, ...] | None = None) -> xr.Dataset | None:
        if path is None:
            return None
        dataset = read_dataset(path, names)
        missing = [name for name in names or () if name not in dataset.variables]
        if missing:
            raise InputError(f"{path}: lacks {', '.join(missing)}; delete it and run again")
        files[os.fspath(path)] = dict(dataset.attrs)
        return check_events(dataset, os.fspath(path)) if check else dataset

    found_grid = read(grid)
    paths = [path for path in (elastic, *steps) if path is not None]
    found = [(read(path, names=CONVERGENCE_VARIABLES), path) for path in paths]  # a state may take gigabytes
    found.sort(key=lambda stage: _order(stage[0]))
    stages = [stage for stage, _ in found]
    for stage, path in found:
        if "overshoot_share" not in stage.attrs:
            raise InputError(f"{path}: was made by an earlier version; delete it and run again")
    state = read(found[-1][1], names=STATE_VARIABLES) if found else None
    if state is not None:
        found_grid = on_cells_of(found_grid, state)
    budgets = [read(path, names=()).attrs for path in events]
    # which the mechanics do not know
    dates = {one["step"]: {key: one[key] for key in UNDATED} for one in budgets}
    for stage in stages:
        stage.attrs = UNDATED | stage.attrs | dates.get(stage.attrs["step"], {})
    found_spread = read(spread)
    members = 0 if found_spread is None else int(found_spread.attrs["members"])
    made_by = {"catalog": catalog, "quakeml": catalog, "closeness": closeness, "record": record, "compare": comparison}
    made_by |= {
        "spread": spread,
        "forecast_scores": forecast_scores,
        "grid_convergence": grid_convergence,
        "coarse": grid_convergence,
    }
    absent = {stage for stage, path in made_by.items() if path is None}
    return Evidence(
        config=config,
        default=default,
        listed=_scheduled(config.get("excavations") or []) if excavations is None else list(excavations),
        grid=found_grid,
        stages=stages,
        state=state,
        events=budgets,
        catalog=read(catalog, check=True),
        record=read(record, check=True),
        comparison=read(comparison),
        spread=found_spread,
        closeness=read(closeness),
        grid_convergence=read(grid_convergence),
        forecast_scores=read(forecast_scores),
        files=files,
        resources=read_resources(logs, {Path(path).stem for path in steps}, absent, members),
        insitu=insitu,
    )


def on_cells_of(grid: xr.Dataset, state: xr.Dataset) -> xr.Dataset:
    """The grid's excavations with the cells of a state, which a step may have split."""
    own = [name for name, variable in grid.variables.items() if {"cell", "node"} & set(variable.dims)]
    return grid.drop_vars(own).assign({name: state[name] for name in CELL_VARIABLES})


def _scheduled(entries: list[dict]) -> list[Scheduled]:
    """When excavations of a configuration as written are mined and filled."""
    given = [{key: entry[key] for key in Scheduled.model_fields if key in entry} for entry in entries]
    return [Scheduled.of(entry) for entry in given]


def _order(stage: xr.Dataset) -> tuple[bool, int]:
    """Elastic first, whatever step it is numbered as, then the steps."""
    return stage.attrs["stage"] == "step", int(stage.attrs["step_index"])


def read_resources(logs, steps: set[str], absent: set[str], members: int) -> list[dict]:
    """What each stage cost, from the logs of stages below a folder: columns as in `common.costs`.

    Logs of earlier plans are left out: of other steps than these, of `absent` stages, of members beyond so many. The
    companion on larger cells is one row, and so is each member of an ensemble: the sum of its times, the largest of
    its peaks.
    """
    if logs is None or not Path(logs).is_dir():
        return []
    rows: list[dict] = []
    parts: dict[tuple[int, str], list[dict]] = {}
    for path in sorted(Path(logs).rglob("*.log")):
        if (cost := cost_of(path)) is None:  # of a stage that is under way: this one
            continue
        stage = path.relative_to(logs).with_suffix("").as_posix()
        *folders, last = stage.split("/")
        if folders and folders[0] in OTHER_PAGES:
            continue
        if {stage, *folders} & absent or ({"steps", "events"} & {*folders} and last not in steps):
            continue
        part = COMPANION_FOLDERS.match(stage)
        if part and int(part[2] or 0) > members:
            continue
        if part:
            parts.setdefault((int(part[2] or 0), part[1]), []).append(asdict(cost))
        else:
            rows.append({"stage": stage, **asdict(cost)})
    for (_, folder), stages in sorted(parts.items()):
        total = {name: sum(stage[name] for stage in stages) for name in stages[0]}
        rows.append({"stage": f"{folder}, all stages", **total, "memory": max(stage["memory"] for stage in stages)})
    return rows
