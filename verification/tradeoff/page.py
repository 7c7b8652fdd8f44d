"""Output in results/tradeoff: table.csv, a figure of each scene, and report.html, which refers to no other file."""

from pathlib import Path

import numpy as np
import pandas as pd

from catalogs.figures import style
from common.datasets import atomic_path
from verification.html_page import write_page
from verification.tradeoff.figure import draw
from verification.tradeoff.knobs import CHOSEN, KNOBS, changed
from verification.tradeoff.measures import ITSELF, MEASURES, RELATIVE, Measure
from verification.tradeoff.points import Point
from verification.tradeoff.runs import MIN_SPEEDUP, Scene
from verification.tradeoff.sentences import preset_sentence, price, sentence, share, verdict


def write_report(scenes: list[Scene], table: Path, page: Path) -> None:
    """Write table and page, atomically."""
    with atomic_path(table) as temporary:
        make_table(scenes).to_csv(temporary, index=False, float_format="%.6g")
    with style.applied():
        sections = [_section(scene, page.parent / f"{scene.study.name}.svg") for scene in scenes]
    turned = {line.knob for scene in scenes for line in scene.lines}
    knobs = [knob for knob in KNOBS if knob.key in turned]
    write_page(
        page,
        "tradeoff",
        {"share": share},
        sections=sections,
        knobs=knobs,
        clear=MIN_SPEEDUP,
        runs=sum(len(scene.points) for scene in scenes),
        minutes=float(np.nansum([point.seconds for scene in scenes for point in scene.points])) / 60.0,
    )


def make_table(scenes: list[Scene]) -> pd.DataFrame:
    """One row for each run. Names of columns hold the units; errors are shares or in the measure's unit.

    accuracy: the preset. processor_s: processor time of all stages without compiling. work_s: the same less the start
    of their processes. times_as_fast: speed over that of the base, each by the median of all runs with the same rock.
    wall_s: wall time, compiling included. compiling_s: processor time of compiling.
    """
    rows = []
    for scene in scenes:
        for point, is_front in zip(scene.points, scene.front, strict=True):
            row = {
                "scene": scene.study.name,
                "variant": point.variant,
                "accuracy": point.accuracy,
                "changes": scene.label(point),
                "knob": " ".join(changed(point.settings, scene.base.settings)),
                "pareto_front": "yes" if is_front else "",
                "processor_s": point.seconds,
                "work_s": scene.work(point),
                "times_as_fast": scene.cost(scene.base) / scene.cost(point),
                "wall_s": point.wall,
                "compiling_s": point.compiling,
                "memory_MiB": point.memory,
                "cells": point.cells,
                "failed_particles": point.failed,
            }
            row |= {f"error_{measure.key}": scene.error(point, measure) for measure in scene.measures}
            row |= {_column(measure.key): point.measures[measure.key] for measure in scene.measures}
            rows.append(row | {f"set_{knob.key}": point.settings[knob.key] for knob in KNOBS})
    table = pd.DataFrame(rows)
    errors = [f"error_{key}" for key in MEASURES]
    first = [column for column in rows[0] if not column.startswith(("error_", "set_")) and column not in _columns()]
    order = [*first, *errors, *_columns(), *(f"set_{knob.key}" for knob in KNOBS)]
    table["set_increments"] = table["set_increments"].replace(CHOSEN, 0)
    return table.reindex(columns=[column for column in order if column in table]).replace({np.inf: np.nan})


def _column(key: str) -> str:
    unit = MEASURES[key].unit
    return key if unit == "1" else f"{key}_{unit}"


def _columns() -> list[str]:
    return [_column(key) for key in MEASURES]


def _section(scene: Scene, figure: Path) -> dict:
    """What the template shows of a scene."""
    order = sorted(range(len(scene.points)), key=lambda index: scene.work(scene.points[index]))
    rows: list[dict] = [
        {
            "point": scene.points[index],
            "label": scene.label(scene.points[index]),
            "front": bool(scene.front[index]),
            "work": scene.work(scene.points[index]),
            "speed": scene.cost(scene.base) / scene.cost(scene.points[index]),
            "cells": _cells(scene, scene.points[index]),
        }
        for index in order
    ]
    front = [row | {"work": scene.cost(row["point"])} for row in rows if row["front"]]
    return {
        "scene": scene,
        "figure": style.save(draw(scene), figure),
        "rows": rows,
        "front": sorted(front, key=lambda row: row["work"]),
        "lines": [
            {"line": line, "verdict": verdict(scene, line), "sentence": sentence(scene, line)} for line in scene.lines
        ],
        "prices": {line.knob: price(scene, line) for line in scene.lines},
        "truths": [_truth(scene, measure) for measure in scene.measures],
        "presets": [preset_sentence(scene, point) for point in scene.presets],
    }


def _cells(scene: Scene, point: Point) -> list[tuple[str, str]]:
    """Value and error of each measure of a run, as text."""
    found = []
    for measure in scene.measures:
        value, error = point.measures[measure.key], scene.error(point, measure)
        if measure.kind == ITSELF:
            found.append((share(value) if measure.is_share else f"{value:.2g}", ""))
        else:
            text = share(error) if measure.kind == RELATIVE else f"{error:.2g}"
            found.append((f"{value:.4g}" if np.isfinite(value) else "–", text if np.isfinite(error) else ""))
    return found


def _truth(scene: Scene, measure: Measure) -> str:
    """Source of a measure's truth in words; empty where its value is its error."""
    limit = scene.truths[measure.key]
    if measure.kind == ITSELF:
        return ""
    value = f"{measure.title}: {limit.value:.4g}{'' if measure.unit == '1' else f' {measure.unit}'}"
    if measure.key in scene.exact:
        return f"{value} in closed form"
    if not np.isfinite(limit.value):
        return f"{measure.title}: nothing to compare with"
    if np.isfinite(limit.order):
        beyond = share(measure.error(scene.series[-1].measures[measure.key], limit.value))
        return (
            f"{value}, where ever smaller cells lead with order {limit.order:.2f}, {beyond} from the finest run: "
            "smaller errors than that say little"
        )
    return f"{value}, that of {scene.series[-1].variant}"
