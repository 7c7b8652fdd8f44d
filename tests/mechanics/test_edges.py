"""Rock at sharp edges and in skins, through the stages of a mine."""

import numpy as np
import pytest

from common.errors import InputError
from mechanics.scenes import HOST, excavation, make_scene, uniform
from mechanics.test_steps_with_edge_nodes import grid_of, states_of
from mpm_core.files.state_datasets import read_grid
from mpm_core.model import edge_cells
from mpm_core.model.edge_factor import edge_factor
from mpm_core.model.occupancy import Unsupported
from mpm_core.model.particles import MASSIVE_BENDING_SHARE
from mpm_core.stages.ground import Ground

STRESS = uniform(-28e6, -25e6, -27e6)
FACTOR = edge_factor(np.radians(270.0), HOST["poisson_ratio"])


def model_of(grid, plane, mined=(0,), step=0):
    entries = [excavation(at, name=f"e{number}") for number, at in enumerate(mined)]
    scene = make_scene(plane, excavations=entries, stress=STRESS, steps=max(mined) + 1)
    cells, body = read_grid(grid)
    return Ground.of(scene, grid).model(cells, body, Unsupported.none(), at=0).at(step)


def softened(model):
    """Centres of cells whose rock is softer than the host, in finest cells."""
    shear = model.elastic_constants[model.particles.material, 1]
    soft = model.particles.is_rock & (shear < shear.max() * (1 - 1e-9))
    grid = model.grid
    return {tuple(place) for place in ((grid.cell_center[model.particles.cell[soft]] - grid.origin) / grid.fine_cell)}


@pytest.mark.parametrize("plane", ["xz", None])
def test_cells_around_the_edges_of_a_box_are_softer_by_the_factor(plane):
    """A box on faces of cells of 1 m: all cells that touch an edge, and no others; those inside it are mined."""
    model = model_of(grid_of(([9.0] * 3, [14.0] * 3), plane=plane), plane)
    dimension = model.dimension
    expected = set()
    for number in np.ndindex(*[8] * dimension):
        place = np.array(number) + 7.5
        near = (np.abs(place - 9.0) < 1.0) | (np.abs(place - 14.0) < 1.0)
        within = (place > 8.0) & (place < 15.0)
        if near.sum() >= 2 and within.all():
            expected.add(tuple(place))
    assert softened(model) == expected
    shear = model.elastic_constants[:, 1]
    assert shear[2] == pytest.approx(FACTOR * shear[0])


def energy_of(box, levels, tmp_path):
    return states_of(tmp_path, grid_of(box, levels=levels, domain=80.0, coarse_cell=10.0), [0], stress=STRESS)[0][0]


def test_four_cells_across_are_enough_for_the_energy_of_a_square(tmp_path):
    """Plane strain, walls on faces: within a percent of the energy with 32 cells; without the factor -4 %."""
    square = [35.0] * 3, [45.0] * 3
    coarse, fine = (energy_of(square, levels, tmp_path).attrs["energy_motion"] for levels in (3, 6))
    assert coarse == pytest.approx(fine, rel=0.01)


def test_energy_at_edges_balances_in_later_steps(tmp_path):
    """Two boxes that meet, one after the other: edges come and go; nothing but round-off is left over."""
    grid = grid_of(([8.0] * 3, [12.0] * 3), ([12.0, 8.0, 8.0], [16.0, 12.0, 12.0]))
    for state, facts in states_of(tmp_path, grid, [0, 1], stress=STRESS):
        assert facts["energy_left_share"] < 1e-6, state.attrs["step"]


def test_elastic_rock_does_not_remember_the_order_of_mining(tmp_path):
    """Two boxes that meet, in two steps and at once: the same stress and hourglass forces, edges and all."""
    grid = grid_of(([8.0] * 3, [12.0] * 3), ([12.0, 8.0, 8.0], [16.0, 12.0, 12.0]))
    at_once = states_of(tmp_path, grid, [0, 0], stress=STRESS)[-1][0]
    for mined in ([0, 1], [1, 0]):
        state = states_of(tmp_path, grid, mined, stress=STRESS)[-1][0]
        size = np.abs(at_once.stress.values).max()
        np.testing.assert_allclose(state.stress.values, at_once.stress.values, atol=1e-6 * size)
        hourglass = np.abs(at_once.hourglass_force.values).max()
        np.testing.assert_allclose(state.hourglass_force.values, at_once.hourglass_force.values, atol=1e-5 * hourglass)


