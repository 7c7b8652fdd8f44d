"""Solids of the configuration, excavations and rock bodies, as geometry within a domain."""

import logging
from collections.abc import Sequence

import numpy as np

from common.errors import InputError
from mpm_core.geometry.bodies import join
from mpm_core.geometry.inside import contains
from mpm_core.geometry.shapes import build_shape
from mpm_core.geometry.solid_files import Picked, read_outlines, read_solid
from mpm_core.geometry.solids import Outside, Solid
from mpm_core.grid.domain import Domain
from mpm_core.settings import SolidSettings


def read_solids(
    entries: Sequence[SolidSettings], section: str, domain: Domain, may_miss: bool = False
) -> list[Solid | Outside]:
    """Solids of a section of the configuration ("excavations"), in order; `outside`: what they leave of the domain.

    entries: or their values. may_miss: only warn of one that lies outside the domain.

    Raises InputError naming the entry, also for one that lies outside the domain.
    """
    dimension = len(domain.lower)
    solids = []
    for entry in (SolidSettings.of(one, section) for one in entries):
        try:
            if entry.file and dimension == 2:
                raise InputError(f"{entry.name}: file: a plane strain scene needs a shape in its plane, not a solid")
            if entry.file and entry.shape:
                solids.append(_joined([build_shape(prism, dimension) for prism in prisms_of(entry)]))
            elif entry.file:
                solids.append(read_solid(entry.file, entry.name, Picked.of(entry.given())))
            else:
                solids.append(build_shape(entry.given(), dimension))
        except InputError as error:
            raise InputError(f"{section}.{entry.name}: {str(error).removeprefix(entry.name + ': ')}") from error
        check_inside(solids[-1], domain, section, bool(entry.file), may_miss)
        if entry.outside:
            solids[-1] = Outside(solids[-1], domain.lower, domain.upper)
    return solids


def prisms_of(entry: SolidSettings) -> list[dict]:
    """Keys of a prism for each outline of its drawing; `height` stands on each polyline's own elevations."""
    given = entry.given()

    def ring(line: np.ndarray) -> dict:
        if not entry.height:
            return {"polygon": line[:, :2].tolist(), "lower": entry.lower, "upper": entry.upper}
        level = line[:, 2]
        return {"polygon": line[:, :2].tolist(), "base": level.tolist(), "top": (level + entry.height).tolist()}

    outlines = read_outlines(entry.file, entry.name, Picked.of(given), entry.height)
    return [given | ring(outline.line) | {"holes": [ring(hole) for hole in outline.holes]} for outline in outlines]


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
        )
    elif (lower < domain.lower).any() or (upper > domain.upper).any():
        logging.warning("%s.%s reaches beyond the domain; the part inside is used", section, solid.name)


def _span(lower, upper) -> str:
    return ", ".join(f"{a:.10g} to {b:.10g} m" for a, b in zip(lower, upper, strict=True))


def bodies_at(bodies: list[Solid | Outside], points: np.ndarray) -> np.ndarray:
    """Rock body that each point (k, d) lies in, later ones winning: (k,) int16, -1 host."""
    body = np.full(len(points), -1, np.int16)
    for number, solid in enumerate(bodies):
        body[contains(solid, points)] = number
    return body
