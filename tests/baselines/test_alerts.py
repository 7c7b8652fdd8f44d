"""Alarms: events in rock on alert, Molchan's diagram, and forecasts in CSEP's form."""

from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.stats import binom

from baselines.alert_report import CURVE_SHARES, alert_rows, alert_sentences, draw_molchan, write_alerts
from baselines.alerts import (
    AlertCells,
    AlertScores,
    alert_shares,
    find_alerts,
    find_drive_alerts,
    no_skill_band,
    share_interval,
)
from baselines.csep import rates_on_globe, write_csep
from baselines.drives import DriveMetres
from baselines.models import Counted
from baselines.month_maps import MonthMaps, Periods, Places
from catalogs.sources.geographic_frame import MineFrame

START = np.array(["2019-08-01", "2019-09-01", "2019-10-01"], "datetime64[ns]")
END = np.array(["2019-09-01", "2019-10-01", "2019-11-01"], "datetime64[ns]")
BOX = np.array([[-1000.0, -1000.0], [1000.0, 1000.0]])
FRAME = {"latitude": 39.0, "longitude": -107.4, "surface": 2400.0}


def record(count: int, spread: float = 60.0, seed: int = 0) -> Places:
    """Events at even times of three months, normally distributed about a point."""
    time = START[0] + (END[-1] - START[0]) // count * np.arange(count)
    return Places(time, spread * np.random.default_rng(seed).normal(size=(count, 2)) + [300.0, 100.0], np.ones(count))


def maps_of(events: Places, models: dict[str, Counted] | None = None, box=BOX, deviation: float = 10.0) -> MonthMaps:
    """Maps of all three months without a face; each event is a cluster."""
    step, count = np.searchsorted(END, events.time, side="right"), len(events.time)
    periods = Periods.of(START, END, None)
    return MonthMaps(
        events, step, np.arange(count), np.full(count, deviation), events, periods, None, box, models or {}
    )


def model_of(places: np.ndarray, step: np.ndarray) -> Counted:
    """A model with these events in plan."""
    count = len(places)
    return Counted(np.column_stack([places, np.zeros(count)]), step, np.ones(count), np.zeros(count, int))


def scored(more: np.ndarray, as_many: np.ndarray, cluster: np.ndarray | None = None) -> AlertScores:
    """Scores of one map with one run and one step."""
    count = len(more)
    labels = np.arange(count) if cluster is None else cluster
    return AlertScores(("map",), (more[None],), (as_many[None],), np.zeros(count, int), labels)


@settings(deadline=None, max_examples=30)
@given(cell=st.lists(st.integers(0, 11), min_size=1, max_size=30), level=st.floats(0.01, 100.0))
def test_a_map_that_is_equal_everywhere_has_half_the_area_wherever_events_lie(cell, level):
    """And hits as large a share of the events as there is rock on alert, for every share."""
    scores = scored(*alert_shares(np.full(12, level), np.array(cell)))
    assert scores.skill.mean()[0] == 0.5
    np.testing.assert_allclose(scores.curve("map", CURVE_SHARES), CURVE_SHARES, atol=1e-12)


def test_a_model_without_an_event_is_such_a_map():
    """It says nothing of the step, so its score is 1/2; the record's own maps have more."""
    events = record(90)
    alerts = find_alerts(maps_of(events, {"Pipeline": model_of(np.zeros((0, 2)), np.zeros(0, int))}))
    assert alerts.skill.mean()[alerts.labels.index("Pipeline")] == 0.5
    assert alerts.skill.mean()[alerts.labels.index("all_earlier")] > 0.9


def test_a_perfect_map_has_the_whole_area_and_its_opposite_none():
    """All events in the first of many cells; all events in the last."""
    density = np.linspace(2.0, 0.0, 1000)
    best, worst = (scored(*alert_shares(density, np.full(50, cell))) for cell in (0, 999))
    assert best.skill.mean()[0] == pytest.approx(1.0, abs=1e-3)
    assert worst.skill.mean()[0] == pytest.approx(0.0, abs=1e-3)
    assert best.hit_rate("map", 0.05)[0] == 1.0
    assert worst.hit_rate("map", 0.2)[0] == 0.0


