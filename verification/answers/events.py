"""Events of the same rock on cells of several sizes, in other increments, and cut into halves, by several rules."""

import itertools
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import xarray as xr
from matplotlib.figure import Figure
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree
from sklearn.cluster import DBSCAN
from sklearn.metrics import adjusted_rand_score

from catalogs.figures import style
from catalogs.sources.sizes import estimate_b, log_potency
from common.source_tensors import scalar_potency
from common.voigt import tensor_from_voigt
from seismic.event_settings import EventSettings
from seismic.events import FailedRock, failed_rock, sum_by
from seismic.families import NINE_COMPONENT_WEIGHTS, find_families
from seismic.regions import find_regions
from verification.page_tables import Pivot
from verification.results import Results, Variant
from verification.rows import Row

TABLES = (
    Pivot(
        "Number, b and largest event of smaller cells, against those of the largest (%)",
        r"(?P<row>\w+, cells of [\d.]+ m, [\w ]+): (?P<column>events|b|largest, m3)",
        "change, %",
    ),
    Pivot(
        "Number, b and largest event in equal increments, against those of increments that follow their error (%)",
        r"(?P<row>\w+, \d+ equal increments, [\w ]+): (?P<column>events|b|largest, m3)",
        "change, %",
    ),
    Pivot(
        "Events of half of the failed rock against those of all of it: least adjusted Rand index over the halves",
        r"(?P<row>\w+), (?P<column>[\w ]+): least index of halves",
        "measured",
    ),
)
STEP = "mined"
JUDGED = "regions"
MEASURES = ("events", "b", "largest, m3")
DBSCAN_PARTICLES = 3
COLOURS = (style.MODELLED, style.RECORDED, style.BOTH)


@dataclass(frozen=True)
class Rock:
    """Failed rock: position (k, 3) m, potency (k, 6) m3, part of the step (k,)."""

    position: NDArray
    potency: NDArray
    part: NDArray

    @classmethod
    def of(cls, rock: FailedRock) -> "Rock":
        part = np.minimum((rock.load * rock.parts).astype(np.int64), rock.parts - 1)
        return cls(rock.center, rock.potency, part)

    def __getitem__(self, chosen: NDArray) -> "Rock":
        return Rock(self.position[chosen], self.potency[chosen], self.part[chosen])

    def links(self, length: float) -> NDArray:
        """Pairs (pair, 2) of particles of one part within a length, m."""
        place = np.column_stack([self.position, 3.0 * length * self.part])
        return cKDTree(place).query_pairs(length * (1.0 + 1e-9), output_type="ndarray")


def components(rock: Rock, length: float, closeness: float) -> NDArray:
    """Label (k,): connected by links between particles of like mechanisms."""
    return _connected(rock, length, closeness, rock.potency)


def local_components(rock: Rock, length: float, closeness: float) -> NDArray:
    """Label (k,): as components, with the mechanism around each particle within the length of links."""
    pairs, count = rock.links(length), len(rock.part)
    near = coo_array((np.ones(len(pairs)), pairs.T), shape=(count, count)).tocsr()
    return _connected(rock, length, closeness, rock.potency + (near + near.T) @ rock.potency)


def _connected(rock: Rock, length: float, closeness: float, tensor: NDArray) -> NDArray:
    pairs, count = rock.links(length), len(rock.part)
    unit = tensor * NINE_COMPONENT_WEIGHTS
    unit = unit / np.maximum(np.linalg.norm(unit, axis=1), 1e-300)[:, None]
    linked = pairs[np.sum(unit[pairs[:, 0]] * unit[pairs[:, 1]], axis=1) > closeness]
    graph = coo_array((np.ones(len(linked), np.int8), linked.T), shape=(count, count))
    return connected_components(graph, directed=False)[1]


def density(rock: Rock, length: float, closeness: float) -> NDArray:
    """Label (k,): families of like mechanisms, then DBSCAN of each within a part, in metres; noise is one by one."""
    family, _ = find_families(rock.potency, closeness)
    group = 3.0 * length * (rock.part * (family.max() + 1) + family)
    label = DBSCAN(eps=length, min_samples=DBSCAN_PARTICLES).fit(np.column_stack([rock.position, group])).labels_
    return np.where(label < 0, label.max() + 1 + np.arange(len(label)), label)


def regions(rock: Rock, length: float, closeness: float) -> NDArray:
    """Label (k,): the rule of the project."""
    return find_regions(rock.position, rock.potency, rock.part, length, closeness)


RULES: dict[str, Callable[[Rock, float, float], NDArray]] = {
    JUDGED: regions,
    "components": components,
    "local components": local_components,
    "DBSCAN": density,
}


