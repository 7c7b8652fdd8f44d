"""Projects of the Open Mining Format, version 1 (OMF-v0.9.0): surfaces and points with data.

The form is described in https://omf.readthedocs.io/en/stable/content/io.html: a header of 60 bytes, arrays compressed
with zlib, and JSON with all objects by their identifiers. Identifiers follow from the content, and no time of writing
is stored, so that the same results make the same file.
"""

import json
import os
import struct
import uuid
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from common.datasets import atomic_path

HEADER = struct.Struct("<4s32s16sQ")  # magic number, version, identifier of the project, offset of the JSON
MAGIC, VERSION = b"\x84\x83\x82\x81", b"OMF-v0.9.0"
UNIT_NAMES = {"m": "m", "ft": "ft", "us_ft": "survey_foot"}  # by the unit of the mine's grid
TIME = "1970-01-01T00:00:00Z"  # Objects must say when they were made.
COLOR = [200, 60, 40]


@dataclass(frozen=True)
class Points:
    """Points (point, 3) with data by name: numbers (point,), or texts."""

    name: str
    vertices: NDArray
    data: Mapping[str, NDArray | Sequence[str]] = field(default_factory=dict)
    description: str = ""


@dataclass(frozen=True)
class Triangles:
    """A surface: vertices (vertex, 3) and triangles (triangle, 3)."""

    name: str
    vertices: NDArray
    triangles: NDArray
    description: str = ""


def write_project(
    name: str, elements: Sequence[Points | Triangles], unit: str, path: str | os.PathLike, description: str = ""
) -> None:
    """Write a project atomically; elements without a point are left out, as the format has none.

    unit: one of UNIT_NAMES, of all coordinates, which are stored as float64 and without an origin.
    """
    content = _Content(name)
    rows = [content.element(one) for one in elements if len(one.vertices)]
    values = {"name": name, "description": description, "author": "", "revision": "", "units": UNIT_NAMES[unit]}
    project = content.add("Project", **values, elements=rows, origin=[0.0, 0.0, 0.0])
    with atomic_path(path) as temporary, temporary.open("wb") as file:
        file.write(HEADER.pack(MAGIC, VERSION, uuid.UUID(project).bytes, HEADER.size + content.size))
        for block in content.blocks:
            file.write(block)
        file.write(json.dumps(content.objects).encode("utf-8"))


class _Content:
    """Objects of a project by their identifiers, and the blocks of its arrays."""

    def __init__(self, name: str):
        self.space = uuid.uuid5(uuid.NAMESPACE_OID, name)
        self.objects: dict[str, dict] = {}
        self.blocks: list[bytes] = []
        self.size = 0

    def add(self, kind: str, **values) -> str:
        """Add an object of a class, and return its identifier."""
        made = {"date_created": TIME, "date_modified": TIME, **values, "__class__": kind}
        key = str(uuid.uuid5(self.space, f"{len(self.objects)} {json.dumps(made)}"))
        self.objects[key] = made
        return key

    def array(self, kind: str, values: NDArray) -> str:
        """Add an array of numbers: float64, or int64 of whole ones."""
        dtype = "<i8" if kind == "Int3Array" else "<f8"
        block = zlib.compress(np.ascontiguousarray(values, dtype).tobytes())
        place = {"start": HEADER.size + self.size, "dtype": dtype, "length": len(block)}
        self.blocks.append(block)
        self.size += len(block)
        return self.add(kind, array=place)

    def element(self, one: Points | Triangles) -> str:
        """Add an element."""
        geometry = {"origin": [0.0, 0.0, 0.0], "vertices": self.array("Vector3Array", one.vertices)}
        about = {"name": one.name, "description": one.description, "color": COLOR, "textures": []}
        if isinstance(one, Triangles):
            geometry["triangles"] = self.array("Int3Array", one.triangles)
            shape = self.add("SurfaceGeometry", **geometry)
            return self.add("SurfaceElement", **about, data=[], subtype="surface", geometry=shape)
        shape = self.add("PointSetGeometry", **geometry)
        data = [self.data(name, values) for name, values in one.data.items()]
        return self.add("PointSetElement", **about, data=data, subtype="point", geometry=shape)

    def data(self, name: str, values: NDArray | Sequence[str]) -> str:
        """Add data of points."""
        kind = "Scalar"
        if isinstance(values, np.ndarray) and values.dtype.kind in "fiub":
            array = self.array("ScalarArray", values)
        else:
            kind, array = "String", self.add("StringArray", array=[str(value) for value in values])
        return self.add(f"{kind}Data", name=name, description="", location="vertices", array=array)
