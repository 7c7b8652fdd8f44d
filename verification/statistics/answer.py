"""Estimates and tests of the catalogue comparison against catalogues of known truth."""

from matplotlib.figure import Figure

from verification.results import Results
from verification.rows import Row
from verification.statistics.figure import draw
from verification.statistics.location_recovery import false_alarms, find_shift, location_rows, step_rows
from verification.statistics.mechanism_recovery import mechanism_rows, random_pairs
from verification.statistics.size_recovery import difference_row, estimate_cases, size_rows


def answer(results: Results) -> tuple[list[Row], Figure]:
    """Rows on b-values, axes and angles, and locations; one figure of all."""
    settings, allowed, seed = results.settings, results.allowed, results.settings["seed"]
    estimates = estimate_cases(settings["sizes"], seed)
    uncorrected = estimate_cases(settings["sizes"], seed, "uncorrected")
    pairs = random_pairs(settings["mechanisms"], seed)
    alarms = false_alarms(settings["locations"], seed)
    power = find_shift(settings["locations"], seed)
    rows = [
        *size_rows(estimates, uncorrected, settings["sizes"]["confidence"], allowed),
        difference_row(settings["sizes"], seed, allowed["coverage"]),
        *mechanism_rows(settings["mechanisms"], pairs, seed, allowed),
        *location_rows(alarms, power, settings["locations"], allowed),
        *step_rows(settings["locations"], seed, allowed),
    ]
    return rows, draw(estimates, pairs, alarms, power, settings, allowed)
