"""The brittle cascade: what fails, in which order, what it leaves, and how it may end in an error."""

from dataclasses import replace

import numba
import numpy as np
import pytest

from common.errors import InputError
from mechanics.scenes import (
    COULOMB,
    ball,
    excavation,
    grid_around,
    make_dataset,
    make_model,
    make_scene,
    strength_margin,
    uniform,
)
from mpm_core.constitutive.elastic import strain_from_stress
from mpm_core.constitutive.laws.coulomb import overstress
from mpm_core.equilibrium.body import FAILED_HOURGLASS_SHARE
from mpm_core.equilibrium.brittle import above_strength, fail, find_brittle, new_failures, weakest
from mpm_core.equilibrium.cascade import Ramp, run_cascade
from mpm_core.equilibrium.convergence import History
from mpm_core.equilibrium.explicit_scheme import ExplicitScheme
from mpm_core.files.state_datasets import read_grid, read_pieces
from mpm_core.grid.adjacency import face_neighbors, holding_cells
from mpm_core.kernels import block_scatter
from mpm_core.model.state import HOURGLASS, OVERSHOOT, SEISMIC
from mpm_core.stages.equilibrium_stages import SolutionMonitor, elastic_stage, mining_step

PLANES = {2: "xz", 3: None}


@pytest.mark.parametrize("dimension", [2, 3])
def test_a_single_overstressed_cell_fails_once(dimension):
    """One cell of a block under 10 MPa all round carries 40 MPa along x (strength there 37), held by nodal forces: it
    alone fails, in increment 1, generation 0; it ends inside residual strength; overshoot + seismic strain is the
    compliance times the first drop; its hourglass stiffness falls to 1 %."""
    scene = make_scene(PLANES[dimension], host=COULOMB, stress=uniform(-10e6, -10e6, -10e6))
    model = make_model(scene, grid_around([], [5] * dimension, 1, 2.0))
    state, volume = model.virgin_state(), model.volumes(0)
    cell = int(np.argmin(np.abs(model.grid.cell_center - 5.0).sum(axis=1)))
    state.stress[cell] = [-30e6, 0.5e6, -1e6, 0.0, 0.0, 1e6]
    trial = state.stress[cell] + model.insitu[cell]
    scheme = ExplicitScheme(model, state, volume)
    hourglass = scheme.body.hourglass[cell]
    hold = -scheme.body.internal_force()
    brittle = find_brittle(model, volume, 0, *face_neighbors(model.grid))
    history = History(1e-5)
    ramp = Ramp(hold, hold, np.zeros((dimension, dimension)), float(np.linalg.norm(hold)))
    run_cascade(scheme, brittle, ramp, 0, history)

    assert np.flatnonzero(state.failed >= 0).tolist() == [cell]
    assert state.failure_order[cell].tolist() == [1, 0]
    assert history.table()["new_failures"].sum() == 1
    row = model.residual_rows[0]
    assert overstress(*(state.stress[cell] + model.insitu[cell]), row) <= 1.0  # Pa
    lame, shear = model.elastic_constants[0]
    first = state.overshoot_strain[cell] + state.seismic_strain[cell]
    for strain in (state.overshoot_strain[cell], state.seismic_strain[cell]):
        assert np.abs(strain).max() > 0.0
    # trial - C first is on the residual surface
    tensor = lame * first[:3].sum() * np.array([1, 1, 1, 0, 0, 0]) + 2 * shear * first
    assert overstress(*(trial - tensor), row) == pytest.approx(0.0, abs=1.0)
    np.testing.assert_allclose(strain_from_stress(lame, shear, *tensor), first, atol=1e-12)
    assert state.energy[SEISMIC] > 0.0
    assert state.energy[OVERSHOOT] > 0.0
    assert state.energy[HOURGLASS] == 0.0
    assert scheme.body.hourglass[cell] == pytest.approx(FAILED_HOURGLASS_SHARE * hourglass)


