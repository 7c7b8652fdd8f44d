"""Members of an ensemble: rock fails a little later, by a number of its place, and is taken out in other parts."""

from dataclasses import replace
from pathlib import Path

import numba
import numpy as np
import pytest
from hypothesis import given
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
from mpm_core.constitutive.laws.coulomb import overstress
from mpm_core.equilibrium.brittle import above_strength, find_brittle, new_failures, weakest
from mpm_core.equilibrium.perturbation import MAX_STRENGTH_PERTURBATION, delays, strength_perturbation
from mpm_core.grid.adjacency import face_neighbors
from mpm_core.kernels import block_scatter
from mpm_core.stages.equilibrium_stages import elastic_stage, mining_step

ROOT = Path(__file__).resolve().parents[2]
WEAK = COULOMB | {"cohesion": {"intact": 1e6, "residual": 0.5e6}}


@pytest.mark.parametrize("cut_cells", ["mean", "subdivide"])
def test_numbers_are_one_sided_bounded_and_of_the_place_alone(cut_cells):
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
            materials={"host": COULOMB, "weak": WEAK, "stiff": HOST, "fill": HOST},
            rock_bodies=[{"material": "weak"}, {"material": "stiff"}],
            excavations=[excavation(), excavation(1, fill, name="stope") if fill else excavation(-1, name="stope")],
            steps=steps,
            cut_cells=cut_cells,
        )
        model = make_model(scene, grid, shapes, body)
        assert (strength_perturbation(model) == 0.0).all()
        first, second = (strength_perturbation(replace(model, scene=replace(scene, perturbation=k))) for k in (1, 2))
        names = np.array(list(scene.materials))[model.material]
        for name, cohesion in (("host", 2e6), ("weak", 1e6)):
            share = first[model.particles.is_rock & (names == name)] / cohesion
            assert ((share >= 0.0) & (share < MAX_STRENGTH_PERTURBATION)).all()
            assert share.mean() == pytest.approx(0.5 * MAX_STRENGTH_PERTURBATION, rel=0.15)
        assert (first[(names == "stiff") | (names == "fill")] == 0.0).all()
        assert (first != second).any()
        found.append((first[model.particles.is_rock], second[model.particles.is_rock], model.particles.count))
    assert found[1][2] > found[0][2]
    for earlier, later in zip(found[0][:2], found[1][:2], strict=True):
        np.testing.assert_array_equal(earlier, later)


def test_a_member_fails_what_stands_above_its_own_threshold():
    """Three cells above strength by 0, 1/2 and 3/2 of what the member bears there: the last fails.

    Rated, all are above; the weakest is the one furthest above its own threshold."""
    scene = replace(make_scene("xz", host=COULOMB), perturbation=3)
    model = make_model(scene, grid_around([], [8, 2], 1, 2.0))
    brittle = find_brittle(model, model.volumes(0), 0, *face_neighbors(model.grid))
    state, cells = model.virgin_state(), np.array([3, 6, 9])
    row = model.intact_rows[0]
    threshold = brittle.tolerated_overstress[cells] + strength_margin(row, [0.0] * 6, [-row[2], 0, 0, 0, 0, 0])
    state.stress[cells, 0] = -(row[2] + np.array([0.0, 0.5, 1.5]) * threshold)
    assert new_failures(model, state, brittle).tolist() == [9]
    state.stress[cells, 0] -= 1e6
    assert above_strength(model, state, np.arange(16)).tolist() == cells.tolist()
    assert new_failures(model, state, brittle).tolist() == cells.tolist()
    above = 1e6 + np.array([0.0, 0.5, 1.5]) * threshold
    for allowed, expected in (
        (None, above),
        (brittle.tolerated_overstress, above - brittle.tolerated_overstress[cells]),
    ):
        chosen = replace(brittle, tolerated_overstress=allowed)
        assert weakest(model, state, chosen, cells, 1.0).tolist() == [cells[expected.argmax()]]


@given(st.integers(1, 1000), st.integers(0, 30), st.integers(1, 20))
def test_increments_keep_their_order_and_end_where_the_step_ends(member, step, increments):
    """Whatever the member: all is changed in the end, nothing is put back on the way, no two steps are alike."""
    scene = make_scene(perturbation=member)
    late = delays(scene, step, increments)
    ends = np.arange(increments + 1) + late
    assert (np.diff(ends) > 0.0).all()
    assert (ends[0], ends[-1]) == (0.0, increments)
    assert (np.abs(late) <= 0.5).all()
    assert (delays(replace(scene, perturbation=0), step, increments) == 0.0).all()
    neighbor = replace(scene, perturbation=member + 1)
    for other in (delays(scene, step + 1, increments), delays(neighbor, step, increments)):
        assert (late[1:-1] != other[1:-1]).all()


