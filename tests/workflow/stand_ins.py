"""Programs in place of the interpreter that runs the stages of a workflow."""

import sys
from pathlib import Path

LEAVE_EMPTY = f"""#!{sys.executable} -S
# It leaves results that hold nothing but a digest of what they were made from: the job, and the content of its inputs.
import hashlib, json, os, sys
from pathlib import Path
sys.path.insert(0, os.environ["PYTHONPATH"])
from common.job import remove_earlier
words = sys.argv[3:]
job, outputs = Path(words[0]), words[words.index("--output") + 1 : words.index("--log")]
remove_earlier(job)
digest = hashlib.sha256(job.name.encode())
for paths in json.loads(job.read_text())["inputs"].values():
    for path in map(Path, paths):
        files = sorted(path.glob("*.nc")) if path.is_dir() else [path]
        digest.update(b"".join(file.read_bytes() for file in files))
for output in map(Path, outputs):
    if not output.suffix:
        output.mkdir(parents=True, exist_ok=True)
        output = output / "all.nc"
    output.parent.mkdir(parents=True, exist_ok=True)
    part = output.with_name("." + output.name)
    part.write_text(digest.hexdigest())
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
