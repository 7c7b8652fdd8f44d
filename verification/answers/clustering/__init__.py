"""Clustering methods and families against known truth (paper sections 3.1 and 3.2, Figs 10 to 12)."""

import time
from dataclasses import dataclass, field
from itertools import chain

import numpy as np
import psutil
from matplotlib.figure import Figure
from numpy.typing import NDArray

from common.voigt import tensor_from_voigt, voigt_from_tensor
from seismic.clusters import find_clusters
from seismic.events import extract_events
from verification.answers.clustering.cracks import body_rows, crack_rows
from verification.answers.clustering.family_recovery import family_rows, recover
from verification.answers.clustering.figure import draw
from verification.answers.clustering.known_truth import (
    PointSet,
    balls,
    elongations,
    index_of_clusters,
    lognormal,
    make_points,
    share_of_noise_taken,
    synthetic_step,
    turned,
)
from verification.comparisons import reported, vanishing
from verification.page_tables import Pivot
from verification.results import Results
from verification.rows import Row

NUMERICS = ("seismic",)  # Folders that the results may change with.

TABLES = (
    Pivot(
        "Adjusted Rand index of clusters (1 is the truth)",
        r"(?P<row>[\w ]+), (?P<column>k-means|single linkage|DBSCAN \d): adjusted Rand index",
        "measured",
    ),
    Pivot(
        "Elongation of clusters, relative error",
        r"(?P<row>[\w ]+), (?P<column>k-means|single linkage|DBSCAN \d): elongation .+",
        "error",
    ),
    Pivot(
        "Share of scattered particles in a cluster with others",
        r"(?P<row>[\w ]+), (?P<column>k-means|single linkage|DBSCAN \d): share of scattered particles .+",
        "measured",
    ),
    Pivot("Processor time (s)", r"time, (?P<column>[^,]+), (?P<row>[\d,]+ particles), s", "measured"),
    Pivot(
        "Families at closeness 0.8, mechanisms turned at random",
        r"families: closeness 0.8, turned by (?P<row>up to \d+ degrees): (?P<column>.+)",
        "measured",
    ),
    Pivot(
        "Events made of cracks one cell thick, over 28 orientations",
        r"(?P<row>regions .+?|families): events of (?P<column>.+)",
        "measured",
    ),
    Pivot(
        "Adjusted Rand index of bodies of one mechanism, mean of sets",
        r"(?P<row>regions .+?): adjusted Rand index of bodies .+ turned by (?P<column>up to \d+ degrees), .+",
        "measured",
    ),
)


@dataclass
class Separation:
    """A set of points and its clusters: label (particle,) and resolved (cluster,) by method."""

    points: PointSet
    label: dict[str, NDArray] = field(default_factory=dict)
    resolved: dict[str, NDArray] = field(default_factory=dict)


def answer(results: Results) -> tuple[list[Row], Figure]:
    """Rows on separation in space, its potency budget and time, families, cracks and bodies; one figure."""
    settings, allowed = results.settings, results.allowed
    separations = separate(settings)
    families = recover(settings["families"], settings["seed"])
    times = time_methods(settings)
    rows = [
        *separation_rows(separations, settings, allowed),
        *budget_rows(separations, settings, allowed),
        *time_rows(times, settings),
        *family_rows(settings["families"], families, allowed),
        *crack_rows(settings, allowed),
        *body_rows(settings, allowed),
    ]
    return rows, draw(separations, families, times, len(settings["families"]["mechanisms"]))


def separate(settings: dict) -> dict[str, list[Separation]]:
    """Every method on every draw of every set, by the set's name. A set without random parts has one draw."""
    separations: dict[str, list[Separation]] = {}
    for number, (name, shape) in enumerate(settings["sets"].items()):
        random = any(part.get("share", 1.0) < 1.0 for part in (*shape["bodies"], *shape.get("noise", [])))
        separations[name] = []
        for draw_number in range(settings["draws"] if random else 1):
            generator = np.random.default_rng([settings["seed"], number, draw_number])
            points = make_points(shape, settings["spacing"], settings["origin"], generator)
            separations[name].append(_separate(points, settings["methods"]))
    return separations


def _separate(points: PointSet, methods: dict) -> Separation:
    """Every method on one set of points, all of one family."""
    separation = Separation(points)
    family = np.zeros(len(points.truth), int)
    for method, cluster in methods.items():
        label, resolved = find_clusters(points.position, points.spacing, family, _with_number(cluster, points.clusters))
        separation.label[method], separation.resolved[method] = label, resolved
    return separation


def _with_number(cluster: dict, clusters: int) -> dict:
    """The method's settings, k-means with the true number of clusters."""
    return cluster | {"clusters": clusters} if cluster["method"] == "kmeans" else cluster


def separation_rows(separations: dict[str, list[Separation]], settings: dict, allowed: dict) -> list[Row]:
    """Index, elongation and scattered particles by set and method, as means of draws; the equality of two methods."""
    rows = []
    for name, draws in separations.items():
        shape = settings["sets"][name]
        indices, lengths, taken = [], [], []
        for method in settings["methods"]:
            where = f"{name}, {method}"
            must = shape["must"].get(method)
            labels = [(each.points, each.label[method]) for each in draws]
            index = float(np.mean([index_of_clusters(*each) for each in labels]))
            remark = shape["why"] if must else ""
            indices.append(Row.relative(f"{where}: adjusted Rand index", 1.0, index, allowed.get(must), remark))
            true, found = np.mean([np.mean(elongations(*each), axis=1) for each in labels], axis=0)
            bound = allowed["exact"] if must == "exact" and "noise" not in shape else None
            what = "elongation (longest over shortest deviation), mean of clusters"
            lengths.append(Row.relative(f"{where}: {what}", float(true), float(found), bound))
            share = float(np.mean([share_of_noise_taken(*each) for each in labels]))
            taken.append(vanishing(f"{where}: share of scattered particles in a cluster with others", share))
        rows += [*indices, *lengths, *(taken if "noise" in shape else [])]
    rows.append(_few_samples_row(separations, settings, allowed))
    return rows


