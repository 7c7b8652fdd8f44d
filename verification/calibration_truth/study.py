"""The study of a calibration on known truth: a case for each set of terms, a row for each claim."""

from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from numpy.typing import NDArray

from calibration.figures import axis_label, label_log_axis
from calibration.fit import INTERVAL_SHARE, SelfTest
from calibration.settings import CalibratedQuantity
from calibration.stages import read_calibration
from catalogs.figures import style
from common.event_table import read_events
from common.job import read_job
from verification.calibration_truth import claims
from verification.calibration_truth.settings import SAME_LAW, TERMS
from verification.frame import CaseResults, Inputs, MeasuringStudy
from verification.page_tables import Columns

COLUMNS = ("claim", "record", "terms", "quantity", "wanted", "measured", "holds")


def measure_case(name: str, inputs: Inputs, threads: int) -> dict[str, Any]:
    """Claims, and intervals of the figure, of calibrations by the terms of a case.

    inputs: `settings` of the calibration with the true values, its `trials`, those on `finer` cells, the mine's
    `record`, and the `records` that were made.
    """
    (settings,), (record,) = inputs["settings"], map(Path, inputs["record"])
    trials, finer = (list(map(Path, inputs.get(name, []))) for name in ("trials", "finer"))
    given = read_job(settings).settings
    varied = given | {"calibration": given["calibration"] | {"terms": TERMS[name]}}
    found = read_calibration(varied, trials, finer, record)
    kinds = [trial["kind"] for trial in given["trials"]]
    designed = np.array([n for n, kind in enumerate(kinds) if kind == "design" and n not in found.trials.collapsed])
    tested = found.self_test(designed)
    rows = claims.self_test_claims(found, tested, designed)
    for path in inputs["records"]:
        case, fit = Path(path).stem, claims.fit_to_catalogue(found, read_events(path))
        if case == SAME_LAW:
            rows += claims.twin_claims(found, case, given["truth"], fit, wanted_flag=False)
        else:
            rows.append(claims.flag_claim(case, fit.posterior, wanted_flag=True))
    rows += claims.twin_claims(found, "record", given["record_truth"], found.fit, wanted_flag=False)
    blind = read_calibration(varied, trials, [], record)
    rows += claims.twin_claims(blind, "record, cells not corrected", given["record_truth"], blind.fit, wanted_flag=True)
    rows += claims.chain_claims(found)
    claimed = [asdict(row) | {"terms": ", ".join(found.settings.terms)} for row in rows]
    true = claims.true_points(found, designed)
    return {"claims": claimed, "intervals": intervals(tested, true, found.settings.quantities)}


def intervals(tested: SelfTest, true: NDArray, quantities: Sequence[CalibratedQuantity]) -> list[dict[str, Any]]:
    """True values and intervals of each quantity, one panel each, for JSON; true (trial, quantity) in the unit cube."""
    found = []
    for number, quantity in enumerate(quantities):
        low, middle, high = np.array(
            [posterior.intervals(INTERVAL_SHARE)[:, number] for posterior in tested.posteriors]
        ).T
        shares = {"true": true[:, number], "low": low, "middle": middle, "high": high, "ends": (0.0, 1.0)}
        panel: dict[str, Any] = {name: [float(quantity.value(share)) for share in one] for name, one in shares.items()}
        panel |= {"held": tested.held[:, number].tolist(), "label": axis_label(quantity), "scale": quantity.scale}
        found.append(panel)
    return found


def draw(found: list[dict[str, Any]]) -> Figure:
    """One panel for each quantity of `intervals`."""
    count = len(found)
    columns = min(count, 2)
    rows = -(-count // columns)
    figure = style.new_figure(width=3.6 * columns, height=3.1 * rows)
    for number, quantity in enumerate(found):
        panel = figure.add_subplot(rows, columns, number + 1)
        at, low, middle, high, was_held = (np.array(quantity[key]) for key in ("true", "low", "middle", "high", "held"))
        for held, colour, label in ((True, style.MODELLED, "holds the value"), (False, style.RECORDED, "misses it")):
            chosen = was_held == held
            bars = [(middle - low)[chosen], (high - middle)[chosen]]
            panel.errorbar(at[chosen], middle[chosen], bars, fmt=".", color=colour, elinewidth=0.8, label=label)
        panel.plot(quantity["ends"], quantity["ends"], color=style.OUTLINE, linewidth=0.8)
        panel.set(xlabel=f"true {quantity['label']}", ylabel="90 % interval")
        if quantity["scale"] == "log":
            panel.set(xscale="log", yscale="log")
            label_log_axis(panel.xaxis)
            label_log_axis(panel.yaxis)
        if number == 0:
            panel.legend(loc="upper left", bbox_to_anchor=(0.0, 1.22), ncols=2)
    return figure


def tables(results: CaseResults) -> dict[str, pd.DataFrame]:
    """The table of all claims."""
    claimed = [claim for result in results.values() for claim in result["claims"]]
    rows = pd.DataFrame(claimed, columns=list(COLUMNS))
    rows["holds"] = rows["holds"].map({True: "yes", False: "no"})
    return {"table": rows}


def figures(results: CaseResults) -> dict[str, Figure]:
    """Intervals of each quantity beside the value that made the trial, of the first case."""
    return {"figure": draw(next(iter(results.values()))["intervals"])}


STUDY = MeasuringStudy(
    measure_case,
    tables,
    figures,
    shown=(Columns("Claims and what was found", COLUMNS),),
    names=("claim", "record", "terms", "quantity"),
)
