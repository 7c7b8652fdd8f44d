"""The catalogues of a study by source of their spread: perturbed members, ways of loading, cells, closeness.

The catalogues of a source differ in it alone. The mine's own run is one of each source, except that members are the
perturbed runs only.
"""

import json
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import xarray as xr

from catalogs.compare.size_measures import fit
from catalogs.settings import ComparisonSettings
from catalogs.sources.size_law import FEW, POWER
from catalogs.sources.sizes import above, log_potency
from common.errors import InputError
from seismic.events import extract_events
from verification.results import Results, Variant
from verification.tradeoff.knobs import BY_KEY

MEMBERS, LOADING, CELLS, CLOSENESS = "members", "loading", "cells", "closeness"
SOURCES = {
    MEMBERS: "perturbed members",
    LOADING: "way of loading",
    CELLS: "finest cell",
    CLOSENESS: "closeness",
}
KNOB_OF = {LOADING: "increments", CELLS: "cell"}


@dataclass(frozen=True)
class Quantity:
    """A number of a catalogue whose variance is taken."""

    key: str
    title: str
    of: Callable[["Catalogue"], float]


@dataclass(frozen=True)
class Catalogue:
    """The events of a run's last step. label: how the run differs from others of its source.

    potency: sum over all failed rock, m3. sizes: log10 potency (m3) of each resolved event. cut: log10 of the smallest
    potency (m3) that can be resolved. law: of the sizes above the cut (size_law). b: of a power law, NaN where they
    follow none. seconds: processor time of the mining steps and their events without compiling, NaN where unknown.
    """

    label: str
    potency: float
    sizes: list[float]
    cut: float
    law: str
    b: float
    seconds: float = np.nan


def _mean_excess(run: Catalogue) -> float:
    sizes = above(np.array(run.sizes), run.cut)
    return float(np.mean(sizes - run.cut)) if len(sizes) else np.nan


QUANTITIES = (
    Quantity("potency", "log10 seismic potency", lambda run: float(log_potency(run.potency))),
    Quantity("events", "log10 number of resolved events", lambda run: float(np.log10(len(run.sizes) or np.nan))),
    Quantity("b", "b of log potency", lambda run: run.b),
    Quantity("size", "mean log10 P above the smallest", _mean_excess),
    Quantity("largest", "largest event, log10 P", lambda run: max(run.sizes, default=np.nan)),
)


def catalogue(label: str, events: xr.Dataset, settings: ComparisonSettings, seconds: float = np.nan) -> Catalogue:
    """Catalogue of a dataset of events. b is given only where a power law without an upper end fits the sizes."""
    sizes = log_potency(events.potency.values[events.resolved.values == 1])
    cut = float(log_potency(events.attrs["potency_floor"]))
    found = fit(sizes, cut, 0.0, False, settings)
    few = found.law.name == FEW or not np.isfinite(found.plain.b)
    return Catalogue(
        label=label,
        potency=float(json.loads(events.attrs["budget"])["particle_scalars"]),
        sizes=sizes.tolist(),
        cut=cut,
        law=FEW if few else found.law.name,
        b=found.plain.b if found.law.name == POWER and not few else np.nan,
        seconds=seconds,
    )


def read_sources(results: Results) -> dict[str, list[Catalogue]]:
    """Catalogues of each source. Raises InputError where the study names an unknown variant or has no members."""
    chosen, name = results.settings, results.study.name
    for variant in [chosen["base"], *chosen[LOADING], *chosen[CELLS]]:
        if variant not in results.variants:
            raise InputError(f"{name}: settings: no variant '{variant}'; there are {', '.join(results.variants)}")
    base = results[chosen["base"]]
    if base.mine.members < 2:
        raise InputError(f"{name}: variants.{chosen['base']}.ensemble: a variance takes two members or more")
    found = {MEMBERS: [_read(base, f"{number}", number) for number in range(1, base.mine.members + 1)]}
    for source, key in KNOB_OF.items():
        knob = BY_KEY[key]
        variants = [results[variant] for variant in chosen[source]]
        found[source] = [_read(variant, knob.text(knob.of(variant.mine.settings))) for variant in variants]
    found[CLOSENESS] = [_with_closeness(base, value) for value in chosen[CLOSENESS]]
    return found


def read_base(results: Results) -> Catalogue:
    """The mine's own run."""
    return _read(results[results.settings["base"]], "base")


def _read(variant: Variant, label: str, member: int = 0) -> Catalogue:
    """The run of a variant, or of a member of its ensemble."""
    folder, last = f"ensemble/{member}/" if member else "", variant.step_names[-1]
    stages = [*(f"{folder}steps/{step}" for step in variant.step_names), f"{folder}events"]
    seconds = float(variant.processor_times(stages).sum())
    return catalogue(label, variant.read(f"{folder}events/{last}.nc"), _settings(variant), seconds)


def _with_closeness(variant: Variant, closeness: float) -> Catalogue:
    """The rock of a variant's own run, its events counted at another closeness."""
    step = variant.step_names[-1]
    events = extract_events(
        variant.read(f"steps/{step}.nc"), variant.mine.step_events_slice(step) | {"closeness": closeness}
    )
    return catalogue(f"{closeness:g}", events[0], _settings(variant))


def _settings(variant: Variant) -> ComparisonSettings:
    return variant.mine.settings.comparison
