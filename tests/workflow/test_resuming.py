"""kill -9 in the middle: no stage lives on, and what follows is as if nothing had happened."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import psutil
import pytest
from tiny_mines import hashes, jobs, snakemake, start

from common.costs import cost_of

ROOT = Path(__file__).parents[2]
# A stage that keeps every generation and is killed as it has kept the second: what a stage of hours comes to.
KILLED_WITHIN = """
import os, signal
from workflow import __main__
from mpm_core.stages import checkpoint
from common.costs import CLOCK
save = checkpoint.Checkpoint.save
def save_and_die(self, state, history, *rest):
    self.pause = self.cost = 0.0
    CLOCK.go_on((1000.0, 2000.0, 500.0))  # as if it had been at work for long
    save(self, state, history, *rest)
    if history.generation == 2:
        os.kill(os.getpid(), signal.SIGKILL)
checkpoint.Checkpoint.save = save_and_die
__main__.main()
"""
STEPS = ("results/tiny/steps/history.nc", "results/tiny/steps/2019-08.nc")
PATIENCE = 120  # s, for a slow machine; no result depends on it


def await_(condition):
    """What `condition` gives, once it gives something."""
    for _ in range(PATIENCE * 50):
        if found := condition():
            return found
        time.sleep(0.02)
    raise AssertionError("waited in vain")


def has_ended(process: psutil.Process) -> bool:
    try:
        return not process.is_running() or process.status() == psutil.STATUS_ZOMBIE
    except psutil.NoSuchProcess:  # between these two
        return True


def stage_of(snakemake: psutil.Process, name: str) -> psutil.Process | None:
    """The child of Snakemake that runs this stage, once the shell has become it."""
    for child in snakemake.children(recursive=True):
        try:
            words = child.cmdline()
            if "workflow" in words and any(f"/jobs/{name}" in word for word in words):
                return child
        except psutil.Error:  # it ended in between
            continue
    return None


@pytest.mark.slow
def test_killed_in_a_mechanics_stage_and_resumed_gives_the_same_bytes(spoiled, tiny_file, undisturbed):
    """Twice: as the stage starts, before it could say whom it belongs to, and in the midst of its work.

    Only Snakemake is killed; its stage must end by itself. Then --unlock and --rerun-incomplete, up to the last step.
    """
    results, log = spoiled / "results/tiny", spoiled / "logs/tiny/steps/history.log"
    (results / "steps/history.nc").unlink()
    log.unlink()
    for at_work in (False, True):
        run = start(tiny_file, spoiled, "--rerun-incomplete")
        process = psutil.Process(run.pid)
        stage = await_(lambda process=process: stage_of(process, "step"))
        if at_work:
            await_(log.exists)
        os.kill(run.pid, signal.SIGKILL)
        run.wait()
        await_(lambda stage=stage: has_ended(stage))
        assert not (results / "steps/history.nc").exists()
        status, text = snakemake(tiny_file, spoiled, "--unlock")
        assert status == 0, text
    status, text = snakemake(tiny_file, spoiled, "--rerun-incomplete", *STEPS)
    assert status == 0, text
    assert jobs(text) == {"step": 2}
    assert hashes(results) == hashes(undisturbed[0] / "results/tiny")


@pytest.mark.slow
def test_killed_within_a_step_it_goes_on_inside_it_to_the_same_bytes(spoiled, tiny_file, undisturbed):
    """kill -9 between two generations of failure: they are not repeated, and the result is that of one go.

    What the stage took holds what the killed process took.
    """
    results, log = spoiled / "results/tiny", spoiled / "logs/tiny/steps/history.log"
    (results / "steps/history.nc").unlink()
    run = start(tiny_file, spoiled, "--rerun-incomplete")
    command = await_(lambda: stage_of(psutil.Process(run.pid), "step")).cmdline()
    os.kill(run.pid, signal.SIGKILL)
    run.wait()
    arguments = command[command.index("workflow") + 1 :]
    killed = subprocess.run(
        [sys.executable, "-c", KILLED_WITHIN, *arguments], cwd=spoiled, env={**os.environ, "PYTHONPATH": str(ROOT)}
    )
    assert killed.returncode == -signal.SIGKILL
    assert (results / "steps/history.checkpoint.npz").exists()
    assert not (results / "steps/history.nc").exists()
    assert snakemake(tiny_file, spoiled, "--unlock")[0] == 0
    status, text = snakemake(tiny_file, spoiled, "--rerun-incomplete", *STEPS)
    assert status == 0, text
    assert "going on from increment 1, generation 2" in log.read_text()
    assert not (results / "steps/history.checkpoint.npz").exists()
    costs = cost_of(log)
    assert costs.compiling >= 500.0
    assert 1000.0 < costs.seconds < 2000.0 < costs.processor < 3000.0
    assert hashes(results) == hashes(undisturbed[0] / "results/tiny")


def test_whole_process_group_killed_early_leaves_no_half_file(base, tiny_file):
    """kill -9 of everything while the grid is made: no dataset, or a whole one."""
    folder = base / "cut short"
    run = start(tiny_file, folder)
    await_(lambda: stage_of(psutil.Process(run.pid), "grid"))
    os.killpg(run.pid, signal.SIGKILL)
    run.wait()
    left = hashes(folder / "results")
    assert set(left) <= {"tiny/grid.nc", "tiny/record.nc"}
