"""Excavations of the Elk Creek mine from its dated longwall faces: what `excavations_from: {source: elk_creek}` means.

Each interval between two dated faces of a panel is a slice of caved gob: plan between the two face lines, floor on the
seam, which dips 3 degrees: some 13 m over the length of a face. Panel 1 and panel 2 before 2010-09 are history; the
monthly advances 2010-09 to 2010-12 are steps of that name.

    python -m workflow.mines.elk_creek --data FOLDER --output FILE.yaml     writes the list in the configuration's form
"""

import logging
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import cast

import ezdxf
import numpy as np
import pandas as pd
import yaml
from ezdxf.entities import LWPolyline

from catalogs.records.elk_creek_reader import data_folder, data_path
from common.command_line import CommandLine
from common.datasets import atomic_path
from common.errors import InputError
from common.stage import run_stage

FIRST_STEP = "2010-09-01"  # local dates of faces; the record's UTC months begin 6 or 7 hours earlier
END = "2011-01-01"
GOB_HEIGHT = 18.0  # m, within the 15 to 20 m that a 3 to 4 m seam caves
FACE_COLUMNS = ["local_date", "headgate_x", "headgate_y", "tailgate_x", "tailgate_y", "panel"]


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


def excavations(folder: Path, gob_height: float = GOB_HEIGHT, fill: str = "gob") -> list[dict]:
    """Gob prisms mined up to the end of 2010, panel by panel, in order of mining.

    Each a dict: name, step, shape, polygon [[x, y], ...] m, base and top (an elevation at each corner, m), fill.
    folder: the recorded data (ELK_CREEK_DATA overrides it); gob_height in m. Raises InputError.
    """
    folder = data_folder(folder, "excavations_from.folder")
    return panel_advances(read_faces(folder), fit_seam(folder), gob_height, fill)


def panel_advances(faces: pd.DataFrame, seam: Seam, gob_height: float, fill: str = "gob") -> list[dict]:
    """Prisms between successive faces of each panel that has advanced before END; see `excavations`.

    faces: columns of FACE_COLUMNS, dates as datetimes, coordinates in m.
    """
    if not gob_height > 0:
        raise InputError(f"excavations_from.gob_height: {gob_height:g} m is not a height; give 15 to 20 m")
    prisms = []
    for panel, dated in faces[faces["local_date"] <= pd.Timestamp(END)].groupby("panel", sort=True):
        dated = dated.sort_values("local_date")
        headgate = dated[["headgate_x", "headgate_y"]].to_numpy(float)
        tailgate = dated[["tailgate_x", "tailgate_y"]].to_numpy(float)
        for index, begin in enumerate(dated["local_date"].iloc[:-1]):
            polygon = np.array([tailgate[index], tailgate[index + 1], headgate[index + 1], headgate[index]])
            floor = seam.elevation(*polygon.T)
            prisms.append(
                {
                    "name": f"panel_{panel}_{begin:%Y-%m-%d}",
                    "step": f"{begin:%Y-%m}" if begin >= pd.Timestamp(FIRST_STEP) else "history",
                    "shape": "prism",
                    "polygon": polygon.tolist(),
                    "base": floor.tolist(),
                    "top": (floor + gob_height).tolist(),
                    "fill": fill,
                }
            )
    return prisms


def polygon_area(polygon: np.ndarray) -> float:
    """Signed area, m2, positive counter-clockwise; polygon (corner, 2) m."""
    x, y = np.asarray(polygon, float).T
    return 0.5 * float(np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y))


def polygon_centroid(polygon: np.ndarray) -> np.ndarray:
    """Centroid (2,) m: where a plane has its mean over the polygon."""
    first = np.asarray(polygon, float)
    origin = first.mean(axis=0)  # mine coordinates are large: take the products about the middle
    first = first - origin
    second = np.roll(first, -1, axis=0)
    cross = first[:, 0] * second[:, 1] - second[:, 0] * first[:, 1]
    return origin + ((first + second) * cross[:, None]).sum(axis=0) / (3 * cross.sum())


