"""The study of growth: a case for each thing that grows, a row for each stage at each size, and its exponent."""

from itertools import pairwise

import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from matplotlib.ticker import NullFormatter

from catalogs.figures import style
from common.errors import InputError
from verification.frame import CaseResults, Inputs, MeasuringStudy, read_study
from verification.page_tables import Columns
from verification.results import Variant
from verification.scale import ARRAYS, DRAWN
from verification.scale.arrays import rows_of_arrays
from verification.scale.drawn import rows_of

COLOURS = ("#0072b2", "#56b4e9", "#009e73", "#d55e00", "#cc79a7", "#e69f00", "#000000")  # Okabe and Ito (2008)
MARKS = ("o", "s")  # of the first stages, and of as many after them
MIN_SECONDS = 1.0  # What takes less at both sizes says nothing about growth.
HISTORY, LATER = "history", "a later step"
COLUMNS = ["case", "run", "size", "stage", "processor_s", "memory_MiB", "failed", "page_MB"]
GROWTH = "growth"  # Name of the table of exponents.


def measure_case(name: str, inputs: Inputs, threads: int) -> list[dict]:
    """Rows of a case: case, size, stage, processor_s, memory_MiB and, of cells, failed particles."""
    if name == ARRAYS:
        return rows_of_arrays()
    if name in DRAWN:
        return rows_of(name, threads)
    results = read_study(name)
    case = f"cells of {results.study.title}"
    return [row for run, one in results.variants.items() for row in rows_of_stages(one, case, run)]


def rows_of_stages(variant: Variant, case: str, run: str) -> list[dict]:
    """Rows of the stages of the mechanics of a run. Raises InputError for one whose log does not state its costs."""
    rows = []
    for stage in variant.stages:
        costs = variant.costs(stage)
        if costs is None:
            raise InputError(f"{variant.mine.name}: the log of {stage} does not state its costs; run the stage again")
        facts, name = {}, stage
        if stage.startswith("steps/"):
            step = stage.removeprefix("steps/")
            facts, name = variant.step(step).attrs, HISTORY if step == variant.step_names[0] else LATER
        rows.append(
            {
                "case": case,
                "run": run,
                "size": int(facts.get("cells", variant.grid.sizes["cell"])),
                "stage": name,
                "processor_s": costs.running,
                "memory_MiB": costs.memory,
                "failed": int(facts.get("failed_particles", 0)),
            }
        )
    variant.kept.clear()  # States are large.
    return rows


def table_of(results: CaseResults) -> pd.DataFrame:
    """All rows; bytes_per_cell of stages of the mechanics."""
    table = pd.DataFrame([row for name, case in results.items() if name != ARRAYS for row in case]).reindex(
        columns=COLUMNS
    )
    of_cells = table["case"].str.startswith("cells")
    table["bytes_per_cell"] = np.where(of_cells, table["memory_MiB"] * 2**20 / table["size"], np.nan)
    return table


def growth_of(table: pd.DataFrame) -> pd.DataFrame:
    """Exponent of processor time from each size of a case and stage to the next one; of later steps, their mean."""
    rows = []
    for (case, stage), group in table.groupby(["case", "stage"], sort=False):
        if stage == LATER:
            group = group.groupby("run", sort=False)[["size", "processor_s"]].mean()
        group = group.sort_values("size")
        for one, other in pairwise(group.itertuples()):
            if min(one.processor_s, other.processor_s) >= MIN_SECONDS:
                exponent = np.log(other.processor_s / one.processor_s) / np.log(other.size / one.size)
                rows.append({"case": case, "stage": stage, "from": one.size, "to": other.size, "exponent": exponent})
    return pd.DataFrame(rows, columns=["case", "stage", "from", "to", "exponent"])


def tables(results: CaseResults) -> dict[str, pd.DataFrame]:
    """The table of all rows, that of exponents, and that of arrays."""
    table = table_of(results)
    arrays = pd.DataFrame(results.get(ARRAYS, []), columns=["stage", "file", "code", "bytes_per_cell"])
    return {"table": table, GROWTH: growth_of(table), ARRAYS: arrays}


def figures(results: CaseResults) -> dict[str, Figure]:
    """Processor time of each stage against size, a panel for each case."""
    table = table_of(results)
    cases = list(dict.fromkeys(table["case"]))
    figure = style.new_figure(height=2.6 * ((len(cases) + 1) // 2))
    panels = figure.subplots((len(cases) + 1) // 2, 2, squeeze=False, sharey=True).ravel()
    for panel, case in zip(panels, cases, strict=False):
        own = table[table["case"] == case]
        for number, (stage, rows) in enumerate(own.groupby("stage", sort=False)):
            line = "none" if stage == LATER else "-"
            look = {"color": COLOURS[number % len(COLOURS)], "marker": MARKS[number // len(COLOURS)], "linestyle": line}
            panel.loglog(rows["size"], rows["processor_s"], markersize=4, label=stage, **look)
        panel.set_title(case)
        panel.set_xlabel("cells" if case.startswith("cells") else case)
        panel.set_ylabel("processor time (s)")
        panel.yaxis.set_tick_params(labelleft=True)
        panel.grid(color="#e8e8e8", linewidth=0.6)
        panel.yaxis.set_major_formatter("{x:g}")
        for axis in (panel.xaxis, panel.yaxis):
            axis.set_minor_formatter(NullFormatter())
        panel.legend(fontsize=7, loc="center left", bbox_to_anchor=(1.0, 0.5))
    for panel in panels[len(cases) :]:
        panel.set_axis_off()
    return {"growth": figure}


STUDY = MeasuringStudy(
    measure_case,
    tables,
    figures,
    shown=(
        Columns(
            "Processor time and memory by size",
            ("case", "size", "stage", "processor_s", "memory_MiB", "bytes_per_cell", "failed", "page_MB"),
        ),
        Columns(
            f"Exponents of growth, where both sizes take {MIN_SECONDS:g} s or more",
            ("case", "stage", "from", "to", "exponent"),
            file=GROWTH,
        ),
        Columns(
            "What holds the memory of the demo's stages at their peak, by the line of code that makes it",
            ("stage", "file", "code", "bytes_per_cell"),
            file=ARRAYS,
        ),
    ),
    names=("case", "size", "stage"),
)
