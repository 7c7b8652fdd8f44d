"""Ground motion in a mine's file: what it makes, what it leaves alone, and what is refused before a run."""

import csv

import numpy as np
import pytest
import xarray as xr
from tiny_mines import FLAT, NEXT_STEP, STILL, TINY, changed, edited, jobs, snakemake

RELATION = {"name": "site", "size": "mw", "a": -1.0, "b": 0.5, "c": 1.2, "scatter": 0.3, "nearest": "5 m"}
MOTION = {
    "relation": RELATION,
    "displacement": "200 mm",
    "depth": {"roof": "1 m", "walls": "0.5 m", "floor": "0 m", "face": "0 m"},
}
SUPPORT = [{"name": "mesh", "energy": "5 kJ/m^2", "displacement": "100 mm"}]
SHAKEN = {"ground_motion": MOTION, "support": SUPPORT}
AGAIN = dict.fromkeys(("shaking", "report", "report_page", "all"), 1)


def test_shaking_is_made_where_it_is_asked_for_and_nothing_else_again(spoiled, undisturbed, base):
    """Velocities need no mechanics and no events anew; without the key there is no stage."""
    assert "shaking" not in jobs(undisturbed[1])
    assert not (undisturbed[0] / "results/tiny/shaking.nc").exists()
    with edited(base / "files" / "tiny.yaml", changed(TINY, **SHAKEN)) as file:
        status, text = snakemake(file, spoiled)
        assert status == 0, text
        assert jobs(text) == AGAIN
        assert "Nothing to be done" in snakemake(file, spoiled)[1]
    by_rock = SHAKEN | {"ground_motion": {key: MOTION[key] for key in ("relation", "displacement")}}
    with edited(base / "files" / "tiny.yaml", changed(TINY, **by_rock)) as file:
        status, text = snakemake(file, spoiled, "results/tiny/shaking.csv")
        assert status == 0, text
        assert jobs(text) == {"shaking": 1}
    results = spoiled / "results/tiny"
    with xr.open_dataset(results / "shaking.nc") as shaking, xr.open_dataset(results / "openings.nc") as openings:
        of_drive = (openings["excavation"] == "drive") & (openings["side"] == "roof") & (openings["step"] == "2019-08")
        known = openings["depth_p90"].values[of_drive & np.isnan(openings["chainage_from"])]
        np.testing.assert_allclose(shaking["depth"].sel(opening="drive", side="roof").values, known)
    with edited(base / "files" / "tiny.yaml", changed(TINY, **SHAKEN)) as file:
        assert snakemake(file, spoiled)[0] == 0
    with (results / "shaking.csv").open(encoding="utf-8") as table:
        rows = list(csv.DictReader(table))
    # one dated step, two openings, three chances, four sides
    assert len(rows) == 2 * 3 * 4
    assert {row["opening"] for row in rows} == {"drive", "stope_1"}
    assert {row["state"] for row in rows if row["opening"] == "stope_1"} == {"filled"}
    assert all(float(row["demand_kJ_m2"]) > 0.0 for row in rows if row["side"] == "roof")
    with xr.open_dataset(results / "shaking.nc") as shaking, xr.open_dataset(results / "catalog.nc") as catalog:
        assert shaking["expected_events"].values.tolist() == [int(catalog["resolved"].sum())]
        assert shaking.attrs["made_from"]
    page = (results / "report.html").read_text(encoding="utf-8")
    assert "demand is below the stated" in page
    assert "Most is felt by" in page
    assert "safe" not in page[page.index('<section id="shaking">') :].split("</section>")[0]


PLANS = {"later": {"excavations": {"stope_2": {"step": "2019-09"}}, "steps": [NEXT_STEP]}}


