"""Recorded catalogues: a reader per format, filters shared by all, one form out (pipeline.event_table).

A reader imports its module when it is asked for: one mine's format costs another nothing.
"""

import xarray as xr

from pipeline.errors import InputError


def _quakeml(settings: dict) -> xr.Dataset:
    from catalogs.records.quakeml_reader import read

    return read(settings)


def _csv(settings: dict) -> xr.Dataset:
    from catalogs.records.csv_reader import read

    return read(settings)


def _elk_creek(settings: dict) -> xr.Dataset:
    from catalogs.records.elk_creek import read

    return read(settings)


READERS = {"quakeml": _quakeml, "csv": _csv, "elk_creek": _elk_creek}


def read_record(settings: dict) -> xr.Dataset:
    """The recorded catalogue that `settings` (a mine's `record`, in SI) describes, in the form of pipeline.event_table.

    settings: mine, reader (a name in READERS), file, location_error (m), twin (bool: the record is a model's own),
    filter, period, domain (see catalogs.records.filters), and what the reader asks for. Raises InputError.
    """
    name = settings.get("reader")
    if name not in READERS:
        raise InputError(f"record.reader: {name!r} is not one of {', '.join(READERS)}")
    return READERS[name](settings)
