"""Schemes `explicit` and `multigrid` compared: the same elastic equilibrium, and brittle failure alike on average.

Brittle failure localises, so one run is one realisation. Schemes are compared by all their runs of one brittle scene,
which differ by unknown details.
"""

import copy
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from scipy.stats import sem

from catalogs.figures import style
from catalogs.sources.sizes import MIN_EVENTS_FOR_B, BValue, estimate_b, log_potency
from common.errors import InputError
from mpm_core.equilibrium.increments import potency
from mpm_core.scene.scene import parse_scene
from mpm_core.simd.threads import use_threads
from mpm_core.stages.equilibrium_stages import mining_step
from seismic.events import extract_events
from verification.comparisons import VOIGT_MULTIPLICITY, reported, vanishing
from verification.page_tables import Pivot
from verification.plots import COLOURS, plot_series
from verification.results import Results, Variant
from verification.rows import Row
from workflow.mine import Mine

TABLES = (
    Pivot(
        "Brittle rock: distance of the means of both schemes, in standard errors",
        r"(?P<row>.+), brittle: (?P<column>.+?), means of \d+ runs, .+, apart in standard errors",
        "error",
    ),
    Pivot(
        "Brittle rock: mean difference of pairs (% of the mean)",
        r"(?P<row>.+), brittle: (?P<column>.+?), mean difference of pairs, share of the mean",
        "error, %",
    ),
)

LABELS = {
    "potency": "seismic potency (m³)",
    "failed_volume": "failed volume (m³)",
    "events": "events",
    "b": "b of log P",
}
LINES = {  # Line of convergence by scheme and whether densities are scaled: name and look.
    ("explicit", True): ("explicit, scaled densities", "-"),
    ("explicit", False): ("explicit, true masses", "--"),
    ("multigrid", True): ("multigrid", "o-"),
}
MEAN_OFFSET = 0.16  # Distance of a mean from its runs, as a share of the distance between the schemes.
# Quantities of a run: name, and short name of the bound on the mean difference of pairs, where there is one.
QUANTITIES = {
    "potency": ("seismic potency, m3", "pairs"),
    "failed_volume": ("failed volume, m3", "pairs"),
    "events": ("number of events", None),
    "b": ("b of log potency", None),
}


@dataclass(frozen=True)
class Run:
    """Results of a run's last step.

    potency: sum over particles of the scalar of seismic strain times volume, m3. failed_volume: m3. failed: whether a
    particle has failed by its end. sizes: log10 potency (m3) of resolved events. floor: smallest potency that can be
    resolved, m3. iterations: of all steps. in_parts: generations of failure that were solved in a subdomain.
    """

    potency: float
    failed_volume: float
    failed: np.ndarray
    sizes: np.ndarray
    floor: float
    iterations: int
    in_parts: int

    @property
    def events(self) -> int:
        """Number of resolved events."""
        return len(self.sizes)


@dataclass(frozen=True)
class Pairs:
    """Runs of two variants, paired by their order: by name of the scheme, explicit first, or of the variant."""

    runs: dict[str, list[Run]]

    @cached_property
    def cut(self) -> float:
        """log10 potency (m3) from which b is estimated: the largest floor of all runs; NaN without failed rock."""
        return float(log_potency(np.max([run.floor for runs in self.runs.values() for run in runs])))

    def b_values(self) -> dict[str, list[BValue]]:
        """b of log potency of each run's resolved events from the cut on; NaN of fewer than MIN_EVENTS_FOR_B."""
        return {name: [estimate_b(run.sizes, self.cut) for run in runs] for name, runs in self.runs.items()}

    def values(self, quantity: str) -> tuple[np.ndarray, np.ndarray]:
        """Values (run,) of a quantity for each of the two variants; quantity: potency, failed_volume, events or b."""
        if quantity == "b":
            first, other = ([value.b for value in values] for values in self.b_values().values())
        else:
            first, other = ([getattr(run, quantity) for run in runs] for runs in self.runs.values())
        return np.array(first, float), np.array(other, float)

    @property
    def has_b(self) -> bool:
        """True if every run has enough events for a b-value."""
        return bool(np.isfinite(self.values("b")).all())

    @property
    def why_no_b(self) -> str:
        """Remark with the number of events where they are too few."""
        counted = [value.events for values in self.b_values().values() for value in values]
        return (
            f"too few events: {min(counted)} to {max(counted)} from the cut on, {MIN_EVENTS_FOR_B} needed in every run"
        )

    @property
    def count(self) -> int:
        """Number of runs of each variant."""
        return min(len(runs) for runs in self.runs.values())

    @property
    def same_scene(self) -> bool:
        """True if the runs of a pair differ by their scheme alone, so that their particles can be compared."""
        return set(self.runs) == {"explicit", "multigrid"}

    @property
    def alike(self) -> int:
        """Number of pairs in which the same particles fail."""
        return sum(np.array_equal(one.failed, other.failed) for one, other in zip(*self.runs.values(), strict=True))


