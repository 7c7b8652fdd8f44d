"""Faces and closed polylines of DXF drawings, by layer, inserted blocks included, and the unit that the drawing names.

Imports ezdxf, which takes half a second: only solid_files.py imports this, where a drawing is read.
"""

import logging
import math
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any, NamedTuple

import ezdxf
import numpy as np
from ezdxf.document import Drawing
from ezdxf.entities import Insert, LWPolyline, Polyline
from ezdxf.path import make_path
from ezdxf.render import MeshBuilder

from common.errors import InputError
from mpm_core.geometry.meshes import ALL_NAMES, Mesh, Part, join, parsed_once, shown, triangles

# $INSUNITS: metres of each unit that a mine could be drawn in
METRES_PER_DXF_UNIT = {
    1: 0.0254, 2: 0.3048, 3: 1609.344, 4: 0.001, 5: 0.01, 6: 1.0, 7: 1000.0, 10: 0.9144, 14: 0.1, 15: 10.0, 16: 100.0,
    21: 1200 / 3937, 22: 100 / 3937, 23: 3600 / 3937, 24: 5280 * 1200 / 3937,
}  # fmt: skip
ACIS_ENTITIES = {
    "3DSOLID", "BODY", "REGION", "SURFACE", "PLANESURFACE", "EXTRUDEDSURFACE", "REVOLVEDSURFACE", "LOFTEDSURFACE",
    "SWEPTSURFACE", "NURBSURFACE",
}  # fmt: skip
FLAT_ENTITIES = {"SOLID", "TRACE", "HATCH"}
OUTLINE_ENTITIES = ("LWPOLYLINE", "POLYLINE")
LAYER_OF_INSERT = "0"  # on which the contents of a block take the layer of its insert
FACES, OUTLINES = "faces", "outlines"  # sorts of entities that solids and prisms are read from
PRISM_REMEDY = "give shape: prism with lower and upper to extrude them, or draw the solid's faces"
MAX_INSERTED_ENTITIES = 300_000  # Entities to which a drawing's blocks may unfold.
MIN_OUTLINE_CORNERS = 3
MAX_CHORD_ERROR = 1e-3  # Largest distance of an arc from its chords, as a share of the outline's size.


class LayerFaces(NamedTuple):
    """What a layer of a drawing holds of solids.

    mesh: all its faces, None where it has none. unread: entities of which no faces are read, by kind. smoothed: number
    of MESH that the drawing shows smooth.
    """

    mesh: Mesh | None
    unread: Counter[str]
    smoothed: int


def read_faces(path: Path, layer: str | None) -> tuple[dict[str, list[Mesh]], float | None]:
    """3DFACE, MESH and polyface or polygon-mesh POLYLINE by layer, and metres of the drawing's unit, if any.

    layer: what will be chosen; hidden layers that only a pattern fits are left out. Raises InputError for a drawing
    without any.
    """
    layers, code, hidden = _faces_of(path)
    faces = {name: [found.mesh] for name, found in layers.items() if found.mesh is not None}
    picked = [found for name, found in layers.items() if _picks_any(layer, [name])]
    if not _picks_any(layer, faces):
        raise _without_faces(layer, _contents(_parsed(path)[0]))
    if unread := sum((found.unread for found in picked), Counter[str]()):
        left_out = ", ".join(f"{count} {kind}" for kind, count in unread.items())
        logging.warning("%s: also holds %s, of which no faces are read: left out", path, left_out)
    faces = _without_hidden(path, faces, layer, hidden)
    for on_layer in faces:
        if layers[on_layer].smoothed and _picks_any(layer, [on_layer]):
            logging.warning(
                "%s: layer %s: %d MESH are shown smooth (subdivision levels); their cages are used, which reach "
                "further out: export the smoothed mesh if that is meant",
                path, on_layer, layers[on_layer].smoothed,
            )  # fmt: skip
    return faces, _unit(path, code)


