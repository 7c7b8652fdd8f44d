"""The command of the installed package: rockburst-mpm <mine>.yaml [targets] [options of Snakemake]."""

import sys

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


def main() -> None:
    """Run Snakemake."""
    from snakemake.cli import main as run_snakemake

    sys.argv[1:] = arguments(sys.argv[1:])  # which the profile looks at, too
    run_snakemake(sys.argv[1:])
