"""Particles of a multi-level grid: one group of points per cell and material, whose volumes change as rock is mined.

Every cell has one group of rock particles, and one more for each excavation that is filled there. Fill groups come
after all rock groups, in the order of filling, so the particles of one mining step are a prefix of those of the next.

With `cut_cells: mean` each material of a cut cell has one particle, which stands for the samples that it holds. Shape
functions and their gradients are means over these samples, and its place is their centroid: at the cell's centre it
would act up to half a cell too far into the opening, and rock would carry too little. So has each material of a
distorted cell (grid/distorted_cells.py), cut or not.

The stiffness of a particle bounds the time step of the explicit scheme (equilibrium/body.py) and scales the hourglass
stiffness of its cell.
"""

from dataclasses import dataclass, replace

import numpy as np
from numba import njit, prange

from mpm_core.geometry.inside import SAMPLES_PER_CELL
from mpm_core.grid.distorted_cells import DistortedCells, part_integrals
from mpm_core.grid.mesh import MultiLevelGrid
from mpm_core.model.occupancy import ALL_SAMPLES, NO_SAMPLES, ROCK_OWNER, Changes, Pieces
from mpm_core.scene.scene import Scene

# Share of the hourglass stiffness at which a cell bends as a plate does. Strain varies in a cell of massive rock along
# all axes. Corners show only a part of that, which cells would hold as stiffly as a plate in addition to what smoother
# strain leaves out: the rock would be too stiff. In a skin between two voids bending is all there is (skins.py). With
# less than this share, thin parts of cells come loose from the rock that they are part of when it fails.
MASSIVE_BENDING_SHARE = 1.0 / 6.0


@dataclass(frozen=True)
class Particles:
    """The places of the particles; their state is model.State.

    cell, excavation (-1 rock), material (particle,); position (particle, d), spacing (particle,) m;
    full_volume (particle,) m3 (m2 in 2-D) if the whole place belonged to the particle; sample (particle,) bit of the
    cell's samples that the particle stands for, -1 for a share of all;
    group_start (group + 1,) first particle of each group, group_table (group,) first row of its points in `modes`;
    cell_groups_start (cell + 1,), cell_groups: groups of each cell; modes (row, 2^d): value of each mode
    (kernels/modes.py) at a point, or its mean over samples; slopes (row, 2^d, d): what a field's modal sums are
    multiplied by to give its derivative along each axis (`slopes_of`); the first shared_rows of both are points of many
    groups, each of the others is one group's own. spreads (row,): see `least_spreads`, 1 in the shared rows. distorted:
    cells that are no cubes.
    """

    cell: np.ndarray
    excavation: np.ndarray
    material: np.ndarray
    position: np.ndarray
    spacing: np.ndarray
    full_volume: np.ndarray
    sample: np.ndarray
    group_start: np.ndarray
    group_table: np.ndarray
    cell_groups_start: np.ndarray
    cell_groups: np.ndarray
    modes: np.ndarray
    slopes: np.ndarray
    spreads: np.ndarray
    shared_rows: int
    distorted: DistortedCells

    @property
    def count(self) -> int:
        """Number of particles."""
        return len(self.cell)

    @property
    def is_rock(self) -> np.ndarray:
        """(particle,) bool."""
        return self.excavation < 0

    @property
    def row(self) -> np.ndarray:
        """Row of `modes` that each particle has, (particle,) int64."""
        first = np.repeat(self.group_table - self.group_start[:-1], np.diff(self.group_start))
        return first + np.arange(self.count)

    @property
    def spread(self) -> np.ndarray:
        """Spread of what each particle stands for, (particle,): see `least_spreads`."""
        spread = np.ones(self.count)
        own = np.flatnonzero(self.group_table >= self.shared_rows)
        spread[self.group_start[own]] = self.spreads[self.group_table[own]]
        return spread


