"""Mines small enough to run through in seconds, and the pipeline's command line as a user calls it."""

import copy
import hashlib
import os
import shutil
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import yaml
from snakemake_server import call_snakemake

from verification.extremes.tiny_mine import (  # noqa: F401  what tests import from here
    DIRECTED,
    FILL,
    FLAT,
    HOST,
    NEXT_STEP,
    PUSH,
    STRAIN,
    TINY,
    box,
    changed,
    write_mine,
)

ROOT = Path(__file__).parents[2]
DEFAULT = ROOT / "config" / "default.yaml"
STAGES = {
    *("scene", "grid", "elastic", "step", "companion", "events", "catalogue", "record", "comparison", "report"),
    *("report_page", "plan_outcome", "plans", "flaws", "excess_shear", "baselines", "trial", "further", "calibrate"),
    "calibration_record",
    "calibration_readings",
    "shaking",
    "plan_shaking",
    "loading",
    "plan_loading",
    "plan_openings",
    "all",
}
DATASETS = (".nc", ".csv", ".xml")
# python -m snakemake, whose stages are run by the program that is named first
BY_INTERPRETER = """
import runpy, sys
sys.executable = sys.argv.pop(1)
runpy.run_module("snakemake", run_name="__main__", alter_sys=True)
"""

# Nothing but history: the pipeline stops at the elastic state.
STILL = {key: copy.deepcopy(TINY[key]) for key in TINY if key not in ("steps", "record", "seismic", "comparison")}
STILL |= {"name": "still", "excavations": [box("drive", "planned", [20, 30, 40], [60, 40, 50])]}


def merged(mine: dict) -> dict:
    """The default configuration with a mine over it, as Snakemake merges them."""

    def over(base: dict, top: dict) -> dict:
        both = [key for key in base if isinstance(base[key], dict) and isinstance(top.get(key), dict)]
        return base | top | {key: over(base[key], top[key]) for key in both}

    return over(yaml.safe_load(DEFAULT.read_text()), copy.deepcopy(mine))


def copy_checkout(folder: Path) -> Path:
    """A copy of all that Snakemake and the stages read of this checkout, to be edited."""
    parts = (
        "workflow",
        "config",
        "profiles",
        "common",
        "baselines",
        "calibration",
        "plans",
        "response",
        "shaking",
        "export",
        "mpm_core",
        "seismic",
        "catalogs",
        "verification",
    )
    for name in parts:
        shutil.copytree(ROOT / name, folder / name, ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copy(ROOT / "Snakefile", folder)
    return folder


@contextmanager
def edited(file: Path, mine: dict) -> Iterator[Path]:
    """A mine's own file with other contents for a while: two files of one name must not share results."""
    before = file.read_text()
    try:
        yield write_mine(mine, file)
    finally:
        file.write_text(before)


def command(mine_file: Path, folder: Path, *options: str, cores: int = 2, checkout: Path = ROOT) -> list[str]:
    """The command line of a user; the folder is where results go."""
    snakemake = [sys.executable, "-m", "snakemake", *options, "--cores", str(cores), "--directory", str(folder)]
    return [*snakemake, "--snakefile", str(checkout / "Snakefile"), "--configfile", str(mine_file)]


def start(
    mine_file: Path, folder: Path, *options: str, cores: int = 2, interpreter: Path | None = None
) -> subprocess.Popen:
    """Snakemake in a session of its own; its output is read with communicate(). interpreter: as `snakemake`, if any."""
    text = {"stdout": subprocess.PIPE, "stderr": subprocess.STDOUT, "text": True, "encoding": "utf-8"}
    environment = os.environ | {"PYTHONIOENCODING": "utf-8"}
    python, *line = command(mine_file, folder, *options, cores=cores)
    if interpreter:
        line = ["-c", BY_INTERPRETER, str(interpreter), *line[2:]]
    return subprocess.Popen([python, *line], **text, env=environment, start_new_session=True)


def snakemake(
    mine_file: Path, folder: Path, *options: str, interpreter: Path | None = None, checkout: Path = ROOT
) -> tuple[int, str]:
    """Exit status and terminal text of a run; interpreter: the program that runs the stages."""
    words = command(mine_file, folder, *options, checkout=checkout)[3:]
    return call_snakemake(words, interpreter or Path(sys.executable), checkout)


def finished(process: subprocess.Popen) -> tuple[int, str]:
    """Exit status and terminal text of a run that was started."""
    text, _ = process.communicate(timeout=1800)
    return process.returncode, text


def jobs(text: str) -> dict[str, int]:
    """How often each rule runs, from the table of jobs that Snakemake prints."""
    pairs = (line.split() for line in text.splitlines())
    return {pair[0]: int(pair[1]) for pair in pairs if len(pair) == 2 and pair[0] in STAGES and pair[1].isdigit()}


def hashes(results: Path, suffixes: tuple[str, ...] = DATASETS) -> dict[str, str]:
    """sha256 of every result by its path."""
    files = sorted(path for path in results.rglob("*") if path.suffix in suffixes and path.is_file())
    return {path.relative_to(results).as_posix(): hashlib.sha256(path.read_bytes()).hexdigest() for path in files}
