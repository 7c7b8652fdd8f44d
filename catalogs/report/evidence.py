"""Evidence of a report: the parts of one mine's datasets that it shows, and what follows from them directly."""

import json
import os
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from catalogs.compare.bands import GridPreference, bands_of
from catalogs.report.text import whole
from catalogs.settings import InsituStress, ReportSlice, Scheduled, SectionPlane
from catalogs.sources.openings import FILL, NEVER, ROCK, Mining
from common.cell_sizes import CELLS_ACROSS_FILL
from common.datasets import read_dataset
from common.errors import InputError
from common.event_table import UNDATED, check_events
from common.mine_grid import GridMap

CONVERGENCE_COLUMNS = ("increment", "generation", "iteration", "unbalanced_ratio", "max_ratio", "cells", "new_failures")
CONVERGENCE_VARIABLES = tuple(f"convergence_{name}" for name in CONVERGENCE_COLUMNS)
CELL_VARIABLES = ("cell_origin", "cell_size", "cell_level", "cell_body")
STATE_VARIABLES = (
    *("position", "cell", "spacing", "volume", "excavation", "displacement", "failed", "strength_factor"),
    "plastic_strain",
    *CELL_VARIABLES,
)
EVENT_FILES = ("catalog", "record")
DATASETS = (
    "spread",
    *EVENT_FILES,
    "comparison",
    "event_rules",
    "grid_convergence",
    "forecast_scores",
    "openings",
    "observations",
    "scans",
    "source_parameters",
    "shaking",
    "loading",
)
MODEL_LABEL = "Modelled"
RECORD_LABELS = {"twin": "Recorded (twin)", "recorded": "Recorded"}


@dataclass(frozen=True)
class ExcavationRow:
    """One row of the config's excavations with the grid's numbers, NaN where not known.

    Volumes in m3: solid and drawn, of the solid and of the same on the grid; mined: of rock that it is the first to
    mine, all of a planned one that no other mines; fill_mined: of fill that it mines again. across: cells across it;
    needed: how many it needs there; narrow: whether it has fewer; open: share that hangs on how its surface is closed;
    unheld: nodes at which its fill does not hold the walls.
    """

    name: str
    step: str
    fill: str
    filled: str
    solid: float
    drawn: float
    planned: bool
    dated: bool
    mined: float = np.nan
    fill_mined: float = 0.0
    across: float = np.nan
    needed: float = np.nan
    narrow: bool = False
    open: float = np.nan
    unheld: int = 0

    @property
    def filled_at_once(self) -> bool:
        """True if the excavation is filled in its own step, so that fill supports rock while that step unloads it."""
        return self.fill != "none" and self.filled == self.step


def _by_name(text: str | None, names: list[str]) -> list[float]:
    """Numbers of a JSON attribute, a list in the order of `names` or a dictionary by name; NaN where missing."""
    values = json.loads(text) if text else {}
    values = dict(zip(names, values, strict=False)) if isinstance(values, list) else values
    return [float(values.get(name, np.nan)) for name in names]


@dataclass
class Evidence:
    """Everything that the report shows.

    config, default: the mine's configuration as written, and the defaults; listed: when its excavations are mined and
    filled; grid: on the cells of `state`, each part of a cell in the excavation that is the first to mine it; mining:
    what each excavation mines, by the places of `steps`; stages: elastic, then the steps in order, each with its
    convergence table and attributes only, among them the dates of a step from its file of events; state:
    STATE_VARIABLES of the last stage;
    catalog, record, comparison, spread, event_rules, grid_convergence, forecast_scores, openings, observations,
    scans, source_parameters, shaking, loading: the datasets of these names, None where there is none; files: {path:
    attributes} of all read; logs: folder of the stages' logs; insitu: stress before mining; mine_grid, grid_text: grid
    of the mine's own coordinates, if it is not the map, and in words; sections: planes that the mine file chooses;
    foreseen: what a request (accuracy) was told before the run.
    """

    config: dict
    default: dict | None
    listed: list[Scheduled]
    grid: xr.Dataset
    mining: Mining
    stages: list[xr.Dataset]
    state: xr.Dataset | None
    catalog: xr.Dataset | None
    record: xr.Dataset | None
    comparison: xr.Dataset | None
    spread: xr.Dataset | None
    event_rules: xr.Dataset | None
    grid_convergence: xr.Dataset | None
    forecast_scores: xr.Dataset | None
    openings: xr.Dataset | None
    observations: xr.Dataset | None
    scans: xr.Dataset | None
    source_parameters: xr.Dataset | None
    shaking: xr.Dataset | None
    loading: xr.Dataset | None
    files: dict[str, dict]
    logs: Path | None
    insitu: InsituStress | None
    mine_grid: GridMap | None = None
    grid_text: str = ""
    sections: tuple[SectionPlane, ...] = ()
    foreseen: dict | None = None

    @property
    def steps(self) -> list[dict]:
        """Attributes of the mining steps, in order."""
        return _steps_of(self.stages)

    @cached_property
    def bands(self) -> GridPreference | None:
        """Bands of failed rock along the grid and mirrored ones; None without a state."""
        return None if self.state is None else bands_of(self.state, float(self.grid.attrs["fine_cell"]))

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
    def excavations(self) -> list[ExcavationRow]:
        """Excavations in the grid's order; planned: not mined by any stage of the run."""
        rows = _schedule(self.grid, self.stages, self.config, self.listed)
        mined, again = (self.mining.volumes(kind).tolist() for kind in (ROCK, FILL))
        return [replace(row, mined=rock, fill_mined=fill) for row, rock, fill in zip(rows, mined, again, strict=True)]

    @property
    def planned(self) -> list[int]:
        """Indices of the excavations that no step of the run mines."""
        return [index for index, excavation in enumerate(self.excavations) if excavation.planned]


