"""Table of the benchmark: a row for each code, problem and size, with ratios to the reference and agreement."""

import json
from pathlib import Path

import numpy as np
import pandas as pd

from verification.benchmarks.measuring import DONE
from verification.benchmarks.settings import REFERENCE, Settings

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


def read_rows(files: list[str]) -> list[dict]:
    """Rows that measuring.measure wrote, in the order given."""
    return [json.loads(Path(file).read_text(encoding="utf-8")) for file in files]


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
    return table[list(COLUMNS)]


def _beside(table: pd.DataFrame, key: str, partner: dict[str, str]) -> pd.Series:
    """The same quantity of each row's partner on the same mesh, NaN where there is none."""
    known = table.set_index(["problem", "cells", "code"])[key]
    places = zip(table["problem"], table["cells"], table["code"].map(partner), strict=True)
    return pd.Series([known.get(place, np.nan) for place in places], index=table.index, dtype=float)


def solved(table: pd.DataFrame, problem: str, code: str) -> pd.DataFrame:
    """Rows of one line of the plot, by size."""
    chosen = (table["problem"] == problem) & (table["code"] == code) & (table["outcome"] == DONE)
    return table[chosen].sort_values("cells")


def summary(settings: Settings, table: pd.DataFrame) -> list[dict]:
    """For each problem and code: its largest solution that the reference has solved as well, and its largest of all."""
    rows = []
    for problem, about in settings.problems.items():
        for name in about.codes:
            code = settings.codes[name]
            all_solved = solved(table, problem, name)
            beside = all_solved.dropna(subset=["ratio"])
            if not beside.empty:
                compared, largest = beside.iloc[-1].to_dict(), all_solved.iloc[-1].to_dict()
                rows.append({"title": about.title, "code_title": code.title, "largest": largest, **compared})
    return rows


def agreements(settings: Settings, table: pd.DataFrame) -> list[tuple[str, bool]]:
    """Sentences on how closures agree on the same mesh, and whether within the allowed difference."""
    said = []
    for problem, about in settings.problems.items():
        for name in about.codes:
            code = settings.codes[name]
            rows = solved(table, problem, name).dropna(subset=["difference"])
            if rows.empty:
                continue
            partner = settings.codes[code.agrees_with].title
            shares = [f"{100 * row.difference:+.2g} % ({row.cells:,})" for row in rows.itertuples()]
            passed = bool((rows["agrees"] == "yes").all())
            said.append(
                (
                    f"{about.title}: closure in {code.title} beside {partner}, by cells: "
                    f"{', '.join(shares)}; {100 * code.within:g} % allowed.",
                    passed,
                )
            )
    return said
