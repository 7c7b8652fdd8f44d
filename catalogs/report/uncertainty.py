"""Sources of uncertainty of the modelled potency and of its ratio to the recorded one: each source as a factor, the
largest first; those not measured last, with what would measure them."""

from dataclasses import dataclass

import numpy as np

from catalogs.compare.blocks import MIN_BLOCKS
from catalogs.report.cell_effects import cell_errors, increment_share
from catalogs.report.evidence import Evidence
from catalogs.report.sections.warnings import Advice, finer_cells
from catalogs.report.text import DASH, number, percent, whole
from catalogs.settings import ALL_STEPS
from catalogs.sources.sizes import log_potency

DEVIATIONS = 2.0  # Standard deviations: about 95 % of runs lie within so many of their mean.
MIN_FACTOR = 1.25  # A source with a smaller factor is not worth a run of its own.
CELLS, CHANCE, INCREMENTS, RULE = "Cells", "Chance in the model", "Increments of mining", "Event rule"
ENSEMBLE = Advice("Run the mine several times with changes too small to measure:", "ensemble: 8")
SECOND_RUN = Advice("Run the mine a second time on larger cells:", "grid_convergence: true")
LARGER_CELLS = Advice("Use two sizes of cells or more, so that a second run can have larger ones:", "grid: {levels: 2}")


@dataclass(frozen=True)
class Source:
    """A source of uncertainty: its name, the factor within which it leaves potency (infinite: no factor can be given;
    NaN: not measured), a sentence on it, and what would measure it or make it smaller.

    failed_rock, events: its figures for the volume of failed rock and for the number of events, as text; note: what
    its figures contain; key: what computes them, or makes them smaller.
    """

    name: str
    factor: float
    text: str
    advice: Advice | None = None
    failed_rock: str = DASH
    events: str = DASH
    note: str = ""
    key: str = ""

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
    """Uncertainty from the cells and from the place of walls in them."""
    errors, cell = cell_errors(evidence), float(evidence.grid.attrs["fine_cell"])
    note = "against much smaller cells; contains the chance by which runs of the study's mines differ"
    if errors is None:
        draft = evidence.config.get("accuracy") == "draft"
        text = f"not measured for cells of {cell:g} m" + (", since a draft has no second run" if draft else "")
        advice = LARGER_CELLS if evidence.grid.attrs["levels"] == 1 else SECOND_RUN
        return Source(CELLS, np.nan, text, None if draft else advice, note=note, key=advice.code)
    advice = finer_cells(evidence)
    failed = "too large" if errors[1] == np.inf else _either_way(errors[1])
    if errors[0] == np.inf:
        text = f"too large to give a factor: too few cells of {cell:g} m across the failed rock"
        return Source(CELLS, np.inf, text, advice, failed, note=note, key=advice.code)
    factor = 1.0 + errors[0]
    thickness = float(evidence.grid_convergence["thickness"].sel(period=ALL_STEPS)[0])
    text = f"{_within(factor)}: failed rock is {number(thickness, 2)} cells thick (volume over surface)"
    return Source(CELLS, factor, text, advice, failed, note=note, key=advice.code)


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
    return [
        Source("The record", factor, text, note="the expected potency of the record, not of the model", key="record")
    ]


def _chance(evidence: Evidence) -> Source:
    """Chance in the model: the standard deviation between the runs of an ensemble."""
    runs = evidence.spread
    note, key = "other runs of the same mine on the same cells", ENSEMBLE.code
    if runs is None:
        return Source(CHANCE, np.nan, "not measured, since the model ran once", ENSEMBLE, note=note, key=key)
    members = int(runs.attrs["members"])
    potency = deviation_share(evidence, "potency")
    if members < MIN_BLOCKS or not np.isfinite(potency):
        return Source(CHANCE, np.nan, f"not measured: {members} other runs are too few", ENSEMBLE, note=note, key=key)
    factor = 1.0 + DEVIATIONS * potency
    failed, events = (_either_way(DEVIATIONS * deviation_share(evidence, name)) for name in ("failed_volume", "events"))
    text = f"{_within(factor)} between {members} equally valid runs"
    return Source(CHANCE, factor, text, failed_rock=failed, events=events, note=note, key=key)


def deviation_share(evidence: Evidence, quantity: str) -> float:
    """Standard deviation over mean of a quantity of all dated steps over the runs of an ensemble; NaN without it."""
    name = f"{quantity}_statistics"
    if evidence.spread is None or name not in evidence.spread:
        return np.nan
    mean, deviation, *_ = evidence.spread[name].sel(period=ALL_STEPS).values
    return float(deviation / mean) if mean > 0 else np.nan


def _increments(evidence: Evidence) -> Source:
    """Uncertainty from increments: the overshoot of rock that fails in them."""
    share = increment_share(evidence)
    solver = evidence.config.get("solver", {})
    count, overshoot = int(solver.get("increments", 0)), float(solver.get("max_overshoot", np.nan))
    code = f"solver.increments: {2 * count}" if count else "solver.max_overshoot"
    code += f": {overshoot / 2:g}" if not count and np.isfinite(overshoot) else ""
    advice = Advice("Mine in smaller increments:", code)
    note = "one way: potency is too large, never too small"
    if not np.isfinite(share):
        return Source(INCREMENTS, np.nan, "not known of this scheme", advice, note=note, key=code)
    text = f"potency is too large by a factor of up to {_factor(1.0 + share)}"
    return Source(INCREMENTS, 1.0 + share, text, advice, note=note, key=code)


def event_rule(evidence: Evidence) -> list[Source]:
    """Rule that groups failed rock into events: the same rock by other rules; none where not known."""
    found = evidence.event_rules
    if found is None or not found.sizes["event"]:
        return []
    potency, rule, count = found["potency"].values, found["rule"].values, found.sizes["rules"]
    sums = np.bincount(rule, potency, minlength=count)
    events = np.bincount(rule, minlength=count)
    if not (sums > 0).all():
        return []
    factor = float(max(sums.max() / sums[0], sums[0] / sums.min()))
    largest = [log_potency(potency[rule == index]).max() for index in range(count)]
    note = f"events of enough particles; their largest log P is {number(min(largest), 2)} to {number(max(largest), 2)}"
    text = f"{_within(factor)}, if the same failed rock is grouped by other rules"
    keys = "seismic.closeness, seismic.link_length, solver.parts"
    return [
        Source(
            RULE,
            factor,
            text,
            events=f"{whole(events.min())} to {whole(events.max())} (here {whole(events[0])})",
            note=note,
            key=keys,
        )
    ]


def _rock(evidence: Evidence) -> Source:
    """Uncertainty of strength and stress, which this report knows as inputs only."""
    text = "taken as given; their influence is not measured here"
    if evidence.record is not None:
        text += "; a calibration finds those that fit the record"
    note = "what is not known of rock and stress, and how they vary in the mine"
    return Source("Rock properties and stress", np.nan, text, note=note, key="snakemake calibrate")


def _within(factor: float) -> str:
    return f"within a factor of {_factor(factor)}"


def _factor(factor: float) -> str:
    return number(factor, 2)


def _either_way(share: float) -> str:
    return f"± {percent(share)}" if np.isfinite(share) else DASH
