"""Seismic events of one mining step, from the plastic strain of its failed particles.

Paper, section 3; docs/explanation/method.md says which paper.

`sizes_by_closeness` shows what two choices of the extraction change: the closeness above which mechanisms are similar,
and the cells that count as touching.
"""

import json
import logging
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from common.errors import InputError
from common.event_table import ON_PLANES, UNDATED, event_dataset
from common.modelled_events import describe_sources, spread_in_time
from common.part_centers import part_centers
from common.source_tensors import moment_from_potency, scalar_potency
from common.voigt import tensor_from_voigt
from seismic.budget import log_budget, potency_budget
from seismic.clusters import find_clusters
from seismic.event_settings import EventSettings
from seismic.families import closeness, find_families
from seismic.regions import CORNERS, EDGES, FACES, find_regions

STRAIN_VARIABLES = {
    "seismic": "seismic_strain",
    "overshoot": "overshoot_strain",
    "later": "later_strain",
    "plastic": "plastic_strain_step",
}
ROCK_VARIABLES = (STRAIN_VARIABLES["seismic"], "position", "spacing", "volume", "failed", "failure_order")
STEP_VARIABLES = (*STRAIN_VARIABLES.values(), *ROCK_VARIABLES[1:], "material")
STEP_ATTRIBUTES = ("mine", "step", "step_index", "lame_lambda", "shear_modulus")
MATERIAL_ATTRIBUTES = ("material_names", "elastic_moduli")
# Share of a strain that may deform planes within themselves while it counts as slip along them.
MAX_IN_PLANE_SHARE = 1e-6
LABEL_ATTRIBUTES = ("truncated", "truncated_share", "truncated_where")
CLOSENESS_TRIED = (0.6, 0.7, 0.8, 0.9, 0.95)


@dataclass(frozen=True)
class FailedRock:
    """The particles that a step's events consist of: those that failed in it with a drop, (k,).

    where: name of the step for messages; source (k,): their index in the step, potency (k, 6) m3, center (k, 3) m of
    the part of the cell that is theirs, spacing (k,) m, order (k, 2): increment and generation of their failure.
    """

    where: str
    source: NDArray
    potency: NDArray
    center: NDArray
    spacing: NDArray
    order: NDArray

    def events(self, settings: EventSettings, reach: int = CORNERS) -> tuple[NDArray, NDArray]:
        """Event of each particle, (k,), and which events are resolved, (event,) bool, in the order in which they begin.

        reach: over what regions are linked (seismic.regions).
        """
        label, resolved = find_events(self.center, self.spacing, self.potency, self.order, settings, reach)
        rank = _rank_events(self.order, label, len(resolved))
        return rank[label], resolved[np.argsort(rank)]


def failed_rock(step: xr.Dataset, settings: EventSettings, needed: tuple[str, ...] = ROCK_VARIABLES) -> FailedRock:
    """Failed rock of a step with the variables needed, as extract_events takes it. Raises InputError if it lacks
    something or contradicts itself."""
    where = _check_step(step, settings, needed)
    strained, (strain,), volume = _strained(step, where, STRAIN_VARIABLES["seismic"])
    potency = particle_potency(strain, volume, settings.seismic_fraction)
    breaks = np.flatnonzero(scalar_potency(tensor_from_voigt(potency)) > 0.0)
    source = strained[breaks]
    stray = np.count_nonzero(step["failed"].values[source] != int(step.attrs["step_index"]))
    if stray:
        raise InputError(
            f"{where}: {stray} particles have seismic strain but did not fail in it: compute the step again"
        )
    spacing = np.asarray(step["spacing"].values, dtype=np.float64)[source]
    order, center = step["failure_order"].values[source], part_centers(step)[source]
    return FailedRock(where, source, potency[breaks], center, spacing, order)


def _strained(step: xr.Dataset, where: str, *names: str) -> tuple[NDArray, list[NDArray], NDArray]:
    """Particles (k,) of a step that have some of the strains named, each strain (k, 6) of theirs, and volume (k,) m3.

    Raises InputError if one of these is not finite.
    """
    strains = [np.asarray(step[name].values, dtype=np.float64) for name in names]
    strained = np.flatnonzero(np.any([np.any(values != 0.0, axis=1) for values in strains], axis=0))
    strains = [values[strained] for values in strains]  # most rock has none
    volume = np.asarray(step["volume"].values, dtype=np.float64)
    if not all(np.all(np.isfinite(values)) for values in (*strains, volume)):
        raise InputError(f"{where}: a strain or a volume is not finite: compute the step again")
    return strained, strains, volume[strained]


