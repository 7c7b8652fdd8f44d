"""Rock at a front is judged, and drops, by the stress towards it."""

import numpy as np
import pytest

from mechanics.scenes import COULOMB, ball, box, excavation, grid_around, make_model, make_scene
from mpm_core.constitutive.elastic import strain_from_stress
from mpm_core.constitutive.laws.coulomb import overstress
from mpm_core.equilibrium.body import Body
from mpm_core.equilibrium.brittle import fail, find_brittle, judged_at, new_failures
from mpm_core.equilibrium.front import REACH, front_of
from mpm_core.grid.adjacency import face_neighbors

CELL = 2.0


@pytest.fixture(params=[2, 3])
def model(request):
    """A block of single cells in which those below x = 6 m are mined."""
    dimension = request.param
    shape = box([0.0] * dimension, [6.0] + [16.0] * (dimension - 1))
    scene = make_scene({2: "xz", 3: None}[dimension], host=COULOMB, excavations=[excavation()])
    return make_model(scene, grid_around([], [8] * dimension, 1, CELL), [shape])


def brittle_of(model):
    return find_brittle(model, model.volumes(0), 0, *face_neighbors(model.grid))


def linear(model, slopes) -> np.ndarray:
    """Full stress (particle, 6) Pa that is linear in x, as a change since virgin."""
    return np.outer(model.particles.position[:, 0], slopes) - model.insitu


def test_a_linear_stress_is_met_exactly_towards_the_wall(model):
    """On the wall's cells REACH of a cell nearer to it; elsewhere at the centre."""
    state, slopes = model.virgin_state(), np.array([1e6, -2e6, 3e6, 0.5e6, -0.25e6, 4e6])
    state.stress[:] = linear(model, slopes)
    rock = np.flatnonzero(model.volumes(0) > 0.0)
    change = front_of(model, 0).stress_change(model, state, rock)
    at_wall = model.particles.position[rock, 0] < 8.0
    assert at_wall.any()
    np.testing.assert_allclose(change[at_wall], np.tile(-REACH * CELL * slopes, (at_wall.sum(), 1)), atol=1e-6)
    assert not change[~at_wall].any()


def test_the_front_moves_on_with_failed_rock(model):
    """Where the wall's row has failed, the next row is at the front; one between two failed rows is not."""
    state, slopes = model.virgin_state(), np.array([1e6, 0, 0, 0, 0, 0])
    state.stress[:] = linear(model, slopes)
    x = model.particles.position[:, 0]
    state.failed[(x > 6.0) & (x < 8.0) & (model.volumes(0) > 0.0)] = 0
    rock = np.flatnonzero((x > 8.0) & (model.volumes(0) > 0.0))
    change = front_of(model, 0).stress_change(model, state, rock)
    np.testing.assert_allclose(change[:, 0], np.where(x[rock] < 10.0, -REACH * CELL * 1e6, 0.0), atol=1e-6)
    state.failed[(x > 10.0) & (x < 12.0)] = 0  # a row between two fronts has no sound rock behind it
    between = np.flatnonzero((x > 8.0) & (x < 10.0))
    assert not front_of(model, 0).stress_change(model, state, between).any()


def test_rock_below_its_strength_at_the_centre_fails_by_the_stress_at_the_front_and_drops_from_it(model):
    """Compression along z grows towards the wall: the wall's row alone is above strength, and only at the front. Its
    strain is the compliance times the drop at the front; its own stress falls by as much, to residual strength at most.
    """
    state, brittle = model.virgin_state(), brittle_of(model)
    strength = model.intact_rows[0][2]  # uniaxial
    position, at_wall = model.particles.position, model.particles.position[:, 0] < 8.0
    total = np.zeros((len(position), 6))
    total[:, 2] = -0.99 * strength * (1.0 - 0.1 * (position[:, 0] - 7.0) / CELL)
    state.stress[:] = total - model.insitu
    wall = np.flatnonzero(at_wall & (model.volumes(0) > 0.0))
    assert new_failures(model, state, brittle).tolist() == wall.tolist()
    change = judged_at(model, state, brittle, wall)
    np.testing.assert_allclose(total[wall, 2] + change[:, 2], -0.99 * strength * (1.0 + 0.1 * REACH), rtol=1e-12)

    body = Body(model, state, model.volumes(0))
    fail(body, brittle, wall, 0, 1, 0)
    after = state.stress[wall] + model.insitu[wall]
    lame, shear = model.elastic_constants[0]
    lost = np.stack(strain_from_stress(lame, shear, *(total[wall] - after).T), axis=1)
    np.testing.assert_allclose(state.overshoot_strain[wall] + state.seismic_strain[wall], lost, atol=1e-12)
    assert max(overstress(*row, model.residual_rows[0]) for row in after) <= 1.0  # Pa
    assert state.seismic_strain[wall, 2].max() < -0.1 * strength / (2.0 * shear)


def test_a_mirrored_mine_has_mirrored_changes():
    """Random stress beside a round opening, cut cells included."""
    shapes = {True: [ball([15.0, 17.0], 6.3)], False: [ball([17.0, 17.0], 6.3)]}
    models = {
        mirrored: make_model(
            make_scene("xz", host=COULOMB, excavations=[excavation()]), grid_around([], [16, 16], 1, CELL), shape
        )
        for mirrored, shape in shapes.items()
    }
    own, other = models[False], models[True]
    value = np.random.default_rng(0).normal(size=(len(own.particles.cell), 6)) * 1e6
    centre = own.grid.cell_center[own.particles.cell]
    image = np.argmin(
        (
            (other.grid.cell_center[other.particles.cell][:, None] - np.array([32.0, 0.0]) * [1, 0] + centre * [1, -1])
            ** 2
        ).sum(axis=2),
        axis=0,
    )
    sign = np.array([1, 1, 1, 1, -1, -1])
    state, mirrored = own.virgin_state(), other.virgin_state()
    state.stress[:] = value - own.insitu
    mirrored.stress[image] = value * sign - other.insitu[image]
    rock = np.arange(len(value))
    change = front_of(own, 0).stress_change(own, state, rock)
    found = front_of(other, 0).stress_change(other, mirrored, image)
    assert (change != 0.0).any()
    np.testing.assert_allclose(found, change * sign, atol=1e-6)
