"""Rock that comes loose falls: the skin of rock between a drive and a stope, both mined in one step."""

import json
import sys
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from common.errors import InputError
from mechanics.killed import Killed, KilledAfter
from mechanics.scenes import COULOMB, box, excavation, grid_around, make_dataset, make_model, make_scene
from mpm_core.equilibrium import cascade, falls
from mpm_core.equilibrium.body import Body
from mpm_core.equilibrium.convergence import NoEquilibrium
from mpm_core.grid.mesh import MultiLevelGrid
from mpm_core.model.fallen_rock import coming_loose, mined_volume
from mpm_core.model.occupancy import ALL_SAMPLES, ROCK_OWNER, Changes, Unsupported
from mpm_core.stages import equilibrium_stages, step_subdomain
from mpm_core.stages.checkpoint import Checkpoint
from mpm_core.stages.equilibrium_stages import elastic_stage, mining_step

LOOSE = COULOMB | {
    "cohesion": {"intact": 1.2e6, "residual": 0.0},
    "tension_cutoff": {"intact": 1e6, "residual": 0.0},
    "friction_angle": {"intact": 30.0, "residual": 20.0},
}
SHALLOW = {
    "constant": [-0.1e6, 0.0, 0.0, 0.0, 0.0, 0.0],
    "gradient": [-0.004e6, -0.010e6, -0.0278e6, 0.0, 0.0, 0.0],
}
DRIVE, STOPE, FILLED = box([30.0, 51.25], [50.0, 56.25]), box([30.0, 40.0], [50.0, 50.0]), box([5.0, 5.0], [10.0, 10.0])


def mine(tmp_path, steps=2, host=LOOSE, refinement=None, **changes):
    """Scene up to a step, grid and state before the last of these, in which drive and stope are mined in step 1."""
    shapes = [DRIVE, STOPE, FILLED]
    excavations = [
        excavation(1, name="drive"),
        excavation(1, "fill" if steps > 2 else None, 2 if steps > 2 else -1, name="stope"),
        excavation(2 if steps > 2 else -1, name="later"),
    ]
    scene = make_scene(
        "xz",
        host=host,
        stress=SHALLOW,
        surface=170.0,
        excavations=excavations,
        steps=steps,
        refinement=refinement,
        solver={"scheme": "multigrid", "tolerance": 1e-3, "increments": 1, "collapse": "fall"} | changes,
    )
    grid = make_dataset(scene, grid_around(shapes, [8, 10], 4, 10.0, rings=4), shapes)
    return scene, grid


def first_steps(tmp_path, count=2, **changes):
    """States and facts of the first steps."""
    found = []
    scene, grid = mine(tmp_path, max(count, 2), **changes)
    state, _ = elastic_stage(replace(scene, steps=scene.steps[:1], excavations=_until(scene, 0)), grid, tmp_path / "f")
    for last in range(count):
        own = replace(scene, steps=scene.steps[: last + 1], excavations=_until(scene, last))
        state, facts = mining_step(own, grid, state, tmp_path / "failed.npz")
        found.append((state, facts))
    return scene, grid, found


def _until(scene, last):
    return tuple(
        replace(
            one,
            mined=one.mined if one.mined <= last else -1,
            fill=one.fill if -1 < one.filled <= last else None,
            filled=one.filled if one.filled <= last else -1,
        )
        for one in scene.excavations
    )


@pytest.fixture(scope="module")
def fallen(tmp_path_factory):
    return first_steps(tmp_path_factory.mktemp("falls"))


def test_the_back_of_the_drive_falls_and_the_step_comes_to_rest(fallen):
    _, _, found = fallen
    _, facts = found[1]
    pieces = json.loads(facts["falls"])
    assert facts["collapsed"] == 0
    assert facts["collapse"] == ""
    assert facts["unbalanced_ratio"] <= 1e-3
    assert 5.0 < sum(piece["volume"] for piece in pieces) < 300.0
    assert [piece["volume"] for piece in pieces] == sorted((piece["volume"] for piece in pieces), reverse=True)
    largest = pieces[0]
    assert (largest["opening"], largest["side"]) == ("drive", "back")
    assert 30.0 < largest["place"]["x"] < 50.0
    assert 50.0 < largest["place"]["z"] < 75.0


