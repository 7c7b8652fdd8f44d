"""What two runs on cells of two sizes say of each other: exact numbers of hand-made ones, and the report's words."""

import json

import numpy as np
import pytest
import report_fixtures as fixtures
import xarray as xr
from hypothesis import given
from hypothesis import strategies as st

from catalogs.compare.grid_convergence import MIN_ERROR_SHARE, SAFETY_FACTOR, compare_cells, share_off
from catalogs.figures import style
from catalogs.report.sections.convergence import discretisation
from common.datasets import read_dataset, write_dataset
from common.errors import InputError
from common.event_table import new_catalog

STEPS = ["2019-08", "2019-09"]
SETTINGS = {"mine": "testmine", "steps": STEPS, "cells": [2.0, 4.0]}
COARSE_GRID = {
    "excavation_names": '["drive", "stope_a", "sump"]',
    "excavation_volume_grid": "[9.0, 7.0, 0.0]",
    "excavation_narrow": '["drive"]',
}
VOLUMES = {"own": [100.0, 50.0], "coarse": [80.0, 50.0]}


def run(potency: list[float], step: list[str], floor: float, volumes: list[float], resolved=None, mine="testmine"):
    """Catalogue of a run, and the attributes of its steps."""
    counted = [1] * len(potency) if resolved is None else resolved
    attributes = {"mine": mine, "kind": "synthetic", "potency_floor": floor}
    catalog = new_catalog(len(potency), attributes, potency=potency, step=step, resolved=counted)
    states = [
        {"mine": mine, "step": name, "failed_volume": volume} for name, volume in zip(STEPS, volumes, strict=True)
    ]
    return catalog, states


@pytest.fixture
def found() -> xr.Dataset:
    own = run([3.0, 0.5, 0.1, 1.0], ["2019-08"] * 3 + ["2019-09"], 0.05, VOLUMES["own"], [1, 1, 1, 0])
    coarse = run([2.5, 0.4, 1.2], ["2019-08", "2019-08", "2019-09"], 0.2, VOLUMES["coarse"])
    return compare_cells(*zip(own, coarse, strict=True), COARSE_GRID, SETTINGS)


def test_numbers_of_both_runs_by_step_and_in_total(found):
    assert found["cell"].values.tolist() == [2.0, 4.0]
    assert found["period"].values.tolist() == [*STEPS, "all"]
    np.testing.assert_allclose(found["potency"], [[3.6, 1.0, 4.6], [2.9, 1.2, 4.1]])
    np.testing.assert_allclose(found["failed_volume"], [[100, 50, 150], [80, 50, 130]])
    assert found["events"].values.tolist() == [[2, 0, 2], [2, 1, 3]]  # resolved, from the larger floor on
    np.testing.assert_allclose(found["largest"], np.log10([[3.0, 1.0, 3.0], [2.5, 1.2, 2.5]]))
    assert found.attrs["floor"] == pytest.approx(np.log10(0.2))
    assert (json.loads(found.attrs["left_out"]), json.loads(found.attrs["narrow"])) == (["sump"], ["drive"])


def test_a_number_may_be_off_by_what_it_changed_by_and_a_quarter_of_that(found):
    np.testing.assert_allclose(found["potency_error"], SAFETY_FACTOR * np.array([0.7 / 3.6, 0.2, 0.5 / 4.6]))
    np.testing.assert_allclose(
        found["failed_volume_error"], [0.2 * SAFETY_FACTOR, MIN_ERROR_SHARE, 20 / 150 * SAFETY_FACTOR]
    )


@given(st.floats(0.1, 10.0), st.floats(-0.9, 5.0), st.floats(1.0, 3.0))
def test_it_holds_the_truth_wherever_convergence_is_of_first_order_or_better(limit, excess, order):
    """Numbers limit (1 + excess h^order) on cells h = 1 and 2."""
    own, coarse = limit * (1.0 + excess), limit * (1.0 + excess * 2.0**order)
    assert abs(own - limit) <= share_off(own, coarse) * own * (1.0 + 1e-9)


