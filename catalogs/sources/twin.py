"""A twin record: a modelled catalogue as a mine's seismic system might have recorded it.

Locations get the error of a location, small events are lost, nothing else changes. It tests the comparison where the
answer is known; it is no recorded catalogue and is labelled a twin wherever it is shown.
"""

import os

import numpy as np
import pandas as pd
import xarray as xr

from common.datasets import atomic_path
from common.errors import InputError
from common.voigt import COMPONENTS

HEADER = """\
# A TWIN, not a recorded catalogue: modelled by this project's own pipeline on another grid, with other residual
# strengths and another order of failure ({mine}); {noise:g} m of noise on locations (r.m.s. distance), events below
# log10 P {cut:g} left out. Made again by the rule `twin` (config/mines/demo/twin.yaml).
# UTC, mine coordinates in m, potency in m3.
"""


def write_twin(catalog: xr.Dataset, noise: float, cut: float, seed: int, path: str | os.PathLike) -> int:
    """Write the resolved events at or above `cut` (log10 of m3) as CSV, with isotropic location noise (r.m.s., m).

    Returns the number of events. Raises InputError if none is left.
    """
    potency = catalog.potency.values
    size = np.log10(potency, where=potency > 0, out=np.full(len(potency), -np.inf))
    kept = np.flatnonzero((catalog.resolved.values == 1) & (size >= cut))
    if not len(kept):
        raise InputError(f"twin: no event of the catalogue has log10 P of at least {cut:g}; lower the cut")
    generator = np.random.default_rng(seed)
    location = catalog.location.values[kept] + generator.normal(0.0, noise / np.sqrt(3.0), (len(kept), 3))
    columns = {"time": pd.to_datetime(catalog.time.values[kept]).strftime("%Y-%m-%dT%H:%M:%S")}
    columns |= {name: np.round(location[:, k], 1) for k, name in enumerate("xyz")}
    columns["log_potency"] = [f"{value:.3f}" for value in size[kept]]
    tensor = catalog.potency_tensor.values[kept]
    columns |= {f"p_{name}": [f"{value:.4e}" for value in tensor[:, i, j]] for name, (i, j) in COMPONENTS.items()}
    with atomic_path(path) as temporary, temporary.open("w", newline="\n") as file:
        file.write(HEADER.format(mine=catalog.attrs["mine"], noise=noise, cut=cut))
        pd.DataFrame(columns).to_csv(file, index=False, lineterminator="\n")
    return len(kept)
