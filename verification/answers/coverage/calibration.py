"""Coverage of the intervals of a calibration, and its warnings, by records of a mine in closed form.

Each case calibrates the same trials to records of true values, drawn within the ranges, near their ends or beyond.
Intervals have to hold the true values. Warnings have to stand where the truth lies beyond a range, and where the record
has another b than the model; elsewhere they are false alarms. The self-test has to state the coverage.
"""

from dataclasses import dataclass

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from calibration.fit import INTERVAL_SHARE, Fit, Rows, calibrate, calibrate_to_trials
from calibration.limits import beyond_range, compare_b
from calibration.recorded import complete_above, read_record
from calibration.surrogate import Surrogate
from calibration.trials import (
    PLACES,
    CellCorrection,
    common_cut,
    counted_sizes,
    outputs,
    read_places,
)
from catalogs.sources.sizes import log_potency
from common.errors import InputError
from verification.answers.coverage import closed_form_mine as mine
from verification.answers.coverage.shares import MARGIN, Coverage, share_at_least, share_at_most
from verification.comparisons import monte_carlo_error
from verification.rows import Row

SEED = 1
POINTS = 2**11  # Sobol points of a round of the posterior.
WITHIN, NEAR_ENDS, BEYOND = "within", "near ends", "beyond"  # Where the truth of a case lies.


def answer(settings: dict, allowed: dict) -> tuple[list[Coverage], list[Row]]:
    """Coverages of the quantities, and rows of warnings and of the self-test."""
    chosen, coverages, rows = settings["calibration"], [], []
    for number, case in enumerate(chosen["cases"]):
        found, name = measure(chosen, case, [settings["seed"], 40, number]), f"calibration, {case['name']}"
        if case.get("truth") != BEYOND and "record_b" not in case:
            held, least = float(np.mean(found.held)), allowed["calibrated"]
            coverages.append(Coverage(name, chosen["catalogues"], found.given, held, least))
        if "self_tests" in case:
            rows.append(_self_test_row(name, found, allowed["self_test"]))
        rows += _warning_rows(name, case, found, allowed)
    return coverages, rows


class MinedTrials:
    """Trials of a case, calibrated to records. Trials with one cut have one surrogate."""

    def __init__(self, chosen: dict, case: dict, generator: np.random.Generator):
        self.case = {"b": chosen["b"], "span": chosen["span"]} | case
        self.terms = tuple(case.get("terms", ("potency", "number")))
        self.points, self.catalogues = mine.trials(self.case, chosen["trials"], chosen["replicates"], generator)
        self.designed = np.arange(chosen["replicates"], len(self.points))
        self.surrogates: dict[float, Surrogate] = {}

    def calibrated(self, record: xr.Dataset) -> tuple[Fit, Rows]:
        """Calibration to a record, and the rows of the trials. Raises InputError if its completeness is unknown."""
        known = None if "fade" in self.case else mine.FLOOR
        cut = common_cut(self.catalogues, complete_above(record, known), log_potency(record["potency"].values))
        exposure = mine.exposure()
        places = read_places(record, exposure, cut, self.catalogues) if PLACES in self.terms else None
        made = outputs(self.catalogues, mine.STEPS, cut, places)
        rows = Rows(self.points, made, np.arange(len(self.points)))
        surrogate = self.surrogates.get(cut)
        if surrogate is None:
            surrogate = self.surrogates[cut] = Surrogate(self.points, made.all, rows.trials, SEED)
        elif places is not None:  # gains at these places
            surrogate = surrogate.of(self.points, made.all, rows.trials)
        sizes = counted_sizes(self.catalogues, mine.STEPS, cut)
        recorded = read_record(record, exposure, cut, SEED, sizes)
        correction = CellCorrection.none(made)
        return calibrate(rows, correction, recorded, self.terms, mine.MODEL_ERROR, SEED, surrogate, POINTS), rows


@dataclass(frozen=True)
class Measured:
    """Results over the records of a case.

    given: share of records with a calibration; held (record, quantity): the 95 % interval holds the truth; warned
    (record, kind): of values beyond a range, of another b; stated, true: coverage of the 90 % intervals by self-tests
    of the first records, and as it is.
    """

    given: float
    held: NDArray
    warned: NDArray
    stated: float
    true: float


def measure(chosen: dict, case: dict, seed: list[int]) -> Measured:
    """Calibrate the trials of a case to its records, one by one."""
    generator = np.random.default_rng(seed)
    trials = MinedTrials(chosen, case, generator)
    held: list[NDArray] = []
    held_90: list[NDArray] = []
    warned = []
    stated: list[float] = []
    for _ in range(chosen["catalogues"]):
        truth = true_values(case.get("truth", WITHIN), generator)
        try:
            fit, rows = trials.calibrated(mine.record(truth, trials.case, generator))
        except InputError:  # a completeness that the record does not tell is asked for
            continue
        for share, kept in ((0.95, held), (INTERVAL_SHARE, held_90)):
            low, _, high = fit.posterior.intervals(share)
            kept.append((low <= truth) & (truth <= high))
        warned.append((beyond_range(fit, SEED).is_told or not fit.fits, compare_b(fit, SEED).is_told))
        if len(stated) < case.get("self_tests", 0):
            stated.append(calibrate_to_trials(fit, rows, trials.designed, SEED).coverage)
    return Measured(
        len(held) / chosen["catalogues"],
        np.array(held),
        np.array(warned),
        float(np.mean(stated)) if stated else np.nan,
        float(np.mean(held_90)),
    )


def true_values(place: str, generator: np.random.Generator) -> NDArray:
    """True values (quantity,), as shares of the ranges; `place` is that of the first one."""
    truth = generator.uniform(size=mine.QUANTITIES)
    if place == NEAR_ENDS:
        truth[0] = generator.choice([0.0, 0.9]) + generator.uniform(0.0, 0.1)
    elif place == BEYOND:
        truth[0] = generator.choice([-0.5, 1.25]) + generator.uniform(0.0, 0.25)
    return truth


def _warning_rows(name: str, case: dict, found: Measured, allowed: dict) -> list[Row]:
    """Rows of the shares of records with a warning: wanted ones reach a share, false alarms are below one."""
    rows, count = [], len(found.warned)
    for kind, wanted, share in (
        ("values beyond a range", case.get("truth") == BEYOND, float(np.mean(found.warned[:, 0]))),
        ("another b", "record_b" in case, float(np.mean(found.warned[:, 1]))),
    ):
        if wanted:
            least = allowed["warned"]
            quantity = f"{name}: warned of {kind} (error: short of {least:g})"
            rows.append(share_at_least(quantity, 1.0, share, least, count, "records"))
        elif case.get("truth") != BEYOND and "record_b" not in case:
            most = allowed["false_warnings"]
            quantity = f"{name}: warned falsely of {kind} (error: above {most:g})"
            rows.append(share_at_most(quantity, 0.0, share, most, count, "records"))
    return rows


def _self_test_row(name: str, found: Measured, most: float) -> Row:
    """Row of the difference between the coverage that self-tests state and the true one, of the 90 % intervals."""
    return Row(
        f"{name}: coverage that the self-test states (90 % intervals; error: off by more than {most:g})",
        found.true, found.stated, float(np.maximum(0.0, abs(found.stated - found.true) - most)),
        MARGIN * monte_carlo_error(0.9, found.held.size), f"{len(found.held)} records",
    )  # fmt: skip
