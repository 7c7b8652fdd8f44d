"""Instruments in fields that are known: stress along any axis, extension, closure; their readings; mistakes."""

import tracemalloc

import numpy as np
import pandas as pd
import pytest
from small_mines import load, moved_by, states_of, with_failed

from catalogs.report.sections.observations import instrument_line, misfit_interval
from common.errors import InputError
from common.observation_table import FIELDS, READING_FIELDS
from response.observation_settings import ObservationSlice
from response.observations import observe, tabulate_readings
from response.table_csv import write_csv
from workflow.configuration import load_mine
from workflow.rule_resources import BYTES_PER_CELL, BYTES_PER_PARTICLE, observation_bytes

ROOM = {"name": "room", "shape": "box", "lower": ["-4 m", "-3 m", "-2 m"], "upper": ["4 m", "3 m", "2 m"]}
STEPS = [{"name": "history"}, {"name": "a", "start": "2020-01-01", "end": "2020-02-01"}]
STEPS += [{"name": "b", "start": "2020-02-01", "end": "2020-03-01"}]
GRADIENT = np.array([[1e-4, 2e-5, 0.0], [-3e-5, -2e-4, 4e-5], [1e-5, 0.0, 3e-4]])
MARKS = {"start": ["-4 m", "0 m", "0 m"], "end": ["4 m", "1 m", "0.5 m"]}


def observed(folder, instruments, gradients=(0.0, 1.0, 2.0), **more):
    """Table of observations of a room, in states moved by multiples of GRADIENT."""
    mine = load(folder, [ROOM], steps=STEPS, observations=instruments, **more)
    grid, state = states_of(mine, folder)
    states = [moved_by(state, factor * GRADIENT, np.ones(3)) for factor in gradients]
    table = observe(ObservationSlice.of(mine.observations_slice()), grid, states)
    counted = mine.settings.observations.instruments
    assert table.sizes["row"] == len(gradients) * sum(one.places * one.components for one in counted)
    assert set(table) == {field.name for field in FIELDS}
    return table


def test_an_extensometer_and_a_closure_read_a_linear_field(tmp_path):
    """Extension along the line, closure positive where marks come nearer; both from the step `since` on."""
    line = {"name": "mpbx", "start": ["5 m", "0 m", "0 m"], "end": ["5 m", "8 m", "6 m"], "anchors": ["2 m", "8 m"]}
    table = observed(tmp_path, {"lines": [line], "closures": [MARKS | {"name": "c", "since": "a"}]})
    along = np.array([0.0, 0.8, 0.6])
    strain = float(along @ GRADIENT @ along)
    extension = table["modelled"].values[table["instrument"].values == "mpbx"].reshape(2, 3)
    np.testing.assert_allclose(extension, 1e3 * strain * np.outer([2.0, 8.0], [0.0, 1.0, 2.0]), atol=1e-4)
    between = np.array([8.0, 1.0, 0.5])
    closing = -float(between @ GRADIENT @ between) / np.linalg.norm(between)
    closure = table["modelled"].values[table["instrument"].values == "c"]
    np.testing.assert_allclose(closure[1:], 1e3 * closing * np.array([0.0, 1.0]), atol=1e-4)
    assert np.isnan(closure[0])


def test_a_cell_reads_compression_along_its_axis(tmp_path):
    """Virgin stress far from the room: -10, -20 and -15 MPa along east, north and up."""
    far = {"at": ["12 m", "12 m", "12 m"]}
    points = [
        far | {"name": name, "axis": axis}
        for name, axis in (
            ("east", {"trend": "90 deg"}),
            ("north", {"trend": "0 deg"}),
            ("down", {"trend": "30 deg", "plunge": "90 deg"}),
            ("between", {"trend": "45 deg"}),
        )
    ]
    table = observed(tmp_path, {"points": [*points, far | {"name": "all"}]})
    first = table.isel(row=np.flatnonzero(table["step"].values == "history"))
    found = dict(zip(first["instrument"].values[:4].tolist(), first["modelled"].values[:4].tolist(), strict=True))
    assert found == pytest.approx({"east": 10.0, "north": 20.0, "down": 15.0, "between": 15.0}, abs=0.4)
    every = first.isel(row=slice(4, None))
    values = dict(zip(every["quantity"].values.tolist(), every["modelled"].values.tolist(), strict=True))
    assert values["stress xx"] == pytest.approx(-10.0, abs=0.4)
    assert values["major compression"] == pytest.approx(20.0, abs=0.4)
    assert values["minor compression"] == pytest.approx(10.0, abs=0.4)


