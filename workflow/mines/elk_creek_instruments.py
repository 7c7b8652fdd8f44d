"""Instruments of the Elk Creek mine's gate roads, read from the spreadsheets of its recorded data.

Pressure cells at four sites, each read while panels 1 and 2 passed, closure stations, and extensometers in the roof.

    python -m workflow.mines.elk_creek_instruments config/mines/elk_creek.yaml readings

writes a CSV file for each instrument that has readings in the steps of the mine file, and instruments.yaml, the section
`observations` for it. Instruments are zeroed at the end of the first dated step.

What the files leave open: pressure cells hold the pressure of their oil, of which the change alone says something of
the rock; nothing is said of its temperature, of the direction that a cell faces (taken as vertical: it measures
vertical stress), nor of the factor between the pressures of rock and cell. Dates are local ones.
"""

import argparse
import math
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
import yaml
from numpy.typing import NDArray

from catalogs.records.elk_creek_reader import data_folder, data_path
from catalogs.records.excel_sheets import read_sheet
from common.datasets import atomic_path
from common.errors import InputError
from response.readings import at_steps
from workflow.configuration import load_mine
from workflow.mines.elk_creek import GOB_HEIGHT, Seam, fit_seam

FOOT, INCH, PSI = 0.3048, 0.0254, 6894.757  # m, m, Pa
ZONE = "America/Denver"
GATE_ROAD = 2.6  # m, its height as the closure stations were first read.
SITES = {"1N Inby": "1 North Inby", "1N Outby": "1 North Outby", "2N Inby": "2 North Inby", "2N Outby": "2 North Outby"}
CELLS = "instrumentation/borehole_pressure_cells_and_string_pots"
STATIONS = "instrumentation/closures_and_mpbx_extensometers"
LIST = "instrumentation.csv"
PRESSURE = re.compile(r"(?P<name>\w+) cell pressure \(psi\)")
ANCHOR = re.compile(r".*roof and (?P<depth>\d+)-ft anchor--string pot\. (?P<name>M\d)-\d \(in\)", re.IGNORECASE)
COLLAR = re.compile(r"MPBX(?P<name>\d)-\d location measurement of collar to (?P<depth>\d+)-ft-deep anchor \(in\)")
STATION = re.compile(r"Floor point to roof point distance at station (?P<name>\w) \(ft\)")
LEAST_PRESSURE = 0.7e6  # Pa. Below, a cell has lost its oil; a broken one reads -10 MPa.
LARGEST_LOSS = 0.5  # Share of a cell's pressure between two readings. After more it has broken.
MISPLACED = {("1N Outby", "SP1")}  # Listed 87 m from its neighbours in one borehole row; 4231 may stand for 4321.
CELL_ERROR, LENGTH_ERROR = "0.1 MPa", "1 mm"  # Of one reading, ours: steps of the logger, and a tape.


@dataclass(frozen=True)
class Instrument:
    """An instrument and its readings.

    site: key of SITES. name: as the mine lists it. place (xy,) m. depth: of a cell in its borehole from the entry, m.
    readings: by local time, columns `value` (Pa or m)
    or, of an extensometer, one for each depth of an anchor (m) with how much farther it is from the roof; of pressure
    cells also `face`, the distance (m) of the face past the site, negative before.
    """

    site: str
    name: str
    kind: str
    place: NDArray
    readings: pd.DataFrame
    panel: str = ""
    depth: float = math.nan

    @property
    def label(self) -> str:
        """A name of its own, for files and keys."""
        return "_".join([*self.site.split(), self.name, *([f"panel_{self.panel}"] if self.panel else [])])


def read_places(folder: Path) -> pd.DataFrame:
    """The list of instruments: location, sensor, type, easting, northing (m), set pressure (psi). Raises InputError."""
    path = data_path(folder, LIST)
    try:
        table = pd.read_csv(path, encoding="utf-8-sig")
        table["sensor"] = table["sensor"].str.replace(r"^(M\d)-1$", r"\1", regex=True)  # so named at one of both sites
        return table.set_index(["location", "sensor", "type"])[
            ["easting", "northing", "borehole depth", "set pressure"]
        ]
    except (OSError, ValueError, KeyError, pd.errors.ParserError) as error:
        reason = str(error).splitlines()[0]
        raise InputError(f"{path}: not the list of instruments ({reason}); copy it again") from error


def _listed(places: pd.DataFrame, site: str, name: str, kind: str) -> pd.Series:
    """The row of an instrument in the list. Raises InputError without one."""
    if (site, name, kind) not in places.index:
        raise InputError(f"{LIST}: lists no {kind} {name} of {site}, which has readings; copy it again")
    return places.loc[(site, name, kind)]


