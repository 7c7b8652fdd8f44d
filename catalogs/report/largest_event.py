"""The largest event to expect: how far chance alone moves it, from an ensemble or from the law of sizes."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from catalogs.compare.blocks import MIN_BLOCKS
from catalogs.compare.size_measures import fit
from catalogs.compare.spread import SPREAD_BIN_WIDTH
from catalogs.report.inputs import Evidence
from catalogs.settings import ComparisonSettings
from catalogs.sources.jackknife import INTERVAL_95
from catalogs.sources.size_law import POWER
from catalogs.sources.sizes import log_potency


def largest_of(events: int, b: float, cut: float, share: ArrayLike, end: float = np.inf) -> NDArray:
    """log10 potency below which the largest of so many independent events of a power law lies with these chances.

    N(>= P) falls as P^-b from the cut to the end of the law (log10 m3), so that an event is below x with
    F(x) = (1 - 10^(-b (x - cut))) / (1 - 10^(-b (end - cut))), and the largest with F(x)^events.
    """
    beyond = 10.0 ** (-b * (end - cut))
    above = -np.expm1(np.log(np.asarray(share, float)) / events)  # 1 - F
    return cut - np.log10(above * (1.0 - beyond) + beyond) / b


def expected_range(evidence: Evidence) -> tuple[NDArray, str] | None:
    """log10 potency (lower, upper) between which the largest modelled event may lie by chance, and words for it.

    Of an ensemble the range of its runs; of one run the 95 % interval of the law of sizes, if they follow a power law:
    nothing says where it ends, but no event is larger than all that the model releases. None where neither is known.
    """
    runs = evidence.spread
    if runs is not None and int(runs.attrs["members"]) >= MIN_BLOCKS and runs.sizes["size_bin"]:
        filled = runs["cumulative"].values > 0
        middle = runs["size_bin_lower"].values + SPREAD_BIN_WIDTH / 2
        largest = np.where(filled, middle, -np.inf).max(axis=1)
        if np.isfinite(largest).all():
            return np.array(
                [largest.min(), largest.max()]
            ), f"In {len(largest)} equally valid runs the largest event has"
    law = _law(evidence)
    if law is None:
        return None
    events, b, cut = law
    end = float(np.log10(evidence.catalog["potency"].values.sum()))
    if not end > cut:
        return None
    return largest_of(events, b, cut, INTERVAL_95, end), (
        "If no event is larger than all potency that the model releases, chance alone (95 %) puts the largest event at"
    )


def _law(evidence: Evidence) -> tuple[int, float, float] | None:
    """Number of modelled events above the cut, b and the cut (log10 m3) of a power law; None where they follow none."""
    comparison = evidence.comparison
    if comparison is not None:
        if comparison.attrs["law_model"] != POWER:
            return None
        here = comparison.sel(catalogue="model")
        return int(here["events_above_cut"]), float(here["b"]), float(comparison["cut"])
    floor = float(evidence.catalog.attrs["potency_floor"])
    if not floor > 0:
        return None
    sizes, cut = log_potency(evidence.resolved["potency"].values), float(np.log10(floor))
    found = fit(sizes[np.isfinite(sizes)], cut, 0.0, False, ComparisonSettings())
    return None if found.law.name != POWER else (found.plain.events, found.plain.b, cut)
