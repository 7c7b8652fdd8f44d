"""Runs of a mine with one economy off: cells, cell-cycles, processor time, memory and answer.

A run takes the process of its case, so that the largest memory of the process is that of the run. Only the run with
every stage takes processes of its own.
"""

import resource
import subprocess
import sys
from collections.abc import Iterable, Iterator
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path
from tempfile import TemporaryDirectory
from unittest.mock import patch

import numpy as np
import xarray as xr
import yaml

from common.costs import COMPILING, cost_of, processor_time
from common.datasets import read_dataset
from common.errors import InputError
from mpm_core.equilibrium import subdomain
from mpm_core.equilibrium.cascade import Ramp
from mpm_core.stages import step_subdomain
from verification.comparisons import released_potency
from verification.studies import FOLDER, load_study, merge
from workflow import BASE
from workflow.mine import Mine
from workflow.run_mine import run_stages
from workflow.strict_yaml import read_yaml

BASE_RUN, EVERY_STAGE = "base", "every_stage"  # Variants: no economy is off; also stages that nobody asked for.
OFF: dict[str, AbstractContextManager] = {  # By variant, what turns an economy off that no key of a mine file sets.
    "whole_steps": patch.object(step_subdomain, "MAX_SUBDOMAIN_SHARE", 0.0),
    "whole_cascade": patch.object(subdomain, "MAX_SURROUNDINGS_SHARE", 0.0),
    "every_increment": patch.object(Ramp, "is_constant", False),
}
MAX_CELLS = 3_000_000  # A case has no memory for more of them.


def rows_of(study_name: str, variant: str, threads: int) -> list[dict]:
    """Rows of a variant of a study: mine, economy, whether it is on, cells, costs and answer.

    A grid with too many cells has a row with their number alone: those of its largest size, which are there at least.
    """
    study = load_study(FOLDER / f"{study_name}.yaml")
    mine, start = study.mines[variant], {"mine": study.title, "economy": variant}
    if variant == EVERY_STAGE:
        return [start | row for row in rows_of_stages(study_name, mine, threads)]
    row = start | {"state": "on" if variant == BASE_RUN else "off"}
    if (cells := coarse_cells(mine)) > MAX_CELLS:
        return [row | {"state": "not run", "cells": cells}]
    with OFF.get(variant, nullcontext()):
        return [row | costs_of(mine)]


def coarse_cells(mine: Mine) -> int:
    """Number of cells of a mine's grid before any is split."""
    domain, grid = mine.settings.domain, mine.settings.grid
    assert grid.coarse_cell is not None  # complete: the mine is checked
    return int(np.prod(np.round(np.subtract(domain.upper, domain.lower) / grid.coarse_cell)))


def costs_of(mine: Mine) -> dict:
    """Costs and answer of the mechanics of a mine, which this process computes: grid, elastic state and steps."""
    began, compiled = processor_time(), COMPILING.seconds
    with TemporaryDirectory() as folder:
        stages = run_stages(mine.run_slices(extracted_as=[]), Path(folder) / "failed.npz")
        facts = facts_of(((stage, state) for stage, state, _ in stages if stage != "grid"), mine)
    compiling = COMPILING.seconds - compiled
    return facts | {
        "processor_s": processor_time() - began - compiling,
        "compiling_s": compiling,
        "memory_MiB": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024,
    }


def facts_of(states: Iterable[tuple[str, xr.Dataset]], mine: Mine) -> dict:
    """Work and answer of states: most cells of a step, cell-cycles, potency and failed volume of the steps that have a
    date (of all steps where none has one), and the largest share that coarse cells kept from failing.

    states: with their paths below results/<mine>. Those of its companion have a part in the cell-cycles alone.
    """
    answering = {f"steps/{step}" for step in mine.dated_steps or mine.mined_steps}
    facts = {"cells": 0, "cell_cycles": 0.0, "potency_m3": 0.0, "failed_volume_m3": 0.0, "truncated_share": 0.0}
    for path, state in states:
        facts["cell_cycles"] += cell_cycles(state)
        if path.startswith("steps/"):
            facts["cells"] = max(facts["cells"], state.sizes["cell"])
            facts["truncated_share"] = max(facts["truncated_share"], float(state.attrs["truncated_share"]))
        if path in answering:
            facts["potency_m3"] += released_potency(state)
            facts["failed_volume_m3"] += float(state.attrs["failed_volume"])
    return facts


def cell_cycles(state: xr.Dataset) -> float:
    """Work of a stage: iterations, each times the cells that it relaxed. It does not depend on the machine."""
    cycles = np.diff(state.convergence_iteration.values.astype(np.int64), prepend=0)
    return float(cycles @ state.convergence_cells.values.astype(np.int64))


def rows_of_stages(study_name: str, mine: Mine, threads: int) -> Iterator[dict]:
    """Rows of the stages up to the table of the catalogue alone, and of all stages of the mine's file, by Snakemake."""
    text = mine_text(study_name)
    with TemporaryDirectory() as folder:
        file = Path(folder) / "mine.yaml"
        file.write_text(yaml.safe_dump(text))
        results, logs = (Path(folder) / name / text["name"] for name in ("results", "logs"))
        command = [sys.executable, "-m", "snakemake", "--snakefile", str(BASE / "Snakefile"), "--directory", folder]
        for state, target in (("on", f"results/{text['name']}/catalog.csv"), ("off", "all")):
            options = ["--cores", str(threads), "--configfile", str(file)]
            done = subprocess.run([*command, target, *options], check=False, capture_output=True, text=True)
            if done.returncode:
                raise InputError(f"{study_name}, {EVERY_STAGE}: {done.stderr.strip().splitlines()[-1]}")
            paths = sorted(results.rglob("elastic.nc")) + sorted(results.rglob("steps/*.nc"))
            states = ((path.relative_to(results).with_suffix("").as_posix(), read_dataset(path)) for path in paths)
            costs = [cost for log in logs.rglob("*.log") if (cost := cost_of(log))]
            taken = {
                "processor_s": sum(cost.running for cost in costs),
                "compiling_s": sum(cost.compiling for cost in costs),
                "memory_MiB": max(cost.memory for cost in costs),
            }
            yield {"state": state} | facts_of(states, mine) | taken


def mine_text(study_name: str) -> dict:
    """Content of the mine's file that a study takes its scene from, with the changes of the study's scene."""
    study = read_yaml(FOLDER / f"{study_name}.yaml")
    source = FOLDER / study["scene_from"]
    mine = merge(read_yaml(source), study.get("scene") or {})
    if "record" in mine:
        mine["record"]["file"] = str(source.parent.resolve() / mine["record"]["file"])
    return mine
