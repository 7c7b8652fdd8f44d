"""Recorded catalogues: a reader per format, filters shared by all, one form out (pipeline.event_table).

A reader imports its module when it is asked for: one mine's format costs another nothing.
"""

import xarray as xr

from catalogs.record_settings import RecordSlice


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


def read_record(settings: RecordSlice) -> xr.Dataset:
    """The recorded catalogue that the settings (or their values, in SI) describe, in the form of pipeline.event_table.

    Raises InputError.
    """
    settings = RecordSlice.of(settings, "record")
    return READERS[settings.reader](settings)