def layers_with_faces(path: Path) -> dict[str, bool]:
    """Layers of a drawing that hold faces, in the order of the drawing, each with whether it is off or frozen.

    Raises InputError for a drawing without any.
    """
    layers, _, hidden = _faces_of(path)
    found = {name: name in hidden for name, one in layers.items() if one.mesh is not None}
    if not found:
        raise _without_faces(None, _contents(_parsed(path)[0]))
    return found


@parsed_once(8)
def _faces_of(path: Path) -> tuple[dict[str, LayerFaces], int, dict[str, str]]:
    """Faces of all layers of a drawing, its $INSUNITS, and its layers that are off or frozen."""
    entities, code, hidden = _parsed(path)
    meshes: dict[str, list[Mesh]] = {}
    unread: dict[str, Counter[str]] = {}
    smoothed: Counter[str] = Counter()
    for kind, layer, entity in entities:
        found: tuple[Any, list] | None = None
        if kind == "3DFACE":
            corners = entity.wcs_vertices()
            found = corners, [range(len(corners))]
        elif kind == "MESH":
            found = entity.vertices, list(entity.faces)
            smoothed[layer] += entity.dxf.get("subdivision_levels", 0) > 0
        elif kind == "POLYLINE" and (entity.is_poly_face_mesh or entity.is_polygon_mesh):
            builder = MeshBuilder.from_polyface(entity)
            found = builder.vertices, builder.faces
        elif kind in ACIS_ENTITIES | FLAT_ENTITIES:
            unread.setdefault(layer, Counter())[kind] += 1
        if found is None:
            continue
        facets = triangles(found[1])
        if not len(facets):
            unread.setdefault(layer, Counter())[f"{kind} without a face"] += 1
            continue
        if facets.max() >= len(found[0]):
            raise InputError(f"layer {layer!r} holds a {kind} with faces of vertices that it lacks: export it again")
        meshes.setdefault(layer, []).append((np.array([tuple(v) for v in found[0]], dtype=np.float64), facets))
    layers = {
        name: LayerFaces(join(meshes[name]) if name in meshes else None, unread.get(name, Counter()), smoothed[name])
        for name in dict.fromkeys([*meshes, *unread])
    }
    return layers, code, hidden


def _without_hidden(path: Path, parts: dict[str, Part], layer: str | None, hidden: dict[str, str]) -> dict[str, Part]:
    """The entities on layers less those on hidden ones, unless `layer` names one or there is no other; both are
    said."""
    chosen = [name for name in parts if name == layer] or list(parts)
    here = {name: hidden[name] for name in chosen if name in hidden and fnmatchcase(name, layer or ALL_NAMES)}
    if not here:
        return parts
    named = ", ".join(f"{name} ({how})" for name, how in here.items())
    if layer in here or len(parts) == 1:
        logging.warning("%s: layer %s in the drawing; used all the same", path, named)
        return parts
    if layer is None:
        return parts  # one is named
    logging.warning("%s: layers hidden in the drawing: %s; left out: name one to use it", path, named)
    left = {name: part for name, part in parts.items() if name not in here}
    if not any(fnmatchcase(name, layer) for name in left):
        raise InputError(f"layer {layer!r}: fits hidden layers only, {named}: name one to use it, or thaw it")
    return left


def _picks_any(layer: str | None, layers: Iterable[str]) -> bool:
    """True if `layer` fits one of these layers, or if none is named and there is one."""
    return any(layer is None or name == layer or fnmatchcase(name, layer) for name in layers)


def _contents(entities: Sequence[tuple[str, str, Any]]) -> dict[str, Counter[str]]:
    """By layer, how many entities it holds of each sort: FACES, OUTLINES, and the kinds of which nothing is read."""
    found: dict[str, Counter[str]] = {}
    for kind, layer, entity in entities:
        is_mesh = getattr(entity, "is_poly_face_mesh", False) or getattr(entity, "is_polygon_mesh", False)
        if kind in ("3DFACE", "MESH") or (kind == "POLYLINE" and is_mesh):
            sort = FACES
        elif kind in OUTLINE_ENTITIES and _is_closed(entity):
            sort = OUTLINES
        else:
            sort = kind
        found.setdefault(layer, Counter())[sort] += 1
    return found


