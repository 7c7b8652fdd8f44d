"""Solids from files that mine planning packages write: STL, OBJ, PLY, DXF, OMF, GOCAD.

trimesh and ezdxf are imported where a file is read: that takes long, and most stages read none.
"""

import logging
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from common.errors import InputError
from common.mine_grid import METRES_PER_UNIT as GRID_UNITS
from common.mine_grid import SAME_AS_MAP, GridMap
from mpm_core.geometry.gocad import gocad_names, read_gocad
from mpm_core.geometry.meshes import (
    Mesh,
    choose,
    join,
    obj_names,
    read_obj,
    read_ply,
    read_stl,
    stl_names,
)
from mpm_core.geometry.omf_files import omf_names, read_omf
from mpm_core.geometry.open_pits import closed_at
from mpm_core.geometry.orientation import SURFACE_REMEDY, agree, check_bounds_volume, without_partitions
from mpm_core.geometry.outlines import Outline, check_simple, nest
from mpm_core.geometry.parts import part_of
from mpm_core.geometry.solids import Solid, unique_rows

METRES_PER_UNIT = {"m": 1.0, "cm": 0.01, "mm": 0.001, "km": 1000.0, **GRID_UNITS, "inch": 0.0254}
# Shares of the volume that depend on how an open surface is closed. Above the first there is a warning, above the
# second the file is refused.
OPEN_SHARE_WARNED, MAX_OPEN_SHARE_ACCEPTED = 0.05, 0.3
MAX_COORDINATE_STEP_UNTOLD = 0.01  # m; surveys of openings are about as exact
MAX_VERTEX_COORDINATE = 1e8  # No mine has larger coordinates (m), and float64 resolves 1e-8 m there.


@dataclass(frozen=True)
class Picked:
    """The part of a file that is meant, and its place: metres = coordinate x unit x scale + offset, which `grid` has on
    the map."""

    layer: str | None = None
    """of a DXF drawing"""
    element: str | None = None
    """surface of an OMF project or a GOCAD file, object or group of an OBJ file, solid of a text STL file"""
    units: str | None = None
    """one of METRES_PER_UNIT; None: what a DXF, OMF or GOCAD file states, else that of the grid"""
    scale: float = 1.0
    offset: tuple[float, ...] = (0.0, 0.0, 0.0)
    """m"""
    part: tuple[int, int] | None = None
    """number and count of the parts of equal volume, in the order in which they are mined; None: the whole solid"""
    advance: float = 0.0
    """direction in which parts are mined, degrees clockwise from the map's north"""
    grid: GridMap = SAME_AS_MAP
    """grid of the coordinates, by default that of the map"""
    closed_at: float | None = None
    """elevation of the ground on the map, m, at which a surface that is open there is closed"""

    @classmethod
    def of(cls, entry: dict, grid: GridMap | None = None) -> "Picked":
        """The choice that the keys of an excavation or rock body make; grid: of its coordinates, if not the map's."""
        given = {key: entry[key] for key in cls.__dataclass_fields__ if key in entry and key != "grid"}
        given |= {key: tuple(given[key]) for key in ("offset", "part") if key in given}  # hashable
        return cls(**given, grid=grid or SAME_AS_MAP)

    def place(self, vertices: np.ndarray, own_unit: float | None = None) -> np.ndarray:
        """Vertices (v, 3) of a file on the map, m; own_unit: metres of the unit that the file names, if any, or NaN.

        Raises InputError for a unit that is not known.
        """
        unit = METRES_PER_UNIT[self.units] if self.units else own_unit or self.grid.metres_per_unit
        if np.isnan(unit):
            raise InputError(
                f"is drawn in a unit that no mine is drawn in: say `units`, one of {', '.join(METRES_PER_UNIT)}"
            )
        if self.units and own_unit and not np.isclose(unit, own_unit, rtol=1e-9):
            logging.warning("the file says that its unit is %g m; read as %s", own_unit, self.units)
        return self.grid.to_map(vertices * (unit * self.scale) + np.asarray(self.offset, dtype=np.float64))


