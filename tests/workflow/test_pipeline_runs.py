"""The pipeline from a mine file to the report: what it makes, what it makes again, and what it leaves alone."""

import csv
import json
import re

import meshio
import numpy as np
import pytest
import xarray as xr
from obspy.io.quakeml.core import _validate
from tiny_mines import (
    NEXT_STEP,
    TINY,
    changed,
    copy_checkout,
    edited,
    hashes,
    jobs,
    snakemake,
    write_mine,
)

EVENT_STAGES = dict.fromkeys(("events", "catalogue", "comparison", "report", "report_page", "all"), 1)

GRID = """
cell_origin cell,xyz float64 m | cell_size cell float64 m | cell_level cell int8 1 | cell_nodes cell,corner int32 1
node_position node,xyz float64 m | node_parents node,parent int32 1 | cell_body cell int16 1
piece_origin piece,xyz float64 m | piece_excavation piece int16 1 | piece_fraction piece float64 1
piece_samples piece uint64 1 | piece_volume piece float64 m3
solid_position solid_vertex,xyz float64 m | solid_facets solid_facet,facet_corner int32 1
solid_excavation solid_facet int16 1
"""
STATE = """
position particle,xyz float64 m | cell particle int32 1 | spacing particle float64 m | volume particle float64 m3
material particle int16 1 | excavation particle int16 1 | stress particle,voigt float64 Pa
displacement particle,xyz float64 m | failed particle int32 1 | failure_order particle,order int32 1
seismic_strain particle,voigt float64 1 | overshoot_strain particle,voigt float64 1
later_strain particle,voigt float64 1 | plastic_strain particle,voigt float64 1
plastic_strain_step particle,voigt float64 1 | strength_factor particle float64 1
excess_shear_stress particle float64 Pa | node_displacement node,xyz float64 m | node_velocity node,xyz float64 m/s
hourglass_force cell,mode,xyz float64 N
cell_origin cell,xyz float64 m | cell_size cell float64 m | cell_level cell int8 1 | cell_nodes cell,corner int32 1
node_position node,xyz float64 m | node_parents node,parent int32 1 | cell_body cell int16 1
convergence_increment iteration int32 1
convergence_generation iteration int32 1 | convergence_iteration iteration int32 1
convergence_unbalanced_ratio iteration float64 1 | convergence_max_ratio iteration float64 1
convergence_cells iteration int32 1 | convergence_new_failures iteration int32 1
"""
EVENTS = """
time event datetime64[ns] - | time_lower_uncertainty event float64 s | time_upper_uncertainty event float64 s
location event,xyz float64 m
potency_tensor event,xyz,axis float64 m3 | potency event float64 m3 | moment_tensor event,xyz,axis float64 N_m
moment event float64 N_m | mw event float64 1
p_axis event,xyz float64 1 | b_axis event,xyz float64 1 | t_axis event,xyz float64 1
iso event float64 1 | clvd event float64 1 | dc event float64 1 | particles event int32 1 | resolved event int8 1
source_size event float64 m
"""
MADE = {"mine", "config_hash", "source_hash", "versions"}
STATE_FACTS = {
    *("stage", "step", "step_index", "tolerance", "scheme", "iterations", "unbalanced_ratio"),
    *("truncated", "truncated_share", "truncated_where", "failed_particles", "failed_volume", "energy_released"),
    *("energy_dissipated", "energy_left_share", "energy_balance", "lame_lambda", "shear_modulus"),
    "elastic_moduli",
}
EVENT_FACTS = {"kind", "lame_lambda", "shear_modulus", "frame"}
CATALOG_FACTS = EVENT_FACTS | {"potency_floor", "seismic_fraction", "budget"}
CONTRACT = {
    "grid.nc": (GRID, {"dimension", "plane", "thickness", "domain_lower", "domain_upper", "coarse_cell", "fine_cell"}),
    "elastic.nc": (STATE, STATE_FACTS),
    "steps/history.nc": (STATE, STATE_FACTS),
    "steps/2019-08.nc": (STATE, STATE_FACTS),
    "events/history.nc": (EVENTS, CATALOG_FACTS),
    "events/2019-08.nc": (EVENTS, CATALOG_FACTS),
    "catalog.nc": (EVENTS, CATALOG_FACTS),
    "record.nc": (EVENTS, EVENT_FACTS | {"location_error"}),
}
COLUMNS = (
    "date,time_utc,time_lower_uncertainty_s,time_upper_uncertainty_s,x_m,y_m,z_m,location_uncertainty_m,log10_potency_m3,moment_n_m,mw,"
    "potency_xx_m3,potency_yy_m3,potency_zz_m3,potency_yz_m3,potency_xz_m3,potency_xy_m3"
)


