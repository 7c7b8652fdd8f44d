"""Block models of OMF projects: tensor grids of OMF 1, and grids with or without sub-blocks of OMF 2."""

import gzip
import io
import json
import zipfile
import zlib
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from common.errors import InputError
from mpm_core.geometry.block_files import BlockTable
from mpm_core.geometry.blocks import Blocks
from mpm_core.geometry.meshes import choose, shown, stated_unit
from mpm_core.geometry.omf_files import (
    ARCHIVE,
    ARRAY_TYPES_1,
    INDEX_2,
    check_version_2,
    elements_2,
    objects_1,
    origin_of,
    unit_2,
)

CORNERS_2 = [f"{part}_{axis}" for part in ("parent", "corner_min", "corner_max") for axis in "uvw"]


class Grid(NamedTuple):
    """A block model: sides of its blocks along u, v and w, its origin (3,), axes (3, 3), and how to read its data by
    name."""

    sides: list[np.ndarray]
    origin: np.ndarray
    axes: np.ndarray
    data: dict[str, Callable[[], np.ndarray]]
    corners: tuple[np.ndarray, np.ndarray] | None = None
    """of its sub-blocks, along the axes; None: its blocks have the data"""


def read_block_omf(
    path: Path,
    element: str | None,
    counted_first: str | None,
    unit: float | None,
    wanted: Iterable[str],
    unstated: float = 1.0,
) -> BlockTable:
    """The block model `element` of an OMF project, or its only one.

    counted_first: "u" or "w", which index OMF 1 counts first; unit: m of its numbers, None: as it states, else
    `unstated`; wanted: names of its data. Raises InputError.
    """
    content = path.read_bytes()
    is_2 = content.startswith(ARCHIVE)
    models, own_unit = _models_2(content) if is_2 else _models_1(content)
    if not models:
        raise InputError("holds no block model: export one")
    every = [model for same_name in models.values() for model in same_name]
    found = every if element is None else choose(models, element, "block_model.element")
    if len(found) > 1 and element in models:
        raise InputError(f"has {len(found)} block models called {element!r}: rename them, and export it again")
    if len(found) > 1:
        raise InputError(f"has {len(found)} block models: name one by block_model.element: {shown(models)}")
    grid = found[0]
    if not is_2 and counted_first is None:
        raise InputError(
            "is of OMF 1, which does not say how blocks are counted: give block_model.counted_first, u or w"
        )
    metres = unit if unit is not None else own_unit if own_unit is not None else unstated
    if np.isnan(metres):
        raise InputError("is drawn in a unit that no mine is drawn in: give block_model.units")
    if absent := [name for name in wanted if name not in grid.data]:
        raise InputError(f"has no data {absent[0]!r} on its blocks: it has {shown(grid.data) or 'none'}")
    lower, upper = grid.corners or _corners(grid.sides, counted_first == "w" and not is_2)
    columns = {name: grid.data[name]() for name in wanted}
    if wrong := [name for name, column in columns.items() if len(column) != len(lower)]:
        raise InputError(f"data {wrong[0]!r} has {len(columns[wrong[0]]):,} values for {len(lower):,} blocks")
    if not (upper > lower).all():
        raise InputError("has a block with a side of 0 or less")
    return BlockTable(Blocks(metres * lower, metres * upper, metres * grid.origin, grid.axes), columns)


def _corners(sides: list[np.ndarray], w_first: bool) -> tuple[np.ndarray, np.ndarray]:
    """Lower and upper corners (block, 3) of a tensor grid: u changes first, or w."""
    ends = [np.append(0.0, np.cumsum(side)) for side in sides]
    shape = [len(side) for side in sides]
    index = np.unravel_index(np.arange(np.prod(shape)), shape, order="C" if w_first else "F")
    lower, upper = (np.column_stack([end[one + step] for end, one in zip(ends, index, strict=True)]) for step in (0, 1))
    return lower, upper


def _axes(values: Iterable) -> np.ndarray:
    """Three orthonormal axes, rows. Raises InputError for others."""
    axes = np.array([*values], float).reshape(3, 3)
    if not np.allclose(axes @ axes.T, np.eye(3), atol=1e-6):
        raise InputError("has axes of blocks that are not at right angles: export it again")
    return axes


def _models_1(content: bytes) -> tuple[dict[str, list[Grid]], float | None]:
    objects, project = objects_1(content)
    found: dict[str, list[Grid]] = {}
    for key in project.get("elements", []):
        element = objects[key]
        geometry = objects[element["geometry"]]
        if geometry["__class__"] != "VolumeGridGeometry":
            continue
        data = {}
        for one in (objects[name] for name in element.get("data", [])):
            if one.get("location") == "cells" and one["__class__"] in ("ScalarData", "MappedData", "StringData"):
                data[one.get("name", "")] = _reader_1(content, objects, one)
        grid = Grid(
            [np.array(geometry[f"tensor_{axis}"], float) for axis in "uvw"],
            origin_of(geometry) + origin_of(project),
            _axes(_vector(geometry.get(f"axis_{axis}", axis)) for axis in "uvw"),
            data,
        )
        found.setdefault(element.get("name", ""), []).append(grid)
    return found, stated_unit(project.get("units", ""))


