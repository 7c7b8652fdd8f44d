"""The spread of an ensemble: exact numbers of hand-made runs, and what the report tells of them."""

import json
from pathlib import Path

import numpy as np
import pytest
import report_fixtures as fixtures
import xarray as xr

from catalogs.compare.spread import STATISTICS, gather, statistics
from catalogs.sources.sizes import estimate_b
from common.datasets import read_dataset, write_dataset
from common.errors import InputError
from common.event_table import new_catalog, write_events

STEPS = ["2019-08", "2019-09"]
SETTINGS = {"mine": "testmine", "members": 2, "variability": 0.1, "steps": STEPS}
CATALOG = xr.Dataset(attrs={"potency_floor": 1e-3})


def write_run(folder: Path, potency: dict[str, list[float]], resolved=None, mine: str = "testmine") -> Path:
    """Steps and events of a run. Rock that failed: 10 m3 a step; energy 3 J released, 2 J dissipated."""
    facts = {"mine": mine, "failed_volume": 10.0, "energy_released": 3.0, "energy_dissipated": 2.0}
    for step, values in potency.items():
        write_dataset(xr.Dataset({"stress": ("particle", np.zeros(3))}, attrs=facts), folder / "steps" / f"{step}.nc")
        budget = json.dumps({"particle_scalars": 2 * sum(values)})
        attributes = {"mine": mine, "kind": "synthetic", "budget": budget}
        counted = [1] * len(values) if resolved is None else resolved
        events = new_catalog(len(values), attributes, potency=values, resolved=counted)
        write_events(events, folder / "events" / f"{step}.nc")
    return folder


@pytest.fixture
def runs(tmp_path) -> list[Path]:
    """The mine's own run and two members: 3, 4 and 6 m3 in the first step, 1 m3 in the second."""
    return [
        write_run(tmp_path / str(number), {"2019-08": [2.0] * (number + 1) + [1.0], "2019-09": [1.0]})
        for number in range(3)
    ]


def test_every_run_by_step_and_in_total(runs):
    found = gather(runs, CATALOG, None, SETTINGS)
    assert found["period"].values.tolist() == [*STEPS, "all"]
    np.testing.assert_allclose(found["potency"], [[3, 1, 4], [5, 1, 6], [7, 1, 8]])
    np.testing.assert_allclose(found["particle_potency"], 2 * found["potency"])
    assert found["events"].values.tolist() == [[2, 1, 3], [3, 1, 4], [4, 1, 5]]
    np.testing.assert_allclose(found["failed_volume"], [[10, 10, 20]] * 3)
    np.testing.assert_allclose(found["energy_released"], [[3, 3, 6]] * 3)
    np.testing.assert_allclose(found["energy_dissipated"], [[2, 2, 4]] * 3)
    assert (found.attrs["members"], found.attrs["cut"]) == (2, -3.0)


def test_statistics_are_of_the_members_alone(runs):
    """The mine's own run is shown beside them; mean, deviation with n - 1, range."""
    found = gather(runs, CATALOG, None, SETTINGS)["potency_statistics"]
    np.testing.assert_allclose(found.sel(period="all"), [7.0, np.sqrt(2.0), 6.0, 8.0])
    np.testing.assert_allclose(found.sel(period="2019-09"), [1.0, 0.0, 1.0, 1.0])


def test_members_that_have_collapsed_are_left_out_and_counted(runs):
    path = runs[1] / "steps" / "2019-09.nc"
    write_dataset(read_dataset(path).assign_attrs(collapsed=1), path)
    found = gather(runs, CATALOG, None, SETTINGS)
    assert (found.attrs["members"], found.attrs["collapsed_members"]) == (1, 1)
    np.testing.assert_allclose(found["potency"], [[3, 1, 4], [7, 1, 8]])
    path = runs[2] / "steps" / "2019-09.nc"
    write_dataset(read_dataset(path).assign_attrs(collapsed=1), path)
    with pytest.raises(InputError, match="all 2 members ended in collapse"):
        gather(runs, CATALOG, None, SETTINGS)


def test_statistics_leave_out_what_is_not_known():
    """One value has no deviation, none has nothing; a member without b does not spoil the others'."""
    found = statistics(np.array([[1.0, np.nan, 5.0], [np.nan, np.nan, 7.0], [3.0, np.nan, np.nan]]))
    np.testing.assert_allclose(found[0], [2.0, np.sqrt(2.0), 1.0, 3.0])
    assert np.isnan(found[1]).all()
    assert np.isnan(statistics(np.array([[4.0]]))[0]).tolist() == [name == "standard_deviation" for name in STATISTICS]


