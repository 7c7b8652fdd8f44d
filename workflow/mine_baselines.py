"""The baselines of a mine: which states they are made from, and the slices of their stages."""

import functools
import os
import sys
from pathlib import Path

from baselines.settings import BaselineSettings
from common.costs import cost_of, duration_text
from common.result_folders import BASELINES, ELASTIC_ROCK
from mpm_core.constitutive.laws import can_fail
from workflow.mine import Mine

SMALLEST_RADIUS, LARGEST_RADIUS = 0.5, 6.0  # radii of flaws over the edge of the finest cell, where none are given
CATALOGUES = ("flaws", "excess_shear")
STRENGTH = ("friction_angle", "cohesion")


class MineBaselines:
    """States and slices of the baselines of a mine.

    Nothing is looked at before a rule asks for it. A mine that can have no baselines ends the run in one line.
    """

    def __init__(self, mine: Mine, mine_file: Path):
        self.mine = mine
        self.mine_file = Path(os.path.relpath(mine_file))
        self._has_told = False

    @functools.cached_property
    def settings(self) -> BaselineSettings:
        """The section `baselines`."""
        mine = self.mine
        if mine.settings.record is None or not mine.dated_steps:
            sys.exit(f"{self.mine_file}: record: missing; baselines need a record and steps with dates")
        if mine.dimension != 3:
            sys.exit(f"{self.mine_file}: plane: {mine.plane}; baselines need a mine in three dimensions, plane: none")
        return mine.settings.baselines

    @functools.cached_property
    def strength(self) -> dict[str, dict[str, float]]:
        """Strength of the flaws in each rock that can fail: that of the section, else the rock's residual one."""
        rocks = {name: self.mine.settings.materials[name] for name in ["host", *self.mine.body_materials()]}
        found: dict[str, dict[str, float]] = {}
        for name, rock in rocks.items():
            if not can_fail(rock):
                continue
            for key in STRENGTH:
                own = getattr(rock, key, None)
                value = getattr(self.settings, key)
                if value is None and own is not None:
                    value = own.residual
                if value is None:
                    sys.exit(
                        f"{self.mine_file}: {BASELINES}.{key}: missing key; it does not follow from materials.{name}, "
                        f"whose law is {rock.model}"
                    )
                found.setdefault(name, {})[key] = value
        if not found:
            sys.exit(f"{self.mine_file}: materials: no rock can fail, so there are no flaws that slip in it")
        return found

    def states(self) -> list[str]:
        """States of the mine in elastic rock, in order; the dated steps are the last ones."""
        assert self.settings  # a mine without record ends here
        names = ["elastic", *(f"steps/{step}" for step in self.mine.mined_steps)]
        return [f"results/{self.mine.name}/{ELASTIC_ROCK}/{name}.nc" for name in names]

    def own_states(self) -> list[str]:
        """States of the mine itself that measures follow from: of the dated steps, and the one before them."""
        names = ["elastic", *(f"steps/{step}" for step in self.mine.mined_steps)]
        return [f"results/{self.mine.name}/{name}.nc" for name in names[-len(self.mine.dated_steps) - 1 :]]

    def tell_cost(self) -> None:
        """Print once, to stderr, which jobs the page needs that are not made yet, and about how long they take.

        An elastic state takes as long as the mine's own one, each baseline as long as in its last run.
        """
        if self._has_told:
            return
        self._has_told = True
        name = self.mine.name
        made = [("{} elastic states", self.states(), f"logs/{name}/elastic.log")] + [
            (one, [f"results/{name}/{BASELINES}/{one}_runs.nc"], f"logs/{name}/{BASELINES}/{one}.log")
            for one in CATALOGUES
        ]
        parts = []
        for what, files, log in made:
            if missing := sum(not Path(file).is_file() for file in files):
                cost = cost_of(log)
                time = f"about {duration_text(missing * cost.next_seconds)}" if cost else "time not known yet"
                parts.append(f"{what.format(missing)} ({time})")
        if parts:
            own = sum(not Path(f"results/{name}/steps/{step}.nc").is_file() for step in self.mine.mined_steps)
            first = f"; first {own} steps of the mine itself" if own else ""
            print(f"{name}: baselines need {', '.join(parts)}{first}", file=sys.stderr)

    def excess_shear_slice(self) -> dict:
        """Settings that catalogues of excess shear stress depend on, besides states, record and comparison."""
        mine, settings = self.mine, self.settings
        chosen = mine.settings.record.filter
        box = {} if chosen is None else {"lower": chosen.lower, "upper": chosen.upper}
        return {
            "mine": mine.name,
            "strength": self.strength,
            "steps": mine.comparison_slice()["steps"],
            "seed": settings.seed,
            **{key: list(corner) for key, corner in box.items() if corner is not None},
        }

    def flaws_slice(self) -> dict:
        """Settings that catalogues of seeded flaws depend on, besides states, record and comparison. Radii in m."""
        settings, cell = self.settings, self.mine.finest_cell
        radii = settings.radii or (SMALLEST_RADIUS * cell, LARGEST_RADIUS * cell)
        return self.excess_shear_slice() | {"radii": list(radii), "exponent": settings.exponent}

    def report_slice(self) -> dict:
        """Settings that the page of the baselines depends on, besides catalogues, comparison and record."""
        self.tell_cost()
        planned = [entry.name for entry in self.mine.excavations if self.mine.step_index(entry.step) < 0]
        compared = {key: value for key, value in self.mine.comparison_slice().items() if key != "members"}
        since, complete_above = self.settings.since, self.settings.complete_above
        return {
            "mine": self.mine.name,
            "comparison": compared,
            "planned": planned,
            "drives": self._drives(),
            "flaws": self.flaws_slice(),
            "box": self._box(),
            **({"since": since} if since else {}),
            **({"complete_above": complete_above} if complete_above is not None else {}),
            **(self._place() if self.has_place else {}),
        }

    def _drives(self) -> list[dict]:
        """Excavations that are mined: when, and the points along those whose shape has an axis."""
        path = {one["name"]: one.get("path") for one in self.mine.openings_slice()["excavations"]}
        return [
            opening | ({"path": path[opening["name"]]} if path[opening["name"]] else {})
            for opening in self.mine.mined_openings()
        ]

    @property
    def has_place(self) -> bool:
        """True if the mine has a place on Earth, which forecasts for pyCSEP need."""
        return self.mine.settings.frame.has_place

    def _place(self) -> dict:
        """Place of the mine on Earth, and top and bottom of its domain, m below sea level."""
        domain = self.mine.settings.domain
        return {"frame": self.mine.settings.frame.given(), "depths": [-domain.upper[2], -domain.lower[2]]}

    def _box(self) -> list[list[float]]:
        """Lower and upper corner in plan of the box that the record is taken from, within the domain, m."""
        chosen, domain = self.mine.settings.record.filter, self.mine.settings.domain
        lower, upper = ([corner] for corner in (domain.lower, domain.upper))
        if chosen is not None:
            lower += [chosen.lower] if chosen.lower is not None else []
            upper += [chosen.upper] if chosen.upper is not None else []
        return [
            [max(axis) for axis in zip(*lower, strict=True)][:2],
            [min(axis) for axis in zip(*upper, strict=True)][:2],
        ]

    def earlier_record(self) -> str:
        """The record that earlier months are taken from: read once more from an earlier date on, or the mine's own."""
        folder = f"results/{self.mine.name}"
        return (
            f"{folder}/record.nc" if self.mine.settings.baselines.since is None else f"{folder}/{BASELINES}/record.nc"
        )

    def earlier_record_slice(self) -> dict:
        """Settings that the record since the date `since` depends on."""
        slice_, since = self.mine.record_slice(), self.settings.since
        chosen = {key: value for key, value in slice_.pop("filter", {}).items() if key != "start"}
        return slice_ | {"period": slice_["period"] | {"start": since}, **({"filter": chosen} if chosen else {})}
