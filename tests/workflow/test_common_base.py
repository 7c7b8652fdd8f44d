"""What every stage shares: whole files or none, the same bytes, one line on error, a cache per version of sources."""

import logging
import os
import shutil
import subprocess
import sys

import numpy as np
import pytest
import xarray as xr
from tiny_mines import ROOT

from common import kernel_cache
from common.datasets import atomic_path, read_dataset, write_dataset
from common.errors import InputError
from common.job import config_hash
from common.stage import PARENT
from workflow.terminal import OneLine


def test_a_failed_write_leaves_the_old_file_and_nothing_else(tmp_path):
    """The body raises after it has written half."""
    path = tmp_path / "grid.nc"
    path.write_text("old")
    with pytest.raises(RuntimeError), atomic_path(path) as temporary:  # noqa: PT012
        temporary.write_text("half")
        raise RuntimeError
    assert path.read_text() == "old"
    assert list(tmp_path.iterdir()) == [path]


def test_a_good_write_replaces_the_old_file_and_makes_its_folder(tmp_path):
    """And two processes would not share the temporary name."""
    path = tmp_path / "steps" / "2019-08.nc"
    for text in ("one", "two"):
        with atomic_path(path) as temporary:
            assert str(os.getpid()) in temporary.name
            temporary.write_text(text)
        assert path.read_text() == text
    assert list(path.parent.iterdir()) == [path]


def test_the_next_write_clears_what_a_killed_one_left(tmp_path):
    """A process killed as it wrote leaves its part; a part whose writer lives, and those of other files, stay."""
    with subprocess.Popen([sys.executable, "-c", ""]) as dead:
        dead.wait()
    parts = {
        name: tmp_path / f".{name}.{process}.part"
        for name, process in (("a[1].nc", dead.pid), ("b.nc", dead.pid), ("a[1].nc.npz", dead.pid))
    }
    living = tmp_path / f".a[1].nc.{os.getppid()}.part"
    for part in (*parts.values(), living):
        part.write_text("half")
    with atomic_path(tmp_path / "a[1].nc") as temporary:
        temporary.write_text("whole")
    left = {path.name for path in tmp_path.iterdir()}
    assert left == {"a[1].nc", living.name, parts["b.nc"].name, parts["a[1].nc.npz"].name}


def dataset() -> xr.Dataset:
    """Every kind of variable that a result holds, two of them long and empty enough to be compressed."""
    random = np.random.default_rng(5)
    values = {
        "stress": (("particle", "voigt"), random.normal(size=(5000, 6))),
        "plastic_strain": (("particle", "voigt"), random.normal(size=(5000, 6)) * (random.random((5000, 1)) < 0.1)),
        "failed": ("particle", random.integers(-1, 3, 5000).astype(np.int32)),
        "time": ("event", np.array(["2019-08-01", "NaT"], "datetime64[ns]")),
        "step": ("event", np.array(["2019-08", ""], object)),
    }
    return xr.Dataset(values, attrs={"mine": "tiny", "dated": 1})


def test_bytes_depend_on_the_content_alone(tmp_path):
    """Twice the same dataset, twice the same file; and it reads back as it was."""
    for name in ("one.nc", "two.nc"):
        write_dataset(dataset(), tmp_path / name)
    assert (tmp_path / "one.nc").read_bytes() == (tmp_path / "two.nc").read_bytes()
    xr.testing.assert_identical(read_dataset(tmp_path / "one.nc"), dataset())


def test_what_shrinks_is_compressed(tmp_path):
    """Tensors in chunks of whole rows; noise stays as it is."""
    write_dataset(dataset(), tmp_path / "one.nc")
    stored = {name: variable.encoding for name, variable in read_dataset(tmp_path / "one.nc").variables.items()}
    assert stored["plastic_strain"]["zlib"]
    assert stored["plastic_strain"]["chunksizes"] == (5000, 6)
    assert stored["failed"]["zlib"]
    assert not stored["stress"]["zlib"]


def test_some_variables_are_read_without_the_others(tmp_path):
    """Those that there are; all attributes."""
    write_dataset(dataset(), tmp_path / "one.nc")
    xr.testing.assert_identical(read_dataset(tmp_path / "one.nc", ["failed", "none"]), dataset()[["failed"]])


@pytest.mark.parametrize("content", [None, b"", b"no netCDF", b"\x89HDF\r\n\x1a\n" + bytes(100)])
def test_unreadable_dataset_is_named(tmp_path, content):
    """Missing, empty, cut off: the file, and what to do."""
    path = tmp_path / "elastic.nc"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(
        InputError, match=r"elastic\.nc: not a readable dataset .* delete it and run the same command again"
    ):
        read_dataset(path)


