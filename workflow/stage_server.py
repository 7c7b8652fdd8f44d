"""Stages run as copies of one process that has imported what they need: most of a small stage would be its imports.

Snakemake starts a program for each stage (workflow/stage_client.py). It passes its streams to this process, which sees
the program's words, folder and environment in /proc, and makes a copy of itself that becomes the stage. No
stage sees what an earlier one left. The process ends with Snakemake, the stages with the process, and a stage with its
program.
"""

import atexit
import functools
import gc
import importlib
import os
import resource
import runpy
import secrets
import select
import signal
import socket
import struct
import subprocess
import sys
import traceback
from collections.abc import Iterable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import NoReturn

from common.stage import PIPELINE_PROCESS
from workflow.stage_client import ADDRESS

# In the order in which a run needs them. They are imported while no stage asks for its start.
MODULES = (
    *("catalogs.records", "mpm_core.stages.grid_stage", "mpm_core.stages.first_kernels"),
    *("mpm_core.stages.equilibrium_stages", "seismic.events", "seismic.catalog", "seismic.closeness"),
    *("catalogs.comparison", "catalogs.quakeml", "catalogs.report.page"),
    *("scipy.ndimage", "pint"),  # stages import these as they go, xarray the second for times
)
ROOT = Path(__file__).parents[1]
STREAMS = 3
CREDENTIALS = struct.Struct("3i")  # process, user, group of the other end of a socket


@functools.cache
def start_server() -> str:
    """Start the process, once. Returns what stages find it by, for stage_client.ADDRESS; empty on other systems than
    Linux.

    It ends when this process does.
    """
    if sys.platform != "linux":
        return ""
    name = f"stages-{os.getpid()}-{secrets.token_hex(8)}"
    with socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET) as listener:
        listener.bind(f"\0{name}")
        listener.listen()  # programs wait here until it is ready
        line = [sys.executable, "-m", "workflow.stage_server", str(listener.fileno())]
        # A copy would lack the threads of its original.
        environment = os.environ | {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "PYTHONPATH": str(ROOT)}
        # In a session of its own: what a terminal signals comes by the programs, once.
        server = subprocess.Popen(
            line, stdin=subprocess.PIPE, pass_fds=[listener.fileno()], env=environment, start_new_session=True
        )
    atexit.register(_end, server)
    return name


def _end(server: subprocess.Popen) -> None:
    """End the process, and wait for it if stages may run: it ends them first."""
    if not os.environ.get(ADDRESS):
        server.kill()  # it may be importing
    server.communicate()


@dataclass(frozen=True)
class Stage:
    """A running stage. end: descriptor that can be read once it has ended; program: the socket of its program."""

    process: int
    end: int
    program: socket.socket

    def fileno(self) -> int:
        """For select."""
        return self.end

    def tell_status(self) -> None:
        """Tell the program the exit status; the stage has ended."""
        status = os.waitstatus_to_exitcode(os.waitpid(self.process, 0)[1])
        with self.program, suppress(BrokenPipeError):  # the program was killed
            self.program.send(bytes([status if status >= 0 else 128 - status]))
        os.close(self.end)

    def pass_on(self) -> None:
        """Signal the stage what its program was signalled. A program that was killed takes the stage with it."""
        number = self.program.recv(1)
        signal.pidfd_send_signal(self.end, number[0] if number else signal.SIGKILL)


def serve(listener: socket.socket) -> None:
    """Run stages until the input ends, which the process that has started this one holds."""
    before = os.environ.copy()
    to_import = list(MODULES)
    stages: list[Stage] = []
    while True:
        programs = {stage.program: stage for stage in stages}
        ready, _, _ = select.select([listener, sys.stdin, *stages, *programs], [], [], 0 if to_import else None)
        if sys.stdin in ready:
            for stage in stages:
                signal.pidfd_send_signal(stage.end, signal.SIGKILL)
            return
        for stage in [stage for stage in stages if stage in ready]:
            stages.remove(stage)
            stage.tell_status()
        for program in programs.keys() & set(ready):
            if programs[program] in stages:
                programs[program].pass_on()
        if listener in ready:
            program, _ = listener.accept()
            if _other_end(program)[1] != os.getuid():  # whoever it is need not be waited for
                program.close()
                continue
            _, streams, _, _ = socket.recv_fds(program, 1, STREAMS)
            if not (process := os.fork()):
                added = {key: value for key, value in os.environ.items() if key not in before}
                _become_stage(program, streams, [listener, *programs], added)
            stages.append(Stage(process, os.pidfd_open(process), program))
            for stream in streams:
                os.close(stream)
        elif to_import:
            with suppress(Exception):  # the stage that needs it says what is wrong
                importlib.import_module(to_import.pop(0))
            gc.freeze()  # copies need not search what is imported


def _become_stage(
    program: socket.socket, streams: list[int], others: Iterable[socket.socket], added: dict[str, str]
) -> NoReturn:
    """Run a stage as its program was called, with its streams, and end. added: to the environment, by what is imported.

    Python itself is not taken apart: that would take longer than many a stage.
    """
    status = 1
    try:
        for other in others:
            other.close()
        for number, stream in enumerate(streams):
            os.dup2(stream, number)
            os.close(stream)
        words = _take_place_of(program, added)
        if numba := sys.modules.get("numba"):
            numba.config.reload_config()
        if words[0] == "-m":
            sys.path[0], sys.argv[1:] = os.getcwd(), words[2:]
            runpy.run_module(words[1], run_name="__main__", alter_sys=True)
        else:
            sys.argv = words
            runpy.run_path(words[0], run_name="__main__")
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


def _take_place_of(program: socket.socket, added: dict[str, str]) -> list[str]:
    """Take over folder, environment and limit of files of a program. Returns its words: those of the interpreter."""
    process, _ = _other_end(program)
    program.close()
    folder = Path(f"/proc/{process}")
    resource.setrlimit(resource.RLIMIT_FSIZE, resource.prlimit(process, resource.RLIMIT_FSIZE))
    os.chdir(os.readlink(folder / "cwd"))
    environment = (entry.partition("=") for entry in _strings(folder / "environ"))
    os.environ.clear()
    os.environ.update(added | {key: value for key, _, value in environment})
    os.environ[PIPELINE_PROCESS] = str(os.getppid())  # which the stage ends with (common.stage)
    words = _strings(folder / "cmdline")
    return words[next(number for number, word in enumerate(words) if word.endswith("stage_client.py")) + 1 :]


def _other_end(program: socket.socket) -> tuple[int, int]:
    """Process and user of the program."""
    process, user, _ = CREDENTIALS.unpack(program.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, CREDENTIALS.size))
    return process, user


def _strings(path: Path) -> list[str]:
    """The strings of a file of /proc."""
    return [os.fsdecode(string) for string in path.read_bytes().split(b"\0")[:-1]]


if __name__ == "__main__":
    serve(socket.socket(fileno=int(sys.argv[1])))