def read_pairs(variants: tuple[Variant, Variant], increments: list[int]) -> Pairs:
    """The runs of two variants that differ by their scheme alone or, with one scheme, by a mirror."""
    schemes = [variant.mine.settings.solver.scheme for variant in variants]
    names = schemes if schemes[0] != schemes[1] else [variant.mine.name.partition("-")[2] for variant in variants]
    return Pairs({name: list(read_runs(variant, increments)) for name, variant in zip(names, variants, strict=True)})


def read_runs(variant: Variant, increments: list[int]) -> Iterator[Run]:
    """Runs of a variant: the members of its ensemble, or, without one, one for each number of increments.

    One of those may be the variant's own. The others are computed here from its grid and elastic state, since starting
    a process for each stage would cost more than the stages of these small scenes.
    """
    if variant.mine.settings.ensemble:
        for number in range(1, variant.mine.members + 1):
            states = [variant.read(f"ensemble/{number}/steps/{step}.nc") for step in variant.step_names]
            yield describe(states, variant.mine.member(number))
        return
    use_threads(1)
    for parts in increments:
        mine = with_increments(variant.mine, parts)
        own = parts == variant.mine.settings.solver.increments
        states = [variant.step(step) for step in variant.step_names] if own else compute(mine, variant)
        yield describe(states, mine)


def with_increments(mine: Mine, increments: int) -> Mine:
    """Copy of the mine whose steps are unloaded in `increments` increments."""
    changed = copy.copy(mine)
    changed.change("solver", increments=increments)
    return changed


def compute(mine: Mine, variant: Variant) -> list[xr.Dataset]:
    """States after each step, by the ordinary stage. Raises InputError where a step finds no equilibrium."""
    states = [variant.elastic]
    with TemporaryDirectory() as folder:
        for step in mine.mined_steps:
            try:
                scene = parse_scene(mine.mechanics_slice(mine.step_index(step)))
                states.append(mining_step(scene, variant.grid, states[-1], Path(folder) / "failed.npz")[0])
            except InputError as error:
                parts = mine.settings.solver.increments
                raise InputError(f"{mine.name}, {parts} increments, step {step}: {error}") from error
    return states[1:]


def describe(states: list[xr.Dataset], mine: Mine) -> Run:
    """Run of these states."""
    last = states[-1]
    events = extract_events(last, mine.catalogue_slice())[0]
    return Run(
        potency=float(potency(last.seismic_strain.values, last.volume.values).sum()),
        failed_volume=float(last.attrs["failed_volume"]),
        failed=last.failed.values >= 0,
        sizes=log_potency(events.potency.values[events.resolved.values == 1]),
        floor=float(events.attrs["potency_floor"]),
        iterations=sum(int(state.attrs["iterations"]) for state in states),
        in_parts=sum(_generations_in_parts(state) for state in states),
    )


def _generations_in_parts(state: xr.Dataset) -> int:
    """Number of generations of failure after which a subdomain reached equilibrium before the whole mine."""
    part = state.convergence_cells.values < state.sizes["cell"]
    generations = state.convergence_increment.values[part], state.convergence_generation.values[part]
    return len(np.unique(np.stack(generations), axis=1).T)


