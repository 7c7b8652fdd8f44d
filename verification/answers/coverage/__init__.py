"""Coverage of the 95 % intervals, and false alarms of the verdicts, that the pages of a mine state.

Each case draws many catalogues of known truth. Its rows are the share of catalogues with an interval, and the share of
intervals that hold the truth. For a record and a model of one process they are also the share of false alarms. Each
subject is a module with a function `answer`, which takes settings and bounds, and returns coverages and other rows.
"""

from functools import partial

from matplotlib.figure import Figure

from catalogs.figures import style
from common.processes import call_all
from verification.answers.coverage import baselines, calibration, comparison, first_page, plans
from verification.answers.coverage.shares import Coverage, coverage_rows
from verification.page_tables import Pivot
from verification.plots import plot_errors
from verification.results import Results
from verification.rows import Row

NUMERICS = (  # Folders and files that the results may change with.
    *("baselines", "calibration", "plans", "catalogs/compare", "catalogs/sources"),
    "catalogs/report/verdict.py",
)

TABLES = (
    Pivot(
        "Share of catalogues with an interval, and share of intervals that hold the truth (± two Monte Carlo standard "
        "errors of a share as large as its bound, here and below)",
        r"(?P<row>.+): (?P<column>coverage of the 95 % interval|share of catalogues with an interval) \(error: .+\)",
        "share",
    ),
    Pivot(
        "Share of pairs of one process that are told apart at 5 %",
        r"(?P<row>.+): (?P<column>\w+) of one process said to differ .+",
        "share",
    ),
    Pivot(
        "Share of first pages that call a right model wrong, and random directions close",
        r"(?P<row>.+): (?P<column>right models called wrong|random directions called closer) \(error: .+\)",
        "share",
    ),
    Pivot(
        "Share of wrong models whose sentence on the first page says so, where they are as wrong as it says it notices",
        r"(?P<row>.+): (?P<column>\w+) of the size that pages state, noticed .+",
        "share",
    ),
    Pivot(
        "Share of calibrations with a warning, right ones and false ones, and coverage by the self-test",
        r"(?P<row>calibration, .+): (?P<column>warned.+|coverage that the self-test states) \(.*error: .+\)",
        "share",
    ),
)
SUBJECTS = {
    "calibration": calibration.answer,  # the longest first
    "first page": first_page.answer,
    "comparison": comparison.answer,
    "plans": plans.answer,
    "baselines": baselines.answer,
}
ORDER = ("comparison", "baselines", "first page", "plans", "calibration")


def answer(results: Results) -> tuple[list[Row], Figure]:
    """Two rows for each interval of a case, false alarms in cases of one process, and a figure of all intervals."""
    parts = {name: partial(subject, results.settings, results.allowed) for name, subject in SUBJECTS.items()}
    found = call_all(parts, results.threads)
    coverages: list[Coverage] = []
    others: list[Row] = []
    for name in ORDER:
        of_subject, rows = found[name]
        coverages += of_subject
        others += rows
    rows = [row for one in coverages for row in coverage_rows(one, results.allowed)]
    return rows + others, _draw(coverages, results.allowed["coverage"])


def _draw(found: list[Coverage], least: float) -> Figure:
    """Coverage case by case, with two Monte Carlo standard errors."""
    figure = style.new_figure(width=style.PAGE_WIDTH, height=0.22 * len(found) + 1.2)
    axes = figure.subplots()
    error = [200 * one.error for one in found]
    what = "truth inside the 95 % interval (%; bars: 2 Monte Carlo errors; dotted: asked for)"
    held = {"": [100 * one.held for one in found]}
    plot_errors(axes, [one.name for one in found], held, error, truth=95, xlabel=what)
    axes.axvline(100 * least, color=style.RECORDED, linewidth=0.8, linestyle=":")
    axes.set_xlim(right=100.0)
    return figure
