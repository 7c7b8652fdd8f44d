"""A table of this package as a CSV file, whose header has the units."""

import os
from collections.abc import Sequence

import numpy as np
import xarray as xr

from common.datasets import atomic_path
from common.fields import Field

DIGITS = 6


def write_csv(table: xr.Dataset, fields: Sequence[Field], path: str | os.PathLike) -> None:
    """Write the table, one row below another, atomically; an empty field where there is no number."""
    header = [f"{field.name}_{field.unit}" if field.unit not in ("", "1") else field.name for field in fields]
    columns = [_text(table[field.name].values) for field in fields]
    with atomic_path(path) as temporary:
        lines = [",".join(header), *(",".join(row) for row in zip(*columns, strict=True))]
        temporary.write_text("\n".join(lines) + "\n", encoding="utf-8")


def _text(values: np.ndarray) -> list[str]:
    """Values as fields of a CSV file. Names of excavations and steps hold no comma, as the mine file is checked."""
    if values.dtype.kind == "f":
        return ["" if np.isnan(value) else f"{value:.{DIGITS}g}" for value in values]
    return [str(value) for value in values]
