"""Steps and excavations of the Elk Creek mine from its dated longwall faces: `excavations_from: {source: elk_creek}`.

What lies between two faces of a panel (longwall.py) is caved gob. Its floor is level, or on the seam, which dips 3
degrees, some 13 m over the length of a face. Gate roads and mains are left out.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, cast

import ezdxf
import numpy as np
import pandas as pd
from ezdxf.entities import LWPolyline

from catalogs.records.csv_table import read_table
from catalogs.records.elk_creek_reader import data_folder, data_path
from common.errors import InputError
from workflow.dates import read_date
from workflow.mines.face_table import read_faces
from workflow.mines.longwall import Panel, Slice, advances, slices_of

GOB_HEIGHT = 18.0  # m, within the 15 to 20 m that a 3 to 4 m seam caves
STATION_COLUMNS = ("x", "y", "z")


@dataclass(frozen=True)
class Seam:
    """The seam as a plane z = z0 + east (x - x0) + north (y - y0), m; misfit: standard deviation of residuals, m."""

    origin: tuple[float, float]
    elevation_at_origin: float
    east: float
    north: float
    misfit: float

    def elevation(self, x, y):
        """Elevation of the seam at (x, y), m; numbers or arrays."""
        return self.elevation_at_origin + self.east * (x - self.origin[0]) + self.north * (y - self.origin[1])


def schedule(
    folder: Path,
    start: str,
    end: str,
    slices: Literal["month", "week"] | float = "month",
    gob_height: float = GOB_HEIGHT,
    floor: float | None = None,
    fill: str = "gob",
) -> tuple[list[dict], list[dict]]:
    """Dated steps of a period, and all that is mined up to its end: what was mined before the period is history.

    folder: the recorded data (ELK_CREEK_DATA overrides it); start, end: first date of the period and first one after
    it, local dates; slices: length of a step, a number in m; gob_height, floor (an elevation; None: on the seam) in m.
    A step is a dict: name, start, end. An excavation is a prism: name, step, shape, polygon [[x, y], ...] m,
    base and top (an elevation at each corner, m), fill; panel by panel, in order of mining. Raises InputError.
    """
    folder = data_folder(folder, "excavations_from.folder")
    panels = read_panels(folder)
    period = (read_date(f"excavations_from.{key}", text) for key, text in (("start", start), ("end", end)))
    first, last = (pd.Timestamp(date).tz_localize(None) for date in period)
    made = slices_of(panels, first, last, slices)
    steps = [{"name": part.name, "start": _written(part.start), "end": _written(part.end)} for part in made]
    seam = fit_seam(folder) if floor is None else Seam((0.0, 0.0), floor, 0.0, 0.0, 0.0)
    return steps, gob(panels, seam, made, gob_height, fill)


def _written(date: pd.Timestamp) -> str:
    """A date as a mine file has it."""
    return date.isoformat().removesuffix("T00:00:00")


def gob(panels: Sequence[Panel], seam: Seam, slices: Sequence[Slice], height: float, fill: str) -> list[dict]:
    """Prisms of gob of this height (m) on the seam, up to the last of the slices; see `schedule`."""
    prisms = []
    for mined in advances(panels, slices):
        floor = seam.elevation(*mined.polygon.T)
        prisms.append(
            {
                "name": mined.name,
                "step": mined.step,
                "shape": "prism",
                "polygon": mined.polygon.tolist(),
                "base": floor.tolist(),
                "top": (floor + height).tolist(),
                "fill": fill,
            }
        )
    return prisms


def polygon_centroid(polygon: np.ndarray) -> np.ndarray:
    """Centroid (2,) m: where a plane has its mean over the polygon."""
    first = np.asarray(polygon, float)
    origin = first.mean(axis=0)  # mine coordinates are large: take the products about the middle
    first = first - origin
    second = np.roll(first, -1, axis=0)
    cross = first[:, 0] * second[:, 1] - second[:, 0] * first[:, 1]
    return origin + ((first + second) * cross[:, None]).sum(axis=0) / (3 * cross.sum())


def read_panels(folder: Path) -> list[Panel]:
    """Panels by the faces of face_positions.csv, whose dates are local days. Raises InputError."""
    return read_faces(data_path(folder, "face_positions.csv"))


def read_outlines(folder: Path) -> list[tuple[np.ndarray, float]]:
    """Panel outlines of dxfs/placeholder_workings.dxf: corners (corner, 2) m, and the panel's one elevation, m."""
    path = data_path(folder, "dxfs/placeholder_workings.dxf")
    try:
        outlines = ezdxf.readfile(path).modelspace().query("LWPOLYLINE")
    except (OSError, ezdxf.DXFError) as error:
        raise InputError(f"{path}: not a readable DXF file ({error}); copy it again") from error
    lines = cast("Iterable[LWPolyline]", outlines)
    drawn = [(np.array(line.get_points("xy"), float), float(line.dxf.elevation)) for line in lines]
    return [(outline[:-1] if np.allclose(outline[0], outline[-1]) else outline, z) for outline, z in drawn]


def fit_seam(folder: Path) -> Seam:
    """The plane through all that the data say of the seam's elevation, by least squares.

    The elevations of underground geophones (station_list.csv), which stand in entries on the seam, and of the panel
    outlines, one elevation each, at their middle. Neither says floor or roof: a doubt of about 3 m, below the misfit.
    """
    path = data_path(folder, "station_list.csv")
    table = read_table(
        path, dict.fromkeys((*STATION_COLUMNS, "underground"), "required"), STATION_COLUMNS, has_keys=False
    )
    table.decide_decimals(STATION_COLUMNS)
    stations = np.column_stack([table.numbers(name) for name in STATION_COLUMNS])
    underground = stations[(table.text("underground").str.lower() == "true").to_numpy()]
    if not np.isfinite(underground).all():
        raise InputError(f"{path}: an underground station has no x, y or z; complete it")
    panels = [[*polygon_centroid(outline), elevation] for outline, elevation in read_outlines(folder)]
    points = np.vstack([underground, np.reshape(panels, (-1, 3))])
    if len(points) < 4:
        raise InputError(f"{folder}: {len(points)} elevations of the seam are too few for a plane; complete the data")
    origin = points[:, :2].mean(axis=0)
    design = np.column_stack([np.ones(len(points)), points[:, :2] - origin])
    (level, east, north), *_ = np.linalg.lstsq(design, points[:, 2], rcond=None)
    misfit = float(np.std(points[:, 2] - design @ [level, east, north], ddof=3))
    return Seam(tuple(origin.tolist()), float(level), float(east), float(north), misfit)
