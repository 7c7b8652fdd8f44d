"""Particles of a multi-level grid: one group of points per cell and material, whose volumes change as rock is mined.

Every cell has one group of rock particles, and one more for each excavation that is filled there. Fill groups come
after all rock groups, in the order of filling, so the particles of one mining step are a prefix of those of the next.
"""

from dataclasses import dataclass

import numpy as np

from mpm_core.grid.mesh import MultiLevelGrid
from mpm_core.scene import Scene

SAMPLES = 64  # inside tests per cell, one bit each: 4 x 4 x 4 in 3-D, 8 x 8 in 2-D (geometry/inside.py)
SLIVER = 2  # samples: a share of fewer than 2 / 64 (the design says 0.02) is dropped
HALF = SAMPLES // 2
FULL = np.uint64(2**64 - 1)


@dataclass(frozen=True)
class Pieces:
    """Parts of cells inside excavations: cell, excavation (piece,) indices, samples (piece,) uint64, one bit each."""

    cell: np.ndarray
    excavation: np.ndarray
    samples: np.ndarray


@dataclass(frozen=True)
class Particles:
    """Where the particles are; their state is model.State.

    cell, excavation (-1 rock), material (particle,); xi (particle, d) place in the cell, -1 to 1; position
    (particle, d), spacing (particle,) m;
    full_volume (particle,) m3 (m2 in 2-D) if the whole place belonged to the particle; sample (particle,) bit of the
    cell's samples that the particle stands for, -1 for a share of all;
    group_start (group + 1,) first particle of each group, group_table (group,) first row of its points in `points`;
    cell_groups_start (cell + 1,), cell_groups: groups of each cell; points (row, d) the point tables.
    """

    cell: np.ndarray
    excavation: np.ndarray
    material: np.ndarray
    xi: np.ndarray
    position: np.ndarray
    spacing: np.ndarray
    full_volume: np.ndarray
    sample: np.ndarray
    group_start: np.ndarray
    group_table: np.ndarray
    cell_groups_start: np.ndarray
    cell_groups: np.ndarray
    points: np.ndarray

    @property
    def count(self) -> int:
        """Number of particles."""
        return len(self.cell)

    @property
    def is_rock(self) -> np.ndarray:
        """(particle,) bool."""
        return self.excavation < 0


def point_table(per_edge: int, dimension: int) -> np.ndarray:
    """Centres of `per_edge`^d equal sub-cells, (point, d) in -1..1, first axis fastest (the samples' bit order)."""
    places = (np.arange(per_edge) + 0.5) / per_edge * 2 - 1
    mesh = np.meshgrid(*[places] * dimension, indexing="ij")
    return np.stack([axis.ravel(order="F") for axis in mesh], axis=1)


def exclusive_pieces(pieces: Pieces, scene: Scene) -> Pieces:
    """Pieces of what is mined in this stage, each sample given to the excavation that mines it first.

    Slivers are dropped; so is a remainder of rock thinner than that: its samples go to the piece that left it. No later
    excavation changes the pieces of those before it.
    """
    rank = np.full(len(scene.excavations), -1)
    order = sorted(
        (index for index, excavation in enumerate(scene.excavations) if excavation.mined >= 0),
        key=lambda index: (scene.excavations[index].mined, index),
    )
    rank[order] = np.arange(len(order))
    mined = rank[pieces.excavation] >= 0
    cell, excavation, samples = pieces.cell[mined], pieces.excavation[mined], pieces.samples[mined].copy()
    sequence = np.lexsort((rank[excavation], cell))
    cell, excavation, samples = cell[sequence], excavation[sequence], samples[sequence]
    first = np.append(True, cell[1:] != cell[:-1])
    position = np.arange(len(cell)) - np.maximum.accumulate(np.where(first, np.arange(len(cell)), 0))
    taken = np.zeros(cell.max() + 1 if len(cell) else 0, np.uint64)
    for turn in range(position.max() + 1 if len(cell) else 0):
        now = np.flatnonzero(position == turn)
        free = samples[now] & ~taken[cell[now]]
        free = np.where(np.bitwise_count(free) >= SLIVER, free, np.uint64(0))
        left = ~(taken[cell[now]] | free)
        samples[now] = np.where((free > 0) & (np.bitwise_count(left) < SLIVER), free | left, free)
        taken[cell[now]] |= samples[now]
    keep = samples > 0
    return Pieces(cell[keep], excavation[keep], samples[keep])


