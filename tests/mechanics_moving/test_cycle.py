"""The cycle of moving particles: kernels against slow twins, totals, travel through many cells, threads."""

import numba
import numpy as np
import pytest

from common.errors import InputError
from mpm_core.equilibrium.moving_scheme import MovingBody
from mpm_core.grid.adjacency import leaf_lookup
from mpm_core.kernels.material_point_cycle import relocate, sort_by_cell
from tests.mechanics.scenes import COULOMB, ball, grid_around, make_model, make_scene, random_grid, uniform
from tests.mechanics_moving.cycle_twins import SlowParticles, cell_of, slow_step

PLANES = {2: "xz", 3: None}


def make_body(grid, *, volume=None, **scene) -> MovingBody:
    """A body over all cells of a grid, four or eight particles each, nothing mined."""
    model = make_model(make_scene(PLANES[grid.dimension], particles_per_cell=2, **scene), grid)
    volume = model.particles.full_volume if volume is None else volume(model)
    return MovingBody(model, model.virgin_state(), volume)


def stir(body: MovingBody, random: np.random.Generator, reach: float) -> None:
    """Particles at random places of their cells, with random velocities of up to `reach` finest cells per step."""
    speed = reach * body.model.grid.fine_cell / body.time_step
    body.xi[:] = random.uniform(-0.95, 0.95, body.xi.shape)
    body.velocity[:] = speed * random.uniform(-1.0, 1.0, body.velocity.shape)
    body.update(0.0)


@pytest.mark.parametrize("dimension", [2, 3])
def test_cycle_is_that_of_the_paper(dimension):
    """Three steps with hanging nodes, held faces, external forces, void, flowing rock and many changes of cell.

    Bound: round-off of sums of some hundred terms.
    """
    random = np.random.default_rng(dimension)
    grid = random_grid(random, dimension)
    body = make_body(
        grid,
        host=COULOMB,
        stress=uniform(-10e6, -42e6, -12e6),
        volume=lambda model: model.particles.full_volume * random.choice([0.0, 0.5, 1.0], model.particles.count),
    )
    model, state = body.model, body.state
    state.failed[random.random(model.particles.count) < 0.3] = 0
    body.set_failed()
    state.stress[:] = 1e6 * random.standard_normal(state.stress.shape)
    if dimension == 2:
        state.stress[:, 3:5] = 0.0
    stir(body, random, reach=1.0)
    external = 1e6 * random.standard_normal(state.displacement.shape)
    external[grid.is_hanging] = 0.0
    first_stress = state.stress.copy()

    present = body.volume > 0.0
    slow = SlowParticles(
        position=body._position()[present],
        velocity=body.velocity[present].copy(),
        stress=state.stress[present].copy(),
        insitu=model.insitu[present],
        plastic=np.zeros((present.sum(), 6)),
        mass=body.particle_mass[present],
        volume=body.volume[present],
        failed=body.failed[present],
    )
    lame, shear = model.elastic_constants[0]
    row = model.residual_rows[0]
    damping = model.scene.solver.damping
    for _ in range(3):
        mass, _ = slow_step(grid, slow, external, model.held, damping, body.time_step, lame, shear, row)
        body.advance(external, body.time_step)
        np.testing.assert_allclose(body.mass, mass, rtol=1e-12, atol=1e-12 * mass.max())
        body.update(body.time_step)
    assert state.cell_changes > 0.02 * present.sum()
    assert (slow.plastic[:, 0] != 0.0).sum() > 0.1 * present.sum()
    for fast, expected in (
        (body._position()[present], slow.position),
        (body.velocity[present], slow.velocity),
        (state.stress[present], slow.stress),
        (state.later_strain[present], slow.plastic),
    ):
        np.testing.assert_allclose(fast, expected, rtol=0.0, atol=1e-10 * np.abs(expected).max())
    np.testing.assert_array_equal(state.stress[~present], first_stress[~present])  # what is mined rests


