"""Recorded catalogues: a reader per format, filters shared by all, one form out (catalogs.schema).

A reader is a function `read(settings: RecordSlice) -> xr.Dataset` that returns a filtered catalogue in the schema's
form. It is named here as "module:function" and imported when it is asked for: one mine's format costs another nothing.
"""

from collections.abc import Callable, Iterator, Mapping
from importlib import import_module

import xarray as xr

from catalogs.record_settings import RecordSlice
from catalogs.schema import check_catalog


class Readers(Mapping):
    """Reader functions by name, imported at first use."""

    def __init__(self, places: dict[str, str]):
        self._places = places

    def __getitem__(self, name: str) -> Callable[[RecordSlice], xr.Dataset]:
        module, function = self._places[name].split(":")
        return getattr(import_module(module), function)

    def __iter__(self) -> Iterator[str]:
        return iter(self._places)

    def __len__(self) -> int:
        return len(self._places)


READERS = Readers(
    {
        "quakeml": "catalogs.records.quakeml_reader:read",
        "csv": "catalogs.records.csv_reader:read",
        "elk_creek": "catalogs.records.elk_creek:read",
    }
)


def read_record(settings: RecordSlice) -> xr.Dataset:
    """The recorded catalogue that the settings (or their values, in SI) describe, in the form of catalogs.schema.

    Raises InputError.
    """
    settings = RecordSlice.of(settings, "record")
    return check_catalog(READERS[settings.reader](settings), source=settings.file)
