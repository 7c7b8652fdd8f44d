"""A stage run by its job's file, in a process of its own, as its rule runs it."""

import os
import subprocess
import sys
from pathlib import Path

from common.job import write_job

ROOT = Path(__file__).parents[1]


def run_job(
    folder: Path, stage: str, settings: dict, outputs: list[Path], environment: dict | None = None, **inputs
) -> subprocess.CompletedProcess:
    """The finished process of a stage with these settings. inputs: paths, or lists of them, by name.

    Its log is <stage>.log in the folder, and its job stands in jobs/.
    """
    paths = {
        name: [str(path) for path in (given if isinstance(given, list) else [given])] for name, given in inputs.items()
    }
    job = write_job(folder, stage, "", settings, paths, "code")
    line = [
        sys.executable,
        "-m",
        "workflow",
        job,
        "--output",
        *map(str, outputs),
        "--log",
        str(folder / f"{stage}.log"),
    ]
    inherited = os.environ | {"PYTHONPATH": str(ROOT)} | (environment or {})
    return subprocess.run(line, cwd=folder, env=inherited, capture_output=True, text=True, check=False)
