"""Solids from files that mine planning packages write: STL, OBJ, PLY, DXF, OMF. Coordinates are taken as metres.

trimesh, ezdxf and omf are imported where a file is read: together they take 1.5 s, and most stages read none.
"""

import logging
from collections.abc import Callable
from pathlib import Path

import numpy as np

from mpm_core.geometry.edges import unique_rows
from mpm_core.geometry.orientation import agree, check_bounds_volume, without_partitions
from mpm_core.geometry.solids import Solid
from pipeline.errors import InputError

EVERYTHING = "*"  # as element or layer: all of them, together one solid
Mesh = tuple[np.ndarray, np.ndarray]  # vertices (v, 3) m, triangles (f, 3)


def read_solid(path: str | Path, name: str, element: str | None = None, layer: str | None = None) -> Solid:
    """Read the solid `name` from a file; the file's ending says which format it is.

    element: which surface of an OMF project; layer: which layer of a DXF drawing; "*" for all of them together. Needed
    only if the file has several. Vertices at exactly the same place become one; triangles without area or said twice
    are dropped. Binary STL holds float32: at 1e6 m it is good to 6 cm, and nothing here can mend that.

    Raises InputError naming the file if it is missing, unreadable, of another format, or holds no triangle.
    """
    path = Path(path)
    readers: dict[str, Callable[[], Mesh]] = {
        ".stl": lambda: _read_mesh(path),
        ".obj": lambda: _read_mesh(path),
        ".ply": lambda: _read_mesh(path),
        ".dxf": lambda: _read_dxf(path, layer),
        ".omf": lambda: _read_omf(path, element),
    }
    ending = path.suffix.lower()
    if ending not in readers:
        raise InputError(f"{path}: {name}: not one of the formats {', '.join(readers)}: export it as one of these")
    if (element and ending != ".omf") or (layer and ending != ".dxf"):
        raise InputError(
            f"{path}: {name}: `element` is for OMF files and `layer` for DXF: remove it or convert the file"
        )
    if not path.is_file():
        raise InputError(
            f"{path}: {name}: no such file; relative paths start at the folder of the mine's configuration"
        )
    try:
        vertices, facets = readers[ending]()
    except InputError as error:
        raise InputError(f"{path}: {name}: {error}") from error
    except Exception as error:  # the parsers raise whatever they stumble over
        raise InputError(f"{path}: {name}: unreadable as {ending[1:].upper()} ({error}): export it again") from error
    if len(facets) and (np.min(facets) < 0 or np.max(facets) >= len(vertices)):
        raise InputError(f"{path}: {name}: has triangles of vertices that it does not hold: export it again")
    if not np.isfinite(vertices).all():
        raise InputError(f"{path}: {name}: holds coordinates that are not finite: export it again")
    vertices, facets = _tidy(vertices, facets)
    if len(facets) == 0:
        raise InputError(f"{path}: {name}: holds no triangles: export the solid as a triangulated surface")
    try:
        facets, turned = agree(vertices, facets)
        check_bounds_volume(vertices, facets)
    except InputError as error:
        raise InputError(f"{path}: {name}: {error}") from error
    if turned:
        logging.warning("%s: %s: %d of %d triangles looked the other way; turned", path, name, turned, len(facets))
    return Solid(name, vertices, facets)


def _tidy(vertices: np.ndarray, facets: np.ndarray) -> Mesh:
    """Merge equal vertices, drop triangles with a repeated corner and repeats of the same triangle, keep the order."""
    vertices, facets = np.reshape(vertices, (-1, 3)), np.reshape(facets, (-1, 3))
    vertices, place = unique_rows(vertices)
    facets = place[facets] if len(vertices) else facets
    facets = facets[(facets != np.roll(facets, 1, axis=1)).all(axis=1)]
    facets = without_partitions(facets)
    # the same triangle may start at any of its corners: start it at the smallest, which keeps its orientation
    start = facets.argmin(axis=1, keepdims=True) if len(facets) else np.zeros((0, 1), dtype=np.int64)
    rolled = np.take_along_axis(facets, (start + np.arange(3)) % 3, axis=1)
    _, same = unique_rows(rolled)
    _, first = np.unique(same, return_index=True)
    return vertices, facets[np.sort(first)]


