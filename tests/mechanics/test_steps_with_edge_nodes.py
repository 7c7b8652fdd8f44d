"""Stages of mines whose edges lie within cells, so that nodes are moved onto them: what must hold all the same."""

import numba
import numpy as np
import pytest

from common.datasets import write_dataset
from mechanics.killed import Killed, KilledAfter
from mechanics.scenes import COULOMB, excavation, make_scene, uniform
from mechanics.test_grid_stage import block, grid_slice
from mpm_core.equilibrium.body import Body
from mpm_core.files.state_datasets import read_edge_nodes, read_grid
from mpm_core.model.occupancy import Unsupported
from mpm_core.stages import step_subdomain
from mpm_core.stages.checkpoint import Checkpoint
from mpm_core.stages.equilibrium_stages import elastic_stage, mining_step
from mpm_core.stages.grid_stage import make_grid
from mpm_core.stages.ground import Ground

STRESS = uniform(-25e6, -16e6, -14e6, 0.0, 3e6)
TIGHT = {"scheme": "multigrid", "tolerance": 1e-8}
BRITTLE = {"scheme": "multigrid", "tolerance": 1e-5, "cascade_tolerance": 1e-3, "increments": 3}
LOOSE = BRITTLE | {"tolerance": 1e-3, "cascade_tolerance": 1e-2}  # for comparisons of bits
ADAPTIVE = {"rings": 1, "max_cells": 10**6, "bodies": []}
OPENING = [7.3] * 3, [15.6, 14.9, 15.2]
NEIGHBOUR = [15.6, 8.4, 7.3], [19.4, 14.9, 13.1]
SIZE = {"plane": "xz", "coarse_cell": 4.0, "levels": 3, "volume_error": 1.0}


def boxes_of(*boxes, plane="xz"):
    """Blocks in the scene's axes."""
    axes = [0, 2] if plane else [0, 1, 2]
    corners = [[[float(bound[axis]) for axis in axes] for bound in box] for box in boxes]
    return [block(*box, name=f"e{number}") for number, box in enumerate(corners)]


def grid_of(*boxes, later=(), domain=24.0, **changes):
    values = SIZE | changes
    plane, levels = values.pop("plane"), values.pop("levels")
    made = grid_slice(*boxes_of(*boxes, plane=plane), plane=plane, levels=levels, **values)
    made["domain"]["upper"] = [domain] * (2 if plane else 3)
    return make_grid(made | {"later": list(later)}, {})


def states_of(folder, grid, mined, plane="xz", **options):
    """State and facts of the elastic stage and of every step; mined: step of each excavation."""
    options = {"stress": STRESS, "solver": TIGHT} | options
    states = []
    for last in range(max(mined) + 1):
        entries = [excavation(step if step <= last else -1, name=f"e{k}") for k, step in enumerate(mined)]
        scene = make_scene(plane, excavations=entries, steps=last + 1, **options)
        if not states:
            states.append(elastic_stage(scene, grid, folder / "failed.npz"))
        states.append(mining_step(scene, grid, states[-1][0], folder / "failed.npz"))
    return states


def model_of(grid, plane):
    scene = make_scene(plane, excavations=[excavation()], stress=STRESS)
    own, body = read_grid(grid)
    return Ground.of(scene, grid).model(own, body, Unsupported.none())


@pytest.mark.parametrize("plane", ["xz", None])
def test_a_uniform_strain_gives_a_uniform_stress_in_distorted_cells(plane):
    """The patch test of a mine: to round-off, in every particle, without any hourglass force.

    Rock at edges is softer (edge_factor.py): its stress is divided by that.
    """
    model = model_of(grid_of(OPENING, plane=plane), plane)
    assert len(model.particles.distorted.cell) > 8
    assert (np.abs(model.node_shift).max(axis=1) > 0.2).any()
    body = Body(model, model.virgin_state(), model.volumes(0))
    d = model.dimension
    strain = 1e-4 * np.array([[1.0, 0.3, -0.2], [0.3, -2.0, 0.5], [-0.2, 0.5, 0.7]])[:d, :d]
    body.displace(model.node_position @ strain)
    shear = model.elastic_constants[model.particles.material, 1]
    stress = (body.state.stress / (shear / shear.max())[:, None] - model.insitu)[body.volume > 0.0]
    np.testing.assert_allclose(stress, np.broadcast_to(stress[0], stress.shape), atol=1e-12 * np.abs(stress).max())
    assert np.abs(body.state.hourglass_force).max() < 1e-11 * np.abs(stress).max() * model.grid.fine_cell ** (d - 1)


