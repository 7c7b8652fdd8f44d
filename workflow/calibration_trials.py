"""The trials of a calibration as mines: what each run computes, and what the fit reads."""

import functools
import json
import os
import re
import sys
from pathlib import Path
from typing import Any

import numpy as np

from calibration.mine_files import with_values
from calibration.settings import CalibrationSettings
from common.errors import InputError, InputErrors
from common.job import config_hash, content_hash, content_of, files_of
from common.result_folders import CALIBRATION
from workflow.configuration import load
from workflow.mine import Mine

FILE_KEYS = ("file", "folder")  # keys of a mine file that hold a path
ROCK_DRAWS = 5  # mine files that are drawn from the posterior
DOUBLED, OWN = "doubled", "own"  # cells of a trial
READING_KEYS = ("file", "units", "error", "date", "columns", "since")  # of an instrument, which its places do not need
MIDDLE = 0.5
APART = (0.25, 0.75)  # shares of a range between which a quantity has to change something
EXTRACTIONS = 4  # sets of events of a trial, each with other settings of the section `seismic`, if these are calibrated
BATCH_TRIAL = re.compile(r"batch_(?P<batch>[0-9]+)_(?P<number>[0-9]+)")  # name of a trial of a further batch
TRIAL = "[1-9][0-9]*|batch_[0-9]+_[0-9]+"


