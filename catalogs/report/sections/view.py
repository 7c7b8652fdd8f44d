"""The view that can be turned: openings and failed rock by step, events of both catalogues, and what the page says.

Openings and failed rock are closed surfaces around what cells of one size hold. The template is "view.html.j2".
"""

import base64
import re
import zlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
import xarray as xr
from matplotlib.colors import to_hex
from numpy.typing import NDArray

from catalogs.figures import events_figure, style, views
from catalogs.report.by_opening import step_of_events
from catalogs.report.evidence import MODEL_LABEL, Evidence, ExcavationRow, shown_catalogues
from catalogs.report.gallery import Gallery
from catalogs.report.opening_names import opening_places, responses
from catalogs.report.text import fixed, plural, whole
from catalogs.sources.openings import NOTHING
from catalogs.sources.sizes import log_potency
from common.event_table import new_catalog
from common.mine_grid import GridMap
from common.opening_table import SIDES
from common.part_centers import part_centers

MAX_CELLS = 200_000  # Of more cells, openings or failed rock are drawn on cells of twice the size.
MAX_EVENTS = 10_000  # Of a catalogue with more events the largest are shown: more would make the page too large.
PLACES_PER_EDGE = 256  # Vertices are rounded to this share of a cell's edge.
PLANNED = NEVER = -1
PIXELS_PER_POINT = 96 / 72
# Corners of a cube, in the order of igl.marching_cubes.
CORNERS = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]])
LEVELS = (0.01, 0.99)  # The level of a surface is searched between these shares.
LEVEL_ERROR = 0.001


