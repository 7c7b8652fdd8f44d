"""A study's table as Markdown: all rows one by one, and the tables that the study declares for its page."""

import math
import re
from collections.abc import Callable, Iterable
from dataclasses import dataclass

import pandas as pd

from verification.rows import KNOWN_MISS, PASSES_NOW, VERDICTS

VERDICT_TEXTS = {
    VERDICTS[True]: "passes",
    PASSES_NOW: "passes, listed as a known miss",
    VERDICTS[False]: "**fails**",
    KNOWN_MISS: "**known miss**",
    VERDICTS[None]: "reported",
}
# How a cell shows the verdict of its row. A row that passes is plain.
CELL_FORMATS = {VERDICTS[None]: "*{}*", VERDICTS[False]: "**{} fails**", KNOWN_MISS: "**{}**"}
LEGEND = "Plain numbers are within their bound, bold ones are known misses, and those in italics have no bound."
# The case ends at the first colon. A colon in brackets belongs to the quantity.
CASE_AND_QUANTITY = re.compile(r"(?:([^(]*?): )?(.*)")
LARGE = 1e4  # From here on four digits would need an exponent.
COLUMNS = ("quantity", "case", "measured", "expected", "error", "bound", "verdict")


def number(text: str, digits: int = 4) -> str:
    """A number with so many significant digits. An empty text stays empty."""
    return f"{float(text):.{digits}g}" if text else ""


# How a remark states an interval of what was measured.
INTERVAL = re.compile(r"interval[^;]*? (?P<low>[-+.\de]+) to (?P<high>[-+.\de]+)(?:;|$)")


def with_interval(row: dict[str, str]) -> str:
    """What was measured, with three digits, and in brackets the interval that the row's remark states."""
    found = INTERVAL.search(row["remark"])
    return number(row["obtained"], 3) + (f" ({found['low']} to {found['high']})" if found else "")


CELL_TEXTS: dict[str, Callable[[dict[str, str]], str]] = {
    "measured": lambda row: number(row["obtained"]),
    "share": lambda row: f"{float(row['obtained']):.3f} ± {float(row['allowed']):.3f}" if row["obtained"] else "",
    "with interval": with_interval,
    "error": lambda row: number(row["error"], 2),
    "error, %": lambda row: f"{100 * float(row['error']):.2g}" if row["error"] else "",
    "change, %": lambda row: (
        f"{100 * (float(row['obtained']) / float(row['expected']) - 1):+.1f}" if row["obtained"] else ""
    ),
}


@dataclass(frozen=True)
class Pivot:
    """Rows of table.csv side by side.

    title: what the numbers are. pattern: regular expression of the quantity, with the groups `row` and `column`.
    shows: a key of CELL_TEXTS.
    """

    title: str
    pattern: str
    shows: str

    def place(self, row: dict[str, str]) -> tuple[str, str] | None:
        """Row and column of the pivot in which a row of table.csv stands; None where it belongs to no place of it."""
        found = re.fullmatch(self.pattern, row["quantity"])
        return (found["row"], found["column"]) if found else None

    def lines(self, rows: list[dict[str, str]]) -> list[str]:
        """Title and table of rows that all belong here. Raises ValueError where two of them stand in one place."""
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
        text = CELL_TEXTS[self.shows](row)
        return CELL_FORMATS.get(row["passed"], "{}").format(text) if text else ""


TABLE = "table"  # Name, without its ending, of the file of a measuring study's rows; it may write others beside it.
# A column and its values in the rows that a table shows. Empty: all rows.
Chosen = tuple[()] | tuple[str, tuple[str, ...]]


def choose(table: pd.DataFrame, chosen: Chosen) -> pd.DataFrame:
    """The chosen rows of a table.csv."""
    return table[table[chosen[0]].isin(chosen[1])] if chosen else table


@dataclass(frozen=True)
class Columns:
    """Some columns of the CSV `file` of a measuring study, one line for each row. Equal lines stand once."""

    title: str
    names: tuple[str, ...]
    chosen: Chosen = ()
    file: str = TABLE

    def lines(self, table: pd.DataFrame) -> list[str]:
        """Its title and its table; nothing where no row is chosen."""
        shown = choose(table, self.chosen)[list(self.names)].drop_duplicates()
        if shown.empty:
            return []
        rows = [[_text(value) for value in row] for row in shown.itertuples(index=False)]
        return [f"{self.title}:", "", *markdown([name.replace("_", " ") for name in self.names], rows)]


@dataclass(frozen=True)
class Counts:
    """Number of rows of a table.csv for each pair of values of two columns."""

    title: str
    row: str
    column: str
    file: str = TABLE

    def lines(self, table: pd.DataFrame) -> list[str]:
        """Its title and its table."""
        counts = pd.crosstab(table[self.row].fillna("none"), table[self.column])
        body = [
            [str(name), *(str(count) for count in row)] for name, row in zip(counts.index, counts.values, strict=True)
        ]
        return [f"{self.title}:", "", *markdown([self.row, *map(str, counts.columns)], body)]


@dataclass(frozen=True)
class Cross:
    """A value of a table.csv by line and column. by: columns that together name a line; column: names the columns."""

    title: str
    by: tuple[str, ...]
    column: str
    value: str
    chosen: Chosen = ()
    file: str = TABLE

    def lines(self, table: pd.DataFrame) -> list[str]:
        """Its title and its table."""
        table = choose(table, self.chosen)
        columns = sorted(table[self.column].unique())
        body = []
        for names, rows in table.groupby(list(self.by), sort=False):
            values = rows.set_index(self.column)[self.value]
            body.append([*map(str, names), *(_text(values.get(column, math.nan)) for column in columns)])
        return [f"{self.title}:", "", *markdown([*self.by, *map(_heading, columns)], body)]


def rows_table(rows: list[dict[str, str]]) -> list[str]:
    """All rows one by one. The text before the first colon of a quantity is its case."""
    body = []
    for row in rows:
        case, quantity = CASE_AND_QUANTITY.findall(row["quantity"])[0]
        numbers = [number(row["obtained"]), number(row["expected"]), number(row["error"], 2), number(row["allowed"], 3)]
        body.append([quantity, case, *numbers, VERDICT_TEXTS[row["passed"]]])
    return markdown(COLUMNS, body)


def markdown(head: Iterable[str], body: Iterable[Iterable[str]]) -> list[str]:
    """Lines of a Markdown table."""
    lines = [list(head), *map(list, body)]
    text = ["| " + " | ".join(cell.replace("|", r"\|").replace("<", r"\<") for cell in line) + " |" for line in lines]
    return [text[0], "|" + " --- |" * len(lines[0]), *text[1:]]


def _heading(column) -> str:
    return column if isinstance(column, str) else f"{column:,}"


def _text(value) -> str:
    """A value of a table.csv. Numbers have four digits, from ten thousand on all of them; a missing one is empty."""
    if isinstance(value, int | float) and abs(value) >= LARGE:
        return f"{value:,.0f}"
    if isinstance(value, float):
        return "" if math.isnan(value) else f"{value:.4g}"
    return str(value)
