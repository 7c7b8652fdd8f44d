"""Checks of a mine that the schema cannot express: order of steps, names, the domain, the virgin stress."""

import math
import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field

from catalogs.settings import ALL_STEPS
from common.errors import InputError, InputErrors, Mistakes
from common.setting_types import is_list
from mpm_core.constitutive.laws import can_fail, loses_strength
from mpm_core.grid.domain import base_cells
from mpm_core.scene.scene import parse_scene
from mpm_core.settings import ShapeSettings, Variability
from plans.layout import ANY
from seismic.event_settings import DEFAULT_LINK_LENGTH
from workflow.accuracy import apply_accuracy
from workflow.block_rock import add_block_materials, check_blocks_form
from workflow.comparison_checks import check_baselines, check_face, check_forecasts, check_plans
from workflow.dates import is_date, read_date
from workflow.derived_domain import MAX_COARSE_CELLS, complete, largest_cell_name
from workflow.key_order import key_in, parts_of, section_of
from workflow.loading_checks import check_loading
from workflow.mine import Mine
from workflow.mine_settings import BoundaryStrain, Excavation, Load, MineSettings, RockBody, Step
from workflow.observation_checks import check_observations
from workflow.record_checks import check_filter, check_frame, check_record
from workflow.report_checks import check_sections
from workflow.shaking_checks import check_ground_motion
from workflow.shapes import check_form, check_place, check_repeated
from workflow.virgin_rock import check_virgin_stress

SOURCES = ("excavations_from", "schedule")  # sections that excavations and steps are made from
PLANNED = "planned"  # it is part of the grid, and is mined when it gets a step
IN_PLANE = {"xz": ("xx", "zz", "xz"), "xy": ("xx", "yy", "xy"), None: ("xx", "yy", "zz", "yz", "xz", "xy")}
RESERVED = (
    "verification",
    "benchmarks",
    "extremes",
    "tradeoff",
    "stability",
    "catalog_spread",
    "mine_times",
    "scale",
    "economies",
    "foreseen",
    "calibration_truth",
)  # folders of results
MAX_POISSON_SHARED_CELL = 0.49  # where particles share a cell, rock of a larger ratio is far too stiff
NUMBER = re.compile(r"[-+]?\d+(\.\d+)?(e[-+]\d+)?")
# Over fewer cells the number of events follows the cells (study events), and strength is one number for each cell.
MIN_CELLS_PER_LENGTH = 2
MAX_CELLS_PER_DEFAULT_LINK = 8  # in a specimen of the laboratory


def check_mine(mine: Mine, mistakes: Mistakes, broken: set[str]) -> None:
    """Complete a mine, and gather the mistakes that the schema cannot find.

    broken: sections of the configuration with mistakes already. Checks that need one of them are left out: they would
    report the same mistake again.
    """
    broken = set(broken)
    if mine.made_schedule and mine.made_schedule.mistakes.lines:
        mistakes.lines += mine.made_schedule.mistakes.lines
        broken.add("schedule")
    if not broken.isdisjoint(SOURCES):
        broken |= {"excavations", "steps"}

    def check(function: Callable, *needs: str) -> None:
        if not broken.isdisjoint(needs):
            return
        before = len(mistakes.lines)
        with mistakes.gather():
            function(mine, mistakes)
        broken.update(map(section_of, mistakes.lines[before:]))

    check(_check_name, "name")
    check(_check_steps, "steps")
    check(_check_references)
    check(_check_forms, "plane")
    check(check_blocks_form, "plane", "materials", "block_model")
    cells = ("domain", "grid", "plane", "accuracy")
    rock = ("insitu_stress", "materials", "rock_bodies", "block_model")
    follows = () if mine.has_corners else ("frame", *rock, "excavations", "loads")
    before = len(mistakes.lines)
    check(lambda mine, _: complete(mine), *cells, *follows)
    if len(mistakes.lines) > before or not mine.has_corners or mine.settings.grid.coarse_cell is None:
        broken |= {"domain", "grid"}
    check(_complete_link_length, "seismic", *cells)
    check(_complete_variability, "materials", *cells)
    check(add_block_materials, "materials", "block_model", *cells)
    check(lambda mine, _: apply_accuracy(mine), "solver", *cells)
    check(_check_domain, *cells)
    check(check_frame, "frame", "domain", "plane")
    check(_check_places, "frame", "domain", "plane")  # where the frame is wrong, they lie outside the domain too
    check(check_record, "record", "frame")
    check(check_filter, "record", "domain", "plane")
    check(check_face, "face", "plane", "steps")
    check(check_baselines, "baselines", "steps", *cells)
    check(check_observations, "observations", "excavations", "steps", *cells)
    check(check_loading, "loading_measures", "excavations", "steps", "materials", "rock_bodies", "block_model", *cells)
    check(check_sections, "report", "excavations", *cells)
    check(check_repeated, "excavations", "steps")
    check(check_plans, "plans", "excavations", "steps")
    check(check_forecasts, "forecasts", "record", "steps")
    check(check_ground_motion, "ground_motion", "support", "plane", "steps")
    check(_check_solver, "solver", "grid", "materials")
    check(_check_ensemble, "ensemble", "steps", "materials", "rock_bodies", "block_model", "solver", "accuracy")
    check(_check_compression, "insitu_stress", "domain", "frame", "plane")
    check(_check_virgin, *MineSettings.model_fields)
    mistakes.lines = _under_written_keys(mine, mistakes.lines)