def read_faces(folder: Path) -> pd.DataFrame:
    """face_positions.csv: local_date (datetime), headgate and tailgate corner (m), panel (text). Raises InputError."""
    path = data_path(folder, "face_positions.csv")
    faces = pd.read_csv(path, encoding="utf-8-sig", dtype={"panel": str})  # the file begins with a byte order mark
    missing = [name for name in FACE_COLUMNS if name not in faces]
    if missing:
        raise InputError(f"{path}: column {missing[0]!r} is missing; the file has {', '.join(faces)}")
    faces["local_date"] = pd.to_datetime(faces["local_date"], format="ISO8601")
    if faces[FACE_COLUMNS].isna().any(axis=None):
        raise InputError(f"{path}: a face has no date, corner or panel; complete it")
    return faces[FACE_COLUMNS]


def read_panels(folder: Path) -> list[tuple[np.ndarray, float]]:
    """Panel outlines of dxfs/placeholder_workings.dxf: corners (corner, 2) m, and the panel's one elevation, m."""
    path = data_path(folder, "dxfs/placeholder_workings.dxf")
    try:
        outlines = ezdxf.readfile(path).modelspace().query("LWPOLYLINE")
    except (OSError, ezdxf.DXFError) as error:
        raise InputError(f"{path}: not a readable DXF file ({error}); copy it again") from error
    lines = cast("Iterable[LWPolyline]", outlines)
    panels = [(np.array(line.get_points("xy"), float), float(line.dxf.elevation)) for line in lines]
    return [(outline[:-1] if np.allclose(outline[0], outline[-1]) else outline, z) for outline, z in panels]


def fit_seam(folder: Path) -> Seam:
    """The plane through all that the data say of the seam's elevation, by least squares.

    The elevations of underground geophones (station_list.csv), which stand in entries on the seam, and of the panel
    outlines, one elevation each, at their middle. Neither says floor or roof: a doubt of about 3 m, below the misfit.
    """
    path = data_path(folder, "station_list.csv")
    stations = pd.read_csv(path, encoding="utf-8-sig")
    missing = [name for name in ("x", "y", "z", "underground") if name not in stations]
    if missing:
        raise InputError(f"{path}: column {missing[0]!r} is missing; the file has {', '.join(stations)}")
    underground = stations[stations["underground"].astype(str).str.lower() == "true"]
    panels = [[*polygon_centroid(outline), elevation] for outline, elevation in read_panels(folder)]
    points = np.vstack([underground[["x", "y", "z"]].to_numpy(float), np.reshape(panels, (-1, 3))])
    if len(points) < 4:
        raise InputError(f"{folder}: {len(points)} elevations of the seam are too few for a plane; complete the data")
    origin = points[:, :2].mean(axis=0)
    design = np.column_stack([np.ones(len(points)), points[:, :2] - origin])
    (level, east, north), *_ = np.linalg.lstsq(design, points[:, 2], rcond=None)
    misfit = float(np.std(points[:, 2] - design @ [level, east, north], ddof=3))
    return Seam(tuple(origin.tolist()), float(level), float(east), float(north), misfit)


def prepare(folder: Path, gob_height: float = GOB_HEIGHT) -> dict:
    """The excavations in the configuration's language, every length with its unit."""
    listed = []
    for prism in excavations(folder, gob_height):
        polygon = [[f"{x:.2f} m", f"{y:.2f} m"] for x, y in prism["polygon"]]
        heights = {key: [f"{z:.2f} m" for z in prism[key]] for key in ("base", "top")}
        listed.append(prism | {"polygon": polygon} | heights)
    return {"excavations": listed}


def main() -> None:
    """Command line: write the excavations to a YAML file."""
    parser = CommandLine(description="Elk Creek: dated longwall faces to excavations")
    parser.add_argument("--data", type=Path, required=True, help="folder with the recorded data")
    parser.add_argument("--output", type=Path, required=True, help="YAML file to write")
    parser.add_argument("--gob-height", type=float, default=GOB_HEIGHT, help="height of the caved gob, m")
    arguments = parser.parse_args()

    def write() -> None:
        overlay = prepare(arguments.data, arguments.gob_height)
        seam = fit_seam(data_folder(arguments.data))
        dip = np.degrees(np.arctan(np.hypot(seam.east, seam.north)))
        logging.info("%d prisms; the seam dips %.1f deg, misfit %.1f m", len(overlay["excavations"]), dip, seam.misfit)
        with atomic_path(arguments.output) as temporary:
            temporary.write_text(yaml.safe_dump(overlay, sort_keys=False))

    run_stage("elk_creek", None, write)


if __name__ == "__main__":
    main()
