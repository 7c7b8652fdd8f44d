"""Kernels that processes compile at the same time keep files of their own."""

import errno
import importlib
import itertools
import multiprocessing
import os
import signal
import subprocess
import sys
import threading
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from unittest.mock import Mock

import numba
import pytest
from numba import types
from numba.core.caching import IndexDataCacheFile

from common import kernel_files
from common.kernel_files import share_kernel_files

ROOT = Path(__file__).parents[2]
ACCESSES = ("_load_index", "_save_index", "_save_data")
KERNEL = """
from numba import njit

@njit(cache=True)
def total(values):
    result = 0.0
    for value in values:
        result += value
    return result
"""
CHANGED = """
import sys
import mpm_core
assert "numba" not in sys.modules
from numba.core.caching import IndexDataCacheFile
print(IndexDataCacheFile.save.__module__, end="")
"""


@pytest.fixture
def files(tmp_path) -> list[IndexDataCacheFile]:
    """The files of one kernel as two processes see them."""
    share_kernel_files()
    return [IndexDataCacheFile(str(tmp_path), "kernel", "stamp") for _ in range(2)]


def save_in_order(files, keys, order) -> None:
    """Both save a kernel for their own types; order: whose access to the disk comes next, by number."""
    left, turn = list(order), threading.Condition()

    def in_turn(number, access):
        def wait_and_access(*arguments):
            with turn:
                assert turn.wait_for(lambda: left[0] == number, timeout=10.0)
                try:
                    return access(*arguments)
                finally:
                    left.pop(0)
                    turn.notify_all()

        return wait_and_access

    with ThreadPoolExecutor(2) as pool:
        for number, file in enumerate(files):
            for name in ACCESSES:
                setattr(file, name, in_turn(number, getattr(file, name)))
        saved = [pool.submit(file.save, key, key) for file, key in zip(files, keys, strict=True)]
        for one in saved:
            one.result()
    assert not left


@pytest.mark.parametrize("order", sorted(set(itertools.permutations((0, 0, 0, 1, 1, 1)))))
def test_kernels_of_two_processes_at_once_are_never_exchanged(files, order):
    """Whichever of them reads or writes next, a kernel is then found as what it is, or not at all."""
    keys = ("int32", "float64")
    save_in_order(files, keys, order)
    read = IndexDataCacheFile(files[0]._cache_path, "kernel", "stamp")
    found = [read.load(key) for key in keys]
    assert all(data in (key, None) for key, data in zip(keys, found, strict=True))
    assert any(found)


@pytest.mark.parametrize("access", ["_save_data", "_save_index"])
def test_a_process_that_is_killed_while_it_saves_leaves_a_sound_cache(files, access):
    """Before either file: the kernel is missing, those that were there stay, and it can be saved anew."""
    killed, other = files
    other.save("float64", "other")
    setattr(killed, access, lambda *arguments: os.kill(os.getpid(), signal.SIGKILL))
    process = multiprocessing.get_context("fork").Process(target=killed.save, args=("int32", "lost"))
    process.start()
    process.join()
    assert process.exitcode == -signal.SIGKILL
    assert (other.load("int32"), other.load("float64")) == (None, "other")
    other.save("int32", "found")
    assert (other.load("int32"), other.load("float64")) == ("found", "other")


def test_a_kernel_is_found_again_and_replaced(files):
    """In another process, and beside one for other types."""
    one, two = files
    for key, data in (("int32", "first"), ("float64", "other"), ("int32", "second")):
        one.save(key, data)
    assert (two.load("int32"), two.load("float64"), two.load("int64")) == ("second", "other", None)


def compile_together(folder, barrier, found, change=lambda: None) -> None:
    """Compile the kernel of a folder when all processes are ready: what of it was read, and what compiled."""
    os.chdir(folder)
    sys.path.insert(0, str(folder))
    change()
    total = importlib.import_module("kernel_of_two").total
    barrier.wait()
    total.compile((types.float64[::1],))
    found.put((sum(total.stats.cache_hits.values()), sum(total.stats.cache_misses.values())))


def compiled_by(folder, *changes) -> list[tuple[int, int]]:
    """(read, compiled) by each of several processes at once, sorted; changes: what each does first."""
    share_kernel_files()
    (folder / "kernel_of_two.py").write_text(KERNEL)
    context = multiprocessing.get_context("fork")
    barrier, found = context.Barrier(len(changes)), context.Queue()
    processes = [context.Process(target=compile_together, args=(folder, barrier, found, one)) for one in changes]
    for process in processes:
        process.start()
    results = sorted(found.get(timeout=60.0) for _ in processes)
    for process in processes:
        process.join()
    return results


def nothing() -> None:
    """No change."""


def test_of_processes_that_need_a_kernel_at_once_one_compiles_it(tmp_path, monkeypatch):
    monkeypatch.setattr(numba.config, "CACHE_DIR", str(tmp_path / "kernels"))
    assert compiled_by(tmp_path, nothing, nothing, nothing) == [(0, 1), (1, 0), (1, 0)]


@pytest.mark.parametrize("error", [OSError(errno.ENOLCK, "no locks"), BlockingIOError(errno.EAGAIN, "held for ever")])
def test_without_locks_or_for_ever_locked_a_kernel_is_compiled(error, tmp_path, monkeypatch):
    """On a file system that has none, or that keeps those of a machine that is lost."""

    def refuse() -> None:
        kernel_files.MAX_WAIT = 0.2
        kernel_files.fcntl.lockf = Mock(side_effect=error)

    monkeypatch.setattr(numba.config, "CACHE_DIR", str(tmp_path / "kernels"))
    assert compiled_by(tmp_path, refuse) == [(0, 1)]


def test_numba_is_changed_as_it_is_imported():
    """Not before: importing it takes time."""
    done = subprocess.run([sys.executable, "-c", CHANGED], cwd=ROOT, capture_output=True, text=True)
    assert done.stdout == "common.kernel_files", done.stderr