def _under_written_keys(mine: Mine, lines: Sequence[str]) -> list[str]:
    """The lines, with those about excavations and steps that excavations_from or schedule makes under its key.

    Lines that then differ in the name of the excavation alone become the first of them, which says how many there are.
    Rows of a schedule with the same wrong material are one line, too.
    """
    source = next((name for name in SOURCES if getattr(mine.settings, name)), None)
    made = {
        "excavations": {entry.name for entry in mine.excavations[len(mine.settings.excavations) :]},
        "steps": {step.name for step in mine.listed_steps if source},
    }
    rows = mine.made_schedule.rows if mine.made_schedule else {}
    found: dict[str, list[str]] = {}  # by the line without the name and without numbers, as those of a place
    for line in dict.fromkeys(lines):
        section, *rest = parts_of(key_in(line))
        reason = line.partition(": ")[2]
        if not rest or rest[0] not in made.get(str(section), ()):
            found[line] = [line]
        elif rest[1:] == ["fill"] and rest[0] in rows:
            found.setdefault(f"fill: {reason}", []).append(f"{rows[str(rest[0])]}: {reason}")
        elif rest[1:] == ["fill"]:
            found.setdefault(f"excavations_from.fill: {reason}", [f"excavations_from.fill: {reason}"])
        else:
            name = str(rest[0])
            pattern = NUMBER.sub("", reason.replace(name, ""))
            found.setdefault(pattern, []).append(f"{rows.get(name, f'{source}: {name}')}: {reason}")
    different = (list(dict.fromkeys(same)) for same in found.values())  # parts of a body have one row
    return [f"{same[0]} (and {len(same) - 1} more like it)" if len(same) > 1 else same[0] for same in different]


def _check_name(mine: Mine, _: Mistakes) -> None:
    if mine.name.lower() in RESERVED:
        raise InputError(f"name: results/{mine.name} is a folder of the pipeline's own; choose another name")


def _complete_link_length(mine: Mine, _: Mistakes) -> None:
    """Set the length within which failed rock is linked, if none is given, by the cells of the file. Raises InputError
    for one that these do not resolve."""
    seismic, cell = mine.settings.seismic, mine.finest_cell
    if seismic.method != "simultaneous":
        return
    low, high = MIN_CELLS_PER_LENGTH * cell, MAX_CELLS_PER_DEFAULT_LINK * cell
    if seismic.link_length is None:
        mine.change("seismic", link_length=min(max(DEFAULT_LINK_LENGTH, low), high))
    elif seismic.link_length < low * (1.0 - 1e-9):
        raise InputError(
            f"seismic.link_length: {seismic.link_length:g} m is less than two of the finest cells ({cell:g} m); give "
            f"{low:g} m or more"
        )


