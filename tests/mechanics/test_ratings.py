"""What a stage says of its rock against strength: truncated zones, and virgin rock of every body."""

import numpy as np
import pytest

from common.errors import InputError
from mechanics.scenes import COULOMB, ball, excavation, grid_around, make_model, make_scene, uniform
from mpm_core.stages.equilibrium_stages import failed_at_boundary, refuse_overstressed_virgin, truncation


def test_truncated_share_is_of_all_rock_above_strength():
    """Two coarse cells and one fine one above strength, one fine one failed: V_coarse 8^2 m2 each, V_fine 4^2 m2.

    Held back: 128 of 128 + 16 + 16 m2.
    """
    shape = ball([24.0, 24.0], 6.6)
    scene = make_scene("xz", host=COULOMB, excavations=[excavation()])
    model = make_model(scene, grid_around([shape], [6, 6], 2, 8.0), [shape])
    state, volume = model.virgin_state(), model.volumes(0)
    level = model.grid.cell_level[model.particles.cell]
    whole = volume == model.particles.full_volume
    coarse, fine = np.flatnonzero((level == 0) & whole)[:2], np.flatnonzero((level == 1) & whole)[:2]
    assert truncation(model, state, volume, "step")["truncated"] == 0
    state.stress[[*coarse, fine[0]]] = [-50e6, 0, 0, 0, 0, 0]
    state.failed[fine[1]] = 0
    facts = truncation(model, state, volume, "step")
    assert facts["truncated"] == 1
    assert facts["truncated_volume"] == pytest.approx(2 * 64.0)
    assert facts["truncated_share"] == pytest.approx(128.0 / 160.0)
    state.stress[coarse] = 0.0
    assert truncation(model, state, volume, "step")["truncated"] == 0  # the fine one may still fail


@pytest.mark.parametrize("plane", [None, "xz"])
def test_failed_rock_at_a_face_that_is_held_is_named(plane):
    """Corner cells of 8 m: the lowest one lies at all lower faces, of which a free one does not count, nor does rock
    that is gone."""
    d = 2 if plane else 3
    scene = make_scene(plane, host=COULOMB, boundary={"x_lower": "free"})
    model = make_model(scene, grid_around([], [3] * d, 1, 8.0))
    state, volume = model.virgin_state(), model.volumes(0)
    assert failed_at_boundary(model, state, volume) == {"boundary_failed_volume": 0.0, "boundary_failed_faces": ""}
    index = model.grid.cell_index[model.particles.cell]
    state.failed[(index == 1).all(axis=1)] = 0  # the middle one
    assert failed_at_boundary(model, state, volume)["boundary_failed_faces"] == ""
    corner = (index == 0).all(axis=1)
    state.failed[corner] = 0
    lower = "z_lower" if plane else "y_lower, z_lower"
    assert failed_at_boundary(model, state, volume) == {
        "boundary_failed_volume": pytest.approx(8.0**d), "boundary_failed_faces": lower,
    }  # fmt: skip
    state.failed[(index == 2).all(axis=1)] = 0
    facts = failed_at_boundary(model, state, np.where(corner, 0.0, volume))
    assert facts["boundary_failed_faces"] == ("x_upper, z_upper" if plane else "x_upper, y_upper, z_upper")


def test_a_weak_body_is_refused_only_where_it_is_too_weak():
    """Rock of 0.1 MPa cohesion (0.35 MPa uniaxial strength) under 1 MPa: the body is named; the host bears it."""
    weak = COULOMB | {"cohesion": {"intact": 1e5, "residual": 5e4}, "tension_cutoff": "none"}
    grid = grid_around([], [2, 2], 1, 8.0)
    body = np.array([0, -1, -1, -1], np.int16)

    def model(soft: dict):
        materials = {"host": COULOMB, "talc": soft}
        scene = make_scene(
            "xz", stress=uniform(0.0, 0.0, -1e6), materials=materials, rock_bodies=[{"material": "talc"}]
        )
        return make_model(scene, grid, body=body)

    refuse_overstressed_virgin(model(COULOMB))
    with pytest.raises(InputError, match=r"materials\.talc stands above its intact strength, first at"):
        refuse_overstressed_virgin(model(weak))
