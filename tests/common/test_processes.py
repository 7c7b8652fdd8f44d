"""Parts of a stage in processes of their own: what they return and raise, and what ends them."""

import multiprocessing
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import psutil
import pytest

from common.errors import InputError, InputErrors
from common.processes import KILLED, call_all

ROOT = Path(__file__).parents[2]
TOO_LONG = 60.0  # s, of a part that nobody waits for
STAGE = f"""
import signal, sys, time
from pathlib import Path
from common.processes import call_all
from common.stage import run_stage

signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell ignores it in what it runs in the background

def part(name):
    Path(sys.argv[1], name).touch()
    time.sleep(0.0 if name == "c" else {TOO_LONG})

parts = {{name: lambda name=name: part(name) for name in "abc"}}
run_stage("report here", Path(sys.argv[1], "log"), lambda: call_all(parts, 3))
"""


@pytest.mark.parametrize("processes", [0, 1, 2, 3, 64])
def test_each_part_returns_under_its_name(processes):
    """Whatever it is made of; in the order given, and in no more processes than asked for."""

    two_at_once = multiprocessing.get_context("fork").Barrier(2)

    def part(number: int):
        if processes > 1 and number < 2:
            two_at_once.wait(TOO_LONG)  # or one process could do all parts before another has a core
        return number**2, os.getpid()

    found = call_all({str(number): lambda number=number: part(number) for number in range(6)}, processes)
    assert [(name, square) for name, (square, _) in found.items()] == [(str(n), n**2) for n in range(6)]
    used = {process for _, process in found.values()}
    assert used == {os.getpid()} if processes < 2 else os.getpid() not in used and 1 < len(used) <= min(processes, 6)


def test_nothing_to_do_is_done():
    assert call_all({}, 3) == {}


@pytest.mark.parametrize("processes", [1, 3])
@pytest.mark.parametrize("error", [InputError("a: b"), InputErrors(["a: b", "c: d"]), MemoryError(), KeyError("x")])
def test_an_error_is_raised_as_it_was(error, processes):
    """The first of several in the order of the parts, though a later one was sooner."""

    def fail(with_what: Exception, after: float):
        time.sleep(after)
        raise with_what

    parts = {"works": lambda: 1, "first": lambda: fail(error, 0.2), "second": lambda: fail(ValueError(), 0.0)}
    with pytest.raises(type(error)) as raised:
        call_all(parts, processes)
    assert str(raised.value) == str(error)
    assert getattr(raised.value, "lines", ()) == getattr(error, "lines", ())


def test_nobody_waits_for_the_others_once_one_has_failed():
    began = time.perf_counter()
    with pytest.raises(ZeroDivisionError):
        call_all({"fails": lambda: 1 // 0, "sleeps": lambda: time.sleep(TOO_LONG)}, 2)
    assert time.perf_counter() - began < TOO_LONG / 2


def test_a_killed_process_is_one_line():
    """The system kills what takes too much memory; a pool that waited for it would wait for ever."""
    with pytest.raises(InputError) as raised:
        call_all({"dies": lambda: os.kill(os.getpid(), signal.SIGKILL), "sleeps": lambda: time.sleep(TOO_LONG)}, 2)
    assert raised.value.lines == (KILLED,)


def test_an_interrupt_is_left_to_the_stage():
    """The terminal sends it to all processes, and each that answered would print a traceback."""
    parts = {name: lambda: os.kill(os.getpid(), signal.SIGINT) or "still here" for name in "ab"}
    assert call_all(parts, 2) == {"a": "still here", "b": "still here"}


@pytest.mark.parametrize("ended_by", [signal.SIGINT, signal.SIGTERM, signal.SIGKILL])
def test_processes_end_with_their_stage(tmp_path, ended_by):
    """An interrupt goes to all of them, as from a terminal: to those at work and to one that has nothing left to do."""

    def heed() -> None:  # a shell's background processes ignore SIGINT
        signal.signal(signal.SIGINT, signal.SIG_DFL)

    stage = subprocess.Popen(
        [sys.executable, "-c", STAGE, tmp_path], cwd=ROOT, start_new_session=True, preexec_fn=heed,
        stderr=subprocess.PIPE, text=True,
    )  # fmt: skip
    until = time.perf_counter() + TOO_LONG / 2
    while not {"a", "b", "c"} <= {path.name for path in tmp_path.iterdir()}:
        assert time.perf_counter() < until
        time.sleep(0.02)
    processes = psutil.Process(stage.pid).children()
    assert len(processes) == 3
    time.sleep(0.2)  # until one has nothing left to do
    (os.killpg if ended_by == signal.SIGINT else os.kill)(stage.pid, ended_by)
    told = stage.communicate(timeout=TOO_LONG / 2)[1]
    _, alive = psutil.wait_procs(processes, timeout=TOO_LONG / 2)
    assert not alive
    assert stage.returncode == (130 if ended_by == signal.SIGINT else -ended_by)
    assert "Traceback" not in told
