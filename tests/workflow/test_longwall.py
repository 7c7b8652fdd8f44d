"""Slices of a longwall: what each mines, between faces that are dated and ends of slices that are not."""

import itertools

import numpy as np
import pandas as pd
import pytest
from areas import polygon_area
from hypothesis import given
from hypothesis import strategies as st
from tiny_mines import TINY

from common.errors import InputError
from workflow.mines.longwall import HISTORY, Panel, advances, seconds, slices_of

WIDTH = 240.0


def day(text: str) -> pd.Timestamp:
    return pd.Timestamp(text)


def panel(name: str, y: float, faces: dict[str, float]) -> Panel:
    """Parallel faces across y, by date: their x in m. The headgate is 70 m ahead."""
    dates = np.array([seconds(day(text)) for text in faces])
    x = np.array(list(faces.values()), float)
    tailgate = np.column_stack([x, np.full(len(x), y)])
    return Panel(name, dates, tailgate, tailgate + np.array([70.0, WIDTH]))


# 10 m a day in August and September, none in October, 5 m a day in November.
PANELS = [
    panel("1", 0.0, {"2010-01-01": 0.0, "2010-03-01": 600.0}),
    panel("2", 300.0, {"2010-08-02": 0.0, "2010-09-11": 400.0, "2010-10-01": 600.0}),
    panel("2b", 300.0, {"2010-11-01": 700.0, "2010-12-01": 850.0}),
]
PERIOD = day("2010-08-22"), day("2010-11-21")


def mined(by, period=PERIOD) -> dict[str, float]:
    """Length that each step mines, m."""
    total: dict[str, float] = {}
    for advance in advances(PANELS, slices_of(PANELS, *period, by)):
        total[advance.step] = total.get(advance.step, 0.0) + abs(polygon_area(advance.polygon)) / WIDTH
    return total


def test_months_begin_with_the_period_and_then_with_the_calendar():
    """The faces of 1 September and of the period's ends are not dated: they lie between those that are."""
    slices = slices_of(PANELS, *PERIOD, "month")
    assert [part.name for part in slices] == ["2010-08", "2010-09", "2010-10", "2010-11"]
    assert [f"{part.start:%m-%d}" for part in slices] == ["08-22", "09-01", "10-01", "11-01"]
    expected = {HISTORY: 600.0 + 200.0, "2010-08": 100.0, "2010-09": 300.0, "2010-11": 100.0}
    assert mined("month") == pytest.approx(expected)


def test_weeks_run_from_the_start_of_the_period():
    slices = slices_of(PANELS, *PERIOD, "week")
    assert [part.name for part in slices] == [
        f"{date:%Y-%m-%d}" for date in pd.date_range("2010-08-22", periods=13, freq="7D")
    ]
    found = mined("week")
    assert found["2010-08-29"] == pytest.approx(70.0)
    assert found["2010-11-07"] == pytest.approx(35.0)
    assert "2010-10-10" not in found  # no face moves


def test_metres_are_equal_parts_of_the_advance():
    """500 m in parts of about 60 m: 8 of 62.5 m, to the minute that their ends are rounded to."""
    slices = slices_of(PANELS, *PERIOD, 60.0)
    assert [part.name for part in slices][:3] == ["0000_m", "0062_m", "0125_m"]
    found = mined(60.0)
    del found[HISTORY]
    assert list(found.values()) == pytest.approx([62.5] * 8, abs=0.01)
    assert len(slices_of(PANELS, *PERIOD, 1e4)) == 1


periods = st.tuples(st.integers(0, 333), st.integers(1, 333)).map(
    lambda days: (day("2010-01-01") + pd.Timedelta(days=min(days)), day("2010-01-01") + pd.Timedelta(days=max(days)))
)


@given(periods, st.sampled_from(["month", "week"]) | st.floats(10.0, 500.0))
def test_slices_tile_the_period_and_their_prisms_what_is_mined(period, by):
    """However a period is cut: no gap, names of their own, and the area that was mined by its end."""
    first, last = period
    advanced = sum(one.advance(np.array([seconds(date) for date in period])) for one in PANELS)
    if first == last or advanced[0] == advanced[1]:
        with pytest.raises(InputError):
            slices_of(PANELS, first, last, by)
        return
    slices = slices_of(PANELS, first, last, by)
    assert (slices[0].start, slices[-1].end) == period
    assert all(part.end == later.start for part, later in itertools.pairwise(slices))
    assert all(part.start < part.end for part in slices)
    assert len({part.name for part in slices}) == len(slices)
    found = list(advances(PANELS, slices))
    assert len({one.name for one in found}) == len(found)
    assert {one.step for one in found} <= {HISTORY, *(part.name for part in slices)}
    length = [abs(polygon_area(one.polygon)) / WIDTH for one in found]
    assert sum(length) == pytest.approx(advanced[1], abs=1e-6)
    before = [own for one, own in zip(found, length, strict=True) if one.step == HISTORY]
    assert sum(before) == pytest.approx(advanced[0], abs=1e-6)


@pytest.mark.parametrize(
    ("period", "line"),
    [
        (("2010-09-01", "2010-09-01"), r"end: 2010-09-01 is not after start 2010-09-01"),
        (("2009-12-31", "2010-09-01"), r"start: 2009-12-31, but faces are dated from 2010-01-01 to 2010-12-01"),
        (("2010-09-01", "2010-12-02"), r"end: 2010-12-02, but faces are dated from"),
        (("2010-10-02", "2010-10-20"), r"excavations_from: no face moves from start 2010-10-02"),
    ],
)
def test_a_period_without_faces_or_advance_is_refused(period, line):
    with pytest.raises(InputError, match=line):
        slices_of(PANELS, *map(day, period), "month")


FACES = """local_date,headgate_x,headgate_y,tailgate_x,tailgate_y,panel
2010-01-01,10,20,10,60,1
2010-02-01,30,20,30,60,1
2010-03-01,50,20,50,60,1
2010-04-01,70,20,70,60,1
"""


@pytest.mark.parametrize(
    ("values", "line"),
    [
        ({"fill": "paste"}, "excavations_from.fill: 'paste' is not one of the materials host, fill, none"),
        ({"fill": "host"}, "excavations_from.fill: 'host' is coulomb; only elastic fill"),
        ({"floor": "900 m"}, "excavations_from: panel_1_2010-01-01: lies, as all others do, outside the domain"),
    ],
)
def test_a_mistake_is_told_once_under_the_key_that_was_written(refuse, tmp_path, monkeypatch, values, line):
    """Not for each of the prisms, of which the file has none."""
    monkeypatch.delenv("ELK_CREEK_DATA", raising=False)
    data = tmp_path / "data"
    (data / "ims_events").mkdir(parents=True)
    (data / "ims_events/a.parquet").touch()
    (data / "face_positions.csv").write_text(FACES)
    mine = {key: value for key, value in TINY.items() if key not in ("steps", "excavations", "record")}
    made = {"source": "elk_creek", "folder": "data", "start": "2010-02-01", "end": "2010-04-01"}
    made |= {"gob_height": "20 m", "floor": "30 m", "fill": "fill"}
    assert refuse(mine, excavations_from=made | values).startswith(line)
