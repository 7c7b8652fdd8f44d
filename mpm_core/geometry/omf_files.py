"""Triangulated surfaces of Open Mining Format (OMF) projects.

OMF 1 (https://omf.readthedocs.io/en/stable/content/io.html): a header of 60 bytes, then arrays that are compressed with
zlib, then JSON with all objects by their identifiers. The header states where the JSON begins.
"""

import json
import struct
import uuid
import zlib
from pathlib import Path
from typing import NamedTuple

import numpy as np

from common.errors import InputError
from mpm_core.geometry.meshes import Mesh, choose, join, parsed_once, stated_unit

HEADER_1 = struct.Struct("<4s32s16sQ")  # magic number, version, identifier of the project, offset of the JSON
MAGIC_1, VERSION_1 = b"\x84\x83\x82\x81", "OMF-v0.9.0"
ARCHIVE = b"PK\x03\x04"  # first bytes of OMF 2
ARRAY_TYPES_1 = ("<f8", "<i8")


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
    if others and (not surfaces or element in others):
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
        raise InputError("is of OMF 2, which is not read here: export it as OMF 1, or the surface as OBJ or DXF")
    return _project_1(content)


def _project_1(content: bytes) -> Project:
    """The project of an OMF 1 file. Raises InputError for what is none; other errors for damaged content."""
    if not content.startswith(MAGIC_1) or len(content) < HEADER_1.size:
        raise InputError("is no OMF project: export it again")
    _, version, identifier, json_start = HEADER_1.unpack_from(content)
    text = version.rstrip(b"\0").decode("ascii", errors="replace")
    if text != VERSION_1:
        raise InputError(f"is of version {text!r} of OMF, which is not read here: export it as {VERSION_1}")
    if not HEADER_1.size <= json_start < len(content):
        raise InputError("is cut off: its description is missing: export it again")
    objects = json.loads(content[json_start:].decode("utf-8"))
    project = objects[str(uuid.UUID(bytes=identifier))]
    found = Project({}, [], stated_unit(project.get("units", "")))
    for key in project.get("elements", []):
        element = objects[key]
        geometry = objects[element["geometry"]]
        name = element.get("name", "")
        if geometry["__class__"] != "SurfaceGeometry":
            found.others.append(name)
            continue
        origin = _origin(geometry) + _origin(project)
        vertices, facets = (_array_1(content, objects[geometry[part]]["array"]) for part in ("vertices", "triangles"))
        found.surfaces.setdefault(name, []).append((vertices + origin, facets.astype(np.int64)))
    return found


def _origin(owner: dict) -> np.ndarray:
    """Origin (3,) of a project or a geometry; zero where it states none."""
    return np.array(owner.get("origin", (0.0, 0.0, 0.0)), dtype=np.float64).reshape(3)


def _array_1(content: bytes, place: dict) -> np.ndarray:
    """Array (n, 3) of a file of OMF 1."""
    if place["dtype"] not in ARRAY_TYPES_1:
        raise InputError(f"holds an array of type {place['dtype']!r}: export it again")
    raw = zlib.decompress(content[place["start"] : place["start"] + place["length"]])
    return np.frombuffer(raw, place["dtype"]).reshape(-1, 3)
