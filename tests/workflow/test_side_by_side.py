"""Several mines at once in one folder: none waits for, locks out or overwrites another, and bytes are the same."""

import numpy as np
import pytest
import xarray as xr
from tiny_mines import FLAT, STILL, finished, hashes, start, write_mine


@pytest.fixture(scope="module")
def side_by_side(base, tiny_file):
    """Three mines at once in one folder, elsewhere and on one core each: texts by name."""
    folder = base / "elsewhere" / "shared"
    files = {"tiny": tiny_file}
    files |= {mine["name"]: write_mine(mine, base / "files" / f"{mine['name']}.yaml") for mine in (FLAT, STILL)}
    runs = {name: start(file, folder, cores=1) for name, file in files.items()}
    return folder / "results", {name: finished(run) for name, run in runs.items()}


def test_mines_run_side_by_side_in_one_folder(side_by_side):
    """No run waits for, locks out or overwrites another."""
    _, runs = side_by_side
    assert {name: status for name, (status, _) in runs.items()} == {"tiny": 0, "flat": 0, "still": 0}, runs
    for name, (_, text) in runs.items():
        assert not [line for line in text.splitlines() if "directive" in line or "Warning" in line], (name, text)


def test_another_run_elsewhere_on_one_core_has_the_same_bytes(undisturbed, side_by_side):
    """Datasets, tables and XML do not depend on place, time, number of threads or what else is running."""
    assert hashes(side_by_side[0] / "tiny") == hashes(undisturbed[0] / "results/tiny")


def test_scene_without_steps_stops_at_the_elastic_state(side_by_side):
    """No steps asked for: grid, elastic state and report, nothing more."""
    results, _ = side_by_side
    assert set(hashes(results / "still")) == {"grid.nc", "elastic.nc"}
    assert (results / "still/report.html").exists()


def test_plane_strain_scene_reaches_its_report(side_by_side):
    """Two dimensions inside, three coordinates and six stresses outside; potencies are those of 1 m of section."""
    results, _ = side_by_side
    grid, step = (xr.open_dataset(results / "flat" / path) for path in ("grid.nc", "steps/2019-08.nc"))
    events = xr.open_dataset(results / "flat/events/2019-08.nc")
    assert grid.attrs["plane"] == "xz"
    assert grid.sizes["corner"] == 4
    assert step.sizes["xyz"] == 3
    assert step.sizes["voigt"] == 6
    assert (step.position[:, 1] == 0).all()
    failed = (step.seismic_strain != 0).any("voigt")
    scalar = np.sqrt(
        2 * (step.seismic_strain[:, :3] ** 2).sum("voigt") + 4 * (step.seismic_strain[:, 3:] ** 2).sum("voigt")
    )
    floor = 2 * float(scalar[failed].median()) * 5.0**2 * 1.0  # min_samples cells of 5 m, 1 m thick
    assert events.attrs["potency_floor"] == pytest.approx(floor)
    assert (results / "flat/report.html").exists()
