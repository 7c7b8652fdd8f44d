"""Command lines: `python -m calibration trial` (one trial), `further` (points of a batch) and `fit` (the posterior)."""

import argparse
from pathlib import Path

from common.command_line import CommandLine
from common.event_table import write_events
from common.provenance import provenance
from common.slices import read_slice
from common.stage import run_stage


def main(arguments: list[str] | None = None) -> None:
    """Parse the command line and run the stage it names."""
    parser = CommandLine(prog="python -m calibration", description=__doc__)
    stages = parser.add_subparsers(dest="stage", required=True)
    one = stages.add_parser("trial", help="one trial: a run of the mine with other values of some quantities")
    one.add_argument("--output", required=True, help="catalogue of the trial, netCDF")
    batch = stages.add_parser("further", help="points of a further batch of trials")
    batch.add_argument("--output", required=True, help="points written, JSON")
    every = stages.add_parser("fit", help="the posterior of the quantities, given the record")
    every.add_argument("--output", required=True, help="page written; mine files and figures stand beside it")
    every.add_argument("--table", required=True, help="table of the trials written, CSV")
    for stage in (batch, every):
        stage.add_argument("--trials", required=True, nargs="+", help="catalogues of all trials, in order")
        stage.add_argument(
            "--finer", nargs="*", default=[], help="catalogues of the first designed trials on the mine's own cells"
        )
        stage.add_argument("--record", required=True, help="record.nc")
    for stage in (one, batch, every):
        stage.add_argument("--settings", required=True, help="file of the configuration's slice, JSON")
        stage.add_argument("--log", help="log file; standard error without it")
    chosen = parser.parse_args(arguments)
    run, does = {
        "trial": (trial, "a run of the mine with other values of the calibrated quantities"),
        "further": (further, "where further trials teach most"),
        "fit": (fit, "the calibrated quantities, from all trials and the record"),
    }[chosen.stage]
    run_stage(f"{chosen.stage} {chosen.output}", chosen.log, lambda: run(chosen), does)


def trial(chosen: argparse.Namespace) -> None:
    """One trial, from its grid to its catalogue."""
    from calibration.trial import run_trial  # here: the other stages need no mechanics

    settings = read_slice(chosen.settings)
    output = Path(chosen.output)
    events = run_trial(settings, output.with_suffix(".failed.nc"))
    write_events(events.assign_attrs(provenance(settings, "calibration trial", [])), output)


def further(chosen: argparse.Namespace) -> None:
    """Where the trials of a further batch are run."""
    from calibration.stages import further_stage, read_calibration

    given = read_slice(chosen.settings)
    further_stage(given, read_calibration(given, chosen.trials, chosen.finer, chosen.record), Path(chosen.output))


def fit(chosen: argparse.Namespace) -> None:
    """The posterior as a page, with the table of trials and mine files."""
    from calibration.stages import fit_stage, read_calibration

    given = read_slice(chosen.settings)
    found = read_calibration(given, chosen.trials, chosen.finer, chosen.record)
    fit_stage(given, found, len(chosen.finer), Path(chosen.output), Path(chosen.table))


if __name__ == "__main__":
    main()
