"""Triangles of STL, OBJ, PLY and OMF files, in the units they are written in, and the choice among a file's bodies.

A file may hold several bodies: layers of a drawing, elements of a project, objects of a mesh. They are chosen by name.
"""

import logging
import re
from collections.abc import Iterable
from fnmatch import fnmatchcase
from pathlib import Path
from typing import TypeVar

import numpy as np

from common.errors import InputError

ALL_NAMES = "*"  # As element or layer it stands for all of them, which are one solid together.
MAX_NAMES_SHOWN = 20
STL_FACET = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
NO_STL = "neither text with vertices nor binary with triangles: export it again"
STL_HEADER = 84  # bytes: 80 of text, then the number of triangles
Part = TypeVar("Part")
Mesh = tuple[np.ndarray, np.ndarray]  # vertices (v, 3), triangles (f, 3)


def choose(parts: dict[str, list[Part]], named: str | None, what: str) -> list[Part]:
    """The parts of the layer or element `named`, "*" standing for any text; of the only one, if none is named.

    Raises InputError otherwise.
    """
    if not parts:
        raise InputError("holds no triangulated surface: export the solid as one")
    if named is None and len(parts) > 1:
        raise InputError(f'has {len(parts)} {what}s: name one by `{what}`, or "{ALL_NAMES}" for all: {shown(parts)}')
    if named in parts:
        return parts[named]
    found = [part for name, some in parts.items() if named is None or fnmatchcase(name, named) for part in some]
    if not found:
        raise InputError(f"{what} {named!r} is not one of {shown(parts)}")
    return found


def shown(names: Iterable[str]) -> str:
    """The first of these names, and how many more there are."""
    names = list(names)
    more = f" and {len(names) - MAX_NAMES_SHOWN} more" if len(names) > MAX_NAMES_SHOWN else ""
    return ", ".join(names[:MAX_NAMES_SHOWN]) + more


def join(meshes: list[Mesh]) -> Mesh:
    """Several meshes as one."""
    before = np.cumsum([0] + [len(vertices) for vertices, _ in meshes])
    facets = [facets + start for (_, facets), start in zip(meshes, before, strict=False)]
    return np.concatenate([vertices for vertices, _ in meshes]), np.concatenate(facets)


def triangles(faces: list) -> np.ndarray:
    """Faces of any number of corners, as triangles (f, 3) round their first: cancelling where a face is not convex."""
    fans = [(face[0], face[i], face[i + 1]) for face in faces for i in range(1, len(face) - 1)]
    return np.array(fans, dtype=np.int64).reshape(-1, 3)


def read_stl(path: Path, element: str | None = None) -> Mesh:
    """Every body of an STL file together, or the `solid` of a text file by its name. Vertices of a binary file are
    float32, as it holds them."""
    raw = path.read_bytes()
    has_zeros = b"\0" in raw  # numbers of binary STL have zero bytes, text has none; headers may begin with any word
    counted = int.from_bytes(raw[80:STL_HEADER], "little")
    if has_zeros or len(raw) == STL_HEADER + counted * STL_FACET.itemsize:
        return _binary_stl(raw, counted, element)
    if not re.search(rb"vertex", raw, re.IGNORECASE):
        raise InputError(NO_STL)
    import trimesh

    scene = trimesh.load_scene(path, process=False)  # trimesh would merge vertices that are near, not equal
    bodies = {name: [(np.asarray(body.vertices), np.asarray(body.faces))] for name, body in scene.geometry.items()}
    if len(bodies) == 1:  # trimesh names a lone one after its file
        first = raw.partition(b"\n")[0].decode(errors="replace").strip()
        bodies = {first[len("solid") :].strip(): next(iter(bodies.values()))}
    return join(choose(bodies, element or ALL_NAMES, "element"))


