"""Forces of rock that flows, on the operator's rows, against scheme `explicit`, which is the definition of flow."""

import copy

import numpy as np
import pytest

from mpm_core.equilibrium.explicit_scheme import ExplicitScheme
from mpm_core.equilibrium.multigrid_scheme import MultigridScheme
from tests.mechanics.scenes import COULOMB
from tests.multigrid.test_operator import scene_with_everything


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize(("points", "cut_cells"), [(1, "mean"), (2, "mean"), (2, "whole"), (1, "subdivide")])
def test_forces_of_flow_are_those_of_the_explicit_scheme(dimension, points, cut_cells):
    """A random motion of rock of which half has failed: what of it flows, unloads or stays elastic; to round-off."""
    model, volume = scene_with_everything(dimension, points, cut_cells, host=COULOMB)
    state, random = model.virgin_state(), np.random.default_rng(4)
    state.failed[(volume > 0.0) & (random.random(len(volume)) < 0.5)] = 0
    schemes = [kind(model, copy.deepcopy(state), volume) for kind in (ExplicitScheme, MultigridScheme)]
    motion = 3e-3 * random.standard_normal(model.held.shape) * ~model.held
    motion[model.grid.is_hanging] = 0.0
    motion *= (schemes[0].body.mass > 0.0)[:, None]
    before = []
    for scheme in schemes:
        scheme.body.displace(0.4 * motion)  # to the residual surface
        scheme.body.commit()
        scheme.body.displace(0.3 * motion)  # flow since it last counted
        before.append(scheme.body.internal_force())

    np.testing.assert_array_equal(*before)
    explicit, multigrid = schemes
    explicit.body.displace(motion)
    flowed = (explicit.body.state.later_strain != 0.0).any(axis=1)
    assert 20 < flowed.sum() < len(explicit.body.flowing)
    expected = explicit.body.internal_force() - before[0]

    multigrid._set_stiffness()
    solver, flow = multigrid.solver, multigrid._flow_forces()
    values, elastic, fallen = solver.to_rows(motion), solver.operator.zeros(), solver.operator.zeros()
    solver.operator.apply(values, elastic)
    flow.begin(multigrid.body.state, multigrid.body.undo_flow)
    flow.add(values, fallen)
    solver.operator.collect(fallen)
    obtained = np.empty_like(motion)
    solver.to_nodes(fallen - elastic, obtained)
    free = ~model.held & ~model.grid.is_hanging[:, None]
    error = np.abs(obtained - expected)[free].max()
    assert error < 1e-12 * np.abs(expected[free]).max()
