"""Tables for mXrap, spreadsheets and scripts: CSV whose header states the unit of each column in square brackets."""

import os
from collections.abc import Mapping

import numpy as np
import pandas as pd
import xarray as xr

from catalogs.sources.sizes import log_potency
from catalogs.sources.source_parameters import FIELDS
from common.datasets import atomic_path
from common.event_table import EVENT_ID, NEAREST_OPENING, OPENING_DISTANCE, STATED
from common.voigt import COMPONENTS, NAMES, voigt_from_tensor
from export.failed_rock import is_failed
from export.own_coordinates import OwnCoordinates
from mpm_core.files.state_vtk import principal

MEGA = 1e6  # Pa of MPa, in which stress tables of mines are
NUMBER_FORM = "%.10g"  # Of what is no coordinate: more digits than any of it is known to.
COORDINATE_FORM = ".4f"  # A tenth of a millimetre, or of a thousandth of a foot.
PRINCIPAL = ("most compressive", "intermediate", "least compressive")  # stresses, in ascending order
VARIABLES = ("position", "excavation", "volume", "failed", "stress", "strength_factor", "plastic_strain")


def coordinates(places: np.ndarray, own: OwnCoordinates) -> dict[str, list[str]]:
    """Columns x, y and z of places (n, 3) on the map, m, in the mine's own coordinates."""
    points = own.points(places)
    return {
        f"{axis} [{own.unit}]": [format(value, COORDINATE_FORM) for value in points[:, column].tolist()]
        for column, axis in enumerate("xyz")
    }


def failed_rock_table(state: xr.Dataset, steps: list[str], own: OwnCoordinates) -> dict:
    """Columns of the failed rock of a state, a row for each particle: place, volume, step of failure, stress.

    steps: names of the steps up to this one. Stress is along the axes of the mine's grid, tension positive.
    """
    rows = np.flatnonzero(is_failed(state))
    table: dict = coordinates(state["position"].values[rows], own)
    table["volume [m3]"] = state["volume"].values[rows]
    table["failed in step"] = np.array([*steps, ""])[state["failed"].values[rows]]
    stress = own.tensors(state["stress"].values[rows])
    sizes = principal(stress)[0]
    table |= {f"{name} stress (tension positive) [MPa]": sizes[:, row] / MEGA for row, name in enumerate(PRINCIPAL)}
    table |= {f"stress {name} (tension positive) [MPa]": stress[:, row] / MEGA for row, name in enumerate(NAMES)}
    table["strength factor [1]"] = state["strength_factor"].values[rows]
    table["plastic shear strain [1]"] = equivalent_shear(state["plastic_strain"].values[rows])
    return table


def equivalent_shear(strain: np.ndarray) -> np.ndarray:
    """Equivalent plastic shear strain sqrt(2 e_ij e_ij) of the deviators e of strains (n, 6), tensor shear."""
    mean = strain[:, :3].mean(axis=1)
    square = np.sum((strain[:, :3] - mean[:, None]) ** 2, axis=1) + 2.0 * np.sum(strain[:, 3:] ** 2, axis=1)
    return np.sqrt(2.0 * square)


def event_table(events: xr.Dataset, own: OwnCoordinates, parameters: xr.Dataset | None = None) -> dict:
    """Columns of a catalogue, a row for each event: place, time (UTC), sizes, axes and potency tensor.

    parameters: source parameters of the events, if there are any; else those that a record states. Components are along
    the axes of the mine's grid; axes are unit vectors along those, too. Cells of unknown values are empty.
    """
    table: dict = coordinates(events["location"].values, own)
    times = pd.DatetimeIndex(events["time"].values)
    table["date and time [UTC]"] = times.strftime("%Y-%m-%d %H:%M:%S.%f").str[:-3].fillna("")  # ms
    table["event earlier by at most [s]"] = events["time_lower_uncertainty"].values
    table["event later by at most [s]"] = events["time_upper_uncertainty"].values
    table["step"] = events["step"].values
    if EVENT_ID.name in events:
        table["event"] = events[EVENT_ID.name].values
        table["nearest opening"] = events[NEAREST_OPENING.name].values
        table["distance to nearest opening [m]"] = events[OPENING_DISTANCE.name].values
    if events.attrs["kind"] == "synthetic":
        table["resolved [1]"] = events["resolved"].values
    table["log10 potency [m3]"] = np.where(events["potency"].values > 0, log_potency(events["potency"].values), np.nan)
    table["moment [N m]"] = events["moment"].values
    table["moment magnitude [1]"] = events["mw"].values
    table["source size [m]"] = events["source_size"].values
    stated = events if parameters is None else parameters
    for field in (*FIELDS, *(STATED if parameters is None else ())):
        if field.name in stated:
            table[f"{field.name.replace('_', ' ')} [{field.unit}]"] = stated[field.name].values
    for axis in "pbt":
        vectors = own.vectors(events[f"{axis}_axis"].values)
        table |= {f"{axis.upper()} axis {name} [1]": vectors[:, column] for column, name in enumerate("xyz")}
    tensor = own.tensors(voigt_from_tensor(events["potency_tensor"].values))
    table |= {f"potency {name} [m3]": tensor[:, column] for column, name in enumerate(COMPONENTS)}
    return table


def write_table(table: Mapping, path: str | os.PathLike) -> None:
    """Write columns as CSV atomically; NaN as an empty cell."""
    with atomic_path(path) as temporary:
        pd.DataFrame(dict(table)).to_csv(
            temporary, index=False, lineterminator="\n", encoding="utf-8", float_format=NUMBER_FORM
        )
