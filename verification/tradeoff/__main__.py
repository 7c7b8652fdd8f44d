"""Command lines of speed against accuracy: python -m verification.tradeoff points | report."""

import argparse
import json
from pathlib import Path

from verification.command_line import Stage, run_command


def points(arguments: argparse.Namespace) -> None:
    """Write results and costs of the runs of one study."""
    from verification.results import read_results
    from verification.studies import load_study
    from verification.tradeoff.points import measure_study, write_points

    study = load_study(arguments.study, json.loads(arguments.default))
    results = read_results(study, Path(arguments.results), Path(arguments.logs))
    write_points(measure_study(results), Path(arguments.points))


def report(arguments: argparse.Namespace) -> None:
    """Write table and page of all studies."""
    from verification.studies import load_study
    from verification.tradeoff.page import write_report
    from verification.tradeoff.points import read_points
    from verification.tradeoff.runs import Scene

    studies = [load_study(path, json.loads(arguments.default)) for path in arguments.studies]
    scenes = [Scene(study, read_points(path)) for study, path in zip(studies, arguments.points, strict=True)]
    write_report(scenes, Path(arguments.table), Path(arguments.page))


if __name__ == "__main__":
    run_command(
        "verification.tradeoff",
        __doc__,
        Stage(points, ("study", "default", "results", "logs", "points"), made="points"),
        Stage(report, ("studies+", "points+", "default", "table", "page"), made="page"),
    )