def read_pressure_cells(folder: Path, panel: str) -> list[Instrument]:
    """Pressure cells while a panel passed, without what they read after they broke. Cells that were never set, and
    misplaced ones, are left out. Raises InputError."""
    places = read_places(folder)
    cells = []
    for site, header, body in _sheets(folder, CELLS, rf"Panel {panel} BPC"):
        time = _times(body.iloc[:, 0])
        face = pd.to_numeric(body.iloc[:, 5], errors="coerce").to_numpy(float) * FOOT
        for column, found in _columns(header, PRESSURE):
            listed = _listed(places, site, found["name"], "BPC")
            if (site, found["name"]) in MISPLACED or not listed["set pressure"] > 0.0:
                continue
            pressure = pd.to_numeric(body.iloc[:, column], errors="coerce").to_numpy(float) * PSI
            readings = pd.DataFrame({"face": face, "value": pressure}, index=time)
            readings = readings[readings.index.notna()].sort_index(kind="stable").dropna()
            place = listed[["easting", "northing"]].to_numpy(float)
            if len(whole := _until_broken(readings)):
                depth = float(listed["borehole depth"])
                cells.append(Instrument(site, found["name"], "cell", place, whole, panel, depth))
    return cells


def _until_broken(readings: pd.DataFrame) -> pd.DataFrame:
    """Readings up to the first one that is too low, or far lower than the one before."""
    pressure = readings["value"].to_numpy()
    low = pressure < LEAST_PRESSURE
    low[1:] |= pressure[1:] < (1.0 - LARGEST_LOSS) * pressure[:-1]
    return readings.iloc[: int(low.argmax())] if low.any() else readings


def read_closure_stations(folder: Path) -> list[Instrument]:
    """Closure of roof and floor, m, since the first reading of each station. Raises InputError."""
    places = read_places(folder)
    stations = []
    for site, header, body in _sheets(folder, STATIONS, "closure stations"):
        time = _dates(body.iloc[:, 0])
        for column, found in _columns(header, STATION):
            height = pd.Series(pd.to_numeric(body.iloc[:, column], errors="coerce").to_numpy(float) * FOOT, time)
            height = height[height.index.notna()].dropna()
            if len(height):
                place = _listed(places, site, found["name"], "Closure")[["easting", "northing"]].to_numpy(float)
                readings = pd.DataFrame({"value": height.iloc[0] - height})
                stations.append(Instrument(site, found["name"], "closure", place, readings))
    return stations


def read_extensometers(folder: Path, panel: str) -> list[Instrument]:
    """Extensometers in the roof: how much farther each anchor is from the collar, m. Raises InputError.

    String pots are those that were read while a panel passed. The sheets do not say their sign: what they and the other
    extensometers show as the roof parts, with deeper anchors moving more, is negative, and is taken as getting farther.
    """
    places = read_places(folder)
    found = []
    sheets = [(*sheet, ANCHOR, "SP") for sheet in _sheets(folder, CELLS, rf"Panel {panel} BPC and String Pot")]
    sheets += [(*sheet, COLLAR, "MPBX") for sheet in _sheets(folder, STATIONS, "MPBX")]
    for site, header, body, pattern, kind in sheets:
        first = pd.to_numeric(body.iloc[:, 0], errors="coerce")
        time = _times(first) if first.notna().any() else _dates(body.iloc[:, 0])
        own: dict[str, dict[float, NDArray]] = {}
        for column, match in _columns(header, pattern):
            values = -pd.to_numeric(body.iloc[:, column], errors="coerce").to_numpy(float) * INCH
            own.setdefault(match["name"], {})[int(match["depth"]) * FOOT] = values
        for name, anchors in own.items():
            readings = pd.DataFrame(anchors, index=time)
            readings = readings[readings.index.notna()].dropna(how="all").sort_index(axis=1)
            if len(readings):
                place = _listed(places, site, name, kind)[["easting", "northing"]].to_numpy(float)
                found.append(Instrument(site, name, "extensometer", place, readings - readings.bfill().iloc[0]))
    return found


def _sheets(folder: Path, below: str, what: str) -> list[tuple[str, list[str], pd.DataFrame]]:
    """Site, names of columns and rows of each workbook whose name has these words, in the order of SITES."""
    sheets = []
    for site, title in SITES.items():
        for path in sorted(data_path(folder, below).glob(f"{title} *.xlsx")):
            if not re.search(what, path.name):
                continue
            cells = read_sheet(path)
            lines = cells.astype(str).apply(lambda line: line.str.contains(r"\((?:psi|in|ft)\)")).sum(axis=1)
            row = int(lines.to_numpy().argmax())
            if not lines.iloc[row]:
                raise InputError(f"{path}: no line names columns with their units; copy it again")
            sheets.append((site, [str(name) for name in cells.iloc[row]], cells.iloc[row + 1 :]))
    return sheets


def _columns(header: Sequence[str], pattern: re.Pattern) -> list[tuple[int, re.Match]]:
    """Number of each column whose name matches."""
    return [(number, found) for number, name in enumerate(header) if (found := pattern.fullmatch(name.strip()))]


def _times(days: pd.Series) -> pd.DatetimeIndex:
    """Local times of the workbooks' serial dates, to the second."""
    serial = pd.to_numeric(days, errors="coerce")
    return pd.DatetimeIndex(pd.to_datetime(serial, unit="D", origin="1899-12-30", errors="coerce")).round("s")


