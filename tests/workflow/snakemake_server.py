"""Snakemake's command line from a process that has imported it, and the workflow with it, once for many calls.

Most of what a dry run takes are these imports. The process reads a call as JSON from each line of its input, leaves it
to a copy of itself, so that no call sees what an earlier one left, and prints the exit status.
"""

import atexit
import functools
import importlib
import json
import os
import runpy
import select
import subprocess
import sys
import tempfile
from pathlib import Path

MODULES = ("snakemake.cli", "snakemake_executor_plugin_slurm", "workflow.configuration", "workflow.terminal")
PATIENCE = 1800  # s


def call_snakemake(words: list[str], interpreter: Path, checkout: Path) -> tuple[int, str]:
    """Exit status and terminal text of `python -m snakemake` with such words, in the folder and environment of now.

    interpreter: the program that runs the stages; checkout: the folder of the workflow.
    """
    server = _started(checkout)
    with tempfile.TemporaryDirectory() as folder:
        terminal = Path(folder) / "terminal"
        call = {"words": words, "terminal": str(terminal), "interpreter": str(interpreter)}
        call |= {"folder": os.getcwd(), "environment": dict(os.environ)}
        server.stdin.write(f"{json.dumps(call)}\n")
        server.stdin.flush()
        if not select.select([server.stdout], [], [], PATIENCE)[0]:
            server.kill()  # or the next call would read the answer to this one
            _started.cache_clear()
            raise TimeoutError(terminal.read_text(encoding="utf-8"))
        return int(server.stdout.readline()), terminal.read_text(encoding="utf-8")


@functools.cache
def _started(checkout: Path) -> subprocess.Popen:
    """The process. It ends with this one, which holds the other end of its input."""
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "text": True, "encoding": "utf-8"}
    environment = os.environ | {"PYTHONIOENCODING": "utf-8"}
    line = [sys.executable, __file__, str(checkout)]
    server = subprocess.Popen(line, **pipes, env=environment, start_new_session=True)
    atexit.register(server.communicate)
    return server


def _serve(checkout: Path) -> None:
    """Answer calls until the input ends."""
    sys.path[0] = str(checkout)
    for module in MODULES:
        importlib.import_module(module)
    importlib.import_module("common.quantities").units()
    for line in sys.stdin:
        if not (copy := os.fork()):
            return _run(**json.loads(line))
        print(os.waitstatus_to_exitcode(os.waitpid(copy, 0)[1]), flush=True)


def _run(words: list[str], terminal: str, interpreter: str, folder: str, environment: dict[str, str]) -> None:
    """Become the process of one call."""
    os.setsid()
    os.chdir(folder)
    os.environ.clear()
    os.environ.update(environment)
    os.dup2(os.open(os.devnull, os.O_RDONLY), 0)
    for stream in (1, 2):
        os.dup2(os.open(terminal, os.O_WRONLY | os.O_CREAT | os.O_APPEND), stream)
    sys.executable, sys.argv[1:] = interpreter, words
    runpy.run_module("snakemake", run_name="__main__", alter_sys=True)


if __name__ == "__main__":
    _serve(Path(sys.argv[1]))
