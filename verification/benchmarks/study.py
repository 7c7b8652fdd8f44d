"""The study of time and memory: its cases, and a row for each code, problem and size with ratios to the reference."""

import logging
from pathlib import Path

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from catalogs.figures import style
from verification.benchmarks.measuring import DONE, FAILED, LEFT_OUT, NOT_RUN, STOPPED, measure
from verification.benchmarks.settings import REFERENCE, Settings, read_settings
from verification.frame import CaseResults, Inputs, MeasuringStudy, read_cases
from verification.page_tables import Columns, Cross

ENVIRONMENTS = Path("results/benchmarks/environments")  # Of the other codes; kept between runs.
COLOURS = ("#0072b2", "#56b4e9", "#009e73", "#d55e00", "#cc79a7", "#e69f00", "#000000")  # Okabe and Ito (2008)
MARKS = ("o", "s", "D", "^", "v", "P", "X")
MAX_BUSY_PROCESSORS = 0.1  # Wall times say little where other processes kept more processors busy during a run.

COLUMNS = {
    "problem": "",
    "code": "",
    "version": "",
    "cells": "cells of rock, all of them finest ones",
    "unknowns": "displacements that are solved for on these",
    "cells_at_end": "all cells of our grids when the step ends, the stope's included",
    "cell_m": "edge of the finest cells",
    "outcome": "done, stopped at a limit, not run (foreseen to exceed one), failed, left out (not installed)",
    "wall_s": "median of the repetitions",
    "cpu_s": "of all threads",
    "memory_GB": "peak of the process",
    "us_per_cell": "wall time over cells",
    "ratio": "wall time over that of the reference, same problem and size",
    "cpu_ratio": "the same of processor time",
    "memory_ratio": "the same of memory",
    "iterations": "V-cycles, explicit steps, Newton's or linear solutions",
    "closure_mm": "convergence of the stope's side walls",
    "failed_m3": "volume of rock that reached its strength, ours only",
    "beside": "code whose closure it must give",
    "difference": "of the closure from that, as a share",
    "agrees": "yes, no, or nothing to compare with",
    "repetitions": "",
    "others": "processors that other processes kept busy meanwhile, mean",
    "busy": "yes where these are more than MAX_BUSY_PROCESSORS: the wall time says little",
    "begun": "UTC",
    "threads": "",
    "machine": "",
    "remark": "",
}
MEASURED = (
    "seconds",
    "cpu_seconds",
    "memory",
    "iterations",
    "closure",
    "cells_at_end",
    "failed_volume",
    "repetitions",
    "others",
    "version",
)
COLUMN_NAMES = {
    "seconds": "wall_s",
    "cpu_seconds": "cpu_s",
    "memory": "memory_GB",
    "cell": "cell_m",
    "failed_volume": "failed_m3",
}


def measure_case(name: str, inputs: Inputs, threads: int) -> dict:
    """Measure one case in a process of its own. inputs: the smaller cases of its code and problem ("earlier")."""
    settings = read_settings()
    case = settings.case(name)
    paths = inputs.get("earlier", [])
    earlier = list(read_cases(paths)[0].values()) if paths else []
    row = measure(settings, case, min(settings.threads, threads), earlier, ENVIRONMENTS)
    took = f"{row['seconds']:.3g} s" if row["outcome"] == DONE else f"{row['outcome']}: {row['remark']}"
    logging.info("%s, %s, %d cells: %s", case.problem, case.code, row["cells"], took)
    return row


def make_table(settings: Settings, rows: list[dict]) -> pd.DataFrame:
    """COLUMNS of all rows; numbers are NaN where a case was not solved."""
    table = pd.DataFrame([dict.fromkeys(MEASURED) | row for row in rows])
    for key in set(MEASURED) - {"version"}:
        table[key] = table[key].astype(float)
    table["version"] = table["version"].fillna("")
    table = table.rename(columns=COLUMN_NAMES)
    table["us_per_cell"] = 1e6 * table["wall_s"] / table["cells"]
    table["closure_mm"] = 1e3 * table.pop("closure")
    for ratio, key in (("ratio", "wall_s"), ("cpu_ratio", "cpu_s"), ("memory_ratio", "memory_GB")):
        table[ratio] = table[key] / _beside(table, key, dict.fromkeys(settings.codes, REFERENCE))
    partner = {name: code.agrees_with for name, code in settings.codes.items()}
    within = table["code"].map({name: code.within for name, code in settings.codes.items()})
    table["beside"] = table["code"].map(partner)
    table["difference"] = table["closure_mm"] / _beside(table, "closure_mm", partner) - 1.0
    table["agrees"] = np.where(table["difference"].abs() <= within, "yes", "no")
    table.loc[table["difference"].isna(), "agrees"] = ""
    table["busy"] = np.where(table["others"] > MAX_BUSY_PROCESSORS, "yes", "")
    return table[list(COLUMNS)]


