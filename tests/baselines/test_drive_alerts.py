"""Alarms by metres of drives: metres in cells against closed forms, and shares on alert against counting."""

import json

import numpy as np
import pytest
import xarray as xr
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from test_alerts import BOX, END, START, maps_of, model_of, months_of, record

from baselines.alert_report import CURVE_SHARES, alert_rows, alert_sentences, draw_molchan, drive_rows, write_alerts
from baselines.alerts import AlertCells, AlertScores, alert_shares, find_alerts, find_drive_alerts
from baselines.drives import NEVER, DriveMetres, pieces
from baselines.month_maps import Places
from baselines.settings import Drive
from response.centre_lines import CentreLine

EVERYWHERE = np.array([[-990.0, 0.0, 0.0], [990.0, 0.0, 0.0]])


def drives_along(*paths: np.ndarray, mined: int = -1, filled: int = NEVER) -> DriveMetres:
    """Drives along these points (k, xyz), all mined and filled in the same steps."""
    found = [pieces(CentreLine(np.asarray(path, float)), 1.0) for path in paths]
    place, metres = (np.concatenate(column) for column in zip(*found, strict=True))
    return DriveMetres(place, metres, np.full(len(metres), mined), np.full(len(metres), filled))


def scored(more: np.ndarray, as_many: np.ndarray) -> AlertScores:
    count = len(more)
    return AlertScores(("map",), (more[None],), (as_many[None],), np.zeros(count, int), np.arange(count))


# ---- metres in cells ----


@settings(deadline=None, max_examples=40)
@given(
    points=arrays(float, (4, 3), elements=st.floats(-400.0, 400.0)),
    seed=st.integers(0, 1000),
    edge=st.floats(0.5, 50.0),
)
def test_pieces_add_up_to_the_length_in_space(points, seed, edge):
    """Of any line; no piece is longer than asked for, and backwards they are the same."""
    if (np.linalg.norm(np.diff(points, axis=0), axis=1) < 1.0).any():
        return
    line = CentreLine(points)
    place, metres = pieces(line, edge)
    assert metres.sum() == pytest.approx(line.length)
    assert metres.max() <= edge * (1 + 1e-9)
    back, own = pieces(CentreLine(points[::-1].copy()), edge)
    np.testing.assert_allclose(np.sort(own), np.sort(metres))
    np.testing.assert_allclose(metres @ place, own @ back, rtol=1e-6, atol=1e-6 * line.length)


def test_a_straight_drive_has_its_length_in_each_cell():
    """Along x through cells of 100 m, dipping by 3 in 4: 125 m of drive in each; a raise has all in one cell."""
    cells = AlertCells(BOX, (20, 20))
    dipping = drives_along([[-1000.0, 50.0, 0.0], [0.0, 50.0, -750.0]])
    metres = dipping.in_cells(cells.of_places(dipping.place), 400, 0).reshape(20, 20)
    np.testing.assert_allclose(metres[:10, 10], 125.0, atol=1.0)
    assert metres.sum() == pytest.approx(1250.0)
    assert np.count_nonzero(metres) == 10
    vertical = drives_along([[10.0, 10.0, 0.0], [10.0, 10.0, 80.0]])
    metres = vertical.in_cells(cells.of_places(vertical.place), 400, 0)
    assert metres.max() == pytest.approx(80.0)
    assert np.count_nonzero(metres) == 1


def test_drives_count_while_they_stand_open():
    """From the step that mines them to the one before that which fills them."""
    drive = drives_along(EVERYWHERE, mined=1, filled=3)
    cell = np.zeros(len(drive.metres), int)
    assert [float(round(drive.in_cells(cell, 1, step)[0])) for step in range(4)] == [0.0, 1980.0, 1980.0, 0.0]
    assert drive.in_cells(np.full(len(cell), -1), 1, 1)[0] == 0.0  # outside of the box


def grid_of(boxes: dict[str, tuple]) -> xr.Dataset:
    """grid.nc of openings of whole cells of 2 m between two corners, m."""
    origins = []
    for lower, upper in boxes.values():
        axes = [np.arange(low, high, 2.0) for low, high in zip(lower, upper, strict=True)]
        origins.append(np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3))
    number = np.repeat(np.arange(len(origins)), list(map(len, origins)))
    return xr.Dataset(
        {
            "piece_origin": (("piece", "xyz"), np.concatenate(origins)),
            "piece_excavation": ("piece", number),
            "piece_fraction": ("piece", np.ones(len(number))),
        },
        attrs={
            "plane": "none",
            "fine_cell": 2.0,
            "domain_lower": [0.0] * 3,
            "excavation_names": json.dumps(list(boxes)),
        },
    )


