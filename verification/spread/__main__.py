"""Command line of what a catalogue's spread consists of: python -m verification.spread report."""

import argparse
import json
from pathlib import Path

from common.command_line import CommandLine
from common.stage import run_stage


def report(arguments: argparse.Namespace) -> None:
    """Table and page of all studies."""
    from verification.results import read_results
    from verification.spread.page import Scene, write_report
    from verification.studies import load_study

    studies = [load_study(path, json.loads(arguments.default)) for path in arguments.studies]
    results, logs = Path(arguments.results), Path(arguments.logs)
    scenes = [Scene.of(read_results(study, results / study.name, logs / study.name)) for study in studies]
    write_report(scenes, Path(arguments.table), Path(arguments.page))


def main() -> None:
    """Parse the command line and run the stage."""
    parser = CommandLine(prog="python -m verification.spread", description=__doc__)
    stage = parser.add_subparsers(dest="stage", required=True).add_parser("report")
    stage.add_argument("--studies", required=True, nargs="+")
    for option in ("default", "results", "logs", "table", "page", "log"):
        stage.add_argument(f"--{option}", required=option != "log")
    arguments = parser.parse_args()
    run_stage(f"report {arguments.page}", arguments.log, lambda: report(arguments), report.__doc__.rstrip("."))


if __name__ == "__main__":
    main()
