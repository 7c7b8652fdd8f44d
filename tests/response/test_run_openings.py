"""Openings of a plan's runs after the last step: those of each run, as its own table of openings has them."""

import numpy as np
import pytest
from small_mines import load, states_of, with_failed

from common.datasets import read_dataset, write_dataset
from common.event_table import new_catalog, write_events
from common.opening_table import ALL, read_opening_runs
from response.openings import read_and_measure
from response.run_openings import plan_tables
from response.settings import OpeningSlice, PlanOpeningSlice

EXCAVATIONS = [
    {"name": "stope", "shape": "box", "lower": ["-4 m", "-3 m", "-2 m"], "upper": ["4 m", "3 m", "2 m"]},
    {"name": "later", "step": "planned", "shape": "box", "lower": ["9 m", "9 m", "9 m"],
     "upper": ["12 m", "12 m", "12 m"]},
    {"name": "pass", "shape": "box", "lower": ["-4 m", "10 m", "-2 m"], "upper": ["4 m", "13 m", "2 m"]},
    {"name": "again", "shape": "box", "lower": ["-2 m", "-2 m", "-1 m"], "upper": ["2 m", "2 m", "1 m"]},
]  # fmt: skip


@pytest.fixture(scope="module")
def plan(tmp_path_factory):
    """Slice, path of the grid, and failed roof of the stope in the plan's own run, failed walls of it in the member."""
    folder = tmp_path_factory.mktemp("plan")
    mine = load(folder, EXCAVATIONS)
    grid, state = states_of(mine, folder)
    write_dataset(grid, folder / "grid.nc")
    place, runs = state["position"].values, []
    above = (np.abs(place[:, 0]) < 4) & (np.abs(place[:, 1]) < 3) & (place[:, 2] > 2) & (place[:, 2] < 5)
    aside = (np.abs(place[:, 1]) < 3) & (np.abs(place[:, 2]) < 2) & (place[:, 0] > 4) & (place[:, 0] < 9)
    for kind, failed in (("own", above), ("member", aside)):
        write_dataset(with_failed(state, failed), folder / kind / "states" / "history.nc")
        none = new_catalog(0, {"mine": "small", "step": "history", "kind": "synthetic", "location_error": 0.0})
        none["step"] = none["step"].astype(str)
        write_events(none, folder / kind / "events" / "history.nc")
        runs.append(
            {"kind": kind, **{part: [str(folder / kind / part / "history.nc")] for part in ("states", "events")}}
        )
    return mine.openings_slice() | {"plan": "one", "runs": runs}, folder / "grid.nc"


def test_each_run_has_what_its_own_table_says(plan, tmp_path):
    """Against the table of openings of each run: the deepest side, all sides together; mined openings with walls."""
    given, grid = plan
    own, runs = plan_tables(PlanOpeningSlice.of(given), grid, None)
    write_dataset(runs, tmp_path / "runs.nc")
    found = read_opening_runs(tmp_path / "runs.nc")
    assert found["opening"].values.tolist() == ["stope", "pass"]  # `again` mines nothing
    assert found["run"].values.tolist() == ["own", "member"]
    assert (found.attrs["step"], found.attrs["fine_cell"]) == ("history", 1.0)
    assert found["side"].values.tolist() == [["roof", ""], ["walls", ""]]
    assert found["depth_p90"].values[0, 0] == pytest.approx(3.0, abs=0.5)
    assert found["depth_p90"].values[1, 1] == 0.0
    for number, run in enumerate(given["runs"]):
        settings = OpeningSlice.of({key: one for key, one in given.items() if key not in ("plan", "runs")})
        table = read_and_measure(settings, grid, run["states"], run["events"], None)
        if not number:
            assert table.identical(own)
        for place, name in enumerate(("stope", "pass")):
            rows = table.isel(row=np.flatnonzero(table["excavation"].values == name))
            whole = rows.isel(row=np.flatnonzero(rows["side"].values == ALL))
            sides = rows.isel(row=np.flatnonzero(rows["side"].values != ALL))
            assert found["depth_p90"].values[number, place] == sides["depth_p90"].values.max()
            for column, source in (("depth_largest",) * 2, ("closure", "closure_median"), ("failed_volume",) * 2):
                np.testing.assert_array_equal(found[column].values[number, place], whole[source].values[0])


def test_a_step_after_a_collapse_has_no_rows(plan, tmp_path):
    """Neither the openings mined before nor those that it would have mined."""
    given, grid = plan
    settings = OpeningSlice.of({key: one for key, one in given.items() if key not in ("plan", "runs")})
    run = given["runs"][0]
    write_dataset(read_dataset(run["states"][0]).assign_attrs(computed=0), tmp_path / "history.nc")
    assert read_and_measure(settings, grid, [tmp_path / "history.nc"], run["events"], None).sizes["row"] == 0


def test_runs_in_another_order_have_their_own_numbers(plan):
    given, grid = plan
    mirrored = given | {"runs": given["runs"][::-1]}
    _, runs = plan_tables(PlanOpeningSlice.of(given), grid, None)
    _, other = plan_tables(PlanOpeningSlice.of(mirrored), grid, None)
    np.testing.assert_array_equal(runs["depth_p90"].values, other["depth_p90"].values[::-1])