def test_config_hash_sees_values_but_not_order_or_folder():
    """The same mine in another checkout, or run from another folder, is the same mine."""
    values = {"levels": 4, "excavations": [{"name": "stope", "file": "../mine/stope.stl"}]}
    moved = {"excavations": [{"file": "elsewhere/stope.stl", "name": "stope"}], "levels": 4}
    other = {"levels": 4, "excavations": [{"name": "stope", "file": "../mine/slot.stl"}]}
    assert config_hash(values) == config_hash(moved)
    assert config_hash(values) != config_hash(other)
    assert config_hash(values) != config_hash(values | {"levels": 5})


def test_numba_cache_is_named_by_the_sources_with_kernels_and_pruned(tmp_path, monkeypatch):
    """An edit in any file that mentions numba is a new folder; one elsewhere is not; the latest few stay."""
    for folder in ("mpm_core", "seismic"):
        (tmp_path / folder).mkdir()
    kernel, plain = tmp_path / "mpm_core/kernel.py", tmp_path / "seismic/plain.py"
    kernel.write_text("from numba import njit\n")
    plain.write_text("x = 1\n")
    monkeypatch.setattr(kernel_cache, "ROOT", tmp_path)
    once = kernel_cache.kernel_hash.__wrapped__  # a process asks for it once
    monkeypatch.setattr(kernel_cache, "kernel_hash", once)
    monkeypatch.setattr(sys.modules["numba"].config, "CACHE_DIR", "") if "numba" in sys.modules else None

    def folder() -> str:
        monkeypatch.delenv("NUMBA_CACHE_DIR", raising=False)
        kernel_cache.use_numba_cache()
        return os.environ["NUMBA_CACHE_DIR"]

    first = folder()
    plain.write_text("x = 2\n")
    assert folder() == first
    kernel.write_text("from numba import njit  # edited\n")
    second = folder()
    assert second != first
    for number in range(4):
        os.utime(
            folder(), (2e9 + number, 2e9 + number)
        )  # in the future: a clock that was set back prunes nothing in use
        kernel.write_text(f"from numba import njit  # {number}\n")
    latest = folder()
    left = {path.name for path in (tmp_path / ".numba_cache").iterdir()}
    assert len(left) == kernel_cache.CACHES_KEPT
    assert os.path.basename(latest) in left
    assert os.path.basename(first) not in left


def test_users_own_cache_folder_is_respected(tmp_path, monkeypatch):
    """NUMBA_CACHE_DIR set from outside holds a folder of this version's kernels, which processes below this one use,
    too. What else is in it stays. A variable in it is that of the node; without it the usual folder is taken."""
    monkeypatch.setattr(sys.modules["numba"].config, "CACHE_DIR", "") if "numba" in sys.modules else None
    for number in range(5):
        (tmp_path / f"mine/other_{number}").mkdir(parents=True)
    own = tmp_path / "mine" / kernel_cache.kernel_hash()
    for given in (tmp_path / "mine", own):
        monkeypatch.setenv("NUMBA_CACHE_DIR", str(given))
        kernel_cache.use_numba_cache()
        assert os.environ["NUMBA_CACHE_DIR"] == str(own)
    assert len(list((tmp_path / "mine").iterdir())) == 6
    monkeypatch.setenv("SCRATCH_OF_NODE", str(tmp_path / "node"))
    monkeypatch.setenv("NUMBA_CACHE_DIR", "$SCRATCH_OF_NODE/kernels")
    kernel_cache.use_numba_cache()
    assert os.environ["NUMBA_CACHE_DIR"] == str(tmp_path / "node/kernels" / own.name)
    monkeypatch.delenv("SCRATCH_OF_NODE")
    monkeypatch.setenv("NUMBA_CACHE_DIR", "$SCRATCH_OF_NODE/kernels")
    kernel_cache.use_numba_cache()
    assert os.environ["NUMBA_CACHE_DIR"] == str(kernel_cache.ROOT / ".numba_cache" / own.name)


def run_on_read_only_checkout(tmp_path, **environment) -> subprocess.CompletedProcess:
    """A kernel compiled twice by a checkout in which no folder can be made (a file has its name)."""
    checkout = tmp_path / "checkout"
    shutil.copytree(ROOT / "common", checkout / "common", ignore=shutil.ignore_patterns("__pycache__"))
    (checkout / ".numba_cache").write_text("")
    (checkout / "mpm_core").mkdir()
    package = "from common.kernel_cache import use_numba_cache\nuse_numba_cache()\n"
    (checkout / "mpm_core/__init__.py").write_text(package)
    kernel = "from numba import njit\n@njit(cache=True)\ndef double(x):\n    return 2 * x\n"
    (checkout / "mpm_core/kernel.py").write_text(kernel)
    program = "from mpm_core.kernel import double; print(double(2), sum(double.stats.cache_hits.values()))"
    inherited = {name: value for name, value in os.environ.items() if name not in ("NUMBA_CACHE_DIR", "XDG_CACHE_HOME")}
    command = [sys.executable, "-B", "-c", program]
    for _ in range(2):
        run = subprocess.run(
            command, cwd=checkout, env=inherited | environment, capture_output=True, text=True, check=False
        )
    return run