def _few_samples_row(separations: dict[str, list[Separation]], settings: dict, allowed: dict) -> Row:
    """With min_samples of 3 or less DBSCAN and single linkage resolve the same events, whatever the points."""
    methods = settings["methods"]
    linkage = next(name for name, chosen in methods.items() if chosen["method"] == "single_linkage")
    few = next(name for name, chosen in methods.items() if chosen["method"] == "dbscan" and chosen["min_samples"] <= 3)
    different = 0
    for separation in chain.from_iterable(separations.values()):
        parts = []
        for name in (linkage, few):
            label, resolved = separation.label[name], separation.resolved[name]
            first = np.unique(label, return_index=True)[1]  # A cluster is named by its first particle.
            parts.append(np.where(resolved[label], first[label], -1))
        different += int(np.count_nonzero(parts[0] != parts[1]))
    return vanishing(
        f"all sets: particles whose resolved event differs between {linkage} and {few}",
        float(different),
        allowed["exact"],
        "min_samples 3 (the default): a particle that is not dense has at most one neighbour, so it is the end of a "
        "chain and joins nothing; the two methods differ only from min_samples 4 on",
    )


def budget_rows(separations: dict[str, list[Separation]], settings: dict, allowed: dict) -> list[Row]:
    """Potency of events against that of particles, through the event stage: worst component, first draw of each set."""
    worst = dict.fromkeys(settings["methods"], 0.0)
    events = dict.fromkeys(settings["methods"], 0)
    chosen = settings["budget"]
    mechanisms = tensor_from_voigt(np.array(settings["families"]["mechanisms"], dtype=float))
    for number, (separation, *_) in enumerate(separations.values()):
        generator = np.random.default_rng([settings["seed"], number, 1])
        points = separation.points
        size = lognormal(len(points.truth), chosen["potency"], settings["families"]["log_potency_spread"], generator)
        kind = mechanisms[np.maximum(points.truth, 0) % len(mechanisms)]
        strain = voigt_from_tensor(size[:, None, None] * turned(kind, chosen["scatter"], generator))
        step = synthetic_step(points.position, strain, spacing=points.spacing)
        particles = strain * points.spacing[:, None] ** 3
        for method, cluster in settings["methods"].items():
            stage = {
                "mine": step.attrs["mine"],
                "method": "families",
                "closeness": chosen["closeness"],
                "least_particles": 3,
                "cluster": _with_number(cluster, points.clusters),
                "seismic_fraction": 1.0,
                "frame": {"surface": 0.0},
            }
            found = extract_events(step, stage)[0]
            total = voigt_from_tensor(found["potency_tensor"].values.sum(axis=0))
            miss = np.abs(total - particles.sum(axis=0)) / np.abs(particles).sum(axis=0)
            worst[method] = max(worst[method], float(miss.max()))
            events[method] += found.sizes["event"]
    what = "potency of events less that of particles, worst component over its sum of magnitudes"
    scatter = f"events of mechanisms turned by up to {chosen['scatter']} degrees"
    return [
        vanishing(f"all sets, {method}: {what}", miss, allowed["budget"], f"{events[method]} {scatter}")
        for method, miss in worst.items()
    ]


def time_methods(settings: dict) -> dict[str, list[tuple[int, float, str]]]:
    """(particles, seconds, "") of each method and size; (particles, NaN, why) where it is not run."""
    chosen = settings["timing"]
    times: dict[str, list[tuple[int, float, str]]] = {method: [] for method in settings["methods"]}
    for count in chosen["counts"]:
        points = balls(count, chosen["semi_axes"], chosen["apart"], settings["spacing"])
        family = np.zeros(len(points.truth), int)
        for method, cluster in settings["methods"].items():
            why = _why_not(cluster, points, chosen)
            seconds = np.nan
            if not why:
                start = time.process_time()
                find_clusters(points.position, points.spacing, family, _with_number(cluster, points.clusters))
                seconds = time.process_time() - start
            times[method].append((len(points.truth), seconds, why))
    return times


def _why_not(cluster: dict, points: PointSet, chosen: dict) -> str:
    """Why a method is not run on these points; empty if it is run."""
    count = len(points.truth)
    if cluster["method"] == "kmeans" and count * points.clusters > chosen["kmeans_most_products"]:
        return (
            f"not run: {points.clusters} clusters, particles times clusters {count * points.clusters:.0e}, is too slow"
        )
    if count * chosen["bytes_per_particle"] > 0.5 * psutil.virtual_memory().available:
        return f"not run: needs {count * chosen['bytes_per_particle'] / 1e9:.1f} GB, over half of the free memory"
    return ""


def time_rows(times: dict[str, list[tuple[int, float, str]]], settings: dict) -> list[Row]:
    """Seconds of each method and size, reported."""
    counts = settings["timing"]["counts"]
    return [
        reported(f"time, {method}, {asked:,} particles, s", seconds, why or f"{count} particles")
        for method, line in times.items()
        for (count, seconds, why), asked in zip(line, counts, strict=True)
    ]
