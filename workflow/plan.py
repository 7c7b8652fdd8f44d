"""One mine's configuration in SI units: its steps, what each mines, and which runs there are beside its own."""

import copy
import importlib
import os
from dataclasses import dataclass, field
from pathlib import Path
from typing import Self

from mpm_core.scene.far_field import FarField
from mpm_core.scene.scene import FACES


@dataclass
class Plan:
    """A configuration in SI units (`values`) and as written (`text`, `default`); its paths are relative to `folder`."""

    values: dict
    text: dict
    folder: Path
    default: dict
    steps: list[dict] = field(init=False)
    excavations: list[dict] = field(init=False)
    far_field: FarField | None = field(init=False, default=None)  # of a derived domain (workflow/derived_domain.py)
    perturbation: int = field(init=False, default=0)  # number of the ensemble's member, 0: the mine itself
    _number: dict[str, int] = field(init=False)

    def __post_init__(self):
        values = self.values
        self.name = values["name"]
        self.plane = None if values["plane"] == "none" else values["plane"]
        self.dimension = 2 if self.plane else 3
        self.listed_steps = values.get("steps", [])
        undated = [step for step in self.listed_steps if "start" not in step]
        implicit = [] if undated else [{"name": "history"}]
        self.steps = implicit + self.listed_steps
        self._number = {step["name"]: index for index, step in enumerate(self.steps)}
        self.excavations = list(values.get("excavations", []))
        if "excavations_from" in values:
            made = dict(values["excavations_from"])
            source = importlib.import_module(f"workflow.mines.{made.pop('source')}")
            self.excavations += source.excavations(self.path(made.pop("folder")), **made)

    def path(self, name: str) -> Path:
        """A path of the configuration, relative to the working directory."""
        return Path(os.path.relpath(self.folder / name))

    @property
    def has_place(self) -> bool:
        """Whether the frame says where on Earth the mine is: QuakeML cannot do without, all else can."""
        return bool(set(self.values["frame"]) - {"surface"})

    def step_index(self, name: str) -> int:
        """Place of a step in order, -1 for one that is not listed."""
        return self._number.get(name, -1)

    def boundary(self) -> dict[str, str]:
        """Condition of each face of the domain."""
        given = self.values["domain"].get("boundary", "fixed")
        if isinstance(given, str):
            return dict.fromkeys(FACES, given)
        return {face: given.get(face, given.get(face[0], given.get("others", "fixed"))) for face in FACES}

    @property
    def has_corners(self) -> bool:
        """Whether both corners of the domain are known."""
        return {"lower", "upper"} <= set(self.values.get("domain", {}))

    @property
    def written_cells(self) -> set[str]:
        """Which sizes of cells the mine's file gives: finest_cell, coarse_cell, levels; the others are ours."""
        return {"finest_cell", "coarse_cell", "levels"} & set(self.text.get("grid") or {})

    @property
    def finest_cell(self) -> float:
        """Edge of the finest cells, m."""
        grid = self.values["grid"]
        return grid["coarse_cell"] / 2 ** (grid["levels"] - 1)

    @property
    def is_adaptive(self) -> bool:
        """Whether cells follow the rock: where there are levels of them, and particles stay in their cells.
        A draft has a level more where it keeps the cells of the mine's file."""
        grid = self.values["grid"]
        levels = grid["levels"] + (grid.get("resized_by") == "draft")
        return grid["refinement"] == "adaptive" and levels > 1 and not self.values["solver"]["move"]

    def solids(self) -> list[str]:
        """Files that the grid is built from."""
        entries = [*self.excavations, *self.values.get("rock_bodies", [])]
        return [self.path(entry["file"]).as_posix() for entry in entries if "file" in entry]

    def bodies(self) -> list[str]:
        """Files of rock bodies."""
        return [self.path(entry["file"]).as_posix() for entry in self.values.get("rock_bodies", []) if "file" in entry]

    @property
    def members(self) -> int:
        """How many perturbed members run beside the mine's own run; a member has none."""
        return 0 if self.perturbation else self.values["ensemble"]

    def member(self, number: int) -> Self:
        """A member of the ensemble: its steps and events are its own, grid and elastic state are the mine's."""
        member = copy.copy(self)
        member.perturbation = number
        return member

    def pressure(self, entry: dict) -> list[list]:
        """Pressure in an excavation: [step number, Pa] from when on, in order of steps; none of one that is planned."""
        given = entry.get("pressure", {})
        by_step = given if isinstance(given, dict) else {entry["step"]: given}
        return sorted([self.step_index(step), value] for step, value in by_step.items() if self.step_index(step) >= 0)

    def previous(self, step: str) -> str:
        """Name of the step before, empty before the first."""
        index = self.step_index(step)
        return self.steps[index - 1]["name"] if index > 0 else ""

    def schedule(self) -> list[dict]:
        """Name, step, fill and step of filling of every excavation, for the report."""
        return [
            {
                "name": entry["name"],
                "step": entry["step"],
                "fill": entry.get("fill", "none"),
                "filled": entry.get("filled", entry["step"]),
            }
            for entry in self.excavations
        ]

    @property
    def mined_steps(self) -> list[str]:
        """Names of the steps that the configuration lists, in order; without any the scene stops at elastic.nc."""
        return [step["name"] for step in self.steps] if self.listed_steps else []

    @property
    def dated_steps(self) -> list[str]:
        """Names of the steps whose events enter the catalogue."""
        return [step["name"] for step in self.listed_steps if "start" in step]

    @property
    def has_companion(self) -> bool:
        """Whether it is run on cells of twice the size, too: as configured, else in 3-D with dated steps and levels.
        A draft is not."""
        possible = bool(self.dated_steps) and self.values["grid"]["levels"] > 1 and not self.perturbation
        possible = possible and self.values["accuracy"] != "draft"
        return possible and self.values.get("grid_convergence", self.dimension == 3)

    def coarser(self) -> Self:
        """The same mine without its finest cells: grid, states and events of its own.

        What of an excavation's volume cells of this size miss is no error here, were it all: they are meant to be
        coarse.
        """
        companion = copy.copy(self)
        grid = self.values["grid"]
        coarse = {"levels": grid["levels"] - 1, "volume_error": 1e9, "resized_by": "grid_convergence"}
        companion.values = self.values | {"grid": grid | coarse}
        return companion
