"""Shares of catalogues of known truth whose interval holds it, and shares that a test condemns, as study rows."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from verification.comparisons import monte_carlo_error, reaching
from verification.rows import Row

# Lower and upper end of an interval (None where there is none), and the truth, by quantity.
Intervals = dict[str, tuple[tuple[float, float] | None, float]]


@dataclass(frozen=True)
class Coverage:
    """A case: catalogues drawn, share of these with an interval, and share of those that hold the truth.

    least: smallest share that is allowed, where it is not that of the study.
    """

    name: str
    drawn: int
    given: float
    held: float
    least: float | None = None

    @property
    def error(self) -> float:
        """Monte Carlo standard error of the coverage, were it as large as it should be."""
        return monte_carlo_error(0.95, max(self.given * self.drawn, 1))


def cover(
    draw_intervals: Callable[[dict, dict, np.random.Generator, int], Intervals],
    case: dict,
    chosen: dict,
    seed: list[int],
) -> list[Coverage]:
    """Coverage of each quantity of a case over all its catalogues, which are drawn one by one."""
    generator, drawn = np.random.default_rng(seed), chosen["catalogues"]
    counts: dict[str, NDArray] = {}
    for index in range(drawn):
        for of, (interval, truth) in draw_intervals(case, chosen, generator, index).items():
            held = interval is not None and interval[0] <= truth <= interval[1]
            counts.setdefault(of, np.zeros(2, int))[:] += interval is not None, held
    return [
        Coverage(
            f"{of}, {case['name']}" if of else case["name"], drawn, float(given / drawn), float(held / max(given, 1))
        )
        for of, (given, held) in counts.items()
    ]


def alarm_row(name: str, chosen: dict, share: float, most: float) -> Row:
    """Row of the share of pairs of one process that are said to differ, which may exceed the level only by chance."""
    level = chosen["level"]
    error = monte_carlo_error(level, chosen["catalogues"])
    return Row(
        f"{name} of one process said to differ (p <= {level:g}; error: above {most:g})",
        level, share, float(np.maximum(0.0, share - most)), 2.0 * error,
        f"{chosen['catalogues']} pairs, Monte Carlo standard error {error:.4f}",
    )  # fmt: skip


def coverage_rows(one: Coverage, allowed: dict) -> list[Row]:
    """Rows of the share of catalogues with an interval, and of the share of intervals that hold the truth."""
    least, often = one.least or allowed["coverage"], allowed["given"]
    coverage = f"{one.name}: coverage of the 95 % interval (error: short of {least:g})"
    given = f"{one.name}: share of catalogues with an interval (error: short of {often:g})"
    remark = f"{one.drawn} catalogues, Monte Carlo standard error {one.error:.4f}"
    others = "the others: no law, no completeness or no event, in words"
    return [
        reaching(coverage, 0.95, one.held, least, remark=remark),
        reaching(given, 1.0, one.given, often, remark=others),
    ]
