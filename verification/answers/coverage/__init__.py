"""Coverage of the 95 % intervals of the comparison: of b, of angles between mean axes, of places, of sums and ratios.

Each case draws many catalogues of known truth. Its rows are the share of catalogues with an interval, and the share of
intervals that hold the truth. For a record and a model of one process they are also the share of false alarms.
"""

from dataclasses import dataclass

from matplotlib.figure import Figure

from catalogs.figures import style
from verification.answers.coverage.cases import axes_coverage, one_process, size_coverage, sum_coverage
from verification.page_tables import Pivot
from verification.results import Results
from verification.rows import Row

TABLES = (
    Pivot(
        "Share of catalogues with an interval, and share of intervals that hold the truth",
        r"(?P<row>.+): (?P<column>coverage of the 95 % interval|share of catalogues with an interval) \(error: .+\)",
        "measured",
    ),
    Pivot(
        "Share of pairs of one process that are told apart at 5 %",
        r"(?P<row>.+): (?P<column>\w+) of one process said to differ .+",
        "measured",
    ),
)


@dataclass(frozen=True)
class Found:
    """A case: catalogues drawn, share of these with an interval, and share of those that hold the truth."""

    name: str
    drawn: int
    given: float
    held: float


def answer(results: Results) -> tuple[list[Row], Figure]:
    """Two rows for each interval of a case, false alarms in cases of one process, and a figure of all intervals."""
    settings, allowed = results.settings, results.allowed
    found, alarms = [], []
    for group, (part, cover) in enumerate((("sizes", size_coverage), ("axes", axes_coverage), ("sums", sum_coverage))):
        chosen = settings[part]
        for number, case in enumerate(chosen["cases"]):
            for of, (given, held) in cover(case, chosen, [settings["seed"], group, number]).items():
                name = f"{of}, {case['name']}" if of else case["name"]
                found.append(Found(name, chosen["catalogues"], given, held))
    chosen = settings["one_process"]
    for number, case in enumerate(chosen["cases"]):
        pairs = one_process(case, chosen, [settings["seed"], 3, number])
        found += [
            Found(f"{case['name']}: {what}", chosen["catalogues"], pairs.given, share)
            for what, share in pairs.held.items()
        ]
        alarms += [
            _alarm_row(f"{case['name']}: {what}", chosen, share, allowed["alarms"])
            for what, share in pairs.alarms.items()
        ]
    return [row for one in found for row in _rows(one, allowed)] + alarms, _draw(found, allowed["coverage"])


def _alarm_row(name: str, chosen: dict, share: float, most: float) -> Row:
    level = chosen["level"]
    error = (level * (1.0 - level) / chosen["catalogues"]) ** 0.5
    return Row(
        f"{name} of one process said to differ (p <= {level:g}; error: above {most:g})",
        level, share, max(0.0, share - most), 2.0 * error,
        f"{chosen['catalogues']} pairs, Monte Carlo standard error {error:.4f}",
    )  # fmt: skip


def _rows(one: Found, allowed: dict) -> list[Row]:
    least, often = allowed["coverage"], allowed["given"]
    error = (0.95 * 0.05 / max(one.given * one.drawn, 1)) ** 0.5
    return [
        Row(
            f"{one.name}: coverage of the 95 % interval (error: short of {least:g})",
            0.95, one.held, max(0.0, least - one.held), 0.0,
            f"{one.drawn} catalogues, Monte Carlo standard error {error:.4f}",
        ),
        Row(
            f"{one.name}: share of catalogues with an interval (error: short of {often:g})",
            1.0, one.given, max(0.0, often - one.given), 0.0,
            "the others: no law, no completeness or no event, in words",
        ),
    ]  # fmt: skip


def _draw(found: list[Found], least: float) -> Figure:
    """Coverage case by case, with two Monte Carlo standard errors."""
    figure = style.new_figure(width=style.PAGE_WIDTH, height=0.22 * len(found) + 1.2)
    axes = figure.subplots()
    error = [200 * (0.95 * 0.05 / max(one.given * one.drawn, 1)) ** 0.5 for one in found]
    place = range(len(found))
    axes.errorbar([100 * one.held for one in found], place, xerr=error, fmt="o", color=style.MODELLED, markersize=4)
    axes.axvline(95, color=style.OUTLINE, linewidth=0.8)
    axes.axvline(100 * least, color=style.RECORDED, linewidth=0.8, linestyle=":")
    axes.set_yticks(place, [one.name for one in found])
    axes.invert_yaxis()
    axes.set_xlim(right=100.0)
    axes.set_xlabel("truth inside the 95 % interval (%; bars: 2 Monte Carlo errors; dotted: asked for)")
    return figure
