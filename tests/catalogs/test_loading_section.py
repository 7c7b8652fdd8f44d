"""The report's section on loading measures: the most loaded first, panels of what was asked for, and little to say."""

from types import SimpleNamespace

import numpy as np
import pytest
import xarray as xr
from report_fixtures import make_mine, make_page

from catalogs.report.gallery import Gallery
from catalogs.report.sections.loading import MAX_LISTED, section
from common.datasets import write_dataset
from common.fields import TEXT
from common.loading_table import FIELDS, OPENING, PLANE, STEP, read_loading

ENERGY = {"mined_volume": 100.0, "mined_area": 20.0, "energy_released": 50.0, "energy_mined": 10.0}


def table_of(*rows: dict) -> xr.Dataset:
    """A table of rows; numbers that a row leaves out are NaN."""
    columns = {}
    for field in FIELDS:
        values = [row.get(field.name, "" if field.dtype == TEXT else np.nan) for row in rows]
        columns[field.name] = (field.dims, np.array(values, field.dtype), field.attributes)
    return xr.Dataset(columns)


def openings(*rates: float, step: str = "2019-08") -> list[dict]:
    """Openings of a step with these release rates; the softer, the larger the rate."""
    return [
        {"step": step, "kind": OPENING, "name": f"stope_{number}", **ENERGY, "release_rate": rate,
         "loading_stiffness": 1000.0 / (1.0 + number)}
        for number, rate in enumerate(rates)
    ]  # fmt: skip


def plane(name: str, step: str, largest: float) -> dict:
    return {"step": step, "kind": PLANE, "name": name, "ess_largest": largest, "nearest_opening": "stope_1"}


@pytest.fixture
def shown(tmp_path):
    """Content of the section on a table, without drawing more than its own figure."""

    def make(table: xr.Dataset | None):
        return section(SimpleNamespace(loading=table, excavations=[]), Gallery(tmp_path))

    return make


def step(name: str, **values: float) -> dict:
    return {"step": name, "kind": STEP, "name": "all", **values}


def test_the_most_loaded_opening_comes_first(shown):
    """By energy per area in the step that mines it; one that was mined before is no line of its step."""
    old = {"step": "2019-09", "kind": OPENING, "name": "stope_0", "mined_volume": 0.0, "plastic_work": 3.0}
    rows = [step("2019-08", **ENERGY), *openings(1.5, 4.25, 2.0), step("2019-09", **ENERGY), old]
    found = shown(table_of(*rows))
    assert [line.name for line in found["openings"]] == ["stope_1", "stope_2", "stope_0"]
    assert "stope_1 (2019-08) releases most energy for its area, 4.2 MJ/m²." in found["most"]
    assert "The rock around stope_2 (2019-08) is softest, 333 MPa/m." in found["most"]
    assert [line.step for line in found["steps"]] == ["2019-08", "2019-09"]
    assert found["others"] < 0


def test_planes_are_those_after_the_last_step(shown):
    rows = [step("a"), plane("dyke", "a", -2.0), plane("fault", "a", np.nan), step("b"), plane("dyke", "b", 3.0)]
    found = shown(table_of(*rows, plane("fault", "b", np.nan)))
    assert [line.name for line in found["planes"]] == ["dyke", "fault"]
    assert found["planes"][0].values["ess_largest"] == 3.0
    assert found["most"] == ""


def test_many_openings_are_cut_off(shown):
    rows = [step("2019-08", **ENERGY), *openings(*np.linspace(0.0, 1.0, MAX_LISTED + 7).tolist())]
    found = shown(table_of(*rows))
    assert len(found["openings"]) == MAX_LISTED
    assert found["others"] == 7
    rates = [line.values["release_rate"] for line in found["openings"]]
    assert rates == sorted(rates, reverse=True)


def test_nothing_known_is_no_mistake(shown):
    """No table; no row; a step that collapsed."""
    assert shown(None) is None
    assert shown(table_of()) is None
    found = shown(table_of(step("2019-08", mined_volume=3.0), *openings(np.nan)))
    assert "releases most" not in found["most"]


def test_the_page_has_the_table(tmp_path, without_drawing):
    """Read from its file, which has all columns with their units."""
    mine = make_mine(tmp_path / "mine")
    rows = [step("2019-08", **ENERGY, release_rate=2.5), *openings(2.5), plane("dyke", "2019-08", 7.5)]
    write_dataset(table_of(*rows), tmp_path / "loading.nc")
    assert read_loading(tmp_path / "loading.nc").energy_released.attrs["units"] == "MJ"
    page = make_page(mine, tmp_path, loading=tmp_path / "loading.nc")
    for text in ("stope_0", "MJ/m²", "dyke", "7.50", "figures/loading.svg"):
        assert text in page.sections["loading"], text
    assert "asks for no loading measures" in make_page(mine, tmp_path / "none").sections["loading"]
