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


def ending(result: str, how: str, folder: Path, interpreter: str | Path = sys.executable) -> Path:
    """An interpreter that ends the first stage that makes a result. Then there is a folder `once` beside it."""
    how = how.format(interpreter=interpreter)
    text = END.format(result=result, once=folder / "once", ending=how, interpreter=interpreter)
    return program(text, folder / "interpreter")
