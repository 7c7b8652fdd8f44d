"""The orientation of a file's triangles. Those of one surface are made to agree, where it says what it means.

Neighbours over an edge that two triangles share agree if they pass it opposite ways. Where some do not, each patch of
such neighbours is turned to agree (libigl), the way that most of its area looks in the file. A surface that agrees
with itself is left as it is, inverted or not: an inverted shell inside another one is a cavity. A shell that is
inverted and reaches out of what it lies in cannot be one, and is turned. Where this cannot be decided, the surface is
refused.
"""

import igl
import numpy as np

from common.errors import InputError
from mpm_core.geometry.solids import Edges, edges_of, unique_rows
from mpm_core.geometry.winding import winding_number_of

MAX_REVERSED_SHARE = 0.4  # A patch is refused if a larger share of its area looks the other way than the rest.
PROBE_BOX_MARGIN = 0.01  # Nothing may be inside on a box this share of the solid's size outside its bounding box.
MAX_INSIDE_AROUND = 0.02  # A solid bounds no volume if a larger share of the points on that box is inside it.
MAX_TRIANGLES_PROBED = 20_000  # Triangles that are probed for overlaps of bodies.
TRIANGLE_PROBE_DISTANCE = 1e-3  # Distance of a probe from its triangle, as a share of the root of the triangle's area.
# Smallest distance of a probe from its triangle as a share of the solid's size, well above what libigl's tree resolves.
MIN_PROBE_DISTANCE = 1e-5
SURFACE_REMEDY = "export it again as one closed surface whose triangles all look outward"


def agree(vertices: np.ndarray, facets: np.ndarray) -> tuple[np.ndarray, int]:
    """The triangles (f, 3), turned to agree, and how many were turned. vertices (v, 3) m, equal ones merged.

    Raises InputError where the surface does not say which way is meant.
    """
    edges = edges_of(facets)
    given = facets
    if ((edges.count == 2) & (edges.balance != 0)).any():
        facets = _turn_patches(vertices, facets)
        edges = edges_of(facets)
    facets = _turn_overlapping(vertices, facets, edges)
    return facets, int((facets != given).any(axis=1).sum())


def without_partitions(facets: np.ndarray) -> np.ndarray:
    """The triangles (f, 3) less those between bodies that touch in a whole face, where each body has the same ones.

    Such walls bound nothing. Without them the bodies are one, and whichever way each looks can be seen at their seam:
    there each triangle counted once makes an edge of three. Other repeats of a triangle are kept.
    """
    _, triangle = unique_rows(np.sort(facets, axis=1))
    copies = np.bincount(triangle)
    if (copies < 2).all():
        return facets
    _, once = np.unique(triangle, return_index=True)
    edges = edges_of(facets[once])
    seam = ((edges.count > 2) & (edges.count % 2 == 1))[edges.of_facet].any(axis=1)
    twice = np.flatnonzero(copies == 2)
    count, wall = igl.facet_components(np.ascontiguousarray(facets[once[twice]], dtype=np.int64))
    at_seam = np.bincount(wall, seam[twice], minlength=count) > 0
    partition = np.zeros(len(copies), dtype=bool)
    partition[twice] = at_seam[wall]
    return facets[~partition[triangle]]


def _turn_patches(vertices: np.ndarray, facets: np.ndarray) -> np.ndarray:
    """Neighbours agree within each patch, and most of its area looks as it did."""
    agreeing, patch = igl.bfs_orient(np.ascontiguousarray(facets, dtype=np.int64))
    edges = edges_of(agreeing)
    if ((edges.count == 2) & (edges.balance != 0)).any():
        raise InputError(f"has a surface of one side only, like a Moebius strip: {SURFACE_REMEDY}")
    turned = (agreeing != facets).any(axis=1)
    area = _areas(vertices[facets])
    share = np.bincount(patch, area * turned) / np.maximum(np.bincount(patch, area), np.finfo(float).tiny)
    agreeing = np.where((share > 0.5)[patch][:, None], agreeing[:, ::-1], agreeing)
    doubtful = np.flatnonzero(np.minimum(share, 1.0 - share) > MAX_REVERSED_SHARE)
    if len(doubtful) and len(share) > 1:
        lower, upper = _patch_bounds(vertices, agreeing, patch, len(share))
        key, passed = np.unique(edges.of_facet * len(share) + patch[:, None], return_counts=True)
        has_border = np.bincount(key % len(share), passed % 2, minlength=len(share)) > 0
        for one in doubtful:
            within = (lower <= lower[one]).all(axis=1) & (upper >= upper[one]).all(axis=1)
            around = (lower >= lower[one]).all(axis=1) & (upper <= upper[one]).all(axis=1)
            beside = (lower <= upper[one]).all(axis=1) & (upper >= lower[one]).all(axis=1)
            if (within | around | (beside & has_border[one])).sum() > 1:  # alone it may look either way
                raise InputError(
                    f"{np.minimum(share, 1 - share)[one]:.0%} of a body's surface look the other way, and whether that "
                    f"body is rock or a hole in the one around it cannot be decided: {SURFACE_REMEDY}"
                )
    return agreeing


