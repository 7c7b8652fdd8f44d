"""All scenes and relations of the extremes into a table: python -m verification.extremes --table PATH [--scenes N]."""

import argparse
import csv
import logging
import tempfile
from collections import Counter
from pathlib import Path

from common.command_line import CommandLine
from common.datasets import atomic_path
from common.errors import InputError
from common.stage import run_stage

COLUMNS = ("seed", "relation", "kind", "seconds", "message")
EVERY = 5  # scenes of which one is compared with its relations


def main() -> None:
    """Parse the command line and run."""
    parser = CommandLine(prog="python -m verification.extremes", description=__doc__)
    parser.add_argument("--table", required=True)
    parser.add_argument("--scenes", type=int, default=400)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--log")
    arguments = parser.parse_args()
    run_stage("extremes", arguments.log, lambda: write_table(arguments))


def write_table(arguments: argparse.Namespace) -> None:
    """One row a scene and a relation; raises InputError, with the number of faults, if there are any."""
    from common.provenance import use_numba_cache

    use_numba_cache()
    from verification.extremes.mines import random_mine
    from verification.extremes.outcomes import FAULTS, run
    from verification.extremes.relations import RELATIONS, compare

    rows, counts = [], Counter()
    with tempfile.TemporaryDirectory() as folder:
        for seed in range(arguments.first, arguments.first + arguments.scenes):
            values = random_mine(seed)
            outcome = run(values, Path(folder))
            rows.append((seed, "", outcome.kind, round(outcome.seconds, 1), outcome.message))
            counts[outcome.kind] += 1
            for name in RELATIONS if seed % EVERY == 0 else ():
                differs = compare(name, values, outcome, lambda scene: run(scene, Path(folder)))
                rows.append((seed, name, "differs" if differs else "holds", "", differs))
                counts[f"relation {'differs' if differs else 'holds'}"] += 1
                if differs:  # here too: Snakemake removes the table of a run that fails
                    logging.error("scene %d, %s: %s", seed, name, differs)
            logging.info("scene %d: %s %s", seed, outcome.kind, outcome.message)
    with atomic_path(arguments.table) as temporary, temporary.open("w", newline="", encoding="utf-8") as file:
        csv.writer(file).writerows([COLUMNS, *rows])
    told = ", ".join(f"{count} {kind}" for kind, count in sorted(counts.items()))
    logging.info("%s", told)
    if any(counts[kind] for kind in (*FAULTS, "relation differs")):
        raise InputError(f"{told}; see the log")


if __name__ == "__main__":
    main()
