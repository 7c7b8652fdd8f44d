"""Output in results/stability: table.csv, figure.svg, and report.html, which refers to no other file."""

from collections import Counter
from dataclasses import asdict
from pathlib import Path

import numpy as np
import pandas as pd

from catalogs.figures import style
from common.datasets import atomic_path
from verification.html_page import write_page
from verification.stability.figure import draw
from verification.stability.knobs import knob_of
from verification.stability.points import ENDED, KINDS, REFUSED, RIGHT, SOUND, WRONG, Point

CLASSES = ("right", "sound", "wrong", "ended", "refused", "fault")  # Style classes of the page.
NO_AXIS = "none"  # Scale of a knob that is shown as a table.


def write_report(groups: list[list[Point]], table: Path, page: Path) -> None:
    """Write table, figure and page, atomically."""
    points = [point for group in groups for point in group]
    rows = pd.DataFrame([asdict(point) for point in points])
    rows["fails"] = np.where(rows.fails, "yes", "")
    with atomic_path(table) as temporary:
        rows.to_csv(temporary, index=False, float_format="%.6g")
    drawn = [(knob, group) for group in groups if (knob := knob_of(group[0].knob)).scale != NO_AXIS]
    with style.applied():
        figure = style.save(draw(drawn), page.parent / "figure.svg") if drawn else ""
    write_page(
        page,
        "stability",
        {"error": error_text, "value": value_text},
        figure=figure,
        kinds=KINDS,
        total=Counter(point.kind for point in points),
        count=len(points),
        minutes=sum(point.seconds for point in points) / 60.0,
        failing=[point for point in points if point.fails],
        wrong=[point for point in points if point.kind == WRONG],
        sections=[_section(group) for group in groups],
        balances=_balances(points),
        knobs={group[0].knob: knob_of(group[0].knob) for group in groups},
        classes=dict(zip(KINDS, CLASSES, strict=True)),
    )


def _section(group: list[Point]) -> dict:
    """What the template shows of a knob: counts, a row for each series, and the cases that are not right."""
    knob = knob_of(group[0].knob)
    series: dict[str, list[Point]] = {}
    for point in group:
        series.setdefault(point.series, []).append(point)
    kinds = Counter(point.kind for point in group)
    others = [point for point in group if point.kind not in (RIGHT, SOUND)]
    return {
        "knob": knob,
        "kinds": kinds,
        "series": [{"title": title, "ranges": ranges(points)} for title, points in series.items()],
        "others": others,
        "is_table": knob.scale == NO_AXIS,
        "seconds": sum(point.seconds for point in group),
    }


def ranges(points: list[Point]) -> list[tuple[str, str]]:
    """Stretches of one kind in a series, in its order: kind, and a text with the largest error where there is one."""
    found, start = [], 0
    for end in range(1, len(points) + 1):
        if end < len(points) and points[end].kind == points[start].kind:
            continue
        part = points[start:end]
        first, last = value_text(part[0].value), value_text(part[-1].value)
        where = first if len(part) == 1 else f"{first} to {last}"
        errors = [point.error for point in part if point.error is not None and np.isfinite(point.error)]
        worst = f", up to {error_text(max(errors))}" if errors and part[0].kind in (RIGHT, WRONG) else ""
        found.append((part[0].kind, f"{where}: {part[0].kind}{worst}"))
        start = end
    return found


def _balances(points: list[Point]) -> dict[str, float]:
    """Largest momentum error of all runs that reached equilibrium, and their number."""
    rest = [point for point in points if point.kind not in (ENDED, REFUSED) and np.isfinite(point.mass)]
    momentum = [point.momentum_error for point in rest if np.isfinite(point.momentum_error)]
    return {"runs": len(rest), "momentum": max(momentum, default=0.0)}


def error_text(error: float) -> str:
    """A share in per cent with two digits."""
    if error is None or not np.isfinite(error):
        return "nothing to compare with" if error is not None and np.isinf(error) else ""
    percent = 100 * error
    return f"{percent:.0f} %" if percent >= 9.5 else f"{percent:.2g} %"


def value_text(value) -> str:
    """A value of a knob as text."""
    return f"{value:g}" if isinstance(value, float | int) else value