def read_solid(path: str | Path, name: str, picked: Picked | None = None, **keys) -> Solid:
    """Read the solid `name` from a file; the file's ending says which format it is. `keys` are those of Picked.

    `layer` and `element` are needed only if a DXF, OMF or GOCAD file has several; "*" stands for any text in them.
    Vertices at exactly the same place become one; triangles without area or said twice are dropped, those that look the
    wrong way are turned (orientation.py). A warning names a file whose single precision (float32) leaves coarse
    coordinates. With `closed_at` the solid is what the surface has below the ground (open_pits.py).

    Raises InputError naming the file if it is missing, unreadable, of another format, or bounds no volume.
    """
    path, picked = Path(path), replace(picked or Picked(), **keys)
    readers: dict[str, Callable[[], tuple[Mesh, float | None]]] = {
        ".stl": lambda: (read_stl(path, picked.element), None),
        ".obj": lambda: (read_obj(path, picked.element), None),
        ".ply": lambda: (read_ply(path), None),
        ".dxf": lambda: _read_dxf(path, picked.layer),
        ".omf": lambda: read_omf(path, picked.element),
        ".ts": lambda: read_gocad(path, picked.element, picked.grid.is_downward),
    }
    ending = path.suffix.lower()
    if ending not in readers:
        raise InputError(f"{path}: {name}: not one of the formats {', '.join(readers)}: export it as one of these")
    if (picked.element and ending in (".dxf", ".ply")) or (picked.layer and ending != ".dxf"):
        raise InputError(
            f"{path}: {name}: `element` is for OMF, GOCAD, OBJ and STL files, `layer` for DXF: remove it or convert it"
        )
    (vertices, facets), own_unit = _read(path, name, readers[ending])
    if len(facets) and (np.min(facets) < 0 or np.max(facets) >= len(vertices)):
        raise InputError(f"{path}: {name}: has triangles of vertices that it does not hold: export it again")
    used, facets = np.unique(facets, return_inverse=True)  # what no triangle uses may lie anywhere
    vertices, facets = vertices[used], facets.reshape(-1, 3)
    single = vertices if vertices.dtype == np.float32 else None
    vertices = _placed(path, name, picked, vertices.astype(np.float64), own_unit)
    if not np.isfinite(vertices).all():
        raise InputError(f"{path}: {name}: holds coordinates that are not finite: export it again")
    if np.abs(vertices).max(initial=0.0) > MAX_VERTEX_COORDINATE:
        raise InputError(f"{path}: {name}: coordinates up to {np.abs(vertices).max():.3g} m are no mine's: see `units`")
    if single is not None and len(single):
        _check_precision(path, name, picked, single, own_unit)
    vertices, facets = _tidy(vertices, facets[:, ::-1] if picked.grid.is_mirrored else facets)
    if len(facets) == 0:
        raise InputError(f"{path}: {name}: holds no triangles: export the solid as a triangulated surface")
    turned_before = 0
    try:
        if picked.closed_at is not None:
            vertices, facets, turned_before, notes = closed_at(vertices, facets, picked.closed_at)
            for note in notes:
                logging.warning("%s: %s: %s", path, name, note)
        facets, turned = agree(vertices, facets)
        check_bounds_volume(vertices, facets)
    except InputError as error:
        raise InputError(f"{path}: {name}: {error}") from error
    if turned := turned + turned_before:
        logging.warning("%s: %s: %d of %d triangles looked the other way; turned", path, name, turned, len(facets))
    solid = Solid(name, vertices, facets)
    if solid.open_share > OPEN_SHARE_WARNED:
        least, _, most = solid.open_volumes
        message = (
            f"{path}: {name}: its surface has large holes, or triangles that look the other way: {least:.4g} to "
            f"{most:.4g} m3 are within, {100 * solid.open_share:.0f} % apart, as one closes it"
        )
        pit = "" if picked.closed_at is not None else "; a pit that is open at the ground needs closed_at_ground: true"
        if solid.open_share > MAX_OPEN_SHARE_ACCEPTED:
            raise InputError(
                f"{message}; more than {100 * MAX_OPEN_SHARE_ACCEPTED:.0f} % is no volume: {SURFACE_REMEDY}{pit}"
            )
        logging.warning("%s; %.4g m3 are used: %s%s", message, solid.volume, SURFACE_REMEDY, pit)
    return _part(path, solid, picked)


def _part(path: Path, solid: Solid, picked: Picked) -> Solid:
    """The part of a solid that is meant."""
    if picked.part is None:
        return solid
    try:
        return part_of(solid, *picked.part, picked.advance)
    except InputError as error:
        raise InputError(f"{path}: {error}") from error


@dataclass(frozen=True)
class Body:
    """A body of a file: its name, and the keys of Picked that choose it. A file that names none has one, of its own
    name."""

    name: str
    keys: dict[str, str]
    hidden: bool = False
    """True on a layer that is off or frozen in the drawing"""


def bodies_in(path: Path) -> list[Body]:
    """Bodies of a file in their order: layers of a DXF drawing that hold faces, surfaces of an OMF project or a GOCAD
    file, objects of an OBJ file (groups where it has none), solids of a text STL file.

    Raises InputError naming the file if it is missing, unreadable or of another format.
    """
    of_elements = {".obj": obj_names, ".omf": omf_names, ".ts": gocad_names, ".stl": stl_names, ".ply": lambda path: []}
    ending = path.suffix.lower()
    if ending == ".dxf":
        layers = _read(path, "", lambda: _layers(path))
        return [Body(name, {"layer": name}, hidden) for name, hidden in layers.items()]
    if ending not in of_elements:
        raise InputError(f"{path}: not one of the formats .dxf, {', '.join(of_elements)}: export it as one of these")
    names = _read(path, "", lambda: of_elements[ending](path))
    unnamed = sum(not name.strip() for name in names)
    if unnamed and len(names) > 1:
        raise InputError(f"{path}: {unnamed} of {len(names)} bodies have no name: name them, and export it again")
    names = [name for name in names if name.strip()]
    return [Body(name, {"element": name}) for name in names] or [Body(path.stem, {})]


