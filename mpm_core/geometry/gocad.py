"""Triangulated surfaces (TSurf) of GOCAD files, text of one keyword a line (http://paulbourke.net/dataformats/gocad).

A file holds objects, each from a line GOCAD to a line END. Vertices (VRTX, PVRTX) have identifiers within their object.
An ATOM or PATOM is one more identifier of a vertex. Properties, which follow coordinates and corners, are not read.
"""

import logging
import re
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from common.errors import InputError
from mpm_core.geometry.meshes import UNNAMED, Mesh, choose, join, parsed_once, stated_unit

NAME = re.compile(r"(?:(?:HEADER|HDR)\b[\s{]*)?name\s*:(?P<name>[^}]*)", re.IGNORECASE)
AXIS_WORD = re.compile(r'"([^"]*)"|(\S+)')
DOWNWARD = {"DEPTH": True, "ELEVATION": False}  # by the word that follows ZPOSITIVE


@dataclass
class Surface:
    """A TSurf while it is read."""

    name: str = UNNAMED
    places: dict[str, int] = field(default_factory=dict)
    """Row of `vertices` by identifier."""
    vertices: list[list[str]] = field(default_factory=list)
    facets: list[list[int]] = field(default_factory=list)
    is_downward: bool | None = None
    """True where z counts downward; None where the file does not say so."""

    def mesh(self) -> Mesh:
        """Vertices (v, 3) and triangles (f, 3) as they are written."""
        vertices = np.array(self.vertices, dtype=np.float64).reshape(-1, 3)
        return vertices, np.array(self.facets, dtype=np.int64).reshape(-1, 3)

    def place(self, identifier: str) -> int:
        """Row of the vertex of an identifier. Raises InputError for one that is not there."""
        if identifier not in self.places:
            raise InputError(
                f"object {self.name!r} has a triangle or atom of vertex {identifier}, which it lacks: export it again"
            )
        return self.places[identifier]


def read_gocad(path: Path, element: str | None = None, is_downward: bool = False) -> tuple[Mesh, float | None]:
    """The surfaces of the name `element` of a GOCAD file, and metres of their unit (meshes.stated_unit).

    is_downward: whether z is to count downward. Triangles turn round as z does; where the file does not say how z
    counts, it counts so already.
    """
    surfaces, unit = _parsed_gocad(path)
    chosen = choose(surfaces, element, "element")
    if element is None and len(chosen) > 1:
        logging.warning("%s: its %d surfaces have no names of their own, and are read as one solid", path, len(chosen))
    return join([_turned(*one) if stated not in (None, is_downward) else one for one, stated in chosen]), unit


def _turned(vertices: np.ndarray, facets: np.ndarray) -> Mesh:
    return vertices * [1.0, 1.0, -1.0], facets[:, ::-1]


def gocad_names(path: Path) -> list[str]:
    """Names of the surfaces of a GOCAD file, a repeated one as often as it is there; none of a file that names none."""
    surfaces, _ = _parsed_gocad(path)
    return [] if list(surfaces) == [UNNAMED] else [name for name, meshes in surfaces.items() for _ in meshes]


@parsed_once(8)
def _parsed_gocad(path: Path) -> tuple[dict[str, list[tuple[Mesh, bool | None]]], float | None]:
    """Surfaces of a file by name, each with whether z counts downward, and metres of its unit.

    Raises InputError for a file without a TSurf, one that is cut off, and one that states several units.
    """
    surfaces: dict[str, list[tuple[Mesh, bool | None]]] = {}
    units: dict[float, str] = {}
    kinds: list[str] = []
    surface: Surface | None = None
    is_open = in_header = False
    with path.open(encoding="utf-8", errors="replace") as lines:
        for line in lines:
            words = line.split()
            key = words[0].upper() if words else ""
            if key == "GOCAD":
                if is_open:
                    break
                kinds.append(" ".join(words[1:2]))
                is_open, surface = True, Surface() if kinds[-1].lower() == "tsurf" else None
            elif key == "END":
                if surface is not None and surface.facets:
                    surfaces.setdefault(surface.name, []).append((surface.mesh(), surface.is_downward))
                is_open, surface = False, None
            elif surface is None:
                continue
            elif key in ("VRTX", "PVRTX"):
                surface.places[words[1]] = len(surface.vertices)
                surface.vertices.append(words[2:5])
            elif key in ("ATOM", "PATOM"):
                surface.places[words[1]] = surface.place(words[2])
            elif key == "TRGL":
                surface.facets.append([surface.place(word) for word in words[1:4]])
            elif key == "ZPOSITIVE":
                if (word := words[1].upper()) not in DOWNWARD:
                    raise InputError(f"has ZPOSITIVE {words[1]}, neither Depth nor Elevation: export it again")
                surface.is_downward = DOWNWARD[word]
            elif key == "AXIS_UNIT":
                for quoted, bare in AXIS_WORD.findall(line.split(maxsplit=1)[1]):
                    if (unit := stated_unit(quoted or bare)) is not None:
                        units[unit] = quoted or bare
            else:
                in_header |= key.startswith(("HEADER", "HDR"))
                if in_header and surface.name == UNNAMED and (found := NAME.match(line.strip())):
                    surface.name = found["name"].strip().strip('"') or UNNAMED
                in_header &= "}" not in line
    if is_open:
        raise InputError("is cut off: its last object, or one before another, has no END: export it again")
    if "tsurf" not in map(str.lower, kinds):
        held = f"its objects are {', '.join(dict.fromkeys(kinds))}" if kinds else "no line begins with GOCAD"
        raise InputError(f"holds no triangulated surface of GOCAD (TSurf), {held}: export the solid as one")
    if len(units) > 1:
        raise InputError(f"states several units ({', '.join(units.values())}): export it in one")
    return surfaces, next(iter(units), None)
