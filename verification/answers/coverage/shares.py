"""Shares of catalogues of known truth whose interval holds it, and shares that a test condemns, as study rows.

A share is out of its bound only if so few catalogues can hardly bring it about by chance where the true share is as
large as the bound: if it is further off than MARGIN Monte Carlo standard errors, that is, if its own binomial interval
(Wilson's) leaves the bound out.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from verification.comparisons import monte_carlo_error
from verification.rows import Row

MARGIN = 2.0  # Monte Carlo standard errors by which a share may miss its bound.
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


def share_at_least(quantity: str, expected: float, share: float, least: float, count: float, drawn: str) -> Row:
    """Row of a share of `count` draws that must reach `least`; its error is what it lacks. drawn: what they are."""
    return _share_row(quantity, expected, share, least - share, least, count, drawn)


def share_at_most(quantity: str, expected: float, share: float, most: float, count: float, drawn: str) -> Row:
    """Row of a share of `count` draws that `most` bounds; its error is what it exceeds. drawn: what they are."""
    return _share_row(quantity, expected, share, share - most, most, count, drawn)


def _share_row(quantity: str, expected: float, share: float, off: float, bound: float, count: float, drawn: str) -> Row:
    error = monte_carlo_error(bound, max(count, 1))
    remark = f"{count:g} {drawn}, Monte Carlo standard error {error:.4f}"
    return Row(quantity, expected, share, float(np.maximum(0.0, off)), MARGIN * error, remark)  # NaN stays NaN


def alarm_row(
    name: str, chosen: dict, share: float, most: float, count: int | None = None, drawn: str = "pairs"
) -> Row:
    """Row of the share of pairs of one process that are said to differ, which may exceed the level only by chance.

    count: how many are compared, all catalogues if not given; drawn: what they are."""
    level = chosen["level"]
    quantity = f"{name} of one process said to differ (p <= {level:g}; error: above {most:g})"
    return share_at_most(quantity, level, share, most, chosen["catalogues"] if count is None else count, drawn)


def coverage_rows(one: Coverage, allowed: dict) -> list[Row]:
    """Rows of the share of catalogues with an interval, and of the share of intervals that hold the truth."""
    least, often = one.least or allowed["coverage"], allowed["given"]
    coverage = f"{one.name}: coverage of the 95 % interval (error: short of {least:g})"
    given = f"{one.name}: share of catalogues with an interval (error: short of {often:g})"
    others = "catalogues; the others: no law, no completeness or no event, in words"
    return [
        share_at_least(coverage, 0.95, one.held, least, one.given * one.drawn, "intervals"),
        share_at_least(given, 1.0, one.given, often, one.drawn, others),
    ]