@dataclass(frozen=True)
class Means:
    """A quantity of the runs (run,) of two variants: the difference of their means and its standard error."""

    first: np.ndarray
    other: np.ndarray

    @property
    def difference(self) -> float:
        """Mean of the other variant less that of the first."""
        return float(self.other.mean() - self.first.mean())

    @property
    def error(self) -> float:
        """Standard error of the difference, runs taken as independent samples: sqrt(s1^2 / n1 + s2^2 / n2)."""
        return float(np.sqrt(sum(runs.var(ddof=1) / len(runs) for runs in (self.first, self.other))))

    @property
    def apart(self) -> float:
        """Difference in standard errors. It is 0 without a difference, else infinite where the runs do not scatter."""
        if self.difference == 0.0:
            return 0.0
        return abs(self.difference) / self.error if self.error else np.inf

    @property
    def pair_error(self) -> float:
        """Standard error of the mean difference of pairs."""
        return float(sem(self.other - self.first))


def answer(results: Results) -> tuple[list[Row], Figure]:
    """Rows and figure of the study."""
    settings, variants = results.settings, results.variants
    elastic = {
        scene: {name: variants[name] for name in results.present(names)} for scene, names in settings["elastic"].items()
    }
    brittle = {
        scene: read_pairs((variants[first], variants[second]), settings.get("increments", []))
        for scene, (first, second) in settings["brittle"].items()
        if len(results.present((first, second))) == 2
    }
    rows = []
    for schemes in elastic.values():
        rows += elastic_rows(schemes, results.allowed["stress"])
    for scene, pairs in brittle.items():
        rows += brittle_rows(scene, pairs, results.allowed)
    return rows, draw({scene: schemes for scene, schemes in elastic.items() if schemes}, brittle)


def elastic_rows(schemes: dict[str, Variant], allowed: float) -> list[Row]:
    """Difference of elastic stress for each pair of schemes."""
    rows = []
    for (one, first), (other, second) in combinations(schemes.items(), 2):
        states = first.elastic, second.elastic
        error, largest = stress_difference(*states, first)
        iterations = " and ".join(f"{state.attrs['iterations']}" for state in states)
        left = max(float(state.attrs["unbalanced_ratio"]) for state in states)
        remark = f"{iterations} iterations to {left:.1e}; at most {largest:.1e} at a particle"
        quantity = f"{one} and {other}: elastic stress, r.m.s. difference over all rock, share of virgin stress"
        rows.append(vanishing(quantity, error, allowed, remark))
    return rows


def stress_difference(one: xr.Dataset, other: xr.Dataset, variant: Variant) -> tuple[float, float]:
    """R.m.s. difference of stress over all rock, by volume, and largest difference, both over r.m.s. virgin stress.

    The size of a tensor is sqrt(s_ij s_ij).
    """
    rock = np.flatnonzero((one.volume.values > 0.0) & (one.excavation.values < 0))
    volume = one.volume.values[rock]
    virgin = variant.scene().insitu.at(one.position.values[rock, 2])
    gap = one.stress.values[rock] - other.stress.values[rock]
    squares = [np.square(stress) @ VOIGT_MULTIPLICITY for stress in (gap, virgin)]
    far = np.sqrt(np.average(squares[1], weights=volume))
    return float(np.sqrt(np.average(squares[0], weights=volume)) / far), float(np.sqrt(squares[0].max()) / far)


