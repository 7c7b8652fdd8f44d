"""Command lines: `python -m calibration trial` (one trial) and `fit` (all trials and the record)."""

import argparse
import logging
from pathlib import Path

from common.command_line import CommandLine
from common.datasets import read_dataset
from common.event_table import read_events, write_events
from common.provenance import provenance
from common.slices import read_slice
from common.stage import run_stage


def main(arguments: list[str] | None = None) -> None:
    """Parse the command line and run the stage it names."""
    parser = CommandLine(prog="python -m calibration", description=__doc__)
    stages = parser.add_subparsers(dest="stage", required=True)
    one = stages.add_parser("trial", help="one trial: a run of the mine with other values of some quantities")
    one.add_argument("--output", required=True, help="catalogue of the trial, netCDF")
    every = stages.add_parser("fit", help="the posterior of the quantities, given the record")
    every.add_argument("--trials", required=True, nargs="+", help="catalogues of all trials, in order")
    every.add_argument(
        "--finer", nargs="*", default=[], help="catalogues of the first designed trials on the mine's own cells"
    )
    every.add_argument("--record", required=True, help="record.nc")
    every.add_argument("--output", required=True, help="page written; mine files and figures stand beside it")
    every.add_argument("--table", required=True, help="table of the trials written, CSV")
    for stage in (one, every):
        stage.add_argument("--settings", required=True, help="file of the configuration's slice, JSON")
        stage.add_argument("--log", help="log file; standard error without it")
    chosen = parser.parse_args(arguments)
    run, does = {
        "trial": (trial, "a run of the mine with other values of the calibrated quantities"),
        "fit": (fit, "the calibrated quantities, from all trials and the record"),
    }[chosen.stage]
    run_stage(f"{chosen.stage} {chosen.output}", chosen.log, lambda: run(chosen), does)


def trial(chosen: argparse.Namespace) -> None:
    """One trial, from its grid to its catalogue."""
    from calibration.trial import run_trial  # here: the other stage needs no mechanics

    settings = read_slice(chosen.settings)
    output = Path(chosen.output)
    events = run_trial(settings, output.with_suffix(".failed.nc"))
    write_events(events.assign_attrs(provenance(settings, "calibration trial", [])), output)


def fit(chosen: argparse.Namespace) -> None:
    """The posterior as a page, with the table of trials and mine files."""
    import numpy as np

    from calibration.fit import SHARES, CellCorrection, calibrate
    from calibration.mine_files import write_mine
    from calibration.page import Trials, write_page, write_table
    from calibration.self_test import calibrate_to_trials
    from calibration.settings import CalibrationSettings
    from calibration.trials import Outcome, common_cut, has_silent_history, outcome, read_record
    from catalogs.comparison_settings import DatedStep
    from catalogs.exposure import Exposure

    given = read_slice(chosen.settings)
    settings = CalibrationSettings.of(given["calibration"], "calibration")
    steps = tuple(DatedStep.of(step) for step in given["steps"])
    names = [step.name for step in steps]
    catalogues, finer = ([read_events(path) for path in paths] for paths in (chosen.trials, chosen.finer))
    record = read_dataset(chosen.record)
    cut = common_cut([*catalogues, *finer], record)
    logging.info("events count from log10 potency %.2f m3 on", cut)
    made = outcome(catalogues, names, cut)
    correction = CellCorrection.none(len(steps))
    if finer:
        pairs = slice(settings.replicates, settings.replicates + len(finer))
        coarse = Outcome(made.log_potency[pairs], made.log_number[pairs])
        correction = CellCorrection.of(coarse, outcome(finer, names, cut))
    points = np.array(given["points"])
    recorded = read_record(record, Exposure.of(steps, None), cut, settings.seed)
    found = calibrate(points, made, correction, recorded, settings.terms, settings.model_error, settings.seed)
    logging.info("posterior of %d points worth %.0f", len(found.posterior.points), found.posterior.effective)

    tested = calibrate_to_trials(
        found.surrogate, settings.replicates, recorded, settings.terms, settings.model_error, settings.seed
    )

    page, trials = (
        Path(chosen.output),
        Trials(points, settings.replicates, len(finer), has_silent_history(catalogues) and given["has_history"]),
    )
    write_table(Path(chosen.table), found, trials, list(settings.quantities), names)
    middle = found.posterior.quantiles(SHARES)[1]
    write_mine(page.parent / "middle.yaml", given["text"], settings.quantities, middle)
    draws = found.posterior.draws(given["draws"], settings.seed)
    for number, draw in enumerate(draws, start=1):
        write_mine(page.parent / f"draw_{number}.yaml", given["text"], settings.quantities, draw)
    write_page(page, given["mine"], found, trials, tested, list(settings.quantities), names, len(draws))


if __name__ == "__main__":
    main()