@pytest.mark.slow
def test_plans_are_shaken_side_by_side(spoiled, base):
    """Each plan has its own table, with depths of its own failed rock; the page has them beside each other."""
    by_rock = {"ground_motion": {key: MOTION[key] for key in ("relation", "displacement")}, "support": SUPPORT}
    planned = changed(TINY, **by_rock, plans=PLANS, hazard={"runs": 1})
    with edited(base / "files" / "tiny.yaml", planned) as file:
        status, text = snakemake(file, spoiled, "plans")
        assert status == 0, text
        assert jobs(text)["plan_shaking"] == 2
        assert "shaking" not in jobs(text)
        assert "Nothing to be done" in snakemake(file, spoiled, "plans")[1]
    plans = spoiled / "results/tiny/plans"
    tables = {name: list(csv.DictReader((plans / name / "shaking.csv").open())) for name in ("mine_file", "later")}
    assert {row["opening"] for row in tables["mine_file"]} == {"drive", "stope_1"}
    assert {row["opening"] for row in tables["later"]} == {"drive", "stope_1", "stope_2"}
    first = [[row for row in rows if row["step"] == "2019-08"] for rows in tables.values()]
    lower = "velocity_lower_m_s"
    assert [(row["opening"], row[lower]) for row in first[0]] == [(row["opening"], row[lower]) for row in first[1]]
    for name in tables:
        with (
            xr.open_dataset(plans / name / "shaking.nc") as shaking,
            xr.open_dataset(plans / name / "openings.nc") as openings,
        ):
            step = str(shaking["step"].values[-1])
            rows = (openings["excavation"] == "drive") & (openings["side"] == "walls") & (openings["step"] == step)
            known = openings["depth_p90"].values[rows & np.isnan(openings["chainage_from"])]
            np.testing.assert_allclose(shaking["depth"].sel(opening="drive", side="walls", step=step).values, known)
            assert shaking.attrs["depth_source"].startswith("the depth of failed rock")
        with xr.open_dataset(plans / name / "opening_runs.nc") as runs:
            assert runs["run"].values.tolist() == ["own"]
            assert runs.attrs["step"] == step
    page = (plans / "report.html").read_text(encoding="utf-8")
    assert "Only later mines stope_2." in page
    section = page[page.index("Shaking of openings") :].split("<h2>")[0]
    assert "stope_2" in section
    assert "2019-09" in section


def test_the_slice_holds_what_the_stage_needs(accept):
    """Quantities as numbers, the host's density, dated steps, and when openings are mined and filled."""
    slice_ = accept(TINY, **SHAKEN).shaking_slice()
    assert slice_["ground_motion"]["displacement"] == 200.0
    assert slice_["ground_motion"]["relation"]["nearest"] == 5.0
    assert slice_["support"] == [{"name": "mesh", "energy": 5.0, "displacement": 100.0}]
    assert slice_["density"] == 2850.0
    assert slice_["openings"] == [
        {"name": "drive", "step": ""},
        {"name": "stope_1", "step": "2019-08", "filled": "2019-08"},
    ]


FITTED = {"name": "fitted", "file": "velocities.csv", "size": "mw", "velocity_unit": "mm/s", "nearest": "5 m"}


@pytest.mark.parametrize(
    ("mine", "values", "message"),
    [
        (FLAT, {"ground_motion": {"relation": RELATION}}, "ground_motion: sources of a scene with plane: xz"),
        (STILL, {"ground_motion": {"relation": RELATION}}, "ground_motion: no step has dates"),
        (TINY, {"support": SUPPORT}, "support: there is no demand to compare it with; give ground_motion"),
        (
            TINY,
            {"ground_motion": {"relation": RELATION}, "support": SUPPORT},
            "support: there is no demand to compare it with; give ground_motion.displacement",
        ),
        (TINY, {"ground_motion": {"relation": FITTED}}, "velocities.csv: no such file"),
        (TINY, SHAKEN | {"support": SUPPORT * 2}, "support[1].name: mesh stands twice"),
        (
            TINY,
            SHAKEN | {"support": [SUPPORT[0] | {"displacement": "300 mm"}]},
            "support[0].displacement: 300 mm is more than ground_motion.displacement allows (200 mm)",
        ),
        (TINY, SHAKEN | {"support": [SUPPORT[0] | {"energy": 5}]}, "support[0].energy: 5 has no unit"),
        (
            TINY,
            SHAKEN | {"support": [SUPPORT[0] | {"energy": "5 kJ"}]},
            "support[0].energy: '5 kJ' is not convertible to kJ/m^2",
        ),
        (TINY, {"ground_motion": {}}, "ground_motion.relation: missing key"),
    ],
)
def test_mistakes_are_found_before_anything_runs(refuse, mine, values, message):
    assert message in refuse(mine, **values)
