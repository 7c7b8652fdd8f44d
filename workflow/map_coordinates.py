"""All places of a mine file on the map: read in the mine's own grid, in x east, y north, z up and metres from here on.

Solids of files and columns of a record are converted where they are read, by the grid that their stages are given.
"""

from dataclasses import replace
from typing import Any, NamedTuple, TypeVar

import numpy as np

from catalogs.records.filters import MAX_COORDINATE
from catalogs.records.settings import RecordSettings
from catalogs.settings import FaceSettings, ReportSettings
from common.errors import InputError, InputErrors, Mistakes
from common.frame import Frame
from common.mine_grid import EAST_NORTH, GridMap, MineGrid, fit
from common.setting_types import Settings, is_list
from common.voigt import NAMES
from mpm_core.geometry.shapes import Shape, checked, shape_of
from mpm_core.geometry.shapes.prism import DrawnPrism
from mpm_core.insitu_settings import InsituSettings, SymmetricTensor
from mpm_core.settings import FACES, Boundary, DomainSettings, ShapeSettings
from response.loading_settings import LoadingSettings
from response.observation_settings import ObservationSettings
from workflow.mine import shape_keys
from workflow.mine_settings import BoundaryStrain, Load, MineSettings
from workflow.record_checks import BEYOND_USE, degrees_outside

SIDES = FACES[:4]  # Faces of the domain that stand upright.
Solid = TypeVar("Solid", bound=ShapeSettings)


class OnMap(NamedTuple):
    """Settings with all places on the map, and in words how the mine's grid lies there; empty if it is the map."""

    settings: MineSettings
    text: str = ""


def on_map(settings: MineSettings) -> OnMap:
    """The settings of a mine with all their places on the map, and its grid there in `frame.grid`, without `points`.

    Without `frame.grid`, and with a `crs` that has no axis to the west or south, they are the same settings. Raises
    InputErrors, a line for each place that the map has no form for, and one for a grid that is wrong.
    """
    frame = settings.frame
    axes = EAST_NORTH
    if frame.crs is not None:
        from catalogs.sources.geographic_frame import axes_of_crs  # slow to import

        axes = axes_of_crs(frame.crs)
        _check_unit(frame)
    if frame.grid is None and axes == EAST_NORTH:
        return OnMap(settings)
    _check_has_grid(settings)
    own, grid, text = _resolved(frame, axes)
    mistakes = Mistakes()
    found: dict[str, Any] = {
        "frame": frame.model_copy(update={"grid": own, "surface": grid.elevation(frame.surface)}),
        "insitu_stress": _insitu_stress(settings.insitu_stress, grid),
        "strains": tuple(_strain(entry, grid) for entry in settings.strains),
        "rock_bodies": tuple(_solid(body, grid) for body in settings.rock_bodies),
        "excavations": tuple(_solid(entry, grid) for entry in settings.excavations),
        "loads": tuple(_load(load, grid) for load in settings.loads),
        "face": settings.face and _face(settings.face, grid),
        "observations": settings.observations and _observations(settings.observations, grid),
        "loading_measures": settings.loading_measures and _loading(settings.loading_measures, grid),
        "report": _report(settings.report, grid),
    }
    with mistakes.gather():
        found["domain"] = _domain(settings.domain, grid)
    with mistakes.gather():
        found["record"] = _record(settings.record, grid)
    if mistakes.lines:
        raise InputErrors(mistakes.lines)
    given = settings.model_fields_set
    return OnMap(settings.model_copy(update={key: found[key] for key in found if key in given}), text)


def _check_unit(frame: Frame) -> None:
    """Raise InputError for a crs that counts in feet where nothing says in which unit the files do."""
    from catalogs.sources.geographic_frame import unit_of_crs

    unit = unit_of_crs(frame.crs or "")
    if unit != "metre" and (frame.grid is None or "units" not in frame.grid.model_fields_set):
        known = {"US survey foot": "us_ft", "foot": "ft"}.get(unit, "m")
        raise InputError(
            f"frame.crs: {frame.crs[:40] if frame.crs else ''}: its unit is the {unit}, and results are in metres; say "
            f"which unit solids and record have with frame.grid.units: {known}, if they have that of the system"
        )


def _check_has_grid(settings: MineSettings) -> None:
    """Raise InputErrors where a grid has no meaning: in a plane, and for data that have coordinates of their own."""
    reader = settings.record is not None and settings.record.reader == "elk_creek"
    found = {
        f"plane: {settings.plane}: a scene in a plane": settings.plane != "none",
        "excavations_from: these excavations": settings.excavations_from is not None,
        "face.source: these positions": settings.face is not None and settings.face.source is not None,
        "record.reader: elk_creek: these events": reader,
    }
    lines = [f"{what} cannot lie in a grid; leave frame.grid out, and give a crs with axes east and north"
             for what, there in found.items() if there]  # fmt: skip
    if lines:
        raise InputErrors(lines)