def _binary_stl(raw: bytes, counted: int, element: str | None) -> Mesh:
    held = (len(raw) - STL_HEADER) // STL_FACET.itemsize
    if held < 1 or counted == 0:
        raise InputError(NO_STL)
    if counted > held:
        raise InputError(f"is cut off: {counted:,} triangles are announced, {held:,} are there: export it again")
    if element:
        raise InputError("binary STL has no names: remove `element`, or export each body to a file of its own")
    if len(raw) > STL_HEADER + counted * STL_FACET.itemsize:
        logging.warning("more follows its %d triangles; left out", counted)
    facets = np.frombuffer(raw, STL_FACET, counted, STL_HEADER)
    return facets["corners"].reshape(-1, 3), np.arange(3 * counted).reshape(-1, 3)


def read_obj(path: Path, element: str | None = None) -> Mesh:
    """Every body of an OBJ file together, or those of one object (`o`) or group (`g`). Faces may have many corners."""
    vertices, named = [], ["", ""]
    bodies: dict[tuple[str, ...], list] = {}
    faces = bodies.setdefault(("", ""), [])
    with path.open(encoding="utf-8", errors="replace") as lines:
        rest = ""
        for line in lines:
            if line.rstrip("\r\n").endswith("\\"):
                rest += line.rstrip("\r\n")[:-1]
                continue
            words = (rest + line).split()
            rest = ""
            if not words:
                continue
            if words[0] == "v":
                vertices.append(words[1:4])
            elif words[0] == "f":
                corners = [int(word.split("/")[0]) for word in words[1:]]
                if 0 in corners:
                    raise InputError("has a face of vertex 0, where they count from 1: export it again")
                faces.append([corner - 1 if corner > 0 else len(vertices) + corner for corner in corners])
            elif words[0] in ("o", "g"):
                named["og".index(words[0])] = " ".join(words[1:])
                faces = bodies.setdefault(tuple(named), [])
    parts: dict[str, list[list]] = {}
    for names, body in bodies.items():
        for name in dict.fromkeys(name for name in names if name) or ("unnamed",):
            if body:
                parts.setdefault(name, []).append(body)
    if element is None:
        chosen = list(bodies.values())
    else:
        chosen = list({id(body): body for body in choose(parts, element, "element")}.values())
    places = np.array(vertices, dtype=np.float64).reshape(-1, 3)
    return places, triangles([face for body in chosen for face in body])


def read_ply(path: Path) -> Mesh:
    """The one body of a PLY file. Its vertices are float32 where all of them are numbers of that kind."""
    import trimesh

    mesh = trimesh.load_mesh(path, process=False)
    if not hasattr(mesh, "faces"):
        raise InputError("holds points but no triangles: export the solid as a triangulated surface")
    vertices = np.asarray(mesh.vertices, dtype=np.float64)
    with np.errstate(over="ignore"):
        single = vertices.astype(np.float32)
    return single if (single == vertices).all() else vertices, np.asarray(mesh.faces, dtype=np.int64)


def read_omf(path: Path, element: str | None = None) -> Mesh:
    """Triangulated surfaces of an OMF 1 project, each moved by its own origin and the project's."""
    import omf

    with path.open("rb") as file:
        if file.read(4) == b"PK\x03\x04":  # an archive; version 1 is not
            raise InputError("is of OMF 2, which is not read here: export it as OMF 1, or the surface as OBJ or DXF")
    project = omf.OMFReader(str(path)).get_project()
    surfaces: dict[str, list[Mesh]] = {}
    others = []
    for part in project.elements:
        geometry = part.geometry
        if isinstance(part, omf.SurfaceElement) and isinstance(geometry, omf.SurfaceGeometry):
            origin = np.asarray(geometry.origin, dtype=np.float64) + np.asarray(project.origin, dtype=np.float64)
            vertices = np.asarray(geometry.vertices.array, dtype=np.float64) + origin
            mesh = vertices, np.asarray(geometry.triangles.array, dtype=np.int64)
            surfaces.setdefault(part.name, []).append(mesh)
        else:
            others.append(part.name)
    if others and (not surfaces or element in others):
        names = ", ".join(others)
        raise InputError(f"{names}: no triangulated surface (points, lines, blocks or a height field): export one")
    return join(choose(surfaces, element, "element"))
