"""Variances of a catalogue's numbers by source, and the share of each in their sum.

A run that is loaded in another way, or has other cells, is another realisation as well, since other rock fails first.
The variance that its source adds is therefore that between its runs less that between members, and at least zero.
Closeness counts the same rock in another way, so nothing is subtracted. The sum takes the sources as independent. Other
values of a source would give another variance.
"""

from dataclasses import dataclass

import numpy as np
import pandas as pd
from scipy.stats import chi2

from catalogs.sources.size_law import FEW, NONE, TRUNCATED
from verification.spread.runs import CELLS, LOADING, MEMBERS, QUANTITIES, SOURCES, Catalogue, Quantity

MIN_VALUES = 3  # Fewer values are given no variance.
ALSO_CHANCE = (LOADING, CELLS)  # Sources whose runs differ by chance as well.
WHY = {FEW: "too few events", TRUNCATED: "a law with an upper end", NONE: "no power law"}


@dataclass(frozen=True)
class Variance:
    """Variance of a quantity over the runs of a source.

    values (run,): NaN where the quantity is not defined. why: how many values are missing, and why. total: variance
    between runs. own: what the source adds to that between members. share: own over the sum of all sources. total, own
    and share are NaN of fewer than MIN_VALUES values.
    """

    source: str
    quantity: Quantity
    labels: list[str]
    values: np.ndarray
    why: str
    total: float
    own: float
    share: float

    @property
    def defined(self) -> np.ndarray:
        """Values that are defined."""
        return self.values[np.isfinite(self.values)]

    @property
    def deviation(self) -> float:
        """Standard deviation between runs."""
        return float(np.sqrt(self.total))

    @property
    def interval(self) -> tuple[float, float]:
        """95 % interval of the standard deviation for normal values; NaN except for members, which are random draws."""
        count = len(self.defined)
        if self.source != MEMBERS or not np.isfinite(self.total):
            return np.nan, np.nan
        lower, upper = (float(np.sqrt(self.total * (count - 1) / chi2.ppf(p, count - 1))) for p in (0.975, 0.025))
        return lower, upper


def variances(sources: dict[str, list[Catalogue]]) -> list[Variance]:
    """Variance of every quantity by every source, source by source within each quantity."""
    return [variance for quantity in QUANTITIES for variance in _of_quantity(quantity, sources)]


def _of_quantity(quantity: Quantity, sources: dict[str, list[Catalogue]]) -> list[Variance]:
    values = {source: np.array([quantity.of(run) for run in runs], float) for source, runs in sources.items()}
    total = {source: _variance(found) for source, found in values.items()}
    chance = total[MEMBERS]
    own = {source: max(0.0, found - chance) if source in ALSO_CHANCE else found for source, found in total.items()}
    own = {source: own[source] if np.isfinite(chance) else np.nan for source in own}
    together = sum(own.values())  # NaN where one is unknown.
    return [
        Variance(
            source,
            quantity,
            [run.label for run in runs],
            values[source],
            _why(quantity, values[source], runs),
            total[source],
            own[source],
            own[source] / together if together else np.nan,
        )
        for source, runs in sources.items()
    ]


def _variance(values: np.ndarray) -> float:
    known = values[np.isfinite(values)]
    return float(known.var(ddof=1)) if len(known) >= MIN_VALUES else np.nan


def _why(quantity: Quantity, values: np.ndarray, runs: list[Catalogue]) -> str:
    """Number of runs that do not define the quantity, and why; empty where all do."""
    without = [run for run, value in zip(runs, values, strict=True) if not np.isfinite(value)]
    if not without:
        return ""
    reasons = [WHY[run.law] for run in without] if quantity.key == "b" else ["no resolved event"] * len(without)
    counted = ", ".join(f"{reason} in {reasons.count(reason)}" for reason in dict.fromkeys(reasons))
    return f"{counted} of {len(runs)}"


def make_table(studies: dict[str, list[Variance]]) -> pd.DataFrame:
    """One row for each scene, quantity and source. Potency and number are logarithms: 0.1 is a factor of 1.26."""
    rows = []
    for scene, found in studies.items():
        for variance in found:
            known, (lower, upper) = variance.defined, variance.interval
            rows.append(
                {
                    "scene": scene,
                    "quantity": variance.quantity.title,
                    "source": SOURCES[variance.source],
                    "runs": " ".join(f"[{label}]" for label in variance.labels),
                    "defined_in": len(known),
                    "mean": known.mean() if len(known) else np.nan,
                    "least": known.min(initial=np.inf) if len(known) else np.nan,
                    "largest": known.max(initial=-np.inf) if len(known) else np.nan,
                    "standard_deviation": variance.deviation,
                    "lower_95": lower,
                    "upper_95": upper,
                    "variance": variance.total,
                    "variance_of_its_own": variance.own,
                    "share": variance.share,
                    "not_defined": variance.why,
                }
            )
    return pd.DataFrame(rows)
