"""The stage: from the events of all runs to velocities, what makes them, and demands.

Layout of its result: shaking.layout.
"""

import json
import logging
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from catalogs.compare.exposure import DAY, window
from catalogs.compare.spread import read_members
from common.datasets import read_dataset
from common.errors import InputError
from common.event_table import read_events
from common.opening_table import SIDES
from shaking.events import RunEvents, dispersions, magnitude_edges
from shaking.fit import fitted_relation
from shaking.hazard import LOG_VELOCITIES, Shaking, disaggregate
from shaking.layout import new_shaking
from shaking.openings import Openings
from shaking.relations import SOURCES, GroundMotion, relation_of
from shaking.settings import FittedRelation, ShakingSlice
from shaking.support import demands, depth_source, read_depths

DISTANCE_EDGES = np.array([0.0, 5.0, 10.0, 20.0, 50.0, 100.0, 200.0, 500.0, np.inf])  # m
RECORD_VARIABLES = ("dispersion_index", "event_ratio")  # of comparison.nc
DEPTH_REMEDY = "give ground_motion.depth, in m"


def shaking_stage(
    given: Mapping,
    *,
    grid: Path,
    catalog: Path,
    members: Sequence[Path] = (),
    comparison: Path | None = None,
    failed_rock: Path | None = None,
) -> xr.Dataset:
    """Shaking of a mine from files; given: the stage's slice (ShakingSlice).

    members: folders of the runs of the ensemble; comparison: comparison.nc, for the clustering of the record;
    failed_rock: openings.nc, for the depth of sides that the mine file states none for. Raises InputError: files of
    another mine, a relation that fits none of the events, a demand without a depth.
    """
    settings = ShakingSlice.of(given)
    steps = [step.name for step in settings.steps]
    own = read_events(catalog)
    if own.attrs["mine"] != settings.mine:
        raise InputError(f"{catalog}: is of mine {own.attrs['mine']}, not of {settings.mine}")
    relation, fit_text = relation_and_text(settings)
    runs = read_members(members, steps, settings.mine)
    events = RunEvents.of_catalogues(relation.kind, own, runs, steps)
    record = read_dataset(comparison, RECORD_VARIABLES) if comparison else None
    depths = _failed_depths(settings, failed_rock)
    return find_shaking(settings, relation, events, read_dataset(grid), record, depths, fit_text)


def _failed_depths(settings: ShakingSlice, failed_rock: Path | None) -> NDArray | None:
    """Depths of failed rock (step, opening, side) m from openings.nc, if demands need them; None if none does."""
    if not settings.ground_motion.failed_depth:
        return None
    if failed_rock is None:
        raise InputError(f"ground_motion.displacement: no depth of failed rock is known; {DEPTH_REMEDY}")
    return read_depths(failed_rock, settings)


def plan_shaking_stage(
    given: Mapping,
    *,
    grid: Path,
    outcome: Path,
    comparison: Path | None = None,
    failed_rock: Path | None = None,
) -> xr.Dataset:
    """Shaking of a mining plan from its outcome.nc: events from the floor on, of its own run and of its members.

    given, grid, comparison, failed_rock: as in shaking_stage, of the plan. The moment of an event is its potency by the
    shear modulus of the host rock, as all magnitudes of plans. Raises InputError as shaking_stage.
    """
    settings = ShakingSlice.of(given)
    found = read_dataset(outcome)
    if found.attrs["mine"] != settings.mine:
        raise InputError(f"{outcome}: is of mine {found.attrs['mine']}, not of {settings.mine}")
    if list(found["step"].values) != [step.name for step in settings.steps]:
        raise InputError(f"{outcome}: has other steps than the plan; delete it and run again")
    relation, fit_text = relation_and_text(settings)
    counted = np.flatnonzero(~np.isnan(found["number"].values[:, 0, 0]))  # those like its own that stand
    run = np.searchsorted(counted, found["event_run"].values)
    potency = found["event_potency"].values
    events = RunEvents.of(
        relation.kind, found["event_step"].values, run, len(counted), len(settings.steps),
        found["event_location"].values, potency, float(found.attrs["shear_modulus"]) * potency,
    )  # fmt: skip
    record = read_dataset(comparison, RECORD_VARIABLES) if comparison else None
    depths = _failed_depths(settings, failed_rock)
    return find_shaking(settings, relation, events, read_dataset(grid), record, depths, fit_text)


def relation_and_text(settings: ShakingSlice) -> tuple[GroundMotion, str]:
    """The relation of a mine, and a sentence on its fit, empty where nothing is fitted."""
    given = settings.ground_motion.relation
    if not isinstance(given, FittedRelation):
        return relation_of(settings.ground_motion), ""
    fitted, fit = fitted_relation(given, settings.ground_motion.largest or np.inf)
    return fitted, fit.text


