"""One mine's configuration cut into the slice that each stage depends on.

A slice holds only what its stage needs, so that changing a value re-runs only what it changes. An excavation that is
not mined yet is the same in a slice whether it is planned or dated later: giving a planned stope its month runs
that month.
"""

import functools
import math
from collections.abc import Iterator, Sequence
from contextlib import suppress
from operator import itemgetter
from pathlib import Path
from typing import Self

from catalogs.records import elk_creek_reader
from common.errors import InputError
from mpm_core.constitutive.laws import variability_of
from mpm_core.settings import PlacedSolid, ShapeSettings, SolidSettings
from response.scan_settings import ObservedScan
from response.settings import MIN_SLENDERNESS
from workflow.dates import read_date
from workflow.face_positions import face_positions
from workflow.mine_configuration import MineConfiguration
from workflow.mine_settings import BoundaryStrain, Excavation, Load

GRID_KEYS = {"coarse_cell", "levels", "buffer_cells", "cut_cells", "volume_error"}
SHAPE_KEYS = set(ShapeSettings.model_fields)


def shape_keys(solid: ShapeSettings) -> dict:
    """The keys of an excavation, rock body or load that define its shape or file, as plain values."""
    return solid.model_dump(mode="json", include=SHAPE_KEYS, exclude_unset=True)


def _axis(shape: dict) -> list | None:
    """Ends of a cylinder that is long enough for a drive or a shaft; None for other shapes."""
    if shape.get("shape") != "cylinder":
        return None
    length = math.dist(shape["start"], shape["end"])
    return [shape["start"], shape["end"]] if length >= MIN_SLENDERNESS * 2.0 * shape["radius"] else None


