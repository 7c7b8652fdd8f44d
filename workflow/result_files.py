"""The results of a mine, and the results that each rule reads. Rules call these functions with their wildcards."""

import sys

from snakemake.iocontainers import Wildcards

from catalogs.records import READERS
from workflow.folders import COARSE, DRAWN_ROCK, ELASTIC_ROCK, ENSEMBLE, PLANS, Folders
from workflow.mine import Mine
from workflow.mine_settings import MINE_FILE_PLAN
from workflow.mining_plans import CALIBRATION

PLAN_PAGES = ("report.html", "plans.csv")
BASELINES = "baselines"  # folder below results/<mine>
BASELINE_FILES = (
    *(f"{name}{part}.nc" for name in ("flaws", "excess_shear") for part in ("", "_runs")),
    *("record.nc", "report.html", "scores.csv", "months.csv", "rates.csv"),
)
CATALOGUES = ("catalog.nc", "catalog.csv", "catalog.xml", "closeness.nc")


def stage_results(place: str, mine: Mine, folders: tuple[str, ...] = ("steps", "events")) -> list[str]:
    """Files of all stages of a mine and of its ensemble up to their events, below results/<place>."""
    runs = ["", *(f"{ENSEMBLE}/{number}/" for number in range(1, mine.members + 1))]
    steps = [f"{run}{folder}/{step}.nc" for run in runs for folder in folders for step in mine.mined_steps]
    return [f"results/{place}/{file}" for file in ["grid.nc", "elastic.nc", *steps]]


class ResultFiles:
    """Results of the run's own mine, and inputs of rules for any mine."""

    def __init__(self, folders: Folders):
        self.folders = folders
        self.mine = folders.mine
        self.has_catalog = bool(self.mine.dated_steps)
        self.has_quakeml = self.has_catalog and self.mine.settings.frame.has_place
        self.has_record = self.has_catalog and self.mine.settings.record is not None
        self.has_coarse = self.mine.has_companion
        self.has_forecasts = self.has_record and bool(self.mine.settings.forecasts)

    def own(self, path: str) -> str:
        """A result of the run's own mine."""
        return f"results/{self.mine.name}/{path}"

    def own_steps(self, folder: str) -> list[str]:
        """One file for each listed step of the run's own mine, in order."""
        return [self.own(f"{folder}/{step}.nc") for step in self.mine.mined_steps]

    def all(self) -> list[str]:
        """The files of all stages, so that a missing intermediate file is made again although the report exists."""
        made = {
            "report.html": True,
            "catalog.nc": self.has_catalog,
            "catalog.csv": self.has_catalog,
            "closeness.nc": self.has_catalog,
            "catalog.xml": self.has_quakeml,
            "record.nc": self.has_record,
            "comparison.nc": self.has_record,
            "forecast_scores.nc": self.has_forecasts,
            "spread.nc": self.mine.members,
            "grid_convergence.nc": self.has_coarse,
        }
        return stage_results(self.mine.name, self.mine) + [self.own(file) for file in made if made[file]]

    def planned(self) -> list[str]:
        """All results that the mine's plan may leave: `all`, those of the companion, and what is made on request."""
        files = [*self.all(), self.own("twin.csv")]
        places = [f"{self.mine.name}/{ENSEMBLE}/{number}" for number in range(1, self.mine.members + 1)]
        if self.has_coarse:
            places.append(f"{self.mine.name}/{COARSE}")
            files += stage_results(places[-1], self.mine.coarser())
        if self.has_record:
            files += stage_results(f"{self.mine.name}/{ELASTIC_ROCK}", self.mine, ("steps",))
            files += [self.own(f"{BASELINES}/{name}") for name in BASELINE_FILES]
        files += [f"results/{place}/{file}" for place in places for file in CATALOGUES]
        # A shorter design keeps the trials of a longer one; what a plan has of its own depends on the mine file's.
        plans = [f"{PLANS}/{name}/" for name in (MINE_FILE_PLAN, *self.mine.settings.plans)]
        whole = [f"{CALIBRATION}/", f"{DRAWN_ROCK}/", *plans, *(f"{PLANS}/{name}" for name in PLAN_PAGES)]
        return files + [self.own(path) for path in whole]

    def record_data(self) -> str | list[str]:
        """The file that the record is read from. A folder's reader finds its own files."""
        if not self.has_record or READERS[self.mine.settings.record.reader].READS_FOLDER:
            return []
        return self.mine.record_slice()["file"]

    def mine_of(self, wildcards: Wildcards) -> Mine:
        """Configuration behind results/{mine}."""
        return self.folders.mine_at(wildcards.mine)

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

    def state(self, wildcards: Wildcards) -> str:
        """The state that a step ends in."""
        return self.result(wildcards.mine, f"steps/{wildcards.step}")

    def previous_state(self, wildcards: Wildcards) -> str:
        """The state that a step starts from: the step before, or the elastic history."""
        before = self.mine_of(wildcards).previous(self.step_of(wildcards))
        return self.result(wildcards.mine, f"steps/{before}" if before else "elastic")

    def solids(self, wildcards: Wildcards) -> list[str]:
        """Files that the grid is built from."""
        return self.mine_of(wildcards).solids()

    def bodies(self, wildcards: Wildcards) -> list[str]:
        """Files of rock bodies, which a step samples again in the cells that it splits."""
        mine = self.mine_of(wildcards)
        return mine.bodies() if mine.is_adaptive else []

    def events(self, wildcards: Wildcards) -> list[str]:
        """Events of the dated steps, in order; of all listed ones if none has dates."""
        mine = self.mine_of(wildcards)
        return [f"results/{wildcards.mine}/events/{step}.nc" for step in mine.dated_steps or mine.mined_steps]

    def dated_steps(self, wildcards: Wildcards) -> list[str]:
        """States of the dated steps, in order."""
        return [f"results/{wildcards.mine}/steps/{step}.nc" for step in self.mine_of(wildcards).dated_steps]

    def coarse_dated_steps(self, wildcards: Wildcards) -> list[str]:
        """States of the dated steps of the companion on cells of twice the size."""
        return [f"results/{wildcards.mine}/{COARSE}/steps/{step}.nc" for step in self.mine_of(wildcards).dated_steps]

    def runs(self, wildcards: Wildcards) -> list[str]:
        """Folders of the runs of an ensemble: the mine's own, then the members."""
        members = range(1, self.mine_of(wildcards).members + 1)
        return [f"results/{wildcards.mine}", *(f"results/{wildcards.mine}/{ENSEMBLE}/{number}" for number in members)]

    def dated_results(self, wildcards: Wildcards) -> list[str]:
        """What the spread of an ensemble is read from: steps and events of all dated steps of all runs."""
        steps, folders = self.mine_of(wildcards).dated_steps, ("steps", "events")
        return [f"{run}/{folder}/{step}.nc" for run in self.runs(wildcards) for folder in folders for step in steps]

    def member_events(self, wildcards: Wildcards) -> list[str]:
        """Events of all dated steps of the members of an ensemble; empty without one."""
        steps = self.mine_of(wildcards).dated_steps
        return [f"{run}/events/{step}.nc" for run in self.runs(wildcards)[1:] for step in steps]

    def comparison(self, wildcards: Wildcards) -> str | list[str]:
        """The comparison with the record, if there is one."""
        return self.own("comparison.nc") if self.has_record and wildcards.mine == self.mine.name else []
