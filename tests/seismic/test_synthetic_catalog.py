"""The catalogue of all dated steps, as dataset and table, and the two command lines end to end."""

import json

import numpy as np
import pandas as pd
import pytest
from job_runs import run_job
from mechanics.test_grid_stage import block, grid_slice
from numpy.testing import assert_allclose, assert_array_equal

from catalogs.sources.event_labels import label_events
from common.datasets import read_dataset, write_dataset
from common.errors import InputError
from common.event_table import NAMES, ON_PLANES, read_events, write_events
from common.job import read_job
from mpm_core.stages.grid_stage import make_grid
from seismic.catalog import merge, write_csv
from seismic.events import extract_events

HISTORY = {"step": "history", "step_index": 0, "start": "", "end": "", "dated": 0}
AUGUST = {"step": "2019-08", "step_index": 1, "start": "2019-08-01", "end": "2019-09-01"}
SEPTEMBER = {"step": "2019-09", "step_index": 2, "start": "2019-09-01", "end": "2019-10-01"}
UNCERTAINTIES = ("time_lower_uncertainty_s", "time_upper_uncertainty_s")


@pytest.fixture(scope="module")
def event_steps(make_scattered_step, make_settings):
    """Events of an undated history and of two months, the later month first."""
    steps = [(3, SEPTEMBER), (1, HISTORY), (2, AUGUST)]
    return [extract_events(make_scattered_step(seed, 150, **attrs), make_settings())[0] for seed, attrs in steps]


def test_only_dated_steps_by_time(event_steps):
    september, history, august = event_steps
    catalog = merge(event_steps)
    assert history.sizes["event"] > 0
    assert catalog.sizes["event"] == august.sizes["event"] + september.sizes["event"]
    assert np.all(np.diff(catalog["time"].values) > np.timedelta64(0))
    assert set(catalog["step"].values) == {"2019-08", "2019-09"}
    for name in NAMES:
        expected = np.concatenate([august[name].values, september[name].values])
        assert_array_equal(catalog[name].values, expected)
    assert json.loads(catalog.attrs["steps"]) == ["2019-08", "2019-09"]
    assert catalog.attrs["potency_floor"] == max(august.attrs["potency_floor"], september.attrs["potency_floor"])


def test_slip_on_planes_stands_in_catalogue_and_table(event_steps, tmp_path):
    """Where every step tells of it; else neither has the column."""
    shares = [np.linspace(0.0, 1.0, step.sizes["event"]) for step in event_steps]
    field = [
        step.assign(on_planes=("event", share, ON_PLANES.attributes))
        for step, share in zip(event_steps, shares, strict=True)
    ]
    catalog = merge(field)
    assert_array_equal(catalog["on_planes"].values, np.concatenate([shares[2], shares[0]]))
    write_events(catalog, tmp_path / "catalog.nc")
    assert_array_equal(read_events(tmp_path / "catalog.nc")["on_planes"].values, catalog["on_planes"].values)
    for name, given in (("with", catalog), ("without", merge(event_steps))):
        write_csv(given, tmp_path / f"{name}.csv")
    assert_allclose(pd.read_csv(tmp_path / "with.csv")["on_planes"], catalog["on_planes"].values, atol=5e-5)
    assert "on_planes" not in pd.read_csv(tmp_path / "without.csv")


def test_catalog_budget_is_the_sum_of_its_steps(event_steps):
    budgets = [json.loads(step.attrs["budget"]) for step in event_steps]
    total = json.loads(merge(event_steps).attrs["budget"])
    assert_allclose(total["plastic"], np.add(budgets[0]["plastic"], budgets[2]["plastic"]), rtol=1e-14)
    assert total["event_scalars"] == pytest.approx(budgets[0]["event_scalars"] + budgets[2]["event_scalars"])
    assert total["scalar_ratio"] == pytest.approx(total["event_scalars"] / total["particle_scalars"])


def test_simultaneous_events_stay_in_the_order_of_steps(make_step, make_settings):
    """Two steps over the same days, one event each: the same time, so the earlier step comes first."""
    shear = [[0, 0, 0, 0, 0, 1e-3]]
    both = [
        extract_events(make_step([[x, 0, 0]], shear, step=name, step_index=index), make_settings())[0]
        for x, name, index in ((1.0, "earlier", 2), (0.0, "a-later", 3))
    ]
    for steps in (both, both[::-1]):
        assert_array_equal(merge(steps)["step"], ["earlier", "a-later"])


