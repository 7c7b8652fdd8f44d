"""A brittle stope whose own failed rock is written as a scan: the misfit is nothing, within a cell."""

import numpy as np
import pytest
import trimesh
from small_mines import CELL, load

from export.failed_rock import failed_surface, failed_volume
from response.scan_settings import ScanSlice
from response.scans import compare_scans
from workflow.run_mine import run_stages

STOPE = {"name": "stope", "shape": "box", "lower": ["-6 m", "-4 m", "-5 m"], "upper": ["6 m", "4 m", "5 m"]}
BRITTLE = {
    "model": "coulomb", "youngs_modulus": "50 GPa", "poisson_ratio": 0.25, "density": "2700 kg/m^3",
    "friction_angle": {"intact": "35 deg", "residual": "30 deg"},
    "dilation_angle": {"intact": "0 deg", "residual": "0 deg"},
    "cohesion": {"intact": "12 MPa", "residual": "1 MPa"}, "tension_cutoff": {"intact": "2 MPa", "residual": "0 MPa"},
}  # fmt: skip
STRESS = {"constant": {"xx": "-20 MPa", "yy": "-45 MPa", "zz": "-25 MPa"}}


@pytest.mark.slow
def test_the_failed_surface_of_a_brittle_stope_is_its_own_scan(tmp_path):
    """Beyond the design the scan has the failed rock: by wall the mean depth is the model's, and so is the volume."""
    mine = load(
        tmp_path, [STOPE], half=24.0, materials={"host": BRITTLE}, insitu_stress=STRESS, solver={"collapse": "keep"}
    )
    slices = mine.run_slices(extracted_as=())
    datasets = {path: dataset for path, dataset, _ in run_stages(slices, tmp_path / "failed.npz")}
    grid, state = datasets["grid"], datasets["steps/history"]
    surface = failed_surface(state, grid, slices["steps"][0]["scene"]["excavations"])
    assert failed_volume(state) > 100.0
    design = trimesh.Trimesh(grid["solid_position"].values, grid["solid_facets"].values)
    scan = trimesh.util.concatenate([design, trimesh.Trimesh(surface.vertices, surface.triangles)])
    scan.export(tmp_path / "scan.ply")
    openings = mine.openings_slice()
    entry = {"name": "CMS", "excavations": ["stope"], "file": (tmp_path / "scan.ply").as_posix(), "step": "history"}
    settings = {"scans": [entry | {"error": 0.01}]} | {key: openings[key] for key in ("steps", "excavations")}
    table = compare_scans(ScanSlice.of(settings), grid, [state])
    rows = table.drop_dims("point").to_dataframe().set_index("side")
    assert rows["depth_mean"].max() > 1.5 * CELL
    np.testing.assert_allclose(rows["misfit"], 0.0, atol=0.25 * CELL)
    np.testing.assert_allclose(rows["overbreak_volume"], rows["failed_volume"], rtol=0.05, atol=2.0)
    assert (rows["seen_area"] > 0.95 * rows["wall_area"]).all()