def answer(results: Results) -> tuple[list[Row], Figure]:
    """Rows on cells, increments and halves; a figure of the numbers of events above a size on all cells."""
    settings = results.settings
    rows, drawn = [], {}
    for scene, (first, *others) in settings["cells"].items():
        base = _runs(results[first])
        floor = max(floor for _, floor in base)
        drawn[scene] = {_cell(results[name]): _runs(results[name]) for name in (first, *others)}
        for name in others:
            title = f"{scene}, cells of {_cell(results[name]):g} m"
            rows += compare(title, base, drawn[scene][_cell(results[name])], floor, settings, results.allowed)
    for scene, (first, *others) in settings["increments"].items():
        base = _runs(results[first])
        floor = max(floor for _, floor in base)
        for name in others:
            count = results[name].mine.settings.solver.increments
            title = f"{scene}, {count} equal increments"
            rows += compare(title, base, _runs(results[name]), floor, settings, results.allowed)
    for scene, (first, *_) in settings["cells"].items():
        rock = _runs(results[first])[0][0]
        for name, rule in RULES.items():
            least = min(halves(rock, rule, settings))
            allowed = settings["least_index"] if name == JUDGED else None
            title = f"{scene}, {name}: least index of halves"
            rows.append(Row.relative(title, 1.0, least, None if allowed is None else 1.0 - allowed))
    return rows, draw(drawn, settings)


def compare(title: str, base: list, found: list, floor: float, settings: dict, allowed: dict[str, float]) -> list[Row]:
    """Rows on means over runs of number, b and largest event above a floor, m3: of `found` against `base`."""
    rows = []
    for name, rule in RULES.items():
        first, second = (
            np.array([measures(rock, rule, floor, settings) for rock, _ in runs]) for runs in (base, found)
        )
        for column, measure in enumerate(MEASURES):
            expected, obtained = first[:, column], second[:, column]
            told = f"members: {np.std(expected, ddof=1):.2g} and {np.std(obtained, ddof=1):.2g}"
            bound = allowed[measure.partition(",")[0]] if name == JUDGED else None
            rows.append(
                Row.relative(f"{title}, {name}: {measure}", float(expected.mean()), float(obtained.mean()), bound, told)
            )
    return rows


def measures(rock: Rock, rule: Callable, floor: float, settings: dict) -> tuple[float, float, float]:
    """Number of events above a floor, m3, their b, and the largest, m3."""
    size = _sizes(rock, rule, settings)
    return float((size >= floor).sum()), estimate_b(log_potency(size), float(log_potency(floor))).b, float(size.max())


def _sizes(rock: Rock, rule: Callable, settings: dict) -> NDArray:
    """Potency (event,) m3 of the events of a rule."""
    label = rule(rock, settings["link_length"], settings["closeness"])
    return scalar_potency(tensor_from_voigt(sum_by(label, rock.potency, label.max() + 1)))


def halves(rock: Rock, rule: Callable, settings: dict) -> list[float]:
    """Adjusted Rand index between the events of all rock and of the rock on either side of its median alone, on all
    axes, of particles farther from the cut than twice the length of links."""
    label, found = rule(rock, settings["link_length"], settings["closeness"]), []
    for axis, side in itertools.product(np.flatnonzero(np.ptp(rock.position, axis=0)), (-1.0, 1.0)):
        beyond = side * (rock.position[:, axis] - np.median(rock.position[:, axis]))
        half, away = beyond > 0.0, beyond > 2.0 * settings["link_length"]
        alone = rule(rock[half], settings["link_length"], settings["closeness"])
        found.append(adjusted_rand_score(label[away], alone[away[half]]))
    return found


def _cell(variant: Variant) -> float:
    return variant.mine.finest_cell


def _runs(variant: Variant) -> list[tuple[Rock, float]]:
    """Failed rock and potency floor, m3, of a variant and of its members."""
    paths = [f"steps/{STEP}.nc", *(f"ensemble/{one}/steps/{STEP}.nc" for one in range(1, variant.mine.members + 1))]
    return [_failed(variant.read(path), variant) for path in paths]


def _failed(step: xr.Dataset, variant: Variant) -> tuple[Rock, float]:
    found = failed_rock(step, EventSettings.of(variant.mine.step_events_slice(STEP), "seismic"))
    return Rock.of(found), found.floor


def draw(scenes: dict[str, dict[float, list]], settings: dict) -> Figure:
    """Number of events at least so large, by scene: a line for each run, a colour for each size of cells."""
    figure = style.new_figure(height=3.2)
    panels = figure.subplots(1, len(scenes), sharey=True)
    for axes, (scene, runs_of) in zip(np.atleast_1d(panels), scenes.items(), strict=True):
        for colour, (cell, runs) in zip(COLOURS, runs_of.items(), strict=False):
            for number, (rock, floor) in enumerate(runs):
                size = np.sort(_sizes(rock, regions, settings))[::-1]
                kept = size >= floor
                label = f"{cell:g} m" if not number else None
                axes.step(log_potency(size[kept]), np.arange(1, kept.sum() + 1), color=colour, label=label, lw=0.9)
        axes.set(title=scene.replace("_", " "), xlabel="log P (m³)", yscale="log")
        axes.legend(title="cells")
    np.atleast_1d(panels)[0].set_ylabel("events at least so large")
    return figure