@pytest.mark.parametrize("dimension", [2, 3])
def test_nodes_hold_the_mass_and_momentum_of_the_particles(dimension):
    """Totals over nodes without parents: mass and momentum are those of the particles, internal forces cancel."""
    random = np.random.default_rng(10 + dimension)
    body = make_body(random_grid(random, dimension), boundary="free")
    body.state.stress[:] = 1e6 * random.standard_normal(body.state.stress.shape)
    stir(body, random, reach=0.1)
    body.advance(np.zeros_like(body.unbalanced), 0.0)
    free = ~body.model.grid.is_hanging
    momentum = body.mass[free, None] * body.state.velocity[free]
    carried = body.particle_mass[:, None] * body.velocity
    assert body.mass[free].sum() == pytest.approx(body.particle_mass.sum(), rel=1e-12)
    np.testing.assert_allclose(momentum.sum(axis=0), carried.sum(axis=0), atol=1e-12 * np.abs(carried).sum())
    force = body.unbalanced[free]
    np.testing.assert_allclose(force.sum(axis=0), 0.0, atol=1e-12 * np.abs(force).sum())


def translate(body: MovingBody, way: np.ndarray, steps: int) -> np.ndarray:
    """Move all particles by `way` (d,) m in so many steps without any force; returns the velocity given, m/s."""
    speed = np.asarray(way, float) / (steps * body.time_step)
    body.velocity[:] = speed
    body.update(0.0)
    for _ in range(steps):
        body.advance(np.zeros_like(body.unbalanced), body.time_step)
        body.update(body.time_step)
    return speed


def test_changes_of_cell_counted_by_hand():
    """One cell of 2 x 2 particles travels 2.5 cells along x: those at 1/4 cross two sides, those at 3/4 three: 10."""
    grid = grid_around([], (6, 3), 1, 10.0)
    body = make_body(
        grid,
        boundary="free",
        volume=lambda model: np.where(
            grid.cell_index[model.particles.cell].tolist() == np.array([1, 1]), 25.0, 0.0
        ).min(1),
    )
    assert (body.volume > 0.0).sum() == 4
    translate(body, (25.0, 0.0), 60)
    assert body.state.cell_changes == 10


@pytest.mark.parametrize("dimension", [2, 3])
def test_rigid_travel_through_all_levels_strains_nothing(dimension):
    """A block travels through finer and coarser cells: velocity stays, stress stays zero, cells are counted.

    Every particle crosses as many cells as its straight way overlaps, less one. Bounds: round-off of the steps.
    """
    way = np.array([41.3, 7.7, 5.1])[:dimension]
    grid = grid_around([ball([40.0] * dimension, 2.0)], (10,) + (6,) * (dimension - 1), 3, 10.0, rings=0)
    middle = np.array([15.0, 25.0, 25.0])[:dimension]

    def block(model):
        inside = (np.abs(model.particles.position - middle) < 10.0).all(axis=1)
        return model.particles.full_volume * inside

    body = make_body(grid, boundary="free", volume=block)
    present = body.volume > 0.0
    start = body._position()
    speed = translate(body, way, 150)
    np.testing.assert_allclose(body.velocity[present], speed + 0.0 * start[present], rtol=1e-11)
    np.testing.assert_allclose(body._position()[present], start[present] + way, rtol=1e-11)
    modulus = 57e9
    assert np.abs(body.state.stress).max() < 1e-11 * modulus

    lower, upper = grid.cell_origin, grid.cell_origin + grid.cell_size[:, None]
    expected, levels = 0, set()
    for position in start[present]:
        enters = ((lower - position) / way).max(axis=1)
        leaves = ((upper - position) / way).min(axis=1)
        crossed = (enters < 1.0) & (leaves > 0.0) & (enters < leaves)
        expected += crossed.sum() - 1
        levels |= set(grid.cell_level[crossed].tolist())
    assert body.state.cell_changes == expected > present.sum()
    assert levels == {0, 1, 2}


