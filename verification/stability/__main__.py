"""Command lines of the numerics at their limits: python -m verification.stability points | report | verdict."""

import argparse
from pathlib import Path

from verification.command_line import Stage, run_command


def points(arguments: argparse.Namespace) -> None:
    """Run the cases of one knob."""
    from common.provenance import use_numba_cache

    use_numba_cache()
    from verification.stability.knobs import knob_of
    from verification.stability.points import measure, write_points

    write_points(measure(knob_of(arguments.knob)), Path(arguments.points))


def report(arguments: argparse.Namespace) -> None:
    """Write table and page of all knobs."""
    from verification.stability.page import write_report
    from verification.stability.points import read_points

    write_report([read_points(path) for path in arguments.points], Path(arguments.table), Path(arguments.page))


def verdict(arguments: argparse.Namespace) -> None:
    """Fail in one line where a case is a fault, or its error exceeds what is known."""
    from verification.stability.verdict import check_table

    check_table(Path(arguments.table), arguments.page)


if __name__ == "__main__":
    run_command(
        "verification.stability",
        __doc__,
        Stage(points, ("knob", "points"), made="points"),
        Stage(report, ("points+", "table", "page"), made="page"),
        Stage(verdict, ("table", "page"), made="page"),
    )