def test_a_model_that_knows_each_event_is_nearly_perfect():
    """Events at two points of a large box, which the model has in the right months."""
    step = np.repeat([0, 1, 2], 20)
    time = START[step] + np.timedelta64(10, "D") + np.arange(60) * np.timedelta64(1, "m")
    place = np.array([[-700.0, 500.0], [600.0, -300.0], [0.0, 0.0]])[step]
    alerts = find_alerts(maps_of(Places(time, place, np.ones(60)), {"Pipeline": model_of(place, step)}))
    row = alerts.labels.index("Pipeline")
    assert alerts.skill.mean()[row] > 0.999
    assert alerts.skill.mean()[alerts.labels.index("last")] < 0.55  # they move each month


@settings(deadline=None, max_examples=60)
@given(
    density=arrays(np.int64, 9, elements=st.integers(0, 3)), cell=st.lists(st.integers(0, 8), min_size=1, max_size=6)
)
def test_ties_are_hit_in_proportion_as_on_average_over_all_orders(density, cell):
    """Slow twin: the hit rate by counting cells one by one, ties in many random orders."""
    scores = scored(*alert_shares(density.astype(float), np.array(cell)))
    generator, orders = np.random.default_rng(1), 400
    shares = np.arange(10) / 9.0
    hits = np.zeros(10)
    for _ in range(orders):
        order = np.lexsort((generator.random(9), -density))
        for alerted in range(10):
            hits[alerted] += np.isin(cell, order[:alerted]).mean() / orders
    np.testing.assert_allclose(scores.curve("map", shares), hits, atol=0.12)
    # the area under the curve, straight between whole cells, is the score
    assert np.trapezoid(scores.curve("map", shares), shares) == pytest.approx(scores.skill.mean()[0], abs=1e-12)


def test_the_curve_of_a_normal_map_is_that_of_theory():
    """Rock on alert is a disc of radius r: a share pi r^2 / A of the box, and 1 - exp(-r^2 / (2 s^2)) of the events."""
    spread, generator = 120.0, np.random.default_rng(3)
    events = Places(
        START[0] + (END[-1] - START[0]) // 6000 * np.arange(6000),
        spread * generator.normal(size=(6000, 2)),
        np.ones(6000),
    )
    alerts = find_alerts(maps_of(events, deviation=40.0))
    shares = np.array([0.005, 0.01, 0.02, 0.04, 0.08])
    expected = 1.0 - np.exp(-shares * np.prod(BOX[1] - BOX[0]) / (2.0 * np.pi * spread**2))
    np.testing.assert_allclose(alerts.curve("all_earlier", shares), expected, atol=0.025)


def test_a_mirrored_and_turned_mine_has_the_same_scores():
    """By right angles, as cells are along the axes; to the rounding of places to cells."""
    events = record(300)
    turn = np.array([[0.0, 1.0], [1.0, 0.0]]) @ np.diag([1.0, -1.0])
    own, other = (
        find_alerts(maps_of(Places(events.time, events.place @ matrix.T, events.potency)))
        for matrix in (np.eye(2), turn)
    )
    np.testing.assert_allclose(own.skill.mean(), other.skill.mean(), atol=2e-4)


def test_more_rock_that_nobody_mines_makes_scores_larger_and_a_huge_deviation_none():
    """A box of four times the area; a mine whose location error exceeds it."""
    events = record(300)
    small, large = (
        find_alerts(maps_of(events, box=factor * BOX, deviation=40.0)).skill.mean()[0] for factor in (1.0, 2.0)
    )
    assert 1.0 - large == pytest.approx((1.0 - small) / 4.0, rel=0.1)
    assert 0.0 < find_alerts(maps_of(events, deviation=5000.0)).skill.mean()[0] < 1.0


