"""A CSV file as mines export it, as a table of text and columns of numbers.

Found from the file itself: its encoding, the separator and the line of the header (those with which the columns that
the configuration names appear), a line of units below it, decimal commas. What cannot be found is required in the
configuration.
"""

import codecs
import csv
import difflib
import io
import logging
import re
import warnings
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pandas as pd

from catalogs.records.csv_units import unit_quantity
from catalogs.records.excel_sheets import is_workbook, sheet_text
from catalogs.records.settings import normalized
from common.errors import InputError

SEPARATORS = {",": "comma", ";": "semicolon", "\t": "tab", "|": "bar"}
MAX_PREAMBLE_LINES = 100  # Lines in which the header is searched.
EMPTY_WORDS = ("", "nan", "na", "n/a", "null", "none", "-", "--", "nat", "#n/a")
BETWEEN_THOUSANDS = r"(?<=\d)[ \u00a0\u202f'\u2019](?=\d{3}(?!\d))"
NUMBER_PATTERNS = {  # by decimal mark; the other one may stand between thousands
    "point": r"[-+]?(?:(?:[1-9]\d{0,2}(?:,\d{3})+|\d+)\.?\d*|\.\d+)(?:[eE][-+]?\d+)?",
    "comma": r"[-+]?(?:(?:[1-9]\d{0,2}(?:\.\d{3})+|\d+),?\d*|,\d+)(?:[eE][-+]?\d+)?",
}
# A quoted cell of several lines; quotation marks within other cells, such as inches, begin none.
BROKEN_CELL = re.compile(r'(?:(?<=[,;\t|])|^)"(?:[^"\n]|"")*\n(?:[^"]|"")*"(?=[,;\t|\r\n]|\Z)', re.MULTILINE)
BYTE_ORDER_MARKS = {  # first bytes of texts that say their encoding; those of UTF-32 begin as those of UTF-16 do
    "utf-32": (codecs.BOM_UTF32_LE, codecs.BOM_UTF32_BE),
    "utf-16": (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE),
}
CONTAINERS = {  # first bytes of what is no text
    b"PK\x03\x04": "a zip archive or an Excel workbook",
    b"\xd0\xcf\x11\xe0": "an Excel workbook",
    b"\x1f\x8b": "a gzip archive",
    b"MATLAB 5.0 MAT-file": "a file of MATLAB",
    b"MATLAB 7.3 MAT-file": "a file of MATLAB",
    b"\x89HDF\r\n": "an HDF5 file",
    b"PAR1\x15": "a Parquet file",
    b"SQLite format 3\0": "a database of SQLite",
}
NOT_UTF8 = "the file is not in UTF-8, and here its letters count; "
ENCODING_REMEDY = (  # by whether a key can say it
    "save it in UTF-8", "say its encoding with record.encoding, such as cp1252, gbk or shift_jis"
)  # fmt: skip
DECIMAL_REMEDY = "write decimal points, and nothing between thousands", "say it with record.decimal: comma or point"