def test_the_back_of_an_opening_that_cuts_cells_falls_from_its_back(tmp_path, monkeypatch):
    """Half a cell of rock above a drive in the cells that it cuts: each is its own nearest cell of the drive."""
    monkeypatch.setattr(sys.modules[__name__], "DRIVE", box([30.0, 51.25], [50.0, 56.875]))
    pieces = json.loads(first_steps(tmp_path)[2][1][1]["falls"])
    assert (pieces[0]["opening"], pieces[0]["side"]) == ("drive", "back")


def test_what_has_fallen_is_gone_and_is_no_event(fallen):
    _, _, found = fallen
    state, facts = found[1]
    gone = np.isin(state.cell.values, state.loose_cell.values[state.loose_fall.values > 0])
    assert gone.any()
    rock = state.excavation.values < 0
    assert (state.volume.values[gone & rock] == 0.0).all()
    assert (state.stress.values[gone & rock] == 0.0).all()
    here = (state.failed.values == 1) & (state.volume.values > 0.0)
    assert facts["failed_volume"] == pytest.approx(state.volume.values[here].sum())
    volume = sum(piece["volume"] for piece in json.loads(facts["falls"]))
    before = found[0][0].volume.values[found[0][0].excavation.values < 0].sum()
    mined = 20.0 * 5.0 + 20.0 * 10.0
    assert before - state.volume.values[rock].sum() == pytest.approx(mined + volume, rel=1e-9)
    assert facts["mass"] == pytest.approx(LOOSE["density"] * state.volume.values[rock].sum(), rel=1e-9)


def test_energy_is_balanced_to_round_off_through_falls(fallen):
    _, _, found = fallen
    assert json.loads(found[1][1]["falls"])
    assert found[1][1]["energy_left_share"] < 1e-9


def test_without_falls_it_is_an_error_or_the_last_equilibrium(tmp_path):
    with pytest.raises(InputError, match=r"runs away|no convergence"):
        first_steps(tmp_path, collapse="error")
    _, facts = first_steps(tmp_path, collapse="keep")[2][1]
    assert facts["collapsed"] == 1
    assert "[]" in facts["falls"]
    assert facts["collapse"]
    _, not_computed = first_steps(tmp_path, count=3, collapse="keep")[2][2]
    assert not_computed["computed"] == 0


def test_rock_that_stands_is_the_same_to_the_bit_with_falls_allowed(tmp_path):
    """A residual cohesion holds all of it."""
    held = LOOSE | {"cohesion": {"intact": 1.2e6, "residual": 0.3e6}}
    one, other = (first_steps(tmp_path, host=held, collapse=mode)[2][1] for mode in ("fall", "error"))
    assert one[1]["falls"] == "[]"
    assert one[1]["failed_particles"] == other[1]["failed_particles"] > 0
    for name in ("stress", "failed", "failure_order", "node_displacement", "seismic_strain", "later_strain"):
        assert np.array_equal(one[0][name].values, other[0][name].values), name


def test_later_steps_keep_what_has_fallen(tmp_path):
    """The stope is filled and another opening mined: what fell stays gone, and no fill is where it was."""
    _, _, found = first_steps(tmp_path, count=3)
    before, after = found[1][0], found[2][0]
    assert json.loads(found[2][1]["falls"]) == []
    fell = before.loose_fall.values > 0
    assert np.array_equal(after.loose_cell.values[: len(fell)], before.loose_cell.values)
    gone = np.isin(after.cell.values, before.loose_cell.values[fell])
    assert (after.volume.values[gone] == 0.0).all()
    assert (after.failed.values[: before.sizes["particle"]][before.failed.values == 1] == 1).all()


def test_what_is_read_in_a_resumed_step_is_counted_from_where_it_was(tmp_path, monkeypatch):
    """Motion since the last equilibrium tells what falls, and motion in the stage what runs away: it was counted from
    the checkpoint."""
    scene, grid, found = first_steps(tmp_path)
    path, entered, run = tmp_path / "c.npz", [], equilibrium_stages.run_cascade

    def note(scheme, *others):
        entered.append((scheme.body.start.copy(), scheme.body.rest.copy()))
        return run(scheme, *others)

    monkeypatch.setattr(equilibrium_stages, "run_cascade", note)
    apart = 0
    for saves in (3, 12):
        dying = KilledAfter(path, "key", pause=0.0)
        dying.left = saves
        with pytest.raises(Killed):
            mining_step(scene, grid, found[0][0], tmp_path / "failed.npz", dying)
        with np.load(path) as saved:
            start, rest = saved["start"], saved["rest_displacement"]
            apart += not np.array_equal(start, saved["displacement"])
        mining_step(scene, grid, found[0][0], tmp_path / "failed.npz", Checkpoint(path, "key"))
        np.testing.assert_array_equal(entered[-1][0], start)
        np.testing.assert_array_equal(entered[-1][1], rest)
    assert apart