def test_readings_are_the_last_of_each_step_in_the_models_unit(tmp_path):
    """Centimetres, out of order, zeroed at the end of step a; a month without a reading has none."""
    rows = [("2020-02-20", 3.0), ("2020-01-10", 0.5), ("2020-01-31T12:00", 1.0), ("2020-04-01", 9.0)]
    pd.DataFrame(rows, columns=["day", "gap"]).to_csv(tmp_path / "c.csv", index=False)
    mark = MARKS | {"name": "c", "since": "a", "file": "c.csv", "units": "cm", "error": "1 mm", "date": "day"}
    table = observed(tmp_path, {"closures": [mark | {"columns": ["gap"]}]})
    np.testing.assert_allclose(table["measured"].values, [np.nan, np.nan, 20.0])  # the zero is no reading
    np.testing.assert_allclose(table["measured_error"].values, [np.nan, np.nan, np.sqrt(2.0)])
    line = instrument_line(table, "c")
    assert line.readings == 1
    assert line.misfit == pytest.approx(abs(20.0 - table["modelled"].values[2]))


def test_readings_of_a_calibration_are_raw_and_match_the_models_rows(tmp_path):
    """As read in MPa or mm, from the step `since` on, no error where none is stated; row by row as the model's."""
    pd.DataFrame([("2020-01-10", 0.5), ("2020-02-20", 3.0)], columns=["date", "value"]).to_csv(tmp_path / "c.csv")
    rows = [("2020-01-10", 1.0, 2.0), ("2020-02-20", 1.5, 4.0)]
    pd.DataFrame(rows, columns=["date", "a", "b"]).to_csv(tmp_path / "m.csv")
    line = LINE | {"file": "m.csv", "units": "mm", "error": "0.2 mm", "columns": ["a", "b"], "since": "b"}
    instruments = {"closures": [MARKS | {"name": "c", "file": "c.csv", "units": "cm"}], "lines": [line]}
    mine = load(tmp_path, [ROOM], steps=STEPS, observations=instruments)
    settings = ObservationSlice.of(mine.observations_slice())
    table = tabulate_readings(settings)
    assert set(table) == {field.name for field in READING_FIELDS}
    nan = np.nan
    np.testing.assert_allclose(table["measured"].values, [nan, nan, 1.5, nan, nan, 4.0, nan, 5.0, 30.0])
    np.testing.assert_allclose(table["measured_error"].values, [0.2] * 6 + [nan] * 3)
    assert table["zeroed"].values.tolist() == [1] * 6 + [0] * 3
    modelled = observed(tmp_path, instruments)
    for key in ("instrument", "distance", "step", "unit"):
        np.testing.assert_array_equal(table[key].values, modelled[key].values)


def test_a_share_within_errors_needs_a_stated_error(tmp_path):
    """Without one the report has a misfit and no share."""
    pd.DataFrame([("2020-01-10", 0.5)], columns=["date", "value"]).to_csv(tmp_path / "c.csv")
    line = instrument_line(
        observed(tmp_path, {"closures": [MARKS | {"name": "c", "file": "c.csv", "units": "cm"}]}), "c"
    )
    assert (line.readings, np.isfinite(line.misfit), np.isnan(line.within)) == (1, True, True)


def test_the_interval_of_a_misfit_covers():
    """Normal misfits of known standard deviation: 95 of 100 intervals hold it."""
    generator, held = np.random.default_rng(4), 0
    for _ in range(2000):
        low, high = misfit_interval(float(np.sqrt(np.mean(generator.normal(size=6) ** 2))), 6)
        held += low <= 1.0 <= high
    assert held / 2000 == pytest.approx(0.95, abs=0.015)
    assert np.isnan(misfit_interval(np.nan, 0)).all()


