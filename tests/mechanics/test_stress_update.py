"""The stress update of resting particles against a slow twin built from shape function gradients at every corner."""

import numpy as np
import pytest

from mechanics.scenes import (
    FILL,
    HOST,
    ball,
    constrain,
    excavation,
    grid_around,
    make_model,
    make_scene,
    random_grid,
)
from mpm_core.equilibrium.body import Body
from mpm_core.geometry.inside import SAMPLES_PER_CELL
from mpm_core.model.particles import centroids, owned_samples, point_table

PLANES = {2: "xz", 3: None}
CASES = [(2, 1, "mean"), (2, 3, "mean"), (3, 1, "mean"), (3, 2, "mean"), (2, 1, "subdivide")]


def shape_gradients(corners, place, size):
    """N (corner,) and grad N (corner, d) at xi = place, for corner sides -1 or 1; bilinear, trilinear."""
    factors = 0.5 * (1 + corners * place)
    gradient = np.empty(corners.shape)
    for k in range(corners.shape[1]):
        others = np.delete(factors, k, axis=1).prod(axis=1)
        gradient[:, k] = corners[:, k] / size * others
    return factors.prod(axis=1), gradient


def sample_places(model, particle):
    """Places (k, d) of the middles of the parts of a cell that a lone particle's material holds."""
    group = np.searchsorted(model.particles.group_start, particle)
    samples = owned_samples(model.particles, model.changes, 0)[group]
    points = point_table(round(SAMPLES_PER_CELL ** (1 / model.dimension)), model.dimension)
    return points[[bit for bit in range(SAMPLES_PER_CELL) if int(samples) >> bit & 1]]


def cut_model(dimension, per_edge, cut_cells):
    """A void and a fill that share cut cells, two levels."""
    shapes = [ball([12.0] * dimension, 7.2), ball([17.0] * dimension, 3.0)]
    scene = make_scene(
        PLANES[dimension],
        excavations=[excavation(), excavation(fill="fill", name="filled")],
        particles_per_cell=per_edge,
        cut_cells=cut_cells,
    )
    grid = grid_around(shapes, [3] * dimension, 2, 8.0)
    return make_model(scene, grid, shapes)


