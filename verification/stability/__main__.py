"""Command lines of the numerics at their limits: python -m verification.stability points | report | verdict."""

import argparse
from pathlib import Path

from common.command_line import CommandLine
from common.stage import run_stage


def points(arguments: argparse.Namespace) -> None:
    """What the cases of one knob came to."""
    from common.provenance import use_numba_cache

    use_numba_cache()
    from verification.stability.knobs import knob_of
    from verification.stability.points import measure, write_points

    write_points(measure(knob_of(arguments.knob)), Path(arguments.points))


def report(arguments: argparse.Namespace) -> None:
    """Table and page of all knobs."""
    from verification.stability.page import write_report
    from verification.stability.points import read_points

    write_report([read_points(path) for path in arguments.points], Path(arguments.table), Path(arguments.page))


def verdict(arguments: argparse.Namespace) -> None:
    """Fail in one line where a case is a fault, or wrong beyond what is known."""
    from verification.stability.verdict import check_table

    check_table(Path(arguments.table), arguments.page)


def main() -> None:
    """Parse the command line and run the stage."""
    parser = CommandLine(prog="python -m verification.stability", description=__doc__)
    stages = parser.add_subparsers(dest="stage", required=True)
    options = {"points": ("knob", "points"), "report": ("points", "table", "page"), "verdict": ("table", "page")}
    for name, own in options.items():
        stage = stages.add_parser(name)
        for option in (*own, "log"):
            many = {"nargs": "+"} if (name, option) == ("report", "points") else {}
            stage.add_argument(f"--{option}", required=option != "log", **many)
    arguments = parser.parse_args()
    run = {"points": points, "report": report, "verdict": verdict}[arguments.stage]
    made = arguments.points if arguments.stage == "points" else arguments.page
    run_stage(f"{arguments.stage} {made}", arguments.log, lambda: run(arguments), run.__doc__.rstrip("."))


if __name__ == "__main__":
    main()
