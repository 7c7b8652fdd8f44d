"""Triangulated surfaces of Open Mining Format (OMF) projects.

OMF 1 (https://omf.readthedocs.io/en/stable/content/io.html): a header of 60 bytes, then arrays that are compressed with
zlib, then JSON with all objects by their identifiers. The header states where the JSON begins.

OMF 2 (https://github.com/gmggroup/omf-rust, docs/format.md and omf.schema.json): a zip archive whose comment names the
format. It holds the project as JSON, which nests its elements, and each array as a Parquet file.
"""

import gzip
import io
import json
import re
import struct
import uuid
import zipfile
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np

from common.errors import InputError
from mpm_core.geometry.meshes import Mesh, choose, join, parsed_once, stated_unit

HEADER_1 = struct.Struct("<4s32s16sQ")  # magic number, version, identifier of the project, offset of the JSON
MAGIC_1, VERSION_1 = b"\x84\x83\x82\x81", "OMF-v0.9.0"
ARRAY_TYPES_1 = ("<f8", "<i8")
ARCHIVE = b"PK\x03\x04"  # first bytes of OMF 2
COMMENT_2 = re.compile(rb"Open Mining Format (?P<version>\d+\.\d+)(-.*)?")
VERSION_2, INDEX_2 = "2.0", "index.json.gz"
COLUMNS_2 = {"vertices": ["x", "y", "z"], "triangles": ["a", "b", "c"]}  # of the Parquet files
TYPES_2 = {"vertices": ("float", "double"), "triangles": ("uint32",)}


class Project(NamedTuple):
    """Content of a file: its triangulated surfaces by name, names of its other elements, and metres of its unit.

    The unit is None where the file states none, and NaN where it states no length.
    """

    surfaces: dict[str, list[Mesh]]
    others: list[str]
    unit: float | None


def read_omf(path: Path, element: str | None = None) -> tuple[Mesh, float | None]:
    """The surfaces of the name `element`, each moved by its own origin and the project's, and metres of their unit."""
    surfaces, others, unit = _parsed_omf(path)
    if others and element not in surfaces and (not surfaces or element in others):
        names = ", ".join(others)
        raise InputError(f"{names}: no triangulated surface (points, lines, blocks or a height field): export one")
    return join(choose(surfaces, element, "element")), unit


def omf_names(path: Path) -> list[str]:
    """Names of the triangulated surfaces of an OMF project, a repeated one as often as it is there."""
    return [name for name, meshes in _parsed_omf(path).surfaces.items() for _ in meshes]


@parsed_once(8)
def _parsed_omf(path: Path) -> Project:
    content = path.read_bytes()
    if content.startswith(ARCHIVE):
        return _project_2(content)
    return _project_1(content)


def objects_1(content: bytes) -> tuple[dict, dict]:
    """All objects of an OMF 1 file by their identifiers, and its project. Raises InputError for what is none."""
    if not content.startswith(MAGIC_1) or len(content) < HEADER_1.size:
        raise InputError("is no OMF project: export it again")
    _, version, identifier, json_start = HEADER_1.unpack_from(content)
    text = version.partition(b"\0")[0].decode("ascii", errors="replace")
    if text != VERSION_1:
        raise InputError(f"is of version {text!r} of OMF, which is not read here: export it as {VERSION_1}")
    if not HEADER_1.size <= json_start < len(content):
        raise InputError("is cut off: its description is missing: export it again")
    objects = json.loads(content[json_start:].decode("utf-8"))
    return objects, objects[str(uuid.UUID(bytes=identifier))]


def _project_1(content: bytes) -> Project:
    """The project of an OMF 1 file. Raises InputError for what is none; other errors for damaged content."""
    objects, project = objects_1(content)
    found = Project({}, [], stated_unit(project.get("units", "")))
    for key in project.get("elements", []):
        element = objects[key]
        geometry = objects[element["geometry"]]
        name = element.get("name", "")
        if geometry["__class__"] != "SurfaceGeometry":
            found.others.append(name)
            continue
        origin = origin_of(geometry) + origin_of(project)
        vertices, facets = (_array_1(content, objects[geometry[part]]["array"]) for part in ("vertices", "triangles"))
        found.surfaces.setdefault(name, []).append((vertices + origin, facets.astype(np.int64)))
    return found


