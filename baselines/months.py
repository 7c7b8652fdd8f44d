"""The record predicts itself: maps and numbers of a month's events, from what was known before the month.

Maps: baselines.month_maps. The number of a month follows from earlier ones by metres of the face or by days: a rate is
the earlier number over the earlier metres or days. The test is the N test of forecasts with the chance of both numbers:
counts are Poisson numbers of equal groups of events (catalogs.compare.exposure.total_ratio), whose size is the
dispersion index of the record up to the end of the month. A month alone holds too few clusters to know it from.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from baselines.alerts import AlertScores, find_alerts, find_drive_alerts
from baselines.drives import DriveMetres
from baselines.map_scores import MIN_CLUSTERS, MapScores, coarser_clusters
from baselines.measures import METRES
from baselines.models import ModelComparison
from baselines.month_maps import TIMES_IN_STEP, MonthMaps, Periods, Places, nuisances, spans_of_face, times_with_face
from baselines.number_forecasts import (
    ALL_LAWS,
    NumberScores,
    RecordedSteps,
    control_rules,
    laws_of_all,
    score_numbers,
    score_potency,
)
from baselines.rate_law import RateLaw
from baselines.settings import BaselineReportSlice
from catalogs.compare.blocks import cluster_labels
from catalogs.compare.comparison import record_clusters
from catalogs.compare.exposure import DAY, Exposure, Total, common_period, total_ratio, window
from catalogs.compare.face import Face
from catalogs.compare.locations import location_errors
from catalogs.sources.jackknife import effective_blocks
from catalogs.sources.sizes import log_potency
from common.errors import InputError

MEASURES = ("metres", "days")  # A rate is a number of events per one of these.


@dataclass(frozen=True)
class Rate:
    """Number expected of a step by earlier periods, and the p-value of the recorded one (N test); NaN where unknown."""

    expected: float
    p_value: float


@dataclass(frozen=True)
class StepRates:
    """Events of a step, and what earlier periods predict of their number.

    amount: metres (NaN without a face) and days; number; potency, m3; all_earlier, last: rates by each measure of all
    earlier periods and of the last one.
    """

    amount: dict[str, float]
    number: int
    potency: float
    all_earlier: dict[str, Rate]
    last: dict[str, Rate]


def step_rates(record: Places, periods: Periods, face: Face | None) -> list[StepRates]:
    """Numbers and rates of each dated step. Earlier days without a face do not count, nor do their events."""
    if face is not None:
        has_face = np.isfinite(face.at(record.time).ahead).all(axis=1)
        record = Places(record.time[has_face], record.place[has_face], record.potency[has_face])
    edges = list(zip(periods.start, periods.end, strict=True))
    amounts = [_amount(face, start, end) for start, end in edges]
    with_face = [spans_of_face(face, start, end) for start, end in edges]
    period = Exposure(periods.start, periods.end).step(record.time)
    numbers = np.array([np.count_nonzero(period == one) for one in range(len(amounts))])
    clusters = cluster_labels(record.time, record.place, period)
    rows = []
    for step in range(len(periods.start) - periods.before):
        own = periods.before + step
        counted = (period >= 0) & (period <= own)
        sizes = np.unique(coarser_clusters(clusters[counted], record.time[counted]), return_counts=True)[1]
        known = Exposure(*np.concatenate(with_face[: own + 1]).T)
        dispersion = known.dispersion_index(record.time, clusters)
        dispersion = dispersion if effective_blocks(sizes) >= MIN_CLUSTERS else np.nan

        def rates(first: int, own: int = own, dispersion: float = dispersion) -> dict[str, Rate]:
            return {
                measure: n_test(
                    int(numbers[own]),
                    amounts[own][measure],
                    int(numbers[first:own].sum()),
                    float(sum(one[measure] for one in amounts[first:own])),
                    dispersion,
                )
                for measure in MEASURES
            }

        potency = float(record.potency[period == own].sum())
        rows.append(StepRates(amounts[own], int(numbers[own]), potency, rates(0), rates(max(own - 1, 0))))
    return rows


def n_test(number: int, amount: float, earlier: int, earlier_amount: float, dispersion: float = 1.0) -> Rate:
    """The number expected of an amount (metres, days) after an earlier number of an earlier amount, and the chance of
    one as far from it: the N test of forecasts (Zechar et al. 2010), which here includes the chance of both numbers.

    dispersion: dispersion index of both numbers; NaN: there are too few independent clusters, and no p-value.
    """
    if not (earlier_amount > 0.0 and amount > 0.0 and earlier > 0):
        return Rate(np.nan, np.nan)
    scale = amount / earlier_amount
    if not np.isfinite(dispersion):
        return Rate(earlier * scale, np.nan)
    ratio = total_ratio(Total(float(number), dispersion), Total(earlier * scale, dispersion * scale))
    return Rate(earlier * scale, ratio.p_value)


def _amount(face: Face | None, start: np.datetime64, end: np.datetime64) -> dict[str, float]:
    days = float((end - start) / DAY)
    if face is None:
        return {"metres": np.nan, "days": days}
    return {"metres": face.metres(start, end), "days": days * len(times_with_face(face, start, end)) / TIMES_IN_STEP}


@dataclass(frozen=True)
class Months:
    """Maps, alarms and rates of the dated steps, and the mean gains of the maps under other assumptions (nuisances).

    numbers, potencies: of the steps, forecast by laws of modelled measures and by simpler rules; laws: of the number by
    all steps, by label of the measure; drive_alerts: alarms by metres of drives, None without drives; amounts: measures
    (step,) of the recorded part of each step, by label; recorded_potency (step,): m3.
    """

    steps: tuple[str, ...]
    maps: MonthMaps
    scores: MapScores
    alerts: AlertScores
    drive_alerts: AlertScores | None
    rates: list[StepRates]
    nuisances: list[tuple[str, NDArray]]
    numbers: NumberScores
    potencies: NumberScores
    laws: dict[str, RateLaw]
    amounts: dict[str, NDArray]
    recorded_potency: NDArray

    def expected_number(self, step: int) -> float:
        """Events expected of a step: the mean of the laws of all measures together, by earlier steps.

        Before there are enough, those of all earlier steps by metres of the face if there is one, else by days.
        """
        forecast = self.numbers.forecasts[ALL_LAWS][step]
        law = np.nan if forecast is None else forecast.mean_number
        rates = [rate.expected for rate in self.rates[step].all_earlier.values()]
        return next((value for value in (law, *rates) if np.isfinite(value)), np.nan)


def compare_with_months(
    models: ModelComparison,
    earlier: xr.Dataset,
    cell: float,
    settings: BaselineReportSlice,
    measures: Mapping[str, NDArray] | None = None,
    drives: DriveMetres | None = None,
) -> Months:
    """Compare the dated steps with maps and rates of the months before them.

    earlier: the record from an earlier date on, or the record itself; cell: edge of the finest cells, m; measures:
    modelled ones of the whole steps (step,), by label; drives: None for a mine without any.
    """
    own = models.models[0].comparison
    exposure = Exposure.of(settings.comparison.steps, common_period(models.record))
    used, cut, cluster = own["record_used"].values == 1, float(own["cut"]), models.scores.cluster
    if settings.complete_above is not None:
        cut = float(np.log10(settings.complete_above))
        used, cluster = _recorded_from(models.record, exposure, cut)
        if not used.any():
            raise InputError(
                f"baselines.complete_above: no recorded event of the dated steps has {settings.complete_above:g} m3 or "
                "more; give a smaller one"
            )
    counted = (earlier["resolved"].values == 1) & (log_potency(earlier["potency"].values) >= cut)
    common = common_period(earlier) if settings.since else None
    face = Face.of(settings.comparison.face) if settings.comparison.face else None
    maps = MonthMaps(
        _places(models.record, used),
        exposure.step(models.record["time"].values)[used],
        cluster,
        np.hypot(location_errors(models.record)[used], cell) / np.sqrt(3.0),
        _places(earlier, counted),
        Periods.of(exposure.start, exposure.end, np.datetime64(common[0], "ns") if common else None),
        face,
        np.array(settings.box),
        {model.label: model.counted for model in models.models},
    ).with_learned_priors()
    rates = step_rates(maps.record, maps.periods, face)
    start, end = np.array([window(one.model_dump()) for one in settings.comparison.steps]).T
    recorded = RecordedSteps.of(maps.record, maps.periods, (end - start) / DAY)
    amounts = {label: amount * recorded.share for label, amount in (measures or {}).items()}
    if face is not None:
        amounts = {METRES.label: np.array([row.amount["metres"] for row in rates])} | amounts
    rules = control_rules(recorded, face, maps.periods)
    return Months(
        models.steps,
        maps,
        maps.scores(),
        find_alerts(maps),
        find_drive_alerts(maps, drives),
        rates,
        nuisances(maps),
        score_numbers(recorded, amounts, rules),
        score_potency(recorded, amounts, rules),
        laws_of_all(recorded, amounts),
        amounts,
        recorded.potency,
    )


def _recorded_from(record: xr.Dataset, exposure: Exposure, cut: float) -> tuple[NDArray, NDArray]:
    """Recorded events from a cut on in the dated steps (event,) bool, log10 m3, and the clusters of these."""
    time = record["time"].values
    step = exposure.step(time)
    known = (record["resolved"].values == 1) & (step >= 0)
    used = known & (log_potency(record["potency"].values) >= cut)
    return used, coarser_clusters(record_clusters(record, known, step)[used], time[used])


def _places(events: xr.Dataset, chosen: NDArray) -> Places:
    """The events that `chosen` (event,) bool marks, in plan."""
    time = events["time"].values.astype("datetime64[ns]")
    return Places(time[chosen], events["location"].values[chosen][:, :2], events["potency"].values[chosen])
