"""The comparison of sizes as variables of comparison.nc (their layout: catalogs.compare.layout), and their text."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import scipy  # imports its parts as they are used, which small stages would wait for
from numpy.typing import NDArray

from catalogs.compare.layout import CATALOGUES
from catalogs.settings import ComparisonSettings
from catalogs.sources import completeness, sizes
from catalogs.sources.significance import POWER_DEVIATIONS, TEST_LEVEL
from catalogs.sources.size_law import FEW, NONE, POWER, TRUNCATED, Law, find_law

LAW_RESAMPLINGS, LAW_SEED = 999, 1  # the verdict on the law depends on the sizes only, not on the comparison's seed
SIZE_BIN_WIDTH = 0.2  # Bins of log10 potency in plots: 0.13 of Mw, where 0.1 is usual.


@dataclass(frozen=True)
class Fit:
    """Sizes of one catalogue above a cut: the law they follow, b without an upper end and with one at the largest."""

    law: Law
    plain: sizes.BValue
    bounded: sizes.BValue

    @property
    def quoted(self) -> sizes.BValue | None:
        """b of the law that is not rejected; None if both are, or there is none.

        Few sizes of a law that ends one or two decades above the cut do not reject one without an end, whose b is then
        too large. Where it stands its interval holds that of the law with an end, too: the hull of both.
        """
        if self.law.name in (NONE, FEW) or not np.isfinite(self.plain.b):
            return None
        if self.law.name == TRUNCATED:
            return self.bounded if np.isfinite(self.bounded.b) else None
        if not np.isfinite(self.bounded.b):
            return self.plain
        lower, upper = min(self.plain.lower, self.bounded.lower), max(self.plain.upper, self.bounded.upper)
        return replace(self.plain, lower=lower, upper=upper)


def fit(x: NDArray, cut: float, bin_width: float, chosen: bool, settings: ComparisonSettings, number: int = 0) -> Fit:
    """The law of the sizes x (log10 P) at or above `cut`, of rounded sizes (bin_width) a bin's lower edge.

    chosen: the cut comes from these sizes, so that the intervals of b also hold those of resampled catalogues that
    choose their own (`completeness.interval`): the hull of both. number: of the catalogue, for the draws.
    """
    law = find_law(x, cut, bin_width, min(settings.resamplings, LAW_RESAMPLINGS), np.random.default_rng(LAW_SEED))
    generator = np.random.default_rng([settings.seed, 2, number])
    found = []
    for bound in (None, "largest"):
        value = sizes.estimate_b(x, cut + 0.5 * bin_width, bin_width, bound)
        if chosen and np.isfinite(value.b):
            drawn = completeness.interval(x, bin_width, bound is not None, settings.resamplings, generator)
            value = replace(
                value, lower=float(np.fmin(value.lower, drawn[0])), upper=float(np.fmax(value.upper, drawn[1]))
            )
        found.append(value)
    return Fit(law, *found)


def size_measures(
    x: list[NDArray], bins: list[float], cut: float, chosen: list[bool], settings: ComparisonSettings
) -> tuple[dict, dict]:
    """Laws and their b above the cut, b against the cut, their difference, and the counts for plots; attributes.

    x, bins, chosen: of each catalogue its sizes, the width of bins they are rounded to, whether the cut is its own.
    """
    fits = [
        fit(values, cut, width, own, settings, number)
        for number, (values, width, own) in enumerate(zip(x, bins, chosen, strict=True))
    ]
    plain, bounded = [one.plain for one in fits], [one.bounded for one in fits]
    difference = _difference(fits)
    grid = sizes.cut_grid(np.concatenate(x), completeness.SEARCH_BIN_WIDTH)
    table = [_by_cut(values, grid, width) for values, width in zip(x, bins, strict=True)]
    edges = sizes.cut_grid(np.concatenate(x), SIZE_BIN_WIDTH)
    counted = [sizes.counts(values, edges, SIZE_BIN_WIDTH) for values in x]
    stable = [completeness.completeness(values, width) for values, width in zip(x, bins, strict=True)]

    def column(values, name):
        return [getattr(value, name) for value in values]

    by_catalogue = {
        "b": column(plain, "b"),
        "b_error": column(plain, "error"),
        "b_magnitude": column(plain, "magnitude"),
        "a": [one.a - 0.5 * width * one.b for one, width in zip(plain, bins, strict=True)],  # from the bin's edge
        "b_truncated": column(bounded, "b"),
        "b_truncated_error": column(bounded, "error"),
        "power_law_p_value": [one.law.power_p_value for one in fits],
        "truncated_law_p_value": [one.law.truncated_p_value for one in fits],
        "size_rounding": bins,
        "largest_log_potency": [float(values.max()) if values.size else np.nan for values in x],
        "completeness_curvature": [
            completeness.fullest_bin(values, width) for values, width in zip(x, bins, strict=True)
        ],
        "completeness_stability": stable,
    }
    result: dict[str, Any] = {name: ("catalogue", np.array(values, float)) for name, values in by_catalogue.items()}
    quoted = [one.quoted if one.quoted and one.law.name == POWER else one.plain for one in fits]
    for name, values in (("b_interval", quoted), ("b_truncated_interval", bounded)):
        result[name] = (("catalogue", "interval"), [[value.lower, value.upper] for value in values])
    result |= {
        "b_difference": ((), difference.difference),
        "b_difference_error": ((), difference.error),
        "b_difference_interval": ("interval", [difference.lower, difference.upper]),
        "b_difference_p_value": ((), difference.p_value),
        "b_difference_noticed": ((), _noticed(fits)),
        "cut_log_potency": ("trial_cut", grid),
        "size_bin_lower": ("size_bin", edges),
        "incremental": (("catalogue", "size_bin"), np.array([one for one, _ in counted], np.int64)),
        "cumulative": (("catalogue", "size_bin"), np.array([all_ for _, all_ in counted], np.int64)),
        "events_by_cut": (
            ("catalogue", "trial_cut"),
            np.array([column(values, "events") for values in table], np.int64),
        ),
    }
    for name, key in (("b_by_cut", "b"), ("b_by_cut_error", "error")):
        result[name] = (("catalogue", "trial_cut"), np.array([column(values, key) for values in table], float))
    said = [_text(name, one, size) for name, one, size in zip(CATALOGUES, fits, stable, strict=True)]
    laws = {f"law_{name}": one.law.name for name, one in zip(CATALOGUES, fits, strict=True)}
    return result, {"size_text": ". ".join(said), **laws}


def _by_cut(x: NDArray, grid: NDArray, bin_width: float) -> list[sizes.BValue]:
    """b above each cut; of rounded sizes above the next bin's edge."""
    cuts = [completeness.next_edge(x, cut, bin_width) + 0.5 * bin_width for cut in grid]
    return sizes.b_by_cut(x, np.array(cuts), bin_width)


