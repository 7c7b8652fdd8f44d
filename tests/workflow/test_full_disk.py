"""A disk without room: one line that says so and which folder, and every earlier result as it was.

Without rights to mount a small disk: a limit on the size of files gives the same refusal (EFBIG for ENOSPC) at the same
places, and /dev/full refuses every byte.
"""

import errno
import os
import resource
import subprocess
import sys
from contextlib import contextmanager

import numpy as np
import pytest
import xarray as xr
from test_common_base import STAGE, record
from test_faults import spoken
from tiny_mines import ROOT, finished, hashes, snakemake, start

from common.datasets import atomic_path, write_dataset
from common.errors import InputError
from workflow.command_line import check_folder
from workflow.terminal import OneLine

LIMIT = 100_000  # bytes
SHRINK = "resource.setrlimit(resource.RLIMIT_FSIZE, (1000, resource.RLIM_INFINITY))"
LARGE = xr.Dataset({"stress": ("particle", np.random.default_rng(1).random(LIMIT))})


@contextmanager
def little_room(limit: int = LIMIT):
    """No file of this process may grow beyond `limit` bytes."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (limit, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


def test_a_dataset_without_room_says_so_and_the_old_one_stands(tmp_path):
    """netCDF's own words are "HDF error"."""
    path = tmp_path / "steps" / "elastic.nc"
    write_dataset(LARGE.isel(particle=slice(10)), path)
    old = path.read_bytes()
    with little_room(), pytest.raises(InputError) as told:
        write_dataset(LARGE, path)
    line = str(told.value)
    assert line.startswith(f"the disk is full: no room in {tmp_path / 'steps'} (File too large); free some")
    assert "\n" not in line
    assert path.read_bytes() == old
    assert list(path.parent.iterdir()) == [path]


def test_text_without_room_says_so(tmp_path):
    """Tables and pages are written by Python itself."""
    with little_room(), pytest.raises(InputError, match="the disk is full"), atomic_path(tmp_path / "a.csv") as file:
        file.write_text("x" * 2 * LIMIT)
    assert not list(tmp_path.iterdir())


def test_another_error_of_a_library_is_not_blamed_on_the_disk(tmp_path):
    """There is room: the error is what it is."""
    with pytest.raises(RuntimeError, match="HDF"), atomic_path(tmp_path / "a.nc") as file:  # noqa: PT012
        file.write_text("half")
        raise RuntimeError("NetCDF: HDF error")


@pytest.mark.parametrize(
    ("body", "status", "line"),
    [
        ("pass", 0, "its log /dev/full is cut short: [Errno 28]"),
        ("raise InputError('solver.tolerance: too small')", 1, "elastic tiny: solver.tolerance: too small"),
        (
            "raise OSError(28, 'No space left on device', '/data/results/x')",
            1,
            "the disk is full: no room in /data/res",
        ),
    ],
)
def test_a_log_without_room_is_one_line(body, status, line):
    """On today's disk of 40 kB a stage said 68 lines: its traceback, and that of the log."""
    run = subprocess.run(
        [sys.executable, "-c", STAGE.format(body=body), "/dev/full"], cwd=ROOT, capture_output=True, text=True
    )
    assert run.returncode == status
    assert line in run.stderr
    assert len(run.stderr.splitlines()) == 1, run.stderr


def test_no_room_for_compiled_kernels_names_their_folder(tmp_path):
    """They are written by numba, whose error names no file."""
    (tmp_path / "kernel.py").write_text("from numba import njit\n@njit(cache=True)\ndef double(x):\n    return 2 * x\n")
    body = f"from kernel import double; import resource; {SHRINK}; double(2)"
    run = subprocess.run(
        [sys.executable, "-c", STAGE.format(body=body), str(tmp_path / "elastic.log")],
        cwd=ROOT, capture_output=True, text=True,
        env=os.environ | {"NUMBA_CACHE_DIR": str(tmp_path / "kernels"), "PYTHONPATH": str(tmp_path)},
    )  # fmt: skip
    assert run.returncode == 1
    assert f"the disk is full: no room in {tmp_path / 'kernels'}" in run.stderr.splitlines()[-1]


NO_SPACE = os.strerror(errno.ENOSPC)
METADATA = (
    f"WorkflowError:\nError recording metadata for finished job ([Errno {errno.ENOSPC}] {NO_SPACE}). Please ensure "
    "write permissions for the directory /data/my mine/.snakemake"
)
TRACEBACK = (
    'Traceback (most recent call last):\n  File "x.py", line 3, in log\n    write()\n'
    f"OSError: [Errno {errno.EDQUOT}] {os.strerror(errno.EDQUOT)}: '/data/my mine/.snakemake/incomplete/abc'"
)


@pytest.mark.parametrize(
    ("message", "folder", "reason"),
    [
        (METADATA, "/data/my mine/.snakemake", NO_SPACE),
        (TRACEBACK, "/data/my mine/.snakemake/incomplete", os.strerror(errno.EDQUOT)),
        (f"Traceback\nOSError: [Errno {errno.ENOSPC}] {NO_SPACE}", os.getcwd(), NO_SPACE),
    ],
)
def test_snakemakes_own_failure_is_one_line(message, folder, reason):
    """Its metadata do not fit; told once."""
    one, terminal = record(message, "error"), OneLine()
    assert terminal.filter(one)
    assert one.msg.startswith(f"the disk is full: no room in {folder} ({reason})")
    assert "\n" not in one.msg
    assert not terminal.filter(record(message, "error"))


def test_a_folder_without_any_room_is_one_line(tmp_path):
    """Before Snakemake writes its log, whose every lost line was a traceback."""
    with little_room(1000), pytest.raises(InputError, match=f"the disk is full: no room in {tmp_path} ") as refused:
        check_folder(tmp_path)
    assert len(refused.value.lines) == 1
    check_folder(tmp_path)


@pytest.mark.slow
def test_a_run_on_a_full_disk_says_one_line_and_goes_on_when_there_is_room(spoiled, tiny_file, undisturbed):
    """The elastic state of 400 kB finds no room; nothing else is touched, and it is then made as ever."""
    results = spoiled / "results/tiny"
    (results / "elastic.nc").unlink()
    before = hashes(results)
    run = start(tiny_file, spoiled)
    resource.prlimit(run.pid, resource.RLIMIT_FSIZE, (200_000, resource.RLIM_INFINITY))
    status, text = finished(run)
    assert status != 0
    lines = spoken(text)
    assert len(lines) == 1, text
    assert "the disk is full: no room in" in lines[0]
    assert str(results) in lines[0]
    assert hashes(results) == before
    status, text = snakemake(tiny_file, spoiled, "results/tiny/elastic.nc")
    assert status == 0, text
    assert hashes(results) == hashes(undisturbed[0] / "results/tiny")