def test_steps_that_overlap_are_interleaved_by_time(make_scattered_step, make_settings):
    """A later step that spans the first half of an earlier one: its events come between the others, all in order."""
    early = make_scattered_step(2, 150, **AUGUST)
    late = make_scattered_step(3, 150, **(SEPTEMBER | {"start": "2019-08-01", "end": "2019-08-16"}))
    catalog = merge([extract_events(step, make_settings())[0] for step in (early, late)])
    assert np.all(np.diff(catalog["time"].values) >= np.timedelta64(0))
    assert set(catalog["step"].values[:10]) == {"2019-08", "2019-09"}


def test_truncation_is_carried_into_the_catalog(event_steps):
    labelled = [step.assign_attrs(truncated=1, truncated_share=0.2, truncated_where="roof") for step in event_steps[:1]]
    catalog = merge([*labelled, *event_steps[1:]])
    assert catalog.attrs["truncated"] == 1
    assert catalog.attrs["truncated_share"] == 0.2
    assert catalog.attrs["truncated_where"] == "2019-09: roof"
    assert merge(event_steps).attrs["truncated"] == 0


def test_a_catalog_of_history_alone_is_empty_and_valid(event_steps, tmp_path):
    catalog = merge(event_steps[1:2])
    assert catalog.sizes["event"] == 0
    write_events(catalog, tmp_path / "catalog.nc")
    again = read_events(tmp_path / "catalog.nc")
    assert again["time"].dtype == "datetime64[ns]"
    assert np.isnan(again.attrs["potency_floor"])
    write_csv(again, tmp_path / "catalog.csv")
    table = pd.read_csv(tmp_path / "catalog.csv")
    assert len(table) == 0
    assert list(table.columns[:5]) == ["date", "time_utc", *UNCERTAINTIES, "x_m"]


def test_steps_that_do_not_belong_together_are_refused(event_steps):
    with pytest.raises(InputError, match="steps 2019-09 and history differ in mine"):
        merge([event_steps[0], event_steps[1].assign_attrs(mine="other")])
    with pytest.raises(InputError, match="differ in closeness"):
        merge([event_steps[0], event_steps[1].assign_attrs(closeness=0.5)])
    with pytest.raises(InputError, match="appears twice"):
        merge([event_steps[0], event_steps[0]])
    with pytest.raises(InputError, match="no event datasets"):
        merge([])


def test_table_holds_the_catalog(event_steps, tmp_path):
    catalog = merge(event_steps)
    write_csv(catalog, tmp_path / "catalog.csv")
    table = pd.read_csv(tmp_path / "catalog.csv", dtype={"step": str})
    assert (
        list(table.columns)
        == (
            f"date time_utc {' '.join(UNCERTAINTIES)} x_m y_m z_m location_uncertainty_m log10_potency_m3 moment_n_m "
            "mw potency_xx_m3 potency_yy_m3 potency_zz_m3 potency_yz_m3 "
            "potency_xz_m3 potency_xy_m3 step resolved"
        ).split()
    )
    time = pd.to_datetime(table.date + "T" + table.time_utc).to_numpy()
    assert np.all(np.abs(time - catalog["time"].values) <= np.timedelta64(1, "s"))
    for name, sign, month in ((UNCERTAINTIES[0], -1, 0), (UNCERTAINTIES[1], 1, 1)):  # never out of the step
        edge = time.astype("datetime64[s]") + sign * table[name].to_numpy().astype("timedelta64[s]")
        assert_array_equal(edge, (table.step.to_numpy().astype("datetime64[M]") + month).astype("datetime64[s]"))
    assert_allclose(table.location_uncertainty_m, catalog.attrs["location_error"], rtol=5e-3)
    assert_allclose(table[["x_m", "y_m", "z_m"]], catalog["location"], atol=5.01e-4)
    assert_allclose(10**table.log10_potency_m3, catalog["potency"], rtol=2e-6)
    assert_allclose(table.moment_n_m, catalog["moment"], rtol=1e-9)
    assert_allclose(table.mw, catalog["mw"], atol=5.01e-5)
    tensor = catalog["potency_tensor"].values
    for name, (i, j) in {"xx": (0, 0), "zz": (2, 2), "yz": (1, 2), "xz": (0, 2), "xy": (0, 1)}.items():
        assert_allclose(table[f"potency_{name}_m3"], tensor[:, i, j], rtol=1e-9)
    assert_array_equal(table.step, catalog["step"])
    assert_array_equal(table.resolved, catalog["resolved"])
    assert b"\r" not in (tmp_path / "catalog.csv").read_bytes()


