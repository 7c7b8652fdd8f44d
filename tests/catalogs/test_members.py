"""Members of an ensemble in the comparison: read from their folders, checked, and part of the model."""

import json

import numpy as np
import pytest
from catalog_fixtures import made_up_catalog
from job_runs import run_job
from test_comparison import QUICK, as_record

from catalogs.compare.comparison import compare
from catalogs.compare.spread import read_members
from common.datasets import read_dataset
from common.errors import InputError
from common.event_table import write_events

STEPS = [
    {"name": "august", "start": "2019-08-01", "end": "2019-09-01"},
    {"name": "september", "start": "2019-09-01", "end": "2019-10-01"},
]
AUTUMN = np.datetime64("2019-09-01")


def write_member(folder, catalog):
    """A run's folder: the events of each step, and of a history before them, which no catalogue has."""
    early = catalog["time"].values < AUTUMN
    for name, part in (("august", early), ("september", ~early), ("history", early)):
        write_events(catalog.isel(event=np.flatnonzero(part)), folder / "events" / f"{name}.nc")
    return folder


def test_a_member_is_read_as_one_catalogue_of_its_dated_steps(tmp_path):
    catalog = made_up_catalog(200, seed=1)
    folder = write_member(tmp_path, catalog)
    (member,) = read_members([folder], ["september", "august"], "demo")
    for name in catalog.variables:
        np.testing.assert_array_equal(member[name], catalog[name], err_msg=name)
    with pytest.raises(InputError, match=r"august\.nc: is of mine demo, not of other"):
        read_members([folder], ["august"], "other")
    with pytest.raises(InputError, match=r"october\.nc: not a readable dataset"):
        read_members([folder], ["october"], "demo")


def test_a_member_that_has_collapsed_is_left_out(tmp_path):
    folders = [write_member(tmp_path / str(k), made_up_catalog(150, seed=k)) for k in (1, 2)]
    lost = folders[0] / "events" / "september.nc"
    write_events(read_dataset(lost).assign_attrs(collapsed=1), lost)
    (left,) = read_members(folders, ["august", "september"], "demo")
    (other,) = read_members(folders[1:], ["august", "september"], "demo")
    assert left.identical(other)


def test_a_member_too_few_or_of_another_mine_is_refused():
    catalog = made_up_catalog(50)
    with pytest.raises(InputError, match="comparison: 1 members are given, and the ensemble has 2"):
        compare(catalog, as_record(catalog), QUICK | {"members": 2}, [catalog])
    with pytest.raises(InputError, match="catalog is of mine demo, member 1 of other"):
        compare(catalog, as_record(catalog), QUICK | {"members": 1}, [catalog.assign_attrs(mine="other")])


def test_the_stage_takes_folders_of_members(tmp_path):
    folders = [write_member(tmp_path / str(k), made_up_catalog(150, seed=k)) for k in (1, 2)]
    write_events(made_up_catalog(150), tmp_path / "catalog.nc")
    write_events(as_record(made_up_catalog(200, seed=9)), tmp_path / "record.nc")
    settings = {"comparison": QUICK | {"steps": STEPS, "members": 2}}
    inputs = {name: tmp_path / f"{name}.nc" for name in ("catalog", "record")}
    members = [folder / "events" for folder in folders]
    done = run_job(tmp_path, "comparison", settings, [tmp_path / "comparison.nc"], members=members, **inputs)
    assert done.returncode == 0, done.stderr
    assert json.loads(read_dataset(tmp_path / "comparison.nc").attrs["settings"])["members"] == 2
