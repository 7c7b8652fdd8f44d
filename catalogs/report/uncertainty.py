"""Sources of uncertainty of the modelled potency and of its ratio to the recorded one: each source as a factor, the
largest first; those not measured last, with what would measure them."""

from dataclasses import dataclass

import numpy as np

from catalogs.compare.blocks import MIN_BLOCKS
from catalogs.compare.grid_convergence import MIN_ERROR_SHARE
from catalogs.report.evidence import Evidence
from catalogs.report.sections.convergence import MAX_AT_ONCE_SHARE, MAX_ERROR_SHARE, cell_errors, increment_share
from catalogs.report.sections.warnings import Advice, finer_cells
from catalogs.report.text import number, percent
from catalogs.settings import ALL_STEPS

DEVIATIONS = 2.0  # Standard deviations: about 95 % of runs lie within so many of their mean.
MIN_FACTOR = 1.25  # A source with a smaller factor is not worth a run of its own.
ENSEMBLE = Advice("Run the mine several times with changes too small to measure:", "ensemble: 8")
SECOND_RUN = Advice("Run the mine a second time on larger cells:", "grid_convergence: true")


@dataclass(frozen=True)
class Source:
    """A source of uncertainty: its name, the factor within which it leaves potency (infinite: no factor can be given;
    NaN: not measured), a sentence on it, and what would measure it or make it smaller."""

    name: str
    factor: float
    text: str
    advice: Advice | None = None

    @property
    def matters(self) -> bool:
        """True if the source is worth acting on: its factor is at least MIN_FACTOR, infinite or not known (NaN)."""
        return not self.factor < MIN_FACTOR


def sources(evidence: Evidence) -> list[Source]:
    """All sources, the largest factor first, then those that were not measured; none without modelled events."""
    if evidence.catalog is None or not evidence.catalog.sizes["event"]:
        return []
    found = [_cells(evidence), *_record(evidence), _chance(evidence), _increments(evidence), _rock(evidence)]
    return sorted(found, key=lambda one: -one.factor if np.isfinite(one.factor) or one.factor == np.inf else 0.0)


def _cells(evidence: Evidence) -> Source:
    """Uncertainty from the cell size, estimated to first order with a run on cells of twice the size."""
    errors, cell = cell_errors(evidence), float(evidence.grid.attrs["fine_cell"])
    if errors is None:
        advice = None if evidence.config.get("accuracy") == "draft" else SECOND_RUN
        return Source("Cells", np.nan, f"not measured for cells of {cell:g} m", advice)
    coarse = float(evidence.grid_convergence["cell"].values[1])
    if errors[0] > MAX_ERROR_SHARE:
        text = f"too large to give a factor: potency changes too much from cells of {coarse:g} m to {cell:g} m"
        return Source("Cells", np.inf, text, finer_cells(evidence))
    factor = 1.0 + errors[0]
    text = f"{_within(factor)}, from a second run on cells of {coarse:g} m in place of {cell:g} m"
    if errors[0] <= MIN_ERROR_SHARE:
        text = f"{_within(factor)} at most, which is the least that two runs can tell"
    return Source("Cells", factor, text, finer_cells(evidence))


def _record(evidence: Evidence) -> list[Source]:
    """Uncertainty of the record: the interval of its expected potency."""
    comparison = evidence.comparison
    if comparison is None:
        return []
    rate = float(comparison["potency_rate"].sel(catalogue="record"))
    low, high = comparison["potency_rate_interval"].values
    if not (np.isfinite([rate, high]).all() and low > 0 and rate > 0):
        return []
    factor = float(max(high / rate, rate / low))
    text = f"{_within(factor)}, since few events or clusters of them hold most of the recorded potency"
    return [Source("The record", factor, text)]


def _chance(evidence: Evidence) -> Source:
    """Chance in the model: the standard deviation between the runs of an ensemble."""
    runs = evidence.spread
    if runs is None:
        return Source("Chance in the model", np.nan, "not measured, since the model ran once", ENSEMBLE)
    members = int(runs.attrs["members"])
    mean, deviation, *_ = runs["potency_statistics"].sel(period=ALL_STEPS).values
    if members < MIN_BLOCKS or not mean > 0:
        return Source("Chance in the model", np.nan, f"not measured: {members} other runs are too few", ENSEMBLE)
    factor = 1.0 + DEVIATIONS * float(deviation / mean)
    return Source("Chance in the model", factor, f"{_within(factor)} between {members} equally valid runs")


def _increments(evidence: Evidence) -> Source:
    """Uncertainty from increments: overshoot, and rock that one increment brings to failure at once."""
    share, at_once = increment_share(evidence), float(evidence.catalog.attrs.get("at_once_share", 0.0))
    solver = evidence.config.get("solver", {})
    count, overshoot = int(solver.get("increments", 0)), float(solver.get("max_overshoot", np.nan))
    code = f"solver.increments: {2 * count}" if count else "solver.max_overshoot"
    code += f": {overshoot / 2:g}" if not count and np.isfinite(overshoot) else ""
    advice = Advice("Mine in smaller increments:", code)
    patches = f"; {percent(at_once)} of the potency is in events whose extent depends on the size of the increments"
    patches = patches if at_once > MAX_AT_ONCE_SHARE else ""
    if not np.isfinite(share):
        return Source("Increments of mining", np.nan, f"not known of this scheme{patches}", advice)
    return Source(
        "Increments of mining",
        1.0 + share,
        f"potency is too large by a factor of up to {_factor(1.0 + share)}{patches}",
        advice,
    )


def _rock(evidence: Evidence) -> Source:
    """Uncertainty of strength and stress, which this report knows as inputs only."""
    text = "taken as given; their influence is not measured here"
    if evidence.record is not None:
        text += "; a calibration finds those that fit the record"
    return Source("Rock properties and stress", np.nan, text)


def _within(factor: float) -> str:
    return f"within a factor of {_factor(factor)}"


def _factor(factor: float) -> str:
    return number(factor, 2)
