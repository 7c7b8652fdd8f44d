"""The trials of a calibration as mines: what each run computes, and what the fit reads."""

import functools
import os
import sys
from pathlib import Path
from typing import Any

import numpy as np

from calibration.mine_files import with_values
from calibration.settings import CalibrationSettings
from common.errors import InputError, InputErrors
from workflow.configuration import load
from workflow.mine import Mine

FILE_KEYS = ("file", "folder")  # keys of a mine file that hold a path
DRAWS = 5  # mine files that are drawn from the posterior
DOUBLED, OWN = "doubled", "own"  # cells of a trial
MIDDLE = 0.5


class CalibrationTrials:
    """Trials of a mine's calibration, numbered from 1: first replicates in the middle of all ranges, then the design.

    A longer design begins with the shorter one, so that no trial changes its number.
    Nothing is computed before a rule asks for it. A mistake ends the run in one line.
    """

    own_cells = OWN
    mine_files = ("middle", *(f"draw_{number}" for number in range(1, DRAWS + 1)))

    def __init__(self, mine: Mine, mine_file: Path):
        self.mine = mine
        self.mine_file = Path(os.path.relpath(mine_file))

    @functools.cached_property
    def settings(self) -> CalibrationSettings:
        """The section `calibration`."""
        if self.mine.settings.calibration is None:
            sys.exit(
                f"{self.mine_file}: calibration: missing section; say which quantities to calibrate, within which "
                "ranges (docs/how-to/calibration.md)"
            )
        if self.mine.settings.record is None or not self.mine.dated_steps:
            sys.exit(f"{self.mine_file}: record: missing; a calibration needs a record and steps with dates")
        if self.mine.settings.calibration.cells == DOUBLED and self.mine.settings.grid.levels < 2:
            sys.exit(f"{self.mine_file}: calibration.cells: cells of one size cannot be doubled; set it to own")
        return self.mine.settings.calibration

    @functools.cached_property
    def points(self) -> np.ndarray:
        """Points of all trials (trial, quantity) in the unit cube."""
        from calibration.design import sobol_points  # here: runs that calibrate nothing need no scipy

        settings = self.settings
        design = sobol_points(settings.trials, len(settings.quantities), settings.seed)
        middle = np.full((settings.replicates, len(settings.quantities)), MIDDLE)
        return np.concatenate([middle, design])

    @property
    def numbers(self) -> range:
        """Numbers of all trials."""
        return range(1, len(self.points) + 1)

    @property
    def finer(self) -> range:
        """Numbers of the trials that are run on the mine's own cells, too."""
        is_coarse = self.settings.cells == DOUBLED
        first, pairs = self.settings.replicates + 1, min(self.settings.pairs, self.settings.trials)
        return range(first, first + pairs if is_coarse else first)

    def mine_of(self, number: int, cells: str) -> Mine:
        """Configuration of a trial."""
        if number not in self.numbers:
            sys.exit(f"{self.mine.name}: calibration: no trial {number}; there are {len(self.points)}")
        try:
            text = with_values(self.mine.text, self.settings.quantities, self.points[number - 1])
            text = {key: value for key, value in text.items() if key != "calibration"}
            mine = load(text | {"ensemble": 0}, self.mine_file, self.mine.default)
        except InputErrors as error:
            sys.exit("\n".join(f"calibration, trial {number}: {line}" for line in error.lines))
        except InputError as error:
            sys.exit(f"{self.mine_file}: {error}")
        return mine.coarser() if cells == DOUBLED else mine

    def slice_of(self, number: int, cells: str) -> dict:
        """What a trial depends on, for calibration.trial.run_trial."""
        mine = self.mine_of(number, cells)
        run = mine.member(number) if number <= self.settings.replicates else mine
        steps = [
            {"name": step, "scene": run.step_slice(step), "events": run.event_slice(step)} for step in run.mined_steps
        ]
        return {"grid": mine.grid_slice(), "elastic": mine.slice_of("elastic"), "steps": steps}

    def fit_slice(self) -> dict:
        """What the fit depends on, beside trials and record."""
        mine = self.mine
        folder = Path("results", mine.name, "calibration")
        text = {key: value for key, value in mine.text.items() if key != "calibration"}
        return {
            "mine": mine.name,
            "calibration": self.settings.given(),
            "points": self.points.tolist(),
            "steps": [step.model_dump(include={"name", "start", "end"}) for step in mine.listed_steps if step.is_dated],
            "has_history": any(self._mines_something(step.name) for step in mine.listed_steps if not step.is_dated),
            "text": _moved(text, mine.folder, folder),
            "draws": DRAWS,
        }

    def _mines_something(self, step: str) -> bool:
        return any(excavation.step == step for excavation in self.mine.excavations)


def _moved(value: Any, old: Path, new: Path) -> Any:
    """A configuration whose paths, relative to one folder, are made relative to another one."""
    if isinstance(value, dict):
        return {
            key: os.path.relpath(old / entry, new) if key in FILE_KEYS else _moved(entry, old, new)
            for key, entry in value.items()
        }
    return [_moved(entry, old, new) for entry in value] if isinstance(value, list) else value
