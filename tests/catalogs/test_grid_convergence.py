"""What two runs on cells of two sizes say of each other: exact numbers of hand-made ones, and the report's words."""

import json
import re
from dataclasses import replace

import numpy as np
import pytest
import report_fixtures as fixtures
import xarray as xr
from scipy.stats import norm

from catalogs.compare.cell_error import error_at
from catalogs.compare.grid_convergence import cell_error, compare_cells, doubled_cells_tell
from catalogs.figures import style
from catalogs.report.cell_effects import doubled_cells
from catalogs.report.sections.uncertainty import section
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


def run(
    potency: list[float], step: list[str], floor: float, volumes: list[float], resolved=None, mine="testmine", thick=2
):
    """Catalogue of a run, and the states of its steps: layers of failed rock of `thick` cells beside sound rock."""
    counted = [1] * len(potency) if resolved is None else resolved
    attributes = {"mine": mine, "kind": "synthetic", "potency_floor": floor}
    catalog = new_catalog(len(potency), attributes, potency=potency, step=step, resolved=counted)
    states = [
        layers(thick, list(range(1, index + 2))).assign_attrs(
            mine=mine, step=name, step_index=index + 1, failed_volume=volume
        )
        for index, (name, volume) in enumerate(zip(STEPS, volumes, strict=True))
    ]
    return catalog, states


