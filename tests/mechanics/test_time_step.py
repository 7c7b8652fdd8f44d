"""The time step against the largest frequency of assembled scenes, and the damped iteration at that step."""

import numpy as np
import pytest

from mechanics.scenes import HOST, ball, constrain, excavation, grid_around, make_model, make_scene
from mpm_core.equilibrium.body import Body
from mpm_core.kernels.nodal_operations import spread_to_hanging

PLANES = {2: "xz", 3: None}


def make_body(dimension, *, nu=0.25, per_edge=1, cut_cells="mean", solver=None, boundary="fixed", fill="fill"):
    """A void and a soft fill (57:1) in cut cells beside it, two levels."""
    shapes = [ball([12.3] * dimension, 5.3), ball([17.0] * dimension, 3.0)]
    scene = make_scene(
        PLANES[dimension],
        host=HOST | {"poisson_ratio": nu},
        excavations=[excavation(), excavation(fill=fill, name="other")],
        particles_per_cell=per_edge,
        cut_cells=cut_cells,
        solver=solver,
        boundary=boundary,
    )
    grid = grid_around(shapes, [3] * dimension, 2, 8.0, rings=0)
    model = make_model(scene, grid, shapes)
    return Body(model, model.virgin_state(), model.volumes(0))


def stiffness(body):
    """(moving dofs) flat indices and the assembled matrix, column by column from unit displacements."""
    model, state = body.model, body.state
    moving = ~model.held & (body.mass > 0.0)[:, None]
    moving[model.hanging] = False
    flat = np.flatnonzero(moving)
    columns = np.empty((len(flat), len(flat)))
    for column, dof in enumerate(flat):
        state.stress[:], state.hourglass_force[:] = 0.0, 0.0
        unit = np.zeros(state.velocity.size)
        unit[dof] = 1.0
        state.velocity[:] = constrain(model.grid, unit.reshape(state.velocity.shape))
        body.update(1.0)
        columns[:, column] = -body.internal_force().ravel()[flat]
    return flat, columns


def largest_eigenvalue(body):
    """Of M^-1 K; K must be symmetric."""
    flat, matrix = stiffness(body)
    np.testing.assert_allclose(matrix, matrix.T, rtol=0, atol=1e-9 * np.abs(matrix).max())
    root = 1.0 / np.sqrt(np.repeat(body.mass, body.model.dimension)[flat])
    return np.linalg.eigvalsh(root[:, None] * 0.5 * (matrix + matrix.T) * root).max()


@pytest.mark.parametrize(
    ("dimension", "options"),
    [
        (2, {}),
        (2, {"nu": 0.0}),
        (2, {"per_edge": 2}),
        (2, {"cut_cells": "subdivide"}),
        (2, {"solver": {"density_scaling": False}}),
        (2, {"boundary": "traction"}),
        (2, {"fill": None}),
        (2, {"fill": None, "cut_cells": "subdivide", "boundary": "traction"}),
        (3, {}),
        (3, {"nu": 0.0}),
        (3, {"per_edge": 2}),
    ],
)
def test_no_frequency_exceeds_the_limit_that_the_step_is_made_from(dimension, options):
    """Largest eigenvalue of M^-1 K <= 4 / limit^2, exact bound by parts; K symmetric; and at least a quarter of it, so
    that no more than half of the step is given away; two thirds where a crumb in a cut cell sets that of all rock."""
    body = make_body(dimension, **options)
    limit = body.time_step / body.time_step_share
    ratio = largest_eigenvalue(body) * limit**2 / 4.0
    print(f"\n{dimension}-D {options}: {ratio:.3f} of the bound")
    assert ratio <= 1.0 + 1e-9
    assert ratio > (0.25 if body.model.scene.solver.density_scaling else 0.11)


def test_a_lone_sample_in_a_corner_sets_no_frequency_above_the_limit():
    """All is mined but two of the 64 samples in a corner of one cell: far corners take little of their mass. At 7/8 of
    the way, the bound of a particle at the centre is passed by up to 1 / (1 - 49/64) = 4.3."""

    def all_but_a_crumb(x):
        return (x > np.array([9.0, 8.6])).any(axis=-1) | (x < 8.0).any(axis=-1)

    scene = make_scene("xz", excavations=[excavation()], cut_cells="subdivide", boundary="traction")
    model = make_model(scene, grid_around([], [3, 3], 1, 4.0), [all_but_a_crumb])
    body = Body(model, model.virgin_state(), model.volumes(0))
    assert (body.volume > 0.0).sum() == 2
    ratio = largest_eigenvalue(body) * (body.time_step / body.time_step_share) ** 2 / 4.0
    assert 0.25 < ratio <= 1.0 + 1e-9


@pytest.mark.parametrize("damping", [0.0, 0.5, 0.7, 0.8, 0.85])
def test_a_mode_at_the_limit_decays_under_local_damping(damping):
    """One mass on one spring, omega dt = 2 share: x'' = -w^2 x, f - c |f| sgn v. The share is 0.98 / sqrt(1 + c); at
    0.9, which ignores that damping stiffens the spring while it slows the mass, c = 0.8 grows by e^1.27 a step."""
    body = make_body(2, solver={"damping": damping})

    def grown(share, steps=300):
        angle = np.linspace(0, 2 * np.pi, 1000)
        place, velocity, log = np.cos(angle), np.sin(angle), np.zeros_like(angle)
        for _ in range(steps):
            force = -4 * share**2 * place
            velocity = velocity + force - damping * np.abs(force) * np.sign(velocity)
            place = place + velocity
            size = np.hypot(place, velocity)
            log += np.log(size)
            place, velocity = place / size, velocity / size
        return log.max() / steps

    assert grown(body.time_step_share) < (0.02 if damping == 0.0 else 0.0)
    if damping >= 0.7:
        assert grown(0.9) > 0.9


@pytest.mark.parametrize(
    ("dimension", "options"),
    [
        (2, {"nu": 0.0}),
        (2, {}),
        (2, {"per_edge": 2}),
        (2, {"cut_cells": "subdivide"}),
        (3, {"nu": 0.0}),
    ],
)
def test_random_motion_comes_to_rest(dimension, options):
    """Kinetic energy of random nodal velocities: never more than a few times the first value, after 300 steps gone."""
    body = make_body(dimension, **options)
    model, velocity = body.model, body.state.velocity
    velocity[:] = np.random.default_rng(0).normal(size=velocity.shape)
    velocity[model.held] = 0.0
    spread_to_hanging(model.hanging, model.grid.node_parents, velocity)
    body.update(body.time_step)
    energies = []
    for _ in range(300):
        body.advance(np.zeros_like(velocity), body.time_step)
        spread_to_hanging(model.hanging, model.grid.node_parents, velocity)
        energies.append(float(np.sum(body.mass[:, None] * velocity**2)))
        body.update(body.time_step)
    assert max(energies) < 10 * energies[0]
    assert energies[-1] < 1e-6 * energies[0]
