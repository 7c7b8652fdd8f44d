"""Number and potency of both catalogues and their ratios as variables of comparison.nc, and their words.

Layout: catalogs.compare.layout; statistics: catalogs.compare.exposure.
"""

from collections.abc import Sequence

import numpy as np
import scipy
import xarray as xr
from numpy.typing import NDArray

from catalogs.compare.exposure import Exposure, Total, noticed_ratio, total_interval, total_ratio
from catalogs.sources.jackknife import INTERVAL_95
from catalogs.sources.sizes import log_potency

MIN_RUNS_FOR_VARIANCE = 5  # Runs of the model that a variance between them needs: four degrees of freedom.
MIN_EQUAL_EVENTS = 4.0  # A sum that is worth fewer equal events depends on one or two of its events.
LARGE_SHARE = 0.9  # Share of all potency by which the few events are counted that it rests on.
MIN_SCALE_SHARE = 1e-6  # Smallest scale, as a share of the total, where all runs of the model agree.


def sum_measures(
    both, used, members: Sequence[xr.Dataset], clusters: NDArray, cut: float, exposure: Exposure
) -> tuple[dict, dict[str, str]]:
    """Counts and summed potency, per day of exposure, their ratios with intervals and tests; and a sentence or two.

    both: (catalogue, record), used: which events of each count (event,); members: the model's other runs, of which
    events from `cut` (log10 m3) on count; clusters: of recorded events (event,), found by `compare.blocks`, -1
    for those that are in none. With
    MIN_RUNS_FOR_VARIANCE runs or more the model is their mean, its chance what they differ by; else its events are
    taken to be as clustered as the record's. These are as clustered as the clusters or their times say, whichever is
    more.
    """
    potency = [events["potency"].values[kept] for events, kept in zip(both, used, strict=True)]
    number = [float(len(values)) for values in potency]
    summed = [float(values.sum()) for values in potency]
    whole = [float(np.nansum(events["potency"].values)) for events in both]
    known = clusters >= 0
    dispersion_index = exposure.dispersion_index(both[1]["time"].values[known], clusters[known], used[1][known])
    runs = [potency[0], *(_counted(member, cut, exposure) for member in members)]
    runs = runs if len(runs) >= MIN_RUNS_FOR_VARIANCE else runs[:1]

    ones = [np.ones_like(values) for values in potency]
    totals = _of_runs(runs, np.ones_like, dispersion_index), Total(number[1], dispersion_index)
    counted, counted_noticed = total_ratio(*totals), noticed_ratio(*totals)
    # of all runs and the record: the few events of one say little of the scale of its sizes
    every = np.concatenate([*runs, potency[1]])
    scale = float(np.sum(every**2) / every.sum()) if every.size else np.nan
    own = max(scale, float(np.sum(potency[1] ** 2)) / summed[1]) if summed[1] else scale
    by_clusters = potency_variance_factor(potency[1], dispersion_index)
    modelled = potency_variance_factor(potency[0], dispersion_index)
    totals = _of_runs(runs, np.asarray, scale, modelled), Total(summed[1], own * by_clusters)
    released, released_noticed = total_ratio(*totals), noticed_ratio(*totals)
    intervals = [total_interval(ones[1], dispersion_index, 1.0), total_interval(potency[1], by_clusters)]
    days = exposure.days
    variables = {
        "events_above_cut": ("catalogue", np.array(number, np.int64)),
        "exposure": ((), days),
        "event_rate": ("catalogue", np.array(number) / days),
        "potency_rate": ("catalogue", np.array(summed) / days),
        "event_rate_interval": ("interval", intervals[0] / days),
        "potency_rate_interval": ("interval", intervals[1] / days),
        "dispersion_index": ((), dispersion_index),
        "model_runs": ((), np.int64(len(runs))),
        "event_ratio": ((), counted.value),
        "event_ratio_interval": ("interval", counted.interval),
        "event_ratio_p_value": ((), counted.p_value),
        "event_ratio_noticed": ((), counted_noticed),
        "summed_potency": ("catalogue", summed),
        "summed_potency_all": ("catalogue", whole),
        "potency_ratio": ((), released.value),
        "potency_ratio_all": ((), whole[0] / whole[1] if whole[1] > 0 else np.nan),
        "potency_ratio_interval": ("interval", released.interval),
        "potency_ratio_p_value": ((), released.p_value),
        "potency_ratio_noticed": ((), released_noticed),
        **_few_large(runs, potency[1]),
    }
    return variables, {"sums_text": _text(potency, runs, intervals[0], counted, dispersion_index, days)}


def potency_variance_factor(potency: NDArray, dispersion_index: float) -> float:
    """Factor by which clusters raise the variance of summed potency (event,), if sizes do not depend on the cluster."""
    if not len(potency):
        return 1.0
    worth = potency.sum() ** 2 / np.sum(potency**2)
    return 1.0 + (dispersion_index - 1.0) * worth / len(potency)