def test_killed_after_a_fall_it_goes_on_to_the_same_bytes(tmp_path):
    scene, grid, found = first_steps(tmp_path)
    whole, facts = found[1]
    assert json.loads(facts["falls"])
    resumed_with_fall = 0
    for saves in (1, 3, 6, 12, 20):
        path = tmp_path / f"{saves}.npz"
        dying = KilledAfter(path, "key", pause=0.0)
        dying.left = saves
        try:
            mining_step(scene, grid, found[0][0], tmp_path / "failed.npz", dying)
        except Killed:
            with np.load(path) as saved:
                resumed_with_fall += len(saved["fallen_cell"]) > 0
            state, again = mining_step(scene, grid, found[0][0], tmp_path / "failed.npz", Checkpoint(path, "key"))
            assert again == facts
            assert all(np.array_equal(whole[name].values, state[name].values) for name in whole)
    assert resumed_with_fall


def test_a_mine_that_falls_on_is_caving_and_ends_there(tmp_path, monkeypatch):
    """No fall is allowed: the last equilibrium, and a step after it that is not computed."""
    monkeypatch.setattr("mpm_core.stages.step_cells.MAX_FALLS", 0)
    _, _, found = first_steps(tmp_path, count=3)
    (state, facts), (after, not_computed) = found[1:]
    assert (facts["collapsed"], facts["computed"]) == (1, 1)
    assert facts["collapse"].startswith("caving: more than 0 falls in this step")
    assert facts["unbalanced_ratio"] <= 3e-3
    assert (after.attrs["collapsed"], after.attrs["computed"], after.attrs["step_index"]) == (1, 0, 2)
    assert not_computed["failed_particles"] == 0
    assert (after.failed.values != 2).all()
    assert (after.seismic_strain.values == 0.0).all()
    assert state.seismic_strain.values.any()  # that of the step before stays
    assert np.array_equal(after.stress.values, state.stress.values)


def test_in_the_subdomain_of_a_step_the_same_rock_falls(tmp_path, monkeypatch, fallen):
    monkeypatch.setattr(step_subdomain, "MIN_MINE_CELLS", 0)
    monkeypatch.setattr(step_subdomain, "MAX_SUBDOMAIN_SHARE", 1.0)
    _, facts = first_steps(tmp_path)[2][1]
    one, other = (sum(piece["volume"] for piece in json.loads(each["falls"])) for each in (facts, fallen[2][1][1]))
    assert facts["collapsed"] == 0
    assert one == pytest.approx(other, rel=0.5)
    assert facts["energy_left_share"] < 1e-9


def test_after_a_split_a_fall_goes_back_to_the_load_of_the_last_equilibrium(tmp_path, monkeypatch):
    """In the second increment cells are split before anything fails; on them no equilibrium is found."""
    scene, grid, found = first_steps(
        tmp_path, count=1, increments=2, refinement={"rings": 1, "max_cells": 10**6, "bodies": []}
    )
    loads = []

    def generations(scheme, brittle, external, tolerance, reference, step, history, *_):
        loads.append(history.load)
        model = scheme.body.model
        if len(loads) == 2:
            largest = model.particles.cell[brittle.coarse[0]]
            return model.grid.cell_index[[largest]]
        if len(loads) == 3:
            raise NoEquilibrium("none", brittle.sound[:1])
        scheme.reach_equilibrium(external, tolerance, reference, history)
        return np.empty((0, 2), int)

    monkeypatch.setattr(cascade, "run_generations", generations)
    _, facts = mining_step(scene, grid, found[0][0], tmp_path / "failed.npz")
    assert facts["cell_splits"] == 1
    assert len(json.loads(facts["falls"])) == 1
    assert loads[:4] == [0.5, 1.0, 1.0, 1.0]


