"""The present state of a stage, next to its output: a stage that was killed goes on from there, to the same bytes.

Written between two generations of failure, where nothing is under way. It is no output that Snakemake knows of, which
deletes the outputs of a killed stage; a stage that ends removes it.
"""

import hashlib
import logging
import time
import zipfile
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from common.costs import CLOCK
from common.datasets import atomic_path, clear_parts
from mpm_core.equilibrium.convergence import HISTORY_COLUMNS, History
from mpm_core.grid.mesh import MultiLevelGrid
from mpm_core.model.occupancy import Unsupported
from mpm_core.model.state import Extent, State, changed_in

MIN_SECONDS_BETWEEN_CHECKPOINTS = 30.0  # A checkpoint is written at least this long after the one before.
MAX_WRITING_SHARE = 0.015  # Largest share of a stage's time that writing checkpoints may take.
OF_FAILED, UNCHANGED = changed_in(Extent.FAILED), changed_in(Extent.NONE)
COUNTERS = (  # of history
    *("increment", "generation", "iteration", "tightened", "splits", "load", "load_before", "size"),
    *("equilibrium_increment", "equilibrium_load"),
)


def key_of(provenance: dict[str, str], *inputs: Path) -> str:
    """Key of what a checkpoint belongs to: configuration, sources and versions, and the bytes of the stage's input
    files."""
    digest = hashlib.sha256(repr(sorted(provenance.items())).encode())
    for path in inputs:
        with Path(path).open("rb") as file:
            digest.update(hashlib.file_digest(file, "sha256").digest())
    return digest.hexdigest()


@dataclass
class Checkpoint:
    """The file and what it belongs to (see key_of); `pause` s between two of them.

    Which generations are saved depends on the clock; what follows from any of them does not.
    """

    path: Path
    key: str
    pause: float = MIN_SECONDS_BETWEEN_CHECKPOINTS
    last: float = field(default_factory=time.perf_counter)
    cost: float = 0.0

    def save(
        self,
        state: State,
        history: History,
        grid: MultiLevelGrid,
        in_step_subdomain: bool = False,
        places: Sequence[np.ndarray] = (),
        full: bool = False,
        fallen: Unsupported | None = None,
        displacement_before: np.ndarray | None = None,
        start: np.ndarray | None = None,
    ) -> None:
        """Write state, the cells that it has, and the convergence table, if it is time to.

        in_step_subdomain: True if they are those of the step's subdomain; places (k, d) each: what was split, full:
        whether no more may be; fallen: what has fallen in this step; displacement_before (node, d) m: at its start
        (step_cells.py); start (node, d) m: where displacement is counted from in the check for a run away (body.py).
        """
        now = time.perf_counter()
        if now - self.last < max(self.pause, self.cost / MAX_WRITING_SHARE):
            return
        counters = {name: getattr(history, name) for name in COUNTERS}
        with atomic_path(self.path) as temporary, temporary.open("wb") as file:
            tables = _named("table_", history.table()) | _named("rest_", history.last_equilibrium)
            failed = np.flatnonzero(state.failed >= 0)
            of_failed = {name: getattr(state, name)[failed] for name in OF_FAILED}
            others = {name: value for name, value in vars(state).items() if name not in (*OF_FAILED, *UNCHANGED)}
            split = np.concatenate([np.empty((0, grid.dimension), np.int64), *places])
            cells: dict[str, Any] = {"cells_index": grid.cell_index, "cells_level": grid.cell_level}
            cells |= {"in_step_subdomain": in_step_subdomain, "places": split, "full": full}
            cells |= _named("fallen_", vars(fallen or Unsupported.none()))
            if displacement_before is not None:
                cells["displacement_before"] = displacement_before
            if start is not None:
                cells["start"] = start
            np.savez(file, key=self.key, taken=CLOCK.taken(), **counters | cells | others | of_failed | tables)
        self.last = time.perf_counter()
        self.cost = self.last - now

    def read(self) -> dict[str, np.ndarray]:
        """All that is saved, by name; nothing where there is none of this stage, whole."""
        try:
            with np.load(self.path, allow_pickle=False) as saved:
                if str(saved["key"]) != self.key:
                    logging.info("%s is of other inputs; the stage starts from its beginning", self.path)
                    return {}
                return {name: saved[name] for name in saved.files}
        except FileNotFoundError:
            return {}
        except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile) as error:
            logging.warning("%s is not readable (%s); the stage starts from its beginning", self.path, error)
            return {}

    @staticmethod
    def restore(values: dict[str, np.ndarray], state: State, history: History) -> None:
        """Put what was read back into a state on the saved cells, and into the history, in place; time goes on, too."""
        CLOCK.go_on(values["taken"])
        failed = np.flatnonzero(values["failed"] >= 0)
        for name, array in vars(state).items():
            if name in UNCHANGED:
                continue
            if name in OF_FAILED:
                array[failed] = values[name]
            elif isinstance(array, np.ndarray):
                array[:] = values[name]
            else:
                setattr(state, name, values[name].item())
        for name in COUNTERS:
            setattr(history, name, values[name].item())
        history.last_equilibrium = {name: values[f"rest_{name}"] for name in vars(state) if f"rest_{name}" in values}
        columns = [values[f"table_{name}"].tolist() for name in HISTORY_COLUMNS]
        history.rows = list(zip(*columns, strict=True))
        logging.info(
            "going on from increment %d, generation %d, iteration %d",
            history.increment, history.generation, history.iteration,
        )  # fmt: skip

    def remove(self) -> None:
        """The stage has ended: nothing of it stays, nor what a kill has left of one half written."""
        self.path.unlink(missing_ok=True)
        clear_parts(self.path)


def _named(prefix: str, arrays: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    return {prefix + name: array for name, array in arrays.items()}
