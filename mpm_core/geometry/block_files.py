"""Block models of CSV files: the boxes and the columns of their rows.

The columns of places and sides have common names, or are named. Rows below the header that hold no numbers there, such
as the descriptions and types that some programs write, are left out.
"""

import csv
import logging
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

from common.errors import InputError
from common.mine_grid import GridMap
from mpm_core.geometry.blocks import Blocks
from mpm_core.geometry.meshes import shown

SIDES = {"x": "dx", "y": "dy", "z": "dz"}
COMMON_NAMES = {  # in lower case, of what planning packages export
    "x": ("x", "xc", "xcentre", "xcenter", "x_centre", "x_center", "centroid_x", "mid_x", "xmid", "east", "easting"),
    "y": ("y", "yc", "ycentre", "ycenter", "y_centre", "y_center", "centroid_y", "mid_y", "ymid", "north", "northing"),
    "z": ("z", "zc", "zcentre", "zcenter", "z_centre", "z_center", "centroid_z", "mid_z", "zmid", "rl", "elevation"),
    "dx": ("dx", "xinc", "dim_x", "xdim", "x_size", "size_x", "xlength", "x_length", "_east", "x_inc"),
    "dy": ("dy", "yinc", "dim_y", "ydim", "y_size", "size_y", "ylength", "y_length", "_north", "y_inc"),
    "dz": ("dz", "zinc", "dim_z", "zdim", "z_size", "size_z", "zlength", "z_length", "_rl", "z_inc"),
}
SEPARATORS = ",;\t|"
MAX_LINES_OF_HEAD = 100  # Lines in which the header and the first block are looked for.


@dataclass(frozen=True, eq=False)
class BlockTable:
    """Blocks of a file in m of its own coordinates, and its columns, an array (block,) of text or numbers each."""

    blocks: Blocks
    columns: Mapping[str, np.ndarray]


def read_block_csv(
    path: Path,
    named: Mapping[str, str],
    size: tuple[float, ...] | None,
    turn: GridMap,
    unit: float,
    wanted: Iterable[str],
) -> BlockTable:
    """The blocks of a CSV file.

    named: columns of x, y, z, dx, dy, dz that have no common name; size: sides m where the file has none; turn: from
    the axes of the blocks to those of the file; unit: m of the file's numbers; wanted: names of other columns. Raises
    InputError.
    """
    lines = _head(path)
    place, separator, header = _header(lines, set(named.values()) | set(wanted))
    found = {key: _column(key, named, header) for key in COMMON_NAMES}
    missing = [key for key in SIDES if found[key] is None]
    if missing:
        raise InputError(f"has no column of {', '.join(missing)}: name it by block_model.columns: {shown(header)}")
    sides = [key for key in SIDES.values() if found[key] is not None]
    if size is None and len(sides) < 3:
        raise InputError(
            f"has columns of {', '.join(sides) or 'no'} sides of its blocks: name those of dx, dy and dz by "
            "block_model.columns, or give block_model.size"
        )
    if size is not None and sides:
        raise InputError(f"has the column {found[sides[0]]} of the sides of its blocks: leave block_model.size out")
    if absent := [name for name in wanted if name not in header]:
        raise InputError(f"has no column {absent[0]!r}: it has {shown(header)}")
    used = [name for name in dict.fromkeys([*found.values(), *wanted]) if name is not None]
    if twice := [name for name in used if header.count(name) > 1]:
        raise InputError(f"has {header.count(twice[0])} columns {twice[0]!r}: name each its own way")
    table = _table(path, lines, place, separator, header, used, [str(found[key]) for key in SIDES])
    numbers = {key: _numbers(table, name) for key, name in found.items() if name is not None}
    middle = unit * np.column_stack([numbers[key] for key in SIDES])
    if size is None:
        side = unit * np.column_stack([numbers[key] for key in SIDES.values()])
    else:
        side = np.broadcast_to(np.array(size), middle.shape)
    if not (side > 0.0).all():
        raise InputError(f"block {1 + int(np.flatnonzero((side <= 0.0).any(axis=1))[0]):,} has a side of 0 or less")
    own = turn.to_grid(middle)
    blocks = Blocks(own - 0.5 * side, own + 0.5 * side, np.zeros(3), turn.turn.T.copy())
    return BlockTable(blocks, {name: table[name].to_numpy() for name in wanted})


