"""Open pits in a mine file: pushbacks by step from surfaces that are open at the ground."""

import copy
import json
from itertools import pairwise

import numpy as np
import pytest
import yaml
from geometry.pits import GROUND, stepped_pit, write_obj
from tiny_mines import snakemake

from catalogs.sources.openings import NEVER, ROCK, Mining
from common.datasets import read_dataset
from common.errors import InputError, InputErrors
from mpm_core.files.state_datasets import read_edge_points
from mpm_core.geometry.inside import contains
from mpm_core.geometry.open_pits import closed_at
from mpm_core.geometry.solids import Solid
from mpm_core.stages.grid_stage import make_grid
from workflow.cells_across import across_of
from workflow.configuration import load_mine

# A pit 1.4 km across and 400 m deep. Each pushback holds the one before: walls and floors lie outside of it.
PUSHBACKS = {
    "pushback_1": stepped_pit(radii=(430.0, 327.0, 223.0, 120.0), bench=60.0, sides=36, center=(-40.0, 10.0)),
    "pushback_2": stepped_pit(radii=(570.0, 423.0, 277.0, 160.0), bench=80.0, sides=36, center=(-20.0, 10.0)),
    "pushback_3": stepped_pit(radii=(700.0, 533.0, 367.0, 200.0), bench=100.0, sides=36),
}
VOLUMES = np.array([volume for *_, volume in PUSHBACKS.values()])  # m3
SLICES = np.diff(VOLUMES, prepend=0.0)
MINE = {
    "name": "open_pit",
    "grid_convergence": False,
    "frame": {"surface": f"{GROUND} m"},
    "grid": {"finest_cell": "50 m", "buffer_cells": 1},
    "insitu_stress": {"constant": {"zz": "0 MPa"}, "gradient": {axis: "-0.027 MPa/m" for axis in ("xx", "yy", "zz")}},
    "materials": {
        "host": {
            "model": "coulomb", "youngs_modulus": "30 GPa", "poisson_ratio": 0.25, "density": "2752 kg/m^3",
            "friction_angle": {"intact": "40 deg", "residual": "35 deg"},
            "dilation_angle": {"intact": "5 deg", "residual": "2 deg"},
            "cohesion": {"intact": "20 MPa", "residual": "10 MPa"},
            "tension_cutoff": {"intact": "5 MPa", "residual": "1 MPa"},
        }
    },
    "excavations": [
        {"name": name, "step": step, "file": f"{name}.obj", "closed_at_ground": True}
        for name, step in zip(PUSHBACKS, ("history", "2024", "2025"), strict=True)
    ],
    "steps": [
        {"name": "history"},
        {"name": "2024", "start": "2024-01-01", "end": "2025-01-01"},
        {"name": "2025", "start": "2025-01-01", "end": "2026-01-01"},
    ],
}  # fmt: skip


