"""The mines whose results are pinned, and their runs: Snakemake as a user calls it, in a folder of its own."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

from pins import Pins, pins_of

ROOT = Path(__file__).parents[2]
TINY_MINES = Path(__file__).parent / "mines"
MINES = ROOT / "config" / "mines"
CORES = 2
ALL_BRANCHES = ("all", "baselines", "plans", "calibrate")
ONLY = {"later": {"forecast_scores.nc", "report.html"}}
"""Results that are pinned of runs that otherwise repeat another one."""
COMMON_INSTRUCTIONS = {
    "NUMBA_CPU_NAME": "haswell",
    "NUMBA_CPU_FEATURES": "",
    "OPENBLAS_CORETYPE": "Haswell",
    "NPY_DISABLE_CPU_FEATURES": "X86_V4 AVX512_ICL AVX512_SPR",
}
"""Instructions that all processors since 2013 have. With others, round-off differs, and then which rock fails."""
SHOWN_LINES = 40  # of the terminal of a run that failed


def run(mine_file: Path, folder: Path, *targets: str) -> Path:
    """Run a mine's file in a folder and return its folder of results.

    Raises RuntimeError with the end of the terminal's text if the run fails.
    """
    snakemake = [sys.executable, "-m", "snakemake", *targets, "--cores", str(CORES), "--directory", str(folder)]
    line = [*snakemake, "--snakefile", str(ROOT / "Snakefile"), "--configfile", str(mine_file)]
    environment = os.environ | COMMON_INSTRUCTIONS | {"PYTHONIOENCODING": "utf-8"}
    streams = {"stdout": subprocess.PIPE, "stderr": subprocess.STDOUT, "stdin": subprocess.DEVNULL}
    process = subprocess.run(line, **streams, env=environment, encoding="utf-8", errors="replace", check=False)
    if process.returncode:
        end = "\n".join(process.stdout.splitlines()[-SHOWN_LINES:])
        raise RuntimeError(f"{mine_file}: the run failed\n{end}")
    return folder / "results"


def run_tiny_mines(folder: Path) -> dict[str, Path]:
    """A mine in space with every branch, the same with a month more and its plan as a forecast, two in plane strain."""
    files = shutil.copytree(TINY_MINES, folder / "files")
    own = run(files / "tiny.yaml", folder / "tiny", *ALL_BRANCHES) / "tiny"
    shutil.copy(own / "plans/longer/outcome.nc", files)
    later = run(files / "later.yaml", folder / "later", "results/tiny/report.html") / "tiny"
    flat, laws = (run(files / f"{name}.yaml", folder / name) / name for name in ("flat", "laws"))
    return {"tiny": own, "later": later, "flat": flat, "laws": laws}


def run_demo(folder: Path) -> dict[str, Path]:
    """The demo to its report."""
    return {"demo": run(MINES / "demo.yaml", folder) / "demo"}


def run_elk_creek(folder: Path) -> dict[str, Path]:
    """Elk Creek to its report. Its recorded data are read from ELK_CREEK_DATA, or from data/elk_creek."""
    return {"elk_creek": run(MINES / "elk_creek.yaml", folder) / "elk_creek"}


RUNS = {"tiny": run_tiny_mines, "demo": run_demo, "elk_creek": run_elk_creek}
"""By the name of a golden file: what runs its mines in a folder. It returns folders of results by a name for each."""


def results_of(name: str, folder: Path) -> tuple[Pins, list[str]]:
    """Pins of the mines of a golden file, run in a folder, and the data files that are not pinned."""
    pins: Pins = {}
    others: list[str] = []
    for label, results in RUNS[name](folder).items():
        own, own_others = pins_of(results)
        pins |= {f"{label}/{path}": own[path] for path in own if path in ONLY.get(label, own)}
        others += [f"{label}/{path}" for path in own_others]
    return pins, others
