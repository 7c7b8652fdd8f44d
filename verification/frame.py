"""The frame of all studies: cases are measured one by one, and their results become the rows of one table.

A study of scenes with a known answer is a file of config/verification. Its cases are the variants, which the ordinary
stages run; `answer` compares them. A measuring study (MEASURING) has cases of its own. Each is a job that writes what
it measured as JSON, and one more job makes the table of them all. Every table has beside it what it was made from
(verification.made), and one verdict is given on all of them.
"""

import importlib
import json
import logging
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from common.datasets import atomic_path
from common.errors import InputError
from verification.made import Made, oldest
from verification.results import Results, Variant, read_results
from verification.rows import KNOWN_MISS, PASSES_NOW, VERDICTS, judge, read_rows, write_texts
from verification.studies import FOLDER, load_study
from verification.targets import MEASURING

if TYPE_CHECKING:
    from matplotlib.figure import Figure

RESULTS, LOGS = Path("results/verification"), Path("logs/verification")  # Below the folder in which the workflow runs.
VERIFICATION = "verification"
COSTS = "costs"  # Name of the file of what variants cost, without its ending.
COST_COLUMNS = ("variant", "cells", "levels", "finest_cell_m", "steps", "seconds", "memory_MiB")
MAX_NAMED = 3  # Rows that a verdict names.

Inputs = dict[str, list[str]]  # Paths by their kind.
CaseResults = dict[str, Any]  # Results by the name of the case, in the order of the cases.


@dataclass(frozen=True)
class MeasuringStudy:
    """A study that measures its own cases.

    measure: result of a case, which JSON can hold, from the case's name, its inputs and the number of threads. tables:
    tables by name from all results; "table" holds the rows of the study. figures: figures by name from all results.
    shown: tables of the study's page (verification.page_tables). names: columns of "table" that name a row together.
    """

    measure: Callable[[str, Inputs, int], Any]
    tables: Callable[[CaseResults], dict[str, pd.DataFrame]]
    figures: Callable[[CaseResults], "dict[str, Figure]"]
    shown: tuple
    names: tuple[str, ...]


def load(name: str) -> MeasuringStudy:
    """A measuring study by its name. Raises InputError if there is none."""
    if name not in MEASURING:
        raise InputError(f"no measuring study '{name}'; there are {', '.join(MEASURING)}")
    return importlib.import_module(f"verification.{name}.study").STUDY


def measure_case(study: str, case: str, inputs: Inputs, threads: int, output: Path) -> None:
    """Write the result of one case, and what it was made from, as JSON. NaN and infinity stay what they are."""
    result = load(study).measure(case, inputs, threads)
    with atomic_path(output) as temporary:
        text = json.dumps({"made": asdict(Made.now()), "result": result}, indent=1)
        temporary.write_text(text + "\n", encoding="utf-8")


def read_cases(paths: list[str]) -> tuple[CaseResults, Made]:
    """Results of several cases in the order given, and what the oldest of them was made from."""
    texts = {Path(path).stem: json.loads(Path(path).read_text(encoding="utf-8")) for path in paths}
    results = {case: text["result"] for case, text in texts.items()}
    return results, oldest(Made(**text["made"]) for text in texts.values())


def write_tables(study: str, cases: list[str], table: Path) -> None:
    """Write the tables of a measuring study, its figures beside them, and what they were made from."""
    from catalogs.figures import style

    measuring = load(study)
    results, made = read_cases(cases)
    for name, rows in measuring.tables(results).items():
        with atomic_path(table.with_stem(name)) as temporary:
            rows.to_csv(temporary, index=False, float_format="%.6g")
    with style.applied():
        for name, figure in measuring.figures(results).items():
            style.save(figure, table.parent / f"{name}.svg")
    made.write(table)


def read_study(name: str) -> Results:
    """Results of a study of config/verification, in the folder in which the workflow runs."""
    return read_results(load_study(FOLDER / f"{name}.yaml"), RESULTS / name, LOGS / name)


def write_answer(name: str, table: Path, figure: Path, costs: Path, threads: int = 1) -> None:
    """Write the rows of a study with their verdicts, its figure, and the costs of its variants.

    threads: how many an answer without scenes may use. What they were made from is written beside them. Raises
    InputError where a known miss explains no row.
    """
    from catalogs.figures import style

    results = read_study(name)
    results.threads = threads
    study = results.study
    module = importlib.import_module(f"verification.answers.{study.answer}")
    with style.applied():
        rows, drawn = module.answer(results)
        style.save(drawn, figure)
    for row in rows:
        logging.info("%s: expected %g, obtained %g, passed %s", row.quantity, row.expected, row.obtained, row.passed)
    try:
        judged = judge([row.texts(name) for row in rows], study.known_misses)
    except InputError as error:
        raise InputError(f"config/verification/{name}.yaml: {error}") from error
    write_texts(table, judged)
    with atomic_path(costs) as temporary:
        costs_of(results).to_csv(temporary, index=False, float_format="%.6g")
    Made.now().write(table)


def costs_of(results: Results) -> pd.DataFrame:
    """One row for each variant: its grid, its steps, wall time of grid and mechanics (s), and largest memory (MiB)."""
    rows = [(name, *_costs(variant)) for name, variant in results.variants.items()]
    return pd.DataFrame(rows, columns=list(COST_COLUMNS))


def _costs(variant: Variant) -> tuple:
    grid = variant.grid
    return (
        grid.sizes["cell"],
        grid.attrs["levels"],
        grid.attrs["fine_cell"],
        len(variant.step_names),
        float(np.array([variant.seconds(stage) for stage in variant.stages], float).sum()),  # NaN without a log
        float(np.array([variant.peak_memory(stage) for stage in variant.stages], float).max()),
    )


def write_summary(tables: list[str], summary: Path) -> None:
    """Write the rows of all studies with a known answer as one table."""
    write_texts(summary, [row for table in tables for row in read_rows(Path(table))])
    oldest(Made.read(Path(table)) for table in tables).write(summary)


def give_verdict(study: str, table: Path) -> None:
    """Say where a table is and that none of its rows fails. Raises InputError, one line, where one fails.

    A known miss does not fail. Only tables with a column "passed" have rows that can: others are measured and reported.
    """
    rows = pd.read_csv(table, dtype=str, keep_default_na=False).to_dict("records")
    for row in rows:
        if row.get("passed") == PASSES_NOW:
            file = f"config/verification/{row['scene']}.yaml"
            logging.warning("%s: '%s' passes now; take it off known_misses", file, row["quantity"])
    failing = [row for row in rows if row.get("passed") == VERDICTS[False]]
    known = sum(row.get("passed") == KNOWN_MISS for row in rows)
    beside = f", beside {known} known miss{'es' if known > 1 else ''}" if known else ""
    if failing:
        columns = ("scene", "quantity") if study == VERIFICATION else load(study).names
        named = [": ".join(row[column] for column in columns) for row in failing]
        for name, row in zip(named, failing, strict=True):
            said = ", ".join(f"{column} {row[column]}" for column in ("error", "message") if row.get(column))
            logging.error("%s fails%s", name, f": {said}" if said else "")
        first = "; ".join(named[:MAX_NAMED]) + ("; ..." if len(named) > MAX_NAMED else "")
        raise InputError(f"{len(failing)} of {len(rows)} rows fail{beside} ({first}); see {table}")
    is_judged = any("passed" in row for row in rows)
    found = f"no row of {len(rows)} fails{beside}" if is_judged else f"{len(rows)} rows"
    logging.info(found)
    print(f"{study}: {found}; see {table}")
