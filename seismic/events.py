"""Seismic events of one mining step, from the plastic strain of its failed particles.

Paper, section 3; docs/explanation/method.md says which paper.

`sizes_by_rule` shows what three choices change: the closeness above which mechanisms are similar, the link length, and
the parts of a step in which rock that fails may belong together.
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
from seismic.regions import find_regions

STRAIN_VARIABLES = {
    "seismic": "seismic_strain",
    "overshoot": "overshoot_strain",
    "later": "later_strain",
    "plastic": "plastic_strain_step",
}
LOAD_VARIABLES = ("convergence_increment", "convergence_load")
ROCK_VARIABLES = (
    *(STRAIN_VARIABLES["seismic"], "position", "spacing", "volume", "failed", "failure_order"),
    *LOAD_VARIABLES,
)
STEP_VARIABLES = (*STRAIN_VARIABLES.values(), *ROCK_VARIABLES[1:], "material")
STEP_ATTRIBUTES = ("mine", "step", "step_index", "parts", "lame_lambda", "shear_modulus")
MATERIAL_ATTRIBUTES = ("material_names", "elastic_moduli")
# Share of a strain that may deform planes within themselves while it counts as slip along them.
MAX_IN_PLANE_SHARE = 1e-6
LABEL_ATTRIBUTES = ("truncated", "truncated_share", "truncated_where", "collapsed")
CLOSENESS_TRIED = (0.6, 0.7, 0.8, 0.9, 0.95)
LINK_LENGTHS_TRIED = (1.0, 1.5, 2.0)  # times the catalogue's own


@dataclass(frozen=True)
class FailedRock:
    """The particles that a step's events consist of: those that failed in it with a drop, (k,).

    where: name of the step for messages; source (k,): their index in the step, potency (k, 6) m3, center (k, 3) m of
    the part of the cell that is theirs, spacing (k,) m, order (k, 2): increment and generation of their failure; load
    (k,): share of the step's load in the middle of that increment; parts of the step; floor m3: potency of the smallest
    event that the cells resolve, NaN where nothing failed.
    """

    where: str
    source: NDArray
    potency: NDArray
    center: NDArray
    spacing: NDArray
    order: NDArray
    load: NDArray
    parts: int
    floor: float

    def events(self, settings: EventSettings, parts: int | None = None) -> tuple[NDArray, NDArray]:
        """Event of each particle, (k,), and which events are resolved, (event,) bool, in the order in which they begin.

        parts: equal parts of the step of which rock makes different events, by default its own.
        """
        part = np.minimum((self.load * (parts or self.parts)).astype(np.int64), (parts or self.parts) - 1)
        label, resolved = find_events(self.center, self.spacing, self.potency, part, settings)
        size = scalar_potency(tensor_from_voigt(sum_by(label, self.potency, len(resolved))))
        rank = _rank_events(self.order, label, len(resolved))
        return rank[label], (resolved & (size >= self.floor))[np.argsort(rank)]


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
    floor = potency_floor(strain[breaks], spacing, settings)
    load = middle_of_increments(step)[order[:, 0]] if len(source) else np.empty(0)
    return FailedRock(where, source, potency[breaks], center, spacing, order, load, int(step.attrs["parts"]), floor)


def middle_of_increments(step: xr.Dataset) -> NDArray:
    """Share of the step's load in the middle of each increment, (increment + 1,) from 0 on."""
    increment = step["convergence_increment"].values
    end = np.zeros(increment.max(initial=0) + 1)
    end[increment] = step["convergence_load"].values  # the last that is noted: an increment may have been tried before
    before = np.append(0.0, end[:-1])
    return 0.5 * (before + end)


def potency_floor(strain: NDArray, spacing: NDArray, settings: EventSettings) -> float:
    """Potency of the smallest event that can be resolved, m3; NaN where nothing failed.

    That of `min_particles` full particles (cells, at one particle per cell) of the median spacing at the median drop.
    strain (k, 6), of the drop of failed particles; spacing (k,) m.
    """
    if not len(strain):
        return np.nan
    full = np.median(spacing) ** settings.dimension * (settings.thickness or 1.0)
    drop = settings.seismic_fraction * np.median(scalar_potency(tensor_from_voigt(strain)))
    return float(settings.min_particles * drop * full)


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