def test_drives_are_those_with_an_axis_or_cells_in_a_row():
    """A long box is a drive by its cells, a stope is none; a path goes before cells; planned drives do not count."""
    long, stope = ((0.0, 0.0, 0.0), (60.0, 4.0, 4.0)), ((0.0, 20.0, 0.0), (20.0, 40.0, 20.0))
    grid = grid_of({"drive": long, "stope": stope, "ramp": stope, "planned": long})
    steps = ["a", "b"]
    given = [
        Drive.of({"name": "drive", "step": "b", "filled": "b"}),
        Drive.of({"name": "stope"}),
        Drive.of({"name": "ramp", "path": [[0.0, 20.0, 0.0], [12.0, 20.0, 5.0]]}),
    ]
    found = DriveMetres.of(grid, given, steps)
    of_drive = found.mined == 1
    assert found.metres[of_drive].sum() == pytest.approx(60.0, abs=2.0)
    assert (found.filled[of_drive] == 1).all()
    assert found.metres[~of_drive].sum() == pytest.approx(13.0)
    assert (found.mined[~of_drive] == -1).all()
    assert (found.filled[~of_drive] == NEVER).all()
    assert DriveMetres.of(grid, given[1:2], steps) is None


# ---- shares on alert ----


@settings(deadline=None, max_examples=60)
@given(
    density=arrays(np.int64, 9, elements=st.integers(0, 3)),
    metres=arrays(np.int64, 9, elements=st.integers(0, 4)),
    cell=st.lists(st.integers(0, 8), min_size=1, max_size=6),
)
def test_shares_are_those_of_counting_metres(density, metres, cell):
    """Slow twin by the definition: metres of cells that are more probable, and at least as probable."""
    more, as_many = alert_shares(density.astype(float), np.array(cell), metres.astype(float))
    if not metres.sum():
        assert np.isnan(more).all()
        assert np.isnan(scored(more, as_many).hits("map", 0.5)).all()
        return
    for own, low, high in zip(cell, more, as_many, strict=True):
        assert low == pytest.approx(metres[density > density[own]].sum() / metres.sum())
        assert high == pytest.approx(metres[density >= density[own]].sum() / metres.sum())
    scores, shares = scored(more, as_many), np.linspace(0.0, 1.0, 20_001)
    curve = scores.curve("map", shares)
    assert (np.diff(curve) >= -1e-12).all()
    assert curve[-1] == 1.0
    assert np.trapezoid(curve, shares) == pytest.approx(scores.skill.mean()[0], abs=1e-4)


@settings(deadline=None, max_examples=30)
@given(
    metres=arrays(float, 12, elements=st.floats(0.0, 50.0)), cell=st.lists(st.integers(0, 11), min_size=1, max_size=20)
)
def test_a_map_that_is_equal_everywhere_has_half_wherever_drives_and_events_are(metres, cell):
    if metres.sum() < 1.0:
        return
    scores = scored(*alert_shares(np.full(12, 3.0), np.array(cell), metres))
    assert scores.skill.mean()[0] == pytest.approx(0.5)
    np.testing.assert_allclose(scores.curve("map", CURVE_SHARES), CURVE_SHARES, atol=1e-9)


def test_metres_that_are_alike_everywhere_give_the_shares_of_rock():
    density, cell = np.random.default_rng(1).random(500), np.arange(0, 500, 7)
    for own, rock in zip(alert_shares(density, cell, np.full(500, 3.7)), alert_shares(density, cell), strict=True):
        np.testing.assert_allclose(own, rock, atol=1e-12)


def test_a_perfect_map_has_one_and_events_away_from_drives_cost_nothing():
    """Events in the first of a thousand cells with a drive each; then in rock without one, which is on alert first."""
    density, metres = np.linspace(2.0, 0.0, 1000), np.ones(1000)
    best, worst = (scored(*alert_shares(density, np.full(50, cell), metres)) for cell in (0, 999))
    assert best.skill.mean()[0] == pytest.approx(1.0, abs=1e-3)
    assert worst.skill.mean()[0] == pytest.approx(0.0, abs=1e-3)
    metres[0] = 0.0
    free = scored(*alert_shares(density, np.zeros(50, int), metres))
    assert free.skill.mean()[0] == 1.0
    assert free.hit_rate("map", 0.0)[0] == 1.0