def _complete_variability(mine: Mine, mistakes: Mistakes) -> None:
    """Set how strength varies in rock that loses it, where that is not given, by the cells of the file. Raises
    InputErrors where these do not resolve it, or rock has no strength to lose."""
    cell, materials = mine.finest_cell, dict(mine.settings.materials)
    least = MIN_CELLS_PER_LENGTH * cell
    for name, rock in materials.items():
        where = f"materials.{name}.variability"
        with mistakes.gather():
            if not can_fail(rock):
                continue
            given = rock.variability or Variability()
            if not loses_strength(rock):
                if rock.variability is not None and given.share > 0.0:
                    raise InputError(f"{where}: rock that loses no strength when it fails has none; leave it out")
                continue
            if given.length is not None and given.share > 0.0 and given.length < least * (1.0 - 1e-9):
                raise InputError(
                    f"{where}.length: {given.length:g} m is less than two of the finest cells ({cell:g} m); give "
                    f"{least:g} m or more"
                )
            length = given.length or least
            materials[name] = rock.model_copy(
                update={"variability": given.model_copy(update={"share": given.share, "length": length})}
            )
    mine.settings = mine.settings.model_copy(update={"materials": materials})


def _check_virgin(mine: Mine, _: Mistakes) -> None:
    """Raise InputError where the last step's scene is none, and where virgin rock would fail before anything is
    mined."""
    parse_scene(mine.mechanics_slice(len(mine.steps) - 1))
    check_virgin_stress(mine)


def _check_steps(mine: Mine, mistakes: Mistakes) -> None:
    earlier = EarlierSteps()
    for step in mine.steps:
        with mistakes.gather():
            _check_step(mine, step, earlier)
        earlier.add(step)


@dataclass
class EarlierSteps:
    """What the check of a step needs to know of the steps before it."""

    names: set[str] = field(default_factory=set)
    lower_names: set[str] = field(default_factory=set)
    has_dated: bool = False
    end: str | None = None  # of the last that has one

    def add(self, step: Step) -> None:
        """Note a step that follows them."""
        self.names.add(step.name)
        self.lower_names.add(step.name.lower())
        self.has_dated |= step.is_dated
        self.end = self.end if step.end is None else step.end


def _check_step(mine: Mine, step: Step, earlier: EarlierSteps) -> None:
    implicit = len(mine.steps) > len(mine.listed_steps)  # the first, history
    first, where = mine.steps[0].name, f"steps.{step.name}"
    if implicit and earlier.names and step.name.lower() == first:
        raise InputError(
            f"{where}: an undated step '{first}' stands before the first dated one by itself; give this step "
            "another name, or leave out its dates if it is that"
        )
    if step.name in earlier.names:
        raise InputError(f"{where}: this name stands twice; steps need names of their own")
    if step.name.lower() in earlier.lower_names:
        raise InputError(f"{where}: differs from another step in capitals alone, which are the same file on some disks")
    if step.name == PLANNED:
        raise InputError(f"{where}: '{PLANNED}' means not yet scheduled; give the step another name")
    if step.name == ALL_STEPS:
        raise InputError(f"{where}: '{ALL_STEPS}' means all dated steps in results; give the step another name")
    if (step.start is None) != (step.end is None):
        raise InputError(f"{where}: a dated step needs both start and end")
    if not step.is_dated:
        if earlier.has_dated:
            raise InputError(f"{where}: an undated step is history and must stand before the first dated one")
        return
    start, end = read_date(f"{where}.start", step.start), read_date(f"{where}.end", step.end)
    if start >= end:
        raise InputError(f"{where}.end: {step.end} is not after start {step.start}")
    if earlier.end is not None and is_date(earlier.end) and start < read_date(where, earlier.end):
        raise InputError(f"{where}.start: {step.start} is before the end of the step before, {earlier.end}")


