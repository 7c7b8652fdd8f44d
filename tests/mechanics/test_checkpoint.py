"""A stage that was killed goes on from its checkpoint, to the same bytes."""

import subprocess
import sys

import numpy as np
import pytest

from common.datasets import write_dataset
from mechanics.killed import Killed, KilledAfter
from mechanics.scenes import COULOMB, ball, excavation, grid_around, make_dataset, make_scene, uniform
from mpm_core.equilibrium.convergence import History
from mpm_core.stages.checkpoint import Checkpoint, key_of
from mpm_core.stages.equilibrium_stages import elastic_stage, mining_step

HOLES = [ball([14.0, 20.0], 4.0), ball([25.0, 20.0], 4.0)]


@pytest.fixture(scope="module", params=["explicit", "multigrid"])
def stage(tmp_path_factory, request):
    """A brittle step in two increments, among rock that an earlier step has let fail, and its dataset's bytes."""
    folder = tmp_path_factory.mktemp("stage")

    def scene_of(*mined):
        return make_scene(
            "xz",
            host=COULOMB,
            stress=uniform(-30e6, -20e6, -18e6, 0.0, 3e6),
            excavations=[excavation(step) for step in mined],
            steps=max(mined) + 1,
            solver={"scheme": request.param, "tolerance": 1e-4, "increments": 2},
        )

    first, scene = scene_of(1, -1), scene_of(1, 2)
    grid = make_dataset(scene, grid_around(HOLES, [5, 5], 3, 8.0, rings=2), HOLES)
    elastic, _ = elastic_stage(first, grid, folder / "f.npz")
    before, facts = mining_step(first, grid, elastic, folder / "f.npz")
    assert facts["failed_particles"] > 10

    def run(checkpoint):
        return mining_step(scene, grid, before, folder / "f.npz", checkpoint)[0]

    return run, run(None)


def content(dataset, path) -> bytes:
    write_dataset(dataset, path)
    return path.read_bytes()


@pytest.mark.parametrize("early", [True, False])
def test_a_killed_step_goes_on_and_ends_in_the_same_bytes(stage, early, tmp_path):
    """Killed after the first generation, or before the last; what was done before is not done again."""
    run, whole = stage
    path = tmp_path / "step.checkpoint.npz"
    failures = whole.convergence_new_failures.values > 0
    assert len(np.unique(whole.convergence_increment.values[failures])) == 2
    saved_in_all = int(failures.sum())
    generations = 1 if early else saved_in_all - 1
    dying = KilledAfter(path, "inputs", pause=0.0)
    dying.left = generations
    with pytest.raises(Killed):
        run(dying)
    assert path.exists()
    going_on = KilledAfter(path, "inputs", pause=0.0)
    resumed = run(going_on)
    assert -going_on.left == saved_in_all - generations
    assert content(resumed, tmp_path / "a.nc") == content(whole, tmp_path / "b.nc")
    assert not path.exists()


def test_a_checkpoint_of_other_inputs_or_a_broken_one_is_left_aside(stage, tmp_path):
    run, whole = stage
    path = tmp_path / "step.checkpoint.npz"
    dying = KilledAfter(path, "other inputs", pause=0.0)
    dying.left = 2
    with pytest.raises(Killed):
        run(dying)
    assert content(run(Checkpoint(path, "inputs")), tmp_path / "a.nc") == content(whole, tmp_path / "b.nc")
    for broken in (b"", b"PK\x03\x04 cut short"):
        path.write_bytes(broken)
        assert not Checkpoint(path, "inputs").read()


def test_a_stage_that_ends_clears_what_a_kill_left_of_a_checkpoint(stage, tmp_path):
    """Killed as it wrote one; the next run ends before it is time for another."""
    run, _ = stage
    with subprocess.Popen([sys.executable, "-c", ""]) as dead:
        dead.wait()
    left = tmp_path / f".step.checkpoint.npz.{dead.pid}.part"
    left.write_bytes(b"half")
    run(Checkpoint(tmp_path / "step.checkpoint.npz", "inputs"))
    assert not list(tmp_path.iterdir())


def test_writing_takes_a_small_share_of_the_time(stage, tmp_path):
    """A checkpoint that cost 10 s is not written again for minutes, however short the pause."""
    checkpoint = Checkpoint(tmp_path / "c.npz", "inputs", pause=0.0, cost=10.0)
    checkpoint.save(None, History(1e-5), None)
    assert not checkpoint.path.exists()


def test_the_key_follows_every_input(tmp_path):
    a, b = tmp_path / "a", tmp_path / "b"
    a.write_bytes(b"1")
    b.write_bytes(b"2")
    keys = {key_of({"config_hash": "x"}, a), key_of({"config_hash": "y"}, a), key_of({"config_hash": "x"}, b)}
    assert len(keys) == 3
    assert key_of({"config_hash": "x"}, a) in keys
