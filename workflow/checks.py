"""What the schema cannot say about a mine: steps in order, names that match, the domain, the virgin stress."""

import math
from collections import Counter

from mpm_core.constitutive.laws import can_fail
from mpm_core.domain import base_cells
from mpm_core.scene import check_virgin_stress, parse_scene
from pipeline.errors import InputError
from workflow.accuracy import DRAFT
from workflow.dates import read_date
from workflow.far_field import largest_cell_name
from workflow.mine import Mine
from workflow.record_checks import check_record
from workflow.shapes import check_repeated, check_shape

PLANNED = "planned"  # shapes the grid now, is mined when it gets a step
IN_PLANE = {"xz": ("xx", "zz", "xz"), "xy": ("xx", "yy", "xy"), None: ("xx", "yy", "zz", "yz", "xz", "xy")}
ALL = "all"  # beside the steps in grid_convergence.nc and spread.nc: all of them together
RESERVED = ("verification", "benchmarks", "extremes", "tradeoff", "stability", "catalog_spread")  # folders of results
LEAST_HOURGLASS = 0.001  # a thousandth of it makes a stage twenty times as long, zero has no answer
MOST_POISSON = 0.49  # where particles share a cell: a hole then closes 4 % too little, at 0.499 26 %, at 0.4999 73 %
MOST_CELLS = 10**9  # coarse ones; the finer come on top


def check_mine(mine: Mine) -> None:
    """What the schema cannot say. Raises InputError."""
    if mine.name.lower() in RESERVED:
        raise InputError(f"name: results/{mine.name} is a folder of the pipeline's own; take another name")
    _check_steps(mine)
    _check_domain(mine)
    check_record(mine)
    _check_names(mine)
    check_repeated(mine)
    _check_solver(mine)
    _check_ensemble(mine)
    _check_compression(mine)
    _check_virgin(mine)


def _check_virgin(mine: Mine) -> None:
    """Raise InputError where virgin rock would fail before anything is mined; that a derived domain has none is its
    own affair (workflow/far_field.py)."""
    scene = parse_scene(mine.scene_slice(len(mine.steps) - 1))
    domain = mine.values["domain"]
    if mine.plane == "xy":
        check_virgin_stress(scene, {"": scene.insitu.surface})
    else:
        check_virgin_stress(scene, {f" (domain.{end})": domain[end][-1] for end in ("lower", "upper")})


def _check_steps(mine) -> None:
    names = [step["name"] for step in mine.steps]
    implicit = len(mine.steps) > len(mine.listed_steps)  # the first, history
    for index, step in enumerate(mine.steps):
        where = f"steps.{step['name']}"
        if implicit and index and step["name"].lower() == names[0]:
            raise InputError(
                f"{where}: an undated step '{names[0]}' stands before the first dated one by itself; give this step "
                "another name, or leave out its dates if it is that"
            )
        if names.index(step["name"]) != index:
            raise InputError(f"{where}: this name stands twice; steps need names of their own")
        if step["name"].lower() in [name.lower() for name in names[:index]]:
            raise InputError(
                f"{where}: differs from another step in capitals alone, which some disks take for the same file"
            )
        if step["name"] == PLANNED:
            raise InputError(f"{where}: '{PLANNED}' means not yet scheduled; give the step another name")
        if step["name"] == ALL:
            raise InputError(f"{where}: '{ALL}' means all dated steps in results; give the step another name")
        if ("start" in step) != ("end" in step):
            raise InputError(f"{where}: a dated step needs both start and end")
        if "start" not in step and any("start" in earlier for earlier in mine.steps[:index]):
            raise InputError(f"{where}: an undated step is history and must stand before the first dated one")
        start, end = (read_date(f"{where}.{key}", step[key]) if key in step else None for key in ("start", "end"))
        if start and start >= end:
            raise InputError(f"{where}.end: {step['end']} is not after start {step['start']}")
        earlier = [other for other in mine.steps[:index] if "end" in other]
        if start and earlier and start < read_date(where, earlier[-1]["end"]):
            raise InputError(
                f"{where}.start: {step['start']} is before the end of the step before, {earlier[-1]['end']}"
            )