@pytest.mark.parametrize("limit", [0.02, 0.2])
def test_the_least_motion_of_a_fall_hardly_matters(tmp_path, monkeypatch, fallen, limit):
    monkeypatch.setattr(falls, "MIN_FALL", limit)
    _, facts = first_steps(tmp_path)[2][1]
    one, other = (sum(piece["volume"] for piece in json.loads(each["falls"])) for each in (facts, fallen[2][1][1]))
    assert facts["collapsed"] == 0
    assert one == pytest.approx(other, rel=0.5)


def lattice(shape) -> MultiLevelGrid:
    return grid_around([], shape, 1, 1.0)


def test_pieces_that_only_loose_rock_holds_fall_with_it():
    """A column of three cells below the roof, of which the upper one is loose: all three; the wall beside stands."""
    grid = lattice([4, 4])
    index = {tuple(at): number for number, at in enumerate(grid.cell_index // grid.cell_width[:, None])}
    void = [index[x, z] for x in (0, 2, 3) for z in (0, 1, 2)]
    changes = Changes(
        np.array(void, np.int32),
        np.full(len(void), -1, np.int16),
        np.zeros(len(void), np.int32),
        np.full(len(void), ALL_SAMPLES),
    )
    faces = {(1, 1): [0, 1]}
    found = coming_loose(grid, changes, faces, np.array([index[1, 2]]), 0)
    assert sorted(found.cell.tolist()) == sorted([index[1, 0], index[1, 1], index[1, 2]])
    assert (found.piece == 0).all()
    assert (found.fall == 1).all()
    twice = coming_loose(grid, changes, faces, np.array([index[1, 2], index[1, 2]]), 0)
    assert (twice.piece == 0).all()  # parts of one cell are one piece
    alone = coming_loose(grid, changes, faces, np.array([index[1, 0]]), 0)
    assert alone.cell.tolist() == [index[1, 0]]
    assert isinstance(found, Unsupported)


def test_a_step_that_mines_nothing_may_lose_as_much_as_all_before():
    """What falls is taken out of what the step mines: the same volumes in another order, which left a round-off."""
    grid, random = lattice([6, 6]), np.random.default_rng(1)
    weight = random.random(36)
    fell, before = np.arange(20, dtype=np.int32), np.arange(20, 36, dtype=np.int32)
    cell = np.append(before, fell)
    changes = Changes(
        cell, np.full(36, ROCK_OWNER, np.int16), np.repeat([0, 1], [16, 20]).astype(np.int32), np.full(36, ALL_SAMPLES)
    )
    found = []
    for _ in range(20):
        order = random.permutation(fell)
        loose = Unsupported(order, np.full(20, ALL_SAMPLES), *np.ones((3, 20), np.int32))
        distorted = SimpleNamespace(part_volumes=lambda cells, samples: weight[cells])
        model = SimpleNamespace(
            grid=grid, changes=changes, unsupported=loose, particles=SimpleNamespace(distorted=distorted)
        )
        found.append(mined_volume(model, 1))
    np.testing.assert_allclose(found, weight[before].sum(), rtol=1e-9)


def test_time_steps_find_falls_too(tmp_path):
    _, facts = first_steps(tmp_path, scheme="explicit")[2][1]
    assert facts["collapsed"] == 0
    assert json.loads(facts["falls"])[0]["opening"] == "drive"


def test_motion_that_slows_down_is_no_fall():
    """However large it is, as the closure of soft rock; what gains a quarter between two looks is one."""
    scene = make_scene("xz", host=LOOSE, stress=SHALLOW, surface=170.0, solver={"collapse": "fall"})
    model = make_model(scene, grid_around([], [4, 4], 1, 2.0))
    state = model.virgin_state()
    state.failed[5] = 0
    body = Body(model, state, model.volumes(0))
    for motions, falls_at in (((0.5, 0.6, 0.65), None), ((0.1, 0.4), 1), ((0.01, 0.04, 0.06), 2), ((0.01, 0.02), None)):
        watch = falls.FallWatch(body)
        for number, moved in enumerate(motions):
            body.state.displacement[:, 1] = body.rest[:, 1] - moved
            if number == falls_at:
                with pytest.raises(NoEquilibrium) as caught:
                    watch.look(0.1)
                assert 5 in caught.value.loose
            else:
                watch.look(0.1)
