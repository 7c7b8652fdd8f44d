"""What a stage took: its own account in its log, read back."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

from common.costs import COMPILING, Clock, Compiling, Costs, cost_of

ROOT = Path(__file__).parents[2]
BUSY = """
import sys, threading, time
from common import progress
from common.stage import run_stage

progress.SECONDS_TO_FIRST_LINE = 60.0  # or it imports tqdm in the midst of what is measured

def spin():
    began = time.thread_time()
    while time.thread_time() - began < 0.3:
        pass

def body():
    threads = [threading.Thread(target=spin) for _ in range(2)]
    [thread.start() for thread in threads]
    [thread.join() for thread in threads]
    time.sleep(0.5)
    {more}

run_stage("step busy", sys.argv[1], body)
"""
SPIN = "import time\nwhile time.process_time() < 0.4: pass\nlarge = b'x' * (300 << 20)"
COMPILES = """
    import numba
    @numba.njit
    def inner(x): return x + 1.0
    @numba.njit
    def outer(x): return inner(x) * 2.0
    outer(1.0)
"""


def run(body: str, log: Path, before: str = "") -> subprocess.CompletedProcess:
    # Through a shell that forks: Linux counts the peak of the process before exec as that of the process after it.
    script = [
        "sh",
        "-c",
        '"$@"; exit $?',
        "sh",
        sys.executable,
        "-c",
        before + BUSY.replace("{more}", body.strip()),
        log,
    ]
    return subprocess.run(script, cwd=ROOT, capture_output=True, text=True)


def test_a_stage_says_in_its_log_what_it_took(tmp_path):
    """All threads' processor time and no sleep; the terminal's line says it too."""
    log = tmp_path / "busy.log"
    told = run("", log)
    assert told.returncode == 0, told.stderr
    costs = cost_of(log)
    assert costs.seconds > 0.8
    assert 0.6 <= costs.processor < 0.6 + 0.4  # beside it the process does next to nothing, but machines are slow
    assert costs.compiling == 0.0
    assert costs.running == costs.processor
    assert 5 < costs.memory < 2000
    said = re.search(r"\((.+) s of processor time\), (\d+) MiB", told.stderr)
    assert float(said[1]) == pytest.approx(costs.processor, abs=0.056)  # rounded to tenths and to hundredths
    assert float(said[2]) == pytest.approx(costs.memory, abs=1)


def test_processes_that_a_stage_started_count(tmp_path):
    """Once they have ended; kernels are compiled in such. The memory of the largest is that of the stage."""
    log = tmp_path / "busy.log"
    told = run("import subprocess; subprocess.run([sys.executable, '-c', CHILD])", log, f"CHILD = {SPIN!r}\n")
    assert told.returncode == 0, told.stderr
    assert cost_of(log).processor >= 0.6 + 0.4
    assert 300 < cost_of(log).memory < 2000


@pytest.mark.parametrize("before", ["", "import numba"])
def test_compiling_is_told_apart(tmp_path, before):
    """A kernel and the one that it calls, once; what remains is no more than without. No stage asks for it."""
    log = tmp_path / "busy.log"
    told = run(COMPILES, log, before)
    assert told.returncode == 0, told.stderr
    costs = cost_of(log)
    assert 0.05 < costs.compiling < costs.processor - 0.6
    assert " s of it compiling), peak memory " in log.read_text()


@pytest.mark.parametrize("compiling", [0.0, 3.14])
def test_a_closing_line_is_read_back(tmp_path, compiling):
    costs = Costs(12.34, 23.45, compiling, 345.0)
    log = tmp_path / "a.log"
    log.write_text(f"2026 INFO begun\n2026 INFO {costs.closing_line('step results/a done in 3 s/b.nc')}\n")
    assert cost_of(log) == costs
    assert costs.running == pytest.approx(23.45 - compiling)
    assert costs.next_seconds == pytest.approx(costs.seconds * (1.0 - compiling / 23.45))


def test_of_a_log_that_is_cut_short_nothing_is_known(tmp_path):
    """None of it, its last line in part, ended by an error, empty, or of another version."""
    line = f"2026 INFO {Costs(1.0, 1.0, 0.0, 300.0).closing_line('grid')}\n"
    log = tmp_path / "a.log"
    assert cost_of(log) is None
    for text in ("", line[: -len(" MiB\n")], line + "Traceback\n", "grid done in 1.0 s, peak memory 300 MiB\n", "\xff"):
        log.write_bytes(text.encode("latin-1"))
        assert cost_of(log) is None, text


def test_a_stage_without_kernels_does_not_wait_for_numba(tmp_path):
    told = run("assert 'numba' not in sys.modules", tmp_path / "busy.log")
    assert told.returncode == 0, told.stderr


def test_a_stage_does_not_count_what_was_compiled_before_it(monkeypatch):
    """In a process that had another stage."""
    monkeypatch.setattr(COMPILING, "seconds", 5.0)
    clock = Clock()
    COMPILING.seconds += 2.0
    assert clock.taken()[2] == 2.0


def test_a_stage_that_failed_has_no_costs(tmp_path):
    log = tmp_path / "busy.log"
    assert run("raise ValueError", log).returncode == 1
    assert cost_of(log) is None


def test_kernels_within_kernels_count_once():
    """The inner one's end counts nothing yet."""
    compiling = Compiling()
    compiling.begin()
    compiling.begin()
    sum(range(10_000))
    compiling.end()
    assert compiling.seconds == 0.0
    compiling.end()
    assert 0.0 < compiling.seconds < 1.0