def _no_such_layer(layer: str, contents: dict[str, Counter[str]]) -> str:
    """The reason that a layer picks nothing: the layers that there are, those with solids or outlines first."""
    kinds = {name: [sort for sort in (FACES, OUTLINES) if here[sort]] for name, here in contents.items()}
    named = [
        f"{name} ({' and '.join(sorts) or 'neither faces nor outlines'})"
        for name, sorts in sorted(kinds.items(), key=lambda one: not one[1])
    ]
    return f"layer {layer!r} is not one of {shown(named)}"


def _without_faces(layer: str | None, contents: dict[str, Counter[str]]) -> InputError:
    """The reason that a drawing, or a layer of it, gives no solid, and the remedy."""
    if layer is not None and contents and not _picks_any(layer, contents):
        has_faces = any(here[FACES] for here in contents.values())
        has_outlines = any(here[OUTLINES] for here in contents.values())
        hint = "" if has_faces or not has_outlines else f"; {PRISM_REMEDY}"
        return InputError(_no_such_layer(layer, contents) + hint)
    here = sum((counts for name, counts in contents.items() if _picks_any(layer, [name])), Counter[str]())
    start = "" if layer is None or len(contents) < 2 else f"layer {layer!r} "
    for kinds, what in ((ACIS_ENTITIES, "ACIS bodies"), (FLAT_ENTITIES, "flat faces that bound no volume")):
        if named := ", ".join(f"{here[kind]} {kind}" for kind in sorted(kinds) if here[kind]):
            remedy = "export it as 3DFACE, polyface or MESH, or as STL"
            return InputError(f"{start}holds {what} ({named}), no mesh: {remedy}")
    if here[OUTLINES]:
        return InputError(f"{start}holds {here[OUTLINES]} closed polylines but no faces: {PRISM_REMEDY}")
    return InputError(f"{start}holds no triangulated surface: export the solid as one")


def _without_outlines(layer: str | None, contents: dict[str, Counter[str]]) -> InputError:
    """The reason that a drawing, or a layer of it, gives a prism no outline, and the remedy."""
    if layer is not None and contents and not _picks_any(layer, contents):
        return InputError(_no_such_layer(layer, contents))
    has_faces = any(counts[FACES] for name, counts in contents.items() if _picks_any(layer, [name]))
    start = "" if layer is None or len(contents) < 2 else f"layer {layer!r} "
    if has_faces:
        return InputError(f"{start}holds faces but no closed polyline: leave out shape: prism, and they are the solid")
    return InputError(f"{start}holds no closed polyline: close the outline, or give the prism its polygon")


def read_outlines(path: Path, layer: str | None) -> tuple[dict[str, list[np.ndarray]], float | None]:
    """Closed polylines by layer, their corners (point, 3) with arcs as chords, and metres of the drawing's unit.

    layer: what will be chosen; hidden layers that only a pattern fits are left out.
    """
    entities, code, hidden = _parsed(path)
    outlines: dict[str, list[np.ndarray]] = {}
    short: Counter[str] = Counter()
    for kind, on_layer, entity in entities:
        is_outline = kind in OUTLINE_ENTITIES and not getattr(entity, "is_poly_face_mesh", False)
        if is_outline and not getattr(entity, "is_polygon_mesh", False) and _is_closed(entity):
            line = make_path(entity)
            corners = np.array([tuple(point) for point in line.control_vertices()]).reshape(-1, 3)
            size = np.ptp(corners, axis=0).max(initial=0.0) if len(corners) else 0.0
            points = [tuple(point) for point in line.flattening(max(MAX_CHORD_ERROR * size, 1e-9))][:-1]
            if len(points) < MIN_OUTLINE_CORNERS:
                short[on_layer] += 1
            else:
                outlines.setdefault(on_layer, []).append(np.array(points))
    for name, count in short.items():
        if _picks_any(layer, [name]):
            logging.warning(
                "%s: layer %s: %d closed polylines with less than three corners: left out", path, name, count
            )
    if not _picks_any(layer, outlines):
        raise _without_outlines(layer, _contents(entities))
    return _without_hidden(path, outlines, layer, hidden), _unit(path, code)