def _read_mesh(path: Path) -> Mesh:
    """STL, OBJ, PLY: every body in the file together."""
    import trimesh

    # process=False: trimesh would merge vertices that are near, not equal
    mesh = trimesh.load_mesh(path, process=False)
    if not hasattr(mesh, "faces"):
        mesh = mesh.to_mesh() if isinstance(mesh, trimesh.Scene) else None
    if mesh is None:
        raise InputError("holds points but no triangles: export the solid as a triangulated surface")
    return np.asarray(mesh.vertices, dtype=np.float64), np.asarray(mesh.faces, dtype=np.int64)


def _read_dxf(path: Path, layer: str | None) -> Mesh:
    """3DFACE, MESH and polyface or polygon-mesh POLYLINE of the model space, inserted blocks included."""
    import ezdxf
    from ezdxf.disassemble import recursive_decompose
    from ezdxf.render import MeshBuilder

    faces: dict[str, list[Mesh]] = {}
    outlines = 0
    for entity in recursive_decompose(ezdxf.readfile(path).modelspace()):
        kind, found = entity.dxftype(), None
        if kind == "3DFACE":
            corners = np.array(entity.wcs_vertices(), dtype=np.float64)
            found = corners, [range(len(corners))]
        elif kind == "MESH":
            builder = MeshBuilder.from_mesh(entity)
            found = builder.vertices, builder.faces
        elif kind == "POLYLINE" and (entity.is_poly_face_mesh or entity.is_polygon_mesh):
            builder = MeshBuilder.from_polyface(entity)
            found = builder.vertices, builder.faces
        elif kind in ("LWPOLYLINE", "POLYLINE"):
            outlines += bool(entity.is_closed)
        if found is not None and layer in (None, EVERYTHING, entity.dxf.layer):
            faces.setdefault(entity.dxf.layer, []).append(_triangles(*found))
        elif found is not None:
            faces.setdefault(entity.dxf.layer, [])
    if not faces and outlines:
        raise InputError(
            f"holds {outlines} closed polylines but no faces: extrude them, or use shape prism with their points"
        )
    return _join(_choose(faces, layer, "layer"))


def _triangles(vertices, faces) -> Mesh:
    """Vertices and faces of any number of corners as vertices and triangles."""
    fans = [[face[0], face[i], face[i + 1]] for face in faces for i in range(1, len(face) - 1)]
    places = np.array([tuple(vertex) for vertex in vertices], dtype=np.float64)
    return places.reshape(-1, 3), np.array(fans, dtype=np.int64).reshape(-1, 3)


def _read_omf(path: Path, element: str | None) -> Mesh:
    """Triangulated surfaces of an OMF 1 project, each moved by its own origin and the project's."""
    import omf

    project = omf.OMFReader(str(path)).get_project()
    surfaces: dict[str, list[Mesh]] = {}
    for surface in project.elements:
        geometry = surface.geometry
        if isinstance(surface, omf.SurfaceElement) and isinstance(geometry, omf.SurfaceGeometry):
            origin = np.asarray(geometry.origin, dtype=np.float64) + np.asarray(project.origin, dtype=np.float64)
            vertices = np.asarray(geometry.vertices.array, dtype=np.float64) + origin
            mesh = vertices, np.asarray(geometry.triangles.array, dtype=np.int64)
            surfaces.setdefault(surface.name, []).append(mesh)
    return _join(_choose(surfaces, element, "element"))


def _choose(parts: dict[str, list[Mesh]], wanted: str | None, what: str) -> list[Mesh]:
    """The meshes of the layer or element wanted; of the only one, if none is named. Raises InputError otherwise."""
    if not parts:
        raise InputError("holds no triangulated surface: export the solid as one")
    if wanted is None and len(parts) > 1:
        raise InputError(
            f'has {len(parts)} {what}s: name one by `{what}`, or "{EVERYTHING}" for all: {", ".join(parts)}'
        )
    if wanted not in (None, EVERYTHING) and wanted not in parts:
        raise InputError(f"{what} {wanted!r} is not one of {', '.join(parts)}")
    return [mesh for name, meshes in parts.items() if wanted in (None, EVERYTHING, name) for mesh in meshes]


def _join(meshes: list[Mesh]) -> Mesh:
    """Several meshes as one."""
    before = np.cumsum([0] + [len(vertices) for vertices, _ in meshes])
    facets = [facets + start for (_, facets), start in zip(meshes, before, strict=False)]
    return np.concatenate([vertices for vertices, _ in meshes]), np.concatenate(facets)
