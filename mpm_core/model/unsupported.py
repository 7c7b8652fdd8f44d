"""Unsupported rock and fill: pieces that hang together through faces and that nothing holds. They fall, as if
excavated.

Pieces are found on the samples of cells (occupancy.py), a quarter of a finest cell wide in 3-D, an eighth in 2-D: two
cells hang together where material meets at their common face, not where a void thinner than a cell runs along it, nor
at an edge or a corner only, about which a block would turn. Strength has no part in it: failed rock hangs together too.

A piece is held where fixed and roller faces leave it no rigid motion. Where that is so of none, the largest of those to
which they leave the fewest is the model (a body in space, a scene of tractions). All others are unsupported. Crumbs of
less than a finest cell stay if each of their cells has held material, too: they are that cell's own, no finer is
resolved.

Base cells full of material count as a whole, so that what this costs depends on the cells around excavations.
"""

import logging
from dataclasses import dataclass

import numpy as np
import scipy  # imports its parts as they are used, which small stages would wait for

from mpm_core.geometry.inside import SAMPLES_PER_CELL
from mpm_core.grid.adjacency import face_neighbors
from mpm_core.grid.distorted_cells import DistortedCells
from mpm_core.grid.mesh import CORNER_OFFSETS, MultiLevelGrid
from mpm_core.model.occupancy import ALL_SAMPLES, NO_SAMPLES, Unsupported
from mpm_core.model.rigid_motions import free_motions

MAX_PIECES_LOGGED = 20  # The log lists this many unsupported pieces, the largest first.


@dataclass(frozen=True)
class Parts:
    """Bodies of full base cells (first), then parts of other cells whose samples hang together, and what joins them.

    body (cell,) int64 of cells in full base cells, -1 elsewhere; bodies: how many; cell, samples (part,);
    start (cell + 1,) first part of each cell; piece (bodies + part,) int64, piece of each.
    """

    body: np.ndarray
    bodies: int
    cell: np.ndarray
    samples: np.ndarray
    start: np.ndarray
    piece: np.ndarray


