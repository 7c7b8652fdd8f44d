"""The mining plans of a mine: the sequence of its file, and others that change it, each a mine of its own."""

import copy
import functools
import os
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from snakemake.utils import update_config

from calibration.mine_files import copied_values, is_draw_of
from common.errors import InputError, InputErrors
from common.result_folders import CALIBRATION
from workflow.calibration_trials import CalibrationTrials
from workflow.configuration import load
from workflow.mine import Mine
from workflow.mine_settings import MINE_FILE_PLAN, MiningPlan
from workflow.strict_yaml import read_yaml

# Sections of a mine file that no plan uses: the record and all that is compared with it, and what the mine's own
# file says of plans.
OTHER_SECTIONS = (
    "plans",
    "calibration",
    "baselines",
    "record",
    "comparison",
    "face",
    "forecasts",
    "hazard",
    "observations",
)


class MiningPlans:
    """Plans by name, that of the mine file first.

    Nothing is looked at before a rule asks for it. A mistake ends the run in one line.
    """

    def __init__(self, mine: Mine, mine_file: Path, overrides: Mapping | None = None):
        self.mine = mine
        self.mine_file = Path(os.path.relpath(mine_file))
        self.overrides = dict(overrides or {})
        self.others = tuple(mine.settings.plans)
        self.mine_of = functools.cache(self._mine_of)
        self.drawn = functools.cache(self._drawn)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of all plans."""
        return (MINE_FILE_PLAN, *self.others)

    @property
    def pattern(self) -> str:
        """Regular expression of the names."""
        return "|".join(self.names)

    def _mine_of(self, name: str) -> Mine:
        """The mine of a plan."""
        if name == MINE_FILE_PLAN:
            return self.mine
        return self._loaded(name, *self._written(name))

    def _drawn(self, name: str, draw: int) -> Mine:
        """The mine of a plan in the rock that a draw from the posterior of the calibration has."""
        calibration = self.mine.settings.calibration
        path = Path("results", self.mine.name, CALIBRATION, f"draw_{draw}.yaml")
        if calibration is None or not path.is_file():
            sys.exit(f"{self.mine_file}: hazard.rock: there is no {path}; run `snakemake calibrate` first")
        if not is_draw_of(path, CalibrationTrials(self.mine, self.mine_file).posterior_hash):
            sys.exit(
                f"{self.mine_file}: hazard.rock: {path} is of another calibration than this file asks for (other "
                "quantities, ranges, record or mine), or was changed since; delete it and run `snakemake calibrate` "
                "again"
            )
        text, file = self._written(name)
        try:
            text = copied_values(text, read_yaml(path), calibration.quantities)
        except InputError as error:
            sys.exit(f"{self.mine_file}: plans.{name}, draw {draw}: {error}")
        return self._loaded(f"{name}, draw {draw}", text, file)

    def _written(self, name: str) -> tuple[dict, Path]:
        """Configuration of a plan as written, and the file that its paths are relative to."""
        text = {key: value for key, value in self.mine.text.items() if key not in OTHER_SECTIONS}
        if name == MINE_FILE_PLAN:
            return text, self.mine_file
        plan = self.mine.settings.plans[name]
        if plan.file is None:
            return changed(text, plan), self.mine_file
        file, text = self.mine.path(plan.file), copy.deepcopy(self.mine.default)
        try:
            update_config(text, read_yaml(file))
        except InputError as error:
            sys.exit(f"{self.mine_file}: plans.{name}.file: {error}")
        update_config(text, self.overrides)
        return {key: value for key, value in text.items() if key not in OTHER_SECTIONS}, file

    def _loaded(self, name: str, text: dict, file: Path) -> Mine:
        try:
            return load(text | {"name": self.mine.name}, file, self.mine.default, self.overrides)
        except InputErrors as error:
            sys.exit("\n".join(f"plans.{name}: {line}" for line in error.lines))


def changed(text: Mapping[str, Any], plan: MiningPlan) -> dict:
    """A copy of a mine's configuration with the changes of a plan. An excavation that the configuration lacks is left
    out: the mine's checks have refused it."""
    result = copy.deepcopy(dict(text))
    changes = plan.excavations or {}
    for entry in result.get("excavations", ()):
        if change := changes.get(str(entry.get("name"))):
            entry |= change.given()
    steps = {str(step["name"]): step for step in result.get("steps", ())}
    steps |= {step.name: step.given() for step in plan.steps or ()}
    if steps:
        result["steps"] = list(steps.values())
    return result
