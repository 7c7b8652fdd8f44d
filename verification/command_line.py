"""The command line of a package of studies: each stage is a function, its options are paths or texts."""

import argparse
from collections.abc import Callable
from dataclasses import dataclass

from common.command_line import CommandLine
from common.stage import run_stage

SEVERAL = "+"  # Ends the name of an option that takes several values.


@dataclass(frozen=True)
class Stage:
    """A stage: a function of the parsed command line, its options, and the option that names its output."""

    run: Callable[[argparse.Namespace], None]
    options: tuple[str, ...]
    made: str


def run_command(package: str, about: str, *stages: Stage) -> None:
    """Parse the command line `python -m <package> <stage> --<option> ...` and run the stage; --log may be left out."""
    parser = CommandLine(prog=f"python -m {package}", description=about)
    commands = parser.add_subparsers(dest="stage", required=True)
    for stage in stages:
        command = commands.add_parser(stage.run.__name__)
        for option in stage.options:
            several = {"nargs": "+"} if option.endswith(SEVERAL) else {}
            command.add_argument(f"--{option.removesuffix(SEVERAL)}", required=True, **several)
        command.add_argument("--log")
    arguments = parser.parse_args()
    chosen = next(stage for stage in stages if stage.run.__name__ == arguments.stage)
    name = f"{arguments.stage} {getattr(arguments, chosen.made)}"
    run_stage(name, arguments.log, lambda: chosen.run(arguments), chosen.run.__doc__ or name)