def _is_closed(polyline: LWPolyline | Polyline) -> bool:
    """True for a polyline that is closed by its flag, or that ends where it starts."""
    if polyline.is_closed:
        return True
    points = list(polyline.vertices() if isinstance(polyline, LWPolyline) else polyline.points())
    return len(points) > 3 and tuple(points[0]) == tuple(points[-1])


def _unit(path: Path, code: int) -> float | None:
    """Metres of the unit of a drawing's $INSUNITS; None if it names none, NaN if that is not known."""
    if code == 0:
        logging.info("%s: names no unit ($INSUNITS): that of frame.grid, else m, unless `units` says otherwise", path)
        return None
    unit = METRES_PER_DXF_UNIT.get(code, math.nan)
    if unit != 1.0:
        logging.warning("%s: drawn in units of %g m ($INSUNITS %d), and read so", path, unit, code)
    return unit


@parsed_once(1)  # its entities take much memory
def _parsed(path: Path) -> tuple[list[tuple[str, str, Any]], int, dict[str, str]]:
    """Kind, layer and entity of all of a drawing, blocks unfolded, its $INSUNITS, and its layers
    that are off or frozen."""
    raw = path.read_bytes()
    if raw.count(b"\nINSERT\r\n") + raw.count(b"\nINSERT\n") > MAX_INSERTED_ENTITIES:
        raise InputError(
            f"inserts blocks more than {MAX_INSERTED_ENTITIES:,} times: export the solid alone, as plain faces"
        )
    drawing = ezdxf.readfile(path)
    unfolded = _unfolded(drawing, drawing.modelspace(), {})
    if unfolded > MAX_INSERTED_ENTITIES:
        raise InputError(
            f"its inserted blocks unfold to {unfolded:.3g} entities, more than {MAX_INSERTED_ENTITIES:,}: export the "
            "solid alone, as plain faces"
        )
    entities = list(_decomposed(drawing.modelspace()))
    names = {layer.dxf.name.lower(): layer.dxf.name for layer in drawing.layers}  # capitals make no other layer
    listed = [(entity.dxftype(), names.setdefault(name.lower(), name), entity) for name, entity in entities]
    hidden = {
        layer.dxf.name: "frozen" if layer.is_frozen() else "off"
        for layer in drawing.layers
        if layer.is_frozen() or layer.is_off()
    }
    return listed, drawing.header.get("$INSUNITS", 0), hidden


def _decomposed(entities: Iterable[Any], insert_layer: str = LAYER_OF_INSERT) -> Iterator[tuple[str, Any]]:
    """Layer and entity of all entities, inserted blocks unfolded: what a block holds on layer 0 is on the layer of its
    insert (insert_layer), as in CAD."""
    for entity in entities:
        layer = entity.dxf.get("layer", LAYER_OF_INSERT)
        layer = insert_layer if layer == LAYER_OF_INSERT else layer
        if not isinstance(entity, Insert):
            yield layer, entity
        else:
            inserts = entity.multi_insert() if entity.mcount > 1 else [entity]
            for insert in inserts:
                yield from _decomposed(insert.virtual_entities(), layer)


def _unfolded(drawing: Drawing, layout, known: dict[str, int]) -> int:
    """Number of entities that the inserts of a layout or block unfold to. Raises InputError for a block within
    itself."""
    total = 0
    for insert in layout.query("INSERT"):
        name = insert.dxf.name
        if name not in known:
            known[name] = -1
            block = drawing.blocks.get(name)
            inner = _unfolded(drawing, block, known) if block is not None else 0
            known[name] = inner + sum(1 for _ in block or ())
        if known[name] < 0:
            raise InputError(f"its block {name!r} is inserted into itself: export the solid alone, as plain faces")
        total += known[name] * max(insert.mcount, 1)
    return total