def extract_events(step: xr.Dataset, settings: EventSettings | dict, reach: int = CORNERS) -> tuple[xr.Dataset, dict]:
    """Events of a step and its potency budget.

    step: the dataset of a mining step (particles with seismic_strain, overshoot_strain, later_strain and
    plastic_strain_step of this step, position, spacing, volume, material, failed, failure_order; attributes mine,
    step, step_index, lame_lambda and shear_modulus of the host, material_names, elastic_moduli, truncated*, and start,
    end, dated where it has dates: see dated). settings: EventSettings, or their values; their start and end, if given,
    are the step's, since the mechanics know no dates. reach: over what regions are linked (seismic.regions). Moments
    have the moduli of the rock that failed.
    Events are in the order in which they begin. Events of an undated step have no times and enter no catalogue.
    Particles that failed without a drop (no seismic strain) have no mechanism and join no event.
    Raises InputError for a dataset that lacks something or contradicts itself.
    """
    chosen = EventSettings.of(settings, "seismic")
    rock = failed_rock(step, chosen, STEP_VARIABLES)
    _, strains, volume = _strained(step, rock.where, *STRAIN_VARIABLES.values())
    strain = dict(zip(STRAIN_VARIABLES, strains, strict=True))
    where, source, potency, order, spacing = rock.where, rock.source, rock.potency, rock.order, rock.spacing
    weight = scalar_potency(tensor_from_voigt(potency))
    step = step.assign_attrs(UNDATED | step.attrs) if chosen.start is None else dated(step, chosen.start, chosen.end)
    position = np.asarray(step["position"].values, dtype=np.float64)[source]
    event, resolved = rock.events(chosen, reach)

    event_potency = sum_by(event, potency, len(resolved))
    moment = _moments(event, potency, len(resolved), step, source)
    values = _locate(position, spacing, weight, event, len(resolved), chosen.dimension)
    values |= describe_sources(tensor_from_voigt(event_potency), moment)
    dates = (step.attrs["start"], step.attrs["end"]) if step.attrs["dated"] else None
    values |= spread_in_time(dates, len(resolved), where)
    values |= {
        "particles": np.bincount(event, minlength=len(resolved)),
        "resolved": resolved,
        "step": np.full(len(resolved), step.attrs["step"]),
    }
    scalars = {
        "particle_scalars": float(np.sum(weight)),
        "event_scalars": float(np.sum(values["potency"])),
        "resolved_scalars": float(np.sum(values["potency"][resolved])),
    }
    budget = potency_budget(strain, volume, chosen.seismic_fraction, event_potency, scalars, where)
    attributes = _attributes(step, chosen, step["seismic_strain"].values[source], spacing) | {
        "budget": json.dumps(budget)
    }
    attributes["unlike_share"] = unlike_share(potency, event, event_potency, chosen.closeness)
    attributes["at_once_share"] = at_once_share(weight, event, order, chosen.min_particles)
    logging.info(
        "%s: %d failed particles, %d events, %d of them resolved; %.3f of the potency in particles unlike their event, "
        "%.3f in events that the load began at once",
        where,
        len(source),
        len(resolved),
        np.count_nonzero(resolved),
        attributes["unlike_share"],
        attributes["at_once_share"],
    )
    log_budget(budget)
    events = event_dataset(values, attributes)
    if "plane_normals" in step.attrs:
        slip = weight * slips_on_planes(step, source)
        share = np.bincount(event, slip, minlength=len(resolved)) / np.bincount(event, weight, minlength=len(resolved))
        events[ON_PLANES.name] = (ON_PLANES.dims, share, ON_PLANES.attributes)
    return events, budget


def find_events(
    position: NDArray,
    spacing: NDArray,
    potency: NDArray,
    failure_order: NDArray,
    settings: EventSettings,
    reach: int = CORNERS,
) -> tuple[NDArray, NDArray]:
    """Event of every particle, (particle,) from 0, and which events are resolved (event,) bool, by the chosen method.

    position (particle, 3) and spacing (particle,) m; potency (particle, 6) m3; failure_order (particle, 2).
    """
    if settings.method == "families":
        family, _ = find_families(potency, settings.closeness)
        return find_clusters(position, spacing, family, settings.clustering)
    label = find_regions(position, spacing, potency, failure_order, settings.closeness, reach)
    return label, np.bincount(label) >= settings.min_particles


def slips_on_planes(step: xr.Dataset, source: NDArray) -> NDArray:
    """(k,) bool: True where a particle (k,) of a step slipped on weak planes: their seismic strain leaves the planes as
    they are, whatever they do along and across each other."""
    normals = json.loads(step.attrs["plane_normals"])
    material, strain = step["material"].values[source], tensor_from_voigt(step["seismic_strain"].values[source])
    found = np.zeros(len(source), bool)
    for index, name in enumerate(json.loads(step.attrs["material_names"])):
        if name in normals:
            own = np.flatnonzero(material == index)
            along = np.eye(3) - np.outer(normals[name], normals[name])
            within = np.linalg.norm(along @ strain[own] @ along, axis=(1, 2))
            found[own] = within <= MAX_IN_PLANE_SHARE * np.linalg.norm(strain[own], axis=(1, 2))
    return found


