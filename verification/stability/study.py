"""The study of the limits of the numerics: a case for each knob, a row for each run of it."""

from collections import defaultdict
from dataclasses import asdict

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from verification.frame import CaseResults, Inputs, MeasuringStudy
from verification.page_tables import Columns, Counts
from verification.stability.figure import draw
from verification.stability.knobs import knob_of
from verification.stability.points import FAULT, RIGHT, WRONG, Point, measure

NO_AXIS = "none"  # Scale of a knob that no panel shows.
RANGES = "ranges"
RANGE_COLUMNS = ("knob", "series", "from", "to", "ends", "largest_error")


def measure_case(key: str, inputs: Inputs, threads: int) -> list[dict]:
    """Run the cases of one knob."""
    return [asdict(point) for point in measure(knob_of(key))]


def points_of(results: CaseResults) -> dict[str, list[Point]]:
    """Points of each knob by its key."""
    return {key: [Point(**point) for point in points] for key, points in results.items()}


def tables(results: CaseResults) -> dict[str, pd.DataFrame]:
    """The table of all runs, and that of the stretches of each series that ended in one way."""
    groups = points_of(results).values()
    rows = pd.DataFrame([asdict(point) for points in groups for point in points])
    stretches = [row for points in groups for row in ranges(points)]
    return {"table": rows, RANGES: pd.DataFrame(stretches, columns=list(RANGE_COLUMNS))}


def figures(results: CaseResults) -> dict[str, Figure]:
    """Errors along each knob; no figure where no knob has an axis."""
    groups = points_of(results)
    drawn = [(knob, points) for key, points in groups.items() if (knob := knob_of(key)).scale != NO_AXIS]
    return {"figure": draw(drawn)} if drawn else {}


def ranges(points: list[Point]) -> list[dict]:
    """Stretches of one kind in each series of a knob, in its order, with the largest error where runs have one.

    A knob without an axis has none.
    """
    if knob_of(points[0].knob).scale == NO_AXIS:
        return []
    series: dict[str, list[list[Point]]] = defaultdict(list)
    for point in points:
        stretches = series[point.series]
        if stretches and stretches[-1][-1].kind == point.kind:
            stretches[-1].append(point)
        else:
            stretches.append([point])
    return [_range(stretch) for stretches in series.values() for stretch in stretches]


def _range(stretch: list[Point]) -> dict:
    first, last = stretch[0], stretch[-1]
    errors = [point.error for point in stretch if np.isfinite(point.error)] if first.kind in (RIGHT, WRONG) else []
    row = {"knob": first.knob, "series": first.series, "from": first.value, "to": last.value, "ends": first.kind}
    return row | {"largest_error": max(errors, default=np.nan)}


NAMES = ("knob", "series", "value", "kind")
ENDS = Counts("How runs end, by the setting that is changed", "knob", "kind")
MISSES = Columns(
    "Runs that are wrong or faults; those that are not known to be so make the target fail",
    ("knob", "series", "value", "error", "allowed", "passed", "known", "message"),
    ("kind", (WRONG, FAULT)),
)
STUDY = MeasuringStudy(
    measure_case,
    tables,
    figures,
    shown=(
        ENDS,
        MISSES,
        Columns(
            "Along each setting, and the largest error as a share",
            RANGE_COLUMNS,
            file=RANGES,
        ),
    ),
    names=NAMES,
)
