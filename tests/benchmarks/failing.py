"""What a failed particle costs: the stope of the study `refinement`, mined in one step, in ever smaller cells.

Run ``python -m tests.benchmarks.failing``; it takes half an hour and 9 GB on one core, ``--largest 4e5`` a quarter of
that. Required: the cost for each particle that fails is flat within a factor of 1.5 from 10^3 to 10^6. Processor time
of the step alone, without the start of a process and once kernels are compiled. Writes results/benchmarks/failing.csv
and failing.svg.
"""

import argparse
import csv
import tempfile
import time
from pathlib import Path

import numpy as np
import yaml

from catalogs.figures import style
from common.kernel_cache import use_numba_cache
from verification.studies import merge
from workflow.configuration import load

ROOT = Path(__file__).parents[2]
RUNS = [(3, 1.0), (3, 1.4), (4, 1.0), (4, 1.4), (5, 1.0), (5, 1.4), (6, 1.0), (6, 1.4)]
"""levels (cells of 2.5 to 0.3125 m) and size of the stope, times 10 x 15 x 20 m; 2.7 to 3 times as many fail each time
"""
FAILED = 363_000  # particles in cells of 0.3125 m and a stope of size 1: to know which runs are too large


def run(levels: int, size: float, folder: Path) -> dict[str, float]:
    """One step: cell m, failed particles, cells at its end, processor time s."""
    from workflow.run_mine import run_stages  # once the folder of kernels is named

    default = yaml.safe_load((ROOT / "config" / "default.yaml").read_text())
    values = yaml.safe_load((ROOT / "config" / "verification" / "refinement.yaml").read_text())["scene"]
    stope, half = values["excavations"][0], size * np.array([5.0, 7.5, 10.0])
    middle = np.array([80.0, 80.0, 980.0])
    stope |= {"lower": [f"{x} m" for x in middle - half], "upper": [f"{x} m" for x in middle + half]}
    changes = {"name": "failing", "grid": {"coarse_cell": "10 m", "levels": levels, "buffer_cells": 1}}
    mine = load(merge(merge(default, values), changes), folder / "failing.yaml", default)
    stages = run_stages(mine.run_slices(extracted_as=()), folder / "failed.npz")
    next(stages), next(stages)  # grid and elastic stage
    before = time.process_time()
    _, _, facts = next(stages)
    return {
        "cell": 10.0 / 2 ** (levels - 1), "size": size, "failed": facts["failed_particles"], "cells": facts["cells"],
        "seconds": time.process_time() - before,
    }  # fmt: skip


def draw(rows: list[dict[str, float]]):
    """Cost of a failed particle over how many fail, both on logarithmic axes."""
    with style.applied():
        figure = style.new_figure(height=3.2)
        axes = figure.subplots()
        for size in sorted({row["size"] for row in rows}):
            own = [row for row in rows if row["size"] == size]
            cost = [1e3 * row["seconds"] / row["failed"] for row in own]
            axes.loglog([row["failed"] for row in own], cost, "o-", label=f"stope {size:g} times 10 x 15 x 20 m")
        axes.set(xlabel="failed particles", ylabel="processor time of each (ms)", ylim=(0.1, 10.0))
        axes.legend(frameon=False)
    return figure


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--largest", type=float, default=2e6, help="particles that may fail in a run")
    largest = parser.parse_args().largest
    use_numba_cache()
    from mpm_core.simd.threads import use_threads

    use_threads(1)
    folder = ROOT / "results" / "benchmarks"
    folder.mkdir(parents=True, exist_ok=True)
    rows = []
    with tempfile.TemporaryDirectory() as temporary:
        run(3, 1.0, Path(temporary))  # compiles, and loads what is compiled
        for levels, size in RUNS:
            if FAILED * size**3 / 8 ** (6 - levels) > largest:
                continue
            rows.append(run(levels, size, Path(temporary)))
            row = rows[-1]
            print(
                f"{row['cell']:g} m, stope {size:g}: {row['failed']:>9,} fail in {row['cells']:>9,} cells, "
                f"{row['seconds']:8.1f} s, {1e3 * row['seconds'] / row['failed']:.2f} ms each", flush=True,
            )  # fmt: skip
            with (folder / "failing.csv").open("w", newline="", encoding="utf-8") as file:
                csv.DictWriter(file, list(row)).writeheader()
                csv.DictWriter(file, list(row)).writerows(rows)
    style.save(draw(rows), folder / "failing.svg")


if __name__ == "__main__":
    main()