@pytest.mark.parametrize("path", CONTRACT)
def test_every_dataset_keeps_the_contract(undisturbed, path):
    """Name, dimensions, type and unit of each variable, and the attributes, as promised."""
    table, attributes = CONTRACT[path]
    with xr.open_dataset(undisturbed[0] / "results/tiny" / path) as dataset:
        dataset.load()
    for entry in table.replace("\n", "|").split("|"):
        if not entry.strip():
            continue
        name, dims, kind, unit = entry.split()
        variable = dataset[name]
        found = (",".join(variable.dims), str(variable.dtype), variable.attrs.get("units", "-").replace(" ", "_"))
        assert (name, *found) == (name, dims, kind, unit)
    assert (MADE | attributes) - set(dataset.attrs) == set()
    assert dataset.attrs["mine"] == "tiny"


def test_all_results_are_there_and_nothing_half_written(undisturbed):
    """Every stage file, the tables and the page; no temporary file is left."""
    results = undisturbed[0] / "results/tiny"
    others = {"catalog.csv", "catalog.xml", "event_rules.nc", "source_parameters.nc", "comparison.nc"}
    others |= {"openings.csv", "openings.nc"}
    assert set(hashes(results)) == set(CONTRACT) | others
    assert (results / "report.html").stat().st_size > 10_000
    assert list((results / "figures").iterdir())
    assert not list(results.rglob("*.part"))


def test_terminal_tells_each_stage_and_no_configuration(undisturbed):
    """A line per stage and the progress: nothing of Snakemake's header, and no scene as JSON."""
    text = undisturbed[1]
    for stage in ("grid results/tiny/grid.nc: ", "step results/tiny/steps/2019-08.nc: ", "(100%) done"):
        assert stage in text
    for noise in ("{", "SNAKEMAKE", "Select jobs", "Finished jobid", "Traceback"):
        assert noise not in text


def test_history_stays_out_of_the_catalogue_and_the_budget_closes(undisturbed):
    """The catalogue holds the events of the dated step only, within its dates, and each event's potency adds up."""
    results = undisturbed[0] / "results/tiny"
    catalog, step = xr.open_dataset(results / "catalog.nc"), xr.open_dataset(results / "steps/2019-08.nc")
    history = xr.open_dataset(results / "events/history.nc")
    assert history.sizes["event"] > 0
    assert catalog.sizes["event"] > 0
    assert set(catalog.step.values) == {"2019-08"}
    assert np.isnat(history.time.values).all()
    inside = (catalog.time.values > np.datetime64("2019-08-01")) & (catalog.time.values < np.datetime64("2019-09-01"))
    assert inside.all()
    strain = (step.seismic_strain * step.volume).sum("particle").values
    tensor = catalog.potency_tensor.sum("event").values
    events = tensor[[0, 1, 2, 1, 0, 0], [0, 1, 2, 2, 2, 1]]
    np.testing.assert_allclose(events, strain, rtol=0, atol=1e-12 * np.abs(strain).max())


