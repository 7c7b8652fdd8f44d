"""`--profile profiles/slurm` on a cluster of two nodes: a node dies, Snakemake is killed; results as of a local run."""

import os
import re
import shutil
import signal
import subprocess
import sys
import tempfile
from importlib.util import find_spec
from pathlib import Path

import pytest
from slurm_cluster import NODES, PARTITION, Cluster, reason_against
from test_calibration_runs import CALIBRATED
from tiny_mines import ROOT, changed, finished, hashes, snakemake, write_mine

if AGAINST := reason_against() or ("" if find_spec("snakemake_executor_plugin_slurm") else "needs the extra slurm"):
    pytest.skip(f"a cluster {AGAINST}", allow_module_level=True)

pytestmark = [pytest.mark.slow, pytest.mark.slurm]
MINE = changed(CALIBRATED, **{"grid.levels": 3, "grid.max_cells": 12000})  # trials of some seconds
TRIALS = ("2", "3")
TARGETS = [f"results/tiny/calibration/own/{trial}.nc" for trial in TRIALS]
OF_LOOPBACK = {  # what a site sets
    "--default-resources": f"slurm_partition={PARTITION}",
    "--slurm-status-command": "squeue",
    "--slurm-init-seconds-before-status-checks": "1",
    "--max-threads": "1",
    "--latency-wait": "5",
}
COMPARED = (".nc", ".json")


@pytest.fixture
def cluster():
    """The cluster, which ends with the test. A socket's path may have 108 letters: folders of pytest are longer."""
    with tempfile.TemporaryDirectory(prefix="slurm") as folder, Cluster(Path(folder)) as two_nodes:
        yield two_nodes


@pytest.fixture(scope="module")
def mine_file(tmp_path_factory) -> Path:
    """The mine's file; a space in its folder, as on many users' shares."""
    return write_mine(MINE, tmp_path_factory.mktemp("cluster") / "block caves" / "tiny.yaml")


@pytest.fixture(scope="module")
def local(mine_file) -> Path:
    """Folder of a run without a cluster."""
    folder = mine_file.parent / "local"
    status, text = snakemake(mine_file, folder, *TARGETS)
    assert status == 0, text
    return folder


def without(local: Path, name: str, *trials: str) -> Path:
    """A copy of the local run, time stamps and Snakemake's notes included, as before some of its trials."""
    folder = local.parent / name
    shutil.copytree(local, folder)
    for trial in trials:
        (folder / f"results/tiny/calibration/own/{trial}.nc").unlink()
        (folder / f"logs/tiny/calibration/own/{trial}.log").unlink()
    return folder


def submit(cluster: Cluster, mine_file: Path, folder: Path) -> subprocess.Popen:
    """Snakemake on the cluster, as docs/how-to/cluster.md has it."""
    profile = ["--profile", str(ROOT / "profiles" / "slurm"), *(word for pair in OF_LOOPBACK.items() for word in pair)]
    words = [*TARGETS, *profile, "--directory", str(folder), "--snakefile", str(ROOT / "Snakefile")]
    return subprocess.Popen(
        [sys.executable, "-m", "snakemake", *words, "--configfile", str(mine_file)],
        env=cluster.environment | {"PYTHONIOENCODING": "utf-8"},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        encoding="utf-8",
        start_new_session=True,
    )


def job_of(cluster: Cluster, trial: str) -> dict[str, str]:
    """The latest job of a trial; empty if there is none."""
    found = [job for job in cluster.jobs() if job["comment"] == f"rule_trial_wildcards_own_{trial}"]
    return found[-1] if found else {}


def trial_on(cluster: Cluster, node: str) -> str:
    """The trial whose job a node runs; empty if there is none."""
    return next((trial for trial in TRIALS if job_of(cluster, trial).get("node") == node), "")


def is_at_work(folder: Path, trial: str) -> bool:
    """Whether a trial has begun to solve its steps."""
    log = folder / f"logs/tiny/calibration/own/{trial}.log"
    return log.is_file() and "generation" in log.read_text()


def test_trials_of_a_dead_node_are_run_on_the_other_to_the_same_bytes(cluster, mine_file, local):
    """One trial on each node. The second node dies in the middle of its trial, and stays dead."""
    folder = without(local, "node", *TRIALS)
    run = submit(cluster, mine_file, folder)
    killed = cluster.await_(lambda: trial_on(cluster, NODES[1]), "a job on the second node")
    cluster.await_(lambda: is_at_work(folder, killed), f"trial {killed}")
    before = job_of(cluster, killed)
    cluster.kill_node(NODES[1])
    assert before["state"] == "RUNNING"
    assert not (folder / f"results/tiny/calibration/own/{killed}.nc").exists()
    status, text = finished(run)
    assert status == 0, text
    assert job_of(cluster, killed) == before | {"node": NODES[0], "state": "COMPLETED"}
    assert "Restarts=1" in cluster.ask("scontrol", "show", "job", before["number"])
    found = hashes(folder / "results", COMPARED)
    assert set(TARGETS) <= {f"results/{path}" for path in found}
    assert found == hashes(local / "results", COMPARED)


def test_snakemake_that_was_killed_goes_on_and_repeats_nothing(cluster, mine_file, local):
    """One trial is finished, one at work. Its job is cancelled by its run; then --unlock, and the same command."""
    folder = without(local, "snakemake", TRIALS[1])
    run = submit(cluster, mine_file, folder)
    cluster.await_(lambda: is_at_work(folder, TRIALS[1]), "the trial")
    os.kill(run.pid, signal.SIGKILL)
    text, _ = run.communicate()
    name = re.search(r"^SLURM run ID: (\S+)$", text, re.MULTILINE)
    assert name, text
    assert job_of(cluster, TRIALS[1])["state"] == "RUNNING"
    cluster.ask("scancel", f"--name={name[1]}")
    cluster.await_(lambda: not cluster.ask("squeue", "--noheader", f"--name={name[1]}"), "the end of the job")
    assert job_of(cluster, TRIALS[1])["state"] == "CANCELLED"
    assert not (folder / TARGETS[1]).exists()
    assert snakemake(mine_file, folder, "--unlock")[0] == 0
    status, text = finished(submit(cluster, mine_file, folder))
    assert status == 0, text
    assert [job["comment"] for job in cluster.jobs()] == ["rule_trial_wildcards_own_3"] * 2
    assert hashes(folder / "results", COMPARED) == hashes(local / "results", COMPARED)
