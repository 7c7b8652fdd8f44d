"""Schemes `explicit` and `multigrid` compared: the same elastic equilibrium, and brittle failure alike on average."""

from dataclasses import dataclass
from itertools import combinations

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from verification.answers.schemes.figure import draw
from verification.answers.schemes.runs import Pairs, read_pairs
from verification.page_tables import Pivot
from verification.results import Results, Variant
from verification.rows import Row

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

# How often each Voigt component stands in a sum over the tensor.
VOIGT_MULTIPLICITY = np.array([1.0, 1.0, 1.0, 2.0, 2.0, 2.0])
# Quantities of a run: name, and short name of the bound on the mean difference of pairs, where there is one.
QUANTITIES = {
    "potency": ("seismic potency, m3", "pairs"),
    "failed_volume": ("failed volume, m3", "pairs"),
    "events": ("number of events", None),
    "b": ("b of log potency", None),
}


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
        pairs = self.other - self.first
        return float(pairs.std(ddof=1) / np.sqrt(len(pairs)))


def answer(results: Results) -> tuple[list[Row], Figure]:
    """Rows and figure of the study."""
    settings, variants = results.settings, results.variants
    elastic = {
        scene: {name: variants[name] for name in names if name in variants}
        for scene, names in settings["elastic"].items()
    }
    brittle = {
        scene: read_pairs((variants[first], variants[second]), settings.get("increments", []))
        for scene, (first, second) in settings["brittle"].items()
        if first in variants and second in variants
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
        rows.append(Row(quantity, 0.0, error, error, allowed, remark))
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
            rows.append(Row(f"{what}, mean", np.nan, np.nan, np.nan, None, pairs.why_no_b))
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
            rows.append(Row(f"{what}, {compared}", 0.0, share, abs(share), allowed[bound]))
    if not pairs.same_scene:
        return rows
    taken = " and ".join(f"{np.mean([run.iterations for run in runs]):.0f}" for runs in pairs.runs.values())
    quantity = f"{scene}, brittle: pairs in which the very same rock fails"
    alike, count = pairs.alike, pairs.count
    parts = " and ".join(f"{np.mean([run.in_parts for run in runs]):.0f}" for runs in pairs.runs.values())
    remark = f"{taken} iterations a run; {parts} generations in parts of the mine"
    rows.append(Row(quantity, count, alike, count - alike, None, remark))
    return rows