@dataclass(frozen=True)
class CellSet:
    """Volume held by cells of one size.

    cell (cell, 3): lower corners, distinct, whole numbers of edges from `corner` (3,) m; share (cell,): share of each
    cell that is held, above 0 and at most 1; other cells hold nothing. edge: m.
    """

    cell: NDArray
    share: NDArray
    edge: float
    corner: NDArray

    @classmethod
    def of(cls, cell: NDArray, share: NDArray, edge: float, corner: NDArray) -> "CellSet":
        """Distinct cells, with the shares of those that occur more than once summed, up to 1."""
        distinct, place = np.unique(cell, axis=0, return_inverse=True)
        return cls(distinct, np.minimum(np.bincount(place.ravel(), share, len(distinct)), 1.0), edge, corner)

    def coarsened(self) -> "CellSet":
        """Set of cells of twice the edge that hold the same volume."""
        return CellSet.of(self.cell // 2, self.share / 8.0, 2.0 * self.edge, self.corner)

    def surface(self) -> tuple[NDArray, NDArray]:
        """Vertices (vertex, 3), edges from `corner`, and outward triangles (triangle, 3) around what is held.

        The shares are taken as values at the cells' centres, linear between them. The surface is where they equal a
        level. The level is chosen so that the surface encloses the held volume, as nearly as one level can. So an
        opening that is narrower than a cell is drawn, too.
        """
        if not len(self.cell):
            return np.zeros((0, 3)), np.zeros((0, 3), np.int64)
        from scipy.optimize import brentq  # here, as igl below: other sections are drawn meanwhile

        at_level = self._surface_at_level()

        def excess(level: float) -> float:
            return enclosed_volume(*at_level(level)) - float(self.share.sum())

        low, high = LEVELS
        if excess(low) <= 0:
            return at_level(low)
        return at_level(high if excess(high) >= 0 else brentq(excess, low, high, xtol=LEVEL_ERROR))

    def _surface_at_level(self) -> Callable[[float], tuple[NDArray, NDArray]]:
        """The surface by its level, from marching cubes between the centres of these cells and their neighbours."""
        import igl

        lower = self.cell.min(axis=0) - 1
        shape = tuple(self.cell.max(axis=0) - lower + 2)

        def key(place: NDArray) -> NDArray:
            return np.ravel_multi_index(tuple((place - lower).T), shape)

        def place(key: NDArray) -> NDArray:
            return np.stack(np.unravel_index(key, shape), axis=1) + lower

        cubes = place(np.unique(key((self.cell[:, None, :] - CORNERS).reshape(-1, 3))))
        known, corner = np.unique(key((cubes[:, None, :] + CORNERS).reshape(-1, 3)), return_inverse=True)
        centre, corner = place(known) + 0.5, corner.reshape(-1, 8).astype(np.int64)
        value = np.zeros(len(known))
        value[np.searchsorted(known, key(self.cell))] = self.share

        def at_level(level: float) -> tuple[NDArray, NDArray]:
            vertices, triangles, _ = igl.marching_cubes(value, centre, corner, level)
            return vertices, triangles[:, ::-1]  # Those of igl look towards larger values.

        return at_level


def enclosed_volume(vertices: NDArray, triangles: NDArray) -> float:
    """Volume within closed surfaces, positive where their triangles look outward."""
    if not len(triangles):
        return 0.0
    return float(np.linalg.det((vertices - vertices.mean(axis=0))[triangles]).sum()) / 6.0


def section(evidence: Evidence, _: Gallery) -> dict | None:
    """Content of the section on the view: data of the page's script, titles of the catalogues, range of log potency,
    keys of steps and sizes, colours, whether openings are filled or planned, names of openings, notes. None for a mine
    in a plane or without steps."""
    shown = shown_catalogues(evidence)
    if int(evidence.grid.attrs["dimension"]) == 2 or not evidence.steps:
        return None
    none = {MODEL_LABEL: new_catalog(0, {"mine": evidence.grid.attrs["mine"], "kind": "synthetic"})}
    catalogues = none | dict(shown)
    data = view_data(evidence, catalogues)
    scale = events_figure.common_scale(list(catalogues.values()))
    low, high = (float(np.floor(10 * bound) / 10) for bound in scale.log_potency)
    return {
        "data": data,
        "titles": list(catalogues),
        "has_events": bool(shown),
        "least": {"low": low, "high": high},
        "key_steps": style.thinned(data["steps"]),
        "key_sizes": [
            {"label": f"log P {fixed(value, 1)}", "pixels": PIXELS_PER_POINT * float(scale.diameter(value))}
            for value in (scale.key_sizes if shown else [])
        ],
        "colours": data["colours"],
        "filled": any(one["filled"] != NEVER for one in data["openings"]["parts"]),
        "planned": bool(data["planned"]["parts"]),
        "openings": sorted((one["name"] for one in data["names"]["openings"]), key=by_number),
        "notes": [note for label, one in catalogues.items() if (note := _left_out(evidence, label, one))],
    }


def by_number(name: str) -> list[str | int]:
    """Key that sorts a name before one with a larger number at the same place: stope_2 before stope_10."""
    return [int(part) if part.isdecimal() else part for part in re.split(r"(\d+)", name)]


def _left_out(evidence: Evidence, label: str, catalog: xr.Dataset) -> str:
    """Sentence on the events of a catalogue that the view leaves out; empty where it shows all."""
    undated = int(np.count_nonzero(step_of_events(evidence, catalog) < 0))
    small = catalog.sizes["event"] - undated - len(shown_events(evidence, catalog))
    parts = [f"{plural(undated, 'event')} outside of the dates of the steps"] if undated else []
    parts += [f"the {whole(small)} smallest"] if small else []
    return f"{label}: the view leaves out {' and '.join(parts)}." if parts else ""


def view_data(evidence: Evidence, catalogues: Mapping[str, xr.Dataset]) -> dict:
    """All that the script of the page draws, for JSON: lengths in m from `centre`, arrays as `packed` makes them.

    catalogues: by label, those shown. A step's number is its place among `steps`.
    """
    failed = evidence.state["position"].values[evidence.state["failed"].values >= 0]
    lower, upper = views.frame_limits(evidence.grid, [failed], margin=0.0, least=0.0)
    centre = (lower + upper) / 2
    colours = style.step_colours([bool(int(step["dated"])) for step in evidence.steps])
    scale = events_figure.common_scale(list(catalogues.values()))
    openings = [
        ({"step": mined, "filled": filled}, cells) for (mined, filled), cells in opening_cells(evidence).items()
    ]
    rock = [({"step": step}, cells) for step, cells in failed_cells(evidence).items()]
    return {
        "centre": centre.tolist(),
        "radius": float(np.linalg.norm(upper - lower)) / 2,
        "steps": [
            {"name": str(step["step"]), "colour": to_hex(colour)}
            for step, colour in zip(evidence.steps, colours, strict=True)
        ],
        "colours": {"open": style.EXCAVATION, "fill": style.FILL},
        "sizes": {  # log P, and diameters in pixels, as in the figure of events
            **dict(zip(("low", "high"), scale.log_potency, strict=True)),
            "smallest": PIXELS_PER_POINT * events_figure.SMALLEST,
            "largest": PIXELS_PER_POINT * events_figure.LARGEST,
        },
        "planned": _packed_surfaces([one for one in openings if one[0]["step"] == PLANNED], centre),
        "openings": _packed_surfaces([one for one in openings if one[0]["step"] != PLANNED], centre),
        "rock": _packed_surfaces(rock, centre),
        "names": _packed_names(evidence, centre),
        "catalogues": [_packed_events(evidence, label, one, centre) for label, one in catalogues.items()],
        **({"grid": _in_grid(evidence.mine_grid, centre)} if evidence.mine_grid else {}),
    }


def _in_grid(grid: GridMap, centre: NDArray) -> dict:
    """The mine's own grid: unit, place of `centre` there, and rows that turn a distance from it, m, into the grid."""
    zero = grid.to_grid(centre)
    rows = (grid.to_grid(centre + np.eye(3)) - zero).T
    return {
        "units": grid.units,
        "centre": (zero / grid.metres_per_unit).tolist(),
        "rows": (rows / grid.metres_per_unit).tolist(),
    }


def packed(array: NDArray, kind: str, stride: int = 0) -> dict:
    """An array for the page: its type and its deflated bytes, little-endian, as base64.

    stride: if it is not 0, what is stored are differences from the value so many places before, which deflate better.
    """
    flat = np.ascontiguousarray(array, np.dtype(kind).newbyteorder("<")).ravel()
    if stride:
        flat = np.concatenate([flat[:stride], flat[stride:] - flat[:-stride]])
    return {"type": kind, "stride": stride, "base64": base64.b64encode(zlib.compress(flat.tobytes())).decode()}


def step_places(evidence: Evidence) -> dict[str, int]:
    """Place of each step in the order of mining, by name."""
    return {str(step["step"]): place for place, step in enumerate(evidence.steps)}


def opening_cells(evidence: Evidence) -> dict[tuple[int, int], CellSet]:
    """Excavated cells by the steps that mine and fill them: PLANNED, NEVER where no step of the run does."""
    grid, place = evidence.grid, step_places(evidence)
    when = [_mined_and_filled(row, place) for row in evidence.excavations]
    mining, edge, corner = evidence.mining, float(grid.attrs["fine_cell"]), views.domain(grid)[0]
    keys, of_excavation = np.unique(np.array(when).reshape(-1, 2), axis=0, return_inverse=True)
    taken = np.flatnonzero(mining.takes != NOTHING)
    cell = np.rint((mining.origin - corner) / edge).astype(np.int64)
    found = {}
    for key, own in _grouped(of_excavation.reshape(-1)[mining.excavation[taken]], taken):
        mined, filled = keys[key].tolist()
        found[mined, filled] = CellSet.of(cell[own], mining.volume[own] / edge**3, edge, corner)
    return _drawable(found)


def failed_cells(evidence: Evidence) -> dict[int, CellSet]:
    """Cells of rock by the step of first failure: what remains after the last step, as the figures draw it."""
    state = evidence.state
    spacing, failed = state["spacing"].values, state["failed"].values
    drawn = (failed >= 0) & (state["volume"].values > (1.0 - views.MIN_EXCAVATED_SHARE_DRAWN) * spacing**3)
    if not drawn.any():
        return {}
    edge, corner = float(spacing[drawn].min()), views.domain(evidence.grid)[0]
    lower = np.rint((part_centers(state) - spacing[:, None] / 2 - corner) / edge).astype(np.int64)
    edges = np.rint(spacing / edge).astype(int)  # A particle may be larger than the smallest.
    place = {int(step["step_index"]): number for number, step in enumerate(evidence.steps)}
    found = {}
    for index, own in _grouped(failed[drawn], np.flatnonzero(drawn)):
        if index in place:
            cell = np.concatenate([_cube(lower[own[edges[own] == count]], count) for count in np.unique(edges[own])])
            found[place[index]] = CellSet.of(cell, np.ones(len(cell)), edge, corner)
    return _drawable(found)


def _grouped(group: NDArray, values: NDArray) -> list[tuple[int, NDArray]]:
    """Each group (k,) that occurs, in ascending order, and its values (k,) in theirs."""
    order = np.argsort(group, kind="stable")
    groups, first = np.unique(group[order], return_index=True)
    return list(zip(groups.tolist(), np.split(values[order], first)[1:], strict=True))


def _cube(lower: NDArray, count: int) -> NDArray:
    """Cells of cubes of `count` cells a side with these lower corners (cube, 3)."""
    inside = np.stack(np.meshgrid(*[np.arange(count)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    return (lower[:, None, :] + inside).reshape(-1, 3)


def _drawable(sets: dict) -> dict:
    """The sets of cells, by key, on cells so large that there are at most MAX_CELLS of them."""
    while sum(len(one.cell) for one in sets.values()) > MAX_CELLS:
        sets = {key: one.coarsened() for key, one in sets.items()}
    return sets


def _packed_surfaces(sets: list[tuple[dict, CellSet]], centre: NDArray) -> dict:
    """The surfaces around sets of cells of one edge, one after the other: vertex = origin + place * unit, m.

    parts: what is told of each set, with its numbers of vertices and triangles. A page draws them at once, however many
    steps there are.
    """
    parts, places, corners, count = [], [np.zeros((0, 3))], [np.zeros((0, 3), np.int64)], 0
    for told, cells in sets:
        vertices, triangles = cells.surface()
        parts.append({**told, "vertices": len(vertices), "triangles": len(triangles)})
        places.append(vertices)
        corners.append(triangles + count)
        count += len(vertices)
    cells = sets[0][1] if sets else None
    return {
        "parts": parts,
        "origin": (cells.corner - centre).tolist() if cells else [0.0] * 3,
        "unit": cells.edge / PLACES_PER_EDGE if cells else 1.0,
        "vertices": packed(np.rint(np.concatenate(places) * PLACES_PER_EDGE), "int32", 3),
        "triangles": packed(np.concatenate(corners), "int32", 1),
    }


def _packed_names(evidence: Evidence, centre: NDArray) -> dict:
    """The openings that the view may name, the largest first: name, steps, places, and the responses by step."""
    rows, place, found = evidence.excavations, step_places(evidence), opening_places(evidence)
    schedule = [_mined_and_filled(rows[index], place) for index, *_ in found]
    names = [rows[index].name for index, *_ in found]
    depth, side, closure = responses(evidence.openings, names, list(place))
    return {
        "openings": [
            {"name": name, "step": mined, "filled": filled, "places": len(places), "reach": round(reach, 2)}
            for name, (mined, filled), (_, places, reach) in zip(names, schedule, found, strict=True)
        ],
        "places": packed(np.concatenate([np.zeros((0, 3)), *(one for _, one, _ in found)]) - centre, "float32"),
        "sides": SIDES,
        "measured": bool(np.isfinite(depth).any()),
        "depth": packed(depth, "float32"),
        "side": packed(side, "int32"),
        "closure": packed(closure, "float32"),
    }


def _mined_and_filled(row: ExcavationRow, place: Mapping[str, int]) -> tuple[int, int]:
    """Places of the steps that mine and fill an excavation: PLANNED, NEVER where no step of the run does."""
    if row.planned:
        return PLANNED, NEVER
    return place.get(row.step, 0), NEVER if row.fill == "none" else place.get(row.filled, NEVER)


def shown_events(evidence: Evidence, catalog: xr.Dataset) -> NDArray:
    """Indices of the events that the view shows: those of a step, and of more than MAX_EVENTS the largest."""
    chosen = np.flatnonzero(step_of_events(evidence, catalog) >= 0)
    size = np.nan_to_num(log_potency(catalog["potency"].values[chosen]), nan=-np.inf)
    return np.sort(chosen[np.argsort(-size, kind="stable")[:MAX_EVENTS]])


def _packed_events(evidence: Evidence, label: str, catalog: xr.Dataset, centre: NDArray) -> dict:
    chosen = shown_events(evidence, catalog)
    time = catalog["time"].values[chosen].astype("datetime64[ns]")
    seconds = (time - np.datetime64(0, "ns")) / np.timedelta64(1, "s")
    modelled = catalog.attrs["kind"] == "synthetic"
    return {
        "label": label,
        "modelled": modelled,
        "count": len(chosen),
        "total": catalog.sizes["event"],
        "position": packed(catalog["location"].values[chosen] - centre, "float32"),
        "log_potency": packed(log_potency(catalog["potency"].values[chosen]), "float32"),
        "mw": packed(catalog["mw"].values[chosen], "float32"),
        "step": packed(step_of_events(evidence, catalog)[chosen], "int32", 1),
        "time": packed(seconds, "float64"),  # since 1970; NaN where it is not known
    }
