"""Command line of the spread of a catalogue: python -m verification.spread report."""

import argparse
import json
from pathlib import Path

from verification.command_line import Stage, run_command


def report(arguments: argparse.Namespace) -> None:
    """Write table and page of all studies."""
    from verification.results import read_results
    from verification.spread.page import Scene, write_report
    from verification.studies import load_study

    studies = [load_study(path, json.loads(arguments.default)) for path in arguments.studies]
    results, logs = Path(arguments.results), Path(arguments.logs)
    scenes = [Scene.of(read_results(study, results / study.name, logs / study.name)) for study in studies]
    write_report(scenes, Path(arguments.table), Path(arguments.page))


if __name__ == "__main__":
    run_command(
        "verification.spread",
        __doc__,
        Stage(report, ("studies+", "default", "results", "logs", "table", "page"), made="page"),
    )
