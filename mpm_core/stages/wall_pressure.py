"""Pressure on the walls of excavations, from inside: traction -p n on rock with the outward normal n.

What stands open counts as full of a weightless fluid: its stress is -p I, where that of a void is zero. By the
divergence theorem the integral of B^T (p I) over the open volume is the force of the pressure on the walls; and rock
mined where the virgin stress is -p I moves nothing.

Pressure acts in all that stands open within the excavation's solid, whichever excavation opened it, until the
excavation is filled. Where open solids overlap, the highest pressure acts; it also acts in what went with them without
being part of any solid, remainders of cells and unsupported rock of their cells.
"""

from collections.abc import Iterator

import numpy as np

from mpm_core.model.model import Model


def wall_pressure(model: Model, step: int, chosen: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Pressure once `step` is mined and filled, Pa: mean over the missing rock of chosen particles (k,), and over each
    whole cell, (cell,); both (0,) where there is none."""
    inside = np.array([excavation.pressure_at(step) for excavation in model.scene.excavations])
    if not inside.any():
        return np.zeros(0), np.zeros(0)
    cells = len(model.cell_nodes)
    cell, sample = model.particles.cell[chosen], model.particles.sample[chosen]
    single = np.flatnonzero(sample >= 0)
    bit = np.uint64(1) << sample[single].astype(np.uint64)
    gone = np.bitwise_count(~model.changes.rock_samples(cells, step))
    mean, of_samples = np.zeros(cells), np.zeros(len(single))
    for where, samples, pressure in _open_parts(model, step, inside):
        mean[where] += pressure * (np.bitwise_count(samples) / gone[where])  # exactly the pressure where all is open
        if len(single):
            of_cell = np.zeros(cells, np.uint64)
            of_cell[where] = samples
            of_samples[(of_cell[cell[single]] & bit) != 0] = pressure
    of_particles = mean[cell]
    of_particles[single] = of_samples
    return of_particles, mean * (1.0 - model.rock_share(step))


def _open_parts(model: Model, step: int, inside: np.ndarray) -> Iterator[tuple[np.ndarray, np.ndarray, float]]:
    """Disjoint parts of cells under each pressure: cells (part,), their samples (part,) uint64, the pressure Pa.

    inside (excavation,) Pa: pressure in each excavation.
    """
    pieces, cells = model.pieces, len(model.cell_nodes)
    mined = np.array([0 <= excavation.mined <= step for excavation in model.scene.excavations])
    pieces = pieces.of(mined[pieces.excavation])
    open_now = ~model.changes.solid_samples(cells, step)
    of_solids = np.zeros(cells, np.uint64)
    np.bitwise_or.at(of_solids, pieces.cell, pieces.samples)
    rest = open_now & ~of_solids
    of_piece = inside[pieces.excavation]
    for pressure in np.unique(of_piece[of_piece > 0.0])[::-1]:
        own = pieces.of(of_piece == pressure)
        samples = np.zeros(cells, np.uint64)
        np.bitwise_or.at(samples, own.cell, own.samples)
        where = np.unique(own.cell)
        of_cells = samples[where] & open_now[where] | rest[where]
        open_now[where] &= ~of_cells
        rest[where] = 0
        yield where, of_cells, float(pressure)