def brittle_rows(scene: str, pairs: Pairs, allowed: dict[str, float]) -> list[Row]:
    """Means of both schemes and their scatter, the mean difference of pairs where it has a bound, and equal pairs."""
    rows = []
    for quantity, (name, bound) in QUANTITIES.items():
        what = f"{scene}, brittle: {name}"
        if quantity == "b" and not pairs.has_b:
            rows.append(reported(f"{what}, mean", np.nan, pairs.why_no_b))
            continue
        means = Means(*pairs.values(quantity))
        mean = float(means.first.mean())
        spread = " and ".join(f"{runs.std(ddof=1):.2g}" for runs in (means.first, means.other))
        remark = (
            f"standard deviation of runs {spread}, standard error {means.error:.2g}; "
            f"pairs differ by {means.difference:.2g} ± {means.pair_error:.2g}"
        )
        by = allowed["standard_errors"]
        compared = f"means of {pairs.count} runs, {' and '.join(pairs.runs)}, apart in standard errors"
        rows.append(Row(f"{what}, {compared}", mean, mean + means.difference, means.apart, by, remark))
        if bound and pairs.same_scene:
            share = means.difference / mean
            compared = "mean difference of pairs, share of the mean"
            rows.append(vanishing(f"{what}, {compared}", share, allowed[bound]))
    if not pairs.same_scene:
        return rows
    taken = " and ".join(f"{np.mean([run.iterations for run in runs]):.0f}" for runs in pairs.runs.values())
    quantity = f"{scene}, brittle: pairs in which the very same rock fails"
    parts = " and ".join(f"{np.mean([run.in_parts for run in runs]):.0f}" for runs in pairs.runs.values())
    remark = f"{taken} iterations a run; {parts} generations in parts of the mine"
    rows.append(Row.absolute(quantity, pairs.count, pairs.alike, None, remark))
    return rows


def draw(elastic: dict[str, dict[str, Variant]], brittle: dict[str, Pairs]) -> Figure:
    """Convergence of each elastic scene in one row, then one row for each brittle scene."""
    figure = style.new_figure(height=2.7 * (bool(elastic) + len(brittle)))
    rows = figure.subfigures(bool(elastic) + len(brittle), 1, squeeze=False)[:, 0]
    if elastic:
        panels = rows[0].subplots(1, len(elastic), squeeze=False)[0]
        for axes, (scene, schemes) in zip(panels, elastic.items(), strict=True):
            draw_convergence(axes, scene, schemes)
        rows[0].legend(*panels[0].get_legend_handles_labels(), loc="outside upper left", ncols=3)
    for row, (scene, pairs) in zip(rows[len(rows) - len(brittle) :], brittle.items(), strict=True):
        for axes, quantity in zip(row.subplots(1, len(LABELS)), LABELS, strict=True):
            draw_pairs(axes, quantity, pairs)
            axes.set_title(f"{scene}, brittle" if quantity == "potency" else "")
    return figure


def draw_convergence(axes: Axes, scene: str, schemes: dict[str, Variant]) -> None:
    """Unbalanced force against iterations."""
    lines, marks = {}, []
    for variant in schemes.values():
        state, solver = variant.elastic, variant.values["solver"]
        name, mark = LINES[solver["scheme"], bool(solver["density_scaling"])]
        iteration = np.maximum(state.convergence_iteration.values, 1)
        lines[name] = iteration, state.convergence_unbalanced_ratio.values
        marks.append(mark)
    axes.axhline(solver["tolerance"], color=style.OUTLINE, linewidth=0.6, linestyle=":")
    names: dict = {"title": f"{scene}, elastic", "xlabel": "iterations", "ylabel": "unbalanced force"}
    plot_series(axes, lines, marks=marks, legend=None, xscale="log", yscale="log", **names)


def draw_pairs(axes: Axes, quantity: str, pairs: Pairs) -> None:
    """Runs of both variants with lines that join pairs, and beside them mean and standard error."""
    axes.set(xlim=(-0.5, 1.5), ylabel=LABELS[quantity])
    axes.set_xticks([0, 1], [name.replace("_", "\n") for name in pairs.runs])
    if quantity == "b" and not pairs.has_b:
        axes.set_yticks([])
        axes.text(0.5, 0.5, "too few events", transform=axes.transAxes, ha="center", color=style.OUTLINE)
        return
    both = pairs.values(quantity)
    if quantity == "events":
        axes.yaxis.set_major_locator(MaxNLocator(nbins="auto", integer=True))
    axes.plot([0, 1], both, color=style.BEFORE_RECORD, linewidth=0.7, zorder=1)
    for place, side, colour, values in zip((0, 1), (-1, 1), COLOURS, both, strict=False):
        axes.plot(np.full(len(values), place), values, "o", markersize=3.5, color=colour)
        at = place + side * MEAN_OFFSET
        axes.errorbar(at, values.mean(), sem(values), fmt="D", markersize=4.5, capsize=4.0, color=colour)