@pytest.mark.parametrize(("dimension", "per_edge", "cut_cells"), CASES)
def test_stress_and_forces_are_those_of_the_shape_function_gradients(dimension, per_edge, cut_cells):
    """Random velocity, one step: d sigma = lambda tr(e) I + 2 mu e, f = -sum B^T sigma V - hourglass, cell by cell.

    Equal to a few round-offs: the modes of the kernel are the same polynomials written another way.
    """
    model = cut_model(dimension, per_edge, cut_cells)
    grid, particles = model.grid, model.particles
    vars(model)["bending_share"] = particles.spread  # of a skin
    random = np.random.default_rng(5)
    volume = model.volumes(0)
    assert (volume == 0.0).any()
    assert ((volume > 0.0) & (volume < particles.full_volume)).any() or cut_cells == "subdivide"
    assert (volume[~particles.is_rock] > 0.0).any()
    state = model.virgin_state()
    state.stress[:] = random.normal(size=state.stress.shape)
    before = state.stress.copy()
    body = Body(model, state, volume)
    state.velocity[:] = constrain(grid, random.normal(size=state.velocity.shape)) * 1e-10
    step = body.time_step
    body.update(step)

    corners = np.array([[1 if (c >> k) & 1 else -1 for k in range(dimension)] for c in range(1 << dimension)])
    internal = np.zeros_like(state.velocity)
    expected = before.copy()
    for p in np.flatnonzero(volume > 0.0):
        nodes, size = model.cell_nodes[particles.cell[p]], grid.cell_size[particles.cell[p]]
        is_mean = particles.row[p] >= particles.shared_rows
        places = sample_places(model, p) if is_mean else centroids(particles.modes[particles.row[[p]]])
        gradient = np.mean([shape_gradients(corners, place, size)[1] for place in places], axis=0)
        velocity_gradient = np.zeros((3, 3))
        velocity_gradient[:dimension, :dimension] = state.velocity[nodes].T @ gradient
        strain = 0.5 * (velocity_gradient + velocity_gradient.T) * step
        material = [HOST, FILL][particles.material[p]]
        young, nu = material["youngs_modulus"], material["poisson_ratio"]
        tensor = young / (1 + nu) * (strain + nu / (1 - 2 * nu) * np.trace(strain) * np.eye(3))
        expected[p] += tensor[[0, 1, 2, 1, 0, 0], [0, 1, 2, 2, 2, 1]]
        s = expected[p]
        full = np.array([[s[0], s[5], s[4]], [s[5], s[1], s[3]], [s[4], s[3], s[2]]])
        internal[nodes] -= volume[p] * gradient @ full[:dimension, :dimension]
    np.testing.assert_allclose(state.stress, expected, rtol=0, atol=1e-12 * np.abs(expected).max())

    # 4/3 E / (1 - nu^2) V / h^2 on each modal amplitude, cells with a lone point per group, less for thin parts; 2/3 of
    # it against twist
    group_size = np.diff(particles.group_start)
    for cell in range(len(grid.cell_size)):
        stiffness = 0.0
        for group in np.flatnonzero((particles.cell[particles.group_start[:-1]] == cell) & (group_size == 1)):
            p = particles.group_start[group]
            material = [HOST, FILL][particles.material[p]]
            young, nu = material["youngs_modulus"], material["poisson_ratio"]
            spread = 1.0
            if particles.row[p] >= particles.shared_rows:
                edge = 2 / SAMPLES_PER_CELL ** (1 / dimension)
                spread = np.clip(3 * (sample_places(model, p).var(axis=0).min() + edge**2 / 12), 1 / 6, 1)
            stiffness += 4 / 3 * young / (1 - nu**2) * spread * volume[p] / grid.cell_size[cell] ** 2
        nodes = model.cell_nodes[cell]
        for mode in range(1 << dimension):
            if bin(mode).count("1") < 2:
                continue
            sign = np.prod([corners[:, k] for k in range(dimension) if (mode >> k) & 1], axis=0)
            amplitude = sign @ state.velocity[nodes] / len(corners)
            share = [1 if (mode >> j) & 1 else 2 / 3 for j in range(dimension)]
            internal[nodes] -= np.outer(sign, stiffness * step * amplitude * share) / len(corners)

    free = model.scatter.free_nodes
    assembled = internal[free].copy()
    index = np.full(len(internal), -1)
    index[free] = np.arange(len(free))
    for node in model.hanging:
        parents = grid.node_parents[node]
        parents = parents[parents >= 0]
        for parent in parents:
            assembled[index[parent]] += internal[node] / len(parents)
    assembled[model.held[free]] = 0.0
    assembled[body.mass[free] == 0.0] = 0.0
    measured = body.internal_force()[free]
    np.testing.assert_allclose(measured, assembled, rtol=0, atol=1e-12 * np.abs(assembled).max())


@pytest.mark.parametrize("dimension", [2, 3])
def test_linear_motion_wakes_no_hourglass_force(dimension):
    """A linear velocity field has no hourglass part: forces stay at the round-off of the modal sums."""
    random = np.random.default_rng(2)
    model = make_model(make_scene(PLANES[dimension]), random_grid(random, dimension))
    state = model.virgin_state()
    body = Body(model, state, model.volumes(0))
    state.velocity[:] = model.grid.node_position @ random.normal(size=(dimension, dimension)) + random.normal()
    body.update(body.time_step)
    linear = np.abs(state.stress).max() * model.grid.cell_size.max() ** (dimension - 1)
    assert np.abs(state.hourglass_force).max() < 1e-13 * linear * 2**dimension