def _check_names(mine) -> None:
    names = [step["name"] for step in mine.steps]
    materials = mine.values["materials"]
    for section in ("rock_bodies", "loads", "strains"):
        listed = Counter(entry["name"] for entry in mine.values.get(section, []))
        if twice := [name for name, count in listed.items() if count > 1]:
            raise InputError(f"{section}.{twice[0]}: this name stands twice")
    seen = set()
    for index, entry in enumerate(mine.excavations):
        where = f"excavations.{entry.get('name', index)}"
        if entry["name"] in seen:
            raise InputError(f"{where}: this name stands twice")
        seen.add(entry["name"])
        for key in ("step", "filled"):
            if key in entry and entry[key] not in (*names, PLANNED):
                raise InputError(f"{where}.{key}: '{entry[key]}' is not one of the steps {', '.join(names)}, {PLANNED}")
        fill = entry.get("fill", "none")
        if fill != "none" and fill not in materials:
            raise InputError(f"{where}.fill: '{fill}' is not one of the materials {', '.join(materials)}, none")
        if fill != "none" and can_fail(materials[fill]):
            raise InputError(f"{where}.fill: '{fill}' is {materials[fill]['model']}; only elastic fill is supported")
        if "filled" in entry and fill == "none":
            raise InputError(f"{where}.filled: there is no fill to place; name a material in fill")
        check_shape(mine, where, entry)
        mined, filled = mine.step_index(entry["step"]), mine.step_index(entry.get("filled", entry["step"]))
        if -1 < filled < mined or (mined == -1 and filled > -1):
            raise InputError(
                f"{where}.filled: '{entry['filled']}' comes before the excavation is mined in '{entry['step']}'"
            )
        _check_pressure(mine, where, entry, mined, filled)
    for index, entry in enumerate(mine.values.get("rock_bodies", [])):
        where = f"rock_bodies.{entry.get('name', index)}"
        if entry["material"] not in materials:
            raise InputError(
                f"{where}.material: '{entry['material']}' is not one of the materials {', '.join(materials)}"
            )
        check_shape(mine, where, entry)
    for entry in mine.values.get("loads", []):
        where = f"loads.{entry['name']}"
        if entry["step"] not in names:
            raise InputError(f"{where}.step: '{entry['step']}' is not one of the steps {', '.join(names)}")
        check_shape(mine, where, entry)
        if "file" in entry:
            raise InputError(f"{where}.file: a load acts on a shape; give one instead")
        _check_force(mine, where, entry)
    for entry in mine.values.get("strains", []):
        where = f"strains.{entry['name']}"
        if entry["step"] not in names:
            raise InputError(f"{where}.step: '{entry['step']}' is not one of the steps {', '.join(names)}")
        for name in entry["strain"]:
            if name not in IN_PLANE[mine.plane]:
                raise InputError(
                    f"{where}.strain.{name}: out of the plane, where plane strain has none; "
                    f"give {', '.join(IN_PLANE[mine.plane])}"
                )


def _check_pressure(mine, where: str, entry: dict, mined: int, filled: int) -> None:
    """Pressure begins when the excavation is mined or later, and before it is filled."""
    if "pressure" not in entry:
        return
    given, names = entry["pressure"], [step["name"] for step in mine.steps]
    by_step = isinstance(given, dict)
    for step in given if by_step else [entry["step"]]:
        key, index = f"{where}.pressure.{step}" if by_step else f"{where}.pressure", mine.step_index(step)
        if by_step and index < 0:
            raise InputError(f"{key}: '{step}' is not one of the steps {', '.join(names)}")
        if by_step and not 0 <= mined <= index:
            raise InputError(f"{key}: comes before the excavation is mined in '{entry['step']}'; leave it out")
        if entry.get("fill", "none") != "none" and -1 < filled <= index:
            raise InputError(
                f"{key}: the excavation is filled by then, and pressure acts on the walls of an opening; leave one "
                "out, or place the fill in a later step (filled)"
            )


def _check_force(mine, where: str, entry: dict) -> None:
    single = not isinstance(entry["force"], list)
    if single and "toward" not in entry:
        raise InputError(
            f"{where}.force: a single magnitude needs the point it is directed to; add toward, or give three"
        )
    if "toward" in entry:
        if not single:
            raise InputError(f"{where}.force: with toward the force is a single magnitude, for example '1 kN'")
        line = isinstance(entry["toward"][0], list)
        for point in entry["toward"] if line else [entry["toward"]]:
            if len(point) != mine.dimension:
                raise InputError(f"{where}.toward: {len(point)} coordinates; this scene has {mine.dimension}")
        if line and (mine.dimension == 2 or entry["toward"][0] == entry["toward"][1]):
            raise InputError(f"{where}.toward: two points are a line, in three dimensions; give one, or two different")