def _beside(table: pd.DataFrame, key: str, partner: dict[str, str]) -> pd.Series:
    """Column `key` of each row's partner (row,): the code that `partner` names, on the same mesh; NaN without one."""
    known = table.set_index(["problem", "cells", "code"])[key]
    places = pd.MultiIndex.from_arrays([table["problem"], table["cells"], table["code"].map(partner)])
    return known.reindex(places).set_axis(table.index)


def draw(settings: Settings, table: pd.DataFrame) -> Figure:
    """Wall time per cell against size, log-log, above, and closure as cells shrink below; a column for each problem."""
    figure = style.new_figure(height=7.2)
    axes = figure.subplots(2, len(settings.problems), sharex=True, sharey="row", squeeze=False)
    for (cost, closure), (problem, about) in zip(axes.T, settings.problems.items(), strict=True):
        for number, (name, code) in enumerate(settings.codes.items()):
            if name not in about.codes:
                continue
            rows = solved(table, problem, name)
            look: dict = {"color": COLOURS[number % len(COLOURS)], "marker": MARKS[number % len(MARKS)]}
            is_reference = name == REFERENCE  # Its line is thicker, since another may cover it.
            look |= {"markersize": 9, "linewidth": 3.0} if is_reference else {"markersize": 5, "linewidth": 1.5}
            cost.plot(rows["cells"], rows["us_per_cell"], label=code.title, **look)
            closure.plot(rows["cells"], rows["closure_mm"], **look)
        cost.set(xscale="log", yscale="log", title=about.title)
        closure.set(xlabel="cells of rock, all of them finest ones")
        for panel in (cost, closure):
            panel.grid(which="major", color="#e2e2e2", linewidth=0.6)
        cost.yaxis.set_major_formatter("{x:g}")
    axes[0, 0].set_ylabel("wall time per cell (µs)")
    axes[1, 0].set_ylabel("closure of the side walls (mm)")
    lines = {text: line for panel in axes[0] for line, text in zip(*panel.get_legend_handles_labels(), strict=True)}
    figure.legend(lines.values(), lines.keys(), loc="outside lower center", ncols=4)
    return figure


def solved(table: pd.DataFrame, problem: str, code: str) -> pd.DataFrame:
    """Rows of one line of the plot, by size."""
    chosen = (table["problem"] == problem) & (table["code"] == code) & (table["outcome"] == DONE)
    return table[chosen].sort_values("cells")


def tables(results: CaseResults) -> dict[str, pd.DataFrame]:
    """The table of all cases."""
    return {"table": make_table(read_settings(), list(results.values()))}


def figures(results: CaseResults) -> dict[str, Figure]:
    """Wall time and closure against the number of cells."""
    settings = read_settings()
    return {"figure": draw(settings, make_table(settings, list(results.values())))}


BESIDE_PEERS = ("problem", ("elastic", "coulomb"))
STEPS = ("problem", ("brittle",))
BY = ("problem", "code")
STUDY = MeasuringStudy(
    measure_case,
    tables,
    figures,
    shown=(
        Cross("Wall time (s) by number of cells", BY, "cells", "wall_s", BESIDE_PEERS),
        Cross("Wall time over that of `multigrid`", BY, "cells", "ratio", BESIDE_PEERS),
        Cross("Wall time per cell (µs) by number of cells", BY, "cells", "us_per_cell", BESIDE_PEERS),
        Cross("Processor time (s) by number of cells", BY, "cells", "cpu_s", BESIDE_PEERS),
        Cross("Largest memory (GB) by number of cells", BY, "cells", "memory_GB", BESIDE_PEERS),
        Cross("Closure of the stope (mm) by number of cells", BY, "cells", "closure_mm", BESIDE_PEERS),
        Cross(
            "Closure less that of the code that it is compared with, as a share",
            BY,
            "cells",
            "difference",
            BESIDE_PEERS,
        ),
        Columns(
            "Closures that differ by more than is allowed, so that times must not be compared",
            ("problem", "code", "beside", "cells", "difference"),
            ("agrees", ("no",)),
        ),
        Columns(
            "A step in brittle rock, on equal cells (`multigrid`) and on cells that follow the rock (`adaptive`)",
            (
                *("cell_m", "code", "cells_at_end", "wall_s", "cpu_s", "memory_GB"),
                *("ratio", "closure_mm", "failed_m3", "outcome"),
            ),
            STEPS,
        ),
        Columns(
            "Sizes that were not solved",
            ("problem", "code", "cells", "outcome", "remark"),
            ("outcome", (STOPPED, NOT_RUN, FAILED, LEFT_OUT)),
        ),
        Columns(
            "Runs beside which something else kept processors busy: their wall times say little",
            ("problem", "code", "cells", "others"),
            ("busy", ("yes",)),
        ),
        Columns("Machine", ("machine", "threads"), ("outcome", (DONE,))),
        Columns("Versions", ("code", "version"), ("outcome", (DONE,))),
    ),
    names=("problem", "code", "cells"),
)
