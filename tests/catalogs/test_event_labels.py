"""Names of events that stay, and nearest openings: closed distances, other orders, later steps, no openings."""

import numpy as np
import pandas as pd
import pytest
import xarray as xr
from mechanics.test_grid_stage import block, grid_slice

from catalogs.records.quakeml_events import own_catalog, parse_quakeml, quakeml_bytes
from catalogs.sources.event_labels import append_columns, event_ids, label_columns, label_events
from catalogs.sources.quakeml import write_quakeml
from common.errors import InputError
from common.event_table import LABELS, new_catalog, read_events, write_events
from mpm_core.stages.grid_stage import make_grid

BOXES = {"drive": ([4.0, 4.0, 4.0], [8.0, 8.0, 8.0]), "stope": ([16.0, 4.0, 4.0], [20.0, 8.0, 8.0])}
STEPS = ["history", "2019-08", "2019-09"]
OPENINGS = [{"name": "drive", "mined": 0, "filled": -1}, {"name": "stope", "mined": 2, "filled": -1}]


@pytest.fixture(scope="module")
def grid():
    return make_grid(grid_slice(*(block(*corners, name) for name, corners in BOXES.items()), coarse_cell=4.0), {})


def catalogue(location, step, **values) -> xr.Dataset:
    count = len(location)
    time = np.datetime64("2019-08-01", "ns") + np.arange(count) * np.timedelta64(1, "h")
    attributes = {
        "mine": "test",
        "kind": "synthetic",
        "location_error": 2.0,
        "frame": '{"surface": 0, "latitude": 1.0, "longitude": 2.0}',
    }
    return new_catalog(
        count, attributes, location=np.array(location, float).reshape(-1, 3), step=step, time=time, **values
    )


def test_the_nearest_opening_is_one_that_is_mined_by_then(grid):
    """The stope counts from its own step on; distances to walls of boxes on the lattice are closed."""
    places = [[12.0, 6.0, 6.0], [15.0, 6.0, 6.0], [15.0, 6.0, 6.0], [6.0, 6.0, 6.0], [11.0, 12.0, 6.0]]
    labelled = label_events(catalogue(places, ["2019-08", "2019-08", *["2019-09"] * 3]), grid, OPENINGS, STEPS)
    assert labelled["nearest_opening"].values.tolist() == ["drive", "drive", "stope", "drive", "drive"]
    np.testing.assert_allclose(labelled["opening_distance"].values, [4.0, 7.0, 1.0, 0.0, 5.0], atol=1e-9)


def test_a_planned_opening_is_not_there_yet(grid):
    """However near it is."""
    planned = [OPENINGS[0], OPENINGS[1] | {"mined": -1}]
    labelled = label_events(catalogue([[15.0, 6.0, 6.0]], ["2019-09"]), grid, planned, STEPS)
    assert labelled["nearest_opening"].values.tolist() == ["drive"]
    assert labelled["opening_distance"].values == pytest.approx([7.0])
    none = [one | {"mined": -1} for one in OPENINGS]
    labelled = label_events(catalogue([[15.0, 6.0, 6.0]], ["2019-09"]), grid, none, STEPS)
    assert labelled["nearest_opening"].values.tolist() == [""]


def test_the_order_of_openings_in_the_file_does_not_count(grid):
    other = make_grid(grid_slice(*(block(*BOXES[name], name) for name in reversed(BOXES)), coarse_cell=4.0), {})
    events = catalogue(np.random.default_rng(1).uniform(0, 24, (50, 3)), ["2019-08"] * 20 + ["2019-09"] * 30)
    one = label_events(events, grid, OPENINGS, STEPS)
    two = label_events(events, other, OPENINGS[::-1], STEPS)
    xr.testing.assert_identical(one, two)