@pytest.mark.parametrize("dimension", [2, 3])
def test_particles_are_found_where_they_are(dimension):
    """Random displacements over several cells: the leaf found holds the place, and xi says where in it; slow twin."""
    random = np.random.default_rng(20 + dimension)
    grid = random_grid(random, dimension)
    count = 300
    old = random.integers(0, len(grid.cell_level), count).astype(np.int32)
    xi = random.uniform(-4.0, 4.0, (count, dimension))
    xi[:20] = random.choice([-1.0, 1.0], (20, dimension))  # on sides and corners
    position = grid.cell_center[old] + 0.5 * grid.cell_size[old][:, None] * xi
    domain = grid.origin + grid.shape * grid.fine_cell
    outside = ((position < grid.origin) | (position >= domain)).any(axis=1)
    cell, place = old.copy(), xi.copy()
    changed, lost = relocate(grid.cell_index, grid.cell_width, *leaf_lookup(grid), np.ones(count), cell, place)
    assert lost == outside.sum() > 0
    np.testing.assert_array_equal(cell[outside], old[outside])
    assert changed == (cell != old).sum()
    np.testing.assert_array_equal(cell[~outside], [cell_of(grid, x) for x in position[~outside]])
    found = grid.cell_center[cell] + 0.5 * grid.cell_size[cell][:, None] * place
    np.testing.assert_allclose(found, position, atol=1e-12 * domain.max())

    start, particles = sort_by_cell(cell, len(grid.cell_level))
    np.testing.assert_array_equal(particles, np.argsort(cell, kind="stable"))
    np.testing.assert_array_equal(np.diff(start), np.bincount(cell, minlength=len(grid.cell_level)))


def test_leaving_the_domain_is_an_error():
    """A block that nothing holds runs into the end of the grid: one line that says what to do."""
    body = make_body(grid_around([], (3, 3), 1, 10.0), boundary="free")
    with pytest.raises(InputError, match=r"left the domain: hold its faces .*solver\.move: false"):
        translate(body, (4.0, 0.0), 10)


def test_lone_particle_enters_an_empty_cell_in_peace():
    """A stressed particle creeps across a side: its far nodes have next to no mass, its stress must not grow.

    Without a least inertia the acceleration there overshoots each step and the stress passes any bound.
    """
    grid = grid_around([], (4, 4), 1, 10.0)
    body = make_body(
        grid,
        boundary="free",
        volume=lambda model: np.where((model.particles.position == (12.5, 12.5)).all(axis=1), 25.0, 0.0),
    )
    (particle,) = np.flatnonzero(body.volume)
    body.xi[particle] = 0.9, 0.3
    body.velocity[particle] = 10.0 * 1e-3 / body.time_step, 0.0
    body.state.stress[particle, [0, 1, 5]] = 1e6, -2e6, 0.5e6
    body.update(0.0)
    for _ in range(200):
        body.advance(np.zeros_like(body.unbalanced), body.time_step)
        body.update(body.time_step)
    assert body.state.cell_changes == 1
    assert np.abs(body.state.stress[particle]).max() < 2e6  # that of the start; plane strain keeps some out of plane


def test_same_bits_with_one_thread_or_two():
    """Forty steps with crossings and flowing rock: blocks, sums and relocation know nothing of threads."""
    if numba.config.NUMBA_NUM_THREADS < 2:
        pytest.skip("one processor")
    states = []
    for threads in (1, 2):
        numba.set_num_threads(threads)
        random = np.random.default_rng(5)
        grid = grid_around([ball((40.0, 40.0, 40.0), 9.0)], (8, 8, 8), 3, 10.0, rings=2)
        assert len(grid.cell_level) > 2 * 2048  # several blocks
        body = make_body(grid, host=COULOMB, stress=uniform(-10e6, -42e6, -12e6))
        body.state.failed[random.random(body.model.particles.count) < 0.3] = 0
        body.set_failed()
        stir(body, random, reach=0.05)
        for _ in range(40):
            body.advance(np.zeros_like(body.unbalanced), body.time_step)
            body.update(body.time_step)
        assert body.state.cell_changes > 0
        states.append(
            [
                body.xi,
                body.velocity,
                body.state.stress,
                body.state.cell,
                body.state.displacement,
            ]
        )
    for one, two in zip(*states, strict=True):
        np.testing.assert_array_equal(one, two)