def dated(step: xr.Dataset, start: str, end: str) -> xr.Dataset:
    """A step with the ISO dates from which and to which it is mined; both empty for one before the record begins."""
    return step.assign_attrs(start=start, end=end, dated=int(bool(start)))


def _check_step(step: xr.Dataset, settings: EventSettings, needed: tuple[str, ...]) -> str:
    """Name of the step for messages. Raises InputError if the dataset is not a step of this mine with the variables
    needed."""
    missing = [name for name in needed if name not in step.variables]
    attributes = (*STEP_ATTRIBUTES, *MATERIAL_ATTRIBUTES, *LABEL_ATTRIBUTES)
    missing += [name for name in attributes if name not in step.attrs]
    where = f"step {step.attrs.get('step', '?')}"
    if missing:
        raise InputError(f"{where}: not a mining step, it lacks {', '.join(missing)}: give a dataset of steps/")
    if step.attrs["mine"] != settings.mine:
        raise InputError(f"{where}: belongs to mine {step.attrs['mine']}, not to {settings.mine}: give its own step")
    return where


def particle_potency(seismic_strain: NDArray, volume: NDArray, seismic_fraction: float) -> NDArray:
    """Potency of each failed particle, alpha * strain * V (paper, Eqs 12 and 14).

    seismic_strain (particle, 6) 1, tensor shear; volume (particle,) m3, in two dimensions area times thickness;
    seismic_fraction alpha, 0 to 1. Gives (particle, 6) m3.
    """
    return seismic_fraction * (np.asarray(seismic_strain) * np.asarray(volume)[:, None])


def sum_by(event: NDArray, values: NDArray, events: int) -> NDArray:
    """Sums (event, k) of particle values (particle, k), added in the order of the particles."""
    return np.stack([np.bincount(event, column, minlength=events) for column in values.T], axis=-1)


def _moments(event: NDArray, potency: NDArray, events: int, step: xr.Dataset, source: NDArray) -> NDArray:
    """Moment tensors (event, 3, 3) N m: the potency of each material in an event with that material's own moduli.

    event (particle,) and potency (particle, 6) m3 of the particles `source` of the step.
    """
    moduli, material = json.loads(step.attrs["elastic_moduli"]), step["material"].values[source]
    total = np.zeros((events, 3, 3))
    for index, name in enumerate(json.loads(step.attrs["material_names"])):
        own = np.flatnonzero(material == index)
        if len(own):
            total += moment_from_potency(tensor_from_voigt(sum_by(event[own], potency[own], events)), *moduli[name])
    return total


def _rank_events(failure_order: NDArray, label: NDArray, events: int) -> NDArray:
    """Rank (event,) from 0 by increment, earliest generation in it, and event number.

    failure_order (particle, 2): increment and generation of each particle's failure; label (particle,) event number.
    """
    increment, generation = np.asarray(failure_order, dtype=np.int64).T
    instant = increment * (generation.max(initial=0) + 1) + generation
    earliest = np.full(events, np.iinfo(np.int64).max)
    np.minimum.at(earliest, label, instant)
    rank = np.empty(events, np.int64)
    rank[np.argsort(earliest, kind="stable")] = np.arange(events)
    return rank


def _locate(
    position: NDArray, spacing: NDArray, weight: NDArray, event: NDArray, events: int, dimension: int
) -> dict[str, NDArray]:
    """Location (potency-weighted mean) and source size of each event, m.

    The source size is the diameter of the uniform ball (a disc in two dimensions) whose mean square radius, d / (d + 2)
    of its radius squared, is the event's: the potency-weighted mean square distance from its location, each particle
    counting as a full cube (square) of its spacing, whose own mean square radius is d / 12 of the spacing squared.
    """
    total = np.bincount(event, weight, minlength=events)
    origin = position.mean(axis=0) if len(position) else np.zeros(3)  # near the events: mine coordinates reach 10^5 m
    centred = position - origin
    mean = sum_by(event, weight[:, None] * centred, events) / total[:, None]
    square = np.sum(np.square(centred - mean[event]), axis=1) + dimension / 12.0 * np.square(spacing)
    mean_square = np.bincount(event, weight * square, minlength=events) / total
    return {
        "location": origin + mean,
        "source_size": 2.0 * np.sqrt((dimension + 2.0) / dimension * mean_square),
    }


