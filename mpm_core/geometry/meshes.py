"""Triangles of STL, OBJ and PLY files, in the units they are written in, and the choice among a file's bodies.

A file may hold several bodies: layers of a drawing, elements of a project, objects of a mesh. They are chosen by name.
"""

import functools
import logging
import re
from collections.abc import Callable, Iterable
from fnmatch import fnmatchcase
from pathlib import Path
from typing import TypeVar

import numpy as np

from common.errors import InputError
from common.quantities import factor

ALL_NAMES = "*"  # As element or layer it stands for all of them, which are one solid together.
UNNAMED = "unnamed"  # Name of the faces of an OBJ file that are in no object or group.
MAX_NAMES_SHOWN = 20
NO_UNIT = ("", "none", "unknown")  # in lower case: texts of files in place of a unit
UNIT_WORD = re.compile(r"[A-Za-z_]{1,30}")
STL_FACET = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
NO_STL = "neither text with vertices nor binary with triangles: export it again"
STL_HEADER = 84  # bytes: 80 of text, then the number of triangles
Part = TypeVar("Part")
Parsed = TypeVar("Parsed")
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


def parsed_once(files: int) -> Callable[[Callable[[Path], Parsed]], Callable[[Path], Parsed]]:
    """Decorator of a parser of a path: it parses a file again only if the file has changed since.

    files: number of files whose content is kept. Hundreds of stopes are bodies of one file.
    """

    def decorate(parse: Callable[[Path], Parsed]) -> Callable[[Path], Parsed]:
        known = functools.lru_cache(maxsize=files)(lambda path, modified, size: parse(path))

        @functools.wraps(parse)
        def parsed(path: Path) -> Parsed:
            stamp = path.stat()
            return known(path, stamp.st_mtime_ns, stamp.st_size)

        return parsed

    return decorate


def shown(names: Iterable[str]) -> str:
    """The first of these names, and how many more there are."""
    names = list(names)
    more = f" and {len(names) - MAX_NAMES_SHOWN} more" if len(names) > MAX_NAMES_SHOWN else ""
    return ", ".join(names[:MAX_NAMES_SHOWN]) + more


def stated_unit(text: str) -> float | None:
    """Metres of the unit that a file states; None for no unit, NaN for a word that is no unit of length."""
    if text.strip().lower() in NO_UNIT:
        return None
    try:
        return factor(text.strip().lower(), "m") if UNIT_WORD.fullmatch(text.strip()) else np.nan
    except ValueError:
        return np.nan


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
    if not _is_text_stl(path):
        raw = path.read_bytes()
        return _binary_stl(raw, _announced(raw), element)
    return join(choose(_parsed_stl(path), element or ALL_NAMES, "element"))


def stl_names(path: Path) -> list[str]:
    """Names of the solids of a text STL file; none of a binary one."""
    return list(_parsed_stl(path)) if _is_text_stl(path) else []


def _announced(raw: bytes) -> int:
    """Number of triangles that the head of a binary STL file announces."""
    return int.from_bytes(raw[80:STL_HEADER], "little")


def _is_text_stl(path: Path) -> bool:
    raw = path.read_bytes()
    has_zeros = b"\0" in raw  # numbers of binary STL have zero bytes, text has none; headers may begin with any word
    return not has_zeros and len(raw) != STL_HEADER + _announced(raw) * STL_FACET.itemsize


@parsed_once(8)
def _parsed_stl(path: Path) -> dict[str, list[Mesh]]:
    """Solids of a text STL file by name. Raises InputError for a file without vertices."""
    raw = path.read_bytes()
    if not re.search(rb"vertex", raw, re.IGNORECASE):
        raise InputError(NO_STL)
    import trimesh

    scene = trimesh.load_scene(path, process=False)  # trimesh would merge vertices that are near, not equal
    bodies = {name: [(np.asarray(body.vertices), np.asarray(body.faces))] for name, body in scene.geometry.items()}
    if len(bodies) == 1:  # trimesh names a lone one after its file
        first = raw.partition(b"\n")[0].decode(errors="replace").strip()
        bodies = {first[len("solid") :].strip(): next(iter(bodies.values()))}
    return bodies


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
    places, bodies = _parsed_obj(path)
    if element is None:
        chosen = list(bodies.values())
    else:
        parts: dict[str, list[np.ndarray]] = {}
        for names, body in bodies.items():
            for name in dict.fromkeys(name for name in names if name) or (UNNAMED,):
                parts.setdefault(name, []).append(body)
        chosen = list({id(body): body for body in choose(parts, element, "element")}.values())
    facets = np.concatenate([np.zeros((0, 3), np.int64), *chosen])
    return places, facets


def obj_names(path: Path) -> list[str]:
    """Names of the objects of an OBJ file, and of the groups that are in none; none of a file that names none."""
    _, bodies = _parsed_obj(path)
    names = list(dict.fromkeys(name or group or UNNAMED for name, group in bodies))
    return [] if names == [UNNAMED] else names


@parsed_once(8)
def _parsed_obj(path: Path) -> tuple[np.ndarray, dict[tuple[str, str], np.ndarray]]:
    """Vertices (v, 3) of an OBJ file, and triangles (f, 3) by object and group, which are empty texts where it names
    none. Raises InputError for a file without faces."""
    vertices, named = [], ["", ""]
    bodies: dict[tuple[str, str], list] = {}
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
                faces = bodies.setdefault((named[0], named[1]), [])
    places = np.array(vertices, dtype=np.float64).reshape(-1, 3)
    return places, {names: triangles(body) for names, body in bodies.items() if body}


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
