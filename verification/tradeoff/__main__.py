"""Command lines of speed against accuracy: python -m verification.tradeoff points | report."""

import argparse
import json
from pathlib import Path

from common.command_line import CommandLine
from common.stage import run_stage


def points(arguments: argparse.Namespace) -> None:
    """What the runs of one study came to and cost."""
    from verification.results import read_results
    from verification.studies import load_study
    from verification.tradeoff.points import measure_study, write_points

    study = load_study(arguments.study, json.loads(arguments.default))
    results = read_results(study, Path(arguments.results), Path(arguments.logs))
    write_points(measure_study(results), Path(arguments.points))


def report(arguments: argparse.Namespace) -> None:
    """Table and page of all studies."""
    from verification.studies import load_study
    from verification.tradeoff.page import write_report
    from verification.tradeoff.points import read_points
    from verification.tradeoff.runs import Scene

    studies = [load_study(path, json.loads(arguments.default)) for path in arguments.studies]
    scenes = [Scene(study, read_points(path)) for study, path in zip(studies, arguments.points, strict=True)]
    write_report(scenes, Path(arguments.table), Path(arguments.page))


def main() -> None:
    """Parse the command line and run the stage."""
    parser = CommandLine(prog="python -m verification.tradeoff", description=__doc__)
    stages = parser.add_subparsers(dest="stage", required=True)
    one = stages.add_parser("points")
    for option in ("study", "default", "results", "logs", "points", "log"):
        one.add_argument(f"--{option}", required=option != "log")
    every = stages.add_parser("report")
    for option in ("studies", "points"):
        every.add_argument(f"--{option}", required=True, nargs="+")
    for option in ("default", "table", "page", "log"):
        every.add_argument(f"--{option}", required=option != "log")
    arguments = parser.parse_args()
    run = {"points": points, "report": report}[arguments.stage]
    made = arguments.points if arguments.stage == "points" else arguments.page
    run_stage(f"{arguments.stage} {made}", arguments.log, lambda: run(arguments), run.__doc__.rstrip("."))


if __name__ == "__main__":
    main()