def tunnel(tmp_path, *, stress=-15e6, solver=None, host=COULOMB, dimension=2, levels=2, **changes):
    """Round void in all-round stress, elastic and then brittle: scene, grid dataset, elastic state, path of failed."""
    shape = ball([24.0] * dimension, 5.0)
    scene = make_scene(
        PLANES[dimension],
        host=host,
        stress=uniform(*[stress] * 3),
        excavations=[excavation()],
        solver={"tolerance": 1e-4} | (solver or {}),
        **changes,
    )
    grid = make_dataset(scene, grid_around([shape], [6] * dimension, levels, 8.0, rings=2), [shape])
    elastic, _ = elastic_stage(
        replace(scene, solver=scene.solver.model_copy(update={"max_iterations": 40000})), grid, tmp_path / "e.npz"
    )
    return scene, grid, elastic, tmp_path / "step.failed.npz"


@pytest.mark.parametrize("per_edge", [1, 2])
def test_after_the_cascade_no_rock_that_may_fail_is_above_strength(per_edge, tmp_path):
    """All-round 15 MPa against 6.9 MPa uniaxial strength: several generations. Then intact rock of the finest cells is
    below peak strength plus the margin, failed rock inside residual strength, and the strains add up."""
    scene, grid, elastic, path = tunnel(tmp_path, particles_per_cell=per_edge, levels=3)
    state, facts = mining_step(scene, grid, elastic, path)
    assert not path.exists()
    model = make_model(scene, grid_around([], [1, 1], 1, 8.0))  # for its strength rows alone
    stress, failed = state.stress.values[:, [0, 2, 1, 3, 5, 4]], state.failed.values
    assert facts["failed_particles"] > 20
    assert state.failure_order.values[:, 1].max() > 0
    level = grid.cell_level.values[state.cell.values]
    share = np.ones(len(grid.cell_level))
    share[holding_cells(read_grid(grid)[0], read_pieces(grid).place)] -= grid.piece_fraction.values
    present = state.volume.values > 0.0
    eligible = present & (level == 2) & (share[state.cell.values] >= 0.5)
    for p in np.flatnonzero(eligible & (failed < 0)):
        row = model.intact_rows[0]
        assert overstress(*stress[p], row) <= strength_margin(row, [-15e6] * 3 + [0.0] * 3, stress[p]) + 1.0
    for p in np.flatnonzero(present & (failed >= 0)):
        assert overstress(*stress[p], model.residual_rows[0]) <= 1.0
    assert (level[failed >= 0] == 2).all()
    total = state.seismic_strain + state.overshoot_strain + state.later_strain
    np.testing.assert_allclose(state.plastic_strain_step, total, rtol=0, atol=1e-15)
    np.testing.assert_allclose(state.plastic_strain, total, rtol=0, atol=1e-15)
    assert (state.plastic_strain.values[failed < 0] == 0.0).all()
    assert (state.failure_order.values[failed < 0] == -1).all()
    assert facts["energy_dissipated"] > 0.0


@pytest.mark.parametrize("scale", [2.0**-13, 2.0**13])
def test_rock_of_other_strength_and_stress_fails_alike(scale, tmp_path):
    """Moduli, strengths and stress times a power of two: the same rock fails in the same order, and stress and
    motion are those of the first scene, scaled, to the tolerance of the solution (1e-4), between generations, too: the
    stress by which rock drops is that of an equilibrium."""
    solver = {"scheme": "multigrid", "cascade_tolerance": 1e-5}
    scaled = COULOMB | {
        "youngs_modulus": scale * COULOMB["youngs_modulus"],
        **{
            key: {state: scale * value for state, value in COULOMB[key].items()}
            for key in ("cohesion", "tension_cutoff")
        },
    }
    first, _ = mining_step(*tunnel(tmp_path, solver=solver))
    other, _ = mining_step(*tunnel(tmp_path, solver=solver, stress=-15e6 * scale, host=scaled))
    assert (first.failed.values >= 0).sum() > 20
    for name in ("failed", "failure_order"):
        np.testing.assert_array_equal(other[name], first[name], err_msg=name)
    for name, factor in (("seismic_strain", 1.0), ("node_displacement", 1.0), ("stress", scale)):
        expected = first[name].values * factor
        np.testing.assert_allclose(other[name], expected, rtol=0, atol=1e-4 * np.abs(expected).max(), err_msg=name)


