"""Programs in place of the interpreter that runs the stages of a workflow."""

import sys
from pathlib import Path

LEAVE_EMPTY = f"""#!{sys.executable}
# It leaves results that hold nothing but what they were made from.
import os, sys
from pathlib import Path
import netCDF4
sys.path.insert(0, os.environ["PYTHONPATH"])
from common.provenance import MADE_FROM, comment, made_from
from common.slices import read_slice
module, stage, *words = sys.argv[2:]
given, option = {{}}, ""
for word in words:
    option = word if word.startswith("--") else option
    given.setdefault(option, []).extend([] if word == option else [word])
output = Path(given.pop("--output")[0])
values = [read_slice(given[option][0]) for option in ("--scene", "--settings") if option in given]
inputs = [path for paths in given.values() for path in paths if path.endswith(".nc")]
identity = made_from(*(values or [{{}}]), f"{{module}} {{stage}}", inputs)
for folder in (output.parent, *map(Path, given.get("--figures", []))):
    folder.mkdir(parents=True, exist_ok=True)
for path in given.get("--csv", []):
    Path(path).touch()
part = output.with_suffix(".part")
if output.suffix == ".nc":
    with netCDF4.Dataset(part, "w") as dataset:
        dataset.setncattr(MADE_FROM, identity)
else:
    part.write_text(comment(identity))
part.rename(output)
"""
NOTE = f"""#!{sys.executable}
# It runs a stage and notes what files it has used.
import atexit, json, os, runpy, sys
from pathlib import Path
opened = set()
sys.addaudithook(lambda event, given: opened.add(str(given[0])) if event == "open" else None)
note, command = Path(__file__).with_name(f"{{os.getpid()}}.json"), sys.argv[2:]
def write():
    modules = {{getattr(module, "__file__", None) or "" for module in sys.modules.values()}}
    data = {{path for path in opened if not path.endswith((".py", ".pyc"))}}
    found = sorted({{os.path.abspath(path) for path in modules | data if path}})
    note.write_text(json.dumps({{"command": command[:2], "files": found}}))
atexit.register(write)
sys.argv = command
runpy.run_module(command[0], run_name="__main__", alter_sys=True)
"""
# The first stage that makes a result ends in some way, the others run.
END = """#!/bin/sh
case "$*" in
  *"--output {result} "*) if mkdir "{once}" 2>/dev/null; then {ending}; fi ;;
esac
exec "{interpreter}" "$@"
"""
KILLED = "kill -KILL $$"


def program(text: str, path: Path) -> Path:
    """A program with this text."""
    path.write_text(text)
    path.chmod(0o755)
    return path


def noting(folder: Path) -> Path:
    """An interpreter that leaves a file in the folder for each stage: its command, and the files that it has used."""
    folder.mkdir(exist_ok=True)
    return program(NOTE, folder / "note")


def ending(result: str, how: str, folder: Path, interpreter: str | Path = sys.executable) -> Path:
    """An interpreter that ends the first stage that makes a result. Then there is a folder `once` beside it."""
    how = how.format(interpreter=interpreter)
    text = END.format(result=result, once=folder / "once", ending=how, interpreter=interpreter)
    return program(text, folder / "interpreter")