CELL = {"name": "SC1", "at": ["8 m", "0 m", "0 m"], "axis": {"trend": "90 deg"}}
READ = {"file": "r.csv", "units": "MPa", "error": "0.5 MPa"}
LINE = {"name": "M", "start": ["5 m", "0 m", "0 m"], "end": ["9 m", "0 m", "0 m"], "anchors": ["1 m", "3 m"]}
DATES = {"columns": ["date"]}
MISTAKES = {
    "in mined rock": ({"points": [CELL | {"at": ["0 m", "0 m", "0 m"]}]}, "is inside room; put it into rock"),
    "outside": ({"points": [CELL | {"at": ["99 m", "0 m", "0 m"]}]}, "outside the domain"),
    "wrong unit": ({"points": [CELL | READ | {"units": "mm"}]}, "units: '1 mm' is no stress"),
    "no unit": ({"points": [CELL | {"file": "r.csv", "error": "1 MPa"}]}, "units: missing; readings need it"),
    "no error": ({"points": [CELL | READ | {"error": "0 MPa"}]}, "a reading has an error above zero"),
    "no axis": ({"points": [{key: CELL[key] for key in ("name", "at")} | READ]}, "axis: missing"),
    "no file": ({"points": [CELL | READ | {"file": "none.csv"}]}, "no such file"),
    "no column": ({"points": [CELL | READ | {"columns": ["load"]}]}, "has no column load; it has date, value"),
    "no date": ({"points": [CELL | READ | {"date": "value"}]}, "row 1: 1.5 is no date"),
    "no number": ({"points": [CELL | READ | DATES]}, "row 1, date: 2020-01-05 is no number"),
    "one column twice": ({"points": [CELL | READ, CELL | READ | {"name": "SC2"}]}, "is that of observations.points[0]"),
    "one name twice": ({"points": [CELL, CELL]}, "two instruments are called"),
    "unknown step": ({"points": [CELL | {"since": "aa"}]}, "no step aa; did you mean a?"),
    "undated step": ({"points": [CELL | READ | {"since": "history"}]}, "history has no dates"),
    "anchor beyond": ({"lines": [LINE | {"anchors": ["1 m", "30 m"]}]}, "an anchor at 30 m is beyond the end, 4 m"),
    "anchors and columns": ({"lines": [LINE | READ | {"units": "mm", "error": "1 mm"}]}, "1 columns for 2 anchors"),
    "no length": ({"lines": [LINE | {"end": LINE["start"]}]}, "the same point as where the line starts"),
    "too many points": ({"lines": [{**LINE, "anchors": None, "every": "0.0001 m"}]}, "more than 10000 points"),
    "one mark": ({"closures": [MARKS | {"name": "c", "end": MARKS["start"]}]}, "the same point as the other mark"),
}  # fmt: skip


FILES = {  # What a file of readings may have, and the line that it is refused with.
    "no step": ("date,value\n2010-01-05,1.5\n", {}, "no reading is within the dates of a step"),
    "no zero": (
        "date,value\n2020-02-05,1.5\n",
        {"since": "a"},
        "no reading of value is within the dates of a, from which",
    ),
    "decimal comma": ("date,value\n2020-01-05,1,5\n2020-01-06,2,5\n", {}, "rows have more fields than"),
    "no rows": ("date,value\n", {}, "no reading is within the dates of a step"),
    "a code of a missing reading": (
        "date,value\n2020-01-05,1.5\n2020-01-06,2.5\n2020-02-05,-999\n",
        {},
        "value: is -999 a missing reading",
    ),
    "infinite": ("date,value\n2020-01-05,inf\n", {}, "row 1, value: inf is no number"),
}


def test_an_anchor_without_a_zero_is_refused(tmp_path):
    """Another anchor has one: it would be left out without a word."""
    (tmp_path / "r.csv").write_text("date,a,b\n2020-01-05,1.0,\n2020-02-05,1.5,2.0\n")
    line = LINE | READ | {"units": "mm", "error": "1 mm", "columns": ["a", "b"], "since": "a"}
    with pytest.raises(InputError, match="no reading of b is within the dates of a, from which"):
        load(tmp_path, [ROOM], steps=STEPS, observations={"lines": [line]})


def test_a_step_after_a_collapse_has_no_values(tmp_path):
    """Its state is that of the step before, which is no result of this one."""
    mine = load(tmp_path, [ROOM], steps=STEPS, observations={"closures": [MARKS | {"name": "c"}], "points": [CELL]})
    grid, state = states_of(mine, tmp_path)
    failed = with_failed(moved_by(state, GRADIENT, np.ones(3)), state["volume"].values > 0.0)
    states = [state, failed, failed.assign_attrs(computed=0)]
    table = observe(ObservationSlice.of(mine.observations_slice()), grid, states)
    is_last = table["step"].values == "b"
    assert np.isnan(table["modelled"].values[is_last]).all()
    assert np.isfinite(table["modelled"].values[~is_last]).all()
    line = instrument_line(table, "SC1")
    assert (line.readings, line.failed, line.cell) == (0, True, 2.0)  # of the step before


@pytest.mark.parametrize("case", FILES)
def test_a_file_of_readings_is_refused_in_one_line(tmp_path, case):
    text, keys, expected = FILES[case]
    (tmp_path / "r.csv").write_text(text)
    with pytest.raises(InputError, match=expected):
        load(tmp_path, [ROOM], steps=STEPS, observations={"points": [CELL | READ | keys]})