@pytest.mark.parametrize(
    ("count", "size", "rate"),
    [(60, 1, 0.5), (60, 1, 0.05), (25, 6, 0.6), (40, 10, 0.9), (12, 4, 0.3), (60, 1, 0.98), (30, 3, 0.95)],
)
def test_intervals_of_hit_rates_hold_the_truth(count, size, rate):
    """Clusters of geometric size, all of whose events are hit together: of 95 % intervals at least 93 % hold it."""
    generator, held = np.random.default_rng(5), []
    for _ in range(400):
        sizes = generator.geometric(1.0 / size, count)
        cluster = np.repeat(np.arange(count), sizes)
        low, high = share_interval(np.repeat(generator.random(count) < rate, sizes)[None].astype(float), cluster)
        held.append(low <= rate <= high if np.isfinite(low) else True)
    assert np.mean(held) >= 0.93


def test_too_few_clusters_have_no_interval_and_all_hits_have_an_end():
    """Three clusters of many events; fifty events that are all hit."""
    assert np.isnan(share_interval(np.ones((1, 30)), np.repeat([0, 1, 2], 10))).all()
    low, high = share_interval(np.ones((1, 50)), np.arange(50))
    assert high == 1.0
    assert low == pytest.approx(0.025 ** (1 / 50))  # Clopper and Pearson of 50 in 50


def test_the_band_of_no_skill_is_binomial_and_wider_with_clusters():
    """Zechar and Jordan (2008) for independent events; ten clusters of ten are as uncertain as ten events."""
    shares = np.array([0.05, 0.2, 0.5])
    band, skill = no_skill_band(np.ones(100, int), shares)
    np.testing.assert_allclose(band, binom.ppf([[0.025, 0.975]], 100, shares[:, None]) / 100.0, atol=0.0101)
    assert skill == pytest.approx(0.5 + np.array([-1.96, 1.96]) / np.sqrt(1200.0), abs=0.004)
    clustered, wide = no_skill_band(np.full(10, 10), shares)
    np.testing.assert_allclose(clustered, binom.ppf([[0.025, 0.975]], 10, shares[:, None]) / 10.0, atol=0.101)
    assert np.ptp(wide) == pytest.approx(np.sqrt(10.0) * np.ptp(skill), rel=0.05)


def test_maps_that_know_nothing_leave_the_band_as_often_as_stated():
    """Events at random of a map of other events at random."""
    generator, shares, outside = np.random.default_rng(6), np.array([0.1, 0.4]), []
    band, skill = no_skill_band(np.ones(40, int), shares)
    cells = AlertCells.of(BOX, 60.0)
    for _ in range(400):
        density = cells.density(generator.uniform(-1000.0, 1000.0, (15, 2)), 60.0)
        scores = scored(*alert_shares(density, cells.of_places(generator.uniform(-1000.0, 1000.0, (40, 2)))))
        rates = scores.curve("map", shares)
        outside.append(
            [*((rates < band[:, 0]) | (rates > band[:, 1])), not skill[0] <= scores.skill.mean()[0] <= skill[1]]
        )
    # a hit rate of forty events is a multiple of 1/40: its band holds 95 % at least
    assert (np.mean(outside, axis=0) <= [0.075, 0.075, 0.075]).all()
    assert np.mean(outside, axis=0)[2] >= 0.025


def months_of(maps: MonthMaps, expected=(np.nan, 30.0, 40.0), drives: DriveMetres | None = None) -> SimpleNamespace:
    """What the page and the files take of months."""
    return SimpleNamespace(
        maps=maps,
        alerts=find_alerts(maps),
        drive_alerts=find_drive_alerts(maps, drives),
        steps=("a", "b", "c"),
        expected_number=lambda step: expected[step],
    )