@pytest.mark.parametrize("variable", ["XDG_CACHE_HOME", "HOME"])
def test_a_read_only_checkout_keeps_its_kernels_with_the_user(tmp_path, variable):
    """The second process finds what the first compiled."""
    run = run_on_read_only_checkout(tmp_path, **{variable: str(tmp_path / "user")})
    assert run.stdout.split() == ["4", "1"], run.stderr
    folder = tmp_path / "user" / ("" if variable == "XDG_CACHE_HOME" else ".cache") / "rockburst-mpm/numba"
    assert list(folder.rglob("kernel.double*.nbc"))


def test_nowhere_to_keep_kernels_is_one_line(tmp_path):
    """Neither in the checkout nor at home: what to set."""
    (tmp_path / "user").write_text("")
    run = run_on_read_only_checkout(tmp_path, HOME=str(tmp_path / "user"))
    assert run.returncode == 1
    assert len(run.stderr.splitlines()) == 1, run.stderr
    assert "set NUMBA_CACHE_DIR" in run.stderr


STAGE = """
import sys
from common.errors import InputError
from common.stage import run_stage
def body():
    {body}
run_stage("elastic tiny", sys.argv[1], body)
"""


@pytest.mark.parametrize(
    ("body", "status", "line"),
    [
        ("raise InputError('solver.tolerance: too small;\\n raise it')", 1, "solver.tolerance: too small; raise it"),
        ("raise MemoryError", 1, "out of memory; larger cells"),
        ("[][1]", 1, "unexpected IndexError: list index out of range; traceback in "),
        ("raise KeyboardInterrupt", 130, ""),
        ("pass", 0, " MiB"),
    ],
)
def test_a_stage_says_one_line_and_logs_the_rest(tmp_path, body, status, line):
    """Exit status, one line on stderr that begins with the stage, and the traceback in the log alone."""
    log = tmp_path / "logs" / "elastic.log"
    run = subprocess.run(
        [sys.executable, "-c", STAGE.format(body=body), str(log)], cwd=ROOT, capture_output=True, text=True
    )
    assert run.returncode == status
    assert len(run.stderr.splitlines()) == bool(line)
    assert line in run.stderr
    if line:
        assert run.stderr.startswith("elastic tiny: ")
    assert ("Traceback" in log.read_text()) == (status == 1)


@pytest.mark.parametrize("body", ["raise InputError('no particle')", "raise MemoryError", "[][1]"])
@pytest.mark.parametrize(
    ("folder", "note"),
    [
        ("tiny/coarse", " (the mine on cells of twice the size; grid_convergence: false leaves it out): "),
        ("tiny/ensemble/2", " (a perturbed member; ensemble: 0 leaves all of them out, for plans hazard.runs: 1): "),
        ("tiny/drawn_rock/1", " (rock that the calibration has drawn; hazard.rock: mine_file leaves it out): "),
        ("tiny/plans/late", " (another plan of the mine; without it in plans it is left out): "),
        ("coarse", ": "),
        ("verification/disc/coarse", ": "),
    ],
)
def test_a_run_beside_the_mines_own_that_fails_says_what_it_is_and_how_to_go_without(tmp_path, body, folder, note):
    """The mine's own run may be fine. A mine of that name and a variant of a study are no companions."""
    name = f"elastic results/{folder}/elastic.nc"
    text = STAGE.format(body=body).replace("elastic tiny", name)
    line = [sys.executable, "-c", text, str(tmp_path / "elastic.log")]
    run = subprocess.run(line, cwd=ROOT, capture_output=True, text=True)
    assert run.stderr.startswith(name + note)


def test_a_warning_is_told_on_the_terminal_and_in_the_log(tmp_path):
    """Ours; not what a library thinks worth a word."""
    log = tmp_path / "grid.log"
    body = "import logging; logging.getLogger('fonts').warning('none'); logging.warning('drive reaches %s', 'beyond')"
    run = subprocess.run(
        [sys.executable, "-c", STAGE.format(body=body), str(log)], cwd=ROOT, capture_output=True, text=True
    )
    told, done = run.stderr.splitlines()
    assert told == "elastic tiny: drive reaches beyond"
    assert done.endswith(" MiB")
    assert "drive reaches beyond" in log.read_text()


