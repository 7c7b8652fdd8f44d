"""Rigid motions that the boundary leaves free: found, checked for balance, taken out; all mixes of faces."""

import numpy as np
import pytest

from common.errors import InputError
from mpm_core.equilibrium.convergence import History, norm
from mpm_core.equilibrium.explicit_scheme import ExplicitScheme
from mpm_core.equilibrium.multigrid_scheme import MultigridScheme
from mpm_core.model.rigid_motions import free_motions, unit_motions
from mpm_core.scene.scene import FACES
from mpm_core.stages.equilibrium_stages import elastic_stage
from mpm_core.stages.external_forces import external_force
from tests.mechanics.scenes import ball, excavation, grid_around, make_dataset, make_model, make_scene, uniform

CONDITIONS = ("fixed", "roller", "traction", "free")
WEIGHT = {"constant": [-10e6, -8e6, -12e6, 0, 0, 0], "gradient": [-0.02e6, -0.02e6, -0.028e6, 0, 0, 0]}


def model_with(boundary: dict, plane, stress):
    """A void off the middle of a block of 16 m (2-D) or 12 m, two levels and hanging nodes."""
    dimension = 2 if plane else 3
    shapes = [ball([7.0, 9.0] if plane else [5.0, 6.0, 7.0], 2.0)]
    grid = grid_around(shapes, (4,) * 2 if plane else (3,) * 3, levels=6 - dimension - 1, coarse=4.0)
    scene = make_scene(plane, stress=stress, excavations=[excavation()], boundary=boundary)
    return make_model(scene, grid, shapes)


def test_free_motions_are_the_null_space_at_what_is_held():
    """Against the singular values of all held components together; random faces, single points, shifted by 1e6 m."""
    random = np.random.default_rng(1)
    for _ in range(200):
        dimension = int(random.integers(2, 4))
        position = random.integers(0, 5, (30, dimension)) * 2.5 + random.choice([0.0, 1e6])
        held = np.zeros((30, dimension), bool)
        for _ in range(random.integers(0, 3)):
            held[:, random.integers(dimension)] |= position[:, random.integers(dimension)] == position[0, 0]
        held[random.integers(30, size=random.integers(0, 3)), random.integers(dimension)] = True
        every = unit_motions((position - position.mean(axis=0)) / 5.0)
        rank = np.linalg.matrix_rank(every[:, held]) if held.any() else 0
        motions = free_motions(position, held)
        assert motions.count == len(every) - rank
        moved = motions.at(position)
        np.testing.assert_allclose(moved[:, held], 0.0, atol=1e-9)
        assert motions.count == 0 or np.linalg.matrix_rank(moved.reshape(motions.count, -1)) == motions.count


def random_mixes(dimension: int, count: int):
    random = np.random.default_rng(dimension)
    faces = [face for face in FACES if dimension == 3 or face[0] != "y"]
    named = {"x": "roller", "others": "traction"}
    yield {face: named["x"] if face[0] == "x" else named["others"] for face in faces}
    yield {face: "roller" if face == "z_lower" else "traction" for face in faces}
    yield {face: "roller" if face == "x_upper" else "free" for face in faces}
    yield dict.fromkeys(faces, "free")
    for _ in range(count):
        yield dict(zip(faces, random.choice(CONDITIONS, len(faces)), strict=True))


@pytest.mark.parametrize(("dimension", "count"), [(2, 40), (3, 6)])
@pytest.mark.parametrize("stress", [uniform(-30e6, -20e6, -10e6), WEIGHT], ids=["weightless", "weight"])
def test_all_mixes_of_faces_come_to_rest(dimension, count, stress, caplog):
    """In at most 12 cycles and without explicit steps, or they are refused; nothing moves by more than elastic rock."""
    solved, refused = 0, []
    for boundary in random_mixes(dimension, count):
        try:
            model = model_with(boundary, "xz" if dimension == 2 else None, stress)
            force = external_force(model, 0)
        except InputError as error:
            refused.append(str(error))
            continue
        volume, history = model.volumes(0), History(1e-6)
        scheme = MultigridScheme(model, model.virgin_state(), volume)
        scheme.reach_equilibrium(force, 1e-6, norm(force), history)
        assert history.iteration <= 12, boundary
        assert np.abs(scheme.body.state.displacement).max() < 0.1, boundary  # a square block bent by 30 MPa: 12 p h / E
        free = model.free_motions(model.attached_nodes(volume)).at(model.grid.node_position)
        assert len(free) == 0 or np.abs(
            np.einsum("kni,n,ni->k", free, scheme.body.mass, scheme.body.state.displacement)
        ).max() < (1e-9 * scheme.body.mass.sum() * np.abs(scheme.body.state.displacement).max())
        solved += 1
    assert "explicit" not in caplog.text
    assert solved > count / 2
    assert all(line.startswith("domain.boundary: ") and "\n" not in line for line in refused)
    assert len(refused) > 0 or dimension == 3 or stress is not WEIGHT


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("number", range(4))
def test_both_schemes_agree_where_motions_are_free(dimension, number):
    """x rollers and traction, one roller face, one roller face and free ones, all free: same stress, same motion."""
    boundary = list(random_mixes(dimension, 0))[number]
    model = model_with(boundary, "xz" if dimension == 2 else None, uniform(-30e6, -20e6, -10e6))
    volume, force = model.volumes(0), external_force(model, 0)
    schemes = [kind(model, model.virgin_state(), volume) for kind in (ExplicitScheme, MultigridScheme)]
    for scheme in schemes:
        scheme.reach_equilibrium(force, 1e-7, norm(force), History(1e-7))
    one, other = schemes
    present = volume > 0.0
    assert np.abs(one.body.state.stress - other.body.state.stress)[present].max() < 1e-5 * 30e6
    solid = one.body.mass > 0.0
    moved = np.abs(one.body.state.displacement[solid]).max()
    assert np.abs(one.body.state.displacement - other.body.state.displacement)[solid].max() < 1e-4 * moved


