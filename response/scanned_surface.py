"""The surface of a cavity scan: read, freed of foreign pieces, and refused where it does not show the excavations."""

import logging
from collections.abc import Sequence

import igl
import numpy as np
from numpy.typing import NDArray

from common.errors import InputError
from mpm_core.geometry.inside import contains
from mpm_core.geometry.solid_files import METRES_PER_UNIT, Picked, read_solid
from mpm_core.geometry.solids import Solid, edges_of, unique_rows
from mpm_core.scene.scene_solids import exchanged_hint
from response.scan_settings import PlacedScan

MIN_VOLUME, MAX_VOLUME = 0.05, 20.0  # Of the excavations: a scan in feet that is read as metres has 35 times as much.
LIKELY_VOLUME = (0.5, 2.0)  # Of the excavations: a unit that makes the scan so large is likely meant.
MIN_OVERLAP = 0.5  # Share of the smaller of scan and excavations that lies in the other one.
PIT = "; a pit"  # Begins what the reader of solids says of excavations alone.
POINTS_ACROSS = 24  # Of the lattice by which overlaps are measured.


def read_scan(scan: PlacedScan, design: Sequence[Solid], where: str) -> Solid:
    """The surface of a scan without closed pieces that do not meet the excavations; design: their solids.

    where: key of the scan in the mine file, for messages. Raises InputError, one line, for a file that cannot be read
    or bounds no volume, and for a scan that is not that of the excavations: wrong units, another place.
    """
    picked = Picked.of(scan.given(), scan.grid.map() if scan.grid else None)
    try:
        solid = read_solid(scan.file, scan.name, picked)
    except InputError as error:
        raise InputError(f"{where}.file: {str(error).partition(PIT)[0]}") from error
    solid = _without_foreign(solid, design)
    _check_volume(solid, scan, design, where)
    _check_place(solid, scan, design, where)
    for station in np.reshape(scan.stations or (), (-1, 3)):
        if not contains(solid, station[None])[0]:
            raise InputError(f"{where}.stations: {_text(station)} m is not in the scanned void; correct it")
    return solid


def _without_foreign(solid: Solid, design: Sequence[Solid]) -> Solid:
    """The surface without closed pieces that have no part in the excavations and none of them within."""
    vertices, place = unique_rows(solid.vertices)
    facets = np.ascontiguousarray(place[solid.facets], dtype=np.int64)
    edges = edges_of(facets)
    count, piece = igl.facet_components(facets)
    is_open = np.bincount(piece, (edges.balance != 0)[edges.of_facet].any(axis=1), minlength=count) > 0
    foreign = np.zeros(count, bool)
    for number in np.flatnonzero(~is_open) if count > 1 else ():
        own = Solid(solid.name, vertices, facets[piece == number])
        foreign[number] = not any(_meet(own, other) for other in design)
    if foreign.all():
        return solid  # the check of the place says where it is
    if foreign.any():
        logging.warning("%s: %d of %d pieces do not meet its excavations; left out", solid.name, foreign.sum(), count)
    return Solid(solid.name, vertices, facets[~foreign[piece]]) if foreign.any() else solid


def _meet(one: Solid, other: Solid) -> bool:
    """True if a corner of either solid lies in the other one."""
    if (one.bounds[0] > other.bounds[1]).any() or (one.bounds[1] < other.bounds[0]).any():
        return False
    corners = [solid.vertices[np.unique(solid.facets)] for solid in (one, other)]
    return bool(contains(other, corners[0]).any() or contains(one, corners[1]).any() or _share(one, [other]) > 0.0)


def _check_volume(solid: Solid, scan: PlacedScan, design: Sequence[Solid], where: str) -> None:
    """Raise InputError for a scan that is far smaller or larger than its excavations."""
    volume = abs(solid.signed_volume) if solid.is_closed else solid.volume
    expected = sum(one.volume for one in design)
    ratio = volume / expected
    if MIN_VOLUME <= ratio <= MAX_VOLUME:
        return
    unit = METRES_PER_UNIT[scan.units or "m"]
    likely = [
        name
        for name, metres in METRES_PER_UNIT.items()
        if LIKELY_VOLUME[0] <= ratio * (metres / unit) ** 3 <= LIKELY_VOLUME[1] and name != scan.units
    ]
    hint = f"; with units: {likely[0]} it would be {ratio * (METRES_PER_UNIT[likely[0]] / unit) ** 3:.2g}"
    raise InputError(
        f"{where}.units: {scan.file}: the scan has {ratio:.2g} times the volume of {', '.join(scan.excavations)} "
        f"({volume:.3g} and {expected:.3g} m3){hint if likely else ''}; correct units or scale, or excavations"
    )


def _check_place(solid: Solid, scan: PlacedScan, design: Sequence[Solid], where: str) -> None:
    """Raise InputError for a scan of which most lies beside its excavations."""
    shared = 0.0
    for one, others in [*((part, [solid]) for part in design), (solid, design)]:
        shared = max(shared, _share(one, others))
        if shared >= MIN_OVERLAP:
            return
    lower = np.min([one.bounds[0] for one in design], axis=0)
    upper = np.max([one.bounds[1] for one in design], axis=0)
    away = solid.bounds.mean(axis=0) - 0.5 * (lower + upper)
    exchanged = exchanged_hint(solid.bounds[0], solid.bounds[1], lower, upper)
    raise InputError(
        f"{where}.file: {scan.file}: {100 * shared:.0f} % of the scan and {', '.join(scan.excavations)} are the same "
        f"rock; its middle lies {_text(away)} m from theirs{exchanged}; correct units and offset, or excavations"
    )


def _share(solid: Solid, others: Sequence[Solid]) -> float:
    """Share of a solid's volume that lies in the others, by the points of a lattice."""
    lower, upper = solid.bounds
    spacing = (upper - lower).max() / POINTS_ACROSS
    axes = [
        np.linspace(a, b, count + 1)[:-1] + 0.5 * (b - a) / count
        for a, b, count in zip(lower, upper, np.maximum(np.ceil((upper - lower) / spacing).astype(int), 4), strict=True)
    ]
    points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    points = points[contains(solid, points)]
    if not len(points):
        return 0.0
    return float(np.any([contains(other, points) for other in others], axis=0).mean())


def _text(vector: NDArray) -> str:
    return f"({', '.join(f'{value:.3g}' for value in vector)})"
