"""The command of the installed package: rockburst-mpm <mine>.yaml [targets] [options of Snakemake]."""

import contextlib
import io
import sys
from collections.abc import Sequence

from workflow import BASE

CHOOSES_CORES = ("-c", "--core", "-j", "--job", "-e", "--executor", "--profile")  # beginnings of options
USAGE = """\
usage: rockburst-mpm <mine>.yaml [targets] [options of Snakemake]

It runs Snakemake on a mine's file, on all cores unless --cores, --jobs or --profile says otherwise. Results go to the
folder `results` of the working directory. Targets and options are those of `snakemake`; `snakemake --help` lists the
options.
"""


def arguments(words: list[str]) -> list[str]:
    """Snakemake's arguments for a mine's file and further words. Without a file it prints the usage and ends."""
    if not words or words[0].startswith("-"):
        print(USAGE, end="", file=sys.stderr)
        sys.exit(0 if words[:1] in (["-h"], ["--help"]) else 2)
    mine, *others = words
    cores = [] if any(word.startswith(CHOOSES_CORES) for word in others) else ["--cores", "all"]
    profile = ["--snakefile", str(BASE / "Snakefile"), "--workflow-profile", str(BASE / "profiles/default")]
    return [*others, *cores, *profile, "--configfile", mine]


def check_options(words: Sequence[str]) -> None:
    """End in one line for arguments that Snakemake's own parser refuses: it would print all of its options first."""
    from snakemake.cli import get_argument_parser

    with contextlib.redirect_stderr(io.StringIO()) as said:
        try:
            get_argument_parser().parse_args(words)
        except SystemExit as end:
            if end.code:
                reason = said.getvalue().strip().rpartition("error: ")[2]
                sys.exit(f"{reason}; a file whose name begins with - is given as ./-name")
            raise  # --help and --version


def main() -> None:
    """Run Snakemake."""
    from snakemake.cli import main as run_snakemake

    sys.argv[1:] = arguments(sys.argv[1:])  # which the profile looks at, too
    check_options(sys.argv[1:])
    run_snakemake(sys.argv[1:])
