"""What acts in single cells, in the layout of the operator: hourglass patterns are tangents of another form."""

import numpy as np
import pytest

from mpm_core.kernels.modes import hourglass_shares
from mpm_core.multigrid.cell_entries import Patterns, pack, places_of
from mpm_core.multigrid.coarsening import finest_grid
from mpm_core.multigrid.level import Operator
from mpm_core.multigrid.siblings import build_siblings
from tests.multigrid.test_operator import scene_with_everything


def siblings_of(dimension: int):
    model = scene_with_everything(dimension, 1, "mean")[0]
    grid = finest_grid(model.grid, model.cell_nodes)
    return build_siblings(grid.cell_index, grid.cell_width, grid.cell_nodes, grid.node_parents)


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("precision", [np.float32, np.float64])
def test_patterns_act_as_tangents_of_one_component_each(dimension, precision):
    """The same bits: slopes that are the pattern along each axis, and a matrix of -g for the strains along the axes,
    of its share where the pattern twists; set anew, as well."""
    siblings, random, corners = siblings_of(dimension), np.random.default_rng(dimension), 1 << dimension
    cells = np.sort(random.choice(len(siblings.cell_place), 40, replace=False))
    shares = hourglass_shares(dimension)
    patterns = random.standard_normal((len(cells), len(shares), corners))
    patterns[:, :, 0] = 0.0
    operator = Operator(siblings, dimension, precision)
    values = random.standard_normal(len(operator.zeros())).astype(precision)
    packed = Patterns.of(siblings, cells, patterns, precision)
    for _ in range(2):
        stiffness = random.random(len(cells)) * 1e9
        matrices = np.zeros((len(cells), len(shares), 36))
        matrices[:, :, [0, 7, 14][:dimension]] = -stiffness[:, None, None] * shares
        slopes = np.repeat(patterns.reshape(-1, corners, 1), dimension, axis=2)
        expected, found = operator.zeros(), operator.zeros()
        each = np.repeat(cells, len(shares))
        pack(siblings, each, slopes, matrices.reshape(-1, 36), precision).take_off(values, expected)
        packed.set_stiffness(stiffness)
        packed.add(values, found)
        assert np.abs(expected).max() > 1e8
        np.testing.assert_array_equal(found, expected)


def test_threads_share_only_blocks_that_have_entries(monkeypatch):
    """Every cell, one cell, none: each entry lies in one place, on the rows of its own corners."""
    monkeypatch.setattr("mpm_core.multigrid.siblings.GROUPS_PER_BLOCK", (1, 8))
    siblings = siblings_of(3)
    count = len(siblings.cell_place)
    assert len(siblings.batch_start) > 8
    for cells in (np.arange(count), np.array([count // 2]), np.empty(0, int)):
        places = places_of(siblings, cells)
        assert places.batch_start[0] == 0
        assert (np.diff(places.batch_start) > 0).all()
        assert len(np.unique(places.batch * 8 + places.lane)) == len(cells)
        rows = places.rows.reshape(-1, 8, 8)
        np.testing.assert_array_equal(rows[places.batch, :, places.lane], siblings.corner_rows(cells[places.order]))
    assert len(places_of(siblings, np.array([count // 2])).batch_start) == 2