def _patch_bounds(vertices, facets, patch, count) -> tuple[np.ndarray, np.ndarray]:
    """Lower and upper corners (patch, 3) m."""
    lower, upper = np.full((count, 3), np.inf), np.full((count, 3), -np.inf)
    for corner in range(3):
        np.minimum.at(lower, patch, vertices[facets[:, corner]])
        np.maximum.at(upper, patch, vertices[facets[:, corner]])
    return lower, upper


def _turn_overlapping(vertices: np.ndarray, facets: np.ndarray, edges: Edges) -> np.ndarray:
    """Closed bodies that overlap others of the opposite sign, without being cavities in them, are turned.

    There the winding numbers of the two cancel: a body's surface then bounds a volume from outside here (as a cavity
    does) and from inside there (as a solid does).
    """
    if edges.balance.any():
        return facets
    count, body = igl.facet_components(np.ascontiguousarray(facets, dtype=np.int64))
    corners = vertices[facets] - vertices.mean(axis=0)
    volume = np.bincount(body, np.linalg.det(corners), minlength=count)
    if count == 1 or (volume >= 0).all() or (volume <= 0).all():
        return facets
    order = np.argsort(body, kind="stable")
    first = np.flatnonzero(np.diff(body[order], prepend=-1))
    chosen = order[np.union1d(first, np.arange(0, len(order), -(-len(order) // MAX_TRIANGLES_PROBED)))]
    outward, inward = _both_sides(corners, corners[chosen].mean(axis=1), chosen)
    outward, inward = np.rint(outward), np.rint(inward)
    solid = np.bincount(body[chosen], (outward == 0) & (inward != 0), minlength=count) > 0
    cavity = np.bincount(body[chosen], (outward != 0) & (inward == 0), minlength=count) > 0
    mixed = np.flatnonzero(solid & cavity)
    if len(mixed) == 0:
        return facets
    largest = mixed[np.abs(volume[mixed]).argmax()]
    wrong = mixed[volume[mixed] * volume[largest] < 0]
    return np.where(np.isin(body, wrong)[:, None], facets[:, ::-1], facets)


def check_bounds_volume(vertices: np.ndarray, facets: np.ndarray) -> None:
    """Raise InputError for a surface that is flat, or open with its inside around it."""
    size = np.ptp(vertices, axis=0).max()
    _, spread, _ = np.linalg.svd(vertices[np.unique(facets)] - vertices.mean(axis=0), full_matrices=False)
    if spread[-1] <= 1e-9 * spread[0] or size == 0:
        raise InputError("is flat, all in one plane, and encloses no volume: export the solid as a closed surface")
    if not edges_of(facets).balance.any():
        return
    lower, upper = vertices[np.unique(facets)].min(axis=0), vertices[np.unique(facets)].max(axis=0)
    center, half = (lower + upper) / 2, (upper - lower) / 2
    ring = np.linspace(-1.0, 1.0, 17)
    box = np.stack(np.meshgrid(ring, ring, ring, indexing="ij"), axis=-1).reshape(-1, 3)
    box = box[(np.abs(box) == 1.0).any(axis=1)] * (half + PROBE_BOX_MARGIN * size)
    outside = np.abs(winding_number_of((vertices - center)[facets])(box)) > 0.5
    if outside.mean() > MAX_INSIDE_AROUND:
        raise InputError(
            f"bounds no volume: two sheets that look the same way have their inside around them: {SURFACE_REMEDY}"
        )


def _both_sides(corners: np.ndarray, points: np.ndarray, facet: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Winding numbers just before and just behind points (point, 3) on facets (point,) of `corners` (facet, 3, 3)."""
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])[facet]
    length = np.linalg.norm(normal, axis=1)
    beside = np.maximum(
        TRIANGLE_PROBE_DISTANCE * np.sqrt(length / 2), MIN_PROBE_DISTANCE * np.ptp(corners.reshape(-1, 3), axis=0).max()
    )
    step = normal * (beside / np.maximum(length, np.finfo(float).tiny))[:, None]
    winding_number = winding_number_of(corners)
    return winding_number(points + step), winding_number(points - step)


def _areas(corners: np.ndarray) -> np.ndarray:
    """Areas (facet,) m2 of triangles (facet, 3, 3)."""
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    return 0.5 * np.linalg.norm(cross, axis=1)