def _resolved(frame: Frame, axes: tuple[str, ...]) -> tuple[MineGrid, GridMap, str]:
    """The grid of a frame without points, as a transformation to east and north, and in words.

    axes: directions of x and y in coordinates on the map as files have them. Raises InputError, naming the key.
    """
    given = frame.grid or MineGrid()
    written = GridMap(axes=axes)  # from coordinates on the map, as files have them, to east and north
    points = np.array([point.map for point in given.points or ()])
    own, found = given.axes or axes, None
    if given.points:
        _check_in_area(frame, written.to_map(points))
        found = fit(given, written.to_map(points), own)
        grid = found.map
    else:
        grid = given.map()
        grid = replace(grid, axes=own, map_origin=tuple(written.to_map(grid.map_origin).tolist()))
    resolved = MineGrid.of(
        {
            "axes": grid.axes,
            "angle": grid.angle,
            "origin": {"grid": grid.grid_origin, "map": grid.map_origin},
            "scale": grid.scale,
            "units": grid.units,
        }
    )
    text = grid.text()
    if found:
        text += f" It misses its {len(points)} common points by at most {found.residual.max():.3f} m in plan"
        text += f" and {found.elevation_residual.max():.3f} m in elevation." if points.shape[1] == 3 else "."
        if found.fits_mirrored:
            text += " They fit the mirrored grid as well, and so do not show a mistake in axes: give one that is off "
            text += "their line."
    return resolved, grid, text


def _check_in_area(frame: Frame, points: np.ndarray) -> None:
    """Raise InputError for a common point (point, 2 or 3) m, east and north, outside the area of frame.crs."""
    if frame.crs is None:
        return
    from catalogs.sources.geographic_frame import MineFrame

    system = MineFrame(frame)
    latitude, longitude, _ = system.to_globe(np.column_stack([points[:, :2], np.zeros(len(points))]))
    away = degrees_outside(system, latitude, longitude)
    worst = int(away.argmax())
    if away[worst] > BEYOND_USE:
        raise InputError(
            f"frame.grid.points[{worst}].map: lies at latitude {latitude[worst]:.1f}, longitude "
            f"{longitude[worst]:.1f}, outside the area of {frame.crs[:40]}; give coordinates of that system, along its "
            "axes"
        )


def _report(report: ReportSettings, grid: GridMap) -> ReportSettings:
    """The planes of a report with their points on the map; strikes count from the map's north already."""
    sections = tuple(
        one if one.point is None else one.model_copy(update={"point": tuple(grid.to_map(one.point).tolist())})
        for one in report.sections
    )
    return report.model_copy(update={"sections": sections})


def _loading(settings: LoadingSettings, grid: GridMap) -> LoadingSettings:
    """Planes of excess shear stress with their points on the map, as those of a report."""
    planes = tuple(
        one if one.point is None else one.model_copy(update={"point": tuple(grid.to_map(one.point).tolist())})
        for one in settings.planes
    )
    return settings.model_copy(update={"planes": planes})


def _shape_of(solid: ShapeSettings) -> Shape | None:
    """The shape of a solid, also of prisms from a drawing; None for a file, and where the checks to come refuse it."""
    given = shape_keys(solid)
    if solid.file is not None and solid.shape is None:
        return None
    try:
        if solid.file is None:
            return shape_of(given, 3, "")
        keys = given.keys() & DrawnPrism.model_fields.keys()
        return checked(DrawnPrism.of({key: given[key] for key in keys}), 3, "")
    except InputError:
        return None


def _solid(solid: Solid, grid: GridMap, **others: Any) -> Solid:
    """A solid with its shape on the map. others: further keys to replace."""
    shape = _shape_of(solid)
    if shape is None and not others:
        return solid
    keys = set(type(shape).model_fields) if shape else set()
    kept = {key: value for key, value in solid.given().items() if key not in keys}
    return type(solid).of(kept | (shape.placed(grid) if shape else {}) | others)


def _load(load: Load, grid: GridMap) -> Load:
    """A load with its shape, its force, and the point or line that this is directed to, on the map."""
    others: dict[str, Any] = {}
    if is_list(load.force):
        others["force"] = grid.vector(load.force).tolist()
    if load.toward is not None:
        points = load.toward if is_list(load.toward[0]) else (load.toward,)
        if {len(point) for point in points} == {3}:  # others are refused by the checks to come
            others["toward"] = grid.to_map(load.toward).tolist()
    return _solid(load, grid, **others)


