"""The sections of the scene and of failed rock: sums of many excavations, cells, where energy went."""

import json
from types import SimpleNamespace

import numpy as np
import pytest
import report_fixtures as fixtures
import xarray as xr
from report_fixtures import make_page

from catalogs.figures import style, views
from catalogs.report import sections
from catalogs.report.evidence import ExcavationRow
from catalogs.report.sections import rock
from catalogs.report.sections.rock import energy_table
from catalogs.report.sections.scene import above_cap, block_model, by_step, far_field
from catalogs.report.text import number
from common.datasets import read_dataset

pytestmark = pytest.mark.usefixtures("without_drawing")


def test_many_excavations_are_folded_under_their_sums(page, mine, tmp_path, monkeypatch):
    """Four here; a list of over a hundred would hide what follows."""
    assert not any(tag == "details" for tag, _ in page.tags)
    monkeypatch.setattr(sections, "MAX_ROWS_UNFOLDED", 2)
    folded = make_page(mine, tmp_path)
    assert [tag for tag, _ in folded.tags if tag in ("details", "summary")] == ["details", "summary"]
    names = ("excavation_volume", "excavation_volume_grid")
    volumes = [sum(json.loads(read_dataset(mine.grid).attrs[name])) for name in names]
    expected = f"4 excavations, {number(volumes[0], 4)} m³ as solids, {number(volumes[1], 4)} m³ on the grid"
    assert expected in folded.sections["scene"]


def excavation(name: str, step: str, solid: float, drawn: float) -> ExcavationRow:
    return ExcavationRow(name, step, "none", step, solid, drawn, step == "planned", False)


def test_many_excavations_are_summed_by_step_with_the_worst_of_them():
    """In the order of the list; a solid without volume has no error, and loses nothing of the sums."""
    rows = by_step(
        [
            excavation("a", "history", 10.0, 9.0),
            excavation("b", "2019-08", 4.0, 5.0),
            excavation("c", "history", 20.0, 20.2),
            excavation("d", "planned", 0.0, 0.0),
        ]
    )
    assert [(row["step"], row["count"], row["solid"], row["drawn"]) for row in rows] == [
        ("history", 2, 30.0, 29.2),
        ("2019-08", 1, 4.0, 5.0),
        ("planned", 1, 0.0, 0.0),
    ]
    assert [row["worst"] for row in rows] == ["a", "b", "d"]
    assert [row["error"] for row in rows] == pytest.approx([-0.1, 0.25, np.nan], nan_ok=True)
    assert [row["planned"] for row in rows] == [False, False, True]


def test_a_derived_domain_is_told_with_what_is_expected_of_it():
    """In one sentence, another where it could not be as large as it should; of a given domain nothing is said."""
    assert far_field(xr.Dataset()) == ""
    attributes = {"far_field_distance": 209.86, "far_field_error": 0.3585, "far_field_limited": ""}
    told = far_field(xr.Dataset(attrs=attributes))
    assert "210 m from the nearest of them" in told
    assert "0.36 % of the largest" in told
    assert "memory" not in told
    assert "memory" in far_field(xr.Dataset(attrs=attributes | {"far_field_limited": "memory"}))
    assert "above its strength" in far_field(xr.Dataset(attrs=attributes | {"far_field_limited": "strength"}))


def test_a_block_model_is_told_with_the_share_of_each_kind():
    """The largest first, and how much of the domain has no block."""
    assert block_model(xr.Dataset()) == ""
    shares = {"host": 0.125, "ore": 0.5, **{f"kind {number}": 0.01 for number in range(12)}}
    told = block_model(xr.Dataset(attrs={"block_model": json.dumps({"blocks": 681472, "shares": shares})}))
    assert "ore 50 %, host 12.5 %, kind 0 1 %" in told
    assert "and 2 more" in told
    assert "leave 25.5 % of the domain free" in told


def test_more_cells_than_the_cap_are_told():
    """On an adaptive grid."""
    grid = {"refinement": "adaptive", "max_cells": 300}
    evidence = SimpleNamespace(stages=[SimpleNamespace(attrs={"cells": 1234})], config={"grid": grid})
    assert above_cap(evidence).startswith("The last step has 1\u202f234 cells, more than grid.max_cells (300)")
    for other in ({"max_cells": 1234}, {"refinement": "static"}):
        evidence.config = {"grid": grid | other}
        assert above_cap(evidence) == ""


def test_the_page_says_where_the_energy_of_each_step_went(page, mine):
    """Each term in its column, in MJ; hourglass energy held and lost at failure together; what is left as a share."""
    attributes = read_dataset(mine.steps[-1]).attrs
    table = energy_table(SimpleNamespace(steps=[attributes]))
    assert dict(zip(table["columns"], table["rows"][0]["values"], strict=True)) == {
        "work done on the rock": "2.00", "increase of stored energy": "−33.0", "taken up by the mined rock": "6.00",
        "seismic drop": "1.00", "overshoot": "2.00", "later plastic flow": "8.00", "hourglass": "1.00",
        "motion": "16.9", "unbalanced": "0.100",
    }  # fmt: skip
    assert table["rows"][0]["left"] == "6.0·10⁻¹⁰ %"
    assert not table["gains"]
    for text in (
        "where the energy went",
        "later plastic flow",
        "16.9",
        "6.0·10⁻¹⁰ %",
        "closure depend on the cell size",
    ):
        assert text in page.sections["rock"]
    gains = energy_table(SimpleNamespace(steps=[attributes | {"energy_gained": 1e6}]))
    assert gains["gains"]
    assert gains["rows"][0]["values"][-1] == "1.00"
    round_off = {key: 1e-4 for key in attributes if key.startswith("energy_")} | {"energy_round_off": 1e-3}
    nothing = energy_table(SimpleNamespace(steps=[attributes | round_off]))
    assert set(nothing["rows"][0]["values"]) == {"0"}
    assert nothing["rows"][0]["left"] == "no energy"
    assert not nothing["gains"]
    assert not nothing["splits"]
    moving = energy_table(SimpleNamespace(steps=[attributes | {"energy_left_share": np.nan}]))
    assert moving["unknown"]
    assert moving["rows"][0]["left"] == "–"


def test_rock_above_strength_in_coarse_cells_is_not_shown_as_rock_that_fails_next():
    """Every coarse cell above strength, and no fine one, has its own colour."""
    grid = fixtures.make_grid(**{"coarse": 16.0})
    state = fixtures.make_state(grid, 2)
    state["failed"][:] = -1
    state["excavation"][:] = -1
    state["volume"][:] = grid["cell_size"].values ** 3
    state["strength_factor"][:] = 0.9
    with style.applied():
        cuts = views.cuts(grid, state["position"].values, np.ones(grid.sizes["cell"]))[:1]
        figure = rock.strength_factor(grid, state, cuts, [])
    colour = np.array(style.mpl.colors.to_rgb(rock.TOO_COARSE))
    drawn = [
        one
        for one in figure.axes[0].collections
        if one.get_array() is None and len(one.get_facecolors()) and np.allclose(one.get_facecolors()[0, :3], colour)
    ]
    cells = views.cut_cells(grid, cuts[0])
    coarse = grid["cell_size"].values[cells] > grid["cell_size"].values.min()
    assert sum(len(one.get_paths()) for one in drawn) == coarse.sum() > 0