def test_rock_between_two_voids_is_a_skin_from_the_step_on_that_makes_it_one():
    """Boxes 3 m apart, the second one mined in step 1, cells of 1 m: the rock between them bends as a plate does."""
    grid = grid_of(([6.0] * 3, [10.0] * 3), ([13.0, 6.0, 6.0], [17.0, 10.0, 10.0]))
    model = model_of(grid, "xz", (0, 1), 0)
    assert (model.bending_share == MASSIVE_BENDING_SHARE).all()
    later = model.at(1)
    place = (later.grid.cell_center - later.grid.origin) / later.grid.fine_cell
    between = ((place > [10, 6]) & (place < [13, 10])).all(axis=1)
    assert between.sum() == 12
    assert (later.bending_share[between] == 1.0).all()
    assert (later.bending_share[~between] == MASSIVE_BENDING_SHARE).all()


def test_a_wider_pillar_is_massive_rock():
    grid = grid_of(([5.0] * 3, [9.0] * 3), ([15.0, 5.0, 5.0], [19.0, 9.0, 9.0]))
    assert (model_of(grid, "xz", (0, 0)).bending_share == MASSIVE_BENDING_SHARE).all()


def test_the_factor_is_needed(monkeypatch, tmp_path):
    """The square of four cells without it: more than three percent too little energy."""
    square = [35.0] * 3, [45.0] * 3
    with_factor = energy_of(square, 3, tmp_path).attrs["energy_motion"]
    monkeypatch.setattr(edge_cells, "edge_factor", lambda angle, nu, patch: 1.0)
    assert energy_of(square, 3, tmp_path).attrs["energy_motion"] < 0.97 * with_factor


def test_the_explicit_scheme_gives_the_same_rock_at_edges(tmp_path):
    """Softer rows of the tables weigh as their material does, and both schemes read them."""
    grid = grid_of(([9.3] * 3, [14.1] * 3))
    states = [
        states_of(tmp_path, grid, [0], stress=STRESS, solver=scheme | {"tolerance": 1e-7})[0][0]
        for scheme in ({"scheme": "explicit", "density_scaling": False}, {"scheme": "multigrid"})
    ]
    explicit, multigrid = (state.stress.values for state in states)
    np.testing.assert_allclose(explicit, multigrid, atol=1e-4 * np.abs(multigrid).max())
    assert states[0].attrs["mass"] == pytest.approx(states[1].attrs["mass"], rel=1e-12)


def test_a_grid_that_an_earlier_version_made_is_refused():
    grid = grid_of(([9.0] * 3, [14.0] * 3), plane="xz").drop_vars("edge_point_shares_nodes")
    with pytest.raises(InputError, match=r"grid\.nc was made by an earlier version; run the pipeline from the grid"):
        model_of(grid, "xz")


@pytest.mark.parametrize("step", [0, 1])
@pytest.mark.parametrize("plane", ["xz", None])
def test_what_is_mined_takes_the_energy_that_it_had_before_edges_became_softer(plane, step, tmp_path):
    """A box in uniform stress, in the elastic state or in a step: its volume times s : C^-1 : s / 2."""
    side, modulus, nu = 5.0, HOST["youngs_modulus"], HOST["poisson_ratio"]
    principal = np.array(STRESS["constant"][:3])
    density = ((1 + nu) * (principal**2).sum() - nu * principal.sum() ** 2) / (2 * modulus)
    states = states_of(tmp_path, grid_of(([9.0] * 3, [14.0] * 3), plane=plane), [step], plane, stress=STRESS)
    facts = states[-1 if step else 0][1]
    assert facts["energy_mined"] == pytest.approx(side ** (2 if plane else 3) * density, rel=1e-9)
    assert facts["energy_left_share"] < 1e-9
