"""Command line of the studies: python -m verification case | table | answer | verdict | pages | solve."""

import argparse
from collections.abc import Callable
from pathlib import Path

from common.command_line import CommandLine
from common.stage import run_stage


def case(arguments: argparse.Namespace) -> None:
    """Measure one case of a measuring study."""
    from common.kernel_cache import use_numba_cache

    use_numba_cache()
    from verification.frame import measure_case

    inputs = {kind: paths for kind, *paths in arguments.input}
    measure_case(arguments.study, arguments.case, inputs, arguments.threads, Path(arguments.output))


def table(arguments: argparse.Namespace) -> None:
    """Write the table of a measuring study from its cases, or of all studies with a known answer from their tables."""
    from verification.frame import VERIFICATION, write_summary, write_tables

    if arguments.study == VERIFICATION:
        write_summary(arguments.cases, Path(arguments.output))
    else:
        write_tables(arguments.study, arguments.cases, Path(arguments.output))


def answer(arguments: argparse.Namespace) -> None:
    """Compare the results of a study with its known answer."""
    from verification.frame import write_answer

    paths = (Path(arguments.output), Path(arguments.figure), Path(arguments.costs))
    write_answer(arguments.study, *paths, arguments.threads)


def solve(arguments: argparse.Namespace) -> None:
    """Solve one case of the benchmarks by our own stages in this process; the result goes to standard output."""
    from verification.benchmarks.ours import solve
    from verification.benchmarks.settings import read_settings

    settings = read_settings()
    solve(settings, settings.case(arguments.case), arguments.threads)


def verdict(arguments: argparse.Namespace) -> None:
    """Fail in one line where a row fails that is not a known miss."""
    from verification.frame import give_verdict

    give_verdict(arguments.study, Path(arguments.table))


def pages(arguments: argparse.Namespace) -> None:
    """Write measured results into the pages of docs/studies, or list the pages that are older than the numerics."""
    from verification.pages import older_pages, rewrite

    if arguments.check:
        print("\n".join(older_pages()) or "no page is older than the numerics")
    else:
        print(", ".join(rewrite(arguments.results)) or "no results; marks and index are up to date")


def main() -> None:
    """Parse the command line and run the command."""
    parser = CommandLine(prog="python -m verification", description=__doc__)
    commands = parser.add_subparsers(dest="command", required=True)

    def add(function: Callable[[argparse.Namespace], None], *positional: str) -> CommandLine:
        command = commands.add_parser(function.__name__, description=function.__doc__)
        for name in positional:
            command.add_argument(name)
        command.add_argument("--log")
        command.set_defaults(function=function, positional=positional)
        return command

    command = add(case, "study", "case")
    command.add_argument("--input", nargs="+", action="append", default=[], help="kind of input, and its files")
    command.add_argument("--threads", type=int, default=1)
    command.add_argument("--output", required=True)
    command = add(table, "study")
    command.add_argument("--cases", nargs="+", required=True)
    command.add_argument("--output", required=True)
    command = add(answer, "study")
    for option in ("output", "figure", "costs"):
        command.add_argument(f"--{option}", required=True)
    command.add_argument("--threads", type=int, default=1)
    add(solve, "case").add_argument("--threads", type=int, default=1)
    add(verdict, "study").add_argument("--table", required=True)
    command = add(pages)
    command.add_argument("results", type=Path, nargs="?", help="folder results of a checkout that ran the studies")
    command.add_argument("--check", action="store_true", help="list pages that are older than the numerics")
    arguments = parser.parse_args()
    name = " ".join([arguments.command, *(getattr(arguments, name) for name in arguments.positional)])
    run_stage(name, arguments.log, lambda: arguments.function(arguments), arguments.function.__doc__)


if __name__ == "__main__":
    main()
