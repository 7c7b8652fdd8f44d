"""The study of economies: a case for each run, a row for each, and what an economy saves, off over on."""

import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from matplotlib.ticker import NullFormatter

from catalogs.figures import style
from verification.economies.runs import BASE_RUN, rows_of
from verification.frame import CaseResults, Inputs, MeasuringStudy
from verification.page_tables import Columns

ECONOMIES = {  # By variant: the economy that it does without.
    "wide_domain": "domain from the openings",
    "rings": "cells that follow the rock (off: rings)",
    "regular": "cells that follow the rock (off: equal cells)",
    "three_dimensions": "plane strain",
    "whole_steps": "subdomain of a step",
    "whole_cascade": "subdomains around failed rock",
    "every_increment": "one increment where nothing changes",
    "every_stage": "only stages that are asked for",
}
SAVINGS = "savings"  # Name of the table of ratios.
RATIOS = {  # By column: what it is the ratio of, off over on.
    "times_the_work": ("cell_cycles", "work"),
    "times_the_time": ("processor_s", "processor time"),
    "times_the_memory": ("memory_MiB", "peak memory"),
}
CHANGES = {"potency_change": "potency_m3", "failed_volume_change": "failed_volume_m3"}  # Shares, off less on.
COSTS = ("cells", "cell_cycles", "processor_s", "compiling_s", "memory_MiB")
COLUMNS = ["mine", "economy", "state", *COSTS, "potency_m3", "failed_volume_m3", "truncated_share"]
COLOURS = ("#0072b2", "#d55e00", "#009e73")  # Okabe and Ito (2008)


def measure_case(name: str, inputs: Inputs, threads: int) -> list[dict]:
    """Rows of a case, which is named by its study and its variant with a hyphen between them."""
    study, _, variant = name.partition("-")
    return rows_of(study, variant, threads)


def tables(results: CaseResults) -> dict[str, pd.DataFrame]:
    """The table of all runs, and that of what each economy saves."""
    table = pd.DataFrame([row for rows in results.values() for row in rows], columns=COLUMNS)
    table["economy"] = table["economy"].replace(ECONOMIES | {BASE_RUN: "all"})
    return {"table": table, SAVINGS: savings_of(table)}


def savings_of(table: pd.DataFrame) -> pd.DataFrame:
    """Off over on for each economy that was run without. On is the mine's base, or the economy's own run with it."""
    rows = []
    for _, off in table[table["state"] == "off"].iterrows():
        on = table[(table["mine"] == off["mine"]) & (table["state"] == "on")].set_index("economy")
        on = on.loc[off["economy"] if off["economy"] in on.index else "all"]
        row = {"mine": off["mine"], "economy": off["economy"]}
        row |= {name: _over(off[column], on[column]) for name, (column, _) in RATIOS.items()}
        rows.append(row | {name: _over(off[column], on[column]) - 1.0 for name, column in CHANGES.items()})
    return pd.DataFrame(rows, columns=["mine", "economy", *RATIOS, *CHANGES])


def _over(off: float, on: float) -> float:
    return off / on if on else np.nan


def figures(results: CaseResults) -> dict[str, Figure]:
    """Bars of the ratios by economy and mine."""
    table = tables(results)[SAVINGS]
    mines, economies = list(dict.fromkeys(table["mine"])), [*ECONOMIES.values()]
    figure = style.new_figure(height=4.0)
    panels = figure.subplots(1, len(RATIOS), sharex=True, sharey=True)
    width = 0.8 / max(len(mines), 1)
    for panel, (column, (_, title)) in zip(panels, RATIOS.items(), strict=True):
        for number, (mine, colour) in enumerate(zip(mines, COLOURS, strict=False)):
            rows = table[table["mine"] == mine]
            place = rows["economy"].map(economies.index) + (number - 0.5 * (len(mines) - 1)) * width
            panel.barh(place, rows[column] - 1.0, width, left=1.0, color=colour, label=mine)
        panel.axvline(1.0, color=style.OUTLINE, linewidth=0.8)
        panel.set_xscale("log", base=2)
        panel.xaxis.set_major_formatter("{x:g}")
        panel.xaxis.set_minor_formatter(NullFormatter())
        panel.set_title(title)
        panel.set_xlabel("off over on (1)")
        panel.grid(axis="x", color="#e8e8e8", linewidth=0.6)
    panels[0].set_yticks(range(len(economies)), economies)
    panels[0].set_ylim(len(economies) - 0.5, -0.5)
    figure.legend(*panels[0].get_legend_handles_labels(), loc="outside lower center", ncols=len(COLOURS), fontsize=7)
    return {SAVINGS: figure}


STUDY = MeasuringStudy(
    measure_case,
    tables,
    figures,
    shown=(
        Columns(
            "What each economy saves: off over on, and the change of the answer",
            ("mine", "economy", *RATIOS, *CHANGES),
            file=SAVINGS,
        ),
        Columns("Each run: most cells of a step, costs, and answer of the steps that have a date", tuple(COLUMNS)),
    ),
    names=("mine", "economy", "state"),
)