@dataclass
class Table:
    """Rows of text as they stand in the file, one per event; `source` names the file in errors.

    decimal: "comma", "point", or None: to be found. sure: whether its encoding is known, and not only assumed
    of western Europe. has_keys: whether keys of `record` can answer questions. units: by column, from a line below the
    header. repeated (event,) bool: rows that repeat an earlier one in every column.
    """

    rows: pd.DataFrame
    source: str
    decimal: str | None = None
    sure: bool = True
    has_keys: bool = True
    units: dict[str, str] = field(default_factory=dict)

    @property
    def repeated(self) -> np.ndarray:
        return self.rows.duplicated().to_numpy()

    def text(self, name: str) -> pd.Series:
        """A column as text without surrounding blanks, empty where it holds nothing."""
        text = self.rows[name].fillna("").str.strip()
        return text.where(~text.str.lower().isin(EMPTY_WORDS), "")

    def words(self, name: str) -> pd.Series:
        """A column as text whose letters matter. Raises InputError if they need an unknown encoding."""
        text = self.text(name)
        foreign = text[~text.map(str.isascii)]
        if not self.sure and len(foreign):
            raise InputError(
                f"{self.source}: column {name!r}: {foreign.iloc[0]!r}?: {NOT_UTF8}{ENCODING_REMEDY[self.has_keys]}"
            )
        return text

    def numbers(self, name: str, strict: bool = True) -> np.ndarray:
        """A column as numbers (event,), NaN where empty. Raises InputError for what is none (NaN if not strict)."""
        text = self.text(name)
        bare = _bare(text)
        known = bare.str.fullmatch(NUMBER_PATTERNS[self.decimal or "point"])
        if self.decimal == "comma":
            bare = bare.str.replace(".", "", regex=False).str.replace(",", ".", regex=False)
        values = pd.to_numeric(bare.str.replace(",", "", regex=False).where(known, None), errors="coerce")
        values = values.to_numpy(float)
        if strict:
            wrong = np.isnan(values) & (text != "").to_numpy()
            self.refuse(wrong, name, f"is not a number with a decimal {self.decimal or 'point'}", "correct it")
        return values

    def refuse(self, wrong: np.ndarray, name: str, what: str, remedy: str) -> None:
        """Raise InputError for the first wrong row and say how many there are."""
        if np.any(wrong):
            row = int(np.flatnonzero(wrong)[0])
            value = self.rows[name].iloc[row]
            raise InputError(
                f"{self.source}: event {row + 1} of {len(self.rows)}: column {name!r}: {value!r} {what} "
                f"({int(np.sum(wrong))} such); {remedy}"
            )

    def decide_decimals(self, names: Iterable[str]) -> None:
        """Tell decimal commas from commas between thousands by all the named columns together. Raises InputError."""
        if self.decimal is not None:
            return
        text = _bare(pd.concat([self.text(name) for name in names]))
        fits = {kind: text.str.fullmatch(pattern) for kind, pattern in NUMBER_PATTERNS.items()}
        comma = fits["comma"] & ~fits["point"]
        point = fits["point"] & ~fits["comma"]
        if comma.any() and point.any():
            raise InputError(
                f"{self.source}: {text[comma].iloc[0]!r} has a decimal comma, {text[point].iloc[0]!r} has none; write "
                "one kind"
            )
        either = fits["comma"] & fits["point"] & text.str.contains(",", regex=False)
        if either.any() and not comma.any() and not point.any():
            raise InputError(
                f"{self.source}: {text[either].iloc[0]!r}: a decimal comma, or thousands? "
                f"{DECIMAL_REMEDY[self.has_keys]}"
            )
        self.decimal = "comma" if comma.any() else "point"

    def take_units(self, names: list[str]) -> None:
        """Remove the first row if it is a line of units: the named columns have no number in it, but text."""
        if self.rows.empty:
            return
        first = {name: self.text(name).iloc[0].strip("[]() ") for name in self.rows}
        units = [first[name] for name in names if first[name]]
        if units and all(not re.match(r"[-+.,]?\d", text) and unit_quantity(text) is not None for text in units):
            self.units = {name: text for name, text in first.items() if text}
            self.rows = self.rows.iloc[1:].reset_index(drop=True)


def _bare(text: pd.Series) -> pd.Series:
    """Numbers with a plain minus sign, and without blanks or apostrophes between thousands."""
    return text.str.replace("\u2212", "-", regex=False).str.replace(BETWEEN_THOUSANDS, "", regex=True)