def mined_samples(pieces: Pieces, scene: Scene, cells: int, step: int) -> np.ndarray:
    """Samples of each cell mined up to and including `step`: (cell,) uint64."""
    mined = np.array([excavation.mined for excavation in scene.excavations] or [0])
    now = mined[pieces.excavation] <= step
    result = np.zeros(cells, np.uint64)
    np.bitwise_or.at(result, pieces.cell[now], pieces.samples[now])
    return result


def seed(grid: MultiLevelGrid, body: np.ndarray, pieces: Pieces, scene: Scene, ever: Pieces) -> Particles:
    """Particles of all rock, and of all fill placed up to this stage. `body` (cell,): index of the rock body, -1 host.

    `pieces` are exclusive (see exclusive_pieces). With cut_cells "subdivide" a cut cell has one particle per sample; a
    cell counts as cut if any excavation of the grid cuts it (`ever`), so that no later step changes its particles.
    """
    dimension, cells = grid.dimension, len(grid.cell_level)
    names = list(scene.materials)
    regular = point_table(scene.particles_per_cell, dimension)
    fine = point_table(round(SAMPLES ** (1 / dimension)), dimension)
    points = np.concatenate([regular, fine])

    fills = [
        (excavation.filled, index, names.index(excavation.fill))
        for index, excavation in enumerate(scene.excavations)
        if excavation.fill and 0 <= excavation.filled < len(scene.steps)
    ]
    parts = [pieces.excavation == index for _, index, _ in sorted(fills)]
    group_cell = np.concatenate([np.arange(cells), *(pieces.cell[part] for part in parts)]).astype(np.int32)
    group_excavation = np.concatenate([np.full(cells, -1), *(pieces.excavation[part] for part in parts)]).astype(
        np.int16
    )
    body_material = np.array([names.index(name) for name in (*scene.rock_bodies, "host")])
    fill_material = np.zeros(max(len(scene.excavations), 1), int)
    for _, index, material in fills:
        fill_material[index] = material
    group_material = np.where(group_excavation < 0, body_material[body[group_cell]], fill_material[group_excavation])

    cut = np.zeros(cells, bool)
    if scene.cut_cells == "subdivide":
        cut[ever.cell[ever.samples != FULL]] = True
    group_cut = cut[group_cell]
    size = np.where(group_cut, len(fine), len(regular))
    start = np.append(0, np.cumsum(size)).astype(np.int64)
    table = np.where(group_cut, len(regular), 0).astype(np.int32)

    group = np.repeat(np.arange(len(group_cell)), size)
    place = np.arange(start[-1]) - start[group]
    cell_groups = np.argsort(group_cell, kind="stable").astype(np.int32)
    cell_size = grid.cell_size[group_cell]
    per_edge = np.where(group_cut, round(SAMPLES ** (1 / dimension)), scene.particles_per_cell)
    xi = points[table[group] + place]
    return Particles(
        cell=group_cell[group],
        excavation=group_excavation[group],
        material=group_material[group].astype(np.int16),
        xi=xi,
        position=grid.cell_center[group_cell[group]] + 0.5 * cell_size[group][:, None] * xi,
        spacing=(cell_size / per_edge)[group],
        full_volume=(cell_size**dimension / size)[group],
        sample=np.where(group_cut[group], place, -1).astype(np.int8),
        group_start=start,
        group_table=table,
        cell_groups_start=np.searchsorted(group_cell[cell_groups], np.arange(cells + 1)).astype(np.int64),
        cell_groups=cell_groups,
        points=points,
    )


def volumes(particles: Particles, pieces: Pieces, scene: Scene, cells: int, step: int) -> np.ndarray:
    """Volume of each particle's own material once `step` is mined and filled: (particle,) m3, 0 where there is none."""
    mined = mined_samples(pieces, scene, cells, step)
    owned = ~mined[particles.cell]
    fill = np.flatnonzero(~particles.is_rock)
    bits = np.zeros(cells, np.uint64)
    for index, excavation in enumerate(scene.excavations):
        mine = fill[particles.excavation[fill] == index]
        if len(mine):
            part = pieces.excavation == index
            bits[pieces.cell[part]] = pieces.samples[part]
            placed = 0 <= excavation.filled <= step
            owned[mine] = bits[particles.cell[mine]] if placed else np.uint64(0)
            bits[pieces.cell[part]] = 0
    share = np.bitwise_count(owned) / SAMPLES
    single = particles.sample >= 0
    bit = (owned[single] >> particles.sample[single].astype(np.uint64)) & np.uint64(1)
    share[single] = bit
    return particles.full_volume * share


def rock_share(pieces: Pieces, scene: Scene, cells: int, step: int) -> np.ndarray:
    """Share of each cell that is still rock once `step` is mined, (cell,)."""
    return np.bitwise_count(~mined_samples(pieces, scene, cells, step)) / SAMPLES