def test_slivers_fail_only_beside_failed_rock():
    """A cut cell less than half rock and far above strength: intact while its neighbours are, then failing."""
    shape = ball([24.0, 24.0], 6.6)
    scene = make_scene("xz", host=COULOMB, excavations=[excavation()])
    model = make_model(scene, grid_around([shape], [6, 6], 2, 8.0, rings=2), [shape])
    state, volume = model.virgin_state(), model.volumes(0)
    neighbors = face_neighbors(model.grid)
    brittle = find_brittle(model, volume, 0, *neighbors)
    assert len(brittle.sliver)
    assert (model.rock_share(0)[model.particles.cell[brittle.sliver]] < 0.5).all()
    sliver = brittle.sliver[0]
    state.stress[sliver] = [-50e6, 0, 0, 0, 0, 0]
    assert len(new_failures(model, state, brittle)) == 0
    start, indices = neighbors
    beside = indices[start[model.particles.cell[sliver]] : start[model.particles.cell[sliver] + 1]]
    rock = next(p for p in brittle.sound if model.particles.cell[p] in beside)
    state.stress[rock] = [-50e6, 0, 0, 0, 0, 0]
    assert new_failures(model, state, brittle).tolist() == sorted([sliver, rock])
    gone = replace(brittle, present=np.zeros_like(brittle.present))
    state.failed[rock] = 0
    assert new_failures(model, state, gone).tolist() == []  # what failed there has been mined since
    state.failed[rock] = -1
    scheme = ExplicitScheme(model, state, volume)
    state.hourglass_force[:] = 1.0
    fail(scheme.body, brittle, np.array([rock]), 0, 2, 3)
    assert state.failure_order[rock].tolist() == [2, 3]
    assert (state.hourglass_force[model.particles.cell[rock]] == 0.0).all()
    assert (state.hourglass_force[model.particles.cell[sliver]] == 1.0).all()
    assert new_failures(model, state, brittle).tolist() == [sliver]


@pytest.mark.parametrize("share", [0.0, 0.4, 1.0])
def test_the_weakest_fail_first(share):
    """Three lone cells above strength by 1, 2 and 4 MPa: all, those of 2 and 4, or the last alone."""
    model = make_model(make_scene("xz", host=COULOMB), grid_around([], [8, 2], 1, 2.0))
    state = model.virgin_state()
    above = np.array([3, 6, 9])
    state.stress[above, 0] = -(model.intact_rows[0][2] + np.array([1e6, 2e6, 4e6]))
    assert above_strength(model, state, np.arange(16)).tolist() == above.tolist()
    expected = {0.0: above, 0.4: above[1:], 1.0: above[2:]}[share]
    brittle = find_brittle(model, model.volumes(0), 0, *face_neighbors(model.grid))
    assert weakest(model, state, brittle, above, share).tolist() == expected.tolist()


def test_whichever_fails_first_the_cascade_ends_at_rest(tmp_path):
    """A tunnel, the weakest first: more generations, no more failures, and in the end nothing stands above strength."""
    counts, generations = [], []
    for share in (0.0, 0.9):
        scene, grid, elastic, path = tunnel(tmp_path, solver={"weakest_first": share})
        state, facts = mining_step(scene, grid, elastic, path)
        assert facts["collapsed"] == 0
        assert facts["unbalanced_ratio"] <= 1e-4
        counts.append(facts["failed_particles"])
        generations.append(state.failure_order.values[:, 1].max())
        fine = (grid.cell_level.values == 1)[state.cell.values] & (state.volume.values > 0.9 * 16.0)
        assert (state.strength_factor.values[fine & (state.failed.values < 0)] > 0.99).all()
    assert 0 < counts[1] <= counts[0]
    assert generations[1] > generations[0]


