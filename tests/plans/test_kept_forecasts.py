"""Kept forecasts that cannot be used: one line, which never asks to delete what cannot be made again."""

import re

import numpy as np
import pytest
import xarray as xr
from plan_fixtures import drawn_run, made_up_grid, outcome_slice

from common.datasets import CHECKSUM, write_dataset
from common.errors import InputError
from plans.kept_forecasts import read_forecast
from plans.outcome import make_outcome


@pytest.fixture(scope="module")
def outcome(tmp_path_factory):
    run = drawn_run(tmp_path_factory.mktemp("forecast"), "own", 1)
    return make_outcome(outcome_slice([run]), made_up_grid(), None, None)


def refusal(path) -> str:
    """The line that a forecast is refused with."""
    with pytest.raises(InputError) as refused:
        read_forecast(path, "forecasts.0")
    (line,) = refused.value.lines
    assert line.startswith(f"forecasts.0: {path}: ")
    assert not re.search(r"delete|run again|same command", line)
    assert "leave it out of `forecasts`" in line
    return line


def test_a_forecast_is_read_as_it_was_written(outcome, tmp_path):
    write_dataset(outcome, tmp_path / "kept.nc")
    xr.testing.assert_identical(read_forecast(tmp_path / "kept.nc", "forecasts.0"), outcome)


def test_a_forecast_of_another_version_is_to_be_kept(outcome, tmp_path):
    write_dataset(outcome.drop_vars("shared_number"), tmp_path / "kept.nc")
    line = refusal(tmp_path / "kept.nc")
    assert "shared_number is missing; not a forecast of this version" in line
    assert "keep it" in line


def test_a_damaged_forecast_is_to_be_restored(outcome, tmp_path):
    import netCDF4

    write_dataset(outcome, tmp_path / "kept.nc")
    with netCDF4.Dataset(tmp_path / "kept.nc", "a") as opened:
        opened.floor = -9.0
    assert "damaged: its content is not what was written" in refusal(tmp_path / "kept.nc")
    (tmp_path / "text.nc").write_text("no forecast")
    assert "not a readable dataset" in refusal(tmp_path / "text.nc")


SPOILED = {
    "mine": 3.0,
    "plan": 1,
    "floor": "low",
    "shared_floor": "",
    "recorded_until": "last summer",
    "steps_ahead": "2019-08",
}


@pytest.mark.parametrize("name", SPOILED)
@pytest.mark.parametrize("is_missing", [True, False])
def test_edited_attributes_without_their_checksum(outcome, tmp_path, name, is_missing):
    """An editor of netCDF files may write a file anew."""
    attributes = outcome.attrs | {name: SPOILED[name]}
    if is_missing:
        del attributes[name]
    edited = outcome.copy()
    edited.attrs = attributes
    edited.to_netcdf(tmp_path / "kept.nc")
    assert CHECKSUM not in edited.attrs
    assert f"attribute {name} " in refusal(tmp_path / "kept.nc")


@pytest.mark.parametrize(
    ("name", "values", "says"),
    [
        ("start", ["2019-08-01", "soon"], "the dates of step"),
        ("end", ["2019-08-01", "2019-10-01"], "the dates of step"),
        ("step", ["2019-09", "2019-09"], "attribute steps_ahead does not list steps of it"),
        ("period", ["2019-08", "2019-09", "whole"], "its periods are not its steps"),
    ],
)
def test_edited_names_and_dates(outcome, tmp_path, name, values, says):
    edited = outcome.copy()
    edited[name] = (edited[name].dims, np.array(values, object), edited[name].attrs)
    edited.to_netcdf(tmp_path / "kept.nc")
    assert says in refusal(tmp_path / "kept.nc")
