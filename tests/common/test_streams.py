"""A terminal that goes away while a process writes to it."""

import os
import pty
import socket
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
STAGE = """
import sys
from common.stage import run_stage
def work():
    sys.stdin.readline()  # until the reader is gone
    for _ in range(3):
        print("on the way", file=sys.stderr, flush=True)
    open(sys.argv[2], "w").write("made")
run_stage("grid", sys.argv[1], work)
"""


@pytest.mark.parametrize("kind", ["pipe", "socket", "terminal", "none"])
def test_a_stage_ends_well_although_nobody_reads_what_it_says(tmp_path, kind):
    """`| head`, a lost connection, a closed window, no standard error: its log is whole, and its result."""
    end, ours = [None, None]
    if kind == "pipe":
        end, ours = os.pipe()
    elif kind == "socket":
        end, ours = (one.detach() for one in socket.socketpair())
        os.write(ours, b"unread")  # then the system says "connection reset" in place of "broken pipe"
    elif kind == "terminal":
        end, ours = pty.openpty()
    line = [sys.executable, "-c", STAGE, str(tmp_path / "log"), str(tmp_path / "result")]
    if kind == "none":
        line = ["sh", "-c", 'exec "$@" 2>&-', "sh", *line]
    stage = subprocess.Popen(line, stdin=subprocess.PIPE, stderr=ours, cwd=ROOT)
    for one in (end, ours):
        if one is not None:
            os.close(one)
    stage.communicate(b"\n", timeout=60)
    assert stage.returncode == 0
    assert (tmp_path / "result").read_text() == "made"
    assert " done in " in (tmp_path / "log").read_text()
