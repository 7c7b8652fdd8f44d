"""One stage server (workflow/stage_server.py) for many runs, by programs in place of the interpreter.

The stages of the undisturbed run (conftest), of copied checkouts and of some stand-ins for the interpreter are
processes of their own. A run that is started as a user's (tiny_mines.start) has a server of its own, as a user's has.
"""

import functools
import sys
import tempfile
from pathlib import Path

from stand_ins import program

from workflow import stage_client
from workflow.stage_server import start_server

PROGRAM = """#!/bin/sh
{variable}={address} exec '{python}' -IS '{client}' {script} "$@"
"""


@functools.cache
def stage_program(script: Path | None = None) -> Path:
    """A program that runs `-m <package> <stage> ...`, or this script with such words, by the server.

    On other systems than Linux the interpreter or the script itself.
    """
    if not (address := start_server()):
        return script or Path(sys.executable)
    values = {"variable": stage_client.ADDRESS, "address": address, "python": sys.executable}
    text = PROGRAM.format(**values, client=stage_client.__file__, script=f"'{script}'" if script else "")
    return program(text, programs() / (script.name if script else "stage"))


@functools.cache
def programs() -> Path:
    """The folder of these programs."""
    return Path(tempfile.mkdtemp(prefix="stages-"))
