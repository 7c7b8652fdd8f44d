"""The draft run of a mine: a coarser grid on which any cell may fail, to find where rock will fail.

Large cells average the stress at a wall, and with their own strength far too few fail: in a section with a 12 m drive
and a stope, 235 m2 of cells of 5 m against 1723 m2 of cells of 1.25 m. Once rock beside it has failed, rock stands by
residual strength: with that from the start 899 m2 fail, and with the rings around them all that fails on fine cells.

The draft mines history as the mine does and then all the rest, planned or dated, in one step: so the zone that it
finds, and the grid, stay the same when a planned stope gets its month.
"""

import contextlib
import copy

from mpm_core.constitutive.laws import can_fail
from mpm_core.scene import DRAFT_LEVELS
from pipeline.errors import InputError
from workflow.checks import check_virgin
from workflow.mine import Mine


def draft_of(mine: Mine) -> Mine | None:
    """What the draft runs; None where none is wanted (grid.failure_zone), or no rock can fail or be refined."""
    grid = mine.values["grid"]
    brittle = any(can_fail(material) for material in mine.values["materials"].values())
    if grid["failure_zone"] == "none" or grid["levels"] == 1 or not mine.listed_steps or not brittle or mine.is_draft:
        return None
    history = [step["name"] for step in mine.steps if "start" not in step]
    name = {step: f"draft-{number}" for number, step in enumerate(history)}
    rest = f"draft-{len(history)}"

    def moved(entry: dict) -> dict:
        given = {key: name.get(entry[key], rest) for key in ("step", "filled") if key in entry}
        if isinstance(entry.get("pressure"), dict):  # the last of those that come together
            steps = [step["name"] for step in mine.steps]
            given["pressure"] = {name.get(steps[index], rest): value for index, value in mine.pressure(entry)}
        return entry | given

    draft = copy.copy(mine)
    draft.is_draft = True
    draft.excavations = [moved(entry) for entry in mine.excavations]
    lists = {key: [moved(entry) for entry in mine.values[key]] for key in ("loads", "strains") if key in mine.values}
    host = mine.values["materials"]["host"]
    materials = mine.values["materials"] | {"host": as_if_failed(host)}
    levels = max(1, grid["levels"] - DRAFT_LEVELS)
    draft.values = mine.values | lists | {"grid": grid | {"levels": levels, "failure_zone": "none"}}
    later = any(entry["step"] == rest for entries in (draft.excavations, *lists.values()) for entry in entries)
    draft.steps = [{"name": step} for step in [*name.values(), *([rest] if later else [])]]
    draft.listed_steps = draft.steps
    with contextlib.suppress(InputError):  # unless virgin rock would not stand at it
        check_virgin(draft, materials)
        draft.values["materials"] = materials
    return draft


def as_if_failed(material: dict) -> dict:
    """A material with its residual strength from the start: the pairs of intact and residual in it, at any depth."""
    if set(material) == {"intact", "residual"}:
        return {"intact": material["residual"], "residual": material["residual"]}
    return {key: as_if_failed(value) if isinstance(value, dict) else value for key, value in material.items()}
