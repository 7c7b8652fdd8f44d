"""The study of what a mine costs: a case for each mine, a row for each size of its cells, and one for each step."""

from typing import Any

import pandas as pd
from matplotlib.figure import Figure

from catalogs.figures import style
from common.costs import Costs
from common.errors import InputError
from verification.frame import CaseResults, Inputs, MeasuringStudy, read_study
from verification.page_tables import Columns
from verification.results import Variant

STEPS = "steps"  # Name of the table of all steps.
COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7")  # Okabe and Ito (2008)


def measure_case(name: str, inputs: Inputs, threads: int) -> dict:
    """What each run of a mine took: `runs` and `steps`, rows of the tables of these names."""
    results = read_study(name)
    runs: list[dict] = []
    steps: list[dict] = []
    for variant in results.variants.values():
        of_run, of_steps = rows_of(variant)
        start = {"mine": results.study.title, "finest_cell_m": float(variant.grid.attrs["fine_cell"])}
        runs.append(start | of_run)
        steps += [start | step for step in of_steps]
        variant.kept.clear()  # States are large.
    return {"runs": runs, STEPS: steps}


def rows_of(variant: Variant) -> tuple[dict[str, Any], list[dict[str, Any]]]:
    """Rows of a run and of its steps, without mine and cell size.

    Times are processor times without compiling. Raises InputError for a stage whose log does not state its costs.
    """
    steps: list[dict[str, Any]] = []
    for name in variant.step_names:
        costs = _costs(variant, f"steps/{name}")
        cells = int(variant.step(name).attrs.get("cells", variant.grid.sizes["cell"]))
        steps.append({"step": name, "cells": cells, "processor_s": costs.running, "memory_MiB": costs.memory})
    others = {stage: _costs(variant, stage) for stage in ("grid", "elastic", "events")}
    seconds = {f"{stage}_s": costs.running for stage, costs in others.items()}
    of_steps = float(sum(step["processor_s"] for step in steps))
    run: dict[str, Any] = {
        "steps": len(steps),
        "cells_at_start": variant.grid.sizes["cell"],
        "cells_at_end": steps[-1]["cells"],
        "processor_min": (sum(seconds.values()) + of_steps) / 60.0,
        **seconds,
        "step_s": of_steps / len(steps),
        "longest_step_s": max(step["processor_s"] for step in steps),
        "memory_MiB": max([costs.memory for costs in others.values()] + [step["memory_MiB"] for step in steps]),
    }
    return run, steps


def _costs(variant: Variant, stage: str) -> Costs:
    costs = variant.costs(stage)
    if costs is None:
        raise InputError(f"{variant.mine.name}: the log of {stage} does not state its costs; run the stage again")
    return costs


def tables(results: CaseResults) -> dict[str, pd.DataFrame]:
    """The table of all runs, and that of all steps."""
    return {
        "table": pd.DataFrame([row for case in results.values() for row in case["runs"]]),
        STEPS: pd.DataFrame([row for case in results.values() for row in case[STEPS]]),
    }


def figures(results: CaseResults) -> dict[str, Figure]:
    """Processor time and memory of each step against its cells."""
    table = tables(results)[STEPS]
    figure = style.new_figure(height=3.0)
    panels = figure.subplots(1, 2)
    for panel, column, label in zip(
        panels, ("processor_s", "memory_MiB"), ("processor time of a step (s)", "memory of a step (MiB)"), strict=True
    ):
        for colour, (mine, rows) in zip(COLOURS, table.groupby("mine", sort=False), strict=False):
            panel.loglog(rows["cells"], rows[column], "o", color=colour, markersize=4, label=mine)
        panel.set_xlabel("cells at the end of the step")
        panel.set_ylabel(label)
        panel.grid(color="#e8e8e8", linewidth=0.6)
    panels[0].legend(fontsize=7)
    return {"steps": figure}


STUDY = MeasuringStudy(
    measure_case,
    tables,
    figures,
    shown=(
        Columns(
            "Cells, steps, processor time and memory of each run",
            (
                *("mine", "finest_cell_m", "steps", "cells_at_start", "cells_at_end", "processor_min"),
                *("step_s", "longest_step_s", "memory_MiB"),
            ),
        ),
        Columns("Processor time of the other stages", ("mine", "finest_cell_m", "grid_s", "elastic_s", "events_s")),
        Columns(
            "Each step",
            ("mine", "finest_cell_m", "step", "cells", "processor_s", "memory_MiB"),
            file=STEPS,
        ),
    ),
    names=("mine", "finest_cell_m"),
)