def test_sentences_rows_and_file_state_hit_rates_with_intervals(tmp_path):
    """In per cent; the best map first; a step without an earlier one has none."""
    months = months_of(maps_of(record(90), {"Pipeline": model_of(np.array([[-500.0, -500.0]]), np.zeros(1, int))}))
    best, pipeline = alert_sentences(months)
    assert best.startswith("With 5, 10 and 20 % of the rock on alert, the map with the largest area skill (")
    assert "of the events of the next step." in best
    assert pipeline.startswith("The pipeline's map holds ")
    rows = alert_rows(months)
    assert [row["name"] for row in rows][:2] == ["all earlier months, as they are", "last month, as they are"]
    assert all(len(row["rates"]) == 3 and "%" in row["rates"][0] for row in rows)
    write_alerts(tmp_path / "alerts.csv", months)
    lines = (tmp_path / "alerts.csv").read_text().splitlines()
    assert lines[0].startswith("map,name,step,recorded events,area skill score,")
    assert len(lines) == 1 + 4 * len(months.alerts.labels)
    axes = draw_molchan(months).axes[0]
    assert axes.get_xlabel() == "share of the rock on alert (%)"
    assert all(np.diff(line.get_ydata()).min() >= -1e-9 for line in axes.lines if len(line.get_ydata()) > 2)


def test_a_record_of_one_month_has_no_alarms(tmp_path):
    """Nothing precedes it."""
    events = record(90).between(START[0], END[0])
    months = months_of(maps_of(events))
    assert alert_sentences(months) == []
    assert alert_rows(months) == []
    draw_molchan(months)
    write_alerts(tmp_path / "alerts.csv", months)


def read_csep(path) -> dict[str, np.ndarray]:
    """A forecast as CSEP's format is documented: cells with latitude fastest, corners of equal width."""
    data = np.loadtxt(path)
    names = "lon_0 lon_1 lat_0 lat_1 z_0 z_1 mag_0 mag_1 rate flag".split()
    assert data.shape[1] == len(names)
    return dict(zip(names, data.T, strict=True))


def test_forecasts_are_in_the_form_of_csep(tmp_path):
    """Rates add up to the expected number; each cell once, of one width; the largest rate where the events are."""
    maps = maps_of(record(300))
    months = months_of(maps)
    assert write_csep(tmp_path / "csep", months, FRAME, (-1500.0, 500.0), 0.3) == 4  # two maps of two months
    assert sorted(path.name for path in (tmp_path / "csep").iterdir()) == [
        f"{label}_{step}.dat" for label in ("all_earlier", "last") for step in "bc"
    ]
    found = read_csep(tmp_path / "csep/last_c.dat")
    assert found["rate"].sum() == pytest.approx(40.0, rel=1e-5)
    assert (found["rate"] > 0.0).all()
    widths = np.concatenate([found["lon_1"] - found["lon_0"], found["lat_1"] - found["lat_0"]])
    np.testing.assert_allclose(widths, widths[0], atol=1e-9)
    corners = np.column_stack([found["lon_0"], found["lat_0"]])
    assert len(np.unique(corners, axis=0)) == len(corners)
    assert (np.lexsort((found["lat_0"], found["lon_0"])) == np.arange(len(corners))).all()
    assert (found["z_0"][0], found["z_1"][0], found["mag_0"][0], found["flag"].min()) == (-1.5, 0.5, 0.3, 1.0)
    best = found["rate"].argmax()
    middle = [found[f"{name}_0"][best : best + 1] + 0.5 * widths[0] for name in ("lat", "lon")]
    place = MineFrame(FRAME).to_map(*middle, np.zeros(1))[0]
    np.testing.assert_allclose(place[:2], [300.0, 100.0], atol=60.0)


def test_rates_on_the_globe_follow_the_area_of_the_cells():
    """A map that is equal everywhere has the same rate per square metre at 60 degrees of latitude, too."""
    cells = AlertCells.of(np.array([[-5e4, -5e4], [5e4, 5e4]]), 2000.0)
    from baselines.csep import GlobeCells

    globe = GlobeCells.of(cells, MineFrame({"latitude": 60.0, "longitude": 179.0, "surface": 0.0}))
    rate = rates_on_globe(np.ones(np.prod(cells.shape)), cells, globe, 100.0)
    north, south = rate[globe.south.argmax()], rate[globe.south.argmin()]
    top, bottom = (np.cos(np.radians(one + 0.5 * globe.width)) for one in (globe.south.max(), globe.south.min()))
    assert north / south == pytest.approx(top / bottom)
    assert rate.sum() == pytest.approx(100.0)
