"""The rock of the blocks of a block model: which kind each is, and which a point lies in."""

import functools
import json
import logging
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from common.errors import InputError
from common.mine_grid import METRES_PER_UNIT, SAME_AS_MAP, GridMap
from mpm_core.block_settings import BlockProperty, PlacedBlocks, class_text
from mpm_core.geometry.block_files import BlockTable, read_block_csv
from mpm_core.geometry.blocks import NO_BLOCK, Blocks
from mpm_core.geometry.meshes import shown
from mpm_core.geometry.omf_blocks import read_block_omf

MAX_OVERLAP_ACCEPTED = 0.01  # Share of the blocks that overlap others; more are no blocks side by side.
MAX_APART_ACCEPTED = 0.5  # Share of the blocks without a neighbour; with more, their sides are wrong.


@dataclass(frozen=True, eq=False)
class RockBlocks:
    """Blocks, the number (block,) int16 of the kind of each, and the grid of their coordinates."""

    blocks: Blocks
    kind: np.ndarray
    grid: GridMap

    def kinds_at(self, points: np.ndarray) -> np.ndarray:
        """Number of the kind of rock (point,) int16 at points (point, 3) m on the map, NO_BLOCK outside of all
        blocks."""
        block = self.blocks.at(self.grid.to_grid(points))
        return np.where(block == NO_BLOCK, NO_BLOCK, self.kind[block]).astype(np.int16)


def read_blocks(settings: PlacedBlocks) -> RockBlocks:
    """The rock of a block model. Raises InputError naming the file, and the key where it is wrong."""
    path = Path(settings.file)
    try:
        stamp = path.stat()
    except OSError as error:
        raise InputError(f"block_model.file: {path} is not readable ({error.strerror})") from error
    return _read(json.dumps(settings.given()), stamp.st_mtime_ns, stamp.st_size)


@functools.lru_cache(maxsize=1)  # each time that a step splits cells
def _read(text: str, modified: int, size: int) -> RockBlocks:
    settings = PlacedBlocks.of(json.loads(text), "block_model")
    path, grid = Path(settings.file), settings.grid.map() if settings.grid else SAME_AS_MAP
    try:
        table = _table(settings, path, grid)
        kind = _material_numbers(settings, table)
        for key, one in settings.properties.items():
            kind = kind * (len(one.values) + 1) + _value_numbers(key, one, table)
    except InputError as error:
        raise InputError(f"block_model: {path}: {error}") from error
    return RockBlocks(table.blocks, kind.astype(np.int16), grid)


def check_blocks(blocks: Blocks) -> None:
    """Raise InputError for blocks that overlap or lie apart; warn of gaps and of few overlaps."""
    overlaps, gaps, apart = blocks.overlaps(), blocks.gaps(), blocks.apart()
    where = "({:.9g}, {:.9g}, {:.9g}) m of the file".format
    if overlaps.share > MAX_OVERLAP_ACCEPTED:
        raise InputError(
            f"block_model: {100 * overlaps.share:.3g} % of the blocks overlap others, first at "
            f"{where(*overlaps.point)}: check the columns of their sides, size and units"
        )
    if apart > MAX_APART_ACCEPTED:
        raise InputError(
            f"block_model: {100 * apart:.3g} % of the blocks touch no other: check the columns of their sides "
            "(block_model.size, units) and their angle"
        )
    if overlaps.share:
        logging.warning(
            "block_model: %.3g %% of the blocks overlap others, first at %s; the later row counts",
            100 * overlaps.share, where(*overlaps.point),
        )  # fmt: skip
    if gaps.share:
        logging.warning(
            "block_model: %.3g %% of what lies within the blocks is in none, first at %s; it is host",
            100 * gaps.share, where(*gaps.point),
        )  # fmt: skip


def _table(settings: PlacedBlocks, path: Path, grid: GridMap) -> BlockTable:
    wanted = [one.column for one in settings.properties.values()]
    wanted = list(dict.fromkeys([settings.classes.column, *wanted] if settings.classes else wanted))
    if path.suffix.lower() == ".omf":
        given = [key for key in ("columns", "size", "angle") if key in settings.model_fields_set]
        if given:
            raise InputError(f"an OMF project has blocks of its own: leave block_model.{given[0]} out")
        stated = METRES_PER_UNIT[settings.units] if settings.units else None
        first, unstated = settings.counted_first, grid.metres_per_unit
        return _damaged(lambda: read_block_omf(path, settings.element, first, stated, wanted, unstated))
    for_omf = [key for key in ("element", "counted_first") if key in settings.model_fields_set]
    if for_omf:
        raise InputError(f"block_model.{for_omf[0]} is for OMF projects: leave it out")
    unit = METRES_PER_UNIT[settings.units] if settings.units else grid.metres_per_unit
    turn = GridMap(angle=settings.angle or 0.0)
    return read_block_csv(path, settings.columns.given(), settings.size, turn, unit, wanted)


