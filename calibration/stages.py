"""The stages of a calibration that read trials: the fit, and the points of a further batch."""

import json
import logging
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from calibration.fit import INTERVAL_SHARE, Fit, Rows, SelfTest, calibrate, calibrate_to_trials
from calibration.instrument_findings import by_terms, find
from calibration.instruments import instrument_term
from calibration.limits import beyond_range, compare_b
from calibration.mine_files import write_mine
from calibration.page import Tests, Trials, write_page, write_table
from calibration.posterior import POINTS
from calibration.recorded import RecordedOutputs, check_record, complete_above, covered, read_record
from calibration.settings import INSTRUMENTS, CalibrationSettings
from calibration.surrogate import Surrogate
from calibration.tradeoffs import further_points
from calibration.trials import (
    MIN_PAIRS,
    PLACES,
    CellCorrection,
    Outputs,
    Places,
    common_cut,
    counted_events,
    counted_sizes,
    gains,
    nothing_fails_before_record,
    outputs,
    read_places,
)
from catalogs.compare.exposure import Exposure, common_period
from catalogs.settings import DatedStep
from catalogs.sources.sizes import log_potency
from common.datasets import atomic_path, read_dataset
from common.errors import InputError
from common.event_table import read_events
from common.observation_table import MODELLED, MODELLED_ERROR
from seismic.catalog import extractions

MAX_COLLAPSED_SHARE = 0.5  # A calibration that leaves more of its trials out says little of its ranges.


@dataclass(frozen=True)
class TrialCatalogues:
    """Catalogues of trials: points (row, quantity), catalogue of each row and its trial (row,); catalogues of the
    `paired` trials, by number, on the mine's own cells; by number of a trial that is left out, why it has collapsed.
    A catalogue also holds what its trial gives at readings, if they count."""

    points: NDArray
    rows: list[xr.Dataset]
    trials: NDArray
    finer: list[xr.Dataset] = field(default_factory=list)
    paired: Sequence[int] = ()
    collapsed: dict[int, str] = field(default_factory=dict)

    @classmethod
    def read(cls, points: NDArray, trials: Sequence[Path], finer: Sequence[Path], first: int) -> "TrialCatalogues":
        """Catalogues of these files, without trials in which rock found no equilibrium on any of their cells.

        points: those of all rows of the trials, in order; finer: of the trials from the number `first` on. Raises
        InputError if too few are left."""
        of_trials, of_finer = ([extractions(read_events(path)) for path in files] for files in (trials, finer))
        collapsed = {number: str(found[0].attrs.get("collapsed", "")) for number, found in enumerate(of_trials)}
        for number, found in enumerate(of_finer, start=first):
            collapsed[number] = collapsed[number] or str(found[0].attrs.get("collapsed", ""))
        collapsed = {number: reason for number, reason in collapsed.items() if reason}
        paired = [number for number in range(first, first + len(of_finer)) if number not in collapsed]
        lost = sum(number >= first for number in collapsed)  # of those that are no replicates
        share = lost / max(len(of_trials) - first, 1)
        if share > MAX_COLLAPSED_SHARE or len(paired) < min(MIN_PAIRS, len(of_finer)):
            worst, reason = next(iter(collapsed.items()))
            raise InputError(
                f"calibration.quantities: rock found no equilibrium in {len(collapsed)} of {len(of_trials)} trials, "
                f"too many to leave out (trial {worst + 1}, {reason}); narrow the ranges to rock that stands"
            )
        trial_of_row = np.repeat(np.arange(len(of_trials)), [len(trial) for trial in of_trials])
        stands = ~np.isin(trial_of_row, list(collapsed))
        rows = [one for trial in of_trials for one in trial]
        return cls(
            points[stands],
            [one for one, kept in zip(rows, stands, strict=True) if kept],
            trial_of_row[stands],
            [one for trial in paired for one in of_finer[trial - first]],
            paired,
            collapsed,
        )


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
    trials: TrialCatalogues

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