def test_unresolved_events_count_in_potency_alone(tmp_path):
    own, member = (write_run(tmp_path / k, {"2019-08": [4.0, 1.0]}, resolved=[1, 0]) for k in "ab")
    found = gather([own, member], CATALOG, None, SETTINGS | {"steps": ["2019-08"]})
    assert found["potency"].values[0, -1] == 5.0
    assert found["events"].values[0, -1] == 1
    assert found["cumulative"].values[:, 0].tolist() == [1, 1]


def test_b_is_that_of_the_comparison_at_its_cut_and_all_runs_share_the_cut(tmp_path):
    """300 events of b = 1 each; the cut is the comparison's where there is a record, else the model's floor."""
    random = np.random.default_rng(1)
    values = [1e-3 * random.random(300) ** -1.0 for _ in range(2)]
    folders = [write_run(tmp_path / str(k), {"2019-08": list(v)}) for k, v in enumerate(values)]
    settings = SETTINGS | {"steps": ["2019-08"]}
    comparison = xr.Dataset({"cut": ((), -2.5)}, attrs={"cut_text": "log P >= -2.50, the record's completeness"})
    for given, cut in ((None, -3.0), (comparison, -2.5)):
        found = gather(folders, CATALOG, given, settings)
        for run, potency in enumerate(values):
            expected = estimate_b(np.log10(potency), cut)
            assert found["b"].values[run, -1] == pytest.approx(expected.b)
            assert found["b_error"].values[run, -1] == pytest.approx(expected.error)
            assert found["events_above_cut"].values[run, -1] == (np.log10(potency) >= cut).sum()
    assert found.attrs["cut_text"] == comparison.attrs["cut_text"]


def test_runs_without_any_event_are_told_as_such(tmp_path):
    """Nothing failed: no floor, no cut, no b, no bins, and no crash."""
    folders = [write_run(tmp_path / str(k), {"2019-08": []}) for k in range(2)]
    nothing = xr.Dataset(attrs={"potency_floor": np.nan})
    found = gather(folders, nothing, None, SETTINGS | {"steps": ["2019-08"]})
    assert found.sizes["size_bin"] == 0
    assert np.isnan(found["b"].values).all()
    assert (found["events"].values == 0).all()


def test_what_is_missing_or_of_another_mine_is_named(runs, tmp_path):
    with pytest.raises(InputError, match="there are no members"):
        gather(runs[:1], CATALOG, None, SETTINGS)
    with pytest.raises(InputError, match=r"steps/2019-10\.nc: not a readable dataset"):
        gather(runs, CATALOG, None, SETTINGS | {"steps": ["2019-10"]})
    other = write_run(tmp_path / "other", {step: [1.0] for step in STEPS}, mine="othermine")
    with pytest.raises(InputError, match=r"steps/2019-08\.nc: is of mine othermine, not of testmine"):
        gather([*runs, other], CATALOG, None, SETTINGS)


# ---- in the report ----


def page(mine: fixtures.Mine, folder: Path, **changes) -> str:
    """A short report: no stages, no pictures of rock."""
    output = folder / "report.html"
    fixtures.write_page(**mine.arguments(output=output, figures=folder / "figures", elastic=None, steps=[], **changes))
    return output.read_text()


def test_the_report_shows_the_spread_in_its_section(mine, tmp_path):
    """Four runs, each with the sizes of 150 events; the numbers are those of the dataset."""
    sizes = read_dataset(mine.catalog)["potency"].values
    folders = [
        write_run(tmp_path / str(k), {"2019-08": list(sizes[: 75 - k]), "2019-09": list(sizes[75 + 2 * k :])})
        for k in range(4)
    ]
    found = gather(folders, read_dataset(mine.catalog), read_dataset(mine.comparison), SETTINGS)
    write_dataset(found, tmp_path / "spread.nc")
    text = page(mine, tmp_path, spread=tmp_path / "spread.nc")
    section = text[text.index('<section id="spread">') : text.index('<section id="truncated">')]
    assert (tmp_path / "figures/spread.svg").stat().st_size > 10_000
    assert "figures/spread.svg" in section
    assert "strength varies from place to place by 10 %" in section
    assert "In 3 members of the ensemble" in section
    assert "141 to 147 events are of enough particles (here 150)" in section
    _, _, least, largest = found["potency_statistics"].sel(period="all").values
    assert f"{least:.3g} to {largest:.3g} m³" in section
    for row in ("potency of all events", "events (of enough particles)", "b of potency", "energy released"):
        assert row in section
    assert "<td>150</td><td>144</td>" in section


def test_without_an_ensemble_the_report_says_that_one_run_is_one_realisation(mine, tmp_path):
    text = page(mine, tmp_path, record=None, comparison=None)
    assert text.count("One run is one realisation") == 1
    assert "<code>ensemble</code> in the mine file" in text
    assert not (tmp_path / "figures/spread.svg").exists()
