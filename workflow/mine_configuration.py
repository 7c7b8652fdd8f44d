"""One mine's configuration in SI units: its steps, what each mines, and which runs there are besides its own."""

import copy
import functools
import importlib
import os
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

from mpm_core.constitutive.laws import ELASTIC_MODEL
from mpm_core.scene.far_field import FarField
from mpm_core.scene.scene import FACES
from mpm_core.settings import ElasticMaterial, MaterialSettings
from workflow.mine_settings import Excavation, MineSettings, Step

if TYPE_CHECKING:
    from workflow.schedule import MadeSchedule

BUFFER_CELLS_IN_ELASTIC_ROCK = 4  # Rings of cells around openings that stress between them and the far field needs.


@dataclass
class MineConfiguration:
    """A configuration in SI units (`settings`) and as written (`text`, `default`); paths are relative to `folder`.

    Four lists hold its steps in order:

    | name | holds |
    |---|---|
    | `listed_steps` | steps that the mine file, its source of excavations or its schedule lists |
    | `steps` | the same, after an implicit step `history` if no listed one is undated; `step_index` counts these |
    | `mined_steps` | names of `steps`; none where no step is listed: only elastic.nc is computed then |
    | `dated_steps` | names of the listed steps with dates, whose events enter the catalogue |
    """

    settings: MineSettings
    text: dict
    folder: Path
    default: dict
    steps: list[Step] = field(init=False)
    excavations: list[Excavation] = field(init=False)
    far_field: FarField | None = field(init=False, default=None)  # of a derived domain (workflow/derived_domain.py)
    resized_by: str = field(init=False, default="")  # what has changed the cells: see mpm_core.settings.RESIZED
    realization: int = field(
        init=False, default=0
    )  # number of the ensemble's member: another random field of strength; 0: the mine itself
    requested: str = field(init=False, default="")  # what followed from a request (accuracy), for the user
    asked: dict | None = field(init=False, default=None)  # the request as written
    foreseen: dict | None = field(
        init=False, default=None
    )  # its quote `own`, `half` for half of the error; for what run
    record_mistakes: str = field(init=False, default="")  # of a record that was left out for them
    made_schedule: "MadeSchedule | None" = field(init=False, default=None)  # what section `schedule` makes
    grid_text: str = field(init=False, default="")  # how the grid of its file lies on the map; empty if it is the map
    _number: dict[str, int] = field(init=False)

    def __post_init__(self):
        settings = self.settings
        self.name = settings.name
        self.plane = None if settings.plane == "none" else settings.plane
        self.dimension = 2 if self.plane else 3
        self.listed_steps = settings.steps
        self.excavations = list(settings.excavations)
        if made := settings.excavations_from:
            source = importlib.import_module(f"workflow.mines.{made.source}")
            options = made.model_dump(exclude={"source", "folder"}, exclude_unset=True)
            steps, found = source.schedule(self.path(made.folder), **options)
            self.listed_steps = tuple(Step.of(entry, f"excavations_from: {entry['name']}") for entry in steps)
            self.excavations += [Excavation.of(entry, f"excavations_from: {entry['name']}") for entry in found]
        if settings.schedule:
            from workflow.schedule import make_schedule  # here: what reads tables and drawings takes seconds to import

            self.made_schedule = make_schedule(settings.schedule, self.folder)
            self.listed_steps = tuple(self.made_schedule.steps)
            self.excavations += self.made_schedule.excavations
        has_undated = not all(step.is_dated for step in self.listed_steps)
        implicit = [] if has_undated else [Step(name="history")]
        self.steps = [*implicit, *self.listed_steps]
        self._number = {step.name: index for index, step in enumerate(self.steps)}

    def change(self, section: str, **values: Any) -> None:
        """Give keys of a section other values, which are in SI units and not checked."""
        changed = getattr(self.settings, section).model_copy(update=values)
        self.settings = self.settings.model_copy(update={section: changed})

    def path(self, name: str) -> Path:
        """A path of the configuration, relative to the working directory."""
        return Path(os.path.relpath(self.folder / name))

    def step_index(self, name: str) -> int:
        """Place of a step in order, -1 for one that is not listed."""
        return self._number.get(name, -1)

    def boundary(self) -> dict[str, str]:
        """Condition of each face of the domain."""
        given = self.settings.domain.boundary
        if given is None or isinstance(given, str):
            return dict.fromkeys(FACES, given or "fixed")
        return given.by_face()

    @property
    def has_corners(self) -> bool:
        """True if both corners of the domain are known."""
        return None not in (self.settings.domain.lower, self.settings.domain.upper)

    @property
    def written_cells(self) -> set[str]:
        """Keys among finest_cell, coarse_cell and levels that the mine's file gives; the program derives the others."""
        return {"finest_cell", "coarse_cell", "levels"} & set(self.text.get("grid") or {})

    @property
    def finest_cell(self) -> float:
        """Edge of the finest cells, m."""
        return self.settings.grid.coarse_cell / 2 ** (self.settings.grid.levels - 1)

    @property
    def is_adaptive(self) -> bool:
        """True if cells are refined where rock comes near its strength: they have levels, and particles stay in them.

        A draft has a level more where it keeps the cells of the mine's file."""
        grid = self.settings.grid
        levels = grid.levels + (self.resized_by == "draft")
        return grid.refinement == "adaptive" and levels > 1 and not self.settings.solver.move

    def forecasts(self) -> list[str]:
        """Kept forecasts that the record may score."""
        return [self.path(name).as_posix() for name in self.settings.forecasts]

    def body_materials(self) -> list[str]:
        """Name of the material of each rock body, then of each kind of rock of the block model."""
        names, model = [body.material for body in self.settings.rock_bodies], self.settings.block_model
        return names if model is None else [*names, *map(model.kind_name, model.kinds())]

    def written_rocks(self) -> list[str]:
        """Names of the materials of the mine file that rock may have, each once: the host's first."""
        bodies, model = [body.material for body in self.settings.rock_bodies], self.settings.block_model
        return list(dict.fromkeys(["host", *bodies, *(model.materials() if model else ())]))

    @property
    def members(self) -> int:
        """Number of perturbed members that run besides the mine's own run; 0 for a member."""
        return 0 if self.realization else self.settings.ensemble

    @property
    def plan_members(self) -> int:
        """Number of perturbed members that each plan of the mine runs: as many as hazard.runs asks for at least."""
        return 0 if self.realization else max(self.members, self.settings.hazard.runs - 1)

    def member(self, number: int) -> Self:
        """A member of the ensemble: its steps and events are its own, grid and elastic state are the mine's."""
        member = copy.copy(self)
        member.realization = number
        return member

    def pressure(self, excavation: Excavation) -> list[list]:
        """Pressure in an excavation: [step number, Pa] from when on, in order of steps; none of one that is planned."""
        given = {} if excavation.pressure is None else excavation.pressure
        by_step = given if isinstance(given, dict) else {excavation.step: given}
        return sorted([self.step_index(step), value] for step, value in by_step.items() if self.step_index(step) >= 0)

    def previous(self, step: str) -> str:
        """Name of the step before, empty before the first."""
        index = self.step_index(step)
        return self.steps[index - 1].name if index > 0 else ""

    def schedule(self) -> list[dict]:
        """Name, step, fill and step of filling of every excavation, for the report."""
        return [
            {
                "name": excavation.name,
                "step": excavation.step,
                "fill": excavation.fill_material or "none",
                "filled": excavation.fill_step,
            }
            for excavation in self.excavations
        ]

    @functools.cached_property
    def mined_steps(self) -> list[str]:
        """Names of all steps in order, the implicit history among them; empty if none is listed."""
        return [step.name for step in self.steps] if self.listed_steps else []

    @functools.cached_property
    def dated_steps(self) -> list[str]:
        """Names of the steps whose events enter the catalogue: those with dates."""
        return [step.name for step in self.listed_steps if step.is_dated]

    @property
    def has_companion(self) -> bool:
        """True if the mine is also run on cells of twice the size: as grid_convergence has it, by default in 3-D.

        It needs dated steps and more than one level of cells. Drafts and members of an ensemble have no such run.
        """
        settings = self.settings
        possible = bool(self.dated_steps) and settings.grid.levels > 1 and not self.realization
        requested = self.dimension == 3 if settings.grid_convergence is None else settings.grid_convergence
        return possible and requested and settings.accuracy != "draft"

    def coarser(self) -> Self:
        """Copy of the mine without its finest cells, with grid, states and events of its own.

        The error of an excavation's volume is not limited in the copy: its cells are coarse on purpose.
        """
        companion = copy.copy(self)
        companion.change("grid", levels=self.settings.grid.levels - 1, volume_error=1e9)
        companion.resized_by = "grid_convergence"
        return companion

    def in_elastic_rock(self) -> Self:
        """Copy of the mine in elastic rock, which does not fail, with grid and states of its own.

        Cells are not split where such rock comes near its strength, so there are more of them around openings from the
        start.
        """
        variant = copy.copy(self)
        kept = MaterialSettings.model_fields.keys()
        elastic = {
            name: ElasticMaterial.of(
                {key: value for key, value in rock.given().items() if key in kept} | {"model": ELASTIC_MODEL}
            )
            for name, rock in self.settings.materials.items()
        }
        variant.settings = self.settings.model_copy(update={"materials": elastic})
        variant.change("grid", buffer_cells=max(self.settings.grid.buffer_cells, BUFFER_CELLS_IN_ELASTIC_ROCK))
        variant.change("solver", move=False)
        return variant