def _layers(path: Path) -> dict[str, bool]:
    from mpm_core.geometry.dxf import layers_with_faces

    return layers_with_faces(path)


def read_outlines(path: str | Path, name: str, picked: Picked, height: float | None = None) -> list[Outline]:
    """Outlines with their holes (point, 3) m of the closed polylines of a DXF drawing, or of its layer; arcs as chords.

    height, m: of prisms that stand on the polylines (outlines.nest). Raises InputError naming the file and the layer.
    """
    from mpm_core.geometry import dxf

    path = Path(path)
    if path.suffix.lower() != ".dxf" or picked.element:
        raise InputError(f"{path}: {name}: a prism reads its outline from a DXF polyline, by `layer`: export it as DXF")
    lines, own_unit = _read(path, name, lambda: dxf.read_outlines(path, picked.layer))
    try:
        found = choose(lines, picked.layer, "layer")
    except InputError as error:
        raise InputError(f"{path}: {name}: {error}") from error
    layer = picked.layer or next(iter(lines))
    found = [_placed(path, name, picked, line, own_unit) for line in found]
    try:
        for line in found:
            check_simple(line[:, :2])
        outlines = nest(found, height)
    except InputError as error:
        raise InputError(f"{path}: {name}: layer {layer}: {error}") from error
    holes = sum(len(outline.holes) for outline in outlines)
    if holes:
        logging.warning(
            "%s: %s: layer %s: %d of %d closed polylines lie within another one: rock is left there",
            path, name, layer, holes, len(found),
        )  # fmt: skip
    return outlines


def _check_precision(path: Path, name: str, picked: Picked, vertices: np.ndarray, own_unit: float | None) -> None:
    """Warn of a file whose coordinates (v, 3) float32, in its own unit, lie on steps that a survey would see."""
    largest = np.abs(vertices).max()
    unit = METRES_PER_UNIT[picked.units] if picked.units else own_unit or picked.grid.metres_per_unit
    step = float(np.spacing(largest)) * unit * picked.scale
    if step > MAX_COORDINATE_STEP_UNTOLD:
        logging.warning(
            "%s: %s: the file holds its coordinates in single precision, in steps of %.2g m at %.9g: walls may lie "
            "%.2g m from their place; export it as OBJ or DXF, or near the origin, and give `offset`",
            path, name, step, largest, 0.5 * step,
        )  # fmt: skip


def _placed(path: Path, name: str, picked: Picked, vertices: np.ndarray, own_unit: float | None) -> np.ndarray:
    try:
        return picked.place(vertices, own_unit)
    except InputError as error:
        raise InputError(f"{path}: {name}: {error}") from error


def _read(path: Path, name: str, reader: Callable):
    """The result of the reader; any error in it becomes one line. name: of the solid; empty for that of all."""
    where = f"{path}: {name}" if name else f"{path}"
    if not path.is_file():
        raise InputError(f"{where}: no such file; relative paths start at the folder of the mine's configuration")
    try:
        return reader()
    except InputError as error:
        raise InputError(f"{where}: {error}") from error
    except Exception as error:  # the parsers raise whatever they stumble over
        reason = " ".join(str(error).split())[:200]
        raise InputError(f"{where}: unreadable as {path.suffix[1:].upper()} ({reason}): export it again") from error


def _read_dxf(path: Path, layer: str | None) -> tuple[Mesh, float | None]:
    from mpm_core.geometry.dxf import read_faces

    faces, own_unit = read_faces(path, layer)
    return join(choose(faces, layer, "layer")), own_unit


def _tidy(vertices: np.ndarray, facets: np.ndarray) -> Mesh:
    """Merge equal vertices, drop triangles with a repeated corner and repeats of the same triangle, keep the order."""
    vertices, facets = np.reshape(vertices, (-1, 3)), np.reshape(facets, (-1, 3))
    vertices, place = unique_rows(vertices)
    facets = place[facets] if len(vertices) else facets
    facets = without_partitions(facets[(facets != np.roll(facets, 1, axis=1)).all(axis=1)])
    # the same triangle may start at any of its corners: start it at the smallest, which keeps its orientation
    start = facets.argmin(axis=1, keepdims=True) if len(facets) else np.zeros((0, 1), dtype=np.int64)
    rolled = np.take_along_axis(facets, (start + np.arange(3)) % 3, axis=1)
    _, same = unique_rows(rolled)
    _, first = np.unique(same, return_index=True)
    return vertices, facets[np.sort(first)]
