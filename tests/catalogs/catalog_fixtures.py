"""Catalogues made up for the tests: no mechanics, only what a catalogue looks like."""

import json

import numpy as np
import xarray as xr

from catalogs.records.build import build_record
from catalogs.records.quakeml_reader import RecordSlice

LAME, SHEAR = 22.8e9, 22.8e9
FRAME = {"latitude": -41.8, "longitude": 145.4, "surface": 2000.0}
SETTINGS = {"mine": "demo", "lame_lambda": LAME, "shear_modulus": SHEAR, "location_error": 10.0, "frame": FRAME}


def made_up_catalog(count: int, seed: int = 0, kind: str = "synthetic", b: float = 0.7, shift=(0, 0, 0)) -> xr.Dataset:
    """`count` events over 60 days, spread 30 m, log P above -3, near strike-slip with P north-south, T east-west."""
    generator = np.random.default_rng(seed)
    tensor = np.diag([1.0, -1.0, 0.0]) + 0.2 * generator.normal(size=(count, 3, 3))
    tensor = tensor + tensor.transpose(0, 2, 1)
    potency = 10 ** (generator.exponential(1 / (b * np.log(10)), count) - 3)
    tensor *= (potency / np.sqrt(2 * np.sum(tensor**2, axis=(1, 2))))[:, None, None]
    time = np.datetime64("2019-08-01", "ns") + np.sort(generator.integers(0, 60 * 86400 * 10**9, count)).astype(
        "m8[ns]"
    )
    location = generator.normal(size=(count, 3)) * 30 + np.asarray(shift)
    catalog = build_record(
        RecordSlice.of(SETTINGS | {"reader": "quakeml", "file": ""}),
        time,
        location,
        {},
        tensor,
        step=np.full(count, "2019-08"),
    )
    catalog.attrs |= {"kind": kind, "frame": json.dumps(FRAME), "potency_floor": 1e-3, "location_error": 0.0}
    return catalog


def awkward_catalog() -> xr.Dataset:
    """Thirty events with nanoseconds, one without a tensor, awkward names and attributes."""
    catalog = made_up_catalog(30)
    for name in ("potency_tensor", "moment_tensor", "p_axis", "b_axis", "t_axis", "iso", "clvd", "dc"):
        catalog[name][3] = np.nan
    catalog["step"][7] = "a <b> & 'c'"
    catalog.attrs |= {"note": "stress < strength & rising", "seismic_fraction": 0.1, "truncated": 1}
    return catalog
