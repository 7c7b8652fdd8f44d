"""Strength that varies from place to place: a field of the rock, which knows no cells, and another for each member."""

from dataclasses import replace

import numba
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mechanics.scenes import (
    COULOMB,
    HOST,
    ball,
    box,
    excavation,
    grid_around,
    make_dataset,
    make_model,
    make_scene,
    strength_margin,
    uniform,
)
from mpm_core.constitutive.laws import coulomb, hoek_brown, rows_of_all, weak_planes
from mpm_core.constitutive.laws.coulomb import overstress
from mpm_core.equilibrium.brittle import above_strength, find_brittle, new_failures, weakest
from mpm_core.equilibrium.refinement import near_strength
from mpm_core.grid.adjacency import face_neighbors
from mpm_core.kernels import block_scatter
from mpm_core.kernels.failure import (
    make_drop,
    make_drop_share,
    make_is_above_strength,
    make_overstress_of,
    make_rate_strength,
)
from mpm_core.model.variability import COARSE_CELLS, field_at
from mpm_core.stages.equilibrium_stages import elastic_stage, mining_step

LENGTH = 3.0
VARIED = COULOMB | {"variability": {"share": 0.1, "length": LENGTH}}
WEAK = VARIED | {"cohesion": {"intact": 1e6, "residual": 0.5e6}}
ROCKS = {
    coulomb: COULOMB,
    hoek_brown: HOST
    | {
        "model": "hoek_brown",
        "sigma_ci": {"intact": 60e6, "residual": 20e6},
        "mb": {"intact": 8.0, "residual": 4.0},
        "s": {"intact": 0.1, "residual": 0.01},
        "a": {"intact": 0.5, "residual": 0.5},
        "dilation_angle": {"intact": 5.0, "residual": 5.0},
        "tension_cutoff": {"intact": 0.5e6, "residual": 0.0},
    },
    weak_planes: COULOMB
    | {
        "model": "weak_planes",
        "planes": {
            "dip": 40.0,
            "dip_direction": 120.0,
            "friction_angle": {"intact": 25.0, "residual": 20.0},
            "dilation_angle": {"intact": 5.0, "residual": 5.0},
            "cohesion": {"intact": 1e6, "residual": 0.5e6},
            "tension_cutoff": {"intact": 0.2e6, "residual": 0.0},
        },
    },
}
STRENGTHS = ("cohesion", "tension_cutoff", "sigma_ci")


@pytest.mark.parametrize("dimension", [2, 3])
def test_the_field_has_its_variance_and_its_correlation(dimension):
    random = np.random.default_rng(5)
    place = random.uniform(-5000.0, 5000.0, (100_000, dimension))
    away = random.normal(size=place.shape)
    away /= np.linalg.norm(away, axis=1)[:, None]
    here = field_at(place, LENGTH, 0)
    assert here.mean() == pytest.approx(0.0, abs=0.02)
    assert here.std() == pytest.approx(1.0, abs=0.02)
    assert np.mean(here**4) == pytest.approx(3.0, abs=0.2)
    for distance in (0.25 * LENGTH, LENGTH, 3.0 * LENGTH):
        there = field_at(place + distance * away, LENGTH, 0)
        assert np.mean(here * there) == pytest.approx(np.exp(-((distance / LENGTH) ** 2)), abs=0.06)
    assert np.mean(here * field_at(place, LENGTH, 1)) == pytest.approx(0.0, abs=0.06)


def test_the_field_is_of_the_place_alone():
    """Whichever points are asked for, in which order; in 2-D the section at 0 of the field in 3-D."""
    place = np.random.default_rng(1).uniform(0.0, 100.0, (700, 3))
    every = field_at(place, LENGTH, 4)
    order = np.random.default_rng(2).permutation(700)
    assert (field_at(place[order][:33], LENGTH, 4) == every[order][:33]).all()
    place[:, 2] = 0.0
    assert (field_at(place[:, :2], LENGTH, 4) == field_at(place, LENGTH, 4)).all()


