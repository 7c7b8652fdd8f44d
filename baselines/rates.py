"""Number of a month's events from earlier ones, by metres of the face or by days, and whether the month fits it.

A rate is the earlier number over the earlier metres or days. The test is the number test of forecasts with the chance
of both numbers: counts are Poisson numbers of equal groups of events, whose size is the clustering of the record
(catalogs.exposure.total_ratio). So the p-values of months that fit are uniform between 0 and 1.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from baselines.month_maps import TIMES_IN_STEP, Periods, Places, times_with_face
from catalogs.exposure import DAY, Exposure, Total, total_ratio
from catalogs.face import Face

MEASURES = ("metres", "days")


@dataclass(frozen=True)
class Rate:
    """What earlier periods let one expect of a step: number, and the p-value of the recorded one; NaN where unknown."""

    expected: float
    p_value: float


@dataclass(frozen=True)
class StepRates:
    """A step: amounts of metres (NaN without a face) and of days, number, potency (m3), and the rates by each measure
    of all earlier periods and of the last one."""

    amount: dict[str, float]
    number: int
    potency: float
    all_earlier: dict[str, Rate]
    last: dict[str, Rate]


def step_rates(record: Places, periods: Periods, face: Face | None) -> list[StepRates]:
    """Of each dated step. Earlier days without a face do not count, nor do their events."""
    if face is not None:
        stands = np.isfinite(face.at(record.time).ahead).all(axis=1)
        record = Places(record.time[stands], record.place[stands], record.potency[stands])
    amounts = [_amount(face, start, end) for start, end in zip(periods.start, periods.end, strict=True)]
    inside = [record.between(start, end) for start, end in zip(periods.start, periods.end, strict=True)]
    numbers = np.array([len(one.time) for one in inside])
    rows = []
    for step in range(len(periods.start) - periods.before):
        own = periods.before + step
        every, last = np.arange(own), np.arange(own)[-1:]

        def rates(earlier: NDArray, own: int = own) -> dict[str, Rate]:
            known = _clustering(record, periods, earlier)
            now = _clustering(record, periods, np.array([own]))
            return {
                measure: n_test(
                    int(numbers[own]),
                    amounts[own][measure],
                    int(numbers[earlier].sum()),
                    float(sum(amounts[one][measure] for one in earlier)),
                    (now, known),
                )
                for measure in MEASURES
            }

        potency = float(inside[own].potency.sum())
        rows.append(StepRates(amounts[own], int(numbers[own]), potency, rates(every), rates(last)))
    return rows


def n_test(
    number: int, amount: float, earlier: int, earlier_amount: float, clustering: tuple[float, float] = (1.0, 1.0)
) -> Rate:
    """The number expected of an amount (metres, days) after an earlier number of an earlier amount, and the chance of
    one as far from it. clustering: variance over mean of the number, and of the earlier one."""
    if not (earlier_amount > 0.0 and amount > 0.0 and earlier > 0):
        return Rate(np.nan, np.nan)
    scale = amount / earlier_amount
    ratio = total_ratio(Total(float(number), clustering[0]), Total(earlier * scale, clustering[1] * scale))
    return Rate(earlier * scale, ratio.p_value)


def _amount(face: Face | None, start: np.datetime64, end: np.datetime64) -> dict[str, float]:
    days = float((end - start) / DAY)
    if face is None:
        return {"metres": np.nan, "days": days}
    return {"metres": face.metres(start, end), "days": days * len(times_with_face(face, start, end)) / TIMES_IN_STEP}


def _clustering(record: Places, periods: Periods, chosen: NDArray) -> float:
    """Variance over mean of the number of events in windows of some days of the chosen periods."""
    if not len(chosen):
        return 1.0
    return Exposure(periods.start[chosen], periods.end[chosen]).clustering(record.time)
