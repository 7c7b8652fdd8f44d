"""A law that one module holds, beside Coulomb in another body: through an elastic history and a step of mining."""

from dataclasses import replace

import numpy as np
import pytest

from common.setting_types import SI
from mechanics import von_mises
from mechanics.scenes import (
    COULOMB,
    HOST,
    ball,
    excavation,
    grid_around,
    host_everywhere,
    make_dataset,
    make_scene,
    uniform,
)
from mpm_core.constitutive import laws
from mpm_core.constitutive.laws import coulomb
from mpm_core.files.state_datasets import read_grid, read_state
from mpm_core.model.occupancy import Unsupported
from mpm_core.stages.equilibrium_stages import elastic_stage, mining_step
from mpm_core.stages.ground import Ground

YIELD = {"intact": 16e6, "residual": 14e6}
VON_MISES = von_mises.Material.model_validate(
    {key: HOST[key] for key in ("youngs_modulus", "poisson_ratio", "density")}
    | {"model": "von_mises", "yield_stress": YIELD},
    context=SI,
)
HARD = COULOMB | {"cohesion": {"intact": 4e6, "residual": 2e6}}


def tunnel(scheme, host, body):
    """A tunnel along the border between two rocks, and the grid's dataset: host in the left half, body in the right."""
    grid = grid_around([ball([16.0, 16.0], 6.0)], (8, 8), 2, 4.0)
    scene = make_scene(
        "xy",
        host=HARD,
        stress=uniform(-17e6, -15e6, -16e6),
        excavations=[excavation()],
        solver={"scheme": scheme, "tolerance": 1e-6, "cascade_tolerance": 1e-6, "increments": 2},
        rock_bodies=[{"material": "fill"}],
    )
    scene = replace(scene, materials={"host": host or scene.materials["host"], "fill": body or scene.materials["host"]})
    of_body = host_everywhere(grid)
    of_body[grid.cell_center[:, 0] > 16.0] = 0
    return scene, make_dataset(scene, grid, [ball([16.0, 16.0], 5.0)], of_body)


def mined(folder, scheme, host=None, body=None):
    """Model, state and dataset after the tunnel's step."""
    scene, grid = tunnel(scheme, host, body)
    before, _ = elastic_stage(scene, grid, folder / "failed.npz")
    after, _ = mining_step(scene, grid, before, folder / "failed.npz")
    model = Ground.of(scene, grid).model(*read_grid(grid), Unsupported.none())
    return model, read_state(after, model), after


@pytest.fixture(autouse=True)
def two_laws(monkeypatch):
    """All that is said to the package of the new law."""
    monkeypatch.setattr(laws, "LAWS", (coulomb, von_mises))


def test_two_laws_in_one_scene_fail_each_by_its_own(tmp_path):
    """Both rocks fail around the tunnel; failed and intact rock stand within their own surfaces, with both schemes."""
    states = []
    for scheme in ("multigrid", "explicit"):
        model, state, dataset = mined(tmp_path, scheme, body=VON_MISES)
        assert model.law.NAME == "coulomb+von_mises"
        failed, of_body = state.failed >= 0, model.particles.material == 1
        assert np.count_nonzero(failed & of_body) > 5
        assert np.count_nonzero(failed & ~of_body) > 5
        rock = np.flatnonzero(model.can_fail() & (model.volumes(0) > 0.0))
        total = state.stress + model.insitu
        for p in rock:
            law = von_mises if of_body[p] else coulomb
            row = law.strength_rows(list(model.scene.materials.values())[int(of_body[p])], (0, 1, 2))[int(failed[p])]
            assert law.overstress(*total[p], tuple(row)) <= (1e3 if failed[p] else 1e6)
        plastic = dataset.plastic_strain.values[failed & of_body]
        assert np.abs(plastic[:, :3].sum(axis=1)).max() < 1e-9 < np.abs(plastic).max()  # von Mises: no change of volume
        assert np.isfinite(dataset.strength_factor.values).all()
        states.append(state)
    np.testing.assert_array_equal(states[0].failed, states[1].failed)
    # a corner of failed Coulomb rock that a void has cut off hardly resists: where it lies depends on the way
    volume = np.bincount(model.particles.cell, model.volumes(0), len(model.cell_nodes))
    firm = np.unique(model.cell_nodes[volume >= 0.5 * model.grid.cell_size**2])
    one, other = (state.displacement[firm] for state in states)
    assert np.abs(one - other).max() < 0.01 * np.abs(other).max()


def test_rock_does_not_feel_that_another_has_another_law(tmp_path):
    """Coulomb rock beside a body of a law that never yields, and beside the same body elastic: to the bit the same."""
    never = VON_MISES.model_copy(update={"yield_stress": von_mises.YieldStress.of({"intact": 1e15, "residual": 1e15})})
    model, state, _ = mined(tmp_path, "explicit", body=never)
    elastic = laws.Materials.of({"materials": {"x": HOST}}).materials["x"]
    alone, expected, _ = mined(tmp_path, "explicit", body=elastic)
    assert model.law is not alone.law is coulomb
    assert np.count_nonzero(expected.failed >= 0) > 5
    np.testing.assert_array_equal(state.failed, expected.failed)
    np.testing.assert_array_equal(state.stress, expected.stress)
    np.testing.assert_array_equal(state.displacement, expected.displacement)


def test_a_scene_of_the_other_law_alone(tmp_path):
    """Host and body of it: its own kernels, no mixture. Schemes agree as it flows back to one stress."""
    model, state, _ = mined(tmp_path, "multigrid", host=VON_MISES, body=VON_MISES)
    _, other, _ = mined(tmp_path, "explicit", host=VON_MISES, body=VON_MISES)
    np.testing.assert_array_equal(state.failed, other.failed)
    size = np.abs(other.displacement).max()
    assert np.abs(state.displacement - other.displacement).max() < 2e-3 * size
    assert model.law is von_mises
    failed = state.failed >= 0
    assert 5 < np.count_nonzero(failed) < 0.5 * len(failed)
    total = (state.stress + model.insitu)[failed & (model.volumes(0) > 0.0)]
    row = np.array([YIELD["residual"]])
    assert max(von_mises.overstress(*stress, tuple(row)) for stress in total) < 1e3
