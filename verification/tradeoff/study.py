"""The study of speed against accuracy: a case for each scene, a row for each run, and what each setting buys."""

from dataclasses import asdict

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from verification.frame import CaseResults, Inputs, MeasuringStudy, read_study
from verification.page_tables import Columns, Cross
from verification.studies import FOLDER, load_study
from verification.tradeoff.figure import draw
from verification.tradeoff.knobs import BY_KEY, CHOSEN, KNOBS, changed
from verification.tradeoff.measures import ITSELF, MEASURES
from verification.tradeoff.points import Points, measure_study
from verification.tradeoff.runs import SceneRuns
from workflow.accuracy import PRESETS, STANDARD

PRICES, TRUTHS = "prices", "truths"  # Names of the tables beside the rows of all runs.
PRICE_COLUMNS = (
    *("scene", "setting", "from", "to", "beside", "times_as_fast", "change", "error_before", "error"),
    *("events_before", "events", "buys", "price", "fastest"),
)
TRUTH_COLUMNS = ("scene", "measure", "unit", "truth", "order", "finest_from_truth", "source")


def measure_case(name: str, inputs: Inputs, threads: int) -> dict:
    """Results and costs of the runs of one scene."""
    return asdict(measure_study(read_study(name)))


def scenes_of(results: CaseResults) -> list[SceneRuns]:
    """The scenes, with their studies as the files of config/verification have them."""
    return [SceneRuns(load_study(FOLDER / f"{name}.yaml"), Points.read(points)) for name, points in results.items()]


def tables(results: CaseResults) -> dict[str, pd.DataFrame]:
    """The table of all runs, that of the values of each setting, and that of what measures are compared with."""
    scenes = scenes_of(results)
    prices = pd.DataFrame([row for scene in scenes for row in price_rows(scene)], columns=list(PRICE_COLUMNS))
    truths = pd.DataFrame([row for scene in scenes for row in truth_rows(scene)], columns=list(TRUTH_COLUMNS))
    return {"table": make_table(scenes), PRICES: prices, TRUTHS: truths}


def figures(results: CaseResults) -> dict[str, Figure]:
    """A figure of each scene, by its name."""
    return {scene.study.name: draw(scene) for scene in scenes_of(results)}


def make_table(scenes: list[SceneRuns]) -> pd.DataFrame:
    """One row for each run. Names of columns hold the units; errors are shares or in the measure's unit.

    accuracy: the preset. processor_s: processor time of all stages without compiling. work_s: the same less the start
    of their processes. times_as_fast: speed over that of the base, each by the median of all runs with the same rock.
    wall_s: wall time, compiling included. compiling_s: processor time of compiling. main_error: that of main_measure,
    by which runs of the scene are compared. preset: of the base and of runs by the key `accuracy`. beaten_by: the
    quickest run on the Pareto front that costs and errs no more. noise: slowest over quickest run of the base's rock.
    """
    rows, measures = [], [m for m in MEASURES.values() if any(m in scene.measures for scene in scenes)]
    for scene in scenes:
        for point in scene.points:
            row: dict[str, float | str] = {
                "scene": scene.study.name,
                "variant": point.variant,
                "accuracy": point.accuracy,
                "changes": scene.label(point),
                "knob": " ".join(changed(point.settings, scene.base.settings)),
                "pareto_front": "yes" if point in scene.front else "",
                "processor_s": point.seconds,
                "work_s": scene.work(point),
                "times_as_fast": scene.cost(scene.base) / scene.cost(point),
                "wall_s": point.wall,
                "compiling_s": point.compiling,
                "memory_MiB": point.memory,
                "cells": point.cells,
                "failed_particles": point.failed,
                "main_measure": scene.main.title,
                "main_error": scene.error(point, scene.main),
                "preset": point.accuracy if point in scene.presets else "",
                "beaten_by": scene.label(better) if (better := scene.beaten_by(point)) else "",
                "noise": scene.noise if point is scene.base else np.nan,
            }
            row |= {f"error_{m.key}": scene.error(point, m) if m in scene.measures else np.nan for m in measures}
            row |= {m.column: point.measures.get(m.key, np.nan) for m in measures}
            rows.append(row | {f"set_{knob.key}": point.settings[knob.key] for knob in KNOBS})
    table = pd.DataFrame(rows)
    table["set_increments"] = table["set_increments"].replace(CHOSEN, 0)
    return table.replace({np.inf: np.nan})