def test_catalogue_as_table_and_as_quakeml(undisturbed):
    """catalog.csv has the promised columns and one line per event; catalog.xml passes ObsPy's schema check."""
    results = undisturbed[0] / "results/tiny"
    catalog = xr.open_dataset(results / "catalog.nc")
    with (results / "catalog.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert ",".join(rows[0]).startswith(COLUMNS)
    np.testing.assert_allclose([float(row["x_m"]) for row in rows], catalog.location[:, 0], atol=1e-3)
    np.testing.assert_allclose([float(row["log10_potency_m3"]) for row in rows], np.log10(catalog.potency), atol=1e-6)
    assert _validate(str(results / "catalog.xml"))


def test_second_call_has_nothing_to_do(undisturbed, tiny_file):
    """Nothing is run again, and Snakemake says so."""
    status, text = snakemake(tiny_file, undisturbed[0], "--dry-run")
    assert status == 0
    assert "Nothing to be done" in text
    assert jobs(text) == {}


def test_snakemakes_own_report_needs_no_network(undisturbed, tiny_file, tmp_path, monkeypatch):
    """`--report`, with proxies that are none: one page with the mine's report and catalogue in it, and no address."""
    for name in ("http_proxy", "https_proxy"):
        monkeypatch.setenv(name, "http://127.0.0.1:9")
    page = tmp_path / "report.html"
    status, text = snakemake(tiny_file, undisturbed[0], "--report", str(page))
    assert status == 0, text
    page = page.read_text(encoding="utf-8")
    for file, result in (("report.html", "report"), ("catalog.csv", "catalogue")):
        assert f"results/tiny/{file}" in page
        assert f'"labels": {{"result": "{result}"}}' in page
    assert not re.findall(r"""<(?:script|link|img)[^>]+(?:src|href)=["']?https?:""", page)


def dry(mine: dict, base, folder, *options) -> dict[str, int]:
    """Jobs that a changed mine would run over existing results."""
    with edited(base / "files" / "tiny.yaml", mine) as file:
        status, text = snakemake(file, folder, "--dry-run", *options)
    assert status == 0, text
    return jobs(text)


def test_a_seismic_value_runs_the_event_stages_only(undisturbed, base):
    """Grid and mechanics do not depend on `seismic`."""
    assert dry(changed(TINY, **{"seismic.closeness": 0.7}), base, undisturbed[0]) == EVENT_STAGES


def test_a_filter_of_the_record_runs_the_comparison_only(undisturbed, base):
    """Nor does the model depend on the record."""
    mine = changed(TINY, **{"record.filter.minimum_potency": "1e-3 m^3"})
    assert dry(mine, base, undisturbed[0]) == dict.fromkeys(("record", "comparison", "report", "report_page", "all"), 1)


def test_a_value_of_the_later_step_leaves_the_earlier_alone(undisturbed, base):
    """The fill is placed in 2019-08: its stiffness changes that step and what follows."""
    mine = changed(TINY, **{"materials.fill.youngs_modulus": "2 GPa"})
    assert dry(mine, base, undisturbed[0]) == EVENT_STAGES | {"step": 1}


def test_the_end_of_a_month_runs_no_mechanics(undisturbed, base):
    """Rock knows no dates: a month that ends later has the same failures, its events other times."""
    mine = changed(TINY, **{"steps.1.end": "2019-09-15"})
    assert dry(mine, base, undisturbed[0]) == EVENT_STAGES | {"record": 1}


def test_a_deleted_intermediate_is_made_again(spoiled, tiny_file):
    """A missing stage file is not overlooked behind a report that still stands."""
    (spoiled / "results/tiny/steps/history.nc").unlink()
    status, text = snakemake(tiny_file, spoiled, "--dry-run")
    assert status == 0
    assert jobs(text)["step"] == 2
    assert "grid" not in jobs(text)
    assert "elastic" not in jobs(text)


def test_a_planned_stope_gets_its_month_and_only_that_is_run(spoiled, base):
    """stope_2 shaped the grid already; dated, it is one new step after those that stand, and a month more of record."""
    results, catalog = spoiled / "results/tiny", "results/tiny/catalog.nc"
    before = hashes(results)
    mine = changed(TINY, **{"excavations.2.step": NEXT_STEP["name"], "steps": [*TINY["steps"], NEXT_STEP]})
    assert dry(mine, base, spoiled) == EVENT_STAGES | {"step": 1, "record": 1}
    with edited(base / "files" / "tiny.yaml", mine) as file:
        status, text = snakemake(file, spoiled, catalog)
    assert status == 0, text
    assert jobs(text) == {"step": 1, "events": 1}
    after = hashes(results)
    remade = {path for path in after if after[path] != before.get(path)}
    events = {f"events/{step}.nc" for step in ("history", "2019-08", "2019-09")}
    assert remade == {"steps/2019-09.nc", "catalog.nc", *events}
    steps = json.loads(xr.open_dataset(spoiled / catalog).attrs["steps"])
    assert steps == ["2019-08", "2019-09"]


def test_a_mine_without_a_place_on_earth_has_all_but_quakeml(base, tmp_path):
    """Local coordinates are all that its catalogue needs; QuakeML cannot do without latitude and longitude."""
    mine = changed(TINY, frame={"surface": "1000 m"})
    file = write_mine(mine, base / "files" / "nowhere" / "tiny.yaml")
    status, text = snakemake(file, tmp_path, "--dry-run")
    assert status == 0, text
    assert {"catalogue", "comparison", "report"} <= set(jobs(text))
    assert "no catalog.xml" not in text  # said when the run begins


def test_the_picture_of_the_scene_needs_nothing_solved(tiny_file, tmp_path):
    """The grid alone: it reads the record itself."""
    status, text = snakemake(tiny_file, tmp_path, "--dry-run", "scene")
    assert status == 0, text
    assert jobs(text) == {"grid": 1, "scene": 1}


def test_lint_is_clean(tiny_file, tmp_path):
    """Snakemake's own style check has nothing to say."""
    status, text = snakemake(tiny_file, tmp_path, "--lint")
    assert status == 0, text
    assert "Congratulations" in text


def test_vtk_files_on_request(spoiled, tiny_file):
    """Targets outside `all`: a state, the solids, and the events of a model and of a record, for ParaView."""
    names = ("steps/2019-08.vtu", "solids.vtm", "record.vtu", "events/history.vtu")
    targets = [f"results/tiny/vtk/{name}" for name in names]
    status, text = snakemake(tiny_file, spoiled, *targets)
    assert status == 0, text
    assert all((spoiled / target).stat().st_size > 300 for target in targets)
    stope = meshio.read(spoiled / "results/tiny/vtk/solids/excavations/stope_1.vtu")
    assert set(stope.cell_data["mined_in_step"][0]) == {1}
    events = meshio.read(spoiled / "results/tiny/vtk/events/history.vtu")
    assert len(events.points) == xr.open_dataset(spoiled / "results/tiny/events/history.nc").sizes["event"]


def test_checkout_in_a_folder_with_a_space(tiny_file, tmp_path):
    """The rules quote the checkout's own path."""
    checkout = copy_checkout(tmp_path / "my checkout")
    status, text = snakemake(tiny_file, tmp_path / "run", "results/tiny/record.nc", checkout=checkout)
    assert status == 0, text
