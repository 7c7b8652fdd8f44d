"""Solids as the configuration gives them: the keys of each shape, sizes that can be, places inside the domain, repeats.

From the numbers alone: triangles are made of them by the grid stage (mpm_core/geometry/shapes.py), at leisure.
"""

import numpy as np

from common.errors import InputError, Mistakes
from workflow.mine import NOT_SHAPE, Mine

PLACED = {"units", "scale", "offset"}  # of what a file holds
HEIGHTS = {"lower", "upper", "height"}
FLAT = 1e-9  # of a polygon's length: less width is none
CIRCLE = ({"center", "radius"}, set())
BOX = ({"lower", "upper"}, set())
SHAPES = {  # by dimension, keys that a shape needs, and may have
    3: {
        "box": BOX,
        "tunnel": ({"path", "width", "height"}, {"profile"}),
        "cylinder": ({"start", "end", "radius"}, set()),
        "sphere": CIRCLE,
        "prism": ({"polygon"}, {"lower", "upper", "base", "top"}),
    },
    2: {"box": BOX, "circle": CIRCLE, "sphere": CIRCLE, "cylinder": CIRCLE, "polygon": ({"points"}, set())},
}


def check_place(mine: Mine, where: str, entry: dict) -> None:
    """Raise InputError for an entry whose shape lies outside the domain, or lacks what check_form asks for.

    A rock body may lie outside a domain that follows from the excavations: the grid's stage leaves it out, and says so.
    """
    check_form(mine, where, entry)
    if "file" in entry or (where.startswith("rock_bodies.") and mine.far_field):
        return
    lower, upper = extent(where, entry, mine.dimension)
    domain = [np.array(mine.values["domain"][key]) for key in ("lower", "upper")]
    if (upper <= domain[0]).any() or (lower >= domain[1]).any():
        raise InputError(
            f"{where}: lies outside the domain ({_span(lower, upper)}; domain {_span(*domain)}): check its coordinates "
            "and domain.lower, domain.upper"
        )


def check_form(mine: Mine, where: str, entry: dict) -> None:
    """Raise InputError for an entry whose shape lacks keys, or whose file is missing; wherever it lies."""
    if ("shape" in entry) == ("file" in entry) and entry.get("shape") != "prism":
        raise InputError(f"{where}: give either a shape or a file")
    given = {key for key in entry if key not in NOT_SHAPE}
    if "file" in entry:
        if mine.dimension == 2:
            raise InputError(f"{where}.file: a plane strain scene needs a shape in its plane, not a solid")
        if entry.get("shape") == "prism":
            _check_keys(where, "prism from a file", given - {"shape"}, {"file"}, {"layer", *PLACED, *HEIGHTS})
            if given & HEIGHTS not in ({"lower", "upper"}, {"height"}):
                raise InputError(f"{where}: a prism from a file needs lower and upper, or height above its polyline")
            if "upper" in given:
                _check_above(f"{where}.upper", np.array(entry["lower"]), np.array(entry["upper"]))
        else:
            _check_keys(where, "file", given, {"file"}, {"layer", "element", *PLACED})
        if not is_file(mine.path(entry["file"])):
            raise InputError(f"{where}.file: {mine.path(entry['file'])} is missing; paths resolve from {mine.folder}")
        return
    shapes = SHAPES[mine.dimension]
    if entry["shape"] not in shapes:
        raise InputError(
            f"{where}.shape: '{entry['shape']}' is not one of the {mine.dimension}-D shapes {', '.join(shapes)}"
        )
    needed, optional = shapes[entry["shape"]]
    if missing := needed - given:
        raise InputError(f"{where}.{min(missing)}: missing; shape {entry['shape']} needs {', '.join(sorted(needed))}")
    _check_keys(where, entry["shape"], given - {"shape"}, needed, optional)
    if entry["shape"] == "tunnel":
        _check_tunnel(where, entry)


def is_file(path) -> bool:
    """Whether there is such a file; a name too long for one is none."""
    try:
        return path.is_file()
    except OSError:
        return False


def _check_keys(where: str, kind: str, given: set, needed: set, optional: set) -> None:
    if foreign := given - needed - optional:
        known = ", ".join(sorted(needed | optional))
        raise InputError(f"{where}.{min(foreign)}: not a key of {kind}; its keys are {known}")


def _span(lower, upper) -> str:
    return ", ".join(f"{low:g} to {high:g} m" for low, high in zip(lower, upper, strict=True))


