"""The stages of a calibration that read trials: the fit, and the points of a further batch."""

import json
import logging
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from calibration.fit import SHARES, Fit, Rows, SelfTest, calibrate, calibrate_to_trials
from calibration.mine_files import write_mine
from calibration.page import Trials, write_page, write_table
from calibration.settings import CalibrationSettings
from calibration.tradeoffs import further_points
from calibration.trials import (
    PLACES,
    CellCorrection,
    Places,
    common_cut,
    counted_events,
    covered,
    gains,
    nothing_fails_before_record,
    outputs,
    read_places,
    read_record,
)
from catalogs.compare.exposure import Exposure, common_period
from catalogs.settings import DatedStep
from common.datasets import atomic_path, read_dataset
from common.event_table import read_events
from seismic.catalog import extractions


@dataclass(frozen=True)
class Calibration:
    """A fit with all that it was made from: settings, catalogues of the rows in order, cut (log10 m3), rows."""

    settings: CalibrationSettings
    steps: tuple[str, ...]
    catalogues: list[xr.Dataset]
    cut: float
    rows: Rows
    places: Places | None
    fit: Fit

    def gains_at(self, row: int) -> NDArray:
        """Information gain of all rows (row, step) at the events of one of them, located as badly as recorded ones."""
        assert self.places is not None
        location, step = counted_events(self.catalogues[row], self.steps, self.cut)
        generator = np.random.default_rng([self.settings.seed, row])
        return gains(self.catalogues, self.steps, self.cut, Places.of_events(location, step, self.places, generator))

    def self_test(self, trials: NDArray) -> SelfTest:
        """Calibrate to each of these trials in turn, as if it were the record."""
        gains_at = self.gains_at if PLACES in self.settings.terms else None
        return calibrate_to_trials(self.fit, self.rows, trials, self.settings.seed, gains_at)


def read_calibration(given: dict, trials: Sequence[Path], finer: Sequence[Path], record_file: Path) -> Calibration:
    """The calibration of a stage's slice to a record.

    trials: files of their catalogues, in the slice's order; finer: files of the first designed trials on the mine's own
    cells. Raises InputError where the record lacks what the terms need."""
    settings = CalibrationSettings.of(given["calibration"], "calibration")
    dated = tuple(DatedStep.of(step) for step in given["steps"])
    steps = tuple(step.name for step in dated)
    of_trials = [extractions(read_events(path)) for path in trials]
    of_finer = [extractions(read_events(path)) for path in finer]
    catalogues = [one for trial in of_trials for one in trial]
    fine = [one for trial in of_finer for one in trial]
    record = read_dataset(record_file)
    exposure = Exposure.of(dated, common_period(record))
    cut = common_cut([*catalogues, *fine], record)
    logging.info("events count from log10 potency %.2f m3 on", cut)
    places = read_places(record, exposure, cut, [*catalogues, *fine]) if PLACES in settings.terms else None
    all_outputs = outputs(catalogues, steps, cut, settings.terms, places)
    number = np.repeat(np.arange(len(of_trials)), [len(trial) for trial in of_trials])
    rows = Rows(np.concatenate([np.array(trial["rows"]) for trial in given["trials"]]), all_outputs, number)
    correction = CellCorrection.none(all_outputs)
    if finer:
        first = settings.replicates
        coarse = all_outputs.of_runs(np.flatnonzero((number >= first) & (number < first + len(finer))))
        correction = CellCorrection.of(coarse, outputs(fine, steps, cut, settings.terms, places), len(finer))
    correction = correction.during(covered(exposure, dated), all_outputs)
    recorded = read_record(record, exposure, cut, settings.seed, settings.terms)
    fit = calibrate(rows, correction, recorded, settings.terms, settings.model_error, settings.seed)
    logging.info("posterior of %d points worth %.0f", len(fit.posterior.points), fit.posterior.effective)
    return Calibration(settings, steps, catalogues, cut, rows, places, fit)


def further_stage(given: dict, *, trials: Sequence[Path], finer: Sequence[Path], record: Path, output: Path) -> None:
    """Write the points of a further batch, (trial, quantity) in the unit cube, as JSON.

    given: the stage's slice; files as of read_calibration.
    """
    calibration = read_calibration(given, trials, finer, record)
    settings = calibration.settings
    points = further_points(calibration.fit, settings.batch_trials, settings.seed + given["batch"])
    with atomic_path(output) as temporary:
        temporary.write_text(json.dumps(points.tolist()), encoding="utf-8")


def fit_stage(
    given: dict, *, trials: Sequence[Path], finer: Sequence[Path], record: Path, output: Path, table: Path
) -> None:
    """Write the page (`output`), the table of the trials, and mine files next to the page.

    given: the stage's slice; files as of read_calibration.
    """
    calibration = read_calibration(given, trials, finer, record)
    settings, fit, steps = calibration.settings, calibration.fit, calibration.steps
    kinds = [trial["kind"] for trial in given["trials"]]
    designed = np.array([number for number, kind in enumerate(kinds) if kind == "design"])
    listed = Trials(
        [trial["name"] for trial in given["trials"]],
        kinds,
        len(finer),
        nothing_fails_before_record(calibration.catalogues) and given["has_history"],
    )
    write_table(table, fit, calibration.rows, listed, settings.quantities, steps)
    write_mine(output.parent / "middle.yaml", given["text"], settings.quantities, fit.posterior.quantiles(SHARES)[1])
    draws = fit.posterior.draws(given["draws"], settings.seed)
    for number, draw in enumerate(draws, start=1):
        write_mine(output.parent / f"draw_{number}.yaml", given["text"], settings.quantities, draw)
    tested = calibration.self_test(designed)
    write_page(output, given["mine"], fit, calibration.rows, listed, tested, settings.quantities, steps, len(draws))
