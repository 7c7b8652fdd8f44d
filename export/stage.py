"""What the stages of the target `export` write: files of each step, and those of the catalogues."""

import json
import logging
from pathlib import Path

import numpy as np
import pandas as pd
import xarray as xr

from catalogs.sources.sizes import log_potency
from common.datasets import SCENE, open_dataset, read_dataset
from common.event_table import read_events
from export.closed_surface import Surface
from export.drawing import write_faces, write_points
from export.failed_rock import failed_surface
from export.omf_project import Points, Triangles, write_project
from export.own_coordinates import OwnCoordinates
from export.tables import event_table, failed_rock_table, write_table
from mpm_core.files.state_datasets import read_edge_nodes, read_grid, read_pieces
from mpm_core.files.state_vtk import write_vtu
from mpm_core.geometry.omf_files import read_omf

MAX_DIFFERENCE = 0.01  # Of the volume within a surface from that of the failed rock, relative.
FAILED_ROCK = "failed_rock"
VOLUME = "volume [m3]"


def export_step(settings: dict, grid: Path, state: Path, folder: Path) -> None:
    """Write the files of a step: cells.vtu, and failed_rock as .dxf, .omf and .csv.

    settings: `mine`, `frame`, and `steps`, the names of the steps up to this one; grid, state: paths of datasets.
    """
    own = OwnCoordinates.of(settings["frame"])
    first, dataset = read_dataset(grid), read_dataset(state)
    with open_dataset(state) as opened:
        excavations = json.loads(opened.attrs[SCENE])["excavations"]
    write_vtu(read_grid(dataset)[0], read_pieces(first), read_edge_nodes(first), dataset, folder / "cells.vtu")
    own.convert_vtu(folder / "cells.vtu")
    surface = failed_surface(dataset, first, excavations)
    vertices, triangles = own.points(surface.vertices), own.triangles(surface.triangles)
    step = settings["steps"][-1]
    name = f"{FAILED_ROCK}_{step}"
    write_faces(vertices, {name: triangles}, own.unit, folder / f"{FAILED_ROCK}.dxf")
    about = f"Rock that has failed up to the end of step {step} and is not mined; modelled."
    elements = [Triangles(name, vertices, triangles, about)]
    write_project(settings["mine"], elements, own.unit, folder / f"{FAILED_ROCK}.omf")
    write_table(failed_rock_table(dataset, settings["steps"], own), folder / f"{FAILED_ROCK}.csv")
    logging.info("%s: failed rock in %d triangles", step, len(triangles))


def export_catalogues(
    settings: dict, catalogues: dict[str, Path], folder: Path, parameters: Path | None = None
) -> None:
    """Write events as points and as a table: .dxf, .omf and .csv of each catalogue, by the name of its files.

    settings: `mine` and `frame`; parameters: source parameters of the modelled events, if there are any.
    """
    own = OwnCoordinates.of(settings["frame"])
    for name, path in catalogues.items():
        events = read_events(path)
        points = own.points(events["location"].values)
        write_points(points, layers_of(events, name), own.unit, folder / f"{name}.dxf")
        is_modelled = events.attrs["kind"] == "synthetic"
        known = read_dataset(parameters) if is_modelled and parameters is not None else None
        table = event_table(events, own, known)
        data = {
            "log10 potency (m3)": log_potency(events["potency"].values),
            "moment magnitude": events["mw"].values,
            "step": events["step"].values.astype(str),
            "date and time (UTC)": np.asarray(table["date and time [UTC]"]),
        }
        if is_modelled:
            data["resolved"] = events["resolved"].values
        named = ("event", "nearest opening", "distance to nearest opening [m]")
        data |= {column.replace("[m]", "(m)"): np.asarray(table[column]) for column in named if column in table}
        write_project(settings["mine"], [Points(name, points, data)], own.unit, folder / f"{name}.omf")
        write_table(table, folder / f"{name}.csv")
        logging.info("%s: %d points", name, len(points))


def layers_of(events: xr.Dataset, name: str) -> list[str]:
    """Layer of each event: modelled ones by their step, those that are not resolved on layers of their own."""
    if events.attrs["kind"] != "synthetic":
        return [name] * events.sizes["event"]
    return [
        f"{name}_{step}" if resolved else f"unresolved_{name}_{step}"
        for step, resolved in zip(events["step"].values, events["resolved"].values, strict=True)
    ]


def write_contents(settings: dict, steps: dict[str, Path], path: Path) -> None:
    """Write what the files of each step hold, as they are read again: volume of the failed rock, and that within its
    surface.

    settings: `frame`; steps: folder of each step's files.
    """
    own = OwnCoordinates.of(settings["frame"])
    rows = []
    for step, folder in steps.items():
        failed = float(pd.read_csv(folder / f"{FAILED_ROCK}.csv")[VOLUME].sum())
        enclosed, count = 0.0, 0
        if failed > 0.0:
            (vertices, triangles), _ = read_omf(folder / f"{FAILED_ROCK}.omf")
            enclosed, count = own.cubic_metres(Surface(vertices, triangles).volume), len(triangles)
        if abs(enclosed - failed) > MAX_DIFFERENCE * failed:
            logging.warning(
                "%s: the surface encloses %.6g m3, the failed rock has %.6g m3; use failed_rock.csv",
                step,
                enclosed,
                failed,
            )
        rows.append((step, failed, enclosed, count))
    columns = ["step", f"failed rock {VOLUME}", f"within its surface {VOLUME}", "triangles [1]"]
    write_table(pd.DataFrame(rows, columns=columns), path)