def point_table(per_edge: int, dimension: int) -> np.ndarray:
    """Centres of `per_edge`^d equal sub-cells, (point, d) in -1..1, first axis fastest (the samples' bit order)."""
    places = (np.arange(per_edge) + 0.5) / per_edge * 2 - 1
    mesh = np.meshgrid(*[places] * dimension, indexing="ij")
    return np.stack([axis.ravel(order="F") for axis in mesh], axis=1)


def mode_table(points: np.ndarray) -> np.ndarray:
    """Value (point, 2^d) of each mode at points (point, d) in -1..1: product of the coordinates whose bit is set."""
    dimension = points.shape[1]
    modes = [np.prod(points[:, [k for k in range(dimension) if m >> k & 1]], axis=1) for m in range(1 << dimension)]
    return np.stack(modes, axis=1)


def mean_modes(samples: np.ndarray, dimension: int) -> np.ndarray:
    """Mean (k, 2^d) of each mode over sets of samples (k,) uint64, none of them empty."""
    table = mode_table(point_table(round(SAMPLES_PER_CELL ** (1 / dimension)), dimension))
    held = (samples[:, None] >> np.arange(SAMPLES_PER_CELL, dtype=np.uint64)) & np.uint64(1)
    return held.astype(float) @ table / np.bitwise_count(samples)[:, None]


def least_spreads(samples: np.ndarray, dimension: int) -> np.ndarray:
    """Variance of place along the axis on which sets of samples (k,) uint64, none empty, are thinnest: (k,), 1 for the
    whole cell, f^2 for a layer of the thickness f h, which bends by it with the cube of its thickness. Not above 1 nor
    below MASSIVE_BENDING_SHARE."""
    per_edge = round(SAMPLES_PER_CELL ** (1 / dimension))
    table = point_table(per_edge, dimension)
    held = ((samples[:, None] >> np.arange(SAMPLES_PER_CELL, dtype=np.uint64)) & np.uint64(1)).astype(float)
    count = np.bitwise_count(samples)[:, None]
    variance = held @ table**2 / count - (held @ table / count) ** 2
    return np.clip(3.0 * variance.min(axis=1, initial=1.0) + 1.0 / per_edge**2, MASSIVE_BENDING_SHARE, 1.0)


def centroids(modes: np.ndarray) -> np.ndarray:
    """Place (k, d) in the cell, -1 to 1, of points or means with these modes (k, 2^d)."""
    return modes[:, [1 << k for k in range(modes.shape[1].bit_length() - 1)]]


def slopes_of(modes: np.ndarray) -> np.ndarray:
    """Derivatives (k, 2^d, d) of each mode along the axes of a cubic cell, of values or means (k, 2^d) of the modes.

    The derivative of mode m along axis k is the mode without k. In units of 2 over the cell's edge.
    """
    bits = np.arange(modes.shape[1])
    axes = range(modes.shape[1].bit_length() - 1)
    slopes = np.stack([np.where(bits >> k & 1, modes[:, bits ^ 1 << k], 0.0) for k in axes], axis=2)
    return np.ascontiguousarray(slopes)  # kernels are compiled for each layout


def _signs(corners: int) -> np.ndarray:
    """(corner, mode): sign of each mode at each corner."""
    bits = np.arange(corners)
    return (-1.0) ** np.bitwise_count(bits & ~bits[:, None])


