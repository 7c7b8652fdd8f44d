"""Variances of a catalogue's numbers by source, and the share of each in their sum.

A run that is loaded in another way, or has other cells, is another realisation as well, since other rock fails first.
The variance that its source adds is therefore that between its runs less that between members, and at least zero.
Closeness counts the same rock in another way, so nothing is subtracted. The sum takes the sources as independent. Other
values of a source would give another variance.
"""

from collections import Counter
from itertools import product

import numpy as np
import pandas as pd
from scipy.stats import chi2

from catalogs.sources.size_law import FEW, NONE, TRUNCATED
from verification.catalog_spread.runs import CELLS, LOADING, MEMBERS, QUANTITIES, Catalogue

MIN_VALUES = 3  # Fewer values are given no variance.
ALSO_CHANCE = (LOADING, CELLS)  # Sources whose runs differ by chance as well.
WHY = {FEW: "too few events", TRUNCATED: "a law with an upper end", NONE: "no power law"}
COLUMNS = (
    *("quantity", "source", "runs", "defined_in", "mean", "least", "largest", "standard_deviation"),
    *("lower_95", "upper_95", "variance", "variance_of_its_own", "share", "not_defined"),
)


def values_of(sources: dict[str, list[Catalogue]]) -> pd.DataFrame:
    """One row for each quantity, source and run.

    run: its label. value: NaN where the run does not define the quantity. lacks: then why, else empty.
    """
    rows = []
    for quantity, (source, runs) in product(QUANTITIES, sources.items()):
        for run in runs:
            value, lacks = quantity.of(run), ""
            if not np.isfinite(value):
                value, lacks = np.nan, WHY[run.law] if quantity.key == "b" else "no resolved event"
            rows.append((quantity.title, source, run.label, value, lacks))
    return pd.DataFrame(rows, columns=["quantity", "source", "run", "value", "lacks"])


def variances(values: pd.DataFrame) -> pd.DataFrame:
    """One row, of COLUMNS, for each quantity and source of `values_of`, source by source within each quantity.

    runs: their labels. defined_in: number of values that are defined; mean, least and largest are theirs. variance:
    between runs; NaN of fewer than MIN_VALUES values. variance_of_its_own: what the source adds to that between
    members. share: of this in the sum of all sources. Where one of the variances is NaN, what its source adds is not
    known, and no share is. lower_95, upper_95: interval of the standard deviation for normal values; NaN except for
    members, which are random draws. not_defined: how many values are missing, and why.
    """
    table = values.groupby(["quantity", "source"], sort=False, as_index=False).agg(
        runs=("run", lambda labels: " ".join(f"[{label}]" for label in labels)),
        defined_in=("value", "count"),
        mean=("value", "mean"),
        least=("value", "min"),
        largest=("value", "max"),
        variance=("value", _variance),
        not_defined=("lacks", _reasons),
    )
    of_members = table["source"] == MEMBERS
    chance = table["quantity"].map(table[of_members].set_index("quantity")["variance"])
    is_chance = table["source"].isin(ALSO_CHANCE)
    own = (table["variance"] - chance.where(is_chance, 0.0)).clip(lower=0.0)
    own = own.where(chance.notna())
    together = own.groupby(table["quantity"]).transform(lambda part: part.sum(skipna=False))  # NaN where one is.
    freedom = table["defined_in"] - 1
    spread = (table["variance"] * freedom).where(of_members)
    table = table.assign(
        standard_deviation=np.sqrt(table["variance"]),
        lower_95=np.sqrt(spread / chi2.ppf(0.975, freedom)),
        upper_95=np.sqrt(spread / chi2.ppf(0.025, freedom)),
        variance_of_its_own=own,
        share=own / together,
    )
    return table[list(COLUMNS)]


def _variance(values: pd.Series) -> float:
    known = values.dropna().to_numpy()
    return float(known.var(ddof=1)) if len(known) >= MIN_VALUES else np.nan


def _reasons(lacks: pd.Series) -> str:
    """Number of runs that do not define the quantity, and why; empty where all do."""
    reasons = Counter(lacks[lacks != ""])
    counted = ", ".join(f"{reason} in {count}" for reason, count in reasons.items())
    return f"{counted} of {len(lacks)}" if reasons else ""