def test_maps_know_where_in_the_drives_events_come():
    """Drives along both middles of the box, events at one point of them: a map of the record has nearly the whole area
    of metres; a model of the far end of the drives nearly none; one without an event 1/2."""
    drives = drives_along(EVERYWHERE, EVERYWHERE[:, [1, 0, 2]])
    events = record(90)
    events = Places(events.time, events.place * 0.2 + [600.0, 0.0], events.potency)
    models = {"Far": np.array([[-600.0, 0.0]] * 3), "Nothing": np.zeros((0, 2))}
    maps = maps_of(events, {name: model_of(place, np.arange(len(place))) for name, place in models.items()})
    found = find_drive_alerts(maps, drives)
    mean = dict(zip(found.labels, found.skill.mean(), strict=True))
    assert mean["all_earlier"] > 0.95
    assert mean["Nothing"] == 0.5
    assert mean["Far"] < 0.5
    mirrored = maps_of(Places(events.time, events.place * [-1.0, 1.0], events.potency))
    other = find_drive_alerts(mirrored, drives)
    assert other.skill.mean()[0] == pytest.approx(mean["all_earlier"], abs=2e-3)


def test_maps_that_know_nothing_leave_the_band_as_often_as_stated():
    """Maps of random points and random events anywhere, drives across the box: 95 % of the scores by metres lie in the
    band, as those of rock do."""
    generator, inside = np.random.default_rng(3), []
    cells = AlertCells(BOX, (25, 25))
    lines = [[[-1000.0, y, 0.0], [1000.0, y + 100.0, 0.0]] for y in np.linspace(-900.0, 800.0, 12)]
    drives = drives_along(*lines)
    metres = drives.in_cells(cells.of_places(drives.place), 625, 0)
    for _ in range(300):
        density = cells.density(generator.uniform(-1000.0, 1000.0, (15, 2)), 60.0)
        place = generator.uniform(-1000.0, 1000.0, (40, 2))
        scores = scored(*alert_shares(density, cells.of_places(place), metres))
        low, high = scores.no_skill(CURVE_SHARES[::20])[1]
        inside.append(low <= scores.skill.mean()[0] <= high)
    assert np.mean(inside) >= 0.95 - 3.0 * np.sqrt(0.05 * 0.95 / 300)


def test_mines_without_open_drives_say_nothing(tmp_path):
    """Without drives, with drives outside of the box, and with drives that are filled before."""
    maps = maps_of(record(90))
    outside = drives_along(EVERYWHERE + np.array([0.0, 5000.0, 0.0]))
    for drives in (None, outside, drives_along(EVERYWHERE, filled=-1)):
        assert find_drive_alerts(maps, drives) is None
    months = months_of(maps)
    assert drive_rows(months) == []
    assert len(alert_sentences(months)) == 1
    assert len(draw_molchan(months).axes) == 1
    write_alerts(tmp_path / "alerts.csv", months)
    assert "drives" not in (tmp_path / "alerts.csv").read_text()


def test_steps_without_an_open_drive_do_not_count():
    """A drive that is mined in the last step: its events alone have a share."""
    maps = maps_of(record(90))
    found = find_drive_alerts(maps, drives_along(EVERYWHERE, mined=2))
    assert set(found.step[found.skill.common]) == {2}
    assert set(find_alerts(maps).step[find_alerts(maps).skill.common]) == {1, 2}
    assert len(START) == len(END) == 3


def test_the_page_states_metres_beside_rock(tmp_path):
    months = months_of(maps_of(record(90)), drives=drives_along(EVERYWHERE, EVERYWHERE[:, [1, 0, 2]]))
    rock, metres = alert_sentences(months)
    assert rock.startswith("With 5, 10 and 20 % of the rock on alert")
    assert metres.startswith("With 5, 10 and 20 % of the metres of drives on alert")
    assert [row["name"] for row in drive_rows(months)] == [row["name"] for row in alert_rows(months)]
    left, right = draw_molchan(months).axes
    assert right.get_xlabel() == "share of the metres of drives on alert (%)"
    assert len(left.lines) == len(right.lines)
    write_alerts(tmp_path / "alerts.csv", months)
    lines = (tmp_path / "alerts.csv").read_text().splitlines()
    assert lines[0].endswith(",on alert")
    assert len(lines) == 1 + 2 * 4 * len(months.alerts.labels)
    assert sum(line.endswith("metres of drives") for line in lines) == 4 * len(months.alerts.labels)