def shapes_of(modes: np.ndarray, slopes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Shape functions (k, 2^d) and their derivatives (k, 2^d, d), of modes (k, 2^d) and their slopes (k, 2^d, d)."""
    sign = _signs(modes.shape[1])
    return modes @ sign.T / len(sign), np.einsum("cm,kmj->kcj", sign, slopes) / len(sign)


def part_means(
    samples: np.ndarray, cells: np.ndarray, distorted: DistortedCells, dimension: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Means over parts of cells (k,), samples (k,) uint64, none empty: of the modes (k, 2^d), their slopes (k, 2^d, d),
    and the centroid's place (k, d) across the cell, -1 to 1."""
    row, corners = distorted.rows(cells), 1 << dimension
    cubic, bent = np.flatnonzero(row < 0), np.flatnonzero(row >= 0)
    modes, place = np.empty((len(cells), corners)), np.empty((len(cells), dimension))
    slopes = np.empty((len(cells), corners, dimension))
    modes[cubic] = mean_modes(samples[cubic], dimension)
    slopes[cubic], place[cubic] = slopes_of(modes[cubic]), centroids(modes[cubic])
    found = part_integrals(distorted.corners[row[bent]], samples[bent])
    modes[bent], place[bent] = found.modes, found.place
    slopes[bent] = np.einsum("cm,kcj->kmj", _signs(corners), found.gradients)
    return modes, slopes, place


def seed(
    grid: MultiLevelGrid, body: np.ndarray, changes: Changes, scene: Scene, ever: Pieces, distorted: DistortedCells
) -> Particles:
    """Particles of all rock, and of all fill placed up to this stage; before any of it is mined, see `at_step`.

    body (cell,): index of the rock body, -1 host.

    With cut_cells "mean" each group of a cut cell has one particle, at the cell's centre, and with "subdivide" one per
    sample. A cell counts as cut if any excavation of the grid cuts it (`ever`), so that no later step changes how many.
    """
    dimension, cells = grid.dimension, len(grid.cell_level)
    names = list(scene.materials)
    whole = scene.particles_per_cell
    of_cut = {"mean": 1, "subdivide": round(SAMPLES_PER_CELL ** (1 / dimension))}.get(scene.cut_cells, whole)
    edges = np.unique([1, whole, of_cut])
    points = np.concatenate([point_table(edge, dimension) for edge in edges])  # the centre first

    fills = np.flatnonzero(changes.owner != ROCK_OWNER)
    _, first = np.unique(changes.owner[fills].astype(np.int64) * cells + changes.cell[fills], return_index=True)
    fills = fills[first]  # where it is placed, not mined again
    fills = fills[np.lexsort((changes.cell[fills], changes.owner[fills], changes.step[fills]))]
    group_cell = np.concatenate([np.arange(cells), changes.cell[fills]]).astype(np.int32)
    group_excavation = np.concatenate([np.full(cells, ROCK_OWNER), changes.owner[fills]]).astype(np.int16)
    body_material = np.array([names.index(name) for name in (*scene.rock_bodies, "host")])
    fill_material = np.array(
        [names.index(excavation.fill) if excavation.fill else 0 for excavation in scene.excavations] or [0]
    )
    group_material = np.where(group_excavation < 0, body_material[body[group_cell]], fill_material[group_excavation])

    cut = np.zeros(cells, bool)
    cut[ever.cell[ever.samples != ALL_SAMPLES]] = True
    cut[distorted.cell] = True
    per_edge = np.where(cut, of_cut, whole)[group_cell]
    size = per_edge**dimension
    start = np.append(0, np.cumsum(size)).astype(np.int64)
    table = np.cumsum([0, *edges**dimension])[np.searchsorted(edges, per_edge)].astype(np.int32)
    is_sample = cut[group_cell] & (scene.cut_cells == "subdivide")

    group = np.repeat(np.arange(len(group_cell)), size)
    place = np.arange(start[-1]) - start[group]
    cell_groups = np.argsort(group_cell, kind="stable").astype(np.int32)
    cell_size = grid.cell_size[group_cell]
    sample = np.full(len(group), -1, np.int8)
    of_samples = np.flatnonzero(is_sample[group])
    sample[of_samples] = place[of_samples]
    modes, full_volume = mode_table(points), cell_size**dimension / size
    full_volume *= distorted.volumes(group_cell)
    return Particles(
        cell=group_cell[group],
        excavation=group_excavation[group],
        material=group_material[group].astype(np.int16),
        position=grid.centers(group_cell[group]) + 0.5 * cell_size[group][:, None] * points[table[group] + place],
        spacing=(cell_size / per_edge)[group],
        full_volume=full_volume[group],
        sample=sample,
        group_start=start,
        group_table=table,
        cell_groups_start=np.searchsorted(group_cell[cell_groups], np.arange(cells + 1)).astype(np.int64),
        cell_groups=cell_groups,
        modes=modes,
        slopes=slopes_of(modes),
        spreads=np.ones(len(points)),
        shared_rows=len(points),
        distorted=distorted,
    )


def owned_samples(particles: Particles, changes: Changes, step: int) -> np.ndarray:
    """Samples that each group's own material holds once `step` is mined and filled: (group,) uint64."""
    cells = len(particles.cell_groups_start) - 1
    owned = np.zeros(len(particles.group_start) - 1, np.uint64)
    owned[:cells] = changes.rock_samples(cells, step)
    first = particles.group_start[cells:-1]  # of the groups of fill
    key = particles.excavation[first].astype(np.int64) * cells + particles.cell[first]
    order = np.argsort(key)
    now = changes.until(step, owned_by_rock=False)
    place = np.searchsorted(key[order], changes.owner[now].astype(np.int64) * cells + changes.cell[now])
    np.bitwise_xor.at(owned, cells + order[place], changes.samples[now])
    return owned


def at_step(particles: Particles, changes: Changes, step: int, grid: MultiLevelGrid) -> Particles:
    """These particles with those that are alone in their group at what their material holds once `step` is mined."""
    owned = owned_samples(particles, changes, step)
    group_cell = particles.cell[particles.group_start[:-1]]
    row = particles.distorted.rows(group_cell)
    alone = np.diff(particles.group_start) == 1
    own = np.flatnonzero(alone & ((row >= 0) | (owned != NO_SAMPLES) & (owned != ALL_SAMPLES)))
    table, first = particles.group_table.copy(), particles.shared_rows
    moved = np.union1d(np.flatnonzero(table >= first), own)
    table[moved] = 0
    table[own] = first + np.arange(len(own), dtype=np.int32)
    held = np.where(owned[own] == NO_SAMPLES, ALL_SAMPLES, owned[own])  # where nothing is left: as before it was mined
    modes, slopes, place = part_means(held, group_cell[own], particles.distorted, grid.dimension)
    particle, cell = particles.group_start[moved], group_cell[moved]
    xi = np.zeros((len(moved), grid.dimension))
    xi[np.searchsorted(moved, own)] = place
    position = particles.position.copy()
    position[particle] = grid.centers(cell) + 0.5 * grid.cell_size[cell][:, None] * xi
    return replace(
        particles,
        position=position,
        group_table=table,
        modes=np.concatenate([particles.modes[:first], modes]),
        slopes=np.concatenate([particles.slopes[:first], slopes]),
        spreads=np.concatenate([particles.spreads[:first], least_spreads(held, grid.dimension)]),
    )


def volumes(particles: Particles, changes: Changes, step: int) -> np.ndarray:
    """Volume of each particle's own material once `step` is mined and filled: (particle,) m3, 0 where there is none."""
    owned = owned_samples(particles, changes, step)
    group = np.repeat(np.arange(len(owned)), np.diff(particles.group_start))
    shares = np.bitwise_count(owned) / SAMPLES_PER_CELL
    row = particles.distorted.rows(particles.cell[particles.group_start[:-1]])
    bent = np.flatnonzero(row >= 0)
    shares[bent] = shares_of_volume(particles.distorted, row[bent], owned[bent])
    owned, share = owned[group], shares[group]
    single = particles.sample >= 0
    share[single] = (owned[single] >> particles.sample[single].astype(np.uint64)) & np.uint64(1)
    return particles.full_volume * share


def shares_of_volume(distorted: DistortedCells, row: np.ndarray, samples: np.ndarray) -> np.ndarray:
    """Share (k,) of the volume of distorted cells, rows (k,) of them, that samples (k,) uint64 have; 1 of all."""
    share = np.where(samples == ALL_SAMPLES, 1.0, 0.0)
    some = np.flatnonzero((samples != ALL_SAMPLES) & (samples != NO_SAMPLES))
    share[some] = _held_shares(distorted.sample_volumes, row[some], samples[some])
    return share


@njit(parallel=True, error_model="numpy", cache=True)
def _held_shares(volumes, row, samples):
    """Share (k,) of the sample volumes (cell, 64) of rows (k,) that samples (k,) uint64 have."""
    share = np.empty(len(row))
    for i in prange(len(row)):
        held, whole = np.zeros(8), np.zeros(8)  # sums side by side, as numpy adds
        for sample in range(volumes.shape[1]):
            volume = volumes[row[i], sample]
            whole[sample % 8] += volume
            if (samples[i] >> np.uint64(sample)) & np.uint64(1):
                held[sample % 8] += volume
        share[i] = _added(held) / _added(whole)
    return share


@njit(inline="always", error_model="numpy")
def _added(sums):
    """The total of eight sums."""
    return ((sums[0] + sums[1]) + (sums[2] + sums[3])) + ((sums[4] + sums[5]) + (sums[6] + sums[7]))


def bending_stiffness(lame: np.ndarray, shear: np.ndarray) -> np.ndarray:
    """Stiffness (k,) Pa against an hourglass mode, times h^2 / V: that with which a cell bends as a plate does.

    The mode with amplitude a at the corners has the strain e_x = 4 a y / h^2, and e_y follows freely. A plate's modulus
    is E' = E / (1 - nu^2) = 4 mu (lambda + mu) / (lambda + 2 mu), and its energy E' e_x^2 / 2 is on average
    2 E' a^2 / (3 h^2), or 1/2 (4 E' / 3) (a / h)^2. No shear takes part, as it would in a cell with more points. E'
    stays finite where volume is constant. (Belytschko and Bindeman 1993: assumed strain with physical stabilisation.)
    """
    return 16.0 / 3.0 * shear * (lame + shear) / (lame + 2.0 * shear)


def step_stiffness(particles: Particles, elastic_constants: np.ndarray, bending_share: np.ndarray) -> np.ndarray:
    """Stiffness (particle,) Pa that bounds the time step: that of dilation, more for particles off their cells'
    centres. elastic_constants (row, 2): lambda, mu, Pa; bending_share (particle,): see Model.
    """
    lame, shear = elastic_constants[particles.material].T
    stiffness = particles.position.shape[1] * lame + 2.0 * shear
    lone = np.flatnonzero(particles.sample >= 0)
    place = centroids(particles.modes[particles.row[lone]])
    stiffness[lone] /= 1.0 - np.abs(place).max(axis=1, initial=0.0) ** 2
    own = np.flatnonzero(particles.group_table >= particles.shared_rows)
    first = particles.group_start[own]
    rows = particles.group_table[own]
    share = 0.25 * bending_share[first] * bending_stiffness(lame[first], shear[first]) / stiffness[first]
    stiffness[first] *= own_stiffening(particles.modes[rows], particles.slopes[rows], share)
    return stiffness


def own_stiffening(modes: np.ndarray, slopes: np.ndarray, hourglass: np.ndarray) -> np.ndarray:
    """Ratio of the square of a lone particle's largest frequency to that of one at its cell's centre, at most, (k,).

    The particle's shape functions N and gradients g are means over samples, of modes (k, 2^d) and slopes (k, 2^d, d).
    Its strain adds at most the largest eigenvalue of sum g g^T / N over the corners, which is 4 / h^2 at the centre.
    Its hourglass stiffness acts on all corners alike, and adds the share `hourglass` (k,) of that times the largest
    eigenvalue of sum s s^T / N, with the signs s of the hourglass modes, over its value at the centre: off the centre
    the patterns of both overlap.
    """
    shape, slope = shapes_of(modes, slopes)
    bits = np.arange(modes.shape[1])
    signs = (-1.0) ** np.bitwise_count(~bits[:, None] & bits[np.bitwise_count(bits) > 1])  # (corner, mode)
    strain = np.einsum("kci,kcj,kc->kij", slope, slope, 1.0 / shape)
    patterns = np.einsum("ci,cj,kc->kij", signs, signs, 1.0 / shape) / len(bits) ** 2
    if not len(modes):
        return np.empty(0)
    return np.linalg.eigvalsh(strain)[:, -1] + hourglass * np.linalg.eigvalsh(patterns)[:, -1]