def _solids(mine: Mine) -> Iterator[tuple[str, ShapeSettings]]:
    """Whatever has a shape: how messages name it, and its settings."""
    settings = mine.settings
    sections: dict[str, Sequence[ShapeSettings]] = {
        "excavations": mine.excavations,
        "rock_bodies": settings.rock_bodies,
        "loads": settings.loads,
    }
    for section, solids in sections.items():
        yield from ((f"{section}.{solid.name}", solid) for solid in solids)


def _check_forms(mine: Mine, mistakes: Mistakes) -> None:
    for where, solid in _solids(mine):
        with mistakes.gather():
            check_form(mine, where, solid)
            if solid.file is not None and isinstance(solid, Load):
                raise InputError(f"{where}.file: a load acts on a shape; give one instead")
        if isinstance(solid, Load):
            with mistakes.gather():
                _check_force(mine, where, solid)
    for entry in mine.settings.strains:
        for name in entry.strain.given():
            with mistakes.gather():
                if name not in IN_PLANE[mine.plane]:
                    raise InputError(
                        f"strains.{entry.name}.strain.{name}: out of the plane, where plane strain has none; "
                        f"give {', '.join(IN_PLANE[mine.plane])}"
                    )


def _check_places(mine: Mine, mistakes: Mistakes) -> None:
    """Add misplaced solids to `mistakes`; only the first if all of several are: the domain may be the mistake."""
    found, solids = Mistakes(), list(_solids(mine))
    for where, solid in solids:
        with found.gather():
            check_place(mine, where, solid)
    if len(found.lines) == len(solids) > 1:
        found.lines = [found.lines[0].replace("lies outside", "lies, as all others do, outside", 1)]
    mistakes.lines += found.lines


def _check_references(mine: Mine, mistakes: Mistakes) -> None:
    """Names that stand once, and names that refer to a step or a material, where those names are right."""
    settings, names = mine.settings, [step.name for step in mine.steps]
    mistaken = [parts_of(key_in(line)) for line in mistakes.lines]
    knows_steps = all(
        parts[0] not in ("steps", *SOURCES) or (parts[0] == "steps" and parts[-1] in ("start", "end"))
        for parts in mistaken
    )
    knows_materials = ["materials"] not in mistaken
    materials = settings.materials
    by_small_letters: dict[str, str] = {}
    for name in materials:
        other = by_small_letters.setdefault(name.lower(), name)
        with mistakes.gather():
            if other != name:
                raise InputError(
                    f"materials.{name}: differs in capitals alone from materials.{other}; give it another name"
                )
    sections: dict[str, Sequence[Excavation | RockBody | Load | BoundaryStrain]] = {
        "excavations": mine.excavations,
        "rock_bodies": settings.rock_bodies,
        "loads": settings.loads,
        "strains": settings.strains,
    }
    for section, entries in sections.items():
        seen, in_small_letters = set[str](), set[str]()
        for entry in entries:
            where = f"{section}.{entry.name}"
            with mistakes.gather():
                if entry.name in seen:
                    raise InputError(f"{where}: this name stands twice")
                if entry.name.lower() in in_small_letters:
                    raise InputError(
                        f"{where}: differs in capitals alone from another of the {section}; give it another name"
                    )
            seen.add(entry.name)
            in_small_letters.add(entry.name.lower())
            with mistakes.gather():
                if isinstance(entry, Excavation) and entry.name == ANY:
                    raise InputError(f"{where}: '{ANY}' means all openings in results; give it another name")
                if isinstance(entry, Excavation):
                    _check_mined(mine, where, entry, knows_steps, knows_materials)
                elif isinstance(entry, RockBody):
                    if knows_materials and entry.material not in materials:
                        raise InputError(
                            f"{where}.material: '{entry.material}' is not one of the materials {', '.join(materials)}"
                        )
                elif knows_steps and entry.step not in names:
                    raise InputError(f"{where}.step: '{entry.step}' is not one of the steps {', '.join(names)}")


