"""The study of quotes: a case for each mine, a row for each size of its cells, foreseen beside found.

Each mine that asks for its cells is a case, too, with a row for each request.

Runs of demo, template and renison_scale have made the powers of workflow.quote (study scale), and the mines of study
openings the law of errors. The mines that ask have made neither. Quote and run take one process and one core: on a busy
machine processor time of several says little.
"""

import logging
import os
import resource
from collections.abc import Iterator
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from catalogs.figures import style
from common.costs import running_time
from common.errors import InputError
from mpm_core.simd.threads import use_threads
from verification.comparisons import released_potency
from verification.foreseen import MINES, OPENINGS, REQUESTS, SECTION, SECTION_SIZES
from verification.frame import CaseResults, Inputs, MeasuringStudy
from verification.page_tables import Columns
from verification.plots import plain_ticks
from verification.studies import FOLDER, load_study
from workflow import BASE
from workflow.configuration import load, load_mine, on_requested_cells
from workflow.mine import Mine
from workflow.mine_settings import AccuracyRequest
from workflow.quote import REPORT_SECONDS, Quotes, quote_slice, quote_source
from workflow.run_mine import run_stages

SIZES, TRUTH = ("standard", "fine"), "finest"  # Variants of a mine of study openings.
NEAR, FAR, NEAR_MEMORY = 1.5, 2.0, 1.3  # Factors between foreseen and found within which a quote is to be.
HELD = "held"  # Name of the table of shares of quotes within these.
REQUESTED = "requested"  # Name of the table of requests.
ELK_CREEK = "mine_elk_creek"  # Its openings are in data that this repository does not have.
ASKED = ({"error": "10 %"}, {"time": "1 min"})
JUDGED, SHIPPED = "#0072b2", "#d55e00"  # Colours of mines whose error is found, and of those whose error is stated.
FINER = 2.0  # Cells of the second run of a request for an error are smaller by this factor.
COLUMNS = (
    *("mine", "finest_cell_m", "pilot_cell_m", "quote_s", "foreseen_s", "took_s", "foreseen_over_took"),
    *("foreseen_cells", "cells", "foreseen_MB", "memory_MB", "stated_error", "potency_error", "volume_error"),
)
REQUEST_COLUMNS = (
    *("mine", "asked", "finest_cell_m", "cells", "took_s", "took_over_asked"),
    *("potency_error", "volume_error", "largest_error"),
)


def measure_case(name: str, inputs: Inputs, threads: int) -> list[dict]:
    """Rows of a mine, of quotes or of requests."""
    use_threads(1)
    if name.startswith(f"{REQUESTS}-"):
        return measure_requests(name.removeprefix(f"{REQUESTS}-"))
    return measure_quotes(name)


def measure_requests(variant: str) -> list[dict]:
    """Rows of a mine of study REQUESTS: for each request the cells that it gives.

    For an error, that which is found, a share; for a time, what the run took over what was asked.
    """
    cores = sorted(os.sched_getaffinity(0))
    os.sched_setaffinity(0, {cores[os.getpid() % len(cores)]})  # The time of a request is that of all cores.
    mine, rows = load_study(FOLDER / f"{REQUESTS}.yaml").mines[variant], []
    for asked in ASKED:
        request = AccuracyRequest.of(asked)
        sized = on_requested_cells(mine, request, FOLDER / f"{REQUESTS}.yaml")
        before = running_time()
        cells, *answer = run(sized)
        took = running_time() - before + REPORT_SECONDS
        row = {
            "mine": variant,
            "asked": " ".join(f"{key} {value}" for key, value in asked.items()),
            "finest_cell_m": sized.finest_cell,
            "cells": cells,
            "took_s": took,
        }
        if request.time is not None:
            row["took_over_asked"] = took / (60.0 * request.time)
        if request.error is not None:
            grid = sized.text["grid"] | {"finest_cell": f"{sized.finest_cell / FINER:.15g} m"}
            _, *finer = run(load(sized.text | {"grid": grid}, FOLDER / f"{REQUESTS}.yaml", sized.default))
            truth = np.add(finer, np.subtract(finer, answer) / (FINER - 1.0))  # errors of the first order in the cells
            row["potency_error"], row["volume_error"] = np.abs(np.divide(answer, truth) - 1.0).tolist()
        rows.append(row)
    return rows