def file_of(folder, **sections):
    """The mine file, with other sections, and the surfaces beside it."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, (vertices, facets, _) in PUSHBACKS.items():
        write_obj(folder / f"{name}.obj", vertices, facets)
    path = folder / "open_pit.yaml"
    path.write_text(yaml.safe_dump(copy.deepcopy(MINE) | sections))
    return path


@pytest.fixture
def mine_of(tmp_path, monkeypatch):
    """Reads the mine with other sections."""
    monkeypatch.chdir(tmp_path)
    return lambda **sections: load_mine(file_of(tmp_path, **sections))


def test_slices_of_pushbacks_are_differences_of_the_solids():
    """By winding numbers, independent of any grid: each pushback holds the one before."""
    random = np.random.default_rng(2)
    solids = [Solid("pit", *closed_at(*PUSHBACKS[name][:2], GROUND)[:2]) for name in PUSHBACKS]
    assert [solid.volume for solid in solids] == pytest.approx(VOLUMES, rel=1e-9)
    for inner, outer in pairwise(solids):
        points = random.uniform(*inner.bounds, (20_000, 3))
        assert not (contains(inner, points) & ~contains(outer, points)).any()


def test_steps_mine_their_slices(mine_of):
    """Of whole solids and of slices on the grid; no bench is narrow; the domain ends at the ground, which is free."""
    mine = mine_of(grid={"finest_cell": "25 m", "buffer_cells": 1})
    assert mine.settings.domain.upper[2] == GROUND
    assert mine.boundary()["z_upper"] == "free"
    grid = make_grid(mine.grid_slice(), {})
    assert json.loads(grid.attrs["excavation_volume"]) == pytest.approx(VOLUMES, rel=1e-9)
    mined = Mining.of(grid, np.arange(3), np.full(3, NEVER)).volumes(ROCK)
    assert mined == pytest.approx(SLICES, rel=3e-3)
    assert json.loads(grid.attrs["excavation_narrow"]) == []
    assert not any(one.is_narrow() for one in across_of(mine).values())
    height = read_edge_points(grid).place[:, 2] * 25.0 + mine.settings.domain.lower[2]
    assert height.max() < GROUND - 1.0  # no edge of rock is at the ground


def test_a_pit_runs_to_its_report(tmp_path):
    """Floor and ground rise, since the weight of what is mined is gone: the floor about as a half-space under an even
    tension on a disc, 2 p a (1 - nu^2) / E; the ground by W (1 - nu) / (2 pi G r), less what the held boundary takes,
    which is the same at all places (Boussinesq)."""
    path = file_of(tmp_path / "files", grid={"finest_cell": "50 m", "buffer_cells": 3})
    status, text = snakemake(path, tmp_path / "run")
    assert status == 0, text
    results = tmp_path / "run" / "results" / "open_pit"
    assert "nothing is left to mine" not in (results / "report.html").read_text()
    state = read_dataset(results / "steps" / "2025.nc")
    assert state.attrs["computed"] == 1
    place, rise = state["position"].values, state["displacement"].values[:, 2]
    distance, rock = np.linalg.norm(place[:, :2], axis=1), state["volume"].values > 0
    weight, radius, youngs_modulus, shear_modulus = 27e3 * VOLUMES[-1], 700.0, 30e9, 12e9  # N, m, Pa
    floor = rock & (distance < 150.0) & (abs(place[:, 2] - (GROUND - 425.0)) < 25.0)
    of_disc = 2.0 * weight / (np.pi * radius) * (1.0 - 0.25**2) / youngs_modulus
    assert rise[floor].mean() == pytest.approx(of_disc, rel=0.2)
    at_ground = [rock & (abs(distance - at) < 120.0) & (place[:, 2] > GROUND - 200.0) for at in (1500.0, 2000.0)]
    difference = weight * 0.75 / (2.0 * np.pi * shear_modulus) * (1.0 / 1500.0 - 1.0 / 2000.0)
    assert rise[at_ground[0]].mean() - rise[at_ground[1]].mean() == pytest.approx(difference, rel=0.15)


def test_the_level_of_the_ground_is_in_the_slice_of_the_grid(mine_of):
    """Where a pit is closed; other solids do not depend on it."""
    pit, other = MINE["excavations"][0], {"name": "box", "step": "planned", "shape": "box"}
    other |= {"lower": ["0 m", "0 m", "100 m"], "upper": ["90 m", "90 m", "190 m"]}
    domain = {"lower": ["-800 m", "-800 m", "-300 m"], "upper": ["800 m", "800 m", "500 m"]}
    domain["boundary"] = {"z_upper": "free", "others": "fixed"}
    mine = mine_of(excavations=[pit, other], domain=domain)
    closed, free = mine.grid_slice()["excavations"]
    assert closed["closed_at"] == GROUND
    assert "closed_at_ground" not in closed
    assert "closed_at" not in free


@pytest.mark.parametrize(
    ("entry", "domain", "message"),
    [
        ({"shape": "box", "file": None}, {}, "closed_at_ground: not a key of box"),
        ({"shape": "prism", "lower": "300 m", "upper": "500 m"}, {}, "closed_at_ground: not a key of prism from"),
        ({"outside": True}, {}, "excavations.pit.closed_at_ground: only what is mined, within its surface, is closed"),
        ({}, {"upper": "400 m"}, r"the domain ends at 400 m, below the ground \(frame.surface, 500 m\)"),
        ({}, {"upper": "600 m"}, r"the domain ends at 600 m, above the ground"),
        ({}, {"boundary": "fixed"}, "domain.boundary holds the ground: z_upper is fixed"),
    ],
)  # fmt: skip
def test_where_it_makes_no_sense_it_is_refused(entry, domain, message, mine_of):
    """In one line each."""
    pit = {key: value for key, value in ({"name": "pit", "step": "history", "file": "pushback_1.obj",
           "closed_at_ground": True} | entry).items() if value is not None}  # fmt: skip
    if pit.get("shape") == "box":
        pit |= {"lower": ["0 m", "0 m", "100 m"], "upper": ["90 m", "90 m", "190 m"]}
    sides = {
        "lower": ["-800 m", "-800 m", "-400 m"],
        "upper": ["800 m", "800 m", domain.get("upper", "500 m")],
        "boundary": domain.get("boundary", {"z_upper": "free", "others": "fixed"}),
    }
    grid = {"coarse_cell": "100 m", "levels": 2}
    with pytest.raises((InputError, InputErrors), match=message) as error:
        mine_of(excavations=[pit], domain=sides, grid=grid)
    assert len(str(error.value).splitlines()) == 1


def test_a_rock_body_is_not_closed(mine_of):
    body = {"name": "weathered", "material": "host", "file": "pushback_1.obj", "closed_at_ground": True}
    with pytest.raises((InputError, InputErrors), match=r"rock_bodies.weathered.closed_at_ground: only what is mined"):
        mine_of(rock_bodies=[body])


def test_a_ground_of_another_unit_is_told_with_the_place(mine_of):
    """Elevations in feet that are read as metres."""
    with pytest.raises(
        (InputError, InputErrors), match=r"pushback_1.*does not reach the ground: its rim at .* is 1140 m"
    ):
        mine_of(frame={"surface": f"{GROUND / 0.3048:.0f} m"})


def test_pushbacks_of_a_schedule(mine_of, tmp_path):
    """Every body of its files is closed at the ground."""
    rows = ["body,end", "pushback_1,history", "pushback_2,2024-01-20", "pushback_3,2024-02-20"]
    (tmp_path / "table.csv").write_text("\n".join([*rows, ""]))
    solids = [{"file": "pushback_*.obj", "closed_at_ground": True}]
    mine = mine_of(excavations=[], steps=[], schedule={"file": "table.csv", "solids": solids})
    assert [entry["closed_at"] for entry in mine.grid_slice()["excavations"]] == [GROUND] * 3
