"""Rock that came loose as it failed: what falls with it, how much that is, and where it fell from."""

import numpy as np
import scipy  # imports its parts as they are used, which small stages would wait for

from mpm_core.grid.adjacency import face_neighbors
from mpm_core.grid.mesh import MultiLevelGrid
from mpm_core.model.model import Model
from mpm_core.model.occupancy import ROCK_OWNER, Changes, Unsupported
from mpm_core.model.unsupported import find_unsupported

SIDES = ("back", "floor", "wall")  # of an opening
VOLUME_ROUND_OFF = 1e-9  # Of a difference of volumes, as a share of what is mined.
MIN_UPRIGHT = 0.5  # Rock is at the back or floor if this share of its distance from the opening is upright.


def coming_loose(
    grid: MultiLevelGrid, changes: Changes, faces: dict[tuple[int, int], list[int]], cells: np.ndarray, step: int
) -> Unsupported:
    """All rock of cells (k,) that comes loose in a step, and the pieces that only it holds, as fall 1: each piece that
    hangs together by faces of cells has a number, the one with most cells first. faces: see find_unsupported."""
    solid, rock = (of(len(grid.cell_level), step) for of in (changes.solid_samples, changes.rock_samples))
    samples = rock[cells]
    solid[cells] &= ~samples
    unheld = find_unsupported(grid, solid, faces, step)
    cell, samples = np.append(cells, unheld.cell), np.append(samples, unheld.samples)
    number = np.full(len(grid.cell_level), -1)
    number[cell] = np.arange(len(cell))
    start, other = face_neighbors(grid, cell)
    own = np.repeat(number, np.diff(start))
    linked = number[other] >= 0
    # parts of one cell hang together, too
    ends = np.append(own[linked], np.arange(len(cell))), np.append(number[other[linked]], number[cell])
    graph = scipy.sparse.coo_array((np.ones(len(ends[0]), np.int8), ends), shape=(len(cell), len(cell)))
    piece = scipy.sparse.csgraph.connected_components(graph, directed=False)[1]
    piece = np.argsort(np.argsort(-np.bincount(piece), kind="stable"))[piece]
    kind = np.int32
    return Unsupported(
        cell.astype(kind), samples, np.full(len(cell), step, kind), piece.astype(kind), np.ones(len(cell), kind)
    )


def part_volumes(model: Model, parts: Unsupported) -> np.ndarray:
    """Volume (part,) m3 (m2 in 2-D) of parts of a model's cells."""
    grid = model.grid
    return (
        model.particles.distorted.part_volumes(parts.cell, parts.samples) * grid.cell_size[parts.cell] ** grid.dimension
    )


def mined_volume(model: Model, step: int) -> float:
    """Volume of rock that a step mines, without what falls, m3 (m2 in 2-D); of one that mines none, of all before."""
    changes, grid = model.changes, model.grid
    of_rock = np.flatnonzero((changes.owner == ROCK_OWNER) & (changes.step <= step))
    cell = changes.cell[of_rock]
    volume = (
        model.particles.distorted.part_volumes(cell, changes.samples[of_rock]) * grid.cell_size[cell] ** grid.dimension
    )
    falls = model.unsupported.of(model.unsupported.fall > 0)
    fallen = part_volumes(model, falls)
    now = float(volume[changes.step[of_rock] == step].sum() - fallen[falls.step == step].sum())
    return now if now > VOLUME_ROUND_OFF * volume.sum() else float(volume.sum() - fallen.sum())


def describe_falls(model: Model, step: int) -> list[dict]:
    """What fell in a step as it failed, a piece each, largest first: its fall, volume m3, place m of its centre in the
    mine's axes, the nearest opening, and at which side of that it was (SIDES)."""
    grid, scene = model.grid, model.scene
    fallen = model.unsupported.of(model.unsupported.falls_in(step))
    volume, center = part_volumes(model, fallen) * scene.thickness, grid.centers(fallen.cell)
    mined = np.array([0 <= excavation.mined <= step for excavation in scene.excavations] or [False])
    open_before = mined[model.pieces.excavation]
    whole = open_before & ~np.isin(model.pieces.cell, fallen.cell)  # a cell that walls cut is not beside itself
    pieces = model.pieces.of(whole if whole.any() else open_before)
    places, found = scipy.spatial.cKDTree(grid.centers(pieces.cell)), []
    for piece in np.unique(fallen.piece):
        own = np.flatnonzero(fallen.piece == piece)
        size, opening, side = volume[own].sum(), "", ""
        place = volume[own] @ center[own] / size if size > 0.0 else center[own].mean(axis=0)
        if places.n:
            nearest = places.query(center[own])[1]
            names, count = np.unique(pieces.excavation[nearest], return_counts=True)
            opening = scene.excavations[names[count.argmax()]].name
            away = center[own] - places.data[nearest]
            up = float(away[:, scene.axes.index(2)].sum() / max(np.sqrt(np.sum(away**2, axis=1)).sum(), 1e-300))
            side = SIDES[0] if up > MIN_UPRIGHT else SIDES[1] if up < -MIN_UPRIGHT else SIDES[2]
        found.append(
            {
                "fall": int(fallen.fall[own[0]]),
                "volume": float(size),
                "place": {"xyz"[axis]: float(along) for axis, along in zip(scene.axes, place, strict=True)},
                "opening": opening,
                "side": side,
            }
        )
    return sorted(found, key=lambda entry: -entry["volume"])
