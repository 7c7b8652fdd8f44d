"""The table of a verification: one row per compared quantity, and the rows that are known to miss their bound.

The study file lists known misses with their cause. They never count as passed.
"""

import csv
import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

from common.datasets import atomic_path
from common.errors import InputError

COLUMNS = ("scene", "quantity", "expected", "obtained", "error", "allowed", "passed", "remark")
VERDICTS = {True: "yes", False: "no", None: ""}
KNOWN_MISS = "known miss"
PASSES_NOW = "yes, listed as a known miss"


@dataclass(frozen=True)
class Row:
    """One comparison.

    quantity: thing, place and unit. error, allowed: in the same terms; a row without an allowed error is reported only.
    remark: why the row fails, or what it means.
    """

    quantity: str
    expected: float
    obtained: float
    error: float
    allowed: float | None = None
    remark: str = ""

    @classmethod
    def relative(
        cls, quantity: str, expected: float, obtained: float, allowed: float | None = None, remark: str = ""
    ) -> "Row":
        """A row whose error is |obtained - expected| / |expected|. The expected value must not be zero."""
        return cls(quantity, expected, obtained, abs(obtained - expected) / abs(expected), allowed, remark)

    @classmethod
    def absolute(
        cls, quantity: str, expected: float, obtained: float, allowed: float | None = None, remark: str = ""
    ) -> "Row":
        """A row whose error is |obtained - expected|."""
        return cls(quantity, expected, obtained, abs(obtained - expected), allowed, remark)

    @classmethod
    def at_least(cls, quantity: str, obtained: float, least: float, remark: str = "") -> "Row":
        """A row without theory whose error is what the obtained value lacks of `least`; the remark states `least`."""
        lacks = 0.0 if obtained >= least else least - obtained  # NaN stays NaN, which does not pass
        return cls(quantity, math.nan, obtained, lacks, 0.0, _joined(f"At least {least:g}.", remark))

    @property
    def passed(self) -> bool | None:
        """True if the error is finite and at most the allowed one; None where the row has no bound."""
        if self.allowed is None:
            return None
        return bool(math.isfinite(self.error) and self.error <= self.allowed)

    def texts(self, scene: str) -> dict[str, str]:
        """The row as the table holds it, by column. Numbers have six digits."""
        numbers = (self.expected, self.obtained, self.error, self.allowed)
        written = ("" if value is None or math.isnan(value) else f"{value:.6g}" for value in numbers)
        return dict(zip(COLUMNS, (scene, self.quantity, *written, VERDICTS[self.passed], self.remark), strict=True))


def write_texts(path: Path, rows: Iterable[dict[str, str]]) -> None:
    """Write rows that are texts already as CSV, atomically."""
    with atomic_path(path) as temporary, temporary.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, COLUMNS)
        writer.writeheader()
        writer.writerows(rows)


def read_rows(path: Path) -> list[dict[str, str]]:
    """Rows of a table as written, by column."""
    with Path(path).open(newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


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