SLOW_STAGE = """
import logging, sys, time
from common import progress
from common.stage import run_stage
progress.SECONDS_TO_FIRST_LINE, progress.SECONDS_BETWEEN_LINES = 0.1, 0.5
def body():
    logging.info("increment 1 of 2\\nand more")
    time.sleep(1.4)
run_stage("elastic tiny", sys.argv[1], body, "elastic equilibrium")
"""


def test_a_stage_that_takes_long_says_what_it_does_and_where_it_stands(tmp_path):
    """Without a terminal's progress bar: a line at its start, the latest line of its log now and then, and its end."""
    log = tmp_path / "elastic.log"
    run = subprocess.run([sys.executable, "-c", SLOW_STAGE, str(log)], cwd=ROOT, capture_output=True, text=True)
    first, *between, last = run.stderr.splitlines()
    assert first == f"elastic tiny: elastic equilibrium; log: {log}"
    assert 1 <= len(between) <= 6  # a busy machine may stretch the stage
    assert all(line.startswith("elastic tiny: increment 1 of 2 (") for line in between), between
    assert last.endswith(" MiB")


def test_a_stage_whose_pipeline_is_gone_does_not_start(tmp_path):
    """The parent named in the environment ended before the stage could ask to end with it."""
    with subprocess.Popen([sys.executable, "-c", ""]) as parent:
        parent.wait()
    environment = os.environ | {PARENT: str(parent.pid)}
    script = STAGE.format(body="open(sys.argv[1] + '.made', 'w')")
    run = subprocess.run([sys.executable, "-c", script, str(tmp_path / "log")], cwd=ROOT, env=environment)
    assert run.returncode == 1
    assert list(tmp_path.iterdir()) == []


FAILED = "RuleException:\nCalledProcessError in file \"x.smk\", line 3:\nCommand 'stage --output a.nc --log l' "


def record(message: str, event: str | None = None) -> logging.LogRecord:
    """A message as Snakemake's logger passes it on."""
    from snakemake_interface_logger_plugins.common import LogEvent

    values = {"event": LogEvent(event)} if event else {}
    return logging.makeLogRecord({"msg": message, "levelno": logging.INFO, **values})


@pytest.mark.parametrize(
    ("message", "event", "shown"),
    [
        ("Select jobs to execute...", None, False),
        ("Nothing to be done (all requested files are present and up to date).", None, True),
        ("Finished jobid: 1", "job_finished", False),
        ("Removing output files of failed job report since they might be corrupted:\nfigures", None, False),
        ("Exiting because a job execution failed. Look above for error messages", None, False),
        (FAILED + "returned non-zero exit status 1.", "error", False),
        (FAILED + "died with <Signals.SIGKILL: 9>.", "error", True),
        ("LockException:\nDirectory cannot be locked.", "error", True),
        ("MissingInputException in rule grid", "error", True),
    ],
)
def test_terminal_drops_chatter_and_keeps_errors(message, event, shown):
    """What the stage has told itself is not told again; what it could not tell is."""
    assert OneLine().filter(record(message, event)) == shown


def test_progress_is_told_in_jobs():
    """Snakemake's word, steps, is that for the months of a mine."""
    one = record("3 of 12 steps (25%) done", "progress")
    one.done, one.total = 3, 12
    assert OneLine().filter(one)
    assert one.msg == "3 of 12 jobs (25%) done"


def test_a_job_that_a_cluster_ended_is_told_with_its_logs():
    """Its stage cannot say so on this terminal. A stage on this machine has said it itself."""
    one = record("Error in rule grid, jobid: 3", "job_error")
    one.output, one.log = ["results/tiny/grid.nc"], ["logs/tiny/grid.log", "slurm/19.log"]
    one.rule_msg = "SLURM-job '19' failed, SLURM status is: 'TIMEOUT'.For further error details see the cluster's log."
    assert OneLine().filter(one)
    told = "results/tiny/grid.nc: SLURM-job '19' failed, SLURM status is: 'TIMEOUT'; see "
    assert one.msg == told + "logs/tiny/grid.log and slurm/19.log"
    assert one.event is None  # shown where rules are quiet
    local = record("Error in rule grid, jobid: 3", "job_error")
    local.rule_msg = None
    assert OneLine().filter(local)
    assert local.event is not None


def test_the_table_of_jobs_is_told_once():
    """A dry run of Snakemake shows it twice."""
    one, table = OneLine(), record("Job stats:\njob  count", "run_info")
    assert [one.filter(table), one.filter(table)] == [True, False]


def test_a_killed_stage_is_told_without_its_command():
    """The out-of-memory killer leaves a stage no time for a line of its own."""
    one = record(FAILED + "died with <Signals.SIGKILL: 9>.", "error")
    assert OneLine().filter(one)
    assert one.msg.startswith("a.nc: died with <Signals.SIGKILL: 9>.")
    assert "\n" not in one.msg
