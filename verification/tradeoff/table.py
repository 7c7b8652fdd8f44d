"""table.csv: every run of every scene, what it took and how wrong it is."""

import numpy as np
import pandas as pd

from verification.tradeoff.knobs import CHOSEN, KNOBS, changed
from verification.tradeoff.measures import MEASURES
from verification.tradeoff.runs import Scene


def make_table(scenes: list[Scene]) -> pd.DataFrame:
    """One row a run; units stand in the names of the columns, errors are shares or in the measure's unit.

    accuracy: the preset; processor_s: processor time of all stages, without compiling; work_s: less the start of their
    processes; times_as_fast: as the base, each by the median of all runs with its rock; wall_s: as a clock saw them,
    compiling included; compiling_s: what compiling took, of a processor.
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