def measure_quotes(name: str) -> list[dict]:
    """Rows of a mine, on the largest cells first: so the largest memory of the process is always that of the last run.

    The error that is found is that against the truth, in ln; NaN where there is none.
    """
    rows, answers = [], []
    for mine in mines_of(name):
        before = running_time()
        quotes = Quotes(quote_slice(mine) | {"companion": False, "members": 0}, quote_source(), 1)
        one, between = quotes.at(mine.finest_cell), running_time()
        cells, *answer = run(mine)
        answers.append(answer)
        rows.append(
            {
                "mine": name.removeprefix("mine_"),
                "finest_cell_m": mine.finest_cell,
                "pilot_cell_m": quotes.pilot.cell,
                "quote_s": between - before,
                "foreseen_s": one.processor - REPORT_SECONDS,
                "took_s": running_time() - between,
                "foreseen_cells": one.end,
                "cells": cells,
                "foreseen_MB": one.memory / 1e6,
                "memory_MB": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024 / 1e6,
                "stated_error": float(np.log1p(one.error)),
            }
        )
    truth = [np.nan, np.nan]
    if name in OPENINGS:
        _, *truth = run(load_study(FOLDER / "openings.yaml").mines[f"{name}_{TRUTH}"])
    for row, answer in zip(rows, answers, strict=True):
        row["potency_error"], row["volume_error"] = np.abs(np.log(np.divide(answer, truth))).tolist()
    return rows


def mines_of(name: str) -> Iterator[Mine]:
    """The mine of a case on cells of each size."""
    if name in MINES:
        file, sizes = MINES[name]
        for size in sizes:
            try:
                mine = load_mine(BASE / f"config/mines/{file}.yaml")
            except InputError as error:
                if name != ELK_CREEK:
                    raise
                logging.warning("%s: left out", error)
                return
            yield on_cells_of(size, mine)
    elif name == SECTION:
        for size in SECTION_SIZES:
            yield on_cells_of(size, load_study(FOLDER / "economies_tunnel.yaml").mines["base"])
    else:
        study = load_study(FOLDER / "openings.yaml")
        yield from (study.mines[f"{name}_{size}"] for size in SIZES)


def on_cells_of(size: float, mine: Mine) -> Mine:
    """The mine, which changes, with finest cells of a size (m)."""
    mine.change("grid", levels=mine.settings.grid.levels + round(np.log2(mine.finest_cell / size)))
    return mine


def run(mine: Mine) -> tuple[int, float, float]:
    """Run the mechanics of a mine: cells at the end, potency and failed volume (m3) of all steps."""
    cells, potency, volume = 0, 0.0, 0.0
    with TemporaryDirectory() as folder:
        for stage, state, facts in run_stages(mine.run_slices([]), Path(folder) / "failed.npz"):
            if stage.startswith("steps/"):
                cells = facts["cells"]
                potency += released_potency(state)
                volume += facts["failed_volume"]
    return cells, potency, volume


def tables(results: CaseResults) -> dict[str, pd.DataFrame]:
    """The table of all runs, that of the shares of quotes that are near, and that of requests."""
    of_requests = [name for name in results if name.startswith(f"{REQUESTS}-")]
    table = pd.DataFrame([row for name, rows in results.items() if name not in of_requests for row in rows])
    table["foreseen_over_took"] = table["foreseen_s"] / table["took_s"]
    requested = pd.DataFrame([row for name in of_requests for row in results[name]], columns=list(REQUEST_COLUMNS))
    requested["largest_error"] = requested[["potency_error", "volume_error"]].max(axis=1)
    return {"table": table[list(COLUMNS)], HELD: held(table), REQUESTED: requested}


