"""Verdict of the target: it fails for a fault, and for an error beyond what is known."""

import logging
from pathlib import Path

import pandas as pd

from common.errors import InputError


def check_table(table: Path, page: str) -> None:
    """Raise InputError, one line, that counts the failing cases and names the first of them."""
    rows = pd.read_csv(table, keep_default_na=False)
    failing = rows[rows.fails == "yes"]
    for row in failing.itertuples():
        logging.error("%s, %s at %s: %s %s %s", row.knob, row.series, row.value, row.kind, row.error, row.message)
    if len(failing):
        first = failing.iloc[0]
        raise InputError(
            f"{len(failing)} of {len(rows)} cases are faults or wrong beyond what is known (first: {first.knob}, "
            f"{first.series} at {first.value}: {first.kind}); see {page}"
        )
