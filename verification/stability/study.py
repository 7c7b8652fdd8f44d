"""The study of the limits of the numerics: a case for each knob, a row for each run of it."""

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
RANGES, SETTINGS = "ranges", "settings"  # Names of the tables beside that of all runs.
RANGE_COLUMNS = {  # Column of a stretch: that of its runs, and what it takes of them.
    "knob": ("knob", "first"),
    "series": ("series", "first"),
    "from": ("value", "first"),
    "to": ("value", "last"),
    "ends": ("kind", "first"),
    "largest_error": ("error", "max"),
}


def measure_case(key: str, inputs: Inputs, threads: int) -> list[dict]:
    """Run the cases of one knob."""
    return [asdict(point) for point in measure(knob_of(key))]


def tables(results: CaseResults) -> dict[str, pd.DataFrame]:
    """Tables of all runs, of the stretches of each series that ended in one way, and of what each knob changes."""
    runs = pd.DataFrame([point for points in results.values() for point in points])
    knobs = pd.DataFrame([{"knob": key, "setting": knob_of(key).title, "runs": knob_of(key).about} for key in results])
    return {"table": runs, RANGES: ranges(runs), SETTINGS: knobs}


def figures(results: CaseResults) -> dict[str, Figure]:
    """Errors along each knob; no figure where no knob has an axis."""
    drawn = [(knob_of(key), [Point(**point) for point in points]) for key, points in results.items() if has_axis(key)]
    return {"figure": draw(drawn)} if drawn else {}


def has_axis(key: str) -> bool:
    """True if the knob of a key has an axis, along which its runs are in order."""
    return knob_of(key).scale != NO_AXIS


def ranges(runs: pd.DataFrame) -> pd.DataFrame:
    """Stretches of one kind in each series, in its order, with the largest error where runs have one.

    runs: columns as the fields of Point. Knobs without an axis have no stretches.
    """
    runs = runs[runs["knob"].map(has_axis).astype(bool)]
    runs = runs.assign(number=runs.groupby(["knob", "series"], sort=False).ngroup())
    runs = runs.sort_values("number", kind="stable")
    runs["error"] = runs["error"].where(runs["kind"].isin([RIGHT, WRONG]) & np.isfinite(runs["error"]))
    begins = (runs[["number", "kind"]] != runs[["number", "kind"]].shift()).any(axis=1)
    return runs.groupby(begins.cumsum()).agg(**RANGE_COLUMNS).reset_index(drop=True).infer_objects()


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
        Columns("The settings, and what is run", ("knob", "setting", "runs"), file=SETTINGS),
        ENDS,
        MISSES,
        Columns("Along each setting, and the largest error as a share", tuple(RANGE_COLUMNS), file=RANGES),
    ),
    names=NAMES,
)
