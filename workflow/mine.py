"""One mine's configuration cut into the slice that each stage depends on.

A slice holds only what its stage needs, so that changing a value re-runs only what it changes. An excavation that is
not mined yet looks the same in a slice whether it is planned or dated later: giving a planned stope its month runs
that month.
"""

from common.voigt import NAMES
from mpm_core.equilibrium.perturbation import MAX_STRENGTH_PERTURBATION
from mpm_core.scene.scene import parse_scene
from mpm_core.settings import ShapeSettings
from workflow.plan import Plan

GRID_KEYS = ("coarse_cell", "levels", "buffer_cells", "cut_cells", "volume_error", "resized_by")


def shape_keys(entry: dict) -> dict:
    """The keys of an excavation, rock body or load that define its shape or file."""
    return {key: entry[key] for key in ShapeSettings.model_fields if key in entry}


class Mine(Plan):
    """A mine's plan, and its slices."""

    def grid_slice(self) -> dict:
        """What grid.nc depends on: shapes, cells, the domain; no material, and of steps what the first one mines."""
        values = self.values
        grid = {key: values["grid"][key] for key in GRID_KEYS if key in values["grid"]}
        later = [number for number, entry in enumerate(self.excavations) if self.step_index(entry["step"]) != 0]
        return {
            "name": self.name,
            "plane": self.plane,
            "thickness": values["thickness"],
            "domain": {key: values["domain"][key] for key in ("lower", "upper")},
            "grid": grid,
            "excavations": [self._shape(entry) for entry in self.excavations],
            "rock_bodies": [
                {**self._shape(entry), "refine": entry.get("refine", False)} for entry in values.get("rock_bodies", [])
            ],
            **({"later": later} if later and self.is_adaptive else {}),
            **({"far_field": self.expected()} if self.far_field else {}),
        }

    def _shape(self, entry: dict) -> dict:
        """Name and shape of a solid, its file as a path from the working directory."""
        made = shape_keys(entry)
        if entry.get("outside"):
            made["outside"] = True
        if "file" in made:
            made["file"] = self.path(made["file"]).as_posix()
        return {"name": entry["name"], **made}

    def expected(self) -> dict:
        """Distance and expected error of a derived domain."""
        return {key: getattr(self.far_field, key) for key in ("distance", "error", "radius", "limited")}

    def solids_slice(self) -> dict:
        """What the picture of the solids depends on: their shapes, and the index of the step that mines each, or -1."""
        return self.grid_slice() | {"mined": [self.step_index(entry["step"]) for entry in self.excavations]}

    def scene_slice(self, last: int) -> dict:
        """What the mechanics up to step number `last` depend on, for mpm_core.scene.scene.parse_scene."""
        values = self.values

        def excavation(entry: dict) -> dict:
            mined = self.step_index(entry["step"])
            filled = self.step_index(entry.get("filled", entry["step"]))
            fill = entry.get("fill", "none")
            placed = fill != "none" and 0 <= filled <= last
            pressure = [pair for pair in self.pressure(entry) if mined <= pair[0] <= last]
            return {
                "name": entry["name"],
                "mined": mined if mined <= last else -1,
                "fill": fill if placed else None,
                "filled": filled if placed else -1,
                **({"pressure": pressure} if pressure else {}),
            }

        def components(key: str) -> list[float]:
            given = values["insitu_stress"].get(key, {})
            return [given.get(name, 0.0) for name in NAMES]

        def load(entry: dict) -> dict:
            toward = {"toward": entry["toward"]} if "toward" in entry else {}
            since = self.step_index(entry["step"])
            return {
                "name": entry["name"],
                "since": since,
                "force": entry["force"],
                **toward,
                "shape": shape_keys(entry),
            }

        def listed(section: str) -> list[dict]:
            return [entry for entry in values.get(section, []) if self.step_index(entry["step"]) <= last]

        strains = [
            {
                "name": entry["name"],
                "since": self.step_index(entry["step"]),
                "strain": [entry["strain"].get(name, 0.0) for name in NAMES],
            }
            for entry in listed("strains")
        ]
        excavations = [excavation(entry) for entry in self.excavations]
        used = {"host", *(entry["material"] for entry in values.get("rock_bodies", []))}
        used |= {entry["fill"] for entry in excavations if entry["fill"]}
        return {
            "name": self.name,
            "plane": self.plane,
            "thickness": values["thickness"],
            "particles_per_cell": round(values["grid"]["particles_per_cell"] ** (1 / self.dimension)),
            "cut_cells": values["grid"]["cut_cells"],
            "boundary": self.boundary(),
            "surface": values["frame"]["surface"],
            "insitu_stress": {key: components(key) for key in ("constant", "gradient")},
            "materials": {name: entry for name, entry in values["materials"].items() if name in used},
            "rock_bodies": [{"material": entry["material"]} for entry in values.get("rock_bodies", [])],
            "excavations": excavations,
            "loads": [load(entry) for entry in listed("loads")],
            **({"strains": strains} if strains else {}),
            **({"refinement": self._refinement()} if self.is_adaptive else {}),
            **({"perturbation": self.perturbation} if self.perturbation else {}),
            "steps": [{"name": step["name"]} for step in self.steps[: last + 1]],  # rock knows no dates
            "solver": values["solver"],
        }

    def _refinement(self) -> dict:
        """How cells follow the rock, and the rock bodies that parts of them are of."""
        grid = self.values["grid"]
        bodies = [self._shape(entry) for entry in self.values.get("rock_bodies", [])]
        return {"rings": grid["buffer_cells"], "max_cells": grid["max_cells"], "bodies": bodies}

    def step_slice(self, step: str) -> dict:
        """What steps/<step>.nc depends on, beside the state of the step before."""
        return self.scene_slice(self.step_index(step))

    def picture_slice(self) -> dict:
        """What the picture of the scene depends on: name, whether it has dates, and excavations of every step."""
        mined: dict[str, list[str]] = {step["name"]: [] for step in self.steps}
        for entry in self.excavations:
            if entry["step"] in mined:
                mined[entry["step"]].append(entry["name"])
        steps = [
            {"name": step["name"], "dated": "start" in step, "excavations": mined[step["name"]]} for step in self.steps
        ]
        return {"steps": steps}

    def event_slice(self, step: str = "") -> dict:
        """What events and catalogue depend on, beside the steps; of the events of one step, its dates too."""
        flat = {"thickness": self.values["thickness"]} if self.plane else {}
        dates = {key: self.steps[self.step_index(step)].get(key, "") for key in ("start", "end")} if step else {}
        return {"mine": self.name, "frame": self.values["frame"], **flat, **self.values["seismic"], **dates}

    def spread_slice(self) -> dict:
        """What spread.nc depends on, beside the runs of the ensemble."""
        return {
            "mine": self.name,
            "members": self.members,
            "largest_overstress": MAX_STRENGTH_PERTURBATION,
            "steps": self.dated_steps,
        }

    def convergence_slice(self) -> dict:
        """What grid_convergence.nc depends on, beside the runs on cells of this size and of twice the size."""
        return {"mine": self.name, "steps": self.dated_steps, "cells": [self.finest_cell, 2 * self.finest_cell]}

    def comparison_slice(self) -> dict:
        """What comparison.nc depends on, beside the two catalogues and the events of the ensemble's members."""
        dated = [step for step in self.listed_steps if "start" in step]
        return self.values["comparison"] | {
            "steps": [{key: step[key] for key in ("name", "start", "end")} for step in dated],
            **({"members": self.members} if self.members else {}),
        }

    def report_slice(self) -> dict:
        """What the report shows of the configuration: as written, the default, and when each excavation is mined."""
        return {
            "config": self.text,
            "default": self.default,
            "excavations": self.schedule(),
            "insitu": self.scene_slice(0)["insitu_stress"] | {"surface": self.values["frame"]["surface"]},
        }

    def slice_of(self, stage: str) -> dict:
        """The slice of a stage, which is named by its result below results/<mine>, without ending: "steps/2019-08"."""
        kind, _, step = stage.partition("/")
        of_stage = {
            "scene": self.picture_slice,
            "grid": self.grid_slice,
            "solids": self.solids_slice,
            "elastic": lambda: self.scene_slice(0),
            "steps": lambda: self.step_slice(step),
            "events": lambda: self.event_slice(step),
            "catalog": self.event_slice,
            "closeness": self.event_slice,
            "quakeml": dict,
            "record": self.record_slice if "record" in self.values else dict,
            "comparison": self.comparison_slice,
            "spread": self.spread_slice,
            "grid_convergence": self.convergence_slice,
            "report": self.report_slice,
        }
        return of_stage[kind]()

    def record_slice(self) -> dict:
        """What record.nc depends on, beside the recorded data."""
        host = parse_scene(self.scene_slice(0)).materials["host"]
        dated = [step for step in self.listed_steps if "start" in step]
        # Only what was recorded while the model mines, and where, is comparable; the configuration may choose less.
        period = {"start": dated[0]["start"], "end": dated[-1]["end"]} if dated else {}
        domain = {key: self.values["domain"][key] for key in ("lower", "upper")}
        record = {
            **self.values["record"],
            "period": period,
            "domain": domain | {"plane": self.plane},
            "file": self.path(self.values["record"]["file"]).as_posix(),
        }
        elastic = {"lame_lambda": host.lame_lambda, "shear_modulus": host.shear_modulus}
        return {"mine": self.name, "frame": self.values["frame"], **elastic, **record}
