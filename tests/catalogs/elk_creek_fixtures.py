"""A tiny folder of the layout of the Elk Creek data, whose answers are known, and where the recorded data are."""

import os
from pathlib import Path

import ezdxf
import numpy as np
import pandas as pd
import pytest

from catalogs.records import elk_creek_reader as record

ROOT = Path(__file__).resolve().parents[2]
LEVEL, EAST, NORTH = 1800.0, -0.01, -0.05  # the synthetic seam: elevation at (10000, 5000), slopes


def recorded_data():
    """The folder of the recorded data; skips the test where there is none."""
    named = Path(os.environ.get(record.ENVIRONMENT_VARIABLE) or ROOT / "data/elk_creek")
    if not (named / "ims_events").is_dir() and not (named / "events/ims_events").is_dir():
        pytest.skip(f"no Elk Creek data in {named}: see record.file in config/mines/elk_creek.yaml")
    return named


def seam(x, y):
    return LEVEL + EAST * (x - 10000) + NORTH * (y - 5000)


def ims_frame(times, location, moment, residual):
    columns = dict(zip(record.COORDINATES, np.transpose(location), strict=True))
    return pd.DataFrame({"Date": times, **columns, "Moment Total": moment, "Location Residual": residual})


def write_tiny_mine(folder):
    """40 IMS events in September 2010 and one in August; each of September has a reprocessed twin 100 m to the north.

    Every fourth twin has a location error of 200 m; the tensors have xy = 3, zz = -4 (times 1e9) and nothing else.
    Two panels dip on one plane: panel 1 mined 2010-01 to 2010-03, panel 2 from 2010-08-20 on.
    """
    count = 40
    day = pd.Timestamp("2010-09-01") + pd.to_timedelta(np.arange(count) * 16, unit="h")
    text = [f"{time:%Y-%m-%d %H:%M:%S}" + (".250" if index % 2 else "") for index, time in enumerate(day)]
    location = np.column_stack([10000.0 + np.arange(count), np.full(count, 5000.0), np.full(count, 1800.0)])
    september = ims_frame(text, location, 33e9 * 10.0 ** np.arange(count), np.linspace(5, 83, count))
    august = ims_frame(["2010-08-31 23:59:59.999"], [[10000.0, 5000.0, 1800.0]], [1e9], [1.0])
    for name, frame in (("2010-09", september), ("2010-08", august)):
        path = folder / f"ims_events/{name}_ims.parquet"
        path.parent.mkdir(exist_ok=True)
        frame.to_parquet(path)

    twin = pd.DataFrame(
        {"Date": text, **dict(zip(record.COORDINATES, (location + np.array([0, 100, 0])).T, strict=True))}
    )
    twin["Location Error"] = np.where(np.arange(count) % 4 == 0, 200.0, 50.0)
    for place, name in record.TENSOR_COLUMNS.items():
        twin[name] = {(0, 1): 3e9, (2, 2): -4e9}.get(place, 0.0)
    (folder / "rocksigma_events").mkdir()
    twin.to_parquet(folder / "rocksigma_events/2010-09_rocksigma.parquet")

    faces = [("2010-01-01", 10000, "1"), ("2010-02-01", 10300, "1"), ("2010-03-01", 10500, "1")]
    faces += [("2010-08-20", 10000, "2"), ("2010-09-01", 10100, "2"), ("2010-10-01", 10350, "2")]
    faces += [("2010-11-01", 10500, "2"), ("2010-12-01", 10600, "2"), ("2011-01-01", 10800, "2")]
    faces += [("2011-02-01", 11000, "2"), ("2011-04-01", 11200, "2b"), ("2011-05-01", 11300, "2b")]
    lines = ["local_date,headgate_x,headgate_y,tailgate_x,tailgate_y,panel,notes"]
    for date, x, panel in faces:
        y = {"1": 4500, "2": 5000, "2b": 5000}[panel]
        lines.append(f"{date},{x + 70},{y + 240},{x},{y},{panel},")
    (folder / "face_positions.csv").write_text("\ufeff" + "\r\n".join(lines) + "\r\n", encoding="utf-8")

    corners = [(9000, 4000), (12000, 4000), (12000, 6000), (9500, 6000)]
    stations = [f"{x},{y},{seam(x, y)},True" for x, y in corners] + ["10000,5000,2500,False"]
    (folder / "station_list.csv").write_text("\n".join(["x,y,z,underground", *stations]) + "\n")
    drawing = ezdxf.new()
    outline = [(10000, 4500), (10500, 4500), (10500, 4740), (10000, 4740)]
    drawing.modelspace().add_lwpolyline(outline, close=True, dxfattribs={"elevation": seam(10250, 4620)})
    (folder / "dxfs").mkdir()
    drawing.saveas(folder / "dxfs/placeholder_workings.dxf")
    return folder