def extent(where: str, entry: dict, dimension: int) -> tuple[np.ndarray, np.ndarray]:
    """Lower and upper corner (dimension,) m of a box around a shape; around a tunnel or cylinder with room to spare.

    Raises InputError for a shape upside down, without length, or with coordinates of another dimension.
    """
    shape = entry["shape"]
    if shape == "box":
        lower, upper = (_points(where, entry, key, dimension)[0] for key in ("lower", "upper"))
        _check_above(f"{where}.upper", lower, upper)
        return lower, upper
    if shape == "prism":
        return _prism_extent(where, entry)
    if shape == "tunnel":
        points, reach = _points(where, entry, "path", 3), max(entry["width"], entry["height"])
    elif shape == "cylinder" and dimension == 3:
        points = np.concatenate([_points(where, entry, key, 3) for key in ("start", "end")])
        reach = entry["radius"]
    elif shape == "polygon":
        points, reach = _points(where, entry, "points", dimension), 0.0
        _check_area(f"{where}.points", points)
    else:
        points, reach = _points(where, entry, "center", dimension), entry["radius"]
    if shape in ("tunnel", "cylinder") and dimension == 3 and (points == points[0]).all():
        raise InputError(f"{where}.{'path' if shape == 'tunnel' else 'end'}: the same point as where it starts")
    return points.min(axis=0) - reach, points.max(axis=0) + reach


def _prism_extent(where: str, entry: dict) -> tuple[np.ndarray, np.ndarray]:
    by_point = "base" in entry or "top" in entry
    keys = ("base", "top") if by_point else ("lower", "upper")
    if set(entry) & {"lower", "upper", "base", "top"} != set(keys):
        raise InputError(f"{where}: a prism needs lower and upper, or base and top with an elevation per polygon point")
    polygon, levels = np.array(entry["polygon"]), []
    _check_area(f"{where}.polygon", polygon)
    for key in keys:
        level = np.array(entry[key])
        if level.shape != ((len(polygon),) if by_point else ()):
            asked = f"{len(polygon)} elevations, one per polygon point" if by_point else "one elevation"
            raise InputError(f"{where}.{key}: expected {asked}")
        levels.append(level)
    _check_above(f"{where}.{keys[1]}", *levels)
    return np.append(polygon.min(axis=0), levels[0].min()), np.append(polygon.max(axis=0), levels[1].max())


def _points(where: str, entry: dict, key: str, dimension: int) -> np.ndarray:
    """The points (point, dimension) m of a key that holds one or a list of them."""
    value = entry[key] if isinstance(entry[key], list) else [entry[key]]
    points = value if isinstance(value[0], list) else [value]
    for point in points:
        if len(point) != dimension:
            raise InputError(f"{where}.{key}: {len(point)} coordinates; this scene has {dimension}")
    return np.array(points, float)


def _check_area(where: str, polygon: np.ndarray) -> None:
    """Raise InputError for a polygon (point, 2) m whose points all lie on one line, or that crosses itself."""
    from mpm_core.geometry.outlines import check_simple  # with all of its package: a sixth of a second

    edges = polygon[1:] - polygon[0]
    if len(edges) < 2 or np.linalg.matrix_rank(edges, tol=FLAT * np.abs(edges).max()) < 2:
        raise InputError(f"{where}: needs three points or more that are not on one line")
    try:
        check_simple(polygon)
    except InputError as error:
        raise InputError(f"{where}: {error}") from error


def _check_tunnel(where: str, entry: dict) -> None:
    """Raise InputError for a stretch that is too steep for a floor, or an arch that is too low."""
    from mpm_core.geometry.tunnels import check_arch, stretches  # with all of its package: a sixth of a second

    def fail(key: str, problem: str) -> InputError:
        return InputError(f"{where}.{key}: {problem}")

    path = _points(where, entry, "path", 3)
    path = path[np.append(True, (np.diff(path, axis=0) != 0).any(axis=1))]
    if len(path) > 1:
        stretches(path, fail)
    check_arch(entry["width"], entry["height"], entry.get("profile", "rectangular"), fail)


def _check_above(where: str, lower: np.ndarray, upper: np.ndarray) -> None:
    if (upper <= lower).any():
        raise InputError(f"{where}: upside down: {upper.tolist()} m is not above lower {lower.tolist()} m throughout")


def check_repeated(mine: Mine, mistakes: Mistakes) -> None:
    """Gather the same solid mined twice: the second finds nothing, unless the first was filled before."""

    def solid(entry: dict) -> dict:
        return {key: value for key, value in entry.items() if key not in NOT_SHAPE}

    def filled_before(first: dict, second: dict) -> bool:
        filled, mined = mine.step_index(first.get("filled", first["step"])), mine.step_index(second["step"])
        return first.get("fill", "none") != "none" and 0 <= filled and (filled < mined or mined < 0)

    by_solid = {}
    for entry in mine.excavations:
        by_solid.setdefault(repr(sorted(solid(entry).items())) + str(entry.get("outside", False)), []).append(entry)
    for entries in by_solid.values():
        for second in entries[1:]:
            earlier = entries[: entries.index(second)]
            first = next(
                (one for one in earlier if not filled_before(one, second) and not filled_before(second, one)), None
            )
            if first is not None:
                mistakes.add(
                    f"excavations.{second['name']}: the same solid as excavations.{first['name']}, which leaves "
                    "nothing to mine; leave one out, or have the first filled before"
                )