def read_calibration(
    given: dict, trials: Sequence[Path], finer: Sequence[Path], record: Path | None, readings: Path | None = None
) -> Calibration:
    """The calibration of a stage's slice to a record, to readings, or to both.

    trials: files of their catalogues, in the slice's order; finer: files of the first designed trials on the mine's own
    cells. Raises InputError where record or readings lack what the terms need."""
    settings = CalibrationSettings.of(given["calibration"], "calibration")
    dated = tuple(DatedStep.of(step) for step in given["steps"])
    points = np.concatenate([np.array(trial["rows"]) for trial in given["trials"]])
    found = TrialCatalogues.read(points, trials, finer, settings.replicates)
    of_record, of_readings = (None if path is None else read_dataset(path) for path in (record, readings))
    return calibrate_catalogues(settings, dated, found, of_record, readings=of_readings)


def calibrate_catalogues(
    settings: CalibrationSettings,
    dated: tuple[DatedStep, ...],
    trials: TrialCatalogues,
    record: xr.Dataset | None,
    sobol: int = POINTS,
    readings: xr.Dataset | None = None,
    surrogate: Surrogate | None = None,
) -> Calibration:
    """The calibration of trials to a record, to readings, or to both; sobol: points of a round of the posterior.

    surrogate: one of the same outputs, if there is one. Without a term of the catalogue the record is not looked at,
    and no step of it counts. Raises InputError where record or readings lack what the terms need, and where quantities
    change no trial."""
    catalogues, fine = trials.rows, trials.finer
    exposure, places, cut = None, None, np.nan
    if record is not None and settings.catalogue_terms:
        exposure = Exposure.of(dated, common_period(record))
        check_record(record, dated, exposure, settings.terms)
        complete = complete_above(record, settings.complete_above)
        cut = common_cut([*catalogues, *fine], complete, log_potency(record["potency"].values))
        logging.info("events count from log10 potency %.2f m3 on", cut)
        places = read_places(record, exposure, cut, [*catalogues, *fine]) if PLACES in settings.terms else None
    steps = tuple(step.name for step in dated) if exposure else ()
    made = [outputs(runs, steps, cut, places).by_term for runs in (catalogues, fine)]
    instruments = None
    if readings is not None and settings.uses_instruments:
        if any(MODELLED.name not in one for one in [*catalogues, *fine]):
            raise InputError(
                "calibration: a trial has no values at the instruments, as it was made before they counted; delete the "
                "trials' folders doubled and own, and run again"
            )
        values, errors = (
            np.array([one[field.name].values for one in [*catalogues, *fine]]) for field in (MODELLED, MODELLED_ERROR)
        )
        instruments, scores = instrument_term(readings, values, errors, settings.model_error)
        made[0][INSTRUMENTS], made[1][INSTRUMENTS] = np.split(scores, [len(catalogues)])
    all_outputs = Outputs(made[0])
    rows = Rows(trials.points, all_outputs, trials.trials)
    refuse_without_effect(rows, settings)
    correction = CellCorrection.none(all_outputs)
    if fine:
        coarse = all_outputs.of_runs(np.flatnonzero(np.isin(trials.trials, trials.paired)))
        correction = CellCorrection.of(coarse, Outputs(made[1]), len(trials.paired))
    recorded = RecordedOutputs.none()
    if record is not None and exposure is not None:
        correction = correction.during(covered(exposure, dated), all_outputs)
        recorded = read_record(record, exposure, cut, settings.seed, counted_sizes(catalogues, steps, cut))
    surrogate = surrogate or Surrogate(rows.points, all_outputs.all, rows.trials, settings.seed)
    known = rows, correction, recorded, settings.terms, settings.model_error, settings.seed
    fit = calibrate(*known, surrogate, sobol, instruments)
    logging.info("posterior of %d points worth %.0f", len(fit.posterior.points), fit.posterior.effective)
    return Calibration(settings, steps, catalogues, cut, rows, places, fit, trials)


