"""Checks of the solids in a configuration: keys of each shape, sizes, places inside the domain, repeated solids.

From the numbers alone: the grid stage makes their surfaces.
"""

import numpy as np

from common.errors import InputError, Mistakes
from mpm_core.geometry.shapes import Shape, checked, shape_model, shape_of
from mpm_core.geometry.shapes.prism import DrawnPrism
from mpm_core.scene.scene_solids import exchanged_hint
from mpm_core.settings import FileSettings, PartSettings, ShapeSettings
from workflow.mine import SHAPE_KEYS, Mine, shape_keys
from workflow.mine_settings import Excavation


def check_place(mine: Mine, where: str, solid: ShapeSettings) -> None:
    """Raise InputError for a solid whose shape lies outside the domain, or lacks what check_form requires.

    A rock body may lie outside a domain that follows from the excavations: the grid's stage leaves it out, and says so.
    """
    shape = check_form(mine, where, solid)
    if solid.closed_at_ground:
        _check_ground(mine, where)
    if shape is None or (where.startswith("rock_bodies.") and mine.far_field):
        return
    lower, upper = shape.extent(mine.dimension)
    domain = [np.array(corner) for corner in (mine.settings.domain.lower, mine.settings.domain.upper)]
    if (upper <= domain[0]).any() or (lower >= domain[1]).any():
        raise InputError(
            f"{where}: lies outside the domain ({_span(lower, upper)}; domain {_span(*domain)}): check its coordinates "
            f"and domain.lower, domain.upper{exchanged_hint(lower, upper, *domain)}"
        )


def check_form(mine: Mine, where: str, solid: ShapeSettings) -> Shape | None:
    """The shape of a solid, wherever it lies; None for one from a file.

    Raises InputError for a shape that lacks keys, or a file that is missing.
    """
    name = solid.shape
    if (name is None) == (solid.file is None) and name != "prism":
        raise InputError(f"{where}: give either a shape or a file")
    given = (solid.model_fields_set & SHAPE_KEYS) - {"shape"}
    if solid.file is None:
        model = shape_model(name, mine.dimension, where)
        needed = {key for key, field in model.model_fields.items() if field.is_required()}
        if missing := needed - given:
            raise InputError(f"{where}.{min(missing)}: missing; shape {name} needs {', '.join(sorted(needed))}")
        _check_keys(where, name, given, set(model.model_fields))
        return shape_of(shape_keys(solid), mine.dimension, where)
    if mine.dimension == 2:
        raise InputError(f"{where}.file: a plane strain scene needs a shape in its plane, not a solid")
    if name:
        prism_keys = set(DrawnPrism.model_fields)
        file_keys = set(FileSettings.model_fields) - {"element", "closed_at_ground"}
        _check_keys(where, "prism from a file", given, file_keys | prism_keys)
        drawn = {key: value for key, value in shape_keys(solid).items() if key in prism_keys}
        checked(DrawnPrism.of(drawn, where), mine.dimension, where)
    else:
        _check_keys(where, "file", given, set(PartSettings.model_fields))
        _check_part(where, solid)
    if not is_file(mine.path(solid.file)):
        raise InputError(f"{where}.file: {mine.path(solid.file)} is missing; paths resolve from {mine.folder}")
    if solid.closed_at_ground and (not isinstance(solid, Excavation) or solid.outside):
        raise InputError(f"{where}.closed_at_ground: only what is mined, within its surface, is closed; leave it out")
    return None


def _check_part(where: str, solid: ShapeSettings) -> None:
    """Raise InputError for a part without a direction, or a direction without a part, and for a part that is none."""
    if (solid.part is None) != (solid.advance is None):
        given, missing = ("part", "advance") if solid.advance is None else ("advance", "part")
        raise InputError(f"{where}.{given}: stands without {missing}; give both, or leave both out")
    if solid.part is not None and solid.part[0] > solid.part[1]:
        raise InputError(
            f"{where}.part: part {solid.part[0]} of {solid.part[1]}; give its number, then how many there are"
        )


def _check_ground(mine: Mine, where: str) -> None:
    """Raise InputError if the domain does not end, with a free face, at the ground at which a pit is closed."""
    top, surface = mine.settings.domain.upper[-1], mine.settings.frame.surface
    if top != surface:
        raise InputError(
            f"{where}.closed_at_ground: the domain ends at {top:.10g} m, {'above' if top > surface else 'below'} the "
            f"ground (frame.surface, {surface:.10g} m); let domain.upper end there, or leave both corners out"
        )
    condition = mine.boundary()["z_upper"]
    if condition not in ("free", "traction"):
        raise InputError(
            f"{where}.closed_at_ground: domain.boundary holds the ground: z_upper is {condition}; say {{z_upper: free, "
            "others: fixed}"
        )


def is_file(path) -> bool:
    """True if `path` is a file; False also if the system refuses the name, say one that is too long."""
    try:
        return path.is_file()
    except OSError:
        return False


def _check_keys(where: str, kind: str, given: set[str], known: set[str]) -> None:
    if foreign := given - known:
        raise InputError(f"{where}.{min(foreign)}: not a key of {kind}; its keys are {', '.join(sorted(known))}")


def _span(lower, upper) -> str:
    return ", ".join(f"{low:.10g} to {high:.10g} m" for low, high in zip(lower, upper, strict=True))


def check_repeated(mine: Mine, mistakes: Mistakes) -> None:
    """Gather the same solid mined twice: the second finds nothing, unless the first was filled before."""

    def filled_before(first: Excavation, second: Excavation) -> bool:
        filled, mined = mine.step_index(first.fill_step), mine.step_index(second.step)
        return first.fill_material is not None and 0 <= filled and (filled < mined or mined < 0)

    by_solid: dict[str, list[Excavation]] = {}
    for entry in mine.excavations:
        by_solid.setdefault(repr((sorted(shape_keys(entry).items()), entry.outside)), []).append(entry)
    for entries in by_solid.values():
        for number, second in enumerate(entries[1:], 1):
            earlier = entries[:number]
            first = next(
                (one for one in earlier if not filled_before(one, second) and not filled_before(second, one)), None
            )
            if first is not None:
                mistakes.add(
                    f"excavations.{second.name}: the same solid as excavations.{first.name}, which leaves "
                    "nothing to mine; leave one out, or have the first filled before"
                )