@pytest.mark.parametrize("plane", ["xz", None])
def test_both_schemes_give_the_same_elastic_rock(plane, tmp_path):
    grid = grid_of(OPENING, plane=plane)
    ways = [
        states_of(tmp_path, grid, (0,), plane, solver={"scheme": scheme, "tolerance": 1e-8})[-1]
        for scheme in ("explicit", "multigrid")
    ]
    (one, facts), (other, of_other) = ways
    present = one.volume.values > 0.0
    np.testing.assert_allclose(other.stress.values[present], one.stress.values[present], rtol=0, atol=1e-4 * 25e6)
    assert facts["energy_released"] == pytest.approx(of_other["energy_released"], rel=1e-4)


def mirrored(box, axis):
    lower, upper = (np.array(bound) for bound in box)
    lower[axis], upper[axis] = 24.0 - upper[axis], 24.0 - lower[axis]
    return lower.tolist(), upper.tolist()


@pytest.mark.parametrize("axis", [0, 2])
def test_a_mirrored_mine_has_mirrored_edge_nodes_and_fails_alike(axis, tmp_path):
    """Stress without shear is its own mirror image. Elastic to 1e-6, brittle in the same cells."""
    found = []
    for box in (OPENING, mirrored(OPENING, axis)):
        grid = grid_of(box)
        nodes = read_edge_nodes(grid)
        stress = uniform(-25e6, -16e6, -14e6)
        elastic = states_of(tmp_path, grid, (0,), stress=stress)[-1][1]["energy_released"]
        state, _ = states_of(tmp_path, grid, (0,), stress=stress, host=COULOMB, solver=BRITTLE)[-1]
        failed = state.position.values[(state.failed.values >= 0) & (state.volume.values > 0.0)]
        found.append((nodes, elastic, failed[:, [0, 2]]))
    (nodes, elastic, failed), (others, of_other, of_others) = found
    index = {0: 0, 2: 1}[axis]
    place, shift = others.place.copy(), others.shift.copy()
    place[:, index], shift[:, index] = 24 - place[:, index], -shift[:, index]
    order, own = np.lexsort(place.T), np.lexsort(nodes.place.T)
    np.testing.assert_array_equal(place[order], nodes.place[own])
    np.testing.assert_allclose(shift[order], nodes.shift[own], atol=1e-9)
    assert elastic == pytest.approx(of_other, rel=1e-6)
    of_others[:, index] = 24.0 - of_others[:, index]
    assert len(failed) > 10
    np.testing.assert_allclose(
        failed[np.lexsort(np.round(failed.T, 6))], of_others[np.lexsort(np.round(of_others.T, 6))], atol=1e-6
    )


@pytest.mark.parametrize("later", [(), (1,)], ids=["fine cells from the start", "fine cells when mined"])
def test_elastic_rock_forgets_the_order_of_mining(later, tmp_path):
    """Two openings side by side, mined at once or one after the other; the nodes of both are moved from the start on,
    or when the cells around them are split. 1e-5 of the stress."""
    refinement = ADAPTIVE if later else None
    once = states_of(tmp_path, grid_of(OPENING, NEIGHBOUR), (0, 0))[-1][0]
    grid = grid_of(OPENING, NEIGHBOUR, later=later)
    twice = states_of(tmp_path, grid, (0, 1), refinement=refinement)[-1][0]
    finest = [
        {tuple(np.round(place, 6)): k for k, place in enumerate(state.position.values) if state.volume.values[k] > 0.0}
        for state in (once, twice)
    ]
    shared = finest[0].keys() & finest[1].keys()
    assert len(shared) > 0.9 * len(finest[0])
    one, other = ([own[place] for place in shared] for own in finest)
    gap = np.abs(once.stress.values[one] - twice.stress.values[other])
    assert gap.max() < (1e-5 if not later else 0.02) * 25e6
    assert np.median(gap.max(axis=1)) < (1e-5 if not later else 1e-3) * 25e6