class CalibrationTrials:
    """Trials of a mine's calibration: 1, 2, ... are replicates in the middle of all ranges, then the design. Those of
    further batches are called batch_1_1, batch_1_2, ...

    A longer design begins with the shorter one, so that no trial changes its number. Nothing is computed before a rule
    asks for it. A mistake ends the run in one line.
    """

    pattern = TRIAL
    mine_files = ("middle", *(f"draw_{number}" for number in range(1, ROCK_DRAWS + 1)))

    def __init__(self, mine: Mine, mine_file: Path):
        self.mine = mine
        self.mine_file = Path(os.path.relpath(mine_file))
        self.folder = Path("results", mine.name, CALIBRATION)

    @functools.cached_property
    def settings(self) -> CalibrationSettings:
        """The section `calibration`."""
        if self.mine.settings.calibration is None:
            sys.exit(
                f"{self.mine_file}: calibration: missing section; say which quantities to calibrate, within which "
                "ranges (docs/how-to/calibration.md)"
            )
        settings = self.mine.settings.calibration
        if settings.catalogue_terms and (self.mine.settings.record is None or not self.mine.dated_steps):
            sys.exit(
                f"{self.mine_file}: record: missing; a calibration needs a record and steps with dates, or readings of "
                "instruments alone (calibration.terms)"
            )
        if settings.uses_instruments and not self._has_readings():
            sys.exit(
                f"{self.mine_file}: calibration.terms: instruments: no instrument in observations has readings; give "
                "one a file, or leave instruments out"
            )
        if self.mine.settings.calibration.cells == DOUBLED and self.mine.settings.grid.levels < 2:
            sys.exit(f"{self.mine_file}: calibration.cells: cells of one size cannot be doubled; set it to own")
        return self.mine.settings.calibration

    def _has_readings(self) -> bool:
        observations = self.mine.settings.observations
        return observations is not None and any(one.file for one in observations.instruments)

    @property
    def _asked(self) -> CalibrationSettings | None:
        """The section, if there is one; for rules of mines without one."""
        return self.mine.settings.calibration

    @property
    def record(self) -> list[str]:
        """The record, if it counts."""
        counts = self._asked is None or self._asked.catalogue_terms
        return [f"results/{self.mine.name}/record.nc"] if counts else []

    @property
    def readings(self) -> list[str]:
        """The readings of instruments, if they count."""
        counts = self._asked is not None and self._asked.uses_instruments
        return [f"{self.folder.as_posix()}/readings.nc"] if counts else []

    @property
    def record_check(self) -> list[str]:
        """The file of what is asked of the record, if it counts; readings are checked with the mine."""
        return [f"{self.folder.as_posix()}/record.json" for _ in self.record]

    @property
    def figures(self) -> list[str]:
        """Figures of the page."""
        names = ["pairs", *(["predictions", "surrogate"] if self.record else [])]
        return [f"{self.folder.as_posix()}/{name}.svg" for name in [*names, *(["instruments"] * len(self.readings))]]

    def batch_file(self, batch: int | str) -> str:
        """Path of the file with the points of a further batch of trials."""
        return f"{self.folder.as_posix()}/batch_{batch}.json"

    @functools.cached_property
    def points(self) -> np.ndarray:
        """Points of replicates and design (trial, quantity) in the unit cube."""
        from calibration.posterior import sobol_points  # here: runs that calibrate nothing need no scipy

        settings = self.settings
        self._check_effects()
        design = sobol_points(settings.trials, len(settings.quantities), settings.seed)
        middle = np.full((settings.replicates, len(settings.quantities)), MIDDLE)
        return np.concatenate([middle, design])

    def names(self, batch: int = 0) -> list[str]:
        """Names of the trials of replicates and design, or of a further batch."""
        if batch:
            return [f"batch_{batch}_{number}" for number in range(1, self.settings.batch_trials + 1)]
        return [str(number) for number in range(1, len(self.points) + 1)]

    def names_before(self, batch: int) -> list[str]:
        """Names of all trials before a further batch, which is placed by them."""
        return [name for one in range(batch) for name in self.names(one)]

    @property
    def all_names(self) -> list[str]:
        """Names of all trials, in order."""
        return self.names_before(self.settings.batches + 1)

    @property
    def finer(self) -> list[str]:
        """Names of the trials that are run on the mine's own cells, too."""
        if self.settings.cells != DOUBLED:
            return []
        first = self.settings.replicates
        return self.names()[first : first + min(self.settings.pairs, self.settings.trials)]

    def trial_files(self, batch: int, checkpoints: Any) -> list[str]:
        """Files of all trials before a further batch. checkpoints: Snakemake's, which stops here until the points of
        the batches before are known."""
        for number in range(1, batch):
            checkpoints.further.get(batch=number)
        return self._files(self.settings.cells, self.names_before(batch))

    def all_trial_files(self, checkpoints: Any) -> list[str]:
        """Files of all trials; checkpoints as of `trial_files`."""
        return self.trial_files(self.settings.batches + 1, checkpoints)

    def finer_files(self) -> list[str]:
        """Files of the trials on the mine's own cells, if others are on doubled ones."""
        return self._files(OWN, self.finer)

    def _files(self, cells: str, names: list[str]) -> list[str]:
        return [f"{self.folder.as_posix()}/{cells}/{name}.nc" for name in names]

    def rows(self, name: str) -> np.ndarray:
        """Points (row, quantity) in the unit cube at which a trial tells of the mine: one, or EXTRACTIONS of them that
        differ in what changes events only. Ends the run in one line if there is no such trial."""
        from calibration.posterior import sobol_points

        batched = BATCH_TRIAL.fullmatch(name)
        batch, number = (int(batched["batch"]), int(batched["number"])) if batched else (0, int(name))
        if batch > self.settings.batches or name not in self.names(batch):
            sys.exit(f"{self.mine.name}: calibration: no trial {name}; there are {', '.join(self.all_names)}")
        if batch:
            point = np.array(json.loads(Path(self.batch_file(batch)).read_text(encoding="utf-8")))[number - 1]
        else:
            point = self.points[number - 1]
        events_only = [index for index, one in enumerate(self.settings.quantities) if one.changes_events_only]
        if not events_only:
            return point[None]
        rows = np.repeat(point[None], EXTRACTIONS, axis=0)
        # Replicates, too, and by a sequence of their own for each trial.
        drawn = sobol_points(EXTRACTIONS, len(events_only), hash_seed(self.settings.seed, batch, number))
        rows[:, events_only] = drawn
        return rows

    def mine_at(self, name: str, row: np.ndarray, cells: str) -> Mine:
        """Configuration of a trial at one of its points."""
        try:
            return self._loaded(row, cells)
        except InputErrors as error:
            sys.exit("\n".join(f"calibration, trial {name}: {line}" for line in error.lines))
        except InputError as error:
            sys.exit(f"{self.mine_file}: {error}")

    def _loaded(self, row: np.ndarray, cells: str) -> Mine:
        """Configuration at a point. Raises InputError or InputErrors where its values make no mine."""
        text = with_values(self.mine.text, self.settings.quantities, row)
        text = {key: value for key, value in text.items() if key != "calibration"}
        mine = load(text | {"ensemble": 0}, self.mine_file, self.mine.default)
        return mine.coarser() if cells == DOUBLED else mine

    def _check_effects(self) -> None:
        """End the run in one line if a quantity changes no setting that the outputs of a trial depend on."""
        quantities, cells = self.settings.quantities, self.settings.cells
        for number, quantity in enumerate(quantities):
            rows = np.full((2, len(quantities)), MIDDLE)
            rows[:, number] = APART
            try:
                runs = [_of_outputs(self._loaded(row, cells).run_slices()) for row in rows]
            except (InputError, InputErrors):
                continue  # the trials that have such values say so
            if runs[0] == runs[1]:
                sys.exit(
                    f"{self.mine_file}: calibration.quantities[{number}].key: {quantity.key} changes no trial, as no "
                    "run of this mine depends on it; take it off the list, or name a key that the mine uses"
                )

    @functools.cached_property
    def posterior_hash(self) -> str:
        """Hash of what the posterior depends on: quantities and their ranges, trials, the mine but for the values of
        the quantities, its record, and the content of their files."""
        middle = np.full(len(self.settings.quantities), MIDDLE)
        known = {
            "calibration": self.settings.given(),
            "run": self.mine_at("in the middle of all ranges", middle, self.settings.cells).run_slices(),
            "record": self.mine.record_slice() if self.record else {},
            "steps": self._dated_steps(),
        }
        if self.settings.uses_instruments:
            known["readings"] = self.readings_slice()
        files = [content_of(path) for path in files_of(known)]
        return content_hash(config_hash(known) + " ".join(files))

    def _dated_steps(self) -> list[dict]:
        return [step.model_dump(include={"name", "start", "end"}) for step in self.mine.listed_steps if step.is_dated]

    def record_slice(self) -> dict:
        """Settings that the check of the record depends on, besides the record."""
        settings = self.settings
        return {
            "terms": settings.catalogue_terms,
            "complete_above": settings.complete_above,
            "steps": self._dated_steps(),
        }

    def slice_of(self, name: str, cells: str) -> dict:
        """Settings that a trial depends on, those of stage `trial` (workflow/stages/calibration.py)."""
        mines = [self.mine_at(name, row, cells) for row in self.rows(name)]
        mine = mines[0]
        is_replicate = name.isdigit() and int(name) <= self.settings.replicates
        run = mine.member(int(name)) if is_replicate else mine
        slices = run.run_slices(extracted_as=mines)
        return slices | ({"instruments": self._places_slice()} if self.settings.uses_instruments else {})

    def readings_slice(self) -> dict:
        """Settings that the table of readings depends on: instruments with a file."""
        given = self.mine.observations_slice()
        kept = {kind: [one for one in own if "file" in one] for kind, own in given["observations"].items()}
        return given | {"observations": kept}

    def _places_slice(self) -> dict:
        """The same instruments without their readings: a trial does not depend on these."""
        given = self.readings_slice()
        places = {
            kind: [{key: value for key, value in one.items() if key not in READING_KEYS} for one in own]
            for kind, own in given["observations"].items()
        }
        return given | {"observations": places}

    def fit_slice(self, batch: int | None = None) -> dict:
        """Settings that the fit depends on, besides trials and record; with a batch, those of the batch's points."""
        mine = self.mine
        text = {key: value for key, value in mine.text.items() if key not in ("calibration", "forecasts")}
        names = self.all_names if batch is None else self.names_before(batch)
        known = {
            "mine": mine.name,
            "calibration": self.settings.given(),
            "trials": [{"name": name, "kind": self._kind(name), "rows": self.rows(name).tolist()} for name in names],
            "steps": self._dated_steps(),
        }
        if batch is not None:
            return known | {"batch": batch}
        return known | {
            "has_history": any(self._mines_something(step.name) for step in mine.steps if not step.is_dated),
            "text": _moved(text, mine.folder, self.folder),
            "draws": ROCK_DRAWS,
            "posterior": self.posterior_hash,
        }

    def _kind(self, name: str) -> str:
        """Kind of a trial, as calibration.page.Trials names it: replicate, design, or further (of a further batch)."""
        if not name.isdigit():
            return "further"
        return "replicate" if int(name) <= self.settings.replicates else "design"

    def _mines_something(self, step: str) -> bool:
        return any(excavation.step == step for excavation in self.mine.excavations)


def _of_outputs(run: dict) -> dict:
    """Settings of a run without those that only label its events: names and the place of the mine on Earth."""
    labels = ("mine", "frame")
    steps = [
        {**step, "events": [{key: value for key, value in one.items() if key not in labels} for one in step["events"]]}
        for step in run["steps"]
    ]
    return {**run, "steps": steps}


def hash_seed(*numbers: int) -> int:
    """One seed of several numbers."""
    return int(np.random.SeedSequence(numbers).generate_state(1)[0])


def _moved(value: Any, old: Path, new: Path) -> Any:
    """A configuration whose paths, relative to one folder, are made relative to another one."""
    if isinstance(value, dict):
        return {
            key: os.path.relpath(old / entry, new)
            if key in FILE_KEYS and isinstance(entry, str)
            else _moved(entry, old, new)
            for key, entry in value.items()
        }
    return [_moved(entry, old, new) for entry in value] if isinstance(value, list) else value