def read_table(
    path: Path,
    named: Mapping[str, str],
    numeric: Iterable[str],
    decimal: str | None = None,
    encoding: str | None = None,
    has_keys: bool = True,
    sheet: str | None = None,
    has_comments: bool = True,
) -> Table:
    """The table of a CSV file that has the columns `named` (by the key that names each); `numeric` hold numbers.

    sheet: of a workbook, which is read as a CSV file with decimal points is; None: the first.

    Lines that begin with # are comments, but for a header (FDSN's text has one); without has_comments they are rows. A
    header without a row is a record without an event. has_keys: whether the user can answer questions with keys of
    `record`. Raises InputError, one line: not readable, not text, in an encoding that is not known where that counts,
    columns missing or there twice.
    """
    if is_workbook(path):
        return table_of(sheet_text(path, sheet), True, path, named, numeric, "point", has_keys, has_comments)
    text, sure = _decoded(path, encoding, has_keys)
    return table_of(text, sure, path, named, numeric, decimal, has_keys, has_comments)


def table_of(
    text: str,
    sure: bool,
    path: Path,
    named: Mapping[str, str],
    numeric: Iterable[str] = (),
    decimal: str | None = None,
    has_keys: bool = False,
    has_comments: bool = True,
) -> Table:
    """The table of the text of a CSV file, which `path` names in messages; sure: whether its encoding is known. Other
    arguments and errors are those of read_table."""
    text = BROKEN_CELL.sub(lambda cell: " ".join(cell[0].split()), text)
    lines = [line for line in text.splitlines() if line.strip(" \t\r,;|")]
    if all(line.startswith("#") for line in lines):
        raise InputError(f"{path}: not a readable CSV file (it is empty); give a table with a header")
    place, separator, header = _header(lines, set(named))
    if missing := {name: key for name, key in named.items() if name not in header}:
        foreign = next((name for name in missing if not name.isascii()), next(iter(missing)))
        if not sure and not all(map(str.isascii, (*missing, *header))):
            raise InputError(
                f"{path}: column {foreign!r} ({missing[foreign]}) is not found: {NOT_UTF8}{ENCODING_REMEDY[has_keys]}"
            )
        raise InputError(f"{path}: {_missing_columns(missing, header)}")
    for name in named:
        if header.count(name) > 1:
            raise InputError(f"{path}: column {name!r} is there {header.count(name)} times; name each its own way")
    body = "\n".join(line for line in lines[place + 1 :] if not (has_comments and line.startswith("#")))
    full = header and sum(
        line.startswith("#") and line.count(separator) >= len(header) - 1 for line in lines[place + 1 :]
    )
    if has_comments and full and len(header) > 1:
        logging.warning("%s: %d rows begin with # and are left out as comments", path, full)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error", pd.errors.ParserWarning)  # a row with more cells than names
            rows = pd.read_csv(
                io.StringIO(body), sep=separator, names=_unique_names(header),
                dtype=str, skipinitialspace=True, keep_default_na=False, index_col=False,
            )  # fmt: skip
    except pd.errors.EmptyDataError:
        rows = pd.DataFrame(columns=_unique_names(header), dtype=str)
    except (ValueError, pd.errors.ParserWarning) as error:  # pandas' parser errors are ValueErrors
        raise InputError(f"{path}: not a readable CSV file ({_unreadable(error)})") from error
    table = Table(rows, str(path), decimal, sure, has_keys)
    table.take_units(list(numeric))
    logging.info("%s: %d rows, separated by %s", path, len(rows), SEPARATORS[separator])
    return table


def _unreadable(error: Exception) -> str:
    """Reason for a user why pandas finds no table, and the remedy: a row with more cells than the header has names,
    quotation marks that do not close, or, of any other error, its own words."""
    if wide := re.search(r"Expected (\d+) fields in line (\d+), saw (\d+)", str(error)):
        return f"row {wide[2]} below the header has {wide[3]} cells, and {wide[1]} are expected; correct the row"
    if isinstance(error, pd.errors.ParserWarning):
        return "rows have more cells than the header has names; give each column a name"
    if "EOF inside string" in str(error):
        return "quotation marks open and do not close; correct them"
    return f"{' '.join(str(error).split())}; export it again as a plain table"