@pytest.mark.parametrize("cut_cells", ["mean", "subdivide"])
def test_strength_is_of_the_place_alone(cut_cells):
    """Two rocks, an elastic one, a stope that is filled later: fills come after all rock and change no number."""
    shapes = [box([16, 16], [24, 24]), ball([30.0, 30.0], 4.0)]
    grid = grid_around(shapes, [6, 6], 3, 8.0)
    body = np.full(len(grid.cell_level), -1)
    body[grid.cell_center[:, 0] > 32.0] = 0
    body[grid.cell_center[:, 1] < 8.0] = 1
    found = []
    for steps, fill in ((1, None), (2, "fill")):
        scene = make_scene(
            "xz",
            materials={"host": VARIED, "weak": WEAK, "stiff": HOST, "fill": HOST},
            rock_bodies=[{"material": "weak"}, {"material": "stiff"}],
            excavations=[excavation(), excavation(1, fill, name="stope") if fill else excavation(-1, name="stope")],
            steps=steps,
            cut_cells=cut_cells,
        )
        model = make_model(scene, grid, shapes, body)
        names = np.array(list(scene.materials))[model.material]
        rock = model.particles.is_rock & np.isin(names, ["host", "weak"])
        assert (model.strength_scale[~rock] == 1.0).all()
        finest = model.grid.cell_level[model.particles.cell] == model.grid.levels - 1
        assert len(np.unique(model.strength_scale[rock & ~finest])) == 1
        deviation = np.sqrt(np.log(1.01))
        assert np.log(model.strength_scale[rock & ~finest]) == pytest.approx(
            COARSE_CELLS * deviation - 0.5 * deviation**2
        )
        assert model.strength_scale[rock & finest].std() == pytest.approx(0.1, rel=0.3)
        found.append((model.strength_scale[model.particles.is_rock], model.particles.count))
        at = np.flatnonzero(rock & finest & (np.diff(model.particles.group_start)[0] == 1))
        if cut_cells == "mean":
            value = field_at(model.grid.cell_center[model.particles.cell[at]], LENGTH, 0)
            assert np.log(model.strength_scale[at]) == pytest.approx(deviation * value - 0.5 * deviation**2, abs=1e-12)
    assert found[1][1] > found[0][1]
    np.testing.assert_array_equal(found[0][0], found[1][0])


def test_uniform_rock_has_no_field():
    for host in (COULOMB, COULOMB | {"variability": {"share": 0.0}}, HOST):
        assert len(make_model(make_scene("xz", host=host), grid_around([], [4, 4], 1, 2.0)).strength_scale) == 0


@settings(deadline=None, max_examples=60)
@given(st.sampled_from(list(ROCKS)), st.floats(0.6, 1.6), st.integers(0, 10_000))
def test_a_scale_is_a_rock_with_strengths_so_scaled(law, scale, seed):
    """Judged, rated and dropped: as rock of scaled intact cohesion, tensile and uniaxial strength."""
    rock, random = ROCKS[law], np.random.default_rng(seed)

    def scaled(part: dict) -> dict:
        return part | {
            key: scaled(value) if key == "planes" else value | {"intact": scale * value["intact"]}
            for key, value in part.items()
            if key in (*STRENGTHS, "planes")
        }

    (intact, residual), (scaled_row, _) = (
        rows_of_all(law, [make_scene(host=host).materials["host"]], (0, 1, 2)) for host in (rock, scaled(rock))
    )
    stress = random.normal(0.0, 20e6, (8, 6)) - np.array([10e6] * 3 + [0.0] * 3)
    zeros, material, to_front = np.zeros((8, 6)), np.zeros(8, np.int16), random.normal(0.0, 1e6, (8, 6))
    every, intact_now, constants = np.arange(8), np.full(8, -1, np.int32), np.array([[20e9, 20e9]])
    results = []
    for rows, factor in ((intact, np.full(8, scale)), (scaled_row, np.empty(0))):
        excess, above, share = np.empty(8), np.empty(8, bool), np.empty(8)
        make_overstress_of(law)(every, stress, zeros, to_front, material, rows, factor, excess)
        make_is_above_strength(law)(every, intact_now, stress, zeros, to_front, material, rows, factor, above)
        make_drop_share(law)(every, stress, zeros, to_front, material, rows, residual, factor, share)
        left, overshoot, seismic, energy = stress.copy(), np.zeros((8, 6)), np.zeros((8, 6)), np.empty((8, 2))
        make_drop(law)(
            every, left, zeros, material, constants, rows, residual, factor, overshoot, seismic, to_front, energy
        )
        rating, shear = np.empty(8), np.empty(8)
        make_rate_strength(law)(every, stress, material, rows, residual, factor, np.zeros(8, bool), rating, shear)
        strain = 60e9 * np.concatenate([overshoot, seismic])
        results.append((np.maximum(excess, 0.0), above, share, left, strain, rating, shear))
    for one, two in zip(*results, strict=True):
        np.testing.assert_allclose(
            one.astype(float), two.astype(float), rtol=1e-6, atol=1e-9 * np.abs(two).max() + 1e-5
        )


def test_rock_fails_at_its_own_strength():
    """Three cells at 0.999, 1.001 and 1.002 of theirs: the last two fail, the last one first."""
    model = make_model(make_scene("xz", host=VARIED), grid_around([], [8, 2], 1, 2.0))
    brittle = find_brittle(model, model.volumes(0), 0, *face_neighbors(model.grid))
    state, cells = model.virgin_state(), np.array([3, 6, 9])
    strength = model.strength_scale[cells] * model.intact_rows[0][2]
    assert np.ptp(strength) > 0.01 * strength.mean()
    state.stress[cells, 0] = -strength * np.array([0.999, 1.001, 1.002])
    assert new_failures(model, state, brittle).tolist() == [6, 9]
    assert above_strength(model, state, np.arange(16)).tolist() == [6, 9]
    excess = strength[1:] * np.array([0.001, 0.002])
    assert weakest(model, state, brittle, cells[1:], 1.0).tolist() == [cells[1:][excess.argmax()]]


