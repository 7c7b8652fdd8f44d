"""Fill between walls that cut cells: it takes the closure of its full width."""

import numpy as np
import pytest

from mechanics.scenes import FILL, HOST, excavation, make_scene, uniform
from mechanics.test_steps_with_edge_nodes import TIGHT, grid_of
from mpm_core.grid.octree import all_cells
from mpm_core.model.fill_width import width_shares
from mpm_core.scene.scene import FACES
from mpm_core.stages.equilibrium_stages import elastic_stage, mining_step

DEPTH = 24.0  # m, of the block
STRESS = 25e6
STIFF_FILL = FILL | {"youngs_modulus": 5e9}  # bears a third of the stress that was there


def confined_modulus(material):
    young, nu = material["youngs_modulus"], material["poisson_ratio"]
    return young * (1 - nu) / ((1 + nu) * (1 - 2 * nu))


def stress_in_layer(layers, tmp_path):
    """Mean vertical stress, Pa, of rock below layers of fill (low, high) right across the block, on rollers."""
    grid = grid_of(*(([0.0] * 2 + [low], [DEPTH] * 2 + [high]) for low, high in layers), levels=3, buffer_cells=1)
    scene = make_scene(
        "xz",
        excavations=[excavation(0, "fill", name=f"e{k}") for k in range(len(layers))],
        stress=uniform(-STRESS, -STRESS, -STRESS),
        boundary=dict.fromkeys(FACES, "roller"),
        materials={"host": HOST, "fill": STIFF_FILL},
        solver=TIGHT,
    )
    virgin = elastic_stage(scene, grid, tmp_path / "failed.npz")[0]
    state = mining_step(scene, grid, virgin, tmp_path / "failed.npz")[0]
    below = state.position.values[:, 2] < 9.0
    return -state.stress.values[below, 2].mean()


def exact(width):
    """Rock above and below unloads until fill between it bears what it bears."""
    rock, fill = (DEPTH - width) / confined_modulus(HOST), width / confined_modulus(STIFF_FILL)
    return STRESS * rock / (fill + rock)


@pytest.mark.parametrize(("low", "high"), [(10.0, 14.0), (10.25, 14.25), (10.5, 14.5), (10.3, 14.1), (10.5, 13.5)])
def test_a_layer_of_fill_bears_its_closure_wherever_its_walls_lie(low, high, tmp_path):
    """Closed form, cells of 1 m. Without the share of its width fill bears 18 to 24 % too much."""
    tolerance = 1e-4 if low == 10.0 else 0.02
    assert stress_in_layer([(low, high)], tmp_path) == pytest.approx(exact(high - low), rel=tolerance)


def test_a_layer_in_two_lifts_is_one_layer(tmp_path):
    """Two excavations that meet within a cell, filled at once: each has the width of both."""
    whole = stress_in_layer([(10.5, 14.5)], tmp_path)
    assert stress_in_layer([(10.5, 12.5), (12.5, 14.5)], tmp_path) == pytest.approx(whole, rel=1e-6)


def test_the_smallest_width_counts_and_the_order_of_cells_does_not():
    """A stope of 3 x 5 cells, half of its outer cells along x; a fifth of those along y."""
    place = all_cells((3, 5)) + np.array([7, 2])
    wide = np.where(np.isin(place[:, 1], [2, 6]), 0.2, 1.0)
    fill = np.where(np.isin(place[:, 0], [7, 9]), 0.5, 1.0) * wide
    bears = fill == 1.0
    share = width_shares(place, fill, bears, bears)
    assert share == pytest.approx(0.5)
    order = np.random.default_rng(1).permutation(len(place))
    shuffled = width_shares(place[order], fill[order], bears[order], bears[order])
    np.testing.assert_array_equal(shuffled, share)


def test_fill_that_nothing_but_shared_cells_hold_keeps_its_stiffness():
    place = all_cells((2, 4))
    every = np.ones(len(place), bool)
    assert (width_shares(place, np.full(len(place), 0.5), ~every, every) == 1.0).all()


def test_fills_apart_have_widths_of_their_own():
    column, row = np.meshgrid([0, 1, 2, 5, 6], np.arange(9), indexing="ij")
    fill = np.repeat([0.5, 1.0, 0.5, 1.0, 1.0], 9)
    place = np.stack([column.ravel(), row.ravel()], axis=1)
    share = width_shares(place, fill, fill == 1.0, fill > 0.0)
    assert share == pytest.approx(np.repeat([0.5, 0.5, 0.5, 1.0, 1.0], 9))
    for column_of_one in (1, 5):
        chosen = place[:, 0] == column_of_one
        np.testing.assert_array_equal(width_shares(place, fill, fill == 1.0, chosen), share[chosen])


@pytest.mark.parametrize(("degrees", "expected"), [(0.0, 0.75), (15.0, 0.885), (30.0, 1.0)])
def test_the_more_obliquely_walls_lie_the_less_fill_is_softened(degrees, expected):
    """A long layer of four cells, turned; its shares of cells by a fine lattice of points."""
    step = np.array([np.cos(np.radians(degrees)), np.sin(np.radians(degrees))])
    place = all_cells((24, 40))
    points = (all_cells((8, 8)) + 0.5) / 8
    across = (place[:, None, :] + points - np.array([12.5, 20.0])) @ step
    fill = (np.abs(across) < 2.0).mean(axis=1)
    here = fill > 0.02
    place, fill = place[here], fill[here]
    middle = (place[:, 1] > 12) & (place[:, 1] < 28) & (fill == 1.0)
    share = width_shares(place, fill, fill == 1.0, middle)
    assert share.mean() == pytest.approx(expected, abs=0.03)
