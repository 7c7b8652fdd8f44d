"""A sheet of a workbook (Excel, OpenDocument) as the text of a CSV file, which csv_table reads."""

import csv
import io
import logging
from pathlib import Path

import pandas as pd

from common.errors import InputError

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
    text = io.StringIO()
    csv.writer(text).writerows([_cell(value) for value in row] for row in cells.itertuples(index=False))
    logging.info("%s: %d rows of sheet %s", path, len(cells), sheet or "1")
    return text.getvalue()


def _cell(value: object) -> str:
    """A cell of a sheet as the text that a CSV file has, in one line."""
    if isinstance(value, float) and value.is_integer():
        value = int(value)
    return " ".join(str(value).split())