def told(done) -> list[str]:
    """Lines on the terminal, but for those that tell where a stage of more than a second stands."""
    where = "; log: ", "compiling", ": at work ("
    return [line for line in done.stderr.splitlines() if not any(word in line for word in where)]


@pytest.mark.parametrize("planes", [False, True])
def test_the_stage_of_the_events_end_to_end(planes, make_scattered_step, make_settings, tmp_path):
    """Events and their catalogue: the same bytes as from the functions in this process; the budget in the log. Rock
    with weak planes, too."""
    step = make_scattered_step(2, 150, **AUGUST)
    if planes:
        step = step.assign(material=("particle", np.arange(step.sizes["particle"], dtype=np.int16) % 2)).assign_attrs(
            material_names=json.dumps(["fault", "host"]),
            elastic_moduli=json.dumps({"fault": [2e10, 1e10], "host": [2e10, 2e10]}),
            plane_normals=json.dumps({"fault": [0.0, 0.0, 1.0]}),
        )
    write_dataset(step, tmp_path / "step.nc")
    dates = {key: AUGUST[key] for key in ("start", "end")}
    steps = [{"name": "2019-08", "dates": dates}]
    settings = {"seismic": make_settings(), "steps": steps, "openings": [{"name": "stope", "mined": 0, "filled": -1}]}
    write_dataset(make_grid(grid_slice(block([4.0, 4.0, 4.0], [12.0, 12.0, 12.0])), {}), tmp_path / "grid.nc")
    outputs = [tmp_path / "events", tmp_path / "catalog.nc"]
    done = run_job(tmp_path, "events", settings, outputs, steps=[tmp_path / "step.nc"], grid=[tmp_path / "grid.nc"])
    assert (done.returncode, len(told(done))) == (0, 1), done.stderr
    assert "potency budget" in (tmp_path / "events.log").read_text()

    events, _ = extract_events(step, make_settings() | dates)
    made = read_job(done.args[3]).provenance()
    write_events(events.assign_attrs(made), tmp_path / "here_events.nc")
    catalog = merge([read_events(tmp_path / "here_events.nc")])
    catalog = label_events(catalog, read_dataset(tmp_path / "grid.nc"), settings["openings"], ["2019-08"])
    write_events(catalog.assign_attrs(made), tmp_path / "here_catalog.nc")
    write_csv(catalog, tmp_path / "catalog.csv")
    table = pd.read_csv(tmp_path / "catalog.csv")
    assert len(table) == events.sizes["event"]
    assert ("on_planes" in table) == planes
    assert (outputs[0] / "2019-08.nc").read_bytes() == (tmp_path / "here_events.nc").read_bytes()
    assert outputs[1].read_bytes() == (tmp_path / "here_catalog.nc").read_bytes()


def test_errors_of_the_stage_are_one_line_and_leave_no_output(make_scattered_step, make_settings, tmp_path):
    write_dataset(make_scattered_step(2, 150).drop_vars("volume"), tmp_path / "step.nc")
    settings = {"seismic": make_settings(), "steps": [{"name": "2019-08", "dates": {"start": "", "end": ""}}]}
    outputs = [tmp_path / "events", tmp_path / "catalog.nc"]
    done = run_job(tmp_path, "events", settings, outputs, steps=[tmp_path / "step.nc"])
    assert done.returncode == 1
    assert len(told(done)) == 1, done.stderr
    assert "step.nc: step 2019-08: not a mining step, it lacks volume" in done.stderr
    assert "Traceback" in (tmp_path / "events.log").read_text()
    assert not list((tmp_path / "events").iterdir())
    assert not list(tmp_path.rglob("*.part"))
