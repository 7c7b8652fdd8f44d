"""Estimates and tests of the catalogue comparison against catalogues of known truth."""

from matplotlib.figure import Figure

from verification.answers.statistics.figure import draw
from verification.answers.statistics.location_recovery import false_alarms, find_shift, location_rows, step_rows
from verification.answers.statistics.mechanism_recovery import mechanism_rows, random_pairs
from verification.answers.statistics.size_recovery import difference_row, estimate_cases, size_rows
from verification.page_tables import Pivot
from verification.results import Results
from verification.rows import Row

TABLES = (
    Pivot(
        "Estimates of b",
        r"(?P<row>b .+?): (?P<column>mean of b|coverage of the 95 % interval|mean stated error of b)(?: .+)?",
        "measured",
    ),
    Pivot("Three steps that lie apart", r"three steps (?P<row>\d+ m apart), (?P<column>.+?)(?: \(.+\))?", "measured"),
)


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