def _missing_columns(missing: Mapping[str, str], header: list[str]) -> str:
    """All columns that are missing, each with its key and the name that may be meant; the names that there are."""
    plain = {name.casefold(): name for name in header if name}
    listed = []
    for name, key in missing.items():
        near = difflib.get_close_matches(name.casefold(), plain, n=1)
        listed.append(f"{name!r} ({key}{f'; did you mean {plain[near[0]]}?' if near else ''})")
    many = len(listed) > 1
    text = f"column{'s' * many} {', '.join(listed)} {'are' if many else 'is'} missing"
    return f"{text}; it has {', '.join(filter(None, header))}"


def check_container(content: bytes, path: Path, expected: str) -> None:
    """Raise InputError for what is no text but holds one; expected: CSV or QuakeML."""
    for begins, what in CONTAINERS.items():
        if content.startswith(begins):
            unpack = "unpack it, or " if "archive" in what else ""
            raise InputError(f"{path}: {what}, not a {expected} file; {unpack}export it as {expected}")


def _decoded(path: Path, encoding: str | None, has_keys: bool) -> tuple[str, bool]:
    """The text of a file, and whether its encoding is known: as named, UTF-8, or UTF-16 and UTF-32 with their mark.

    Else it is assumed to be that of western Europe, which is right for letters of ASCII. Raises InputError.
    """
    try:
        content = path.read_bytes()
    except OSError as error:
        raise InputError(f"{path}: not a readable CSV file ({error.strerror}); give a table as text") from error
    check_container(content, path, "CSV")
    if encoding:
        try:
            text = content.decode(encoding).removeprefix("\ufeff")
        except ValueError as error:  # a UnicodeDecodeError
            raise InputError(
                f"{path}: not in record.encoding: {encoding} ({error}); name the encoding it has"
            ) from error
        return text, True
    marked = [name for name, marks in BYTE_ORDER_MARKS.items() if content.startswith(marks)][:1]
    for encoding in marked or ["utf-8-sig", "cp1252", "latin-1"]:
        try:
            text = content.decode(encoding)
        except UnicodeDecodeError:
            continue
        break
    else:
        raise InputError(f"{path}: begins as {marked[0]} and is not; export the table as text")
    if "\0" in text:
        other = next(filter(lambda name: _is_text(content, name), ("utf-16-le", "utf-16-be")), "")
        hint = f", or say record.encoding: {other}" if other and has_keys else ""
        raise InputError(f"{path}: not a readable CSV file (it holds zero bytes); export the table as text{hint}")
    logging.info("%s: read as %s", path, encoding)
    return text, encoding not in ("cp1252", "latin-1")


def _is_text(content: bytes, encoding: str) -> bool:
    """True if bytes in this encoding are letters, digits, marks and white space, and nothing else."""
    try:
        return all(letter.isprintable() or letter.isspace() for letter in content.decode(encoding))
    except UnicodeDecodeError:
        return False


def _header(lines: list[str], named: set[str]) -> tuple[int, str, list[str]]:
    """Place of the header, its separator and its names: where most of the named columns appear."""
    best: float = -1
    found: tuple[int, str, list[str]] = (0, ",", [])
    head = list(enumerate(lines[:MAX_PREAMBLE_LINES]))
    first = next((place for place, line in head if not line.startswith("#")), 0)
    for place, line in sorted(head, key=lambda one: one[1].startswith("#")):  # comments last
        line = line.lstrip("# ")
        for separator in SEPARATORS:
            try:
                cells = next(csv.reader([line], delimiter=separator, skipinitialspace=True), [])
            except csv.Error:  # a line of JSON or XML is one field, longer than any
                continue
            header = [normalized(name) for name in cells]
            count = len(named & set(header))
            # without any of them, the first line, separated by what parts it most
            score = (len(header) - 1) / max(len(line), 1) if not count and place == first else count
            if score > best:
                best, found = score, (place, separator, header)
        if best == len(named):
            break
    return found


def _unique_names(header: list[str]) -> list[str]:
    """Unique names for columns without a name, or with a repeated one."""
    return [name if name and name not in header[:place] else f"{name}#{place + 1}" for place, name in enumerate(header)]
