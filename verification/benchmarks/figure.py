"""Figure of the benchmark: wall time per cell against size, log-log, and closure as cells shrink."""

import pandas as pd
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter

from catalogs.figures import style
from verification.benchmarks.measuring import DONE
from verification.benchmarks.settings import REFERENCE, Settings

COLOURS = ("#0072b2", "#56b4e9", "#009e73", "#d55e00", "#cc79a7", "#e69f00", "#000000")  # Okabe and Ito (2008)
MARKS = ("o", "s", "D", "^", "v", "P", "X")


def draw(settings: Settings, table: pd.DataFrame) -> Figure:
    """All panels: time above, closure below, a column for each problem."""
    figure = style.new_figure(height=7.2)
    axes = figure.subplots(2, len(settings.problems), sharex=True, sharey="row", squeeze=False)
    for column, (problem, about) in enumerate(settings.problems.items()):
        cost, closure = axes[:, column]
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
        cost.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes[0, 0].set_ylabel("wall time per cell (µs)")
    axes[1, 0].set_ylabel("closure of the side walls (mm)")
    lines = {text: line for panel in axes[0] for line, text in zip(*panel.get_legend_handles_labels(), strict=True)}
    figure.legend(lines.values(), lines.keys(), loc="outside lower center", ncols=4)
    return figure


def solved(table: pd.DataFrame, problem: str, code: str) -> pd.DataFrame:
    """Rows of one line of the plot, by size."""
    chosen = (table["problem"] == problem) & (table["code"] == code) & (table["outcome"] == DONE)
    return table[chosen].sort_values("cells")