def read_evidence(paths: Mapping[str, Any], settings: ReportSlice, logs: str | os.PathLike | None = None) -> Evidence:
    """Read the files of one mine. Raises InputError (unreadable).

    paths: of grid, elastic, steps and events (lists), and DATASETS; a scene may lack all but the grid. settings: the
    configuration as the user wrote it; when excavations are mined, if not as that says; the stress before mining.
    """
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

    grid = read(paths["grid"])
    states = [path for path in (paths.get("elastic"), *paths.get("steps", ())) if path is not None]
    found = [(read(path, names=CONVERGENCE_VARIABLES), path) for path in states]  # a state may take gigabytes
    found.sort(key=lambda stage: _order(stage[0]))
    stages = [stage for stage, _ in found]
    for stage, path in found:
        if "overshoot_share" not in stage.attrs:
            raise InputError(f"{path}: was made by an earlier version; delete it and run again")
    state = read(found[-1][1], names=STATE_VARIABLES) if found else None
    if state is not None:
        grid = on_cells_of(grid, state)
    event_attributes = [read(path, names=()).attrs for path in paths.get("events", ())]
    # which the mechanics do not know
    dates = {one["step"]: {key: one[key] for key in UNDATED} for one in event_attributes}
    for stage in stages:
        stage.attrs = UNDATED | stage.attrs | dates.get(stage.attrs["step"], {})
    config, excavations = settings.config, settings.excavations
    listed = _scheduled(config.get("excavations") or []) if excavations is None else list(excavations)
    mining = _mining(grid, _schedule(grid, stages, config, listed), _steps_of(stages))
    return Evidence(
        config=config,
        default=settings.default,
        listed=listed,
        grid=mining.first_mined(grid),
        mining=mining,
        stages=stages,
        state=state,
        **{name: read(paths.get(name), check=name in EVENT_FILES) for name in DATASETS},
        files=files,
        logs=None if logs is None else Path(logs),
        insitu=settings.insitu,
        mine_grid=settings.mine_grid.map() if settings.mine_grid else None,
        grid_text=settings.grid_text,
        sections=settings.sections,
        foreseen=settings.foreseen,
    )


def on_cells_of(grid: xr.Dataset, state: xr.Dataset) -> xr.Dataset:
    """The grid's excavations with the cells of a state, which a step may have split."""
    own = [name for name, variable in grid.variables.items() if {"cell", "node"} & set(variable.dims)]
    return grid.drop_vars(own).assign({name: state[name] for name in CELL_VARIABLES})


def _steps_of(stages: list[xr.Dataset]) -> list[dict]:
    """Attributes of the mining steps among stages, in order."""
    return [stage.attrs for stage in stages if stage.attrs["stage"] == "step"]