def tunnel(tmp_path, realization=None, host=VARIED, **changes):
    """A round void in 12 MPa and less, with brittle rock: state of the step, its facts, the model."""
    shape = ball([24.3, 23.8], 5.0)
    scene = make_scene(
        "xz",
        host=host,
        stress=uniform(-12e6, -9.6e6, -15.6e6),
        excavations=[excavation()],
        solver={"tolerance": 1e-4, "increments": 2} | changes,
        **({} if realization is None else {"realization": realization}),
    )
    grid = grid_around([shape], [6, 6], 4, 8.0, rings=4)
    dataset = make_dataset(scene, grid, [shape])
    elastic, _ = elastic_stage(replace(scene, realization=0), dataset, tmp_path / "failed.npz")
    state, facts = mining_step(scene, dataset, elastic, tmp_path / "failed.npz")
    return state, facts, make_model(scene, grid, [shape])


def test_a_slice_without_the_key_is_the_mines_own_run(tmp_path):
    plain, zero, one = (tunnel(tmp_path, number)[0] for number in (None, 0, 1))
    assert (plain.failed.values >= 0).any()
    assert zero.identical(plain)
    assert not one.identical(plain)


def test_without_variability_all_members_are_the_same(tmp_path):
    first, second = (tunnel(tmp_path, number, COULOMB)[0] for number in (0, 7))
    assert first.identical(second)


def test_the_same_bits_on_one_thread_and_two(tmp_path, monkeypatch):
    monkeypatch.setattr(block_scatter, "CELLS_PER_BLOCK", 16)
    results = []
    for threads in (1, min(2, numba.config.NUMBA_NUM_THREADS)):
        numba.set_num_threads(threads)
        results.append(tunnel(tmp_path, 1)[0])
    assert results[0].identical(results[1])


@pytest.mark.parametrize("scheme", ["multigrid", "explicit"])
def test_after_the_cascade_no_rock_stands_above_its_own_strength_and_failed_rock_is_residual(tmp_path, scheme):
    """The drop is from the stress that was reached, whatever the strength: it ends inside residual strength."""
    state, facts, model = tunnel(tmp_path, 0, scheme=scheme)
    stress, failed = state.stress.values[:, [0, 2, 1, 3, 5, 4]], state.failed.values
    brittle = find_brittle(model, state.volume.values, 0, *face_neighbors(model.grid))
    assert facts["failed_particles"] > 20
    row, beyond = model.intact_rows[0], 0
    for p in brittle.sound[failed[brittle.sound] < 0]:
        scale = model.strength_scale[p]
        margin = scale * strength_margin(row, model.insitu[p], stress[p]) + 1.0
        assert scale * overstress(*(stress[p] / scale), row) <= 1.1 * margin
        beyond += overstress(*stress[p], row) > 1e4
        assert state.strength_factor.values[p] >= 1.0 - 1e-4
    assert beyond  # some rock bears more than its material would
    for p in np.flatnonzero((failed >= 0) & (state.volume.values > 0.0)):
        assert overstress(*stress[p], model.residual_rows[0]) <= 1.0


@pytest.mark.parametrize("share", [0.1, 0.5])
def test_virgin_rock_stands_in_every_realization_and_none_at_its_limit(share):
    """At 0 to 1 - 1e-4 of its strength: what is left is the field's distribution above what the stress needs."""
    host = COULOMB | {"variability": {"share": share, "length": LENGTH}}
    grid = grid_around([], [64, 64], 1, 2.0)
    strength = make_model(make_scene("xz", host=host), grid).intact_rows[0][2]
    deviation = np.sqrt(np.log(1.0 + share**2))
    for realization in range(3):
        free = make_model(make_scene("xz", host=host, realization=realization), grid).strength_scale
        for part in (0.3, 0.9, 1.0 - 1e-4):
            scene = make_scene("xz", host=host, stress=uniform(-part * strength, 0.0, 0.0), realization=realization)
            model = make_model(scene, grid)
            brittle = find_brittle(model, model.volumes(0), 0, *face_neighbors(model.grid))
            assert len(new_failures(model, model.virgin_state(), brittle)) == 0
            assert len(near_strength(model, model.virgin_state(), np.arange(len(free))).nonzero()[0]) == 0
            scale = model.strength_scale
            assert scale.min() > part - 1e-6
            assert (np.argsort(scale) == np.argsort(free)).all()  # weak places stay the weak ones
            own = np.sort(np.random.default_rng(0).lognormal(-0.5 * deviation**2, deviation, 200_000))
            expected = own[own > part]
            assert np.mean(scale) == pytest.approx(expected.mean(), rel=0.15 * share)
            assert np.mean(scale < part + 0.01) == pytest.approx(np.mean(expected < part + 0.01), abs=0.03)