def _check_domain(mine) -> None:
    domain, coarse = mine.values["domain"], mine.values["grid"]["coarse_cell"]
    for key in ("lower", "upper"):
        if len(domain[key]) != mine.dimension:
            raise InputError(f"domain.{key}: {len(domain[key])} coordinates; this scene has {mine.dimension}")
    for axis, (low, high) in enumerate(zip(domain["lower"], domain["upper"], strict=True)):
        if high <= low:
            raise InputError(f"domain.upper[{axis}]: {high:g} m is not above domain.lower[{axis}], {low:g} m")
    base_cells(domain["lower"], domain["upper"], coarse, largest_cell_name(mine))
    count = mine.values["grid"]["particles_per_cell"]
    if round(count ** (1 / mine.dimension)) ** mine.dimension != count:
        raise InputError(f"grid.particles_per_cell: {count} is not n^{mine.dimension} in {mine.dimension}-D")
    cells = math.prod((high - low) / coarse for low, high in zip(domain["lower"], domain["upper"], strict=True))
    if cells > MOST_CELLS:
        raise InputError(
            f"grid.{'coarse_cell' if 'coarse_cell' in mine.written_cells else 'finest_cell'}: the largest cells, "
            f"{coarse:g} m, are {cells:.1g} coarse cells in this domain; take larger ones"
        )


def _check_solver(mine) -> None:
    solver, count = mine.values["solver"], mine.values["grid"]["particles_per_cell"]
    if solver["hourglass"] < LEAST_HOURGLASS and count == 1:
        raise InputError(
            f"solver.hourglass: {solver['hourglass']:g} leaves cells of one particle without stiffness against "
            f"hourglass patterns; take {LEAST_HOURGLASS:g} to 1, or more grid.particles_per_cell"
        )
    stiff = {name: rock["poisson_ratio"] for name, rock in mine.values["materials"].items()}
    if count > 1 and max(stiff.values()) > MOST_POISSON:
        name = max(stiff, key=stiff.get)
        raise InputError(
            f"materials.{name}.poisson_ratio: {stiff[name]:g} locks cells of {count} particles, which then hardly "
            f"deform; take at most {MOST_POISSON:g}, or grid.particles_per_cell: 1"
        )
    if solver["move"] and count == 1:
        raise InputError(
            "solver.move: a lone particle must rest at its cell's centre; take more grid.particles_per_cell"
        )
    if solver["move"] and solver["scheme"] != "explicit":
        raise InputError("solver.move: particles move with scheme explicit only; set solver.scheme: explicit")


def _check_ensemble(mine) -> None:
    if not mine.members:
        return
    if not mine.dated_steps:
        raise InputError("ensemble: no step has dates, hence no catalogue to show the spread of; set it to 0")
    bodies = {"host", *(entry["material"] for entry in mine.values.get("rock_bodies", []))}
    if not any(can_fail(mine.values["materials"][name]) for name in bodies):
        raise InputError("ensemble: no rock can fail (materials), so all members are the same; set it to 0")
    if mine.values["solver"]["increments"] == 1:
        is_draft = mine.values["accuracy"] == DRAFT
        said = "accuracy: draft has made 1 of solver.increments" if is_draft else "solver.increments is 1"
        raise InputError(
            f"ensemble: members differ by the parts in which they take rock out, and {said}; set that to "
            f"{3 if is_draft else 2} or more, or ensemble to 0"
        )


def _check_compression(mine) -> None:
    """Compression is negative: rock in place is under tension along an axis nowhere, at no depth of a mine."""
    insitu = mine.values["insitu_stress"]
    if insitu.get("gradient", {}).get("zz", 0.0) > 0.0:
        raise InputError(
            "insitu_stress.gradient.zz: positive, rock would weigh less than nothing; compression is negative, "
            "and gradients are per metre of depth below frame.surface"
        )
    domain, surface = mine.values["domain"], mine.values["frame"]["surface"]
    depths = [0.0] if mine.plane == "xy" else [surface - domain[key][-1] for key in ("lower", "upper")]
    for name in ("xx", "yy", "zz"):
        constant, gradient = (insitu.get(key, {}).get(name, 0.0) for key in ("constant", "gradient"))
        if all(constant + gradient * depth > 0.0 for depth in depths):
            raise InputError(
                f"insitu_stress: {name} is positive, tension, in all of the domain; compression is negative "
                f"(constant.{name}, and gradient.{name} per metre of depth below frame.surface)"
            )
