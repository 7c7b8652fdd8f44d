"""The results of a mine, and the results that each rule reads. Rules call these functions with their wildcards."""

import os
import sys
from collections.abc import Callable, Iterable

from snakemake.iocontainers import Wildcards

from common.result_folders import COARSE, ENSEMBLE
from workflow.folders import Folders
from workflow.mine import Mine


def stage_results(place: str, mine: Mine, has_events: bool = True) -> list[str]:
    """Results of all stages of a mine and of its ensemble up to their events, below results/<place>."""
    runs = ["", *(f"{ENSEMBLE}/{number}/" for number in range(1, mine.members + 1))]
    steps = [f"{run}steps/{step}.nc" for run in runs for step in mine.mined_steps]
    events = [f"{run}events" for run in runs if has_events and mine.mined_steps]
    return [f"results/{place}/{file}" for file in ["grid.nc", "elastic.nc", *steps, *events]]


class ResultFiles:
    """Results of the run's own mine, and inputs of rules for any mine."""

    def __init__(self, folders: Folders):
        self.folders = folders
        self.mine = folders.mine
        self.has_catalog = bool(self.mine.dated_steps)
        self.has_quakeml = self.has_catalog and self.mine.settings.frame.has_place
        self.has_record = self.has_catalog and self.mine.settings.record is not None
        self.has_coarse = self.mine.has_companion
        self.has_observations = bool(self.mine.mined_steps) and self.mine.settings.observations is not None
        self.has_loading = bool(self.mine.mined_steps) and self.mine.settings.loading_measures is not None
        self.has_scans = self.has_observations and bool(self.mine.scan_steps)
        self.has_forecasts = self.has_record and bool(self.mine.settings.forecasts)
        self.has_shaking = self.has_catalog and self.mine.settings.ground_motion is not None

    def own(self, path: str) -> str:
        """A result of the run's own mine."""
        return f"results/{self.mine.name}/{path}"

    def own_states(self, steps: Iterable[str]) -> list[str]:
        """States of some steps of the run's own mine, in order."""
        return [self.own(f"steps/{step}.nc") for step in steps]

    def if_recorded(self, path: str) -> str | list[str]:
        """A result of the run's own mine, if it has a record."""
        return self.own(path) if self.has_record else []

    def failed_rock_for_shaking(self) -> str | list[str]:
        """The table of openings, if demands on support take the depth of failed rock from it."""
        motion = self.mine.settings.ground_motion
        return self.own("openings.nc") if motion is not None and motion.failed_depth else []

    def comparisons(self) -> dict[str, str]:
        """Files of the run's own comparisons, by name: comparison, spread, grid_convergence, forecast_scores."""
        made = {
            "comparison": self.has_record,
            "spread": self.has_catalog and self.mine.members,
            "grid_convergence": self.has_coarse,
            "forecast_scores": self.has_forecasts,
        }
        return {name: self.own(f"{name}.nc") for name in made if made[name]}

    @property
    def compared(self) -> list[str]:
        """Files of `comparisons`."""
        return list(self.comparisons().values())

    def all(self) -> list[str]:
        """The files of all stages, so that a missing intermediate file is made again although the report exists."""
        made = {
            "report.html": True,
            "figures": True,
            "catalog.nc": self.has_catalog,
            "catalog.csv": self.has_catalog,
            "event_rules.nc": self.has_catalog,
            "source_parameters.nc": self.has_catalog,
            "catalog.xml": self.has_quakeml,
            "record.nc": self.has_record,
            "openings.csv": bool(self.mine.mined_steps),
            "observations.csv": self.has_observations,
            "loading.csv": self.has_loading,
            "scans.csv": self.has_scans,
            "shaking.nc": self.has_shaking,
            "shaking.csv": self.has_shaking,
        }
        files = [self.own(file) for file in made if made[file]]
        return [*stage_results(self.mine.name, self.mine), *files, *self.compared]

    def mine_of(self, wildcards: Wildcards) -> Mine:
        """Configuration behind results/{mine}, or of the run's own mine."""
        return self.folders.mine_at(getattr(wildcards, "mine", self.mine.name))

    def step_of(self, wildcards: Wildcards) -> str:
        """Name of the step. Ends the run in one line if the mine does not list it."""
        steps = self.mine_of(wildcards).mined_steps
        if wildcards.step not in steps:
            sys.exit(f"{wildcards.mine}: steps: no '{wildcards.step}'; there are {', '.join(steps) or 'none'}")
        return wildcards.step

    def result(self, folder: str, stage: str) -> str:
        """The result of a stage of a folder's mine, where it stands: members and plans share some."""
        return f"results/{self.folders.home(folder, stage)}/{stage}.nc"

    def grid(self, wildcards: Wildcards) -> str:
        """The grid of a mine."""
        return self.result(wildcards.mine, "grid")

    def grid_of_any(self, wildcards: Wildcards) -> str:
        """The grid of a mine, or of its companion."""
        folder = getattr(wildcards, "mine", self.mine.name)
        return f"results/{folder}/grid.nc" if is_coarse(folder) else self.result(folder, "grid")

    def previous_state(self, wildcards: Wildcards) -> str:
        """The state that a step starts from: the step before, or the elastic history."""
        before = self.mine_of(wildcards).previous(self.step_of(wildcards))
        return self.result(wildcards.mine, f"steps/{before}" if before else "elastic")

    def states(self, wildcards: Wildcards) -> list[str]:
        """The states that all steps end in, in order."""
        return [self.result(wildcards.mine, f"steps/{step}") for step in self.mine_of(wildcards).mined_steps]

    def dated_states(self, wildcards: Wildcards) -> list[str]:
        """States of the dated steps, in order."""
        return [self.result(wildcards.mine, f"steps/{step}") for step in self.mine_of(wildcards).dated_steps]

    def member_events(self) -> list[str]:
        """Folders of the events of the members of the own mine's ensemble; empty without one."""
        return [self.own(f"{ENSEMBLE}/{number}/events") for number in range(1, self.mine.members + 1)]

    def member_states(self) -> list[str]:
        """States of the dated steps of the members of the own mine's ensemble."""
        members = range(1, self.mine.members + 1)
        return [
            self.own(f"{ENSEMBLE}/{number}/steps/{step}.nc") for number in members for step in self.mine.dated_steps
        ]

    def made_by(self, stage: str) -> Callable[[Wildcards], str]:
        """Function of wildcards that returns the output of the rule for `stage`: the path of a file or its folder."""

        def made(wildcards: Wildcards) -> str:
            own = stage.format(**wildcards)
            path = f"results/{wildcards.mine}/{own}.nc"
            in_folder = own.startswith("events/") or (is_coarse(wildcards.mine) and own.startswith("steps/"))
            return os.path.dirname(path) if in_folder else path

        return made


def is_coarse(folder: str) -> bool:
    """True if a folder is that of a companion (cells of twice the size), whose stages are one job."""
    return folder.rsplit("/", 1)[-1] == COARSE
