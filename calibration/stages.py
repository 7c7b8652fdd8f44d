"""The stages of a calibration that read trials: the fit, and the points of a further batch."""

import json
import logging
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from calibration.cells import CellCorrection
from calibration.extractions import extractions
from calibration.fit import SHARES, Fit, Rows, calibrate
from calibration.further import further_points
from calibration.mine_files import write_mine
from calibration.page import Trials, write_page, write_table
from calibration.self_test import SelfTest, calibrate_to_trials
from calibration.settings import CalibrationSettings
from calibration.trials import (
    PLACES,
    Places,
    common_cut,
    counted_events,
    covered,
    gains,
    has_silent_history,
    outputs,
    read_places,
    read_record,
)
from catalogs.comparison_settings import DatedStep
from catalogs.exposure import Exposure, common_period
from common.datasets import atomic_path, read_dataset
from common.event_table import read_events


@dataclass(frozen=True)
class Calibration:
    """All that the stages read: settings, catalogues of the rows in order, cut (log10 m3), rows, and the fit."""

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
        """Each of these trials in turn as the record."""
        known = self.gains_at if PLACES in self.settings.terms else None
        return calibrate_to_trials(self.fit, self.rows, trials, self.settings.seed, known)


def read_calibration(given: dict, trials: Sequence[str], finer: Sequence[str], record_file: str) -> Calibration:
    """The calibration of a stage's slice to a record; trials: their files in the slice's order; finer: those of the
    first designed trials on the mine's own cells. Raises InputError where the record lacks what the terms need."""
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
    made = outputs(catalogues, steps, cut, settings.terms, places)
    number = np.repeat(np.arange(len(of_trials)), [len(trial) for trial in of_trials])
    rows = Rows(np.concatenate([np.array(trial["rows"]) for trial in given["trials"]]), made, number)
    correction = CellCorrection.none(made)
    if finer:
        first = settings.replicates
        coarse = made.chosen(np.flatnonzero((number >= first) & (number < first + len(finer))))
        correction = CellCorrection.of(coarse, outputs(fine, steps, cut, settings.terms, places), len(finer))
    correction = correction.during(covered(exposure, dated), made)
    recorded = read_record(record, exposure, cut, settings.seed, settings.terms)
    fit = calibrate(rows, correction, recorded, settings.terms, settings.model_error, settings.seed)
    logging.info("posterior of %d points worth %.0f", len(fit.posterior.points), fit.posterior.effective)
    return Calibration(settings, steps, catalogues, cut, rows, places, fit)


def fit_stage(given: dict, found: Calibration, pairs: int, page: Path, table: Path) -> None:
    """Write page, table of trials and mine files. given: the stage's slice; pairs: trials run on finer cells, too."""
    settings, fit = found.settings, found.fit
    names = [trial["name"] for trial in given["trials"]]
    designed = np.array([number for number, trial in enumerate(given["trials"]) if trial["kind"] == "design"])
    trials = Trials(
        names,
        [trial["kind"] for trial in given["trials"]],
        pairs,
        has_silent_history(found.catalogues) and given["has_history"],
    )
    write_table(table, fit, found.rows, trials, settings.quantities, found.steps)
    write_mine(page.parent / "middle.yaml", given["text"], settings.quantities, fit.posterior.quantiles(SHARES)[1])
    draws = fit.posterior.draws(given["draws"], settings.seed)
    for number, draw in enumerate(draws, start=1):
        write_mine(page.parent / f"draw_{number}.yaml", given["text"], settings.quantities, draw)
    tested = found.self_test(designed)
    write_page(page, given["mine"], fit, found.rows, trials, tested, settings.quantities, found.steps, len(draws))


def further_stage(given: dict, found: Calibration, output: Path) -> None:
    """Write the points of a further batch, (trial, quantity) in the unit cube, as JSON."""
    points = further_points(found.fit, found.settings.batch_trials, found.settings.seed + given["batch"])
    with atomic_path(output) as temporary:
        temporary.write_text(json.dumps(points.tolist()), encoding="utf-8")