def test_nothing_that_failed_has_no_error():
    assert np.isnan(share_off([0.0], [0.0]))[0]
    assert share_off([0.0], [1.0])[0] == np.inf


@pytest.mark.parametrize("fault", [{"mine": "other"}, {"steps": ["2019-08"]}])
def test_files_of_another_mine_or_other_steps_are_refused(fault):
    runs = [run([1.0], ["2019-08"], 0.1, VOLUMES["own"]) for _ in range(2)]
    with pytest.raises(InputError, match="grid_convergence: steps 2019-08, 2019-09 of testmine"):
        compare_cells(*zip(*runs, strict=True), COARSE_GRID, SETTINGS | fault)


def written(mine: fixtures.Mine, **attributes) -> dict:
    """Arguments of a report whose steps carry what they overshot by."""
    for path in mine.steps:
        step = read_dataset(path)
        write_dataset(step.assign_attrs(attributes), path)
    return mine.arguments()


def test_the_report_says_what_cells_and_increments_leave_uncertain(tmp_path, found):
    """In the paragraph that the report has of them; the last test sees that it is in the page."""
    mine = fixtures.make_mine(tmp_path)
    arguments = written(mine, overshoot_share=0.15)

    def said(**changes) -> str:
        return " ".join(discretisation(fixtures.evidence_of(**arguments | changes)))

    grid = read_dataset(mine.grid)
    text = said()
    assert "on these numbers was not measured (grid_convergence: true measures it); unloading in increments" in text
    assert "too large, roughly by 15 % or less" in text
    with_table = {"grid_convergence": tmp_path / "grid_convergence.nc"}
    write_dataset(found, tmp_path / "grid_convergence.nc")
    text = said(**with_table)
    assert "On cells of 4 m instead of 2 m the same steps release 4.10 m³ of potency (here 4.60)" in text
    assert (
        "uncertain by about 14 % and failed rock by about 17 %. These shares may be too large: on cells of 4 m " in text
    )
    assert (
        "on cells of 4 m too little rock fails around openings narrow for them: drive; unloading in increments" in text
    )
    write_dataset(found.assign_attrs(narrow="[]"), tmp_path / "grid_convergence.nc")
    assert "failed rock by about 17 %; unloading in increments" in said(**with_table)
    write_dataset(found, tmp_path / "grid_convergence.nc")
    write_dataset(grid.assign_attrs(excavation_narrow='["drive", "stope_1"]'), tmp_path / "narrow.nc")
    text = said(grid=tmp_path / "narrow.nc", **with_table)
    assert "failed rock by about 17 %; unloading in increments" in text  # narrow for its own cells
    assert "above its strength at once" not in text
    catalog = read_dataset(arguments["catalog"]).assign_attrs(at_once_share=0.24)
    write_dataset(catalog, tmp_path / "at_once.nc")
    text = said(catalog=tmp_path / "at_once.nc")
    assert "24 % of the potency is in rock that one increment of mining brought above its strength at once" in text
    write_dataset(found.assign_attrs(left_out='["drive", "no_more"]'), tmp_path / "grid_convergence.nc")
    assert "On cells of 4 m instead of 2 m, which leave out drive, the same steps release" in said(**with_table)


def test_the_report_says_that_cells_are_too_large(tmp_path, found, monkeypatch):
    """In the page."""
    monkeypatch.setattr(style, "save", fixtures.write_nothing)
    mine = fixtures.make_mine(tmp_path)
    arguments = written(mine, overshoot_share=0.15)
    worse = found.assign(potency_error=found["potency_error"] * 10)
    write_dataset(worse, tmp_path / "grid_convergence.nc")
    fixtures.write_page(**arguments, grid_convergence=tmp_path / "grid_convergence.nc")
    page = mine.arguments()["output"].read_text()
    assert "too large to say how far these numbers would still change" in page
    assert "(on cells of 4 m too little rock fails around openings narrow for them: drive)" in page
