"""A sheet of a workbook (Excel, OpenDocument) as the text of a CSV file, which csv_table reads."""

import csv
import datetime
import io
import logging
import re
from pathlib import Path

import pandas as pd

from common.errors import InputError

DATE_TEXT = re.compile(r"\d{1,2}[-/. ]\d{1,2}[-/. ](?:\d{4}|\d{2})(?!\d)")
ENDINGS = (".xlsx", ".xlsm", ".xlsb", ".xls", ".ods")


def is_workbook(path: Path) -> bool:
    """True for a file whose ending is that of a workbook."""
    return path.suffix.lower() in ENDINGS


def read_sheet(path: Path, sheet: str | None = None) -> pd.DataFrame:
    """Cells of a sheet of a workbook, by default the first, empty ones as empty texts. Raises InputError."""
    try:
        return pd.read_excel(path, sheet_name=sheet or 0, header=None, dtype=object, na_filter=False, engine="calamine")
    except ImportError as error:
        raise InputError(
            f"{path}: Excel files need the package python-calamine, which is not installed; install it, or save the "
            "sheet as CSV"
        ) from error
    except Exception as error:  # the parser raises whatever it stumbles over
        raise InputError(f"{path}: not readable ({' '.join(str(error).split())[:200]}); save it as CSV") from error


def sheet_text(path: Path, sheet: str | None) -> str:
    """A sheet of a workbook, by default the first, as the text of a CSV file with decimal points. Raises InputError."""
    cells = read_sheet(path, sheet)
    _check_dates(path, cells)
    text = io.StringIO()
    csv.writer(text).writerows([_cell(value) for value in row] for row in cells.itertuples(index=False))
    logging.info("%s: %d rows of sheet %s", path, len(cells), sheet or "1")
    return text.getvalue()


def _check_dates(path: Path, cells: pd.DataFrame) -> None:
    """Raise InputError for a column with dates and with texts that look like dates: a program with another order of day
    and month makes dates of those whose day is no larger than 12, and leaves the others."""
    for _, column in cells.items():
        dates = [value for value in column if isinstance(value, datetime.datetime)]
        texts = [value for value in column if isinstance(value, str) and DATE_TEXT.match(value.strip())]
        if dates and texts:
            raise InputError(
                f"{path}: a column has {len(dates)} dates ({dates[0]:%Y-%m-%d}) and {len(texts)} texts ({texts[0]}): "
                "day and month may have changed places in the dates; make the sheet again with all of them as text"
            )


def _cell(value: object) -> str:
    """A cell of a sheet as the text that a CSV file has, in one line. A date has no time of day, and a time no date."""
    if isinstance(value, datetime.datetime) and value.time() == datetime.time():
        value = value.date()
    if isinstance(value, datetime.timedelta):
        value = (datetime.datetime.min + value).time() if value < datetime.timedelta(days=1) else value
    if isinstance(value, float) and value.is_integer():
        value = int(value)
    return " ".join(str(value).split())
