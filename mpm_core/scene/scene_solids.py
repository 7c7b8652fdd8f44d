"""Solids of the configuration, excavations and rock bodies, as geometry within a domain."""

import logging
from collections.abc import Sequence

import numpy as np

from common.errors import InputError
from mpm_core.geometry.inside import contains
from mpm_core.geometry.meshes import join
from mpm_core.geometry.shapes import Shape, checked, shape_of, solid_of
from mpm_core.geometry.shapes.prism import DrawnPrism
from mpm_core.geometry.solid_files import Picked, read_outlines, read_solid
from mpm_core.geometry.solids import Outside, Solid
from mpm_core.grid.domain import Domain
from mpm_core.scene.rock_blocks import RockBlocks, kinds_or_host
from mpm_core.settings import PlacedSolid

MAX_SHARE_LEFT_AWAY = (
    0.01  # Of the distance of a solid from where it belongs: with less left, a change of axes is right.
)


def read_solids(
    entries: Sequence[PlacedSolid], section: str, domain: Domain, may_miss: bool = False
) -> list[Solid | Outside]:
    """Solids of a section of the configuration ("excavations"), in order; `outside`: what they leave of the domain.

    entries: or their values. may_miss: only warn of one that lies outside the domain.

    Raises InputError naming the entry, also for one that lies outside the domain.
    """
    dimension = len(domain.lower)
    solids: list[Solid | Outside] = []
    for entry in (PlacedSolid.of(one, section) for one in entries):
        where = f"{section}.{entry.name}"
        try:
            solid = read_entry(entry, dimension, where)
        except InputError as error:
            if str(error).startswith((f"{where}.", f"{where}: ")):
                raise
            raise InputError(f"{where}: {str(error).removeprefix(entry.name + ': ')}") from error
        check_inside(solid, domain, section, bool(entry.file), may_miss)
        solids.append(Outside(solid, domain.lower, domain.upper) if entry.outside else solid)
    return solids


def read_entry(entry: PlacedSolid, dimension: int, where: str) -> Solid:
    """The solid of an entry. Raises InputError."""
    if not entry.file:
        return solid_of(shape_of(entry.given(), dimension, where), dimension, entry.name)
    if dimension == 2:
        raise InputError(f"{where}.file: a plane strain scene needs a shape in its plane, not a solid")
    if entry.shape:
        return _joined([solid_of(prism, dimension, entry.name) for prism in prisms_of(entry, where)])
    return read_solid(entry.file, entry.name, picked(entry))


def picked(entry: PlacedSolid) -> Picked:
    """The part of an entry's file that is meant, and its place."""
    return Picked.of(entry.given(), entry.grid.map() if entry.grid else None)


def prisms_of(entry: PlacedSolid, where: str) -> list[Shape]:
    """The prism of each outline of an entry's drawing. Raises InputError."""
    given = entry.given()
    drawn = DrawnPrism.of({key: given[key] for key in DrawnPrism.model_fields if key in given}, where)
    outlines = read_outlines(entry.file, entry.name, picked(entry), entry.height)
    return [checked(drawn.prism(outline), 3, where) for outline in outlines]


def _joined(solids: list[Solid]) -> Solid:
    """Several solids as one, named as the first."""
    return Solid(solids[0].name, *join([(solid.vertices, solid.facets) for solid in solids]))


def check_inside(solid: Solid, domain: Domain, section: str, from_file: bool, may_miss: bool) -> None:
    """Raise InputError for a solid outside the domain, unless it may miss it; one that is partly outside is cut off at
    the boundary."""
    lower, upper = solid.bounds
    is_outside = (upper <= domain.lower).any() or (lower >= domain.upper).any()
    if is_outside and may_miss:
        logging.warning("%s.%s lies outside the domain and is left out", section, solid.name)
    elif is_outside:
        raise InputError(
            f"{section}.{solid.name}: lies outside the domain ({_span(lower, upper)}; "
            f"domain {_span(domain.lower, domain.upper)}): check its coordinates"
            f"{', its units, scale and offset' if from_file else ''} and domain.lower, domain.upper"
            f"{exchanged_hint(lower, upper, domain.lower, domain.upper)}"
        )
    elif (lower < domain.lower).any() or (upper > domain.upper).any():
        logging.warning("%s.%s reaches beyond the domain; the part inside is used", section, solid.name)


def exchanged_hint(lower: np.ndarray, upper: np.ndarray, other_lower: np.ndarray, other_upper: np.ndarray) -> str:
    """The end of a message on a box (3,), (3,) m away from another one: that it would lie there if x and y were
    exchanged; empty where it would not, and in plane strain."""
    order = [1, 0, 2]
    if len(lower) < 3:
        return ""
    away, exchanged = (
        np.linalg.norm(np.maximum(np.maximum(other_lower - high, low - other_upper), 0.0))
        for low, high in ((lower, upper), (lower[order], upper[order]))
    )
    return "; with x and y exchanged it would lie there" if exchanged < MAX_SHARE_LEFT_AWAY * away else ""


def _span(lower, upper) -> str:
    return ", ".join(f"{a:.10g} to {b:.10g} m" for a, b in zip(lower, upper, strict=True))


def bodies_at(bodies: list[Solid | Outside], points: np.ndarray, blocks: RockBlocks | None = None) -> np.ndarray:
    """Rock body that each point (k, d) lies in, later ones winning: (k,) int16, -1 host.

    Kinds of rock of a block model have the numbers after the bodies, which replace what they cover.
    """
    body = kinds_or_host(blocks, points, len(bodies))
    for number, solid in enumerate(bodies):
        body[contains(solid, points)] = number
    return body
