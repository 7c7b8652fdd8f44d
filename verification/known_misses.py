"""Rows that are known to miss their bound. The study file lists them with the cause; they never count as passed."""

import math
from collections.abc import Mapping
from dataclasses import dataclass

from common.errors import InputError
from verification.rows import VERDICTS

KNOWN_MISS = "known miss"
PASSES_NOW = "yes, listed as a known miss"


@dataclass(frozen=True)
class KnownMiss:
    """Why a row misses its bound, and its largest known error. A larger error than `at_most` is a failure again."""

    cause: str
    at_most: float


def parse_known_misses(entries) -> dict[str, KnownMiss]:
    """Known misses by the quantity of their row, from `known_misses` of a study file.

    entries: a list of {cause, rows}, where rows maps a quantity to the largest error that is known. Raises InputError.
    """
    found = {}
    for number, entry in enumerate(entries or [], start=1):
        if not isinstance(entry, dict) or set(entry) != {"cause", "rows"} or not isinstance(entry["rows"], dict):
            raise InputError(f"entry {number}: takes a cause and rows, which map a quantity to its largest error")
        cause = " ".join(str(entry["cause"]).split())
        for quantity, at_most in entry["rows"].items():
            if quantity in found:
                raise InputError(f"'{quantity}' is listed twice")
            if isinstance(at_most, bool) or not isinstance(at_most, int | float) or not math.isfinite(at_most):
                raise InputError(f"'{quantity}' takes a number, the largest error that is known")
            found[quantity] = KnownMiss(cause, float(at_most))
    return found


def judge(rows: list[dict[str, str]], known: Mapping[str, KnownMiss]) -> list[dict[str, str]]:
    """Rows with the verdicts of the known misses among them, and their cause as a remark.

    Raises InputError if a known miss is not a row of the study.
    """
    missing = [quantity for quantity in known if quantity not in {row["quantity"] for row in rows}]
    if missing:
        raise InputError(f"known_misses: '{missing[0]}' is not a row of the study")
    return [_judged(row, known.get(row["quantity"])) for row in rows]


def _judged(row: dict[str, str], known: KnownMiss | None) -> dict[str, str]:
    if known is None:
        return row
    if row["passed"] == VERDICTS[True]:
        return row | {"passed": PASSES_NOW}
    if row["passed"] != VERDICTS[False]:
        raise InputError(f"known_misses: '{row['quantity']}' has no bound that it could miss")
    if row["error"] and float(row["error"]) <= known.at_most:
        return row | {"passed": KNOWN_MISS, "remark": _joined(f"Cause: {known.cause}", row["remark"])}
    beyond = f"Known to miss its bound by at most {known.at_most:g}; this error is larger."
    return row | {"remark": _joined(beyond, row["remark"])}


def _joined(*remarks: str) -> str:
    return " ".join(remark for remark in remarks if remark)
