"""Events are what the table says when they are written and when they are read, or one line says what is wrong."""

from datetime import datetime

import numpy as np
import pytest
import xarray as xr
from hypothesis import given
from hypothesis import strategies as st

from common.datasets import write_dataset
from common.errors import InputError
from common.event_table import FIELDS, NAMES, check_events, event_dataset, new_catalog, read_events, write_events

ATTRIBUTES = {"mine": "demo", "kind": "recorded"}
TIMES = np.array(["2019-08-01T12:00:00.123456789", "NaT"], "datetime64[ns]")


def two_events() -> xr.Dataset:
    return new_catalog(2, ATTRIBUTES, time=TIMES, potency=[1.0, np.nan], step=["2019-08", ""])


def test_what_is_not_given_is_missing():
    """NaN, NaT, -1 and nothing; every recorded event counts."""
    events = new_catalog(2, ATTRIBUTES)
    assert set(events.data_vars) == set(NAMES)
    assert np.isnat(events["time"].values).all()
    assert np.isnan(events["potency_tensor"].values).all()
    assert events["particles"].values.tolist() == [-1, -1]
    assert events["resolved"].values.tolist() == [1, 1]
    assert events["step"].values.tolist() == ["", ""]


@pytest.mark.parametrize("count", [0, 2])
def test_events_are_read_as_they_were_written(tmp_path, count):
    """Types, units and meanings, times to the nanosecond, text and its absence; and no events at all."""
    events = two_events().isel(event=slice(count))
    write_events(events, tmp_path / "events.nc")
    again = read_events(tmp_path / "events.nc")
    xr.testing.assert_identical(again, events)
    for field in FIELDS:
        assert again[field.name].dtype == field.dtype
        assert again[field.name].attrs == field.attributes
    write_events(again, tmp_path / "again.nc")
    assert (tmp_path / "again.nc").read_bytes() == (tmp_path / "events.nc").read_bytes()


SPOILED = {
    "potency is missing": lambda events: events.drop_vars("potency"),
    "potency: type float32, not float64": lambda events: events.assign(potency=events["potency"].astype("f4")),
    "resolved: type int64, not int8": lambda events: events.assign(resolved=events["resolved"].astype("i8")),
    "time: type float64, not datetime64": lambda events: events.assign(time=events["potency"].drop_attrs()),
    "step: type float64, not text": lambda events: events.assign(step=events["potency"].drop_attrs()),
    "location: dimensions event, axis, not event, xyz": lambda events: events.assign(
        location=(("event", "axis"), events["location"].values, events["location"].attrs)
    ),
    "potency: dimensions x, not event": lambda events: events.assign(
        potency=("x", events["potency"].values, events["potency"].attrs)
    ),
    "moment: unit dyn cm, not N m": lambda events: events.assign(moment=events["moment"].assign_attrs(units="dyn cm")),
    "mw: unit none, not 1": lambda events: events.assign(mw=events["mw"].drop_attrs()),
    "attribute mine is missing": lambda events: events.drop_attrs(deep=False),
    "attribute kind is 'guess'": lambda events: events.assign_attrs(kind="guess"),
    "dimension xyz has length 2, not 3": lambda events: events.isel(xyz=[0, 1]),
}


@pytest.mark.parametrize("line", SPOILED)
def test_a_foreign_or_broken_file_is_one_line(tmp_path, line):
    """On reading: the file, the variable, what is wrong and what to do; on writing: nothing is written."""
    spoiled = SPOILED[line](two_events())
    path = tmp_path / "catalog.nc"
    write_dataset(spoiled, path)
    with pytest.raises(InputError) as told:
        read_events(path)
    assert str(told.value).startswith(f"{path}: {line}")
    assert str(told.value).endswith("delete it and run again")
    path.unlink()
    with pytest.raises(InputError) as told:
        write_events(spoiled, path)
    assert str(told.value).startswith(f"{path}: {line}")
    assert list(tmp_path.iterdir()) == []


def test_other_variables_may_stand_by():
    """The orientations of a record, say."""
    events = two_events().assign(orientation_time=("orientation", TIMES))
    assert "orientation_time" in check_events(events, "record")


def test_all_variables_and_no_others_make_events():
    """One forgotten is not filled up in silence where all are due."""
    values = {name: variable.values for name, variable in two_events().items()}
    xr.testing.assert_identical(event_dataset(values, ATTRIBUTES), two_events())
    with pytest.raises(InputError, match="dc is missing"):
        event_dataset({name: array for name, array in values.items() if name != "dc"}, ATTRIBUTES)
    with pytest.raises(InputError, match="magnitude is unknown"):
        event_dataset(values | {"magnitude": values["mw"]}, ATTRIBUTES)
    with pytest.raises(InputError, match=r"location has shape \(2, 2\), not \(2, 3\)"):
        event_dataset(values | {"location": values["location"][:, :2]}, ATTRIBUTES)


@given(st.lists(st.datetimes(datetime(1700, 1, 1), datetime(2200, 1, 1))))
def test_times_keep_their_unit_whatever_they_are(times):
    """One encoding for all: xarray's own choice would follow the values."""
    events = new_catalog(len(times), ATTRIBUTES, time=np.array(times, "datetime64[ns]"))
    assert events["time"].encoding["units"] == "nanoseconds since 1970-01-01"
    assert events["time"].encoding["dtype"] == "int64"
