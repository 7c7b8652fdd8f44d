"""Runs of each plan, paths of their results, and settings that their stages depend on, for the rules of the plans."""

import os
import sys
from pathlib import Path

from common.costs import cost_of, duration_text
from common.result_folders import COARSE, DRAWN_ROCK, ENSEMBLE, PLANS
from workflow.calibration_trials import ROCK_DRAWS
from workflow.checks import why_members_are_alike
from workflow.mine_settings import MINE_FILE_PLAN
from workflow.result_files import ResultFiles

OUTCOME = "outcome.nc"
SHAKING = "shaking.nc"
LOADING = "loading.nc"
OPENINGS, OPENING_RUNS = "openings.nc", "opening_runs.nc"
COARSE_RUN = "coarse"  # kind of a run on cells of twice the size
POSTERIOR = "posterior"
TITLE_OF_MINE_FILE = "As the mine file has it"
# Sections of a mine file that runs depend on, beside the sequence.
ROCK_AND_CELLS = (
    "accuracy",
    "frame",
    "domain",
    "grid",
    "insitu_stress",
    "materials",
    "rock_bodies",
    "block_model",
    "loads",
    "strains",
    "solver",
    "seismic",
)


class PlanOutcomes:
    """Runs and slices of the plans of the run's own mine.

    Nothing is looked at before a rule asks for it. Plans are checked three times, each time with a line for a mistake:

    - When the mine file is read, their names and what they change (workflow/comparison_checks.py).
    - When the mine of a plan is first asked for, its whole configuration (`MiningPlans.mine_of`).
    - When the plans are to be compared, that all of them can be (`checked_names`).
    """

    def __init__(self, files: ResultFiles, mine_file: Path):
        self.files = files
        self.folders = files.folders
        self.mine = files.mine
        self.mine_file = Path(os.path.relpath(mine_file))
        self._has_told = False

    @property
    def checked_names(self) -> tuple[str, ...]:
        """Names of the plans, that of the mine file first. Ends the run in one line if they cannot be compared."""
        mine = self.mine
        if not mine.dated_steps:
            sys.exit(f"{self.mine_file}: steps: none has dates; plans are compared by dated steps")
        if mine.dimension != 3:
            sys.exit(f"{self.mine_file}: plane: {mine.plane}; plans need a mine in three dimensions, plane: none")
        if mine.plan_members and (reason := why_members_are_alike(mine)):
            sys.exit(f"{self.mine_file}: hazard.runs: {reason}, or set hazard.runs to 1")
        for name, plan in mine.settings.plans.items():
            if plan.file is not None:
                self._check_file(name)
        assert self.folders.plans is not None  # the rules give them
        return self.folders.plans.names

    def _check_file(self, name: str) -> None:
        """End the run in one line, before its mechanics, if the mine of another file can be no plan."""
        plan = self.folders.mine_at(self.folders.place_of(name))
        reason = ""
        if not plan.dated_steps:
            reason = "steps: none has dates; plans are compared by dated steps"
        elif plan.dimension != 3:
            reason = f"plane: {plan.plane}; plans need a mine in three dimensions, plane: none"
        elif self.mine.has_companion and plan.settings.grid.levels < 2:
            reason = "grid.levels: 1; the mine file has runs on cells of twice the size, which need 2 or more"
        if reason:
            sys.exit(f"{self.mine_file}: plans.{name}.file: {self.mine.settings.plans[name].file}: {reason}")

    def differs_in(self, plan: str) -> list[str]:
        """Sections in which the file of a plan differs from the mine file, beside steps and excavations."""
        mines = self.mine, self.folders.mine_at(self.folders.place_of(plan))
        # as written, since a derived domain follows from excavations; and in SI units, since these can be written twice
        return [
            section
            for section in ROCK_AND_CELLS
            if mines[0].text.get(section) != mines[1].text.get(section)
            and getattr(mines[0].settings, section) != getattr(mines[1].settings, section)
        ]

    def outcome(self, plan: str) -> str:
        """Result of a plan: what its runs release."""
        return self.files.own(f"{PLANS}/{plan}/{OUTCOME}")

    def outcomes(self) -> list[str]:
        """Results of all plans, in order. Says once what they cost."""
        if not self._has_told:
            self._has_told = True
            self.tell_cost()
        return [self.outcome(plan) for plan in self.checked_names]

    def tell_cost(self) -> None:
        """Print which jobs of mechanics the plans need that are not made yet, and how long these take, to stderr.

        Each takes as long as those of its kind that the mine itself has run. Nothing is printed where none is missing.
        """
        mine, logs = self.mine, Path("logs") / self.mine.name
        runs = [run for plan in self.checked_names for run in self.runs(plan)]
        folders = [folder for kind, folder in runs if kind != COARSE_RUN]
        coarse = [f"results/{folder}/catalog.nc" for kind, folder in runs if kind == COARSE_RUN]
        steps = [
            self.files.result(folder, f"steps/{step}")
            for folder in folders
            for step in self.folders.mine_at(folder).mined_steps
        ]
        jobs = [
            (stage, [self.files.result(folder, result) for folder in folders], [logs / f"{result}.log"])
            for stage, result in (("grid{}", "grid"), ("elastic state{}", "elastic"))
        ]
        jobs.append(("step{}", steps, [logs / "steps" / f"{step}.log" for step in mine.mined_steps]))
        jobs.append(("run{} on cells of twice the size", coarse, [logs / f"{COARSE}.log"]))
        parts = []
        for stage, files, logs_of_stage in jobs:
            if missing := sum(not Path(file).is_file() for file in set(files)):
                known = [cost.next_seconds for log in logs_of_stage if (cost := cost_of(log))]
                time = f"about {duration_text(missing * sum(known) / len(known))}" if known else "time not known yet"
                parts.append(f"{missing} more {stage.format('s' if missing > 1 else '')} ({time})")
        if parts:
            print(
                f"{mine.name}: plans: {len(self.checked_names)} plans with {1 + mine.plan_members} runs each "
                f"(hazard.runs, ensemble) need {', '.join(parts)}",
                file=sys.stderr,
            )

    def runs(self, plan: str) -> list[tuple[str, str]]:
        """Kind (plans.settings.RunFiles) and folder of each run of a plan."""
        place, mine = self.folders.place_of(plan), self.mine
        members = range(1, mine.plan_members + 1)
        found = [("own", place), *(("member", f"{place}/{ENSEMBLE}/{number}") for number in members)]
        if mine.has_companion:
            found.append((COARSE_RUN, f"{place}/{COARSE}"))
        if mine.settings.hazard.rock == POSTERIOR:
            found += [("draw", f"{place}/{DRAWN_ROCK}/{number}") for number in range(1, ROCK_DRAWS + 1)]
        return found

    def _results(self, folder: str, kind: str) -> list[str]:
        """Events or states of the dated steps of a run."""
        return [self.files.result(folder, f"{kind}/{step}") for step in self.folders.mine_at(folder).dated_steps]

    def _run_files(self, plan: str) -> list[dict]:
        return [
            {"kind": kind, "events": self._results(folder, "events"), "states": self._results(folder, "steps")}
            for kind, folder in self.runs(plan)
        ]

    def _recorded_runs(self) -> list[dict]:
        if not self.files.has_record:
            return []
        return [{"kind": one["kind"], "events": one["events"]} for one in self._run_files(MINE_FILE_PLAN)]

    def _recorded_states(self) -> list[str]:
        """States of the mine's own run in its dated steps, if it has a record."""
        place = self.folders.place_of(MINE_FILE_PLAN)
        return self._results(place, "steps") if self.files.has_record else []

    def _compared_runs(self, plan: str) -> list[dict]:
        """Runs of the other plans, each plan's own first. Plans may share files of events."""
        others = [other for other in self.checked_names if other != plan]
        return [{"kind": run["kind"], "events": run["events"]} for other in others for run in self._run_files(other)]

    def results(self, plan: str) -> list[str]:
        """All that the outcome of a plan is made from, beside grid, record and comparison: states, folders of events.

        The states of a companion are in a folder, too.
        """
        runs = [*self._run_files(plan), *self._compared_runs(plan), *self._recorded_runs()]
        found = [os.path.dirname(path) for run in runs for path in run["events"]]
        for run in runs:
            is_coarse = run["kind"] == "coarse"
            found += [os.path.dirname(path) if is_coarse else path for path in run.get("states", ())]
        return list(dict.fromkeys([*found, *self._recorded_states()]))

    def grid(self, plan: str) -> str:
        """The grid of a plan's own run."""
        return self.files.result(self.folders.place_of(plan), "grid")

    def elastic(self, plan: str) -> str:
        """The elastic state of a plan's own run."""
        return self.files.result(self.folders.place_of(plan), "elastic")

    def states(self, plan: str) -> list[str]:
        """States of all steps of a plan's own run, in order."""
        place = self.folders.place_of(plan)
        return [self.files.result(place, f"steps/{step}") for step in self.folders.mine_at(place).mined_steps]

    def outcome_slice(self, plan: str) -> dict:
        """Settings that the outcome of a plan depends on, besides the content of files."""
        mine = self.folders.mine_at(self.folders.place_of(plan))
        hazard = self.mine.settings.hazard.given()
        differs = self.differs_in(plan)
        recorded, compared = self._recorded_runs(), self._compared_runs(plan)
        states = self._recorded_states()
        return {
            "mine": mine.name,
            "plan": plan,
            "steps": mine.comparison_slice()["steps"],
            "openings": mine.mined_openings(),
            # names of likelihoods are read by the page alone, and `runs` names the runs
            "hazard": {key: value for key, value in hazard.items() if key not in ("likelihoods", "runs")},
            "shear_modulus": self.mine.settings.materials["host"].shear_modulus,
            "runs": self._run_files(plan),
            **({"differs_in": differs} if differs else {}),
            **({"compared_runs": compared} if compared else {}),
            **({"recorded_steps": self.mine.comparison_slice()["steps"]} if recorded else {}),
            **({"recorded_runs": recorded} if recorded else {}),
            **({"recorded_states": states} if states else {}),
        }

    def _opening_runs(self, plan: str) -> list[dict]:
        """The plan's own run and its members, with the states and events of all of its steps."""
        found = []
        for kind, folder in self.runs(plan):
            if kind in ("own", "member"):
                steps = self.folders.mine_at(folder).mined_steps
                states, events = (
                    [self.files.result(folder, f"{part}/{step}") for step in steps] for part in ("steps", "events")
                )
                found.append({"kind": kind, "states": states, "events": events})
        return found

    def openings_slice(self, plan: str) -> dict:
        """Settings that the openings of a plan depend on, besides the content of files."""
        mine = self.folders.mine_at(self.folders.place_of(plan))
        return mine.openings_slice() | {"plan": plan, "runs": self._opening_runs(plan)}

    def opening_results(self, plan: str) -> list[str]:
        """States and folders of events that the openings of a plan are made from."""
        runs = self._opening_runs(plan)
        files = [path for run in runs for path in (*run["states"], *map(os.path.dirname, run["events"]))]
        return list(dict.fromkeys(files))

    def openings(self) -> list[str]:
        """Openings of all plans after their last steps, in order."""
        return [self.files.own(f"{PLANS}/{plan}/{OPENING_RUNS}") for plan in self.checked_names]

    def failed_rock(self, plan: str) -> str | list[str]:
        """Table of openings of a plan, if demands on support take the depth of failed rock from it."""
        motion = self.mine.settings.ground_motion
        asked = motion is not None and motion.failed_depth
        return self.files.own(f"{PLANS}/{plan}/{OPENINGS}") if asked else []

    def shaking_slice(self, plan: str) -> dict:
        """Settings that the shaking of a plan depends on: ground motion and support of the mine file, and steps and
        openings of the plan."""
        mine = self.folders.mine_at(self.folders.place_of(plan))
        return self.mine.shaking_slice() | {
            "mine": mine.name,
            "density": mine.settings.materials["host"].density,
            "steps": mine.comparison_slice()["steps"],
            "openings": mine.mined_openings(),
        }

    def shaking(self) -> list[str]:
        """Shaking of all plans, in order; none where the mine file asks for no ground motion."""
        if self.mine.settings.ground_motion is None:
            return []
        return [self.files.own(f"{PLANS}/{plan}/{SHAKING}") for plan in self.checked_names]

    def loading_slice(self, plan: str) -> dict:
        """Settings that the loading measures of a plan depend on: measures and planes of the mine file, and steps and
        openings of the plan."""
        mine = self.folders.mine_at(self.folders.place_of(plan))
        return mine.loading_slice() | {"loading_measures": self.mine.loading_slice()["loading_measures"]}

    def loading(self) -> list[str]:
        """Loading measures of all plans, in order; none where the mine file asks for none."""
        if not self.files.has_loading:
            return []
        return [self.files.own(f"{PLANS}/{plan}/{LOADING}") for plan in self.checked_names]

    def report_slice(self) -> dict:
        """Settings that the page of the plans depends on, besides the outcomes of the plans."""
        hazard = {key: value for key, value in self.mine.settings.hazard.given().items() if key != "runs"}
        titles = {name: plan.title for name, plan in self.mine.settings.plans.items() if plan.title is not None}
        return {"mine": self.mine.name, "hazard": hazard, "titles": {MINE_FILE_PLAN: TITLE_OF_MINE_FILE} | titles}