def _counted(member: xr.Dataset, cut: float, exposure: Exposure) -> NDArray:
    """Potency (m3) of the member's resolved events from the cut on in the time compared."""
    potency = member["potency"].values
    kept = (member["resolved"].values == 1) & (exposure.step(member["time"].values) >= 0)
    return potency[kept & (log_potency(potency) >= cut)]


def _few_large(runs: list[NDArray], record: NDArray) -> dict:
    """Number of largest events that hold LARGE_SHARE of a catalogue's potency, the model's of all runs, and the ratio
    of potencies without those of either."""
    model = np.concatenate(runs)
    counts, ratios = [], []
    for number, potency in enumerate((model, record)):
        ordered = -np.sort(-potency)
        total = ordered.sum()
        count = int(np.searchsorted(np.cumsum(ordered), LARGE_SHARE * total) + 1) if total > 0.0 else 0
        others = float(ordered[count:].sum())
        first, second = (others, record.sum()) if number == 0 else (model.sum(), others)
        counts.append(count)
        ratios.append(first / len(runs) / second if second > 0.0 else np.nan)
    return {
        "large_events": ("catalogue", np.array(counts, np.int64)),
        "potency_ratio_without_large": ("catalogue", np.array(ratios)),
    }


def _of_runs(runs: list[NDArray], weight, scale: float, by_clusters: float = 1.0) -> Total:
    """Mean total of the runs, each weight(potency) summed; scale, by_clusters: as in `mean_total`."""
    sums, squares = ([float((weight(run) ** power).sum()) for run in runs] for power in (1, 2))
    return mean_total(np.array(sums), np.array(squares), scale, by_clusters)


def mean_total(sums: NDArray, squares: NDArray, scale: float, by_clusters: float = 1.0) -> Total:
    """Mean of sums over events (run,), and its scale: from their variance if there are MIN_RUNS_FOR_VARIANCE runs, else
    as of events: `scale`, or that of their own if it is larger, times the factor by which clusters raise it.

    squares (run,): sums of the squares of what is summed.
    """
    mean = sums.mean()
    if len(sums) < MIN_RUNS_FOR_VARIANCE or not mean:
        own = float(squares.sum() / sums.sum()) if mean else 0.0
        return Total(mean, by_clusters * max(scale, own) / len(sums))
    stretch = scipy.stats.t.ppf(INTERVAL_95[1], len(sums) - 1) / scipy.stats.norm.ppf(INTERVAL_95[1])
    return Total(mean, max(stretch**2 * sums.var(ddof=1) / len(sums) / mean, MIN_SCALE_SHARE * mean))


def _text(potency, runs, interval, counted, dispersion_index: float, days: float) -> str:
    """Sentences on the expected number of recorded events, the number of modelled ones, the p-value of their difference
    and the assumptions of the intervals, without the last full stop."""
    model, record = len(runs[0]), len(potency[1])
    made = f"{model}" if len(runs) == 1 else f"{np.mean([len(run) for run in runs]):.1f} (mean of {len(runs)} runs)"
    when = f" in {days:.3g} days" if np.isfinite(days) else ""
    said = f"the record has {record} event{'s' * (record > 1)}{when}. The expected number of recorded events is "
    said += f"{interval[0]:.3g} to {interval[1]:.3g} (95 %)"
    if not record:
        said = f"the record has no event{when}. The expected number of recorded events is less than "
        said += f"{interval[1]:.3g} (95 %)"
    if dispersion_index > 1.0 and record:
        said += f"; events come in clusters, which raises the variance of their number {dispersion_index:.2g} times"
    said += f". The model makes {made}"
    if np.isfinite(counted.p_value):
        said += f"; p = {counted.p_value:.2g}" if counted.p_value >= 5e-4 else "; p < 0.001"
        said += " if both expected numbers are equal"
    said += ". "
    if record:
        largest = [float(np.log10(values.max())) for values in (potency[1], np.concatenate(potency))]
        said += (
            f"Intervals of potency hold for events up to the largest one, of log P = {largest[0]:.2f} in the record "
            f"and {largest[1]:.2f} in both, since a power law without an upper end has no mean where its b is below 1"
        )
        worth = potency[1].sum() ** 2 / np.sum(potency[1] ** 2)
        said += (
            f". The record's potency varies like that of {worth:.1f} equal events" if worth < MIN_EQUAL_EVENTS else ""
        )
        said += ". "
    chance = (
        "The events of the model are assumed to be as clustered as those of the record. An ensemble of "
        f"{MIN_RUNS_FOR_VARIANCE - 1} members or more would measure how far runs differ"
    )
    if len(runs) > 1:
        chance = f"The chance of the model is estimated from the differences between its {len(runs)} runs"
    return said + chance
