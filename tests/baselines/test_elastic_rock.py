"""The rock of states: parts of the last state, each with the stress of the cell that it lies in before."""

import numpy as np
import pytest
from rock_fixtures import QUIET, SHEAR, SLIPPING, write_block, write_state

from baselines.elastic_rock import principal, read_rock
from common.errors import InputError
from common.voigt import voigt_from_tensor

EVERYWHERE = ["host"]


def all_of(stress, name):
    """May hold events anywhere."""
    return np.ones(len(stress), bool)


def halves(origin, size):
    """Lower corners and edges of the eight cells of half the size in a cell."""
    corner = np.stack(np.meshgrid(*[[0.0, 0.5]] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    return np.asarray(origin, float) + size * corner, np.full(8, size / 2)


def test_split_cells_have_the_stress_of_the_cell_that_they_were(tmp_path):
    """Two coarse cells, of which the first is split later and a part of it mined."""
    first = write_state(tmp_path / "a.nc", [[0, 0, 0], [8, 0, 0]], [8, 8], [QUIET, SLIPPING])
    fine, edges = halves([0, 0, 0], 8.0)
    stress = np.arange(9)[:, None] * 1e6 * np.ones(6)
    volume = np.append(np.where(np.arange(8) == 3, 0.0, 64.0), 512.0)
    volume[5] = 16.0
    second = write_state(tmp_path / "b.nc", np.append(fine, [[8, 0, 0]], axis=0), [*edges, 8], stress, volume)
    rock = read_rock([first, second], all_of, EVERYWHERE)
    assert rock.states == 2
    np.testing.assert_array_equal(rock.edge, [4] * 8 + [8])
    np.testing.assert_array_equal(rock.stress[0], [QUIET] * 8 + [SLIPPING])
    np.testing.assert_array_equal(rock.stress[1], stress)
    np.testing.assert_array_equal(rock.share[0], 1.0)
    np.testing.assert_array_equal(rock.share[1], [1, 1, 1, 0, 1, 0.25, 1, 1, 1])
    np.testing.assert_allclose(rock.shear_modulus, SHEAR)
    np.testing.assert_allclose(rock.poisson_ratio, 0.25)


def test_only_rock_that_may_hold_events_in_some_state_is_kept(tmp_path):
    """Here the second cell in the second state; rock that is mined by then does not count for it."""
    cells = [[0, 0, 0], [4, 0, 0], [8, 0, 0]], [4, 4, 4]
    first = write_state(tmp_path / "a.nc", *cells, [QUIET] * 3)
    second = write_state(tmp_path / "b.nc", *cells, [QUIET, SLIPPING, SLIPPING], [64, 64, 0])
    rock = read_rock([first, second], lambda stress, name: stress[:, 0] < -30e6, EVERYWHERE)
    np.testing.assert_array_equal(rock.centre, [[6.0, 2, 2]])
    np.testing.assert_array_equal(rock.stress[:, 0], [QUIET, SLIPPING])


def test_fill_and_rocks_without_flaws_are_left_out(tmp_path):
    """Materials are told by name: a state names only those that are there by then."""
    cells = [[0, 0, 0], [4, 0, 0], [8, 0, 0]], [4, 4, 4]
    first = write_state(tmp_path / "a.nc", *cells, SLIPPING, material=[0, 1, 0], names=("host", "dyke"))
    second = write_state(
        tmp_path / "b.nc",
        *cells,
        2 * SLIPPING,
        material=[1, 2, 0],
        names=("fill", "host", "dyke"),
        excavation=[-1, -1, 0],
    )
    rock = read_rock([first, second], all_of, ["host"])
    np.testing.assert_array_equal(rock.centre, [[2.0, 2, 2]])
    np.testing.assert_array_equal(rock.stress[:, 0], [SLIPPING, 2 * SLIPPING])
    assert rock.by_material({"host": 3.0}).tolist() == [3.0]
    both = read_rock([first, second], all_of, ["host", "dyke"])
    np.testing.assert_array_equal(both.centre[:, 0], [2.0, 6.0])


def test_two_rocks_in_one_cell_have_each_their_own_stress(tmp_path):
    """A cell that the surface of a rock body cuts, in both states."""
    paths = [
        write_state(
            tmp_path / f"{name}.nc", [[0, 0, 0], [0, 0, 0]], [4, 4], [factor * QUIET, factor * SLIPPING], [24, 40],
            material=[0, 1], names=("host", "dyke"),
        )
        for name, factor in (("a", 1.0), ("b", 2.0))
    ]  # fmt: skip
    rock = read_rock(paths, all_of, ["host", "dyke"])
    np.testing.assert_array_equal(rock.stress[:, 0], [QUIET, 2 * QUIET])
    np.testing.assert_array_equal(rock.stress[:, 1], [SLIPPING, 2 * SLIPPING])
    np.testing.assert_allclose(rock.share[0], [24 / 64, 40 / 64])


def test_a_box_keeps_the_rock_in_it(tmp_path):
    """Centres count."""
    state = write_block(tmp_path / "a.nc", SLIPPING, cells=4, edge=10.0)
    rock = read_rock([state], all_of, EVERYWHERE, (np.array([0.0, 0, 0]), np.array([20.0, 15, 40])))
    assert len(rock.edge) == 2 * 2 * 4
    assert rock.centre.max(axis=0).tolist() == [15.0, 15.0, 35.0]


def test_plane_strain_is_refused(tmp_path):
    """In one line."""
    state = write_state(tmp_path / "a.nc", [[0, 0, 0]], [4], SLIPPING, plane="xz")
    with pytest.raises(InputError, match="plane strain"):
        read_rock([state], all_of, EVERYWHERE)


def test_principal_stresses_are_those_of_a_turned_tensor():
    """The largest first; tension positive."""
    turn = np.linalg.qr(np.random.default_rng(0).normal(size=(3, 3)))[0]
    largest, smallest = principal(voigt_from_tensor(turn @ np.diag([1.0, -2.0, -5.0]) @ turn.T)[None])
    np.testing.assert_allclose([largest[0], smallest[0]], [1.0, -5.0])
