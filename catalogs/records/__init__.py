"""Recorded catalogues: a reader per format, filters shared by all, one form out (catalogs.schema).

A reader is a function `read(settings: dict) -> xr.Dataset` that returns a filtered catalogue in the schema's form.
It is named here as "module:function" and imported when it is asked for: one mine's format costs another nothing.
"""

from collections.abc import Callable, Iterator, Mapping
from importlib import import_module

import xarray as xr

from catalogs.schema import check_catalog
from pipeline.errors import InputError


class Readers(Mapping):
    """Reader functions by name, imported at first use."""

    def __init__(self, places: dict[str, str]):
        self._places = places

    def __getitem__(self, name: str) -> Callable[[dict], xr.Dataset]:
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


def read_record(settings: dict) -> xr.Dataset:
    """The recorded catalogue that `settings` (a mine's `record`, in SI) describes, in the form of catalogs.schema.

    settings: mine, reader (a name in READERS), file, location_error (m), twin (bool: the record is a model's own),
    filter, period, domain (see catalogs.records.filters), and what the reader asks for. Raises InputError.
    """
    name = settings.get("reader")
    if name not in READERS:
        raise InputError(f"record.reader: {name!r} is not one of {', '.join(READERS)}")
    return check_catalog(READERS[name](settings), source=str(settings.get("file", name)))
