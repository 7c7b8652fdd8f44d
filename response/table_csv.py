"""A table of this package as a CSV file, whose header has the units."""

import csv
import os
from collections.abc import Sequence

import numpy as np
import xarray as xr

from common.datasets import atomic_path
from common.fields import Field

DIGITS = 6
ROWS_AT_ONCE = 50_000  # As text a row takes several times the memory that it takes as numbers.


def write_csv(table: xr.Dataset, fields: Sequence[Field], path: str | os.PathLike) -> None:
    """Write the table, one row below another, atomically; an empty field where there is no number."""
    header = [f"{field.name}_{field.unit}" if field.unit not in ("", "1") else field.name for field in fields]
    columns = [table[field.name].values for field in fields]
    with atomic_path(path) as temporary, temporary.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(header)
        for start in range(0, len(columns[0]), ROWS_AT_ONCE):
            texts = (_text(column[start : start + ROWS_AT_ONCE]) for column in columns)
            writer.writerows(zip(*texts, strict=True))


def _text(values: np.ndarray) -> list[str]:
    """Values as fields of a CSV file."""
    if values.dtype.kind == "f":
        return ["" if np.isnan(value) else f"{value:.{DIGITS}g}" for value in values]
    return [str(value) for value in values]
