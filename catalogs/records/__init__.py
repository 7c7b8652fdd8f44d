"""Readers of recorded catalogues. Each is one module here and one entry of READERS; all other code calls the reader.

What a reader's module offers:

| name | what |
|---|---|
| NAME | value of `reader` in a mine file |
| READS_FOLDER | whether `file` is a folder, whose files the reader finds itself |
| Record | settings of a record with this reader: its keys, their units and bounds; validators refuse what cannot be |
| RecordSlice | the same keys in the slice of the record's stage |
| read(settings) | RecordSlice -> the events in the form of common.event_table, filtered (filters.filter_events) |

A module here is imported whenever a mine file is checked: it imports slow libraries where it uses them.
"""

from collections.abc import Mapping
from types import ModuleType

import xarray as xr

from catalogs.records import csv_reader, elk_creek_reader, quakeml_reader
from catalogs.records import settings as record_settings
from common.setting_types import Settings, one_of

READERS: dict[str, ModuleType] = {reader.NAME: reader for reader in (quakeml_reader, csv_reader, elk_creek_reader)}
AnyRecord = one_of("reader", {name: reader.Record for name, reader in READERS.items()})


class _Stage(Settings):
    """The slice of the record's stage under the section's name, which messages give."""

    record: one_of("reader", {name: reader.RecordSlice for name, reader in READERS.items()})


def record_slice(values: Mapping) -> record_settings.RecordSlice:
    """The settings of the record's stage from the values of its slice, in SI. Raises InputErrors."""
    return _Stage.of({"record": values}).record


def read_record(values: Mapping) -> xr.Dataset:
    """The recorded catalogue that a slice (or its settings) describes, in the form of common.event_table.

    Raises InputError.
    """
    settings = values if isinstance(values, record_settings.RecordSlice) else record_slice(values)
    return READERS[settings.reader].read(settings)