def side_samples(dimension: int, axis: int, side: int) -> np.uint64:
    """Samples of a cell that lie at its lower (side 0) or upper (side 1) face across an axis."""
    per_edge = round(SAMPLES_PER_CELL ** (1 / dimension))
    at = (np.arange(SAMPLES_PER_CELL) // per_edge**axis) % per_edge == side * (per_edge - 1)
    return np.bitwise_or.reduce(np.uint64(1) << np.flatnonzero(at).astype(np.uint64))


def _stride(dimension: int, axis: int) -> np.uint64:
    return np.uint64(round(SAMPLES_PER_CELL ** (axis / dimension)))


def hang_together(samples: np.ndarray, dimension: int) -> tuple[np.ndarray, np.ndarray]:
    """Split samples (k,) uint64 into those joined by faces: parts (part,) uint64 and which of the k (part,), sorted."""
    sides = [[side_samples(dimension, axis, side) for side in range(2)] for axis in range(dimension)]
    rest, row = samples.copy(), np.arange(len(samples))
    parts, rows = [np.empty(0, np.uint64)], [np.empty(0, np.int64)]
    while True:
        row, rest = row[rest != 0], rest[rest != 0]
        if not len(row):
            break
        grown, before = rest & (~rest + np.uint64(1)), NO_SAMPLES  # from the lowest sample on
        while np.any(grown != before):
            before = grown
            for axis, (low, high) in enumerate(sides):
                stride = _stride(dimension, axis)
                grown = grown | (((grown & ~high) << stride) | ((grown & ~low) >> stride)) & rest
        parts.append(grown)
        rows.append(row)
        rest = rest & ~grown
    row = np.concatenate(rows)
    order = np.argsort(row, kind="stable")
    return np.concatenate(parts)[order], row[order]


def find_parts(grid: MultiLevelGrid, solid: np.ndarray) -> Parts:
    """The parts that hang together; solid (cell,) uint64: samples that are rock or fill."""
    halvings, cells = grid.levels - 1, len(solid)
    base = np.ravel_multi_index(tuple((grid.cell_index >> halvings).T), grid.shape >> halvings)
    full = np.ones(grid.shape >> halvings, bool)
    full.reshape(-1)[base[solid != ALL_SAMPLES]] = False
    labels, bodies = scipy.ndimage.label(full)
    body = labels.reshape(-1)[base].astype(np.int64) - 1
    near = np.flatnonzero(body < 0)
    samples, row = hang_together(solid[near], grid.dimension)
    cell = near[row]
    start = np.searchsorted(cell, np.arange(cells + 1))
    own, other = _pairs(grid, near, solid, body)
    simple = (solid[own] == ALL_SAMPLES) & (solid[other] == ALL_SAMPLES)
    full_links = np.stack([_nodes(own[simple], body, bodies, start), _nodes(other[simple], body, bodies, start)])
    links = np.concatenate(
        [full_links, _cut_links(grid, own[~simple], other[~simple], body, bodies, start, samples)], axis=1
    )
    count = bodies + len(cell)
    graph = scipy.sparse.coo_array((np.ones(links.shape[1], np.int8), (links[0], links[1])), shape=(count, count))
    _, piece = scipy.sparse.csgraph.connected_components(graph, directed=False)
    return Parts(body, bodies, cell, samples, start, piece.astype(np.int64))


def _nodes(cell, body, bodies, start):
    """Body, or (bodies +) first part, of each of these cells."""
    return np.where(body[cell] >= 0, body[cell], bodies + start[cell])


def _samples(node, bodies, samples):
    """Samples of bodies, full, and of parts."""
    return np.append(ALL_SAMPLES, samples)[np.maximum(node - bodies + 1, 0)]


def _pairs(grid: MultiLevelGrid, near, solid, body) -> tuple[np.ndarray, np.ndarray]:
    """Pairs of cells with material that share a face, each once; the first one stands in no full base cell."""
    indptr, other = face_neighbors(grid, near)
    own = np.repeat(np.arange(len(solid), dtype=np.int32), np.diff(indptr))
    chosen = (solid[own] != 0) & (solid[other] != 0) & ((own < other) | (body[other] >= 0))
    return own[chosen], other[chosen]


def _cut_links(grid: MultiLevelGrid, own, other, body, bodies, start, samples) -> np.ndarray:
    """Links (2, link) between parts of cells of which at least one is not full: where their samples meet at the face.

    Cells of two sizes: the larger one is full, or empty.
    """
    dimension = grid.dimension
    lower, width = grid.cell_index, grid.cell_width[:, None]
    above = lower[own] + width[own] == lower[other]
    below = lower[other] + width[other] == lower[own]
    axis = np.argmax(above | below, axis=1)
    side = above[np.arange(len(own)), axis].astype(np.int64)
    of_own, of_other = (np.where(body[cell] >= 0, 1, start[cell + 1] - start[cell]) for cell in (own, other))
    pair = np.repeat(np.arange(len(own)), of_own * of_other)
    place = np.arange(len(pair)) - np.repeat(np.cumsum(of_own * of_other) - of_own * of_other, of_own * of_other)
    nodes = []
    at_face = []
    for cell, number, facing in ((own, place // of_other[pair], side), (other, place % of_other[pair], 1 - side)):
        node = _nodes(cell[pair], body, bodies, start) + number
        bits = _samples(node, bodies, samples)
        found = np.zeros(len(pair), np.uint64)
        for across in range(dimension):
            low, high = (side_samples(dimension, across, end) for end in range(2))
            shift = _stride(dimension, across) * np.uint64(round(SAMPLES_PER_CELL ** (1 / dimension)) - 1)
            here = axis[pair] == across
            upper = here & (facing[pair] == 1)
            found[here] = bits[here] & low
            found[upper] = (bits[upper] & high) >> shift
        nodes.append(node)
        at_face.append(found)
    return np.stack(nodes)[:, (at_face[0] & at_face[1]) != 0]


def _motions_left(grid: MultiLevelGrid, faces: dict[tuple[int, int], list[int]], solid, parts: Parts) -> np.ndarray:
    """Number of rigid motions that held faces leave to each piece, (piece,). faces: components held, by axis and
    side."""
    dimension, count = grid.dimension, parts.piece.max() + 1
    at = [np.empty((0, dimension))], [np.empty((0, dimension), bool)], [np.empty(0, np.int64)]
    corners = CORNER_OFFSETS[dimension]
    for (axis, side), components in faces.items():
        edge = grid.cell_index[:, axis] + side * grid.cell_width
        cell = np.flatnonzero((edge == side * grid.shape[axis]) & (solid != 0))
        of_cell = np.where(parts.body[cell] >= 0, 1, parts.start[cell + 1] - parts.start[cell])
        number = np.arange(of_cell.sum()) - np.repeat(np.cumsum(of_cell) - of_cell, of_cell)
        cell = np.repeat(cell, of_cell)
        node = _nodes(cell, parts.body, parts.bodies, parts.start) + number
        bits = _samples(node, parts.bodies, parts.samples)
        touching = (bits & side_samples(dimension, axis, side)) != 0
        cell, node = cell[touching], node[touching]
        for corner in corners[corners[:, axis] == side]:
            at[0].append((grid.cell_index[cell] + corner * grid.cell_width[cell, None]).astype(float))
            at[1].append(np.tile(np.isin(np.arange(dimension), components), (len(cell), 1)))
            at[2].append(parts.piece[node])
    points, held, piece = (np.concatenate(column) for column in at)
    order = np.argsort(piece, kind="stable")
    left = np.full(count, dimension * (dimension + 1) // 2)
    touching, first = np.unique(piece[order], return_index=True)
    for one, begin, end in zip(touching, first, np.append(first, len(order))[1:], strict=True):
        chosen = order[begin:end]
        left[one] = free_motions(points[chosen], held[chosen]).count
    return left


def find_unsupported(
    grid: MultiLevelGrid, solid: np.ndarray, faces: dict[tuple[int, int], list[int]], step: int
) -> Unsupported:
    """Unsupported pieces in cells whose samples `solid` (cell,) uint64 are rock or fill after a step, largest first.

    faces: the components (of the computation's axes) that a face of the domain holds, by its axis and side.
    """
    if not solid.any() or (solid == ALL_SAMPLES).all():
        return Unsupported.none()
    parts = find_parts(grid, solid)
    left = _motions_left(grid, faces, solid, parts)
    # of every cell's parts: those of full base cells are one each
    whole = np.flatnonzero(parts.body >= 0)
    cell = np.concatenate([whole, parts.cell])
    samples = np.concatenate([np.full(len(whole), ALL_SAMPLES), parts.samples])
    piece = np.concatenate([parts.piece[parts.body[whole]], parts.piece[parts.bodies :]])
    volume = np.bitwise_count(samples) / SAMPLES_PER_CELL * grid.cell_size[cell] ** grid.dimension
    size = np.bincount(piece, volume)
    held = left == left.min()
    if left.min() > 0:
        held = np.arange(len(left)) == np.argmax(np.where(held, size, 0.0))
    with_held = np.zeros(len(solid), bool)
    with_held[cell[held[piece]]] = True
    alone = np.bincount(piece, ~with_held[cell]) > 0
    unsupported = ~held & (alone | (size >= grid.fine_cell**grid.dimension))
    rank = np.empty(len(size), np.int64)
    rank[np.lexsort((np.arange(len(size)), -size))] = np.arange(len(size))
    _, rank[unsupported] = np.unique(rank[unsupported], return_inverse=True)
    chosen = np.flatnonzero(unsupported[piece])
    chosen = chosen[np.lexsort((cell[chosen], rank[piece[chosen]]))]
    return Unsupported(
        cell[chosen].astype(np.int32), samples[chosen], np.full(len(chosen), step, np.int32),
        rank[piece[chosen]].astype(np.int32), np.zeros(len(chosen), np.int32),
    )  # fmt: skip


def describe_unsupported(
    grid: MultiLevelGrid,
    distorted: DistortedCells,
    unsupported: Unsupported,
    step: int,
    thickness: float,
    axes: tuple[int, ...],
) -> dict:
    """Facts of the pieces that a step leaves unsupported: how many, volume m3, and where the largest is."""
    now = np.flatnonzero((unsupported.step == step) & (unsupported.fall == 0))
    if not len(now):
        return {"loose_pieces": 0, "loose_volume": 0.0, "loose_where": ""}
    cell, piece = unsupported.cell[now], unsupported.piece[now]
    volume = distorted.part_volumes(cell, unsupported.samples[now]) * grid.cell_size[cell] ** grid.dimension
    size = np.bincount(piece, volume)
    center = np.stack([np.bincount(piece, volume * along) / size for along in grid.centers(cell).T], axis=1)
    names = ", ".join("xyz"[axis] for axis in axes)
    places = [f"({names}) = ({', '.join(f'{value:.1f}' for value in place)}) m" for place in center[:MAX_PIECES_LOGGED]]
    for volume_of, place in zip(size * thickness, places, strict=False):
        logging.info("unsupported: %.3g m3 at %s", volume_of, place)
    where = f"largest {size[0] * thickness:.3g} m3 at {places[0]}"
    logging.warning(
        "unsupported rock or fill: %d pieces, %.3g m3, %s, counted as excavated",
        len(size), size.sum() * thickness, where,
    )  # fmt: skip
    return {
        "loose_pieces": len(size),
        "loose_volume": float(size.sum() * thickness),
        "loose_where": where,
    }
