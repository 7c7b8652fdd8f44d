"""The mine of a folder of results: the run's own mine or one of its plans, and which run of it.

A run is the mine's own, its coarse companion, it in elastic rock, a member of its ensemble, or one in rock that a
calibration has drawn. The verification adds mines of its own (`Folders.add`): the variants of its studies.

Three words stand for folders below `results` in the modules that rules use:

- `place`: the folder of a whole mine, `demo` or `demo/plans/late`. It is also that of the mine's own run.
- `folder`: the folder of a run, `demo` or `demo/ensemble/2`. The wildcard `mine` of the rules is one.
- `home`: the folder of the run in which a result of a `folder` stands: members and plans share results with others.
"""

import functools
import re
from typing import Protocol

from common.result_folders import ALL_RUNS, COARSE, DRAWN_ROCK, ELASTIC_ROCK, ENSEMBLE, PLANS, SEPARATE_RUNS
from workflow.mine import Mine
from workflow.mine_settings import MINE_FILE_PLAN
from workflow.mining_plans import MiningPlans

NAME = "[A-Za-z0-9][A-Za-z0-9_-]*"
ALL_CORES = 64


class OtherMines(Protocol):
    """Mines other than that of the mine file."""

    pattern: str  # of their folders below results, a regular expression

    def mine_at(self, place: str) -> Mine:
        """The mine of a folder that fits the pattern. Ends the run in one line if there is none."""

    def threads_at(self, place: str) -> int:
        """Threads that the mechanics of this mine may use."""


class Folders:
    """Folders below results, and the mine that each one is of."""

    def __init__(self, mine: Mine, plans: MiningPlans | None = None):
        self.mine = mine
        self.plans = plans
        self.others: OtherMines | None = None
        self.mine_at = functools.cache(self._mine_at)
        self.home = functools.cache(self._home)
        self._stages_alike = functools.cache(self._compared_stages)

    def add(self, others: OtherMines) -> None:
        """Add the folders of other mines."""
        self.others = others

    @property
    def places(self) -> str:
        """Regular expression of the folders of whole mines."""
        own = re.escape(self.mine.name)
        plans = f"(?:/{PLANS}/(?:{'|'.join(self.plans.others)}))?" if self.plans and self.plans.others else ""
        return f"{own}{plans}|{self.others.pattern}" if self.others else f"{own}{plans}"

    @property
    def pattern(self) -> str:
        """Regular expression of the wildcard `mine`: a mine's folder, or that of one of its other runs."""
        return f"({self.places})(/(?:{SEPARATE_RUNS}))?"

    @property
    def pattern_with_coarse(self) -> str:
        """Regular expression of the wildcard `mine`, folders of companions (cells of twice the size) included."""
        return f"({self.places})(/(?:{ALL_RUNS}))?"

    def parts(self, folder: str) -> tuple[str, str]:
        """Folder of the whole mine, and which run is meant: ensemble/<number>, coarse, elastic_rock,
        drawn_rock/<number>, or "": its own."""
        found = re.fullmatch(f"({self.places})/?({ALL_RUNS}|)", folder)
        assert found, f"{folder} is no folder of a mine"  # the wildcard `mine` matches no other
        return found[1], found[2]

    def plan_of(self, place: str) -> str:
        """Name of the plan whose folder this is; of a mine that was added the empty text."""
        if place == self.mine.name:
            return MINE_FILE_PLAN
        return (
            place.removeprefix(f"{self.mine.name}/{PLANS}/") if place.startswith(f"{self.mine.name}/{PLANS}/") else ""
        )

    def place_of(self, plan: str) -> str:
        """Folder of a plan below results."""
        return self.mine.name if plan == MINE_FILE_PLAN else f"{self.mine.name}/{PLANS}/{plan}"

    def _mine_at(self, folder: str) -> Mine:
        """Configuration behind results/<folder>."""
        place, part = self.parts(folder)
        plan = self.plan_of(place)
        kind, _, number = part.partition("/")
        if self.plans and plan:
            mine = self.plans.drawn(plan, int(number)) if kind == DRAWN_ROCK else self.plans.mine_of(plan)
        else:
            mine = self.mine if self.others is None or plan else self.others.mine_at(place)
        if kind == COARSE:
            return mine.coarser()
        if kind == ELASTIC_ROCK:
            return mine.in_elastic_rock()
        return mine.member(int(number)) if kind == ENSEMBLE else mine

    def _home(self, folder: str, stage: str) -> str:
        """Folder below results where a stage of a folder's mine has its result, "grid" or "steps/2019-08" for example.

        Members of an ensemble have the grid and the elastic state of their mine. A plan has the results of the mine
        file's plan, or of an earlier one, as far as nothing differs in what they depend on.
        """
        place, part = self.parts(folder)
        if part.startswith(ENSEMBLE) and stage in ("grid", "elastic"):
            return self._home(place, stage)
        if part.startswith(DRAWN_ROCK) and self._is_alike(folder, place, stage):
            return self._home(place, stage)
        if self.plans and place != self.mine.name and self.plan_of(place):
            earlier = [MINE_FILE_PLAN, *self.plans.others[: self.plans.others.index(self.plan_of(place))]]
            has_it = not part.startswith(ENSEMBLE) or int(part.split("/")[1]) <= self.mine.plan_members
            for plan in earlier if has_it else ():
                same = f"{self.place_of(plan)}/{part}".rstrip("/")
                if self._is_alike(folder, same, stage):
                    return self.home(same, stage)
        return folder

    def _is_alike(self, folder: str, other: str, stage: str) -> bool:
        """True if the mines of two folders agree in all settings that a stage and the stages before it depend on."""
        kind, _, step = stage.partition("/")
        if kind != "events":
            return stage in self._stages_alike(folder, other)
        mines = self.mine_at(folder), self.mine_at(other)
        return self._is_alike(folder, other, f"steps/{step}") and mines[0].slice_of(stage) == mines[1].slice_of(stage)

    def _compared_stages(self, folder: str, other: str) -> frozenset[str]:
        """Stages of the mechanics, "grid" to "steps/<step>", before the first in which the mines of two folders
        differ."""
        mines = self.mine_at(folder), self.mine_at(other)
        alike = set()
        for stage, twin in zip(*map(_mechanics, mines), strict=False):
            if stage != twin or mines[0].slice_of(stage) != mines[1].slice_of(stage):
                break
            alike.add(stage)
        return frozenset(alike)

    def threads(self, folder: str) -> int:
        """Threads of a stage of the mechanics: all of them, unless the folder's mine is small."""
        place, _ = self.parts(folder)
        return ALL_CORES if self.others is None or self.plan_of(place) else self.others.threads_at(place)


def _mechanics(mine: Mine) -> list[str]:
    """Stages of the mechanics of a mine, in order."""
    return ["grid", "elastic", *(f"steps/{step}" for step in mine.mined_steps)]