def _vector(value: Any) -> list[float]:
    """A direction, which may be the name of an axis."""
    names = {"u": 0, "v": 1, "w": 2, "x": 0, "y": 1, "z": 2}
    return np.eye(3)[names[value.lower()]].tolist() if isinstance(value, str) else value


def _reader_1(content: bytes, objects: dict, data: dict) -> Callable[[], np.ndarray]:
    def read() -> np.ndarray:
        held = objects[data["array"]]["array"]
        if isinstance(held, list):
            return np.array(held, dtype=object)
        if held["dtype"] not in ARRAY_TYPES_1:
            raise InputError(f"holds an array of type {held['dtype']!r}: export it again")
        values = np.frombuffer(zlib.decompress(content[held["start"] : held["start"] + held["length"]]), held["dtype"])
        return values if data["__class__"] == "ScalarData" else _named(values, _legend_1(objects, data))

    return read


def _legend_1(objects: dict, data: dict) -> list[str]:
    """Names of the classes: the first legend that holds text."""
    for key in data.get("legends", []):
        values = objects[objects[key]["values"]]["array"]
        if isinstance(values, list) and all(isinstance(value, str) for value in values):
            return values
    raise InputError(f"data {data.get('name', '')!r} has classes without names: export it again")


def _named(index: np.ndarray, names: list[str]) -> np.ndarray:
    """Names (block,) of classes by their index, empty where it names none."""
    known = (index >= 0) & (index < len(names))
    return np.array([*names, ""], dtype=object)[np.where(known, index, len(names)).astype(np.int64)]


def _models_2(content: bytes) -> tuple[dict[str, list[Grid]], float | None]:
    found: dict[str, list[Grid]] = {}
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        check_version_2(archive)
        project = json.loads(gzip.decompress(archive.read(INDEX_2)))
        for element in elements_2(project.get("elements", [])):
            if element["geometry"]["type"] == "BlockModel":
                found.setdefault(element["name"], []).append(_grid_2(content, archive, element, project))
    return found, unit_2(project)


def _grid_2(content: bytes, archive: zipfile.ZipFile, element: dict, project: dict) -> Grid:
    geometry = element["geometry"]
    orient, grid, parts = geometry["orient"], geometry["grid"], geometry.get("subblocks")
    if grid["type"] == "Regular":
        sides = [np.full(count, float(size)) for size, count in zip(grid["size"], grid["count"], strict=True)]
    else:
        sides = [_columns_2(archive, grid[axis], ["scalar"])[0].astype(float) for axis in "uvw"]
    axes = _axes(orient.get(axis, _vector(axis)) for axis in "uvw")
    location = "Subblocks" if parts else "Primitives"
    data = {
        one["name"]: _reader_2(content, one["data"])
        for one in element.get("attributes", [])
        if one["location"] == location and one["data"]["type"] in ("Number", "Category", "Text")
    }
    corners = _parts_2(archive, parts, sides) if parts else None
    return Grid(sides, origin_of(orient) + origin_of(project), axes, data, corners)


def _parts_2(archive: zipfile.ZipFile, parts: dict, sides: list[np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """Lower and upper corners (block, 3) of sub-blocks, which have places within the blocks of a grid."""
    columns = np.column_stack(_columns_2(archive, parts["subblocks"], CORNERS_2)).astype(float)
    parent = columns[:, :3].astype(np.int64)
    ends = [np.append(0.0, np.cumsum(side)) for side in sides]
    if len(parent) and ((parent < 0) | (parent >= [len(side) for side in sides])).any():
        raise InputError("has sub-blocks of blocks that do not exist: export it again")
    base = np.column_stack([end[one] for end, one in zip(ends, parent.T, strict=True)])
    side = np.column_stack([own[one] for own, one in zip(sides, parent.T, strict=True)])
    count = np.array(parts["count"], float) if parts["type"] == "Regular" else 1.0
    return base + side * columns[:, 3:6] / count, base + side * columns[:, 6:] / count


def _reader_2(content: bytes, data: dict) -> Callable[[], np.ndarray]:
    def read() -> np.ndarray:
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            if data["type"] == "Number":
                return _columns_2(archive, data["values"], ["number"])[0]
            if data["type"] == "Text":
                return _columns_2(archive, data["values"], ["text"])[0]
            names = _columns_2(archive, data["names"], ["name"])[0].tolist()
            index = _columns_2(archive, data["values"], ["index"])[0]
            return _named(np.nan_to_num(index.astype(float), nan=-1.0), names)

    return read


def _columns_2(archive: zipfile.ZipFile, place: dict, names: list[str]) -> list[np.ndarray]:
    """The columns of a Parquet file of an OMF 2 archive. Raises InputError for others than these."""
    import pyarrow.parquet

    table = pyarrow.parquet.read_table(io.BytesIO(archive.read(place["filename"])))
    if table.column_names != names or len(table) != place["item_count"]:
        raise InputError(f"holds columns {shown(table.column_names)} for {shown(names)}: export it again")
    return [column.to_numpy() for column in table.columns]
