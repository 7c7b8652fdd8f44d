"""Rock at a front is judged, and drops, by the stress towards it."""

import numpy as np
import pytest

from mechanics.scenes import COULOMB, ball, box, excavation, grid_around, make_model, make_scene
from mpm_core.constitutive.elastic import strain_from_stress
from mpm_core.constitutive.laws.coulomb import overstress
from mpm_core.equilibrium.body import Body
from mpm_core.equilibrium.brittle import fail, find_brittle, new_failures, stress_to_front
from mpm_core.equilibrium.front import REACH, front_of
from mpm_core.grid.adjacency import face_neighbors
from mpm_core.model.state import GAINED, SEISMIC

CELL = 2.0
PERFECT = COULOMB | {key: {"intact": COULOMB[key]["intact"], "residual": COULOMB[key]["intact"]}
                     for key in ("friction_angle", "cohesion", "tension_cutoff")}  # fmt: skip


def wall(dimension: int, host: dict = COULOMB, at: float = 6.0, body=None, **scene):
    """A block of single cells, mined below x = `at`, m."""
    shape = box([0.0] * dimension, [at] + [16.0] * (dimension - 1))
    scene = make_scene({2: "xz", 3: None}[dimension], host=host, excavations=[excavation()], **scene)
    return make_model(scene, grid_around([], [8] * dimension, 1, CELL), [shape], body)


@pytest.fixture(params=[2, 3])
def model(request):
    return wall(request.param)


def brittle_of(model):
    return find_brittle(model, model.volumes(0), 0, *face_neighbors(model.grid))


def linear(model, slopes) -> np.ndarray:
    """Full stress (particle, 6) Pa that is linear in x, as a change since virgin."""
    return np.outer(model.particles.position[:, 0], slopes) - model.insitu


def compress(model, state, share: float, slope: float = 0.1, confinement: float = 0.0):
    """Compression along z of `share` times strength in the wall's row, less by `slope` in each row behind; and where
    that row is."""
    friction, strength = model.intact_rows[0][[0, 2]]
    x = model.particles.position[:, 0]
    total = np.full((len(x), 6), 0.0)
    total[:, :3] = -confinement
    total[:, 2] = -share * (friction * confinement + strength) * (1.0 - slope * (x - 7.0) / CELL)
    state.stress[:] = total - model.insitu
    return total, np.flatnonzero((x < 8.0) & (model.volumes(0) > 0.0))


def test_a_linear_stress_is_met_exactly_at_the_face(model):
    """On the wall's cells half a cell nearer to it; elsewhere at the centre."""
    state, slopes = model.virgin_state(), np.array([1e6, -2e6, 3e6, 0.5e6, -0.25e6, 4e6])
    state.stress[:] = linear(model, slopes)
    rock = np.flatnonzero(model.volumes(0) > 0.0)
    change = front_of(model, 0).stress_to_face(model, state, rock)
    at_wall = model.particles.position[rock, 0] < 8.0
    assert at_wall.any()
    np.testing.assert_allclose(change[at_wall], np.tile(-0.5 * CELL * slopes, (at_wall.sum(), 1)), atol=1e-6)
    assert not change[~at_wall].any()


@pytest.mark.parametrize("share", [0.75, 0.5, 0.25])
def test_a_cut_cell_is_judged_towards_its_own_wall(share):
    """Linear stress is met at the wall, wherever it is in the cell; a cell less than half rock has no such stress."""
    at = 8.0 - share * CELL
    model, slopes = wall(3, at=at), np.array([1e6, -2e6, 3e6, 0.5e6, -0.25e6, 4e6])
    state = model.virgin_state()
    state.stress[:] = linear(model, slopes)
    x = model.particles.position[:, 0]
    row = np.flatnonzero((model.volumes(0) > 0.0) & (x < 8.0))
    expected = np.outer(at - x[row], slopes) if share >= 0.5 else 0.0
    change = front_of(model, 0).stress_to_face(model, state, row)
    np.testing.assert_allclose(change, np.broadcast_to(expected, change.shape), atol=1e-6)


def test_changes_along_two_axes_count_with_their_mean():
    """The cell in the corner of failed rock."""
    model = wall(2)
    state, position = model.virgin_state(), model.particles.position
    state.stress[:, 0] = 1e6 * position[:, 0] + 3e6 * position[:, 1]
    state.stress -= model.insitu
    state.failed[(position[:, 1] < 2.0) & (model.volumes(0) > 0.0)] = 0
    corner = np.flatnonzero((abs(position[:, 0] - 7.0) < 0.1) & (abs(position[:, 1] - 3.0) < 0.1))
    change = front_of(model, 0).stress_to_face(model, state, corner)
    np.testing.assert_allclose(change[:, 0], [-0.5 * CELL * (1e6 + 3e6) / 2.0], atol=1e-6)


