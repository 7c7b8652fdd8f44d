"""Command lines of this benchmark: python -m verification.benchmarks measure | solve | report."""

import argparse
import json
import logging
from pathlib import Path

from common.command_line import CommandLine
from common.datasets import atomic_path
from common.stage import run_stage
from verification.benchmarks.settings import Case, read_settings


def measure(arguments: argparse.Namespace) -> None:
    """Measure one case in a process of its own and write its row as JSON."""
    from verification.benchmarks.measuring import DONE, measure
    from verification.benchmarks.table import read_rows

    settings = read_settings()
    case = Case(arguments.problem, arguments.code, arguments.across)
    threads = min(settings.threads, arguments.threads)
    row = measure(settings, case, threads, read_rows(arguments.earlier), Path(arguments.environments))
    with atomic_path(arguments.output) as temporary:
        temporary.write_text(json.dumps(row, indent=1) + "\n", encoding="utf-8")
    took = f"{row['seconds']:.3g} s" if row["outcome"] == DONE else f"{row['outcome']}: {row['remark']}"
    logging.info("%s, %s, %d cells: %s", case.problem, case.code, row["cells"], took)


def solve(arguments: argparse.Namespace) -> None:
    """Solve one case by our own stages in this process; the result goes to standard output."""
    from verification.benchmarks.ours import solve

    solve(read_settings(), Case(arguments.problem, arguments.code, arguments.across), arguments.threads)


def report(arguments: argparse.Namespace) -> None:
    """Write table, figure and page of all cases."""
    from verification.benchmarks.page import write_report
    from verification.benchmarks.table import read_rows

    rows = read_rows(arguments.runs)
    write_report(read_settings(), rows, Path(arguments.table), Path(arguments.figure), Path(arguments.page))


def main() -> None:
    """Parse the command line and run it."""
    parser = CommandLine(prog="python -m verification.benchmarks", description=__doc__)
    commands = parser.add_subparsers(dest="command", required=True)
    for name in ("measure", "solve"):
        command = commands.add_parser(name)
        command.add_argument("problem")
        command.add_argument("code")
        command.add_argument("across", type=int)
        command.add_argument("--threads", type=int, default=1)
        command.add_argument("--log")
        if name == "measure":
            command.add_argument("--earlier", nargs="*", default=[])
            command.add_argument("--environments", required=True)
            command.add_argument("--output", required=True)
    command = commands.add_parser("report")
    command.add_argument("--runs", nargs="+", required=True)
    for option in ("table", "figure", "page"):
        command.add_argument(f"--{option}", required=True)
    command.add_argument("--log")
    arguments = parser.parse_args()
    if arguments.command == "report":
        name = f"report {arguments.page}"
    else:
        name = f"{arguments.command} {arguments.problem}, {arguments.code}, {arguments.across} cells across"
    run = {"measure": measure, "solve": solve, "report": report}[arguments.command]
    run_stage(name, arguments.log, lambda: run(arguments), run.__doc__ or name)


if __name__ == "__main__":
    main()