def _head(path: Path) -> list[str]:
    try:
        with path.open(encoding="utf-8-sig", errors="replace") as file:
            return [line.rstrip("\r\n") for line, _ in zip(file, range(MAX_LINES_OF_HEAD), strict=False)]
    except OSError as error:
        raise InputError(f"is not readable ({error.strerror})") from error


def _header(lines: list[str], named: set[str]) -> tuple[int, str, list[str]]:
    """Number of the line of the header, its separator and its names: that with most of the names that are looked
    for."""
    known = {name for names in COMMON_NAMES.values() for name in names}
    best, found = 0, (0, ",", [""])
    for number, line in enumerate(lines):
        for separator in SEPARATORS:
            text = line.removeprefix("#").strip() if line.startswith("#") else line
            try:
                header = [name.strip() for name in next(csv.reader([text], delimiter=separator), [])]
            except csv.Error:  # a line of JSON or XML is one field, longer than any
                continue
            count = sum((name in named) or (name.lower() in known) for name in header)
            if count > best:
                best, found = count, (number, separator, header)
    if best < len(SIDES):
        raise InputError(
            "has no line with the names of columns x, y and z: name them by block_model.columns, or export it as CSV"
        )
    return found


def _column(key: str, named: Mapping[str, str], header: list[str]) -> str | None:
    """Name of a column by its key. Raises InputError for one that is named and missing."""
    if key in named:
        if named[key] not in header:
            raise InputError(f"has no column {named[key]!r} (block_model.columns.{key}): it has {shown(header)}")
        return named[key]
    lower = [name.lower() for name in header]
    return next((header[lower.index(name)] for name in COMMON_NAMES[key] if name in lower), None)


def _table(
    path: Path, lines: list[str], place: int, separator: str, header: list[str], used: list[str], places: list[str]
) -> pd.DataFrame:
    """The used columns of all blocks; places: columns of x, y and z."""
    column = [header.index(name) for name in places]
    start = place
    for line in lines[place + 1 :]:
        start += 1
        cells = next(csv.reader([line], delimiter=separator), [])
        if len(cells) > max(column) and all(_is_number(cells[index].strip().replace(",", ".")) for index in column):
            break
    else:
        raise InputError("has no block below its header: export the blocks as rows of numbers")
    if start > place + 1:
        logging.info("%s: %d lines below the header hold no block", path, start - place - 1)

    def read(decimal: str) -> pd.DataFrame:
        return pd.read_csv(
            path, sep=separator, decimal=decimal, skiprows=start, header=None, names=range(len(header)),
            usecols=[header.index(name) for name in used],
            index_col=False,  # of a wider row pandas would take the first cells for an index
            encoding_errors="replace", skipinitialspace=True, low_memory=False,
        )  # fmt: skip

    try:
        table = read(".")
        commas = [header[index] for index in table.columns if separator != "," and _has_marks(table[index], ",")]
        points = [header[index] for index in table.columns if commas and _has_marks(table[index], ".")]
        if points:
            raise InputError(
                f"column {commas[0]!r} has numbers with a comma, column {points[0]!r} with a point: export it with one "
                "decimal mark and without marks of thousands"
            )
        if commas:
            table = read(",")
    except (ValueError, OSError) as error:  # pandas' errors of parsing are ValueErrors
        raise InputError(f"is no readable table ({' '.join(str(error).split())[:200]})") from error
    return table.set_axis([header[index] for index in table.columns], axis=1)


def _has_marks(column: pd.Series, mark: str) -> bool:
    """True if one cell of a column, read with decimal points, is a number with this mark; whole numbers have none."""
    if pd.api.types.is_numeric_dtype(column):
        return mark == "." and bool((column.dropna() % 1 != 0).any())
    texts = (str(value).strip() for value in column.unique())
    return any(mark in text and _is_number(text.replace(",", ".")) for text in texts)


def _is_number(text: str) -> bool:
    try:
        return bool(np.isfinite(float(text)))
    except ValueError:
        return False


def _numbers(table: pd.DataFrame, name: str) -> np.ndarray:
    values = pd.to_numeric(table[name], errors="coerce").to_numpy(float)
    wrong = np.flatnonzero(~np.isfinite(values))
    if len(wrong):
        text = str(table[name].iloc[wrong[0]])[:40]
        raise InputError(
            f"column {name!r}: block {wrong[0] + 1:,} of {len(values):,} has {text!r} ({len(wrong):,} such): correct it"
        )
    return values
