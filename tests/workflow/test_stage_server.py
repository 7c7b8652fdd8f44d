"""Stages by a process that has imported what they need: as processes of their own, and they end with what they should.

The programs here run a script by the server, as the rules run a stage.
"""

import json
import os
import resource
import select
import signal
import subprocess
import sys
import time

import psutil
import pytest
from stage_server import stage_program
from stand_ins import program
from tiny_mines import ROOT

from workflow import stage_client

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="stages run by themselves")

TELL = """
import json, os, resource, sys
print("said", file=sys.stderr)
if "left" in sys.modules:
    raise SystemExit("a stage before has left something")
sys.modules["left"] = sys
print(json.dumps([sys.argv[1:], sys.stdin.read(), os.getcwd(), dict(os.environ),
    resource.getrlimit(resource.RLIMIT_FSIZE), __name__]))
"""
# It ends as it is asked to, or says that it waits, until it is told to end.
WAIT = """
import os, signal, sys, time
from common.stage import die_with_parent
die_with_parent()
def end(number, frame):
    print("signal", number, flush=True)
    raise SystemExit(number)
for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
    signal.signal(number, end)
print(os.getpid(), flush=True)
time.sleep(100)
"""
# A process that starts a server, a stage by it, and says the numbers of all three.
OWNER = f"""
import os, psutil, subprocess, sys, time
from workflow.stage_server import start_server
os.environ["{stage_client.ADDRESS}"] = start_server()
line = [sys.executable, "-IS", "{stage_client.__file__}", sys.argv[1]]
stage = subprocess.Popen(line, stdout=subprocess.PIPE, text=True)
server = next(one.pid for one in psutil.Process().children() if one.pid != stage.pid)
print(server, stage.stdout.readline(), flush=True)
time.sleep(100)
"""


@pytest.fixture
def script(tmp_path):
    """A program that runs a script by the server."""

    def make(text: str):
        return stage_program(program(text, tmp_path / "script.py"))

    return make


def gone(process: int, patience: float = 20.0) -> bool:
    """Whether a process ends within so many seconds."""
    until = time.monotonic() + patience
    while psutil.pid_exists(process) and psutil.Process(process).status() != psutil.STATUS_ZOMBIE:
        if time.monotonic() > until:
            return False
        time.sleep(0.02)
    return True


def running(line: list, **options) -> tuple[subprocess.Popen, int]:
    """A program that was started, and the process of its stage, which waits."""
    started = subprocess.Popen(line, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, **options)
    return started, int(started.stdout.readline())


def test_a_stage_has_what_its_program_was_called_with(script, tmp_path):
    """Words with spaces and none, its input, a folder, an environment of its own, and a limit; twice the same."""
    folder = tmp_path / "block caves"
    folder.mkdir()
    words = ["--output", "a b", "", "été"]
    environment = os.environ | {"OWN": "a=b\nc", "EMPTY": ""}

    def limit() -> None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (12345, resource.RLIM_INFINITY))

    for _ in range(2):
        told = subprocess.run(
            [script(TELL), *words], cwd=folder, env=environment, input="from before", capture_output=True, text=True,
            preexec_fn=limit,
        )  # fmt: skip
        assert told.returncode == 0, told.stderr
        assert told.stderr == "said\n"
        given, text, where, seen, size, name = json.loads(told.stdout)
        assert given == words
        assert text == "from before"
        assert where == str(folder)
        assert {key: seen[key] for key in ("OWN", "EMPTY")} == {"OWN": "a=b\nc", "EMPTY": ""}
        assert set(environment) <= set(seen)
        assert size == [12345, -1]
        assert name == "__main__"


@pytest.mark.parametrize(
    ("text", "status", "says"),
    [
        ("", 0, ""),
        ("raise SystemExit(3)", 3, ""),
        ("raise SystemExit('the disk is full')", 1, "the disk is full\n"),
        ("import nothing_of_this_name", 1, "ModuleNotFoundError"),
        ("import os, signal; os.kill(os.getpid(), signal.SIGKILL)", 128 + signal.SIGKILL, ""),
        ("import os; os._exit(255)", 255, ""),
    ],
)
def test_a_program_ends_as_its_stage_does(script, text, status, says):
    """With its exit status, or with what a shell makes of a signal."""
    told = subprocess.run([script(text)], capture_output=True, text=True)
    assert told.returncode == status
    assert says in told.stderr
    assert bool(says) == bool(told.stderr)


@pytest.mark.parametrize("number", stage_client.PASSED_ON)
def test_what_a_program_is_signalled_its_stage_is_too(script, number):
    """Once. Both end as the stage wants to."""

    def heed() -> None:  # a shell's background processes ignore some
        signal.signal(number, signal.SIG_DFL)

    started, _ = running([script(WAIT)], preexec_fn=heed)
    started.send_signal(number)
    text, errors = started.communicate(timeout=20)
    assert (text, errors, started.returncode) == (f"signal {number.value}\n", "", number.value)


def test_a_stage_ends_with_its_program(script):
    """Which may be killed without a word."""
    started, stage = running([script(WAIT)])
    started.kill()
    assert gone(stage)
    started.communicate()


def test_stages_run_beside_each_other(script):
    """One that ends does not wait for those that were started before it."""
    waiting = [running([script(WAIT)]) for _ in range(3)]
    assert subprocess.run([script("raise SystemExit(7)")], timeout=20).returncode == 7
    for started, stage in waiting:
        assert psutil.pid_exists(stage)
        started.terminate()
        started.communicate(timeout=20)


@pytest.fixture
def owner(tmp_path):
    """A process that has started a server and a stage by it; the numbers of both."""
    line = [sys.executable, "-c", OWNER, str(program(WAIT, tmp_path / "script.py"))]
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    started = subprocess.Popen(line, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=environment)
    assert select.select([started.stdout], [], [], 60)[0]
    yield started, *map(int, started.stdout.readline().split())
    started.kill()
    started.communicate()


def test_the_server_and_its_stages_end_with_snakemake(owner):
    """As it is killed."""
    started, server, stage = owner
    started.kill()
    assert gone(stage)
    assert gone(server)


def test_a_stage_ends_with_the_server_and_its_program_says_so(owner):
    """The system kills a process for lack of memory; nothing waits for what it would have run."""
    started, server, stage = owner
    os.kill(server, signal.SIGKILL)
    assert gone(stage)
    assert started.stderr.readline() == f"{stage_client.LOST}\n"


@pytest.mark.parametrize("address", [None, "", "stages-of-nobody"])
def test_a_stage_runs_by_itself_without_a_server(tmp_path, address):
    """On a cluster, and on other systems than Linux."""
    script = program("import sys; print(sys.argv[1:], sys.flags.isolated)", tmp_path / "script.py")
    environment = {key: value for key, value in os.environ.items() if key != stage_client.ADDRESS}
    environment |= {} if address is None else {stage_client.ADDRESS: address}
    line = [sys.executable, "-IS", stage_client.__file__, str(script), "a b"]
    told = subprocess.run(line, env=environment, capture_output=True, text=True)
    assert (told.stdout, told.stderr) == ("['a b'] 0\n", "")