def _check_mined(mine: Mine, where: str, entry: Excavation, knows_steps: bool, knows_materials: bool) -> None:
    """When an excavation is mined and filled, with what, and the pressure in between. Raises InputErrors."""
    names, materials = [step.name for step in mine.steps], mine.settings.materials
    found, fill = Mistakes(), entry.fill_material
    for key, step in (("step", entry.step), ("filled", entry.fill_step)):
        with found.gather():
            if knows_steps and key in entry.model_fields_set and step not in (*names, PLANNED):
                raise InputError(f"{where}.{key}: '{step}' is not one of the steps {', '.join(names)}, {PLANNED}")
    with found.gather():
        if knows_materials and fill is not None and fill not in materials:
            raise InputError(f"{where}.fill: '{fill}' is not one of the materials {', '.join(materials)}, none")
        if knows_materials and fill is not None and can_fail(materials[fill]):
            raise InputError(f"{where}.fill: '{fill}' is {materials[fill].model}; only elastic fill is supported")
        if entry.filled is not None and fill is None:
            raise InputError(f"{where}.filled: there is no fill to place; name a material in fill")
    if found.lines:
        raise InputErrors(found.lines)
    if not knows_steps:
        return
    mined, filled = mine.step_index(entry.step), mine.step_index(entry.fill_step)
    if -1 < filled < mined or (mined == -1 and filled > -1):
        raise InputError(f"{where}.filled: '{entry.filled}' comes before the excavation is mined in '{entry.step}'")
    _check_pressure(mine, where, entry, mined, filled)


def _check_pressure(mine: Mine, where: str, entry: Excavation, mined: int, filled: int) -> None:
    """Pressure begins when the excavation is mined or later, and before it is filled."""
    if entry.pressure is None:
        return
    given, names = entry.pressure, [step.name for step in mine.steps]
    by_step = isinstance(given, dict)
    for step in given if by_step else [entry.step]:
        key, index = f"{where}.pressure.{step}" if by_step else f"{where}.pressure", mine.step_index(step)
        if by_step and index < 0:
            raise InputError(f"{key}: '{step}' is not one of the steps {', '.join(names)}")
        if by_step and not 0 <= mined <= index:
            raise InputError(f"{key}: comes before the excavation is mined in '{entry.step}'; leave it out")
        if entry.fill_material is not None and -1 < filled <= index:
            raise InputError(
                f"{key}: the excavation is filled by then, and pressure acts on the walls of an opening; leave one "
                "out, or place the fill in a later step (filled)"
            )


def _check_force(mine: Mine, where: str, load: Load) -> None:
    single, toward = not is_list(load.force), load.toward
    if single and toward is None:
        raise InputError(
            f"{where}.force: a single magnitude needs the point it is directed to; add toward, or give three"
        )
    if toward is not None:
        if not single:
            raise InputError(f"{where}.force: with toward the force is a single magnitude, for example '1 kN'")
        line = is_list(toward[0])
        for point in toward if line else [toward]:
            if len(point) != mine.dimension:
                raise InputError(f"{where}.toward: {len(point)} coordinates; this scene has {mine.dimension}")
        if line and (mine.dimension == 2 or toward[0] == toward[1]):
            raise InputError(f"{where}.toward: two points are a line, in three dimensions; give one, or two different")


def _check_domain(mine: Mine, mistakes: Mistakes) -> None:
    count = mine.settings.grid.particles_per_cell
    with mistakes.gather():
        if round(count ** (1 / mine.dimension)) ** mine.dimension != count:
            raise InputError(f"grid.particles_per_cell: {count} is not n^{mine.dimension} in {mine.dimension}-D")
    domain, coarse = mine.settings.domain, mine.settings.grid.coarse_cell
    before = len(mistakes.lines)
    for key, corner in (("lower", domain.lower), ("upper", domain.upper)):
        with mistakes.gather():
            if len(corner) != mine.dimension:
                raise InputError(f"domain.{key}: {len(corner)} coordinates; this scene has {mine.dimension}")
    if len(mistakes.lines) > before:
        return
    for axis, (low, high) in enumerate(zip(domain.lower, domain.upper, strict=True)):
        with mistakes.gather():
            if high <= low:
                raise InputError(f"domain.upper[{axis}]: {high:g} m is not above domain.lower[{axis}], {low:g} m")
    if len(mistakes.lines) > before:
        return
    base_cells(domain.lower, domain.upper, coarse, largest_cell_name(mine))
    cells = math.prod((high - low) / coarse for low, high in zip(domain.lower, domain.upper, strict=True))
    if cells > MAX_COARSE_CELLS:
        raise InputError(
            f"grid.{'coarse_cell' if 'coarse_cell' in mine.written_cells else 'finest_cell'}: the largest cells, "
            f"{coarse:g} m, are {cells:.1g} coarse cells in this domain; use larger ones"
        )