def layers(thick: int, steps: list[int]) -> xr.Dataset:
    """State on 4 x 4 cells in plan for each step: so many layers that failed in it between an opening below and sound
    rock above, which also lies between one step's cells and the next one's."""
    where = np.array(
        [(12 * step + x, y, z) for step in steps for x in range(4) for y in range(4) for z in range(thick + 2)]
    )
    failed = np.where(where[:, 2] < thick, where[:, 0] // 12, -1)
    fields = {"cell_origin": (("cell", "xyz"), 2.0 * where), "cell_size": ("cell", np.full(len(where), 2.0))}
    particles = {"cell": ("particle", np.arange(len(where))), "failed": ("particle", failed)}
    return xr.Dataset(fields | particles)


@pytest.fixture
def found() -> xr.Dataset:
    own = run([3.0, 0.5, 0.1, 1.0], ["2019-08"] * 3 + ["2019-09"], 0.05, VOLUMES["own"], [1, 1, 1, 0])
    coarse = run([2.5, 0.4, 1.2], ["2019-08", "2019-08", "2019-09"], 0.2, VOLUMES["coarse"], thick=1)
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


def test_the_uncertainty_follows_from_the_thickness_of_the_failed_rock_where_doubled_cells_lose_an_opening(found):
    """A drive is narrow for doubled cells: their change, a fifth and more, is no error of the mine's own cells."""
    np.testing.assert_allclose(found["thickness"], [[2.0, 2.0, 2.0], [1.0, 1.0, 1.0]])
    for name in ("potency_error", "failed_volume_error"):
        np.testing.assert_allclose(found[name], np.expm1(error_at(2.0)))


def test_a_change_that_both_thicknesses_do_not_explain_is_the_uncertainty():
    """No opening is lost: up to the sum of both uncertainties, beyond it; and where failed rock is thin."""
    own, coarse = error_at(3.0), error_at(1.5)
    for share, stated in ((0.0, own), (0.99, own), (1.01, 1.01 * (own + coarse)), (-1.01, 1.01 * (own + coarse))):
        values = (1.0, np.exp(share * (own + coarse)))
        assert cell_error(values, (3.0, 1.5), lost=False) == pytest.approx(np.expm1(stated))
        assert cell_error(values, (3.0, 1.5), lost=True) == pytest.approx(np.expm1(own))
    assert not doubled_cells_tell(0.2, lost=False)
    assert cell_error((1.0, 0.1), (3.0, 0.2), lost=False) == pytest.approx(np.expm1(own))
    assert cell_error((1.0, 0.0), (3.0, np.nan), lost=False) == pytest.approx(np.expm1(own))


def test_nothing_that_failed_has_no_error():
    assert np.isnan(cell_error((0.0, 0.0), (np.nan, np.nan), lost=False))
    assert np.isnan(cell_error((0.0, 1.0), (np.nan, 1.0), lost=False))


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
    """In the sentences that the report has of them; the last test sees that they are in the page."""
    mine = fixtures.make_mine(tmp_path)
    arguments = written(mine, overshoot_share=0.15)

    def evidence(**changes):
        return fixtures.evidence_of(**arguments | changes)

    def said(table: xr.Dataset, **changes) -> str:
        write_dataset(table, tmp_path / "grid_convergence.nc")
        return " ".join(doubled_cells(evidence(grid_convergence=tmp_path / "grid_convergence.nc", **changes)))

    assert doubled_cells(evidence()) == []
    text = said(found)
    assert (
        "Rock failed in a zone that is 2.0 cells of 2 m thick on average. In study openings, 90 % of the runs" in text
    )
    assert "On cells of 4 m instead of 2 m the same steps release 4.10 m³ of potency (here 4.60)" in text
    assert (
        "This change tells little of cells of 2 m, since on cells of 4 m too little rock fails around openings" in text
    )
    assert text.endswith("narrow for them: drive.")
    clear = found.assign_attrs(narrow="[]", left_out="[]")
    thick = clear.assign(thickness=3.0 * found["thickness"])
    assert said(thick).endswith("The change is within what the study lets expect of both sizes of cells.")
    other = thick.assign(potency_error=thick["potency_error"] + 0.3)
    assert "The change in potency is larger than the study lets expect of both sizes of cells: the" in said(other)
    none = clear.assign(thickness=found["thickness"].where(found["cell"] == 2.0))
    assert said(none).endswith("This change tells little of cells of 2 m, since no rock fails there.")
    thin = clear.assign(thickness=found["thickness"].where(found["cell"] == 2.0, 0.1))
    assert said(thin).endswith("since failed rock is only 0.10 cells thick there.")
    gone = found.assign_attrs(narrow="[]", left_out='["drive", "no_more"]')
    text = said(gone)
    assert "On cells of 4 m instead of 2 m, which leave out drive, the same steps release" in text
    assert text.endswith("since cells of 4 m leave openings out.")


def test_the_report_says_that_cells_are_too_large(tmp_path, found, monkeypatch):
    """In the page."""
    monkeypatch.setattr(style, "save", fixtures.write_nothing)
    mine = fixtures.make_mine(tmp_path)
    arguments = written(mine, overshoot_share=0.15)
    thin = found.assign(potency_error=found["potency_error"] * 100, thickness=found["thickness"] * 0.1)
    write_dataset(thin, tmp_path / "grid_convergence.nc")
    fixtures.write_page(**arguments, grid_convergence=tmp_path / "grid_convergence.nc")
    page = mine.arguments()["output"].read_text()
    assert "Cells of 2 m are too large to say how far smaller cells would change its numbers." in page
    assert "Failed rock is only 0.20 cells of 2 m thick on average, too little to say how far" in page
    assert "Do not use these numbers before grid.finest_cell is halved." in page


def test_sources_are_combined_without_counting_chance_twice(tmp_path, found):
    """Potency 10 m3: cells leave a factor of 1.2, chance 1.4 or 1.1, of which the larger counts; overshoot 15 %."""
    mine = fixtures.make_mine(tmp_path)
    arguments = written(mine, overshoot_share=0.15)
    write_dataset(found.assign(potency_error=0.0 * found["potency_error"] + 0.2), tmp_path / "grid_convergence.nc")
    known = fixtures.evidence_of(**arguments | {"grid_convergence": tmp_path / "grid_convergence.nc"})
    catalog = known.catalog.assign(potency=known.catalog["potency"] * (10.0 / float(known.catalog["potency"].sum())))

    def together(deviation: float | None) -> dict:
        statistics = np.array([[5.0, 5.0 * (deviation or 0.0), 0.0, 0.0]])
        spread = xr.Dataset({"potency_statistics": (("period", "statistic"), statistics)}, {"period": ["all"]})
        runs = None if deviation is None else spread.assign_attrs(members=8)
        return section(replace(known, catalog=catalog, spread=runs), None)

    alone = together(None)
    assert (
        "is 10.0 m³; cells with the place of walls in them, and increments leave it within 7.24 to 12.0 m³."
        in alone["together"]
    )
    assert "Not contained: chance in the model" in alone["together"]
    rows = {row["name"]: row for row in alone["rows"]}
    assert (rows["Chance in the model"]["potency"], rows["Chance in the model"]["key"]) == (
        "not computed",
        "ensemble: 8",
    )
    assert rows["Cells"]["potency"] == "factor 1.20"
    assert rows["Place of walls in the cells"]["potency"] == "in cells"
    assert "whichever is larger, and increments leave it within 7.24 to 12.0 m³" in together(0.05)["together"]
    assert "leave it within 6.21 to 14.0 m³" in together(0.2)["together"]


def test_nine_truths_of_ten_lie_within_what_the_sources_leave_together_and_wrong_ones_do_not(tmp_path, found):
    """Truths by an error of the cells whose 90 % the law states, and by an overshoot up to what the report states; then
    by errors three times as large."""
    mine = fixtures.make_mine(tmp_path)
    arguments = written(mine, overshoot_share=0.15)
    share = 0.2
    write_dataset(found.assign(potency_error=0.0 * found["potency_error"] + share), tmp_path / "grid_convergence.nc")
    known = fixtures.evidence_of(**arguments | {"grid_convergence": tmp_path / "grid_convergence.nc"})
    ends = re.search(r"leave it within ([\d.]+) to ([\d.]+) m³", section(known, None)["together"])
    low, high = (float(end) for end in ends.groups())
    generator, potency = np.random.default_rng(3), float(known.catalog["potency"].sum())
    overshoot = 1.0 + 0.15 * generator.random(4000)
    for factor, least, most in ((1.0, 0.9, 1.0), (3.0, 0.0, 0.6)):
        error = factor * np.log1p(share) / norm.ppf(0.95) * generator.standard_normal(4000)
        truth = potency * np.exp(error) / overshoot
        assert least <= np.mean((truth >= low) & (truth <= high)) <= most
