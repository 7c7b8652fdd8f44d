"""The arrays of a state, declared once: what follows from the declaration holds for each of them."""

import numpy as np
import pytest

from mechanics.scenes import COULOMB, ball, excavation, grid_around, make_model, make_scene, uniform
from mpm_core.equilibrium.convergence import History
from mpm_core.files.state_datasets import read_state, state_dataset
from mpm_core.model.model import Model
from mpm_core.model.state import ARRAYS, Extent, State, restore, snapshot
from mpm_core.stages.checkpoint import Checkpoint
from mpm_core.stages.state_transfer import transfer


def random_state(dimension: int) -> tuple[Model, State]:
    """A filled ball in Coulomb rock; every array that a stage changes is random, strains only where rock has failed."""
    shape = ball([12.0] * dimension, 5.0)
    scene = make_scene(
        None if dimension == 3 else "xz", host=COULOMB, stress=uniform(-5e6), excavations=[excavation(0, "fill", 0)]
    )
    model = make_model(scene, grid_around([shape], [3] * dimension, 2, 8.0), [shape])
    random, state = np.random.default_rng(3), model.virgin_state()
    failed = random.random(model.particles.count) < 0.3
    for name, array in ARRAYS.items():
        values = getattr(state, name)
        if array.start is None:
            continue
        drawn = random.integers(0, 9, values.shape) if values.dtype == np.int32 else random.normal(size=values.shape)
        if array.dims[0] == "particle" and name != "stress":
            drawn[~failed] = array.start
        values[:] = drawn
    return model, state


@pytest.mark.parametrize("dimension", [2, 3])
def test_the_next_stage_reads_what_this_one_has_written(dimension):
    """All arrays but those of a stage alone, which begin as in virgin rock; plastic strain with that of the stage."""
    model, state = random_state(dimension)
    nothing = np.zeros(model.particles.count)
    dataset = state_dataset(model, state, model.volumes(0) + 1.0, (nothing, nothing), History(1.0).table(), {})
    again, virgin = read_state(dataset, model), model.virgin_state()
    for name, array in ARRAYS.items():
        expected = getattr(virgin if array.of_stage else state, name)
        if name == "plastic_strain":
            expected = expected + state.seismic_strain + state.overshoot_strain + state.later_strain
        close = {"rtol": 1e-12, "atol": 1e-7 if name == "stress" else 1e-12}  # Pa: virgin stress is added and taken off
        np.testing.assert_allclose(getattr(again, name), expected, err_msg=name, **close)


NOT_TRANSFERRED = {"velocity": "nodes are at rest when cells are split"}


@pytest.mark.parametrize("dimension", [2, 3])
def test_every_array_is_transferred_to_the_refined_grid(dimension):
    """Cells that stay keep every array to the bit, but those of the list above, which begin as in virgin rock.

    A new array of the state fails here until stages.state_transfer.transfer handles it, or the list names it.
    """
    model, state = random_state(dimension)
    transferred, virgin = transfer(model, state, model), model.virgin_state()
    for name in ARRAYS:
        expected = getattr(virgin if name in NOT_TRANSFERRED else state, name)
        np.testing.assert_array_equal(getattr(transferred, name), expected, err_msg=name)


def test_a_checkpoint_holds_all_that_a_stage_changes(tmp_path):
    model, state = random_state(3)
    again, history, path = model.virgin_state(), History(1.0), tmp_path / "c.npz"
    Checkpoint(path, "key", pause=0.0, last=-1e9).save(state, history, model.grid)
    Checkpoint.restore(Checkpoint(path, "key").read(), again, history)
    for name, array in ARRAYS.items():
        if array.changes is not Extent.NONE:
            np.testing.assert_array_equal(getattr(again, name), getattr(state, name), err_msg=name)


@pytest.mark.parametrize("moving", [False, True])
def test_what_was_kept_comes_back_whatever_has_changed_and_failed_since(moving):
    """Also into memory that held an earlier copy; what no stage changes at rest is not copied at all."""
    model, state = random_state(3)
    state.position, state.cell = state.position.copy(), state.cell.copy()
    expected = {name: getattr(state, name).copy() for name in ARRAYS}
    kept = snapshot(state, moving)
    assert ("plastic_strain" in kept) == moving
    random = np.random.default_rng(5)
    state.failed[random.random(model.particles.count) < 0.3] = 1
    for name, array in ARRAYS.items():
        if array.changes is Extent.ALL or moving:
            getattr(state, name)[...] += 1
        elif array.changes is Extent.FAILED:
            getattr(state, name)[state.failed >= 0] += 1
    later = {name: value.copy() for name, value in snapshot(state, moving).items()}
    restore(kept, state)
    for name in ARRAYS:
        np.testing.assert_array_equal(getattr(state, name), expected[name], err_msg=name)
    again = snapshot(state, moving, into=later)
    assert again["stress"] is later["stress"]
    for name, value in kept.items():
        np.testing.assert_array_equal(again[name], value, err_msg=name)