def _attributes(step: xr.Dataset, settings: EventSettings, strain: NDArray, spacing: NDArray) -> dict:
    """Attributes of the event dataset.

    potency_floor, m3: potency of `min_particles` full particles (cells, at one particle per cell) of the median spacing
    at the median drop of this step's failed particles: the smallest event that can be resolved. location_error, m:
    the median spacing, below which the model cannot tell where something failed. Both NaN where nothing failed.
    """
    floor = location_error = np.nan
    if len(strain):
        location_error = float(np.median(spacing))
        full = location_error**settings.dimension * (settings.thickness or 1.0)
        drop = settings.seismic_fraction * np.median(scalar_potency(tensor_from_voigt(strain)))
        floor = float(settings.min_particles * drop * full)
    kept = {name: step.attrs[name] for name in (*STEP_ATTRIBUTES, *UNDATED, *LABEL_ATTRIBUTES)}
    return kept | {
        "kind": "synthetic",
        "potency_floor": floor,
        "location_error": location_error,
        "seismic_fraction": settings.seismic_fraction,
        "method": settings.method,
        "closeness": settings.closeness,
        "least_particles": settings.min_particles,
        "cluster": json.dumps(settings.cluster.given() if settings.cluster else {}, sort_keys=True),
        "frame": json.dumps(settings.frame.given(), sort_keys=True),
    }


def unlike_share(potency: NDArray, event: NDArray, event_potency: NDArray, threshold: float) -> float:
    """Share of the scalar potency in particles whose cosine with their event's tensor is below the threshold.

    potency (particle, 6), event (particle,), event_potency (event, 6) m3.
    """
    own = tensor_from_voigt(potency)
    unlike = closeness(own, tensor_from_voigt(event_potency)[event]) < threshold
    scalar = scalar_potency(own)
    return float(np.sum(scalar[unlike]) / np.sum(scalar)) if len(own) else 0.0


def at_once_share(weight: NDArray, event: NDArray, failure_order: NDArray, least: int) -> float:
    """Share of the scalar potency in events whose rock one increment of the load brought above its strength.

    That is rock that fails before any other of its increment (generation 0), where one event has `least` such particles
    and more. In smaller increments they would fail one after another, some of them never, and form other events.
    weight (particle,) m3; event (particle,); failure_order (particle, 2): increment and generation.
    """
    first = failure_order[:, 1] == 0
    increment = failure_order[:, 0].astype(np.int64)
    key = event * (increment.max(initial=0) + 1) + increment  # families may span increments
    _, own, count = np.unique(key[first], return_inverse=True, return_counts=True)
    total = weight.sum()
    return float(weight[first][count[own] >= least].sum() / total) if total > 0.0 else 0.0


def sizes_by_closeness(steps: Iterable[xr.Dataset], settings: EventSettings) -> xr.Dataset:
    """Resolved events of all steps at the mine's closeness, at each of CLOSENESS_TRIED, and with fewer links.

    steps: datasets of mining steps, one after the other; settings: EventSettings, or their values. Gives potency
    (event,) m3 and choice (event,): the index of the choice with which the event was extracted; closeness
    and reach (choice,): the cosine, and over what regions are linked (seismic.regions), 0 for families, which have no
    such links;
    attribute own: the index of the catalogue's own choice.
    """
    chosen = EventSettings.of(settings, "seismic")
    has_links = chosen.method == "simultaneous"
    choices = [(value, CORNERS if has_links else 0) for value in sorted({*CLOSENESS_TRIED, chosen.closeness})]
    own = [value for value, _ in choices].index(chosen.closeness)
    if has_links:
        choices += [(chosen.closeness, reach) for reach in (EDGES, FACES)]
    potency: list[list] = [[np.empty(0)] for _ in choices]
    for step in steps:
        rock = failed_rock(step, chosen)
        for (value, reach), parts in zip(choices, potency, strict=True):
            event, resolved = rock.events(chosen.model_copy(update={"closeness": value}), reach)
            parts.append(scalar_potency(tensor_from_voigt(sum_by(event, rock.potency, len(resolved))))[resolved])
    joined = [np.concatenate(parts) for parts in potency]
    closeness, reaches = zip(*choices, strict=True)
    return xr.Dataset(
        {
            "potency": ("event", np.concatenate(joined), {"units": "m3", "long_name": "scalar potency"}),
            "choice": (
                "event",
                np.repeat(np.arange(len(choices)), [len(part) for part in joined]),
                {"units": "1", "long_name": "choice with which the event was extracted"},
            ),
            "closeness": ("choice", list(closeness), {"units": "1", "long_name": "cosine above which rock is alike"}),
            "reach": (
                "choice",
                list(reaches),
                {"units": "1", "long_name": "links go over faces (1), also edges (2), also corners (3)"},
            ),
        },
        attrs={"mine": chosen.mine, "own": own},
    )