def test_no_stress_goes_on_from_other_rock():
    """Behind the wall's row begins another material, whose stress may be any."""
    grid = grid_around([], [8] * 3, 1, CELL)
    body = np.where(grid.cell_center[:, 0] > 8.0, 0, -1).astype(np.int16)
    other = {"materials": {"host": COULOMB, "other": COULOMB}, "rock_bodies": [{"material": "other"}]}
    model = wall(3, body=body, **other)
    state = model.virgin_state()
    state.stress[:] = linear(model, np.full(6, 1e6))
    rock = np.flatnonzero(model.volumes(0) > 0.0)
    assert not front_of(model, 0).stress_to_face(model, state, rock).any()


def test_the_front_moves_on_with_failed_rock(model):
    """Where the wall's row has failed, the next row is at the front; one between two failed rows is not."""
    state, slopes = model.virgin_state(), np.array([1e6, 0, 0, 0, 0, 0])
    state.stress[:] = linear(model, slopes)
    x = model.particles.position[:, 0]
    state.failed[(x > 6.0) & (x < 8.0) & (model.volumes(0) > 0.0)] = 0
    rock = np.flatnonzero((x > 8.0) & (model.volumes(0) > 0.0))
    change = front_of(model, 0).stress_to_face(model, state, rock)
    np.testing.assert_allclose(change[:, 0], np.where(x[rock] < 10.0, -0.5 * CELL * 1e6, 0.0), atol=1e-6)
    state.failed[(x > 10.0) & (x < 12.0)] = 0  # a row between two fronts has no sound rock behind it
    between = np.flatnonzero((x > 8.0) & (x < 10.0))
    assert not front_of(model, 0).stress_to_face(model, state, between).any()


@pytest.mark.parametrize("confinement", [0.0, 1e6, 5e6])
def test_rock_is_judged_as_near_to_the_face_as_its_drop_says(confinement):
    """REACH of the way from the centre to the face, times one less residual strength over strength, both at this
    confinement."""
    model = wall(3)
    state, brittle = model.virgin_state(), brittle_of(model)
    total, row = compress(model, state, 0.99, confinement=confinement)
    friction, strength = model.intact_rows[0][[0, 2]]
    friction_left, strength_left = model.residual_rows[0][[0, 2]]
    drop = 1.0 - ((friction_left - 1.0) * confinement + strength_left) / ((friction - 1.0) * confinement + strength)
    to_front = stress_to_front(model, state, brittle, row)
    np.testing.assert_allclose(to_front[:, 2], 0.05 * REACH * drop * total[row, 2], rtol=1e-4)
    assert not to_front[:, [0, 1, 3, 4, 5]].any()


def test_rock_that_loses_no_strength_is_judged_at_its_centre():
    """No drop: the front of perfectly plastic rock has no jump in stress."""
    model = wall(2, PERFECT)
    state, brittle = model.virgin_state(), brittle_of(model)
    _, row = compress(model, state, 0.99)
    assert not len(new_failures(model, state, brittle))
    np.testing.assert_allclose(stress_to_front(model, state, brittle, row), 0.0, atol=100.0)


def test_rock_below_its_strength_at_the_centre_fails_by_the_stress_at_the_front_and_drops_from_it(model):
    """Compression along z grows towards the wall: the wall's row alone is above strength, and only at the front. Its
    strain is the compliance times the drop at the front; its own stress falls by as much, to residual strength at most.
    """
    state, brittle = model.virgin_state(), brittle_of(model)
    total, row = compress(model, state, 0.99)
    assert new_failures(model, state, brittle).tolist() == row.tolist()
    body = Body(model, state, model.volumes(0))
    fail(body, brittle, row, 0, 1, 0)
    after = state.stress[row] + model.insitu[row]
    lame, shear = model.elastic_constants[0]
    lost = np.stack(strain_from_stress(lame, shear, *(total[row] - after).T), axis=1)
    np.testing.assert_allclose(state.overshoot_strain[row] + state.seismic_strain[row], lost, atol=1e-12)
    assert max(overstress(*one, model.residual_rows[0]) for one in after) <= 1.0  # Pa
    assert state.seismic_strain[row, 2].max() < -0.1 * model.intact_rows[0][2] / (2.0 * shear)


def test_no_drop_gains_energy(model):
    """In rock without cohesion that dilates, the strains of the drop at this front do work against the pressure at the
    centre. The drop is then that of the centre."""
    host = COULOMB | {"friction_angle": {"intact": 35.0, "residual": 25.0}}
    host |= {"dilation_angle": {"intact": 28.0, "residual": 22.0}}
    host |= {key: {"intact": 0.0, "residual": 0.0} for key in ("cohesion", "tension_cutoff")}
    model = wall(model.dimension, host)
    state, brittle = model.virgin_state(), brittle_of(model)
    at_wall = (model.particles.position[:, 0] < 8.0)[:, None]
    own, behind = np.array([-0.3, -0.3, -0.1, 0.0, 0.0, 0.2]), np.array([-1.8, -1.7, -1.6, 0.0, 0.0, -1.2])
    state.stress[:] = 1e6 * np.where(at_wall, own, behind) - model.insitu
    row = np.flatnonzero(at_wall[:, 0] & (model.volumes(0) > 0.0))
    assert stress_to_front(model, state, brittle, row).any(axis=1).all()
    fail(Body(model, state, model.volumes(0)), brittle, row, 0, 1, 0)
    assert state.energy[GAINED] == 0.0
    assert state.energy[SEISMIC] > 0.0
    after = state.stress[row] + model.insitu[row]
    lame, shear = model.elastic_constants[0]
    lost = np.stack(strain_from_stress(lame, shear, *(1e6 * own - after).T), axis=1)
    np.testing.assert_allclose(state.overshoot_strain[row] + state.seismic_strain[row], lost, atol=1e-12)