def _schedule(grid: xr.Dataset, stages: list[xr.Dataset], config: dict, listed: list[Scheduled]) -> list[ExcavationRow]:
    """Rows of the excavations in the grid's order, without what each mines; arguments as in Evidence.

    Without steps only the elastic stage is there, which mines what has no date: the history.
    """
    names = json.loads(grid.attrs["excavation_names"])
    wanted, steps = {row.name: row for row in listed}, _steps_of(stages)
    run = {step["step"]: bool(int(step["dated"])) for step in steps}
    undated = [str(step["name"]) for step in config.get("steps") or [] if not step.get("start")]
    mined = run or dict.fromkeys(["history", *undated], False)
    keys = ("volume", "volume_grid", "cells_across", "cells_needed", "open_share")
    numbers = [_by_name(grid.attrs.get(f"excavation_{key}"), names) for key in keys]
    narrow = json.loads(grid.attrs.get("excavation_narrow", "[]"))
    unheld = json.loads(steps[-1].get("unheld_fill", "{}")) if steps else {}
    rows = []
    for index, name in enumerate(names):
        row = wanted.get(name, Scheduled(name=name))
        planned, dated = name in wanted and row.step not in mined, run.get(row.step, False)
        when = (name, row.step, row.fill, row.filled or row.step)
        solid, drawn, across, needed, open_share = (known[index] for known in numbers)
        rows.append(
            ExcavationRow(
                *when,
                solid,
                drawn,
                planned,
                dated,
                across=across,
                needed=needed,
                narrow=name in narrow,
                open=open_share,
                unheld=_unheld(across, unheld.get(name, 0)),
            )
        )
    return rows


def _unheld(across: float, nodes: int) -> int:
    """Nodes at which fill does not hold walls, in an opening so narrow that they are not those of its edges alone."""
    return nodes if not round(across, 1) >= CELLS_ACROSS_FILL else 0


def _mining(grid: xr.Dataset, rows: list[ExcavationRow], steps: list[dict]) -> Mining:
    """What excavations mine, by the places of these steps; before the first of them: -1; planned ones come last."""
    place = {step["step"]: number for number, step in enumerate(steps)}
    mined = [len(steps) if row.planned else place.get(row.step, -1) for row in rows]
    filled = [
        NEVER if row.fill == "none" or row.planned else when if row.filled_at_once else place.get(row.filled, NEVER)
        for row, when in zip(rows, mined, strict=True)
    ]
    return Mining.of(grid, np.array(mined, int), np.array(filled, int))


def _scheduled(entries: list[dict]) -> list[Scheduled]:
    """Steps in which excavations are mined and filled, one entry for each of a configuration as written."""
    given = [{key: entry[key] for key in Scheduled.model_fields if key in entry} for entry in entries]
    return [Scheduled.of(entry) for entry in given]


def _order(stage: xr.Dataset) -> tuple[bool, int]:
    """Elastic first, whatever step it is numbered as, then the steps."""
    return stage.attrs["stage"] == "step", int(stage.attrs["step_index"])


def shown_catalogues(evidence: Evidence) -> dict:
    """Catalogues that have events to show, by label: the modelled one first."""
    found = {} if evidence.catalog is None else {MODEL_LABEL: evidence.resolved}
    if evidence.record is not None:
        found[evidence.record_label] = evidence.record
    return found if any(catalog.sizes["event"] for catalog in found.values()) else {}


def compared_events(evidence: Evidence, shown: dict) -> dict[str, np.ndarray]:
    """Events (event,) bool, by label of the catalogue, that the comparison counts; all where nothing is compared.

    shown: catalogues by label. All events count, too, if the comparison was made with other catalogues.
    """
    comparison = evidence.comparison
    found = {label: np.ones(catalog.sizes["event"], bool) for label, catalog in shown.items()}
    if comparison is None or not comparison["events_above_cut"].values.all():
        return found
    used = {name: comparison[f"{name}_used"].values == 1 for name in ("model", "record")}
    both = (evidence.catalog, evidence.record)
    if any(one is None or one.sizes["event"] != len(chosen) for one, chosen in zip(both, used.values(), strict=True)):
        return found  # a comparison of other catalogues: a banner says so
    used["model"] = used["model"][evidence.catalog["resolved"].values == 1]
    return {label: used["model" if label == MODEL_LABEL else "record"] for label in shown}


def selection(compared: dict[str, np.ndarray]) -> str:
    """Sentence on how many of the events shown are compared; empty where all are.

    compared: by label of the catalogue, events (event,) bool that are compared.
    """
    if all(chosen.all() for chosen in compared.values()):
        return ""
    counts = [
        f"{whole(chosen.sum())} of {whole(len(chosen))} {label[0].lower()}{label[1:]}"
        for label, chosen in compared.items()
    ]
    return f"{' and '.join(counts)} events are compared: from the cut on, in the time that both catalogues share."
