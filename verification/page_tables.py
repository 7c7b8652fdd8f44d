"""A study's table as Markdown: all rows, or those that a study sets side by side (`on_page.py` beside its answer)."""

import math
import re
from collections.abc import Callable, Iterable
from dataclasses import dataclass

import pandas as pd

from verification.known_misses import KNOWN_MISS, PASSES_NOW
from verification.rows import VERDICTS

SAID = {
    VERDICTS[True]: "passes",
    PASSES_NOW: "passes, listed as a known miss",
    VERDICTS[False]: "**fails**",
    KNOWN_MISS: "**known miss**",
    VERDICTS[None]: "reported",
}
MARKED = {VERDICTS[None]: "*{}*", VERDICTS[False]: "**{} fails**", KNOWN_MISS: "**{}**"}  # of a cell; plain: passes
LEGEND = "Plain numbers are within their bound, bold ones are known misses, and those in italics have no bound."
CASE = re.compile(r"(?:([^(]*?): )?(.*)")  # a colon in brackets explains the quantity
COLUMNS = ("quantity", "case", "measured", "expected", "error", "bound", "verdict")


def number(text: str, digits: int = 4) -> str:
    """A number of a table with so many digits; an empty one stays empty."""
    return f"{float(text):.{digits}g}" if text else ""


SHOWN: dict[str, Callable[[dict[str, str]], str]] = {
    "measured": lambda row: number(row["obtained"]),
    "error": lambda row: number(row["error"], 2),
    "error, %": lambda row: f"{100 * float(row['error']):.2g}" if row["error"] else "",
    "change, %": lambda row: f"{100 * (float(row['obtained']) / float(row['expected']) - 1):+.1f}",
}


@dataclass(frozen=True)
class Pivot:
    """Rows of rows.csv side by side. title: what its numbers are; shows: a key of SHOWN.

    pattern: what the quantity of such a row looks like, with the groups `row` and `column`.
    """

    title: str
    pattern: str
    shows: str

    def place(self, row: dict[str, str]) -> tuple[str, str] | None:
        """Row and column of the pivot that a row of rows.csv stands at; None where it belongs elsewhere."""
        found = re.fullmatch(self.pattern, row["quantity"])
        return (found["row"], found["column"]) if found else None

    def lines(self, rows: list[dict[str, str]]) -> list[str]:
        """Its title and its table of those rows that belong here."""
        cells = {place: row for row in rows if (place := self.place(row))}
        if len(cells) != len(rows):
            raise ValueError(f"two rows stand at one place of '{self.title}'")
        names, columns = (list(dict.fromkeys(place[axis] for place in cells)) for axis in (0, 1))
        body = []
        for name in names:
            shown = (cells.get((name, column)) for column in columns)
            body.append([name, *(self._cell(row) if row else "" for row in shown)])
        return [f"{self.title}:", "", *markdown(["", *columns], body)]

    def _cell(self, row: dict[str, str]) -> str:
        text = SHOWN[self.shows](row)
        return MARKED.get(row["passed"], "{}").format(text) if text else ""


@dataclass(frozen=True)
class Columns:
    """Some columns of a table.csv, one line a row."""

    title: str
    names: tuple[str, ...]

    def lines(self, table: pd.DataFrame) -> list[str]:
        """Its title and its table."""
        rows = [[_text(value) for value in row] for row in table[list(self.names)].itertuples(index=False)]
        return [f"{self.title}:", "", *markdown([name.replace("_", " ") for name in self.names], rows)]


@dataclass(frozen=True)
class Counts:
    """How many rows of a table.csv have each pair of values of two columns."""

    title: str
    row: str
    column: str

    def lines(self, table: pd.DataFrame) -> list[str]:
        """Its title and its table."""
        counts = pd.crosstab(table[self.row].fillna("none"), table[self.column])
        body = [
            [str(name), *(str(count) for count in row)] for name, row in zip(counts.index, counts.values, strict=True)
        ]
        return [f"{self.title}:", "", *markdown([self.row, *map(str, counts.columns)], body)]


@dataclass(frozen=True)
class Cross:
    """One column of a table.csv by two others. by: columns that name a line, together."""

    title: str
    by: tuple[str, ...]
    column: str
    value: str

    def lines(self, table: pd.DataFrame) -> list[str]:
        """Its title and its table."""
        columns = sorted(table[self.column].unique())
        body = []
        for names, rows in table.groupby(list(self.by), sort=False):
            values = rows.set_index(self.column)[self.value]
            body.append([*map(str, names), *(_text(values.get(column, math.nan)) for column in columns)])
        return [f"{self.title}:", "", *markdown([*self.by, *(f"{column:,}" for column in columns)], body)]


def rows_table(rows: list[dict[str, str]]) -> list[str]:
    """Rows one by one: what stands before the first colon of a quantity is its case."""
    body = []
    for row in rows:
        case, quantity = CASE.findall(row["quantity"])[0]
        numbers = [number(row["obtained"]), number(row["expected"]), number(row["error"], 2), number(row["allowed"], 3)]
        body.append([quantity, case, *numbers, SAID[row["passed"]]])
    return markdown(COLUMNS, body)


def markdown(head: Iterable[str], body: Iterable[Iterable[str]]) -> list[str]:
    """Lines of a table; an empty head cell is a blank."""
    lines = [list(head), *map(list, body)]
    text = ["| " + " | ".join(cell.replace("|", r"\|").replace("<", r"\<") for cell in line) + " |" for line in lines]
    return [text[0], "|" + " --- |" * len(lines[0]), *text[1:]]


def _text(value) -> str:
    """A value of a table.csv: numbers with four digits, nothing for what is missing."""
    if isinstance(value, float):
        return "" if math.isnan(value) else f"{value:.4g}"
    return str(value)