def _dates(days: pd.Series) -> pd.DatetimeIndex:
    """Local midnights of days."""
    return pd.DatetimeIndex(pd.to_datetime(days, errors="coerce"))


def values_in_utc(one: Instrument) -> pd.DataFrame:
    """Readings of an instrument in MPa or mm, by time in UTC without a zone."""
    values = one.readings.drop(columns="face", errors="ignore") * (1e-6 if one.kind == "cell" else 1e3)
    values.columns = [name if isinstance(name, str) else f"anchor_{name:g}" for name in values.columns]
    local = values.index.tz_localize(ZONE, ambiguous="NaT", nonexistent="shift_forward")
    values.index = local.tz_convert("UTC").tz_localize(None).rename("date")
    return values[values.index.notna()]


def observations(instruments: Sequence[Instrument], seam: Callable[[float, float], float], since: str) -> dict:
    """The section `observations`. seam: elevation of the middle of the seam at (x, y), m; since: step at whose end the
    instruments are zeroed."""
    section: dict[str, list[dict]] = {"points": [], "closures": [], "lines": []}
    half = 0.5 * GATE_ROAD
    for one in instruments:
        shared = {"name": one.label, "file": f"{one.label}.csv", "since": since}
        elevation = seam(*one.place)
        x, y = (f"{value:g} m" for value in one.place)
        low, high = (f"{elevation + side * half:.4f} m" for side in (-1.0, 1.0))
        if one.kind == "cell":
            place = {"at": [x, y, f"{elevation:.4f} m"], "axis": {"trend": "0 deg", "plunge": "90 deg"}}
            section["points"].append(shared | place | {"units": "MPa", "error": CELL_ERROR})
        elif one.kind == "closure":
            place = {"start": [x, y, low], "end": [x, y, high]}
            section["closures"].append(shared | place | {"units": "mm", "error": LENGTH_ERROR})
        else:
            depths = list(one.readings.columns)
            place = {
                "start": [x, y, high],
                "end": [x, y, f"{elevation + half + max(depths):.4f} m"],
                "anchors": [f"{depth:g} m" for depth in depths],
                "columns": [f"anchor_{depth:g}" for depth in depths],
            }
            section["lines"].append(shared | place | {"units": "mm", "error": LENGTH_ERROR})
    return {"observations": {key: entries for key, entries in section.items() if entries}}


def write_for_mine(mine_file: Path, output: Path, panel: str) -> int:
    """Write the readings and instruments.yaml for a mine file into a folder; returns how many instruments they are.

    Raises InputError for a mine file without `excavations_from`, and where no instrument was read in its steps.
    """
    mine = load_mine(mine_file)
    made = mine.settings.excavations_from
    if made is None:
        raise InputError(f"{mine_file}: excavations_from: missing; the instruments are those of the mine Elk Creek")
    folder = data_folder(mine.path(made.folder), "excavations_from.folder")
    steps = mine.observations_slice()["steps"]
    since = next(step["name"] for step in steps if step["start"])
    read = [*read_pressure_cells(folder, panel), *read_closure_stations(folder), *read_extensometers(folder, panel)]
    tables = {one.label: values_in_utc(one) for one in read}
    kept = [one for one in read if np.isfinite(at_steps(tables[one.label], steps, since)).any()]
    if not kept:
        raise InputError(
            f"{mine_file}: excavations_from: no instrument beside panel {panel} was read in two of its steps"
        )
    height = made.gob_height or GOB_HEIGHT
    plane = fit_seam(folder) if made.floor is None else Seam((0.0, 0.0), made.floor, 0.0, 0.0, 0.0)
    section = observations(kept, lambda x, y: plane.elevation(x, y) + 0.5 * height, since)
    output.mkdir(parents=True, exist_ok=True)
    for one in kept:
        with atomic_path(output / f"{one.label}.csv") as temporary:
            tables[one.label].to_csv(temporary, float_format="%.6g", date_format="%Y-%m-%dT%H:%M:%S")
    with atomic_path(output / "instruments.yaml") as temporary:
        temporary.write_text(yaml.safe_dump(section, sort_keys=False), encoding="utf-8")
    return len(kept)


def main() -> None:
    """The command of the module's docstring."""
    parser = argparse.ArgumentParser(description="Instruments of Elk Creek as the section observations of a mine file.")
    parser.add_argument("mine_file", type=Path, help="a mine file whose excavations_from reads the Elk Creek data")
    parser.add_argument("output", type=Path, help="folder for the readings and instruments.yaml")
    parser.add_argument("--panel", default="2", help="panel whose passing pressure cells and string pots read (2)")
    given = parser.parse_args()
    try:
        count = write_for_mine(given.mine_file, given.output, given.panel)
    except InputError as error:
        raise SystemExit(str(error)) from error
    print(f"{given.output}: readings of {count} instruments, and instruments.yaml")


if __name__ == "__main__":
    main()
