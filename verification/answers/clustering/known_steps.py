"""Input of the event stage with known contents: mechanisms with scatter, and whole steps."""

import json

import numpy as np
import xarray as xr
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

LAME_LAMBDA, SHEAR_MODULUS = 22.8e9, 22.8e9  # Of 57 GPa and a Poisson's ratio of 0.25, Pa.


def turned(tensor: NDArray, largest: float, generator: np.random.Generator) -> NDArray:
    """Each tensor (..., 3, 3) turned about a random axis by a random angle, uniform from 0 to `largest` degrees."""
    shape = np.shape(tensor)[:-2]
    axis = generator.normal(size=(*shape, 3))
    axis /= np.linalg.norm(axis, axis=-1, keepdims=True)
    angle = np.radians(largest) * generator.random(shape)
    turn = Rotation.from_rotvec((angle[..., None] * axis).reshape(-1, 3)).as_matrix().reshape(*shape, 3, 3)
    return turn @ tensor @ np.swapaxes(turn, -1, -2)


def lognormal(count: int, median: float, spread: float, generator: np.random.Generator) -> NDArray:
    """Sizes (count,) whose log10 is normal with this spread."""
    return median * 10.0 ** generator.normal(0.0, spread, count)


def synthetic_step(
    position,
    seismic_strain,
    *,
    spacing=1.25,
    volume=None,
    failure_order=None,
    failed=True,
    overshoot_strain=0.0,
    later_strain=0.0,
    step="2019-08",
    step_index=2,
    start="2019-08-01",
    end="2019-09-01",
    dated=1,
    mine="testmine",
) -> xr.Dataset:
    """A mining step of particles at position (particle, 3) m with seismic_strain (particle, 6), all else as given."""
    position = np.asarray(position, dtype=float).reshape(-1, 3)
    count = len(position)
    spacing = np.broadcast_to(np.asarray(spacing, dtype=float), count)
    volume = spacing**3 if volume is None else np.broadcast_to(np.asarray(volume, dtype=float), count)
    order = np.zeros((count, 2)) if failure_order is None else np.asarray(failure_order).reshape(-1, 2)
    strains = [
        np.broadcast_to(np.asarray(strain, dtype=float), (count, 6))
        for strain in (seismic_strain, overshoot_strain, later_strain)
    ]
    voigt = ("particle", "voigt")
    return xr.Dataset(
        {
            "position": (("particle", "xyz"), position),
            "spacing": ("particle", spacing),
            "volume": ("particle", volume),
            "material": ("particle", np.zeros(count, np.int16)),
            "failed": ("particle", np.where(np.broadcast_to(failed, count), step_index, -1).astype(np.int32)),
            "failure_order": (("particle", "order"), order.astype(np.int32)),
            "seismic_strain": (voigt, strains[0]),
            "overshoot_strain": (voigt, strains[1]),
            "later_strain": (voigt, strains[2]),
            "plastic_strain_step": (voigt, strains[0] + strains[1] + strains[2]),
        },
        attrs={
            "mine": mine,
            "stage": "step",
            "step": step,
            "step_index": step_index,
            "start": start,
            "end": end,
            "dated": dated,
            "lame_lambda": LAME_LAMBDA,
            "shear_modulus": SHEAR_MODULUS,
            "material_names": json.dumps(["host"]),
            "elastic_moduli": json.dumps({"host": [LAME_LAMBDA, SHEAR_MODULUS]}),
            "truncated": 0,
            "truncated_share": 0.0,
            "truncated_where": "",
        },
    )