def test_forces_along_what_is_free_are_refused_by_name():
    """A roller face holds one direction; a load across it is named, a load against it is carried."""
    faces = dict.fromkeys(FACES, "traction") | {"z_lower": "roller"}
    load = {"name": "push", "since": 0, "shape": {"shape": "box", "lower": [4.0, 4.0], "upper": [12.0, 12.0]}}

    def model_under(*force):
        scene = make_scene("xz", boundary=faces, stress=uniform(-1e6), loads=[load | {"force": list(force)}])
        return make_model(scene, grid_around([], (4, 4), 1, 4.0))

    with pytest.raises(InputError, match=r"domain.boundary: in step step_0 .*it may shift along x\), and the forces"):
        external_force(model_under(1e6, 0.0, 0.0), 0)
    model = model_under(0.0, 0.0, -1e6)
    force = external_force(model, 0)
    scheme = MultigridScheme(model, model.virgin_state(), model.volumes(0))
    scheme.reach_equilibrium(force, 1e-6, norm(force), History(1e-6))
    assert scheme.body.state.displacement[:, 1].min() < 0.0


def test_everything_mined_is_refused_in_one_line():
    """No rock, no equilibrium."""
    scene = make_scene("xz", excavations=[excavation()], stress=uniform(-1e6))
    model = make_model(scene, grid_around([], (3, 3), 1, 4.0), [ball([6.0, 6.0], 100.0)])
    with pytest.raises(InputError, match=r"^steps.step_0: nothing is left of the model"):
        external_force(model, 0)


@pytest.mark.parametrize("scheme", ["explicit", "multigrid"])
@pytest.mark.parametrize("force", [0.0, 1e3])
def test_a_free_body_keeps_the_stress_of_its_loads_alone(scheme, force, tmp_path):
    """30 MPa are unloaded by free faces; two balanced loads of 1 kN leave some pascals, right at the default tolerance:
    on any plane across, the mean stress is - force / area. Without loads nothing stays."""
    ends = (([2.0, 2.0, 0.0], [10.0, 10.0, 2.0], 1.0), ([2.0, 2.0, 10.0], [10.0, 10.0, 12.0], -1.0))
    loads = [
        {"name": f"end_{k}", "since": 0, "force": [0.0, 0.0, sign * force]}
        | {"shape": {"shape": "box", "lower": low, "upper": high}}
        for k, (low, high, sign) in enumerate(ends)
    ]
    scene = make_scene(
        boundary="free",
        stress=uniform(-30e6, -20e6, -10e6, 0.0, 0.0, 3e6),
        loads=loads if force else [],
        excavations=[excavation()],
        solver={"scheme": scheme},
    )
    shapes = [ball([6.0, 6.0, 6.0], 0.9)]
    grid = grid_around(shapes, (6, 6, 6), 2, 2.0)
    state, _ = elastic_stage(scene, make_dataset(scene, grid, shapes), tmp_path / "failed.npz")
    place, volume, stress = (state[name].values for name in ("position", "volume", "stress"))
    assert np.abs(stress[volume > 0.0]).max() < (1e-8 * 30e6 if force == 0.0 else 100.0)
    across = (np.abs(place[:, 2] - 3.0) < 1.0) & (volume > 0.0)  # a layer 2 m thick below the void
    assert np.isclose(volume[across].sum(), 2.0 * 144.0)
    mean = (stress[across, 2] * volume[across]).sum() / volume[across].sum()
    assert mean == pytest.approx(-force / 144.0, abs=0.01 if force == 0.0 else 0.01 * force / 144.0)
