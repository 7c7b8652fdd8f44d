"""A CSV record of a few lines in a folder, read as a mine's, or refused in one line."""

from pathlib import Path

import pytest
import xarray as xr
from catalog_fixtures import SETTINGS

from catalogs.records import read_record
from common.errors import InputError

COLUMNS = {"time": "time", "x": "x", "y": "y", "z": "z", "mw": "mw"}
PLAIN = "time,x,y,z,mw\n2019-08-01T12:00:00,100.5,200,300,-1.0\n2019-08-13T00:00:00.5,110,1200,300,0.5\n"


def settings_of(folder: Path, text: str | bytes, columns: dict | None = None, name: str = "record.csv", **others):
    """Settings of a record whose file, `name`, is written here; columns: COLUMNS if not given."""
    path = folder / name
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return SETTINGS | {"reader": "csv", "file": str(path), "columns": columns or COLUMNS} | others


def read(folder: Path, text: str | bytes, columns: dict | None = None, **others) -> xr.Dataset:
    """The record, read; see settings_of."""
    return read_record(settings_of(folder, text, columns, **others))


def refused(folder: Path, text: str | bytes, columns: dict | None = None, **others) -> str:
    """The line, one alone, with which the record is refused."""
    with pytest.raises(InputError) as error:
        read(folder, text, columns, **others)
    assert "\n" not in str(error.value)
    return str(error.value)