def _rotated(tensor: SymmetricTensor, grid: GridMap) -> SymmetricTensor:
    """Components along east, north and up of a tensor by those along the grid's axes."""
    components = grid.tensor(tensor.voigt()) + 0.0  # no negative zero
    return type(tensor).of(dict(zip(NAMES, components.tolist(), strict=True)))


def _insitu_stress(stress: InsituSettings, grid: GridMap) -> InsituSettings:
    """The stress by components along east, north and up; principal stresses have their axes by bearings already."""
    parts = {name: getattr(stress, name) for name in ("constant", "gradient")}
    return stress.model_copy(update={name: _rotated(part, grid) for name, part in parts.items() if part is not None})


def _strain(entry: BoundaryStrain, grid: GridMap) -> BoundaryStrain:
    return entry.model_copy(update={"strain": _rotated(entry.strain, grid)})


def _face(face: FaceSettings, grid: GridMap) -> FaceSettings:
    positions = [{**position.given(), "ends": grid.to_map(position.ends).tolist()} for position in face.positions or ()]
    return FaceSettings.of({"positions": positions}, "face")


def _observations(settings: ObservationSettings, grid: GridMap) -> ObservationSettings:
    """Instruments with their places on the map. Axes have bearings from the map's north already."""

    def placed(one: dict) -> dict:
        return one | {key: grid.to_map(one[key]).tolist() for key in ("at", "start", "end", "stations") if key in one}

    given = {kind: [placed(one) for one in own] for kind, own in settings.given().items()}
    return ObservationSettings.of(given, "observations")


def _box(where: str, box: Settings, grid: GridMap, remedy: str) -> dict[str, tuple[float, ...]]:
    """The corners of a box on the map, by their keys; none where the checks to come refuse it.

    Of one that is open on a side, the corner that is not given is as far away as a coordinate can be. Raises InputError
    for a box that is none on the map.
    """
    given = {key: getattr(box, key) for key in ("lower", "upper") if getattr(box, key) is not None}
    if not given:
        return {}
    if not grid.keeps_boxes:
        raise InputError(
            f"{where}.{min(given)}: a box along the mine's grid, which is turned by {grid.angle:.6g} degrees, is no "
            f"box along the map's axes; leave lower and upper out: {remedy}"
        )
    lower = np.array(given.get("lower", [-MAX_COORDINATE] * 3))
    upper = np.array(given.get("upper", [MAX_COORDINATE] * 3))
    if not len(lower) == len(upper) == 3 or (lower >= upper).any():
        return {}
    ends = np.clip(grid.box(lower, upper), -MAX_COORDINATE, MAX_COORDINATE)
    return dict(zip(("lower", "upper"), (tuple(end) for end in ends.tolist()), strict=True))


def _domain(domain: DomainSettings, grid: GridMap) -> DomainSettings:
    """The domain on the map. Raises InputError for a turned box, and for sides with conditions of their own there."""
    changes: dict[str, Any] = {}
    if domain.lower is not None and domain.upper is not None:
        changes |= _box("domain", domain, grid, "the domain follows from the openings (grid.finest_cell)")
        if grid.scale != 1.0:
            raise InputError(
                f"domain.lower: frame.grid has the scale {grid.scale:.6g}, so that the sides would be no multiples of "
                "the cells; leave lower and upper out: the domain follows from the openings (grid.finest_cell)"
            )
    if isinstance(domain.boundary, Boundary):
        changes["boundary"] = _boundary(domain.boundary, grid)
    return domain.model_copy(update=changes)


def _boundary(boundary: Boundary, grid: GridMap) -> Boundary:
    """Conditions of the faces by their names on the map."""
    conditions = boundary.by_face()
    if len({conditions[side] for side in SIDES}) == 1:
        return boundary
    if not grid.keeps_boxes:
        raise InputError(
            f"domain.boundary: the sides of the domain run along the map's axes, from which the grid is turned by "
            f"{grid.angle:.6g} degrees; give x and y the same condition"
        )
    found = {face: conditions[face] for face in FACES[4:]}
    for side in SIDES:
        outward = grid.vector(np.eye(3)["xyz".index(side[0])] * (1.0 if side.endswith("upper") else -1.0))
        axis = int(np.abs(outward).argmax())
        found[f"{'xyz'[axis]}_{'upper' if outward[axis] > 0 else 'lower'}"] = conditions[side]
    return Boundary.of(found)


def _record(record: RecordSettings | None, grid: GridMap) -> RecordSettings | None:
    """The record with the box of its filter on the map. Its columns are converted as they are read."""
    if record is None or record.filter is None:
        return record
    corners = _box("record.filter", record.filter, grid, "the record is cropped to the domain")
    return record.model_copy(update={"filter": record.filter.model_copy(update=corners)})