def percent(share: float) -> str:
    """A share in per cent with its sign, two significant digits and at most two decimals; a dash for NaN."""
    if not np.isfinite(share):
        return "–"
    decimals = 2 if abs(share) < 5e-5 else max(0, 1 - int(np.floor(np.log10(abs(100 * share)))))
    return f"{100 * share:+.{min(decimals, 2)}f} %"


def price_rows(scene: SceneRuns) -> list[dict]:
    """One row for each value that runs give a setting, over the line's own value of it.

    beside: other settings that the whole line changes. times_as_fast: over the run with the value `from`. change: of
    the main measure, as a share of that of this run; a difference where the measure is an error. price: speed and
    change in a few words, "no speed" where the value is not clearly faster. fastest: yes for the fastest value.
    """
    rows = []
    for line in scene.lines:
        knob = BY_KEY[line.knob]
        fastest = max(line.others, key=lambda member: scene.speed(line, member))
        for member in line.others:
            value, speed = knob.text(member.settings[line.knob]), scene.speed(line, member)
            change = scene.change(line, member)
            rows.append(
                {
                    "scene": scene.study.name,
                    "setting": knob.title,
                    "from": knob.text(line.anchor.settings[line.knob]),
                    "to": value,
                    "beside": line.beside,
                    "times_as_fast": speed,
                    "change": change,
                    "error_before": scene.error(line.anchor, scene.main),
                    "error": scene.error(member, scene.main),
                    "events_before": line.anchor.measures.get("events", np.nan),
                    "events": member.measures.get("events", np.nan),
                    "buys": scene.buys(line, member),
                    "price": f"{value}: {speed:.2g} x, {percent(change)}" if speed > scene.clear else "no speed",
                    "fastest": "yes" if member is fastest else "",
                }
            )
    return rows


def truth_rows(scene: SceneRuns) -> list[dict]:
    """Rows of the table of values that a scene's measures are compared with, where their value is not their error.

    order: of convergence of ever smaller cells. finest_from_truth: error of the finest run; smaller ones say little.
    """
    rows = []
    for measure in scene.measures:
        limit = scene.truths[measure.key]
        if measure.kind == ITSELF:
            continue
        source, beyond = "nothing to compare with", np.nan
        if measure.key in scene.exact:
            source = "closed form"
        elif np.isfinite(limit.order):
            source = "limit of ever smaller cells"
            beyond = measure.error(scene.series[-1].measures[measure.key], limit.value)
        elif np.isfinite(limit.value):
            source = f"run {scene.series[-1].variant}"
        values = (scene.study.name, measure.title, measure.unit, limit.value, limit.order, beyond, source)
        rows.append(dict(zip(TRUTH_COLUMNS, values, strict=True)))
    return rows


BASES = ("preset", (STANDARD,))
STUDY = MeasuringStudy(
    measure_case,
    tables,
    figures,
    shown=(
        Cross(
            "Price list: the fastest value of each setting, how many times as fast as the base it is, and the change "
            "of the main measure (in elastic scenes, of its error)",
            ("setting",),
            "scene",
            "price",
            ("fastest", ("yes",)),
            file=PRICES,
        ),
        Columns("The base of each scene", ("scene", "work_s", "noise", "memory_MiB", "cells"), BASES),
        Columns("What runs are compared with", TRUTH_COLUMNS, file=TRUTHS),
        Columns("What each value of a setting buys", PRICE_COLUMNS[:-2], file=PRICES),
        Columns(
            "Presets",
            ("scene", "preset", "times_as_fast", "main_measure", "main_error", "pareto_front", "beaten_by"),
            ("preset", tuple(PRESETS)),
        ),
        Columns(
            "Pareto front: no run is both faster and nearer",
            ("scene", "changes", "work_s", "times_as_fast", "memory_MiB", "main_measure", "main_error"),
            ("pareto_front", ("yes",)),
        ),
        Columns(
            "Each run beside its scene's base",
            ("scene", "changes", "times_as_fast", "memory_MiB", "cells", "pareto_front"),
        ),
    ),
    names=("scene", "variant"),
)
