"""`grid_convergence`: the tiny mine on cells of twice the size beside results that stand, and what both tell."""

import json
import re

import numpy as np
import pytest
import xarray as xr
from tiny_mines import FLAT, TINY, box, changed, edited, hashes, jobs, snakemake

from mpm_core.scene.scene import parse_scene
from mpm_core.stages.equilibrium_stages import elastic_stage, mining_step
from mpm_core.stages.grid_stage import make_grid

STEPS = ("history", "2019-08")


def test_a_companion_is_run_in_space_where_steps_have_dates_and_a_level_can_go(accept):
    wanted = {"grid_convergence": True}
    bare = {key: value for key, value in TINY.items() if key != "grid_convergence"}
    assert accept(bare).has_companion
    deep = changed(bare, **{"grid.levels": 3, "grid.coarse_cell": "20 m"})
    assert accept(deep).has_companion
    assert not accept(deep, accuracy="draft").has_companion
    assert not accept(TINY).has_companion
    assert not accept(changed(bare, **{"grid.levels": 1})).has_companion
    assert not accept({key: value for key, value in FLAT.items() if key != "grid_convergence"}).has_companion
    assert accept(FLAT, **wanted).has_companion
    assert not accept(TINY, **wanted).member(1).has_companion


def test_the_companion_differs_in_its_cells_alone(accept):
    mine = accept(TINY)
    coarse, here = mine.coarser(), mine.mechanics_slice(1)
    assert coarse.grid_slice()["grid"] == mine.grid_slice()["grid"] | {
        "levels": 1, "volume_error": 1e9, "resized_by": "grid_convergence",
    }  # fmt: skip
    one_size = {key: value for key, value in here.items() if key != "refinement"}
    assert coarse.mechanics_slice(1) == one_size
    assert coarse.step_events_slice("2019-08") == mine.step_events_slice("2019-08")
    assert mine.convergence_slice() == {"mine": "tiny", "steps": ["2019-08"], "cells": [5.0, 10.0]}


def test_the_companion_leaves_out_what_is_too_small_for_its_cells(accept, caplog, tmp_path):
    """Openings of 0.8 % of a doubled cell, one with water in it, each all that its step mines: it runs all the same."""
    sumps = {
        "excavations.0": box("sump", "history", [50, 31, 42], [52, 33, 44], pressure="0.2 MPa"),
        "excavations.1": box("niche", "2019-08", [30, 61, 42], [32, 63, 44], fill="fill"),
    }
    mine = accept(TINY, **sumps, **{"grid.volume_error": 0.9})
    assert min(json.loads(make_grid(mine.grid_slice(), {}).attrs["excavation_volume_grid"])) > 0.0
    coarse = mine.coarser()
    grid = make_grid(coarse.grid_slice(), {})
    said = "excavations.sump: adds no volume: it is thinner than a fraction of the finest cell, 10 m (the companion run"
    assert f"{said} of grid_convergence doubles those of the mine), and left" in caplog.text
    assert json.loads(grid.attrs["excavation_volume_grid"])[:2] == [0.0, 0.0]
    state, _ = elastic_stage(parse_scene(coarse.mechanics_slice(0)), grid, tmp_path / "failed.npz")
    for number in range(len(STEPS)):
        state, _ = mining_step(parse_scene(coarse.mechanics_slice(number)), grid, state, tmp_path / "failed.npz")
    assert state.attrs["energy_released"] == 0.0


@pytest.mark.slow
def test_a_companion_runs_beside_what_stands(spoiled, base):
    """Its grid, states, events of dated steps, in the time that other jobs leave. Nothing of the mine is made again.

    Nor is anything at a second call.
    """
    results = spoiled / "results/tiny"
    before = hashes(results)
    with edited(base / "files" / "tiny.yaml", changed(TINY, grid_convergence=True)) as file:
        status, text = snakemake(file, spoiled)
        again = snakemake(file, spoiled, "--dry-run")
        packed = snakemake(file, spoiled, "--report", str(spoiled / "packed.html"))
        commands = snakemake(file, spoiled, "--detailed-summary")[1].splitlines()
    assert status == 0, text
    idle = re.compile("BEFORE='(chrt --idle 0|nice -n 19)'")
    assert {line.split("\t")[2] for line in commands if idle.search(line)} == {"companion"}
    assert packed[0] == 0, packed[1]
    labels = re.findall(r'"labels": ({[^}]*})', (spoiled / "packed.html").read_text(encoding="utf-8"))
    names = ["catalogue", "openings", "report"]
    assert sorted(json.loads(label)["result"] for label in labels) == names
    assert jobs(text) == dict.fromkeys(("companion", "comparison", "report", "report_page", "all"), 1)
    after = hashes(results)
    assert {path for path in before if after[path] != before[path]} <= {"comparison.nc"}
    made = {f"coarse/{kind}/{step}.nc" for kind in ("steps", "events") for step in STEPS}
    made |= {f"coarse/{name}" for name in ("grid.nc", "elastic.nc", "catalog.nc", "catalog.csv")}
    assert set(after) - set(before) == {"grid_convergence.nc", *made}

    found = xr.open_dataset(results / "grid_convergence.nc")
    assert found.cell.values.tolist() == [5.0, 10.0]
    for run, folder in enumerate((results, results / "coarse")):
        catalog = xr.open_dataset(folder / "catalog.nc")
        np.testing.assert_allclose(found.potency.sel(period="all")[run], catalog.potency.sum())
        state = xr.open_dataset(folder / "steps/2019-08.nc")
        assert float(found.failed_volume.sel(period="2019-08")[run]) == state.attrs["failed_volume"]
        assert state.cell_size.values.min() == found.cell[run]
    page = (results / "report.html").read_text()
    assert "On cells of 10 m instead of 5 m" in page
    assert "Older than the configuration" not in page
    assert "Nothing to be done" in again[1]