def _noticed(fits: list[Fit]) -> float:
    """Amount by which b must exceed the record's for the test of their difference to notice (`sources.significance`);
    NaN if one has no b. Errors are shares of b, so that the limit is one of the ratio."""
    if any(one.quoted is None for one in fits):
        return np.nan
    ends = any(one.law.name == TRUNCATED for one in fits)
    values = [one.bounded if ends else one.plain for one in fits]
    error = np.hypot(values[0].error / values[0].b, values[1].error / values[1].b)
    return float(abs(values[1].b) * np.expm1((scipy.stats.norm.isf(0.5 * TEST_LEVEL) + POWER_DEVIATIONS) * error))


def _difference(fits: list[Fit]) -> sizes.BDifference:
    """Difference of b of one law: with an upper end for both if either has one; NaN if one follows no law."""
    if any(one.quoted is None for one in fits):
        return sizes.BDifference(*[np.nan] * 5)
    ends = any(one.law.name == TRUNCATED for one in fits)
    return sizes.difference_b(*(one.bounded if ends else one.plain for one in fits))


def _text(name: str, one: Fit, stable: float) -> str:
    """Law and b of one catalogue as sentences."""
    value, law = one.plain, one.law
    if not np.isfinite(value.b) or law.name == FEW:
        few = value.events < sizes.MIN_EVENTS_FOR_B
        why = f", and {sizes.MIN_EVENTS_FOR_B} are needed" if few else " of one size"
        return f"The {name} has no b: it has {value.events} event{'s' * (value.events != 1)}{why}"
    complete = f"complete from log P = {stable:.1f} on" if np.isfinite(stable) else "of no stable completeness"
    power, bounded = _chance(law.power_p_value), _chance(law.truncated_p_value)
    if one.quoted is None and law.name == TRUNCATED:
        said = f"follow no power law ({power}) but one that ends at the largest event ({bounded}), and the others are "
        said += "too few or too alike for its b"
    elif one.quoted is None:
        said = f"follow neither a power law ({power}) nor one that ends at the largest event ({bounded}): no b is given"
    else:
        b = f"b = {one.quoted.b:.2f} ({one.quoted.lower:.2f} to {one.quoted.upper:.2f})"
        end = f". If the law ends at the largest event, b is {one.bounded.b:.2f}; the interval contains both values"
        said = f"follow a power law ({power}) with {b}{end if np.isfinite(one.bounded.b) else ''}"
        if law.name == TRUNCATED:
            end = f"one that ends at log P = {one.bounded.bound:.1f} ({bounded})"
            said = f"follow no power law ({power}) but {end}, with {b}"
    return f"The sizes of the {name} {said}. Its {value.events} events are {complete}"


def _chance(p_value: float) -> str:
    return f"p = {p_value:.3f}" if p_value >= 0.0005 else "p < 0.001"
