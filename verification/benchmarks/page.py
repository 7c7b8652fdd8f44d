"""Output in results/benchmarks: table.csv, figure.svg and report.html."""

from pathlib import Path

import pandas as pd

from catalogs.figures import style
from common.datasets import atomic_path
from verification.benchmarks.figure import draw
from verification.benchmarks.measuring import DONE
from verification.benchmarks.settings import REFERENCE, Settings
from verification.benchmarks.table import agreements, make_table, summary
from verification.html_page import write_page

MAX_BUSY_PROCESSORS = 0.1  # The page warns where other processes kept more processors busy during a run.


def write_report(settings: Settings, rows: list[dict], table_path: Path, figure_path: Path, page: Path) -> None:
    """Write the three files, each atomically."""
    table = make_table(settings, rows)
    with style.applied():
        figure = style.save(draw(settings, table), figure_path)
    with atomic_path(table_path) as temporary:
        table.to_csv(temporary, index=False, float_format="%.6g")
    measured = table[table["outcome"] == DONE]
    write_page(
        page,
        "benchmarks",
        {"number": number},
        settings=settings,
        rows=table.to_dict("records"),
        summary=summary(settings, table),
        agreements=agreements(settings, table),
        figure=figure,
        reference=settings.codes[REFERENCE].title,
        threads=sorted(set(table["threads"])),
        machines=sorted(set(table["machine"])),
        versions=sorted(set(measured["version"])),
        first=table["begun"].min(),
        last=table["begun"].max(),
        solved=len(measured),
        busy=int((measured["others"] > MAX_BUSY_PROCESSORS).sum()),
        allowed=MAX_BUSY_PROCESSORS,
        others=measured["others"].max(),
    )


def number(value: float, digits: int = 3, largest: float = 100.0) -> str:
    """A number as text: so many digits, commas between thousands, a dash for a missing one."""
    if value is None or pd.isna(value):
        return "–"
    return f"{value:,.0f}" if abs(value) >= largest or float(value).is_integer() else f"{value:.{digits}g}"