def refuse_without_effect(rows: Rows, settings: CalibrationSettings) -> None:
    """Raise InputError where quantities change nothing: all trials, or all sets of events of each, are the same.

    Replicates are left out, as chance changes them.
    """
    trials = rows.trials
    by_term = rows.outputs.by_term
    found = np.concatenate([values for term, values in by_term.items() if term != PLACES], axis=1)
    is_same = bool(np.ptp(found[trials >= settings.replicates], axis=0).max() == 0.0)
    is_same_rock = all(np.ptp(found[trials == one], axis=0).max() == 0.0 for one in np.unique(trials))
    has_sets = len(np.unique(trials)) < len(trials)
    idle = [
        f"quantities[{number}].key: {quantity.key}"
        for number, quantity in enumerate(settings.quantities)
        if is_same or (has_sets and is_same_rock and quantity.changes_events_only)
    ]
    if idle:
        raise InputError(
            f"calibration.{', '.join(idle)}: changes no output of any trial over its range; take it off the list, or "
            "name a key that the mine uses"
        )


def record_stage(given: dict, *, record: Path, output: Path) -> None:
    """Write from which log10 potency (m3) on the record is complete, as JSON. given: the stage's slice.

    Raises InputError where this is not known, or the record lacks what the terms need.
    """
    dated, read = tuple(DatedStep.of(step) for step in given["steps"]), read_dataset(record)
    check_record(read, dated, Exposure.of(dated, common_period(read)), given["terms"])
    with atomic_path(output) as temporary:
        complete = complete_above(read, given["complete_above"])
        temporary.write_text(json.dumps({"complete_above_log10_potency": complete}), encoding="utf-8")


def further_stage(
    given: dict,
    *,
    trials: Sequence[Path],
    finer: Sequence[Path],
    record: Path | None,
    readings: Path | None,
    output: Path,
) -> None:
    """Write the points of a further batch, (trial, quantity) in the unit cube, as JSON.

    given: the stage's slice; files as of read_calibration.
    """
    calibration = read_calibration(given, trials, finer, record, readings)
    settings = calibration.settings
    points = further_points(calibration.fit, settings.batch_trials, settings.seed + given["batch"])
    with atomic_path(output) as temporary:
        temporary.write_text(json.dumps(points.tolist()), encoding="utf-8")


def fit_stage(
    given: dict,
    *,
    trials: Sequence[Path],
    finer: Sequence[Path],
    record: Path | None,
    readings: Path | None,
    output: Path,
    table: Path,
) -> None:
    """Write the page (`output`), the table of the trials, and mine files next to the page.

    given: the stage's slice; files as of read_calibration.
    """
    calibration = read_calibration(given, trials, finer, record, readings)
    settings, fit, steps = calibration.settings, calibration.fit, calibration.steps
    collapsed = calibration.trials.collapsed
    kinds = ["collapsed" if number in collapsed else trial["kind"] for number, trial in enumerate(given["trials"])]
    listed = Trials(
        [trial["name"] for trial in given["trials"]],
        kinds,
        len(calibration.trials.paired),
        collapsed,
        nothing_fails_before_record(calibration.catalogues) and given["has_history"],
    )
    write_table(table, fit, calibration.rows, listed, settings.quantities, steps)
    draws = fit.posterior.draws(given["draws"], settings.seed)
    values = {"middle": fit.posterior.intervals(INTERVAL_SHARE)[1]}
    values |= {f"draw_{number}": draw for number, draw in enumerate(draws, start=1)}
    for name, shares in values.items():
        file = output.parent / f"{name}.yaml"
        write_mine(file, given["text"], settings.quantities, shares, given["posterior"])
    tested = calibration.self_test(listed.of_kind("design"))
    law = compare_b(fit, settings.seed) if steps else None
    found = find(fit, by_terms(fit, settings.seed), settings.seed) if settings.uses_instruments else None
    tests = Tests(tested, beyond_range(fit, settings.seed), law, calibration.cut, found)
    write_page(output, given["mine"], fit, calibration.rows, listed, tests, settings.quantities, steps, len(draws))