def find_shaking(
    settings: ShakingSlice,
    relation: GroundMotion,
    events: RunEvents,
    grid: xr.Dataset,
    record: xr.Dataset | None = None,
    depths: NDArray | None = None,
    fit_text: str = "",
) -> xr.Dataset:
    """Shaking from events; arguments as in shaking_stage, and the record's comparison.

    depths (step, opening, side) m: of failed rock, in the order of the slice; without them sides that the mine file
    states no depth for have no demand.
    """
    openings = Openings.of(grid, settings.openings, settings.steps)
    relation.check_range(events.size)
    dispersion, of_runs = dispersions(events.number, record)
    chances = np.array(settings.ground_motion.chances)
    shape = (len(settings.steps), len(openings.names))
    values = _empty(shape, len(chances))
    values["magnitude_edge"] = magnitude_edges(events.magnitude)
    values["distance_edge"] = DISTANCE_EDGES
    values["share"] = np.full(
        (*shape, len(chances), len(values["magnitude_edge"]) - 1, len(DISTANCE_EDGES) - 1), np.nan
    )
    mean = events.number.mean(axis=0)
    of_step = [np.flatnonzero(events.step == step) for step in range(shape[0])]
    for opening in range(shape[1]):
        first = max(int(openings.mined[opening]), 0)
        later = np.flatnonzero(events.step >= first)
        distance = np.full(len(events.step), np.nan)
        distance[later] = openings.distances(opening, events.location[later])
        strongest = _strongest(relation, events.size, distance[later])
        for step in range(first, shape[0]):
            own = of_step[step]
            shaking = Shaking(
                relation.log_median(events.size[own], distance[own]),
                relation.deviation(events.size[own], distance[own]),
                len(events.number),
                float(mean[step]),
                dispersion,
                of_runs,
                relation.log_largest,
                strongest,
            )
            _fill(values, (step, opening), shaking, chances, events, own, distance[own], relation)
            values["filled"][step, opening] = openings.is_filled(step)[opening]
    values |= demands(settings, values, openings.names, depths)
    windows = [window(step.model_dump()) for step in settings.steps]
    values |= {
        "days": np.array([(end - start) / DAY for start, end in windows]),
        "expected_events": mean,
        "step": [step.name for step in settings.steps],
        "opening": openings.names,
        "side": list(SIDES),
        "chance": chances,
        "interval": ["lower", "upper"],
        "velocity_of_curve": 10.0**LOG_VELOCITIES,
    }
    logging.info("%d openings, %d events of %d runs", len(openings.names), len(events.step), len(events.number))
    displacement = settings.ground_motion.displacement
    return new_shaking(
        values,
        {
            "mine": settings.mine,
            "relation": relation.name,
            "relation_text": relation.text,
            "source": SOURCES[relation.name],
            "fit_text": fit_text,
            "runs": len(events.number),
            "dispersion": dispersion,
            "run_dispersion": of_runs,
            "event_ratio": np.nan if record is None else float(record["event_ratio"]),
            "displacement": np.nan if displacement is None else displacement / 1e3,
            "density": settings.density,
            "depth_source": depth_source(settings, depths),
            "support": json.dumps([one.model_dump() for one in settings.support]),
        },
    )


def _strongest(relation: GroundMotion, size: NDArray, distance: NDArray) -> tuple[float, float] | None:
    """Median and deviation of log10 of the velocity of an event of the largest size (event,) at the least distance (k,)
    m; None without an event since the opening is mined."""
    if not len(distance):
        return None
    at = size.max(), distance.min()
    return float(relation.log_median(*at)), float(relation.deviation(*at))


def _empty(shape: tuple[int, int], chances: int) -> dict[str, Any]:
    """Variables of shaking.layout for openings that are not mined yet."""
    names = ("velocity", "magnitude", "distance", "top_share", "top_magnitude", "top_distance", "outside_share")
    values: dict[str, Any] = {name: np.full((*shape, chances), np.nan) for name in names}
    values["velocity_interval"] = np.full((*shape, chances, 2), np.nan)
    values["top_location"] = np.full((*shape, chances, 3), np.nan)
    values["curve"] = np.full((*shape, len(LOG_VELOCITIES)), np.nan)
    values["filled"] = np.full(shape, -1, np.int8)
    return values


def _fill(
    values: dict[str, Any],
    place: tuple[int, int],
    shaking: Shaking,
    chances: NDArray,
    events: RunEvents,
    own: NDArray,
    distance: NDArray,
    relation: GroundMotion,
) -> None:
    """Write what an opening feels in a step, in place; own (k,): indices of the step's events, distance (k,) m."""
    found = shaking.velocity(chances)
    values["velocity"][place], values["velocity_interval"][place] = found[:, 0], found[:, 1:]
    values["curve"][place] = shaking.chance(shaking.rates(LOG_VELOCITIES)[:, 0])
    edges = values["magnitude_edge"], DISTANCE_EDGES
    magnitude, outside = events.magnitude[own], relation.is_outside(events.size[own], distance)
    for number, velocity in enumerate(found[:, 0]):
        if not velocity > 0.0:
            continue
        weight = shaking.weights(np.log10(velocity))
        total = weight.sum()
        if not total > 0.0:  # at the largest velocity, which none exceeds
            weight, total = np.ones(len(own)), float(len(own))
        share, top = weight / total, int(weight.argmax())
        at = (*place, number)
        values["magnitude"][at], values["distance"][at] = share @ magnitude, share @ distance
        values["top_share"][at], values["top_magnitude"][at] = share[top], magnitude[top]
        values["top_distance"][at], values["top_location"][at] = distance[top], events.location[own[top]]
        values["outside_share"][at] = share @ outside
        values["share"][at] = disaggregate(weight, magnitude, distance, edges)
