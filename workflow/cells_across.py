"""Cells across each opening, measured once: a later start of the pipeline reads what an earlier one has measured.

The file is a memory only: without it, or if it cannot be read, the openings are measured again.
"""

import hashlib
import json
import logging
import math
from contextlib import nullcontext
from pathlib import Path

from common.errors import InputError
from mpm_core import geometry
from mpm_core.geometry.solids import Solid
from mpm_core.geometry.thickness import Across, cells_across
from workflow.derived_domain import quiet
from workflow.mine import Mine, shape_keys
from workflow.mine_settings import Excavation
from workflow.shapes import check_form

MEMORY = Path(".snakemake/cells_across")  # next to Snakemake's own notes


def across_of(mine: Mine) -> dict[str, Across]:
    """Cells across each opening that is mined in a step, by its name.

    A solid that cannot be read, or encloses nothing, is left out: the stage that reads it tells of it.
    """
    path, across, used = MEMORY / mine.name, {}, {}
    known, code = _read(path), _code()
    for entry in mine.excavations:
        if mine.step_index(entry.step) < 0 or entry.outside:
            continue
        key = _key(mine, entry, code)
        try:
            used[key] = known[key] if key in known else _measured(mine, entry)
        except InputError as error:
            logging.info("%s", error)
            continue
        if used[key].cells > 0.0:
            across[entry.name] = used[key]
    if used.keys() - known.keys():
        _write(path, used)
    return across


def _key(mine: Mine, entry: Excavation, code: str) -> str:
    """Hash of all that the cells across an opening follow from."""
    parts = [code, mine.finest_cell, mine.dimension, shape_keys(entry), _top(mine)]
    if entry.closed_at_ground:
        parts.append(mine.settings.frame.surface)
    if entry.file:
        grid = mine.settings.frame.grid  # of its coordinates, and their unit
        parts.append(grid and grid.given())
        path = mine.path(entry.file)
        stamp = path.stat() if path.exists() else None
        parts += [str(path.resolve()), stamp and [stamp.st_mtime_ns, stamp.st_size]]
    return hashlib.sha256(json.dumps(parts, sort_keys=True).encode(errors="surrogateescape")).hexdigest()


def _top(mine: Mine) -> float | None:
    """Elevation, m, at which the rock ends above; None in plan."""
    return None if mine.plane == "xy" else mine.settings.domain.upper[-1]


def _code() -> str:
    """Hash of the sources that measure."""
    digest = hashlib.sha256()
    for path in sorted(Path(geometry.__path__[0]).rglob("*.py")):
        digest.update(path.read_bytes())
    return digest.hexdigest()


def _read(path: Path) -> dict[str, Across]:
    try:
        return {key: Across(float(cells), int(needed)) for key, (cells, needed) in json.loads(path.read_text()).items()}
    except (OSError, ValueError, TypeError, AttributeError):  # none yet, or no longer whole
        return {}


def _write(path: Path, across: dict[str, Across]) -> None:
    from common.datasets import atomic_path

    try:
        with atomic_path(path) as temporary:
            temporary.write_text(json.dumps(across))
    except (InputError, OSError) as error:
        logging.info("%s", error)


def _measured(mine: Mine, entry: Excavation) -> Across:
    """Cells across an opening. A shape has few facets: waking threads takes longer. Raises InputError."""
    from mpm_core.simd.threads import threads_for

    with threads_for(0) if entry.file is None else nullcontext():
        top = _top(mine)
        return cells_across(_solid(mine, entry), mine.finest_cell, math.inf if top is None else top)


def _solid(mine: Mine, entry: Excavation) -> Solid:
    """The solid of an excavation. Raises InputError."""
    from mpm_core.geometry.shapes import solid_of
    from mpm_core.scene.scene_solids import read_entry

    where = f"excavations.{entry.name}"
    shape = check_form(mine, where, entry)
    if shape is not None:
        return solid_of(shape, mine.dimension, entry.name)
    with quiet():
        return read_entry(mine.placed(entry), mine.dimension, where)
