"""Checks of the solids in a configuration: keys of each shape, sizes, places inside the domain, repeated solids.

From the numbers alone: the grid stage makes their surfaces.
"""

import numpy as np

from common.errors import InputError, Mistakes
from mpm_core.geometry.shapes import checked, shape_model, shape_of
from mpm_core.geometry.shapes.prism import DrawnPrism
from mpm_core.settings import FileSettings
from workflow.mine import Mine, shape_keys


def check_place(mine: Mine, where: str, entry: dict) -> None:
    """Raise InputError for an entry whose shape lies outside the domain, or lacks what check_form asks for.

    A rock body may lie outside a domain that follows from the excavations: the grid's stage leaves it out, and says so.
    """
    check_form(mine, where, entry)
    if "file" in entry or (where.startswith("rock_bodies.") and mine.far_field):
        return
    lower, upper = shape_of(entry, mine.dimension, where).extent(mine.dimension)
    domain = [np.array(mine.values["domain"][key]) for key in ("lower", "upper")]
    if (upper <= domain[0]).any() or (lower >= domain[1]).any():
        raise InputError(
            f"{where}: lies outside the domain ({_span(lower, upper)}; domain {_span(*domain)}): check its coordinates "
            "and domain.lower, domain.upper"
        )


def check_form(mine: Mine, where: str, entry: dict) -> None:
    """Raise InputError for an entry whose shape lacks keys, or whose file is missing; wherever it lies."""
    if ("shape" in entry) == ("file" in entry) and entry.get("shape") != "prism":
        raise InputError(f"{where}: give either a shape or a file")
    given = set(shape_keys(entry)) - {"shape"}
    if "file" not in entry:
        name = entry["shape"]
        model = shape_model(name, mine.dimension, where)
        needed = {key for key, field in model.model_fields.items() if field.is_required()}
        if missing := needed - given:
            raise InputError(f"{where}.{min(missing)}: missing; shape {name} needs {', '.join(sorted(needed))}")
        _check_keys(where, name, given, set(model.model_fields))
        shape_of(entry, mine.dimension, where)
        return
    if mine.dimension == 2:
        raise InputError(f"{where}.file: a plane strain scene needs a shape in its plane, not a solid")
    if "shape" in entry:
        prism_keys = set(DrawnPrism.model_fields)
        _check_keys(where, "prism from a file", given, set(FileSettings.model_fields) - {"element"} | prism_keys)
        checked(DrawnPrism.of({key: entry[key] for key in given & prism_keys}, where), mine.dimension, where)
    else:
        _check_keys(where, "file", given, set(FileSettings.model_fields))
    if not is_file(mine.path(entry["file"])):
        raise InputError(f"{where}.file: {mine.path(entry['file'])} is missing; paths resolve from {mine.folder}")


def is_file(path) -> bool:
    """Whether there is such a file; a name too long for one is none."""
    try:
        return path.is_file()
    except OSError:
        return False


def _check_keys(where: str, kind: str, given: set[str], known: set[str]) -> None:
    if foreign := given - known:
        raise InputError(f"{where}.{min(foreign)}: not a key of {kind}; its keys are {', '.join(sorted(known))}")


def _span(lower, upper) -> str:
    return ", ".join(f"{low:g} to {high:g} m" for low, high in zip(lower, upper, strict=True))


def check_repeated(mine: Mine, mistakes: Mistakes) -> None:
    """Gather the same solid mined twice: the second finds nothing, unless the first was filled before."""

    def filled_before(first: dict, second: dict) -> bool:
        filled, mined = mine.step_index(first.get("filled", first["step"])), mine.step_index(second["step"])
        return first.get("fill", "none") != "none" and 0 <= filled and (filled < mined or mined < 0)

    by_solid: dict[str, list[dict]] = {}
    for entry in mine.excavations:
        by_solid.setdefault(repr(sorted(shape_keys(entry).items())) + str(entry.get("outside", False)), []).append(
            entry
        )
    for entries in by_solid.values():
        for second in entries[1:]:
            earlier = entries[: entries.index(second)]
            first = next(
                (one for one in earlier if not filled_before(one, second) and not filled_before(second, one)), None
            )
            if first is not None:
                mistakes.add(
                    f"excavations.{second['name']}: the same solid as excavations.{first['name']}, which leaves "
                    "nothing to mine; leave one out, or have the first filled before"
                )