def test_a_perfectly_plastic_tunnel_closes_alike_in_two_parts_and_in_many(tmp_path):
    """Rock that loses no strength has one answer, whatever the increments: at rest as if elastic before it yields, its
    wall moves 0.7 % further in two increments than in thirty-two. (Not the largest motion of all, which is that of
    slivers in the wall.)"""
    strength = ("friction_angle", "cohesion", "tension_cutoff")
    plastic = COULOMB | {key: dict.fromkeys(("intact", "residual"), COULOMB[key]["intact"]) for key in strength}
    void, zone = ball([24.0] * 2, 5.0), ball([24.0] * 2, 9.0)
    closures = []
    for increments in (2, 32):
        options = {
            "host": plastic,
            "stress": uniform(*[-15e6] * 3),
            "solver": {"scheme": "multigrid", "tolerance": 1e-5, "cascade_tolerance": 1e-3, "increments": increments},
        }
        planned = excavation(-1, None, name="zone")
        before = make_scene("xz", excavations=[excavation(-1, None), planned], steps=1, **options)
        scene = make_scene("xz", excavations=[excavation(1, None), planned], steps=2, **options)
        grid = make_dataset(scene, grid_around([void, zone], [6] * 2, 4, 8.0, rings=2), [void, zone])
        state, _ = elastic_stage(before, grid, tmp_path / "failed.npz")
        for scene_of_step in (before, scene):
            state, facts = mining_step(scene_of_step, grid, state, tmp_path / "failed.npz")
        assert facts["failed_particles"] > 100
        out = state.node_position.values - np.array([24.0, 0.0, 24.0])
        distance = np.linalg.norm(out, axis=1)
        wall = (distance > 5.0) & (distance < 6.0)
        closures.append(-np.sum(state.node_displacement.values * out, axis=1)[wall] @ (1.0 / distance[wall]))
    assert closures[0] == pytest.approx(closures[1], rel=3e-3)


def test_a_cascade_has_the_same_bits_on_one_thread_and_two(tmp_path, monkeypatch):
    """Elastic state, cascade and final state, blocks of 16 cells."""
    monkeypatch.setattr(block_scatter, "CELLS_PER_BLOCK", 16)
    results = []
    for threads in (1, min(2, numba.config.NUMBA_NUM_THREADS), 1):
        numba.set_num_threads(threads)
        scene, grid, elastic, path = tunnel(tmp_path)
        results.append(mining_step(scene, grid, elastic, path)[0])
    assert (results[0].failed >= 0).any()
    for other in results[1:]:
        assert results[0].identical(other)


@pytest.mark.parametrize(
    ("solver", "host", "message"),
    [
        ({"max_generations": 1}, COULOMB, "generations"),
        ({"max_iterations": 5}, COULOMB, "no convergence"),
    ],
)
def test_limits_end_with_a_line_and_the_last_state(solver, host, message, tmp_path):
    scene, grid, elastic, path = tunnel(tmp_path, solver=solver, host=host)
    with pytest.raises(InputError, match=message):
        mining_step(scene, grid, elastic, path)
    with np.load(path) as last:
        assert last["stress"].shape == (elastic.sizes["particle"], 6)
        assert len(last["unbalanced_ratio"]) == len(last["iteration"]) > 0


def test_an_error_while_cells_are_split_is_told_though_there_is_no_state_to_keep(tmp_path):
    watched = SolutionMonitor(make_scene(None, host=COULOMB), "step", tmp_path / "failed.npz", lambda: None)
    with pytest.raises(InputError, match="the reason"), watched:
        raise InputError("the reason")
    assert not (tmp_path / "failed.npz").exists()


def test_a_state_that_is_not_a_number_is_an_error(tmp_path):
    scene, grid, elastic, path = tunnel(tmp_path)
    elastic.stress[int(np.argmax(elastic.volume.values > 0)), 0] = np.nan
    with pytest.raises(InputError, match="not a number"):
        mining_step(scene, grid, elastic, path)
    assert path.exists()


def test_rock_that_runs_away_is_an_error(tmp_path):
    """Rock of 1 MPa stiffness under 15 MPa closes a 10 m void by metres."""
    with pytest.raises(InputError, match="runs away"):
        tunnel(tmp_path, host={**COULOMB, "youngs_modulus": 1e6})
    assert (tmp_path / "e.npz").exists()