def test_steps_that_are_added_change_no_name(grid):
    """Neither do events of other steps; the same events have the same names."""
    events = catalogue(np.zeros((5, 3)), ["2019-08"] * 2 + ["2019-09"] * 3)
    names = label_events(events, grid, OPENINGS, STEPS)["event_id"].values.tolist()
    assert names == ["2019-08-00001", "2019-08-00002", *(f"2019-09-0000{number}" for number in (1, 2, 3))]
    before = label_events(events.isel(event=slice(2)), grid, OPENINGS, STEPS[:2])["event_id"].values.tolist()
    assert before == names[:2]
    longer = catalogue(np.zeros((6, 3)), ["history", *["2019-08"] * 2, *["2019-09"] * 3])
    assert label_events(longer, grid, OPENINGS, STEPS)["event_id"].values.tolist()[1:] == names


def test_names_are_unique_however_many_there_are():
    steps = np.repeat(["a", "b"], [120_000, 7])
    names = event_ids(steps)
    assert len(set(names)) == len(steps)
    assert names[99_999:100_001].tolist() == ["a-100000", "a-100001"]


@pytest.mark.parametrize("count", [0, 3])
def test_a_mine_without_openings(grid, count):
    labelled = label_events(catalogue(np.zeros((count, 3)), ["2019-08"] * count), grid, [], STEPS)
    assert labelled["nearest_opening"].values.tolist() == [""] * count
    assert np.isnan(labelled["opening_distance"].values).all()


def test_in_a_plane_only_its_axes_count():
    flat = make_grid(grid_slice(block([4.0, 4.0], [8.0, 8.0], "drive"), plane="xz", coarse_cell=4.0), {})
    labelled = label_events(catalogue([[12.0, 0.0, 6.0]], ["2019-08"]), flat, OPENINGS[:1], STEPS)
    assert labelled["nearest_opening"].values.tolist() == ["drive"]
    assert labelled["opening_distance"].values == pytest.approx([4.0])


def test_labels_in_all_three_files(grid, tmp_path):
    """netCDF as it was, QuakeML bit for bit and with the names as identifiers, and a table without a letter changed."""
    generator = np.random.default_rng(2)
    events = catalogue(generator.uniform(0, 24, (7, 3)), ["2019-08"] * 3 + ["2019-09"] * 4, potency=np.ones(7))
    labelled = label_events(events, grid, OPENINGS, STEPS)
    labelled["nearest_opening"].values[0] = ""
    write_events(labelled, tmp_path / "catalog.nc")
    xr.testing.assert_identical(read_events(tmp_path / "catalog.nc"), labelled)
    write_quakeml(labelled, tmp_path / "catalog.xml")
    parsed = parse_quakeml(quakeml_bytes(tmp_path / "catalog.xml"), "catalog.xml")
    assert [event.resource_id.id.rsplit("/")[-1] for event in parsed] == labelled["event_id"].values.tolist()
    again = own_catalog(parsed)
    for field in LABELS:
        np.testing.assert_array_equal(again[field.name].values, labelled[field.name].values)
    write_quakeml(events, tmp_path / "unlabelled.xml")
    assert "event_id" not in own_catalog(parse_quakeml(quakeml_bytes(tmp_path / "unlabelled.xml"), ""))
    text = "date,log10_potency_m3\n" + "".join(f"2019-08-0{number},-0.{number}00000\n" for number in range(1, 8))
    (tmp_path / "catalog.csv").write_text(text)
    append_columns(label_columns(labelled), tmp_path / "catalog.csv")
    lines = (tmp_path / "catalog.csv").read_text().splitlines()
    assert lines[0] == "date,log10_potency_m3,event_id,nearest_opening,opening_distance_m"
    assert [line.rsplit(",", 3)[0] for line in lines] == text.splitlines()
    table = pd.read_csv(tmp_path / "catalog.csv")
    np.testing.assert_allclose(table["opening_distance_m"], labelled["opening_distance"].values, atol=5.1e-3)
    assert label_columns(events) == {}


def test_a_label_of_another_type_is_refused():
    events = catalogue([[0.0, 0.0, 0.0]], ["a"])
    with pytest.raises(InputError, match="opening_distance: type int64, not float64"):
        write_events(events.assign(opening_distance=("event", [1], {"units": "m"})), "none.nc")
