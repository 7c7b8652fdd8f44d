"""Stages from a process that has imported them, once for many runs: a stage of a tiny mine is little but imports.

A program in place of the interpreter passes its words, folder, environment, limit and streams to this process, which
leaves them to a copy of itself, so that no stage sees what an earlier one left. The stages of the undisturbed run
(conftest), of copied checkouts and of runs that are killed are processes of their own, as a user's are.
"""

import array
import atexit
import functools
import gc
import importlib
import json
import os
import resource
import runpy
import select
import socket
import subprocess
import sys
import tempfile
import traceback
from contextlib import suppress
from pathlib import Path
from typing import NoReturn

ROOT = Path(__file__).parents[2]
MODULES = (
    *("mpm_core.stages.grid_stage", "mpm_core.stages.equilibrium_stages", "mpm_core.stages.first_kernels"),
    *("seismic.events", "seismic.catalog", "seismic.closeness"),
    *("catalogs.records", "catalogs.comparison", "catalogs.quakeml", "catalogs.report.page"),
)
# A stage without cores of its own asks which other programs of the run have some (common/stage.py): not this one.
PROGRAM = """#!{python} -IS
import json, os, resource, socket, sys
if os.environ.get("CORES_OF_STAGE") == "0":
    os.sched_setscheduler(0, os.SCHED_IDLE, os.sched_param(0))
call = {{"script": {script!r}, "words": sys.argv[1:], "folder": os.getcwd(), "environment": dict(os.environ)}}
call["limit"] = resource.getrlimit(resource.RLIMIT_FSIZE)
with socket.socket(socket.AF_UNIX) as server:
    server.connect({address!r})
    socket.send_fds(server, [b"."], [0, 1, 2])
    server.sendall(json.dumps(call).encode())
    server.shutdown(socket.SHUT_WR)
    sys.exit(int(server.recv(10) or 1))
"""


@functools.cache
def stage_program(script: Path | None = None) -> Path:
    """A program that runs `-m <package> <stage> ...`, or this script with such words, in a copy of the process.

    On other systems than Linux the interpreter or the script itself.
    """
    if sys.platform != "linux":
        return script or Path(sys.executable)
    folder = _started()
    program = folder / (script.name if script else "stage")
    program.write_text(PROGRAM.format(python=sys.executable, script=str(script or ""), address=str(folder / "socket")))
    program.chmod(0o755)
    return program


@functools.cache
def _started() -> Path:
    """Folder of the process's socket. The process ends with this one, which holds the other end of its input."""
    folder = tempfile.TemporaryDirectory(prefix="stages-")
    atexit.register(folder.cleanup)
    listener = socket.socket(socket.AF_UNIX)
    listener.bind(f"{folder.name}/socket")
    listener.listen(64)  # programs wait here while the modules are imported
    line = [sys.executable, __file__, str(listener.fileno())]
    environment = os.environ | {"OMP_NUM_THREADS": "1"}  # a copy would lack the threads of its original
    server = subprocess.Popen(
        line, stdin=subprocess.PIPE, pass_fds=[listener.fileno()], env=environment, start_new_session=True
    )
    listener.close()
    atexit.register(server.communicate)
    return Path(folder.name)


def _serve(listener: socket.socket) -> None:
    """Run stages until the input ends."""
    sys.path[0] = str(ROOT)
    before = os.environ.copy()
    for module in MODULES:
        importlib.import_module(module)
    gc.freeze()  # copies need not search what is imported
    added = {key: value for key, value in os.environ.items() if key not in before}
    stages: dict[int, tuple[int, socket.socket]] = {}  # by what tells of their end: process, and who waits for it
    while True:
        ready, _, _ = select.select([listener, sys.stdin, *stages], [], [])
        if sys.stdin in ready:
            return
        for end in set(ready) & stages.keys():
            stage, waiting = stages.pop(end)
            status = os.waitstatus_to_exitcode(os.waitpid(stage, 0)[1])
            with waiting, suppress(BrokenPipeError):  # it may have been killed
                waiting.sendall(str(status if status >= 0 else 128 - status).encode())
            os.close(end)
        if listener in ready:
            connection, _ = listener.accept()
            if not (stage := os.fork()):
                _answer(connection, added)
            stages[os.pidfd_open(stage)] = stage, connection


def _answer(connection: socket.socket, added: dict[str, str]) -> NoReturn:
    """Become the process of a stage, and end as it; `added`: what imports have added to the environment.

    Python itself is not taken apart: that would take longer than many a stage.
    """
    _, ancillary, _, _ = connection.recvmsg(1, socket.CMSG_SPACE(3 * array.array("i").itemsize))
    streams = array.array("i", ancillary[0][2])
    with connection.makefile("rb") as sent:
        call = json.load(sent)
    for number, stream in enumerate(streams):
        os.dup2(stream, number)
        os.close(stream)
    status = 1
    try:
        _run(**call, added=added)
        status = 0
    except SystemExit as end:
        if isinstance(end.code, str):
            print(end.code, file=sys.stderr)
        else:
            status = end.code or 0
    except BaseException:
        traceback.print_exc()
    finally:
        atexit._run_exitfuncs()
        sys.stdout.flush()
        os._exit(status)


def _run(
    script: str, words: list[str], folder: str, environment: dict[str, str], limit: list[int], added: dict[str, str]
) -> None:
    """Run a stage where and with what its program was called."""
    os.chdir(folder)
    os.environ.clear()
    os.environ.update(added | environment)
    resource.setrlimit(resource.RLIMIT_FSIZE, tuple(limit))
    importlib.import_module("numba").config.reload_config()
    if script:
        sys.argv = [script, *words]
        runpy.run_path(script, run_name="__main__")
    else:
        sys.argv[1:] = words[2:]
        runpy.run_module(words[1], run_name="__main__", alter_sys=True)


if __name__ == "__main__":
    _serve(socket.socket(fileno=int(sys.argv[1])))
