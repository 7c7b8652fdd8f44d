"""Command lines of the verification: python -m verification answer | report | verdict."""

import argparse
import importlib
import json
import logging
from pathlib import Path

from common.errors import InputError
from verification.command_line import Stage, run_command


def answer(arguments: argparse.Namespace) -> None:
    """Write rows.csv and figure.svg of one study."""
    from catalogs.figures import style
    from verification.results import read_results
    from verification.rows import write_rows
    from verification.studies import load_study

    study = load_study(arguments.study, json.loads(arguments.default))
    module = importlib.import_module(f"verification.answers.{study.answer}")
    with style.applied():
        rows, figure = module.answer(read_results(study, Path(arguments.results), Path(arguments.logs)))
        style.save(figure, Path(arguments.figure))
    for row in rows:
        logging.info("%s: expected %g, obtained %g, passed %s", row.quantity, row.expected, row.obtained, row.passed)
    write_rows(arguments.rows, [(study.name, row) for row in rows])


def report(arguments: argparse.Namespace) -> None:
    """Write report.html and summary.csv of several studies."""
    from verification.report import write_report
    from verification.studies import load_study

    studies = [load_study(path, json.loads(arguments.default)) for path in arguments.studies]
    write_report(studies, Path(arguments.results), Path(arguments.logs), Path(arguments.page), Path(arguments.summary))


def verdict(arguments: argparse.Namespace) -> None:
    """Fail in one line where a row fails that is not a known miss."""
    from verification.known_misses import KNOWN_MISS, PASSES_NOW
    from verification.rows import VERDICTS, read_rows

    rows = read_rows(arguments.summary)
    for row in rows:
        if row["passed"] == PASSES_NOW:
            file = f"config/verification/{row['scene']}.yaml"
            logging.warning("%s: '%s' passes now; take it off known_misses", file, row["quantity"])
    failing = [f"{row['scene']}: {row['quantity']}" for row in rows if row["passed"] == VERDICTS[False]]
    known = sum(row["passed"] == KNOWN_MISS for row in rows)
    beside = f", beside {known} known miss{'es' if known > 1 else ''}" if known else ""
    if failing:
        first = "; ".join(failing[:3]) + ("; ..." if len(failing) > 3 else "")
        raise InputError(f"{len(failing)} of {len(rows)} rows fail{beside} ({first}); see {arguments.page}")
    logging.info("no row of %d fails%s", len(rows), beside)


if __name__ == "__main__":
    run_command(
        "verification",
        __doc__,
        Stage(answer, ("study", "default", "results", "logs", "rows", "figure"), made="rows"),
        Stage(report, ("studies+", "default", "results", "logs", "page", "summary"), made="page"),
        Stage(verdict, ("summary", "page"), made="summary"),
    )