def _check_solver(mine: Mine, mistakes: Mistakes) -> None:
    solver, grid = mine.settings.solver, mine.settings.grid
    count, is_mean = grid.particles_per_cell, grid.cut_cells == "mean"
    fewest = 1 if is_mean else count
    stiff = {name: material.poisson_ratio for name, material in mine.settings.materials.items()}
    for name, ratio in stiff.items():
        with mistakes.gather():
            if count > 1 and ratio > MAX_POISSON_SHARED_CELL:
                raise InputError(
                    f"materials.{name}.poisson_ratio: {ratio:g} locks cells of {count} particles, which then hardly "
                    f"deform; use at most {MAX_POISSON_SHARED_CELL:g}, or grid.particles_per_cell: 1"
                )
    if solver.move and fewest == 1:
        cut_cells = " and grid.cut_cells: whole or subdivide" if is_mean else ""
        raise InputError(
            f"solver.move: a lone particle must rest where it is; use more grid.particles_per_cell{cut_cells}"
        )
    if solver.move and solver.scheme != "explicit":
        raise InputError("solver.move: particles move with scheme explicit only; set solver.scheme: explicit")


def _check_ensemble(mine: Mine, _: Mistakes) -> None:
    if not mine.members:
        return
    if not mine.dated_steps:
        raise InputError("ensemble: no step has dates, hence no catalogue to show the spread of; set it to 0")
    if reason := why_members_are_alike(mine):
        raise InputError(f"ensemble: {reason}, or set ensemble to 0")


def why_members_are_alike(mine: Mine) -> str:
    """Reason why all members of an ensemble would be the same, and what to set, as the beginning of a line; empty if
    they would differ."""
    rocks = [mine.settings.materials[name] for name in mine.written_rocks()]
    if not any(map(can_fail, rocks)):
        return "no rock can fail (materials), so all members are the same; give a material that can"
    if not any(rock.variability is not None and rock.variability.share > 0.0 for rock in rocks if can_fail(rock)):
        return (
            "members differ by the random strength of their rock, and none varies (materials.*.variability); give it a "
            "share"
        )
    return ""


def _check_compression(mine: Mine, mistakes: Mistakes) -> None:
    """Compression is negative: rock in place is under tension along an axis nowhere, at no depth of a mine."""
    insitu, normal = mine.settings.insitu_stress, ("xx", "yy", "zz")
    constants, gradients = (insitu.voigt(name)[:3] for name in ("constant", "gradient"))
    is_principal = insitu.principal is not None
    if gradients[2] > 0.0:
        key = "insitu_stress.principal: its gradient of zz is" if is_principal else "insitu_stress.gradient.zz:"
        raise InputError(
            f"{key} positive, rock would weigh less than nothing; compression is negative, "
            "and gradients are per metre of depth below frame.surface"
        )
    domain, surface = mine.settings.domain, mine.settings.frame.surface
    depths = [0.0] if mine.plane == "xy" else [surface - corner[-1] for corner in (domain.lower, domain.upper)]
    for name, constant, gradient in zip(normal, constants, gradients, strict=True):
        with mistakes.gather():
            if all(constant + gradient * depth > 0.0 for depth in depths):
                keys = f"constant.{name}, and gradient.{name}"
                raise InputError(
                    f"insitu_stress{'.principal' if is_principal else ''}: {name} is positive, tension, in all of the "
                    f"domain; compression is negative ({'constant and gradient' if is_principal else keys}, per metre "
                    "of depth below frame.surface)"
                )
