"""The lines of docs/how-to/records.md that convert other formats, run on small files of these formats."""

import re
import warnings
from pathlib import Path

import numpy as np
import pytest
from catalog_fixtures import SETTINGS
from obspy import UTCDateTime
from obspy.core.event import Catalog, Event, Magnitude, Origin
from scipy.io import savemat

from catalogs.records import read_record
from catalogs.sources.geographic_frame import MineFrame

PAGE = Path(__file__).parents[2] / "docs/how-to/records.md"
TIMES = np.array(["2019-08-01T12:00:00.25", "2019-08-13T00:00:00.5"], "datetime64[ns]")
LOCATIONS = np.array([[100.5, 200.0, -300.0], [110.0, 1200.0, -310.0]])
MAGNITUDES = np.array([-0.5, 1.25])
IN_FILE = {"time": "time", "x": "x", "y": "y", "z": "z", "mw": "mw"}
HYPOCENTRE = """NLLOC "./loc/mine.grid0" "LOCATED" "Location completed."
SIGNATURE "A mine   NLLoc:v7.00.00 21Jun2023 12h53m34"
COMMENT "mine"
HYPOCENTER  x {x} y {y} z {z}  T0 {second}  ix -1 iy -1 iz -1
GEOGRAPHIC  T0 {date} {second}  Lat -41.8 Long 145.4 Depth {z}
STATISTICS  ExpectX 0 Y 0 Z 0  CovXX 1e-4 XY 0 XZ 0 YY 1e-4 YZ 0 ZZ 1e-4 EllAz1  0 Dip1  0 Len1  1 Az2  0 Dip2  0 Len2  1 Len3  1
QML_OriginQuality  assocPhCt 5  usedPhCt 5  assocStaCt -1  usedStaCt 5  depthPhCt -1  stdErr 0.004  azGap 156.3  secAzGap 227.4  gtLevel -  minDist 0.4 maxDist 1.6 medDist 0.9
QML_OriginUncertainty  horUnc -1  minHorUnc 0.1  maxHorUnc 0.2  azMaxHorUnc 69.9
END_NLLOC
"""  # noqa: E501


@pytest.fixture
def convert(tmp_path, monkeypatch):
    """A function that runs the lines below a bold name of the page, in the folder of the test."""
    monkeypatch.chdir(tmp_path)

    def run(name: str) -> None:
        lines = re.search(rf"\*\*{name}.*?```python\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            exec(lines[1], {})

    return run


def events(extra: bool = False) -> Catalog:
    """ObsPy's catalogue of the two events; extra: with x, y and z in a name space of another program."""
    found = []
    globe = MineFrame(SETTINGS["frame"]).to_globe(LOCATIONS)
    for time, place, latitude, longitude, depth, mw in zip(TIMES, LOCATIONS, *globe, MAGNITUDES, strict=True):
        origin = Origin(time=UTCDateTime(str(time)), latitude=latitude, longitude=longitude, depth=depth)
        if extra:
            origin.extra = {
                key: {"value": repr(float(value)), "namespace": "urn:m"}
                for key, value in zip("xyz", place, strict=True)
            }
        magnitude = Magnitude(mag=mw, magnitude_type="Mw", origin_id=origin.resource_id)
        event = Event(origins=[origin], magnitudes=[magnitude])
        event.preferred_origin_id, event.preferred_magnitude_id = origin.resource_id, magnitude.resource_id
        found.append(event)
    return Catalog(found)


def assert_record(tolerance: float, **settings) -> None:
    record = read_record(SETTINGS | settings)
    assert np.abs(record["time"].values - TIMES).max() < np.timedelta64(1, "ms")
    np.testing.assert_allclose(record["location"], LOCATIONS, atol=tolerance)
    np.testing.assert_allclose(record["mw"], MAGNITUDES)


def test_seiscomp(convert, tmp_path):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        events().write(str(tmp_path / "record.scml"), format="SCML")
    convert("SeisComp")
    assert_record(1e-3, reader="quakeml", file="record.xml")


def test_quakeml_with_mine_coordinates_in_another_name_space(convert, tmp_path):
    events(extra=True).write(str(tmp_path / "mine.xml"), format="QUAKEML", nsmap={"m": "urn:m"})
    convert("QuakeML with mine coordinates")
    assert_record(0, reader="csv", file="record.csv", columns=IN_FILE)


def test_nonlinloc_in_its_grid_with_sizes_added(convert, tmp_path):
    (tmp_path / "loc").mkdir()
    for number, (time, (x, y, z)) in enumerate(zip(TIMES, LOCATIONS / 1000, strict=True)):
        at = UTCDateTime(str(time))
        text = HYPOCENTRE.format(
            x=x, y=y, z=-z, date=at.strftime("%Y %m %d  %H %M"), second=at.second + at.microsecond / 1e6
        )
        (tmp_path / f"loc/{number}.hyp").write_text(text)
    convert("NonLinLoc")
    lines = (tmp_path / "record.csv").read_text().splitlines()
    sizes = dict(zip(("0.25", "0.5"), MAGNITUDES, strict=True))
    added = [f"{line},{next(mw for second, mw in sizes.items() if f':00.{second[2:]}' in line)}" for line in lines[1:]]
    (tmp_path / "record.csv").write_text("\n".join([f"{lines[0]},mw", *sorted(added)]) + "\n")
    assert_record(1e-6, reader="csv", file="record.csv", columns=IN_FILE)


def test_episodes(convert, tmp_path):
    latitude, longitude, depth = MineFrame(SETTINGS["frame"]).to_globe(LOCATIONS)
    days = (TIMES - np.datetime64("1970-01-01")) / np.timedelta64(1, "D") + 719529
    columns = {"ID": np.array(["a", "b"], object), "Time": days, "Lat": latitude, "Long": longitude}
    columns |= {"Depth": depth / 1000, "Mw": MAGNITUDES, "ML": np.full(2, np.nan)}
    kind = [("field", object), ("val", object)]
    rows = [(name, values[:, None]) for name, values in columns.items()]
    savemat(tmp_path / "catalog.mat", {"Catalog": np.array(rows, dtype=kind)})
    convert("EPISODES")
    named = {"time": "Time", "latitude": "Lat", "longitude": "Long", "depth": "Depth", "mw": "Mw"}
    assert_record(1e-3, reader="csv", file="record.csv", columns=named, time_format="matlab", units={"depth": "km"})
