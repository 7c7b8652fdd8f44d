"""Elastic rock made up for the tests: parts of cells with a stress in each state, as arrays and as files of states."""

import json
from pathlib import Path

import numpy as np
import xarray as xr

from baselines.elastic_rock import ElasticRock
from baselines.settings import FlawStrength
from common.datasets import write_dataset

LAME = SHEAR = 22.8e9  # Poisson's ratio 0.25
STRENGTH = {"host": FlawStrength.of({"friction_angle": 20.0, "cohesion": 2e6})}
SLIPPING = np.array([-40e6, -25e6, -10e6, 0.0, 0.0, 0.0])  # a third of all planes are above friction of 20 degrees
QUIET = np.array([-20e6, -20e6, -20e6, 0.0, 0.0, 0.0])


def block(stress, cells: int = 4, edge: float = 10.0, share=1.0) -> ElasticRock:
    """A block of equal cells, each with the stress of its state: stress (state, 6) or (state, part, 6), Pa."""
    corner = np.stack(np.meshgrid(*[np.arange(cells)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    stress = np.asarray(stress, float)
    states, parts = len(stress), len(corner)
    if stress.ndim == 2:
        stress = np.repeat(stress[:, None, :], parts, axis=1)
    return ElasticRock(
        centre=(corner + 0.5) * edge,
        edge=np.full(parts, edge),
        material=np.zeros(parts, int),
        materials=("host",),
        shear_modulus=np.full(parts, SHEAR),
        poisson_ratio=np.full(parts, 0.25),
        share=np.broadcast_to(np.asarray(share, float).reshape(-1, 1), (states, parts)).copy(),
        stress=stress,
    )


def write_state(
    path: Path, origin, size, stress, volume=None, material=None, names=("host",), excavation=None, plane: str = "none"
) -> Path:
    """A state with one particle in each cell: origin (cell, 3) and size (cell,) m, stress (cell, 6) Pa."""
    origin, size = np.asarray(origin, float), np.asarray(size, float)
    count = len(size)
    values = {
        "position": (("particle", "xyz"), origin + size[:, None] / 2),
        "spacing": ("particle", size),
        "cell": ("particle", np.arange(count, dtype=np.int32)),
        "cell_origin": (("cell", "xyz"), origin),
        "cell_size": ("cell", size),
        "stress": (("particle", "voigt"), np.broadcast_to(np.asarray(stress, float), (count, 6)).copy()),
        "volume": ("particle", size**3 if volume is None else np.asarray(volume, float)),
        "material": ("particle", np.zeros(count, np.int16) if material is None else np.asarray(material, np.int16)),
        "excavation": ("particle", np.full(count, -1, np.int16) if excavation is None else np.asarray(excavation)),
    }
    attributes = {
        "plane": plane,
        "domain_lower": np.zeros(3),
        "material_names": json.dumps(list(names)),
        "elastic_moduli": json.dumps({name: [LAME, SHEAR] for name in names}),
    }
    write_dataset(xr.Dataset(values, attrs=attributes), path)
    return path


def write_block(path: Path, stress, cells: int = 4, edge: float = 10.0, volume=None) -> Path:
    """A state of a block of equal cells of one stress, or of (cell, 6)."""
    corner = np.stack(np.meshgrid(*[np.arange(cells)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    return write_state(path, corner * edge, np.full(len(corner), edge), stress, volume)
