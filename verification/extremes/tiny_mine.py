"""A mine so small that it runs in seconds, and its file. Tests and lists of mistakes start from it."""

import copy
from pathlib import Path

import numpy as np
import yaml

HOST = {
    "model": "coulomb",
    "youngs_modulus": "57 GPa",
    "poisson_ratio": 0.25,
    "density": "2850 kg/m^3",
    "friction_angle": {"intact": "30 deg", "residual": "20 deg"},
    "dilation_angle": {"intact": "10 deg", "residual": "10 deg"},
    "cohesion": {"intact": "1 MPa", "residual": "0.5 MPa"},
    "tension_cutoff": {"intact": "0.5 MPa", "residual": "0 MPa"},
}
FILL = {"model": "elastic", "youngs_modulus": "1 GPa", "poisson_ratio": 0.25, "density": "1750 kg/m^3"}


def box(name: str, step: str, lower: list[float], upper: list[float], **others) -> dict:
    """A box between two corners, m, as an entry of a mine file."""
    corners = {key: [f"{value} m" for value in corner] for key, corner in (("lower", lower), ("upper", upper))}
    return {"name": name, "step": step, "shape": "box", **corners, **others}


TINY: dict = {
    "name": "tiny",
    "grid_convergence": False,
    "frame": {"latitude": -41.8, "longitude": 145.4, "surface": "1000 m"},
    "domain": {"lower": ["0 m", "0 m", "0 m"], "upper": ["80 m", "80 m", "80 m"]},
    "grid": {"coarse_cell": "10 m", "levels": 2, "buffer_cells": 1},
    "insitu_stress": {
        "constant": {"xx": "-0.1 MPa"},
        "gradient": {"xx": "-0.0249 MPa/m", "yy": "-0.0363 MPa/m", "zz": "-0.0278 MPa/m", "xz": "0.0027 MPa/m"},
    },
    "materials": {"host": HOST, "fill": FILL},
    "excavations": [
        box("drive", "history", [20, 30, 40], [60, 40, 50]),
        box("stope_1", "2019-08", [30, 40, 25], [45, 55, 50], fill="fill"),
        box("stope_2", "planned", [45, 40, 25], [55, 55, 50], fill="fill"),
    ],
    "steps": [{"name": "history"}, {"name": "2019-08", "start": "2019-08-01", "end": "2019-09-01"}],
    "solver": {"tolerance": 1e-3, "increments": 2},
    "seismic": {"least_particles": 2},
    "comparison": {"resamplings": 99},
    "record": {
        "file": "record.csv",
        "reader": "csv",
        "location_error": "5 m",
        "columns": {"time": "date", "x": "x", "y": "y", "z": "z", "log_potency": "size"},
    },
}
FLAT: dict = {key: copy.deepcopy(value) for key, value in TINY.items() if key != "record"} | {
    "name": "flat",
    "plane": "xz",
    "domain": {"lower": ["0 m", "0 m"], "upper": ["80 m", "80 m"]},
    "excavations": [
        {"name": "drive", "step": "history", "shape": "circle", "center": ["40 m", "40 m"], "radius": "6 m"},
        box("stope_1", "2019-08", [46, 30], [58, 50], fill="fill"),
    ],
}
"""Rock of TINY as a section of 1 m: a circular drive in history, a stope in a month; no record."""
NEXT_STEP = {"name": "2019-09", "start": "2019-09-01", "end": "2019-10-01"}
PUSH = box("push", "2019-08", [20, 20, 20], [30, 30, 30], force=["0 N", "0 N", "-1 MN"])
DIRECTED = PUSH | {"force": "1 MN", "toward": ["40 m", "40 m", "40 m"]}
STRAIN = {"name": "press", "step": "2019-08", "strain": {"zz": -1e-4}}


def write_mine(mine: dict, path: Path) -> Path:
    """Write a mine file and the record that TINY reads beside it: 60 events of 2019-08 around the stope."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(yaml.safe_dump(mine, sort_keys=False))
    random = np.random.default_rng(1)
    location, size = random.uniform(20, 60, (60, 3)), random.exponential(0.5, 60) - 3
    lines = [
        f"2019-08-{day % 30 + 1:02d}T06:00:00,{x:.2f},{y:.2f},{z:.2f},{log_potency:.3f}"
        for day, ((x, y, z), log_potency) in enumerate(zip(location, size, strict=True))
    ]
    (path.parent / "record.csv").write_text("\n".join(["date,x,y,z,size", *lines, ""]))
    return path


def changed(mine: dict, **values) -> dict:
    """A copy of a mine with values set by dotted key, changed(TINY, **{"grid.levels": 3}). List items go by number."""
    mine = copy.deepcopy(mine)
    for key, value in values.items():
        *parents, last = (int(part) if part.isdigit() else part for part in key.split("."))
        part = mine
        for parent in parents:
            part = part.setdefault(parent, {}) if isinstance(part, dict) else part[parent]
        part[last] = value
    return mine