def test_a_point_that_is_mined_later_is_taken(tmp_path):
    """A cell in a pillar that step b mines, and a line along a planned stope."""
    later = ROOM | {"name": "later", "lower": ["6 m", "-3 m", "-2 m"], "upper": ["12 m", "3 m", "2 m"]}
    stress = {"name": "hole", "start": ["7 m", "0 m", "0 m"], "end": ["11 m", "0 m", "0 m"], "measures": "stress"}
    for step in ("b", "planned"):
        load(
            tmp_path, [ROOM, later | {"step": step}], steps=STEPS,
            observations={"points": [CELL], "lines": [stress | {"every": "1 m"}]},
        )  # fmt: skip


def test_a_mark_on_the_top_of_the_domain_has_values(tmp_path):
    points = [
        {"name": name, "at": ["0 m", "0 m", z], "measures": "displacement"}
        for name, z in (("a", "16 m"), ("b", "-16 m"))
    ]
    assert np.isfinite(observed(tmp_path, {"points": points})["modelled"].values).all()


@pytest.mark.parametrize("points", [100, 4000])
def test_a_long_line_takes_the_memory_that_its_rule_asks_for(tmp_path, points):
    """Stress at many points and many steps: the peak is below, and not far below."""
    line = {"name": "hole", "start": ["5 m", "-10 m", "0 m"], "end": ["5 m", "10 m", "0 m"], "measures": "stress"}
    steps = [*({"name": f"before_{number}"} for number in range(7)), *STEPS]
    mine = load(tmp_path, [ROOM], steps=steps, observations={"lines": [line | {"every": f"{20 / points} m"}]})
    grid, state = states_of(mine, tmp_path)
    settings = ObservationSlice.of(mine.observations_slice())
    observe(settings, grid, [state] * len(steps))  # what is imported and compiled once is not counted
    tracemalloc.start()
    observe(settings, grid, [state] * len(steps))
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    of_state = BYTES_PER_PARTICLE["observations"] * state.sizes["particle"] + BYTES_PER_CELL * state.sizes["cell"]
    assert peak <= observation_bytes(mine) + of_state
    if points > 1000:
        assert peak > 0.2 * observation_bytes(mine)


def test_names_with_commas_are_read_again(tmp_path):
    table = observed(tmp_path, {"points": [CELL | {"name": 'SC "1", north'}]})
    write_csv(table, FIELDS, tmp_path / "table.csv")
    again = pd.read_csv(tmp_path / "table.csv")
    assert again["instrument"].tolist() == ['SC "1", north'] * 3
    np.testing.assert_allclose(again["modelled"], table["modelled"].values, rtol=1e-5)


@pytest.mark.parametrize("mistake", MISTAKES)
def test_a_mistake_is_one_line(tmp_path, mistake):
    instruments, expected = MISTAKES[mistake]
    instruments = {
        kind: [{key: value for key, value in one.items() if value is not None} for one in own]
        for kind, own in instruments.items()
    }
    (tmp_path / "r.csv").write_text("date,value\n2020-01-05,1.5\n")
    with pytest.raises(InputError) as raised:
        load(tmp_path, [ROOM], steps=STEPS, observations=instruments)
    (line,) = raised.value.lines
    assert "observations" in line
    assert expected in line


def test_a_mine_in_a_plane_has_no_instruments(tmp_path):
    with pytest.raises(InputError, match="instruments need a mine in three dimensions"):
        load(
            tmp_path, [{"name": "hole", "shape": "circle", "center": ["0 m", "0 m"], "radius": "3 m"}], plane="xy",
            domain={"lower": ["-16 m", "-16 m"], "upper": ["16 m", "16 m"]}, observations={"points": [CELL]},
        )  # fmt: skip


def test_places_are_in_the_grid_of_the_mine(tmp_path):
    """A grid turned by 90 degrees: x of the file is north, y is west."""
    grid = {"angle": "90 deg", "origin": {"grid": ["0 m", "0 m"], "map": ["0 m", "0 m"]}}
    load(tmp_path, [ROOM], observations={"points": [CELL]})
    text = (tmp_path / "small.yaml").read_text().replace("surface: 0 m", f"surface: 0 m\n  grid: {grid}")
    (tmp_path / "turned.yaml").write_text(text)
    point = load_mine(tmp_path / "turned.yaml").settings.observations.points[0]
    assert abs(point.at[0]) < 1e-9
    assert abs(point.at[1]) == pytest.approx(8.0)
