"""Loading measures in a mine's file: what they make, for the mine and for its plans, and what they leave alone."""

import csv

import numpy as np
import pytest
import xarray as xr
from tiny_mines import NEXT_STEP, TINY, changed, edited, jobs, snakemake

from common.loading_table import read_loading

POINT = {"name": "dyke", "point": ["20 m", "32 m", "52 m"], "strike": "0 deg", "dip": "70 deg", "radius": "4 m"}
LOADED = {"loading_measures": {"planes": [POINT], "dynamic_friction": "20 deg"}}
AGAIN = dict.fromkeys(("loading", "report", "report_page", "all"), 1)


def test_measures_are_made_where_they_are_asked_for_and_nothing_else_again(spoiled, undisturbed, base):
    """They need no mechanics anew; without the key there is no stage; energies are those of the steps."""
    assert "loading" not in jobs(undisturbed[1])
    with edited(base / "files" / "tiny.yaml", changed(TINY, **LOADED)) as file:
        status, text = snakemake(file, spoiled)
        assert status == 0, text
        assert jobs(text) == AGAIN
        assert "Nothing to be done" in snakemake(file, spoiled)[1]
    results = spoiled / "results/tiny"
    table = read_loading(results / "loading.nc")
    assert table.attrs["made_from"]
    with xr.open_dataset(results / "steps/2019-08.nc") as state:
        row = np.flatnonzero((table["step"].values == "2019-08") & (table["kind"].values == "step"))[0]
        assert float(table["plastic_work"][row]) == pytest.approx(state.attrs["energy_dissipated"] / 1e6)
        made = (state.attrs["energy_released"] + state.attrs["energy_support"] - state.attrs["energy_mined"]) / 1e6
        found = float(table["energy_released"][row] - table["energy_mined"][row])
        assert found == pytest.approx(made)
    with (results / "loading.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == table.sizes["row"]
    assert {one["name"] for one in rows if one["kind"] == "plane"} == {"dyke"}
    assert "release_rate_MJ/m2" in rows[0]
    page = (results / "report.html").read_text(encoding="utf-8")
    assert "releases most energy for its area" in page[page.index('<section id="loading">') :]


PLANS = {"later": {"excavations": {"stope_2": {"step": "2019-09"}}, "steps": [NEXT_STEP]}}


@pytest.mark.slow
def test_plans_have_their_measures_side_by_side(spoiled, base):
    planned = changed(TINY, **LOADED, plans=PLANS, hazard={"runs": 1})
    with edited(base / "files" / "tiny.yaml", planned) as file:
        status, text = snakemake(file, spoiled, "plans")
        assert status == 0, text
        assert jobs(text)["plan_loading"] == 2
        assert "loading" not in jobs(text)
    plans = spoiled / "results/tiny/plans"
    own, later = (read_loading(plans / name / "loading.nc") for name in ("mine_file", "later"))
    assert set(later["name"].values) - set(own["name"].values) == {"stope_2"}
    shared = later["step"].values != NEXT_STEP["name"]
    for column in ("energy_released", "ess_largest", "plastic_work"):
        np.testing.assert_allclose(later[column].values[shared], own[column].values)
    page = (plans / "report.html").read_text(encoding="utf-8")
    section = page[page.index("Energy and loading") :].split("<h2>")[0]
    assert "stope_2" in section
    assert "dyke" in section