def origin_of(owner: dict) -> np.ndarray:
    """Origin (3,) of a project or a geometry; zero where it states none."""
    return np.array(owner.get("origin", (0.0, 0.0, 0.0)), dtype=np.float64).reshape(3)


def _array_1(content: bytes, place: dict) -> np.ndarray:
    """Array (n, 3) of a file of OMF 1."""
    if place["dtype"] not in ARRAY_TYPES_1:
        raise InputError(f"holds an array of type {place['dtype']!r}: export it again")
    raw = zlib.decompress(content[place["start"] : place["start"] + place["length"]])
    return np.frombuffer(raw, place["dtype"]).reshape(-1, 3)


def _project_2(content: bytes) -> Project:
    """The project of an OMF 2 file. Raises InputError for what is none; other errors for damaged content."""
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        check_version_2(archive)
        project = json.loads(gzip.decompress(archive.read(INDEX_2)))
        found = Project({}, [], unit_2(project))
        for element in elements_2(project.get("elements", [])):
            geometry = element["geometry"]
            if geometry["type"] != "Surface":
                found.others.append(element["name"])
                continue
            origin = origin_of(geometry) + origin_of(project)
            vertices, facets = (_array_2(archive, geometry[part], part) for part in COLUMNS_2)
            # Only single precision without an origin is as coarse as it looks.
            mesh = vertices + origin if origin.any() else vertices, facets.astype(np.int64)
            found.surfaces.setdefault(element["name"], []).append(mesh)
    return found


def check_version_2(archive: zipfile.ZipFile) -> None:
    """Raise InputError for an archive that is no project of OMF 2."""
    stated = COMMENT_2.fullmatch(archive.comment)
    if stated is None:
        raise InputError("is a zip archive, but no OMF project: its comment does not name the format: export it again")
    if (version := stated["version"].decode()) != VERSION_2:
        raise InputError(f"is of OMF {version}, which is not read here: export it as OMF {VERSION_2} or 1")


def elements_2(elements: list[dict]) -> Iterator[dict]:
    """Elements of a project, those within composites in place of the composites."""
    for element in elements:
        if element["geometry"]["type"] == "Composite":
            yield from elements_2(element["geometry"].get("elements", []))
        else:
            yield element


def unit_2(project: dict) -> float | None:
    """Metres of a project's unit, which its coordinate reference system defines where it states none.

    None where it has neither, NaN for what is no length or not known.
    """
    system = project.get("coordinate_reference_system", "")
    if project.get("units") or not system:
        return stated_unit(project.get("units", ""))
    import pyproj

    try:
        known = pyproj.CRS.from_user_input(system)
    except pyproj.exceptions.CRSError:
        return np.nan
    return np.nan if known.is_geographic else known.axis_info[0].unit_conversion_factor


def _array_2(archive: zipfile.ZipFile, place: dict, part: str) -> np.ndarray:
    """Array (n, 3) of a Parquet file of an OMF 2 archive; part: one of COLUMNS_2. Raises InputError for another."""
    import pyarrow.parquet

    table = pyarrow.parquet.read_table(io.BytesIO(archive.read(place["filename"])))
    types = {str(kind) for kind in table.schema.types}
    is_expected = table.column_names == COLUMNS_2[part] and len(types) == 1 and types <= {*TYPES_2[part]}
    if not is_expected or len(table) != place["item_count"] or any(column.null_count for column in table.columns):
        raise InputError(
            f"holds {part} that are not as OMF {VERSION_2} has them ({place['filename']}): export it again"
        )
    return np.column_stack([column.to_numpy() for column in table.columns])
