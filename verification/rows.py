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
    """One comparison. `error` is in the terms of `allowed`; without an allowed error the row is reported only.

    quantity names thing, place and unit; remark says why a row fails or what it means.
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
        """A row whose error is |obtained - expected| / |expected|; what is expected must not be zero."""
        return cls(quantity, expected, obtained, abs(obtained - expected) / abs(expected), allowed, remark)

    @property
    def passed(self) -> bool | None:
        """Whether the error is finite and allowed; None where nothing is demanded."""
        if self.allowed is None:
            return None
        return bool(math.isfinite(self.error) and self.error <= self.allowed)


def write_rows(path: Path, rows: Iterable[tuple[str, Row]]) -> None:
    """Write (scene, row) pairs as CSV, atomically; numbers with six digits."""

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