def test_where_nothing_fails_a_member_ends_where_the_mines_own_run_does(tmp_path):
    """Elastic rock, a void mined and the boundary strained in three increments: displacements differ by 1e-5 of them,
    which is the tolerance; half an increment of either would be a sixth."""
    shape, strain = ball([12.0, 12.0], 3.0), [0.0, 0.0, -1e-4, 0.0, 0.0, 0.0]
    scene = make_scene(
        "xz",
        stress=uniform(-10e6, -10e6, -10e6),
        excavations=[excavation(1)],
        strains=[{"name": "press", "since": 1, "strain": strain}],
        steps=2,
        solver={"tolerance": 1e-7, "cascade_tolerance": 1e-4, "increments": 3},
    )
    grid = make_dataset(scene, grid_around([shape], [6, 6], 1, 4.0), [shape])
    elastic, _ = elastic_stage(scene, grid, tmp_path / "failed.npz")
    own, member = (
        mining_step(replace(scene, perturbation=k), grid, elastic, tmp_path / "failed.npz")[0].displacement
        for k in (0, 1)
    )
    np.testing.assert_allclose(member, own, rtol=0, atol=1e-5 * np.abs(own).max())
    assert not member.identical(own)


def tunnel(tmp_path, member: int | None):
    """A round void in 12 MPa and less, with brittle rock: state of the step, its facts, the model."""
    shape = ball([24.3, 23.8], 5.0)
    changes = {} if member is None else {"perturbation": member}
    scene = make_scene(
        "xz",
        host=COULOMB,
        stress=uniform(-12e6, -9.6e6, -15.6e6),
        excavations=[excavation()],
        solver={"tolerance": 1e-4, "increments": 2},
        **changes,
    )
    grid = grid_around([shape], [6, 6], 4, 8.0, rings=4)
    dataset = make_dataset(scene, grid, [shape])
    elastic, _ = elastic_stage(replace(scene, perturbation=0), dataset, tmp_path / "failed.npz")
    state, facts = mining_step(scene, dataset, elastic, tmp_path / "failed.npz")
    return state, facts, make_model(scene, grid, [shape])


def test_member_zero_is_the_run_without_members_to_the_last_bit(tmp_path):
    plain, zero, one = (tunnel(tmp_path, member)[0] for member in (None, 0, 1))
    assert (plain.failed.values >= 0).any()
    assert zero.identical(plain)
    assert not one.identical(plain)


def test_a_member_has_the_same_bits_on_one_thread_and_two(tmp_path, monkeypatch):
    monkeypatch.setattr(block_scatter, "CELLS_PER_BLOCK", 16)
    results = []
    for threads in (1, min(2, numba.config.NUMBA_NUM_THREADS)):
        numba.set_num_threads(threads)
        results.append(tunnel(tmp_path, 1)[0])
    assert results[0].identical(results[1])


def test_after_a_members_cascade_no_rock_stands_above_its_threshold_and_failed_rock_is_residual(tmp_path):
    """The drop is from the stress that was reached, whatever the threshold: it ends inside residual strength."""
    state, facts, model = tunnel(tmp_path, 2)
    stress, failed = state.stress.values[:, [0, 2, 1, 3, 5, 4]], state.failed.values
    brittle = find_brittle(model, state.volume.values, 0, *face_neighbors(model.grid))
    assert facts["failed_particles"] > 20
    row = model.intact_rows[0]
    for p in brittle.sound[failed[brittle.sound] < 0]:
        threshold = brittle.tolerated_overstress[p] + strength_margin(row, model.insitu[p], stress[p]) + 1.0
        assert overstress(*stress[p], row) <= threshold
    for p in np.flatnonzero((failed >= 0) & (state.volume.values > 0.0)):
        assert overstress(*stress[p], model.residual_rows[0]) <= 1.0


def test_virgin_rock_just_below_strength_stands_in_every_member():
    """1 kPa below: no number can make it fail before anything is mined."""
    scene = make_scene("xz", host=COULOMB)
    row = make_model(scene, grid_around([], [4, 4], 1, 2.0)).intact_rows[0]
    scene = make_scene("xz", host=COULOMB, stress=uniform(-(row[2] - 1e3), 0.0, 0.0))
    for member in range(4):
        model = make_model(replace(scene, perturbation=member), grid_around([], [4, 4], 1, 2.0))
        brittle = find_brittle(model, model.volumes(0), 0, *face_neighbors(model.grid))
        assert len(brittle.sound) == 16
        assert len(new_failures(model, model.virgin_state(), brittle)) == 0


def test_a_slice_without_the_key_is_the_mines_own_run():
    """So that an ensemble changes nothing of what stands."""
    assert make_scene().perturbation == 0
    assert make_scene(perturbation=4).perturbation == 4


def test_the_method_page_states_the_largest_overstress():
    page = (ROOT / "docs/explanation/failure-and-increments.md").read_text(encoding="utf-8")
    assert f"bears up to {100 * MAX_STRENGTH_PERTURBATION:g} % of its cohesion more" in " ".join(page.split())