def held(table: pd.DataFrame) -> pd.DataFrame:
    """Shares of quotes within factors of what was found, and of errors within what was stated."""
    time = np.abs(np.log(table["foreseen_over_took"]))
    memory = np.abs(np.log(table["foreseen_MB"] / table["memory_MB"]))
    # Where nothing failed in the run, the error found is infinite, and not within any.
    stated = table[np.isfinite(table["stated_error"]) & table["potency_error"].notna()]
    largest = stated[["potency_error", "volume_error"]].max(axis=1)
    both = pd.concat([stated["potency_error"], stated["volume_error"]])
    limits = pd.concat([stated["stated_error"]] * 2)
    # On the mine's own cells a pilot has run the first steps themselves, and its time is near by construction.
    beyond = time[table["pilot_cell_m"] > 1.01 * table["finest_cell_m"]]
    rows = [
        (f"{title} within a factor of {factor:g}", len(some), float(np.mean(some <= np.log(factor))))
        for title, some in (("time", time), ("time, pilots on larger cells,", beyond))
        for factor in (NEAR, FAR)
    ]
    rows += [
        (f"memory within a factor of {NEAR_MEMORY:g}", len(table), float(np.mean(memory <= np.log(NEAR_MEMORY)))),
        ("error of potency, or of failed volume, within the stated one", len(both), float(np.mean(both <= limits))),
        (
            "stated error at most twice the larger of both",
            len(stated),
            float(np.mean(stated["stated_error"] <= 2.0 * largest)),
        ),
    ]
    return pd.DataFrame(rows, columns=["what", "quotes", "share"])


def figures(results: CaseResults) -> dict[str, Figure]:
    """Time and memory, foreseen against found; and what each mine's cells cost and leave wrong."""
    table = tables(results)["table"]
    figure = style.new_figure(height=3.8)
    *panels, last = figure.subplots(1, 3)
    pairs = (
        ("took_s", "foreseen_s", "processor time (s)", FAR),
        ("memory_MB", "foreseen_MB", "memory (MB)", NEAR_MEMORY),
    )
    for panel, (found, foreseen, title, factor) in zip(panels, pairs, strict=True):
        ends = np.array([table[[found, foreseen]].min().min(), table[[found, foreseen]].max().max()]) * [0.8, 1.25]
        panel.fill_between(ends, ends / factor, ends * factor, color="#e8e8e8", linewidth=0, label=f"factor {factor:g}")
        panel.loglog(ends, ends, color=style.OUTLINE, linewidth=0.8)
        panel.loglog(table[found], table[foreseen], "o", color=JUDGED, markersize=4)
        panel.set_xlim(ends)
        panel.set_xlabel(f"{title}, found")
        panel.set_ylabel("foreseen")
        panel.legend(fontsize=7, loc="upper left")
        plain_ticks(panel.xaxis)
        plain_ticks(panel.yaxis)
    draw_prices(last, table)
    figure.legend(*last.get_legend_handles_labels(), loc="outside lower right", ncols=3, fontsize=7)
    return {"figure": figure}


def draw_prices(panel: Axes, table: pd.DataFrame) -> None:
    """Error of each mine's cells against their processor time, a line for each mine; its largest cells are a star.

    The error is the one found or, of shipped mines, for which there is no truth, the stated one.
    """
    found = np.expm1(table[["potency_error", "volume_error"]].max(axis=1))
    is_shipped = found.isna()
    percent = 100.0 * found.where(~is_shipped, np.expm1(table["stated_error"]))
    for name, rows in table.assign(percent=percent).groupby("mine", sort=False):
        rows = rows[np.isfinite(rows["percent"])]
        if len(rows):
            shipped = is_shipped[rows.index].all()
            colour = SHIPPED if shipped else JUDGED
            panel.loglog(rows["took_s"], rows["percent"], "-", color=colour, linewidth=0.8)
            panel.loglog(rows["took_s"][1:], rows["percent"][1:], "o", color=colour, markersize=4)
            panel.loglog(rows["took_s"][:1], rows["percent"][:1], "*", color=colour, markersize=8)
            panel.annotate(str(name), (rows["took_s"].iloc[-1], rows["percent"].iloc[-1]), fontsize=6, xytext=(3, 2),
                           textcoords="offset points")  # fmt: skip
    panel.plot([], [], "*", color=JUDGED, label="found, on the cells of standard")
    panel.plot([], [], "o", color=JUDGED, label="found, on those of fine")
    panel.plot([], [], "o", color=SHIPPED, label="stated, shipped mines")
    panel.set_xlabel("processor time (s)")
    panel.set_ylabel("error of potency or failed volume (%)")
    plain_ticks(panel.xaxis)
    plain_ticks(panel.yaxis)


STUDY = MeasuringStudy(
    measure_case,
    tables,
    figures,
    shown=(
        Columns("Shares of quotes", ("what", "quotes", "share"), file=HELD),
        Columns("Cells that a request asks for (errors as shares)", REQUEST_COLUMNS, file=REQUESTED),
        Columns("Each mine on cells of each size (errors in ln)", COLUMNS),
    ),
    names=("mine", "finest_cell_m"),
)
