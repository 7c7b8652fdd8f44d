"""The table of a verification: one row per compared quantity."""

import csv
import math
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from common.datasets import atomic_path

COLUMNS = ("scene", "quantity", "expected", "obtained", "error", "allowed", "passed", "remark")
VERDICTS = {True: "yes", False: "no", None: ""}


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

    @property
    def passed(self) -> bool | None:
        """Whether the error is finite and allowed; None where the row has no bound."""
        if self.allowed is None:
            return None
        return bool(math.isfinite(self.error) and self.error <= self.allowed)


def write_rows(path: Path, rows: Iterable[tuple[str, Row]]) -> None:
    """Write pairs of scene and row as CSV, atomically. Numbers have six digits."""

    def text(value: float | None) -> str:
        return "" if value is None or math.isnan(value) else f"{value:.6g}"

    with atomic_path(path) as temporary, temporary.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(COLUMNS)
        for scene, row in rows:
            numbers = (text(value) for value in (row.expected, row.obtained, row.error, row.allowed))
            writer.writerow([scene, row.quantity, *numbers, VERDICTS[row.passed], row.remark])


def read_rows(path: Path) -> list[dict[str, str]]:
    """Rows of a table as written, by column."""
    with Path(path).open(newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))
