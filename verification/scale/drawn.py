"""Costs of mines and catalogues of growing size, drawn by seed: plan of jobs and grid, events to report.

Each is a command of its own, in a folder of its own, so that its time and memory are those of nothing else.
"""

import os
import re
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

from common.costs import cost_of
from common.errors import InputError
from workflow import BASE

SIZES = {"openings": (30, 300, 3000), "steps": (20, 200, 2000), "events": (1000, 10_000, 100_000)}
"""by the name of a case"""
STEPS_OF_OPENINGS, OPENINGS_OF_STEPS = 12, 300  # Steps of mines whose openings grow, and openings where steps do.
OPENINGS_OF_EVENTS, STEPS_OF_EVENTS = 3000, 400
STAGES_OF_EVENTS = ("events", "event rules", "catalogue", "csv", "record csv", "comparison", "report")
QUAKEML_STAGES, MAX_EVENTS_IN_QUAKEML = ("quakeml", "record quakeml"), 10_000  # Such files take too long beyond.
PAGE = re.compile(r"page (?P<size>[0-9.]+) MB$")
STAGE = re.compile(r"(?P<stage>[a-z ]+?) +(?P<seconds>[0-9.]+) s +(?P<memory>[0-9]+) MB$")


def rows_of(case: str, threads: int) -> list[dict]:
    """Rows of a case: its size, and processor time and memory of each stage.

    Raises InputError where the drawn mines are not there: they belong to the tests of a checkout.
    """
    if not (BASE / "tests").is_dir():
        raise InputError(f"scale: {case} needs the project's checkout: its mines are drawn by what its tests draw")
    measure = of_events if case == "events" else of_mines
    rows = []
    for size in SIZES[case]:
        with TemporaryDirectory() as folder:
            rows += [
                {"case": case, "run": "", "size": size, **row} for row in measure(case, size, Path(folder), threads)
            ]
    return rows


def of_mines(case: str, size: int, folder: Path, threads: int) -> list[dict]:
    """Plan of jobs of a drawn mine, and its grid where openings grow."""
    openings, steps = (size, STEPS_OF_OPENINGS) if case == "openings" else (OPENINGS_OF_STEPS, size)
    mine = folder / "mine.yaml"
    _run([sys.executable, "-m", "tests.workflow.large_mines", str(openings), str(steps), str(mine)], BASE)
    snakemake = [sys.executable, "-m", "snakemake", "--snakefile", str(BASE / "Snakefile"), "--directory", str(folder)]
    quiet = ["--quiet", "all", "--cores", str(threads)]
    _run([*snakemake, *quiet, "-n", "--configfile", str(mine)], folder)  # modules are compiled
    rows = [{"stage": "plan of jobs", **_run([*snakemake, *quiet, "-n", "--configfile", str(mine)], folder)}]
    if case == "openings":
        name = f"large-{openings}"
        _run([*snakemake, *quiet, f"results/{name}/grid.nc", "--configfile", str(mine)], folder)
        costs = cost_of(folder / f"logs/{name}/grid.log")
        assert costs is not None  # the command above has ended well
        rows.append({"stage": "grid", "processor_s": costs.running, "memory_MiB": costs.memory})
    return rows


def of_events(case: str, size: int, folder: Path, threads: int) -> list[dict]:
    """Stages from failed rock to the report of so many modelled and as many recorded events."""
    sizes = [str(number) for number in (size, OPENINGS_OF_EVENTS, STEPS_OF_EVENTS)]
    stages = (*STAGES_OF_EVENTS, *(QUAKEML_STAGES if size <= MAX_EVENTS_IN_QUAKEML else ()))
    command = [sys.executable, "-m", "tests.catalogs.large_catalogues", *sizes, str(folder), *stages]
    text = subprocess.run(command, cwd=BASE, check=True, capture_output=True, text=True).stdout
    rows = [
        {"stage": one["stage"], "processor_s": float(one["seconds"]), "memory_MiB": float(one["memory"])}
        for line in text.splitlines()
        if (one := STAGE.match(line))
    ]
    page = PAGE.search(text.strip())
    assert page is not None  # the last line
    next(row for row in rows if row["stage"] == "report")["page_MB"] = float(page["size"])
    return rows


def _run(command: list[str], folder: Path) -> dict[str, float]:
    """Run a command to its end. Processor time, s, of it and of what it started, and largest memory, MiB."""
    with subprocess.Popen(command, cwd=folder, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True) as process:
        assert process.stderr is not None
        said = process.stderr.read()
        _, status, usage = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode:
        raise InputError(f"scale: {' '.join(command[2:])}: {said.strip().splitlines()[-1] if said else 'ended early'}")
    return {"processor_s": usage.ru_utime + usage.ru_stime, "memory_MiB": usage.ru_maxrss / 1024}
