"""Small mines in elastic rock, and their states with failed rock and displacements that are put in by hand."""

from pathlib import Path

import numpy as np
import xarray as xr
import yaml

from mpm_core.scene.scene import parse_scene
from mpm_core.stages.equilibrium_stages import elastic_stage
from mpm_core.stages.grid_stage import make_grid
from response.rock import Rock, Voids
from workflow.configuration import load_mine
from workflow.mine import Mine

CELL = 1.0  # m, the finest


def load(folder: Path, excavations: list[dict], half: float = 16.0, **more) -> Mine:
    """A mine in a cube of elastic rock, cells of CELL around its openings, one step `history`."""
    corner = f"{half} m"
    text = {
        "name": "small",
        "frame": {"surface": "0 m"},
        "domain": {"lower": [f"-{corner}"] * 3, "upper": [corner] * 3, "boundary": "fixed"},
        "grid": {"coarse_cell": "4 m", "levels": 3, "buffer_cells": 2},
        "insitu_stress": {"constant": {"xx": "-10 MPa", "yy": "-20 MPa", "zz": "-15 MPa"}},
        "materials": {
            "host": {"model": "elastic", "youngs_modulus": "50 GPa", "poisson_ratio": 0.25, "density": "2700 kg/m^3"}
        },
        "excavations": [{"step": "history", **one} for one in excavations],
        "steps": [{"name": "history"}],
        "grid_convergence": False,
    }
    path = folder / "small.yaml"
    path.write_text(yaml.safe_dump(text | more))
    return load_mine(path)


def states_of(mine: Mine, folder: Path) -> tuple[xr.Dataset, xr.Dataset]:
    """Grid and elastic state of a mine."""
    grid = make_grid(mine.grid_slice(), {})
    return grid, elastic_stage(parse_scene(mine.mechanics_slice(0)), grid, folder / "failed.npz")[0]


def rock_of(grid: xr.Dataset, state: xr.Dataset) -> Rock:
    """The rock of a state in which all excavations are mined."""
    return Rock(state, Voids.of(grid, np.ones(1 + int(grid["piece_excavation"].max()), bool)))


def with_failed(state: xr.Dataset, chosen: np.ndarray, step: int = 0) -> xr.Dataset:
    """The state with some particles (particle,) bool failed in a step."""
    failed = np.where(chosen, step, -1).astype(np.int32)
    return state.assign(failed=("particle", failed, state["failed"].attrs))


def with_fallen(state: xr.Dataset, chosen: np.ndarray, also: np.ndarray | None = None) -> xr.Dataset:
    """The state without the rock of some particles (particle,) bool, which has fallen with all of their cells.

    also: further cells (k,) from which rock fell before they were mined.
    """
    cells = state["cell"].values[chosen]
    cells = np.unique(cells if also is None else np.append(cells, also)).astype(np.int32)
    every = np.full(len(cells), ~np.uint64(0))
    volume = np.where(chosen, 0.0, state["volume"].values)
    bare = state.drop_dims("loose").assign(volume=("particle", volume, state["volume"].attrs))
    return bare.assign(loose_cell=("loose", cells), loose_samples=("loose", every))


def moved_by(state: xr.Dataset, gradient: np.ndarray, shift: np.ndarray) -> xr.Dataset:
    """The state with nodes moved by shift (3,) m and a uniform displacement gradient (3, 3)."""
    moved = state["node_position"].values @ gradient.T + shift
    return state.assign(node_displacement=(("node", "xyz"), moved))