def _damaged(read) -> BlockTable:
    """What a reader of a project returns. Raises InputError for whatever it stumbles over."""
    try:
        return read()
    except InputError:
        raise
    except Exception as error:  # zip, JSON, zlib and Parquet have a dozen kinds
        raise InputError(f"unreadable as OMF ({' '.join(str(error).split())[:200]}): export it again") from error


def _material_numbers(settings: PlacedBlocks, table: BlockTable) -> np.ndarray:
    """Number (block,) of the material of each block among settings.materials(). Raises InputError."""
    if settings.classes is None:
        return np.zeros(len(table.blocks.lower), np.int64)
    names, given = settings.materials(), settings.classes
    texts, code, count = _classes(table.columns[given.column])
    material = [given.materials.get(text, given.others) for text in texts]
    unknown = [
        f"{text or 'without a class'} ({number:,} blocks)"
        for text, number, name in zip(texts, count, material, strict=True)
        if name is None
    ]
    if unknown:
        raise InputError(
            f"column {given.column!r}: no material for {shown(unknown)}: add to block_model.classes.materials, or give "
            "block_model.classes.others"
        )
    if unused := [text for text in given.materials if text not in texts]:
        logging.warning("block_model.classes.materials: %s: in no block of %s", shown(unused), settings.file)
    return np.array([names.index(str(name)) for name in material])[code]


def _classes(column: np.ndarray) -> tuple[list[str], np.ndarray, np.ndarray]:
    """Different classes of a column as text, empty for none, the number (block,) of each, and how often it is there."""
    if column.dtype.kind in "iuf":
        values, code = np.unique(column, return_inverse=True)
        texts = ["" if np.isnan(value) else class_text(value.item()) for value in values]
    else:
        import pandas as pd

        code, values = pd.factorize(column, use_na_sentinel=False)
        texts = ["" if pd.isna(value) else class_text(value) for value in values]
    different = list(dict.fromkeys(texts))
    code = np.array([different.index(text) for text in texts], np.int64)[code.reshape(-1)]
    return different, code, np.bincount(code, minlength=len(different))


def _value_numbers(key: str, one: BlockProperty, table: BlockTable) -> np.ndarray:
    """Number (block,) of the value that each block takes, from 1 on; 0: the material's own. Raises InputError."""
    import pandas as pd

    value = pd.to_numeric(pd.Series(table.columns[one.column]), errors="coerce").to_numpy(float)
    known = np.isfinite(value) & (value > 0.0)
    if not known.any():
        raise InputError(f"column {one.column!r} (block_model.properties.{key}) has no number above 0")
    logs, used = np.log(value[known]), np.log(one.values)
    nearest = np.searchsorted(0.5 * (used[1:] + used[:-1]), logs)
    number = np.zeros(len(value), np.int64)
    number[known] = 1 + nearest
    if not known.all():
        logging.warning(
            "block_model.properties.%s: %d of %d blocks have no number above 0; their material's own value counts",
            key, np.count_nonzero(~known), len(known),
        )  # fmt: skip
    off = np.exp(np.abs(logs - used[nearest])) - 1.0
    logging.info(
        "block_model.properties.%s: blocks have %.4g to %.4g; the values used differ by %.2g %% on average, %.2g %% at "
        "most", key, value[known].min(), value[known].max(), 100 * off.mean(), 100 * off.max(),
    )  # fmt: skip
    return number


def kinds_or_host(rock: RockBlocks | None, points: np.ndarray, first: int) -> np.ndarray:
    """Number (point,) int16 of the rock body at points: `first` plus the kind of a block, -1 host."""
    if rock is None:
        return np.full(len(points), -1, np.int16)
    kind = rock.kinds_at(points)
    return np.where(kind == NO_BLOCK, -1, first + kind).astype(np.int16)


def block_attributes(
    settings: PlacedBlocks | None, rock: RockBlocks | None, kind: np.ndarray, volume: np.ndarray
) -> dict[str, str]:
    """Attributes of a grid whose rock is from a block model, else nothing: how many blocks there are, the share of the
    volume of the cells that has each kind of rock, and the material of each kind.

    kind (cell,): number of the kind of each cell, negative without; volume (cell,) m3. Raises InputError where no cell
    has one.
    """
    if settings is None or rock is None:
        return {}
    kinds, inside = settings.kinds(), kind >= 0
    if not inside.any():
        reach = ", ".join(f"{low:.9g} to {high:.9g}" for low, high in zip(*rock.blocks.bounds, strict=True))
        raise InputError(
            f"block_model: no cell lies in its blocks, which reach from {reach} m along their own axes: check units, "
            "columns and angle"
        )
    share = np.bincount(kind[inside], volume[inside], minlength=len(kinds)) / volume.sum()
    held = {settings.kind_name(one): float(part) for one, part in zip(kinds, share, strict=True) if part}
    return {
        "block_model": json.dumps({"blocks": len(rock.kind), "shares": held}),
        "block_materials": json.dumps([one.material for one in kinds]),
    }