@pytest.mark.parametrize("refinement", [None, ADAPTIVE])
@pytest.mark.parametrize("scheme", ["multigrid", "explicit"])
def test_the_balance_closes_where_rock_fails(scheme, refinement, tmp_path):
    grid = grid_of(OPENING, NEIGHBOUR, later=[1] if refinement else [])
    states = states_of(tmp_path, grid, (0, 1), host=COULOMB, solver=BRITTLE | {"scheme": scheme}, refinement=refinement)
    for _, facts in states[1:]:
        assert facts["failed_particles"] > 10
        assert facts["energy_left_share"] < 1e-9


@pytest.mark.parametrize("generations", [1, 6])
def test_a_killed_step_goes_on_and_ends_in_the_same_bytes(generations, tmp_path):
    grid = grid_of(OPENING, NEIGHBOUR, later=[1])
    options = {"host": COULOMB, "stress": STRESS, "solver": LOOSE, "refinement": ADAPTIVE}
    before = states_of(tmp_path, grid, (0, -1), **{k: options[k] for k in ("host", "solver", "refinement")})[-1][0]
    entries = [excavation(0, name="e0"), excavation(1, name="e1")]
    scene = make_scene("xz", excavations=entries, steps=2, **options)

    def run(checkpoint=None):
        return mining_step(scene, grid, before, tmp_path / "failed.npz", checkpoint)[0]

    path = tmp_path / "step.checkpoint.npz"
    dying = KilledAfter(path, "inputs", pause=0.0)
    dying.left = generations
    with pytest.raises(Killed):
        run(dying)
    for dataset, name in ((run(), "a.nc"), (run(Checkpoint(path, "inputs")), "b.nc")):
        write_dataset(dataset, tmp_path / name)
    assert (tmp_path / "a.nc").read_bytes() == (tmp_path / "b.nc").read_bytes()


def test_any_number_of_threads_gives_the_same_bits(tmp_path):
    grid, results = grid_of(OPENING, plane=None), []
    for threads in (1, min(2, numba.config.NUMBA_NUM_THREADS)):
        numba.set_num_threads(threads)
        results.append(states_of(tmp_path, grid, (0,), None, host=COULOMB, solver=LOOSE)[-1][0])
    assert (results[0].failed.values >= 0).any()
    assert results[0].identical(results[1])


def test_a_step_in_its_subdomain_has_what_the_whole_mine_has(tmp_path, monkeypatch):
    """Three openings far apart, then one beside the third, in perfectly plastic rock; 2 %."""
    monkeypatch.setattr(step_subdomain, "MIN_MINE_CELLS", 0)
    plastic = COULOMB | {
        "friction_angle": {"intact": 30.0, "residual": 30.0},
        "cohesion": {"intact": 2e6, "residual": 2e6},
        "tension_cutoff": {"intact": 1e6, "residual": 1e6},
    }
    places = [90.3, 100.7], [850.6, 860.2], [470.3, 480.7], [481.2, 480.7]
    boxes = [([x, 0.0, z], [x + 8.4, 0.0, z + 7.3]) for x, z in places]
    grid = grid_of(*boxes, later=[3], domain=960.0, coarse_cell=16.0, levels=5)
    outcomes = []
    for largest in (step_subdomain.MAX_SUBDOMAIN_SHARE, 0.0):
        monkeypatch.setattr(step_subdomain, "MAX_SUBDOMAIN_SHARE", largest)
        options = {"host": plastic, "stress": uniform(-12e6, -9e6, -8e6, 0.0, 1.2e6), "refinement": ADAPTIVE}
        outcomes.append(states_of(tmp_path, grid, (0, 0, 0, 1), solver=BRITTLE, **options)[-1])
    (state, facts), (whole, expected) = outcomes
    assert facts["failed_particles"] > 10
    assert facts["energy_released"] == pytest.approx(expected["energy_released"], rel=0.02)
    assert facts["energy_left_share"] < 1e-9
    for name in ("mass", "energy_mined"):
        assert facts[name] == pytest.approx(expected[name], rel=1e-9), name
    flow, of_whole = (
        float((np.abs(one.later_strain.values) * one.volume.values[:, None]).sum()) for one in (state, whole)
    )
    assert flow == pytest.approx(of_whole, rel=0.02)