class Mine(MineConfiguration):
    """A mine's configuration, and its slices."""

    def grid_slice(self) -> dict:
        """Settings of stage `grid`: shapes, cells, the domain; no material, and of steps what the first one mines."""
        settings = self.settings
        grid = settings.grid.model_dump(mode="json", include=GRID_KEYS, exclude_unset=True)
        later = [number for number, entry in enumerate(self.excavations) if self.step_index(entry.step) != 0]
        return {
            "name": self.name,
            "plane": self.plane,
            "thickness": settings.thickness,
            "domain": self._corners(),
            "grid": {**grid, **({"resized_by": self.resized_by} if self.resized_by else {})},
            "excavations": [self._shape(excavation) for excavation in self.excavations],
            "rock_bodies": [{**self._shape(body), "refine": body.refine} for body in settings.rock_bodies],
            **self._blocks(),
            **({"later": later} if later and self.is_adaptive else {}),
            **({"far_field": self.expected()} if self.far_field else {}),
        }

    def _blocks(self) -> dict:
        """The block model of a slice, if the mine has one: its file as a path from the working directory, and the grid
        of the file."""
        model, grid = self.settings.block_model, self.settings.frame.grid
        if model is None:
            return {}
        made = {**model.given(), "file": self.path(model.file).as_posix(), **({"grid": grid.given()} if grid else {})}
        return {"blocks": made}

    def _corners(self) -> dict:
        """Corners of the domain, m."""
        return self.settings.domain.model_dump(mode="json", include={"lower", "upper"})

    def _shape(self, solid: SolidSettings) -> dict:
        """Name and shape of a solid, its file as a path from the working directory, and the grid of the file."""
        made, grid = shape_keys(solid), self.settings.frame.grid
        if solid.outside:
            made["outside"] = True
        if "file" in made:
            made["file"] = self.path(made["file"]).as_posix()
            made |= {"grid": grid.given()} if grid else {}
        if made.pop("closed_at_ground", False):
            made["closed_at"] = self.settings.frame.surface
        return {"name": solid.name, **made}

    def placed(self, solid: SolidSettings) -> PlacedSolid:
        """A solid as slices have it: its file as a path from the working directory, and the grid of the file."""
        return PlacedSolid.of(self._shape(solid))

    def expected(self) -> dict:
        """Distance and expected error of a derived domain."""
        return {key: getattr(self.far_field, key) for key in ("distance", "error", "radius", "limited")}

    def solids_slice(self) -> dict:
        """Settings of stage `vtk_solids`: those of the grid, and the index of each excavation's step, or -1."""
        return self.grid_slice() | {"mined": [self.step_index(entry.step) for entry in self.excavations]}

    def mechanics_slice(self, last: int) -> dict:
        """What the mechanics up to step number `last` depend on, as mpm_core.scene.scene.parse_scene reads it.

        With 0 it is the settings of stage `elastic`.
        """
        excavations = [self._excavation(entry, last) for entry in self.excavations]
        strains = [strain for strain in self._strains if strain["since"] <= last]
        return {
            **self._constant_settings(),
            "materials": self._materials({entry["fill"] for entry in excavations}),
            "excavations": excavations,
            "loads": [load for load in self._loads if load["since"] <= last],
            **({"strains": strains} if strains else {}),
            "steps": [{"name": step.name} for step in self.steps[: last + 1]],  # rock knows no dates
        }

    def _constant_settings(self) -> dict:
        """What the mechanics of every step depend on alike."""
        settings = self.settings
        return {
            "name": self.name,
            "plane": self.plane,
            "thickness": settings.thickness,
            "particles_per_cell": round(settings.grid.particles_per_cell ** (1 / self.dimension)),
            "cut_cells": settings.grid.cut_cells,
            "boundary": self.boundary(),
            "surface": settings.frame.surface,
            "insitu_stress": self._insitu_stress(),
            "rock_bodies": [{"material": name} for name in self.body_materials()],
            **({"refinement": self._refinement()} if self.is_adaptive else {}),
            **({"realization": self.realization} if self.realization else {}),
            "solver": settings.solver.given(),
        }

    def _materials(self, fills: set[str | None]) -> dict[str, dict]:
        """Materials of the rock and of some fills, in the order of their names."""
        used = {"host", *self.body_materials(), *fills}
        return {name: rock.given() for name, rock in sorted(self.settings.materials.items()) if name in used}

    def _excavation(self, entry: Excavation, last: int) -> dict:
        """What the mechanics up to step number `last` depend on of an excavation."""
        mined, filled = self.step_index(entry.step), self.step_index(entry.fill_step)
        placed = entry.fill_material is not None and 0 <= filled <= last
        pressure = [pair for pair in self.pressure(entry) if mined <= pair[0] <= last]
        return {
            "name": entry.name,
            "mined": mined if mined <= last else -1,
            "fill": entry.fill_material if placed else None,
            "filled": filled if placed else -1,
            **({"pressure": pressure} if pressure else {}),
        }

    @functools.cached_property
    def _loads(self) -> list[dict]:
        """Loads in the order of the steps that they begin in."""

        def load(entry: Load) -> dict:
            return {
                "name": entry.name,
                "since": self.step_index(entry.step),
                **entry.model_dump(mode="json", include={"force", "toward"}, exclude_unset=True),
                "shape": shape_keys(entry),
            }

        return sorted(map(load, self.settings.loads), key=itemgetter("since"))

    @functools.cached_property
    def _strains(self) -> list[dict]:
        """Boundary strains in the order of the steps that they begin in."""

        def strain(entry: BoundaryStrain) -> dict:
            return {"name": entry.name, "since": self.step_index(entry.step), "strain": entry.strain.voigt()}

        return sorted(map(strain, self.settings.strains), key=itemgetter("since"))

    @functools.cached_property
    def _changes_by_step(self) -> list[dict[str, list[dict]]]:
        """What each step changes: of excavations, by their numbers, and which loads and strains begin.

        The first step changes nothing: the elastic state has all that begins with it.
        """
        found: list[dict[str, list[dict]]] = [{"excavations": [], "loads": [], "strains": []} for _ in self.steps]
        for number, entry in enumerate(self.excavations):
            for step, change in self._changes(entry):
                entries = found[step]["excavations"]
                if entries and entries[-1]["number"] == number:
                    entries[-1].update(change)
                elif step > 0:
                    entries.append({"number": number} | change)
        for name, begun in (("loads", self._loads), ("strains", self._strains)):
            for one in begun:
                if one["since"] > 0:
                    found[one["since"]][name].append(one)
        return found

    def _changes(self, entry: Excavation) -> Iterator[tuple[int, dict]]:
        """Numbers of the steps that change the mechanics' settings of an excavation, and what each changes."""
        mined, filled = self.step_index(entry.step), self.step_index(entry.fill_step)
        if mined >= 0:
            yield mined, {"mined": mined}
        if entry.fill_material is not None and filled >= 0:
            yield filled, {"fill": entry.fill_material, "filled": filled}
        for since, value in self.pressure(entry):
            if since >= mined:
                yield since, {"pressure": [[since, value]]}

    def _insitu_stress(self) -> dict[str, list[float]]:
        """Stress at frame.surface, Pa, and its change per metre of depth, Pa/m, in Voigt order."""
        stress = self.settings.insitu_stress
        return {name: stress.voigt(name) for name in ("constant", "gradient")}

    def _refinement(self) -> dict:
        """Settings of adaptive refinement that the grid depends on: buffer rings, limit of cells, rock bodies."""
        grid = self.settings.grid
        bodies = [self._shape(body) for body in self.settings.rock_bodies]
        return {"rings": grid.buffer_cells, "max_cells": grid.max_cells, "bodies": bodies, **self._blocks()}

    def step_slice(self, step: str) -> dict:
        """Settings of stage `step`: what steps/<step>.nc depends on besides the state of the step before.

        They hold what the step changes; mpm_core.scene.step_settings adds it to the settings that the state was made
        with.
        """
        number = self.step_index(step)
        changes = self._changes_by_step[number]
        return {
            **self._constant_settings(),
            "materials": self._materials({entry.get("fill") for entry in changes["excavations"]}),
            **changes,
            "step": {"name": step, "number": number},
        }

    def picture_slice(self) -> dict:
        """Settings of stage `scene`, a picture: of every step its name, whether it has dates, what it mines; those of
        the record, if there is one to compare with, or why it is left out."""
        mined: dict[str, list[str]] = {step.name: [] for step in self.steps}
        for entry in self.excavations:
            if entry.step in mined:
                mined[entry.step].append(entry.name)
        steps = [{"name": step.name, "dated": step.is_dated, "excavations": mined[step.name]} for step in self.steps]
        has_record = bool(self.dated_steps) and self.settings.record is not None
        if self.record_mistakes:
            return {"steps": steps, "record_mistakes": self.record_mistakes}
        return {"steps": steps} | ({"record": self.record_slice()} if has_record else {})

    def catalogue_slice(self) -> dict:
        """Settings of stage `catalogue`: those of section `seismic`, and where the mine is."""
        settings = self.settings
        flat = {"thickness": settings.thickness} if self.plane else {}
        return {"mine": self.name, "frame": settings.frame.given(), **flat, **settings.seismic.given()}

    def step_events_slice(self, step: str) -> dict:
        """Settings that a step's events depend on, besides its state: those of the catalogue, and the step's dates."""
        return self.catalogue_slice() | self._dates(step)

    def events_slice(self) -> dict:
        """Settings of stage `events`: what the events of all steps depend on, beside their states."""
        steps = [{"name": name, "dates": self._dates(name)} for name in self.mined_steps]
        return {"seismic": self.catalogue_slice(), "steps": steps}

    def _dates(self, step: str) -> dict[str, str]:
        """First date of a step, and the first one after it; empty texts where it has none."""
        own = self.steps[self.step_index(step)]
        return {"start": own.start or "", "end": own.end or ""}

    def spread_slice(self) -> dict:
        """Settings that spread.nc depends on, besides the runs of the ensemble."""
        return {
            "mine": self.name,
            "members": self.members,
            "variability": max(share for share, _ in map(variability_of, self.settings.materials.values())),
            "steps": self.dated_steps,
        }

    def convergence_slice(self) -> dict:
        """Settings that grid_convergence.nc depends on, besides the runs on cells of both sizes."""
        return {"mine": self.name, "steps": self.dated_steps, "cells": [self.finest_cell, 2 * self.finest_cell]}

    def comparison_slice(self) -> dict:
        """Settings that comparison.nc depends on, besides the two catalogues and the events of the members."""
        return {
            **self.settings.comparison.given(),
            "steps": [step.given() for step in self.listed_steps if step.is_dated],
            **({"members": self.members} if self.members else {}),
            **({"face": positions} if (positions := face_positions(self)) else {}),
        }

    def forecast_slice(self) -> dict:
        """Settings that forecast_scores.nc depends on, besides the record and the grid.

        Kept forecasts have no rule that makes them again, so they are known by their content (common.job).
        """
        return {
            "mine": self.name,
            "forecasts": [{"file": path} for path in self.forecasts()],
            "steps": [step.given() for step in self.listed_steps if step.is_dated],
            "openings": self.mined_openings(),
        }

    def shaking_slice(self) -> dict:
        """Settings that shaking.nc depends on, besides the events of the runs, the grid and the comparison."""
        settings = self.settings
        motion = settings.ground_motion.given()
        if "file" in motion["relation"]:
            motion["relation"]["file"] = self.path(motion["relation"]["file"]).as_posix()
        return {
            "mine": self.name,
            "ground_motion": motion,
            "support": [one.given() for one in settings.support],
            "density": settings.materials["host"].density,
            "steps": [step.given() for step in self.listed_steps if step.is_dated],
            "openings": self.mined_openings(),
        }

    def mined_openings(self) -> list[dict]:
        """Excavations that are mined, each with the dated steps that mine and fill it; empty: before the first of them;
        without `filled` where none does."""
        openings = []
        for entry in self.excavations:
            if self.step_index(entry.step) >= 0:
                when = {"step": entry.step}
                if entry.fill_material is not None and self.step_index(entry.fill_step) >= 0:
                    when["filled"] = entry.fill_step
                dated = {key: step if step in self.dated_steps else "" for key, step in when.items()}
                openings.append({"name": entry.name, **dated})
        return openings

    def openings_slice(self) -> dict:
        """Settings of stage `openings`: steps, what they mine and fill, axes of drives, virgin stress."""
        excavations = []
        for entry in self.excavations:
            shape, steps = self._shape(entry), self.mined_steps
            filled = entry.fill_step if entry.fill_material is not None and entry.fill_step in steps else ""
            own = {"name": entry.name, "mined": entry.step if entry.step in steps else "", "filled": filled}
            axis = shape.get("path") or _axis(shape)
            excavations.append(own | ({"path": axis} if axis and self.plane is None else {}))
        return {
            "steps": [{"name": name, **self._dates(name)} for name in self.mined_steps],
            "excavations": excavations,
            "insitu": self._insitu_stress() | {"surface": self.settings.frame.surface},
            "chainage": self.settings.openings.chainage,
        }

    def observations_slice(self) -> dict:
        """Settings of stage `observations`: instruments with paths from the working directory, steps, what is mined."""
        given = self.settings.observations.given() if self.settings.observations else {}
        made = {
            kind: [one | ({"file": self.path(one["file"]).as_posix()} if "file" in one else {}) for one in given[kind]]
            for kind in given
            if kind != "scans"
        }
        mined = [
            {"name": entry.name, "mined": entry.step if entry.step in self.mined_steps else ""}
            for entry in self.excavations
        ]
        steps = [{"name": name, **self._dates(name)} for name in self.mined_steps]
        return {"observations": made, "steps": steps, "excavations": mined}

    def loading_slice(self) -> dict:
        """Settings of stage `loading`: measures, steps, what they mine and what then holds its walls, virgin stress."""
        steps, excavations = self.mined_steps, []
        for entry in self.excavations:
            mined = entry.step if entry.step in steps else ""
            filled = entry.fill_material is not None and entry.fill_step == entry.step
            begins = dict(map(tuple, self.pressure(entry)))
            pressure = 0.0 if filled else begins.get(self.step_index(entry.step), 0.0)
            excavations.append({"name": entry.name, "mined": mined, "filled": filled, "pressure": pressure})
        return {
            "loading_measures": self.settings.loading_measures.given() if self.settings.loading_measures else {},
            "steps": steps,
            "excavations": excavations,
            "insitu": self._insitu_stress() | {"surface": self.settings.frame.surface},
        }

    def scan_step(self, scan: ObservedScan) -> str:
        """Step that a scan is compared with: its own, that whose dates hold its date, or else the last one before;
        empty where there is none."""
        if scan.step is not None:
            return scan.step
        date = read_date("observations", str(scan.date))
        begun = [step for step in self.dated_steps if read_date(step, self._dates(step)["start"]) <= date]
        return begun[-1] if begun else ""

    @property
    def scan_steps(self) -> list[str]:
        """Steps at whose end there is a scan, in order."""
        wanted = (
            {self.scan_step(scan) for scan in self.settings.observations.scans} if self.settings.observations else ()
        )
        return [step for step in self.mined_steps if step in wanted]

    def placed_scan(self, scan: ObservedScan) -> dict:
        """A scan as its slice has it: with its step, its file as a path from the working directory, and the grid of the
        file."""
        grid = self.settings.frame.grid
        made = {key: value for key, value in scan.given().items() if key != "date"}
        made |= {"step": self.scan_step(scan), "file": self.path(scan.file).as_posix()}
        return made | ({"grid": grid.given()} if grid else {})

    def scans_slice(self) -> dict:
        """Settings of stage `scans`: scanned voids, all steps, and when each excavation is mined and filled."""
        given = self.settings.observations.scans if self.settings.observations else ()
        openings = self.openings_slice()
        return {
            "scans": [self.placed_scan(scan) for scan in given],
            "steps": openings["steps"],
            "excavations": openings["excavations"],
        }

    def report_slice(self) -> dict:
        """Configuration that the report shows: as written, default, mining of each excavation, in-situ stress, grid."""
        grid = self.settings.frame.grid
        return {
            "config": self.text | ({"accuracy": self.asked} if self.asked else {}),
            "default": self.default,
            **({"foreseen": self.foreseen} if self.foreseen else {}),
            "excavations": self.schedule(),
            "insitu": self._insitu_stress() | {"surface": self.settings.frame.surface},
            **({"mine_grid": grid.given(), "grid_text": self.grid_text} if grid else {}),
            **({"sections": [one.given() for one in sections]} if (sections := self.settings.report.sections) else {}),
        }

    def slice_of(self, result: str) -> dict:
        """Settings that "grid", "elastic", "steps/<step>" or "events/<step>" depends on, besides other results."""
        kind, _, step = result.partition("/")
        return {
            "grid": self.grid_slice,
            "elastic": lambda: self.mechanics_slice(0),
            "steps": lambda: self.step_slice(step),
            "events": lambda: self.step_events_slice(step),
        }[kind]()

    def run_slices(self, extracted_as: Sequence[Self] | None = None) -> dict:
        """Settings of all stages, for workflow.run_mine.run_stages.

        A member of an ensemble has the grid and the elastic state of its mine.
        extracted_as: mines with whose settings the events of each step are extracted, by default this one; empty: none.
        """
        mines = [self] if extracted_as is None else extracted_as
        steps = [
            {"name": name, "scene": self.step_slice(name), "events": [one.step_events_slice(name) for one in mines]}
            for name in self.mined_steps
        ]
        return {"grid": self.grid_slice(), "elastic": self.member(0).mechanics_slice(0), "steps": steps}

    def record_slice(self) -> dict:
        """Settings that record.nc depends on, besides the content of the recorded file."""
        settings, host = self.settings, self.settings.materials["host"]
        dated = [step for step in self.listed_steps if step.is_dated]
        # Only what was recorded while the model mines, and where, is comparable; the configuration may choose less.
        period = {"start": dated[0].start, "end": dated[-1].end} if dated else {}
        file = self.path(settings.record.file)
        if settings.record.reader == elk_creek_reader.NAME:
            with suppress(InputError):  # the stage that reads it says why
                file = elk_creek_reader.data_folder(file)  # the environment may name another one
        return {
            "mine": self.name,
            "frame": settings.frame.given(),
            "lame_lambda": host.lame_lambda,
            "shear_modulus": host.shear_modulus,
            **settings.record.given(),
            "period": period,
            "domain": self._corners() | {"plane": self.plane},
            "file": Path(file).as_posix(),
        }