IMAGES = {  # The place of a point, and the order and sign of stress components there.
    "mirrored": (lambda x: x * [-1, 1] + [32.0, 0.0], [0, 1, 2, 3, 4, 5], [1, 1, 1, 1, -1, -1]),
    "turned": (lambda x: x[:, ::-1] * [-1, 1] + [32.0, 0.0], [1, 0, 2, 4, 3, 5], [1, 1, 1, 1, -1, -1]),
    "ten times as large": (lambda x: 10.0 * x, [0, 1, 2, 3, 4, 5], [1, 1, 1, 1, 1, 1]),
    "in two solids": (lambda x: x, [0, 1, 2, 3, 4, 5], [1, 1, 1, 1, 1, 1]),
}


def test_the_same_rock_fails_however_much_is_judged_at_once(model, monkeypatch):
    """Random stress around strength, some rock failed already: all at once, and seven particles at a time."""
    state, brittle, random = model.virgin_state(), brittle_of(model), np.random.default_rng(1)
    state.stress[:] = random.uniform(-60e6, 5e6, (model.particles.count, 6)) * [1, 1, 1, 0, 0, 0]
    state.failed[random.random(model.particles.count) < 0.2] = 0
    at_once = new_failures(model, state, brittle)
    assert 0 < len(at_once) < len(brittle.sound)
    monkeypatch.setattr("mpm_core.equilibrium.brittle.CANDIDATES_AT_ONCE", 7)
    np.testing.assert_array_equal(new_failures(model, state, brittle), at_once)


def round_opening(center, radius: float, cell: float, solids: int):
    """A block of 16 x 16 cells with a round opening, in one solid or in two halves."""
    whole = ball(center, radius)
    halves = [lambda x: whole(x) & (x[..., 0] < center[0]), lambda x: whole(x) & (x[..., 0] >= center[0])]
    scene = make_scene("xy", host=COULOMB, excavations=[excavation(name=f"void_{k}") for k in range(solids)])
    return make_model(scene, grid_around([], [16, 16], 1, cell), [whole] if solids == 1 else halves)


def front_by_cell(model, stress, failed) -> tuple[np.ndarray, np.ndarray]:
    """Change of stress to where rock is judged (cell, 6), and the cells that fail now, (cell,) bool; stress, failed:
    by cell."""
    state, brittle, cell = model.virgin_state(), brittle_of(model), model.particles.cell
    rock = model.can_fail() & (model.volumes(0) > 0.0)
    state.stress[:] = stress[cell] - model.insitu
    state.failed[rock & failed[cell]] = 0
    sound = np.flatnonzero(rock & (state.failed < 0))
    change, fresh = np.zeros_like(stress), np.zeros(len(stress), bool)
    change[cell[sound]] = stress_to_front(model, state, brittle, sound)
    fresh[cell[new_failures(model, state, brittle)]] = True
    return change, fresh


@pytest.mark.parametrize("image", IMAGES)
def test_the_image_of_a_mine_has_the_image_of_its_front(image):
    """Random stress around a round opening, with cut cells and failed rock: the same but for round-off."""
    place, order, sign = IMAGES[image]
    center, scale = np.array([[17.0, 16.3]]), 10.0 if image == "ten times as large" else 1.0
    model = round_opening(center[0], 6.3, CELL, 1)
    other = round_opening(place(center)[0], 6.3 * scale, CELL * scale, 2 if image == "in two solids" else 1)
    distance = np.abs(other.grid.cell_center[None] - place(model.grid.cell_center)[:, None]).sum(axis=2)
    assert (distance.min(axis=1) < 1e-9).all()
    to = distance.argmin(axis=1)
    random = np.random.default_rng(0)
    stress, failed = random.normal(size=(256, 6)) * 1e7, random.random(256) < 0.2
    stress_there, failed_there = np.empty_like(stress), np.empty_like(failed)
    stress_there[to], failed_there[to] = stress[:, order] * sign, failed
    change, fresh = front_by_cell(model, stress, failed)
    change_there, fresh_there = front_by_cell(other, stress_there, failed_there)
    assert (change != 0.0).any()
    assert fresh.any()
    np.testing.assert_allclose(change_there[to], change[:, order] * sign, atol=1.0)  # Pa
    assert (fresh_there[to] == fresh).all()