def extract_events(step: xr.Dataset, settings: EventSettings | dict) -> tuple[xr.Dataset, dict]:
    """Events of a step and its potency budget.

    step: the dataset of a mining step (particles with seismic_strain, overshoot_strain, later_strain and
    plastic_strain_step of this step, position, spacing, volume, material, failed, failure_order; of its convergence
    increments and load; attributes mine, step, step_index, parts, lame_lambda and shear_modulus of the host,
    material_names, elastic_moduli, truncated*, and start, end, dated where it has dates: see dated). settings:
    EventSettings, or their values; their start and end, if given, are the step's, since the mechanics know no dates.
    Moments have the moduli of the rock that failed.
    Events are in the order in which they begin. Events of an undated step have no times and enter no catalogue.
    Particles that failed without a drop (no seismic strain) have no mechanism and join no event.
    Raises InputError for a dataset that lacks something or contradicts itself.
    """
    chosen = EventSettings.of(settings, "seismic")
    rock = failed_rock(step, chosen, STEP_VARIABLES)
    _, strains, volume = _strained(step, rock.where, *STRAIN_VARIABLES.values())
    strain = dict(zip(STRAIN_VARIABLES, strains, strict=True))
    where, source, potency, spacing = rock.where, rock.source, rock.potency, rock.spacing
    weight = scalar_potency(tensor_from_voigt(potency))
    step = step.assign_attrs(UNDATED | step.attrs) if chosen.start is None else dated(step, chosen.start, chosen.end)
    position = np.asarray(step["position"].values, dtype=np.float64)[source]
    event, resolved = rock.events(chosen)

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
    attributes = _attributes(step, chosen, rock) | {"budget": json.dumps(budget)}
    attributes["unlike_share"] = unlike_share(potency, event, event_potency, chosen.closeness)
    logging.info(
        "%s: %d failed particles, %d events, %d of them resolved; %.3f of the potency in particles unlike their event",
        where,
        len(source),
        len(resolved),
        np.count_nonzero(resolved),
        attributes["unlike_share"],
    )
    log_budget(budget)
    events = event_dataset(values, attributes)
    if "plane_normals" in step.attrs:
        slip = weight * slips_on_planes(step, source)
        share = np.bincount(event, slip, minlength=len(resolved)) / np.bincount(event, weight, minlength=len(resolved))
        events[ON_PLANES.name] = (ON_PLANES.dims, share, ON_PLANES.attributes)
    return events, budget


def find_events(
    position: NDArray, spacing: NDArray, potency: NDArray, part: NDArray, settings: EventSettings
) -> tuple[NDArray, NDArray]:
    """Event of every particle, (particle,) from 0, and which events may be resolved, (event,) bool.

    position (particle, 3) and spacing (particle,) m; potency (particle, 6) m3; part (particle,): of the step.
    """
    if settings.method == "families":
        family, _ = find_families(potency, settings.closeness)
        return find_clusters(position, spacing, family, settings.clustering)
    label = find_regions(position, potency, part, settings.length_of_links, settings.closeness)
    return label, np.ones(label.max(initial=-1) + 1, bool)


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


def _attributes(step: xr.Dataset, settings: EventSettings, rock: FailedRock) -> dict:
    """Attributes of the event dataset.

    potency_floor: see potency_floor. location_error, m: the median spacing, below which the model cannot tell where
    something failed; NaN where nothing failed.
    """
    kept = {name: step.attrs[name] for name in (*STEP_ATTRIBUTES, *UNDATED, *LABEL_ATTRIBUTES)}
    return kept | {
        "kind": "synthetic",
        "potency_floor": rock.floor,
        "location_error": float(np.median(rock.spacing)) if len(rock.source) else np.nan,
        "seismic_fraction": settings.seismic_fraction,
        "method": settings.method,
        "closeness": settings.closeness,
        "link_length": settings.length_of_links if settings.method == "simultaneous" else 0.0,
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


def sizes_by_rule(steps: Iterable[xr.Dataset], settings: EventSettings) -> xr.Dataset:
    """Resolved events of all steps by the mine's own rule, and by rules that differ in one choice.

    steps: datasets of mining steps, one after the other; settings: EventSettings, or their values. Gives potency
    (event,) m3 and rule (event,): the index of the rule by which the event was extracted; closeness, link_length m (0
    with method families, which has none) and parts of a step (rule,). The first rule is the mine's own.
    """
    chosen = EventSettings.of(settings, "seismic")
    rules, found = [], []
    for number, step in enumerate(steps):
        rock = failed_rock(step, chosen)
        if not number:
            rules = _rules(chosen, rock.parts)
            found = [[np.empty(0)] for _ in rules]
        for (value, length, parts), own in zip(rules, found, strict=True):
            given = {"closeness": value, "link_length": length if chosen.method == "simultaneous" else None}
            event, resolved = rock.events(chosen.model_copy(update=given), parts)
            own.append(scalar_potency(tensor_from_voigt(sum_by(event, rock.potency, len(resolved))))[resolved])
    potency = [np.concatenate(own) for own in found]
    rule = np.repeat(np.arange(len(rules)), [len(own) for own in potency])
    closeness, link_length, count = np.array(rules).reshape(-1, 3).T

    def variable(dim: str, values: NDArray, unit: str, meaning: str) -> tuple:
        return dim, values, {"units": unit, "long_name": meaning}

    return xr.Dataset(
        {
            "potency": variable("event", np.concatenate([np.empty(0), *potency]), "m3", "scalar potency"),
            "rule": variable("event", rule, "1", "rule by which the event was extracted"),
            "closeness": variable("rules", closeness, "1", "cosine above which rock is alike"),
            "link_length": variable("rules", link_length, "m", "largest distance of rock that hangs together"),
            "parts": variable("rules", count.astype(np.int64), "1", "parts of a step"),
        },
        attrs={"mine": chosen.mine},
    )


def _rules(settings: EventSettings, parts: int) -> list[tuple[float, float, int]]:
    """Closeness, link length and parts of a step of each rule that is tried; the first is the mine's own."""
    has_links = settings.method == "simultaneous"
    closeness, length = settings.closeness, settings.length_of_links if has_links else 0.0
    others = [(value, length, parts) for value in CLOSENESS_TRIED]
    if has_links:
        others += [(closeness, factor * length, parts) for factor in LINK_LENGTHS_TRIED]
        others += [(closeness, length, fewer) for fewer in (parts // 2, 1) if fewer]
    return list(dict.fromkeys([(closeness, length, parts), *others]))
