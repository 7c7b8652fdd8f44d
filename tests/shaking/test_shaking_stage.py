"""The stage on made-up openings and events: what shakes which opening in which step, and the demand that follows."""

import numpy as np
import pytest
import xarray as xr
from hypothesis import given
from hypothesis import strategies as st
from shaking_fixtures import EDGE, MINE, OPENINGS, SHEAR, STEPS, catalogue, made_up_grid, scattered, slice_of

from common.datasets import write_dataset
from common.errors import InputError
from common.event_table import write_events
from common.opening_table import FIELDS
from shaking.demand import GRAVITY, energy_demand, weakest_class
from shaking.events import RunEvents
from shaking.layout import read_shaking
from shaking.openings import Openings
from shaking.settings import ShakingSlice, SupportClass
from shaking.stage import find_shaking, plan_shaking_stage, relation_and_text, shaking_stage
from shaking.table import table_of, write_csv


def shake(events, grid=None, members=(), depths=None, record=None, **changes) -> xr.Dataset:
    """Shaking from the catalogues of the runs, without files."""
    settings = ShakingSlice.of(slice_of(**changes))
    relation, text = relation_and_text(settings)
    runs = RunEvents.of_catalogues(relation.kind, events, list(members), [step.name for step in STEPS])
    return find_shaking(settings, relation, runs, made_up_grid() if grid is None else grid, record, depths, text)


def test_one_event_shakes_each_opening_from_its_nearest_part():
    """The drive is 60 m long: an event beside its far end is 6 m away, not 40 m from its middle."""
    found = shake(catalogue([0.0], [[10.0, 59.0, 2.0]], [1]))
    assert found["opening"].values.tolist() == ["drive", "stope_1", "stope_2"]
    at = found.sel(step="2019-09", chance=0.1)
    np.testing.assert_allclose(at["distance"], [6.0, np.hypot(10.0, 39.0), np.hypot(10.0, 9.0)], rtol=1e-9)
    log_velocity = 0.2 - 1.2 * np.log10(at["distance"].values) + 0.25 * 1.2520  # p = 0.10536 of a normal law
    np.testing.assert_allclose(np.log10(at["velocity"]), log_velocity, atol=1e-3)
    np.testing.assert_allclose(at["top_location"], [[10.0, 59.0, 2.0]] * 3)
    assert at["top_share"].values.tolist() == [1.0] * 3
    assert found["velocity"].sel(step="2019-08", opening="drive").values.tolist() == [0.0] * 3  # no event in this step


def test_an_opening_is_not_shaken_before_it_is_mined():
    found = shake(catalogue(*scattered(60)))
    assert np.isnan(found["velocity"].sel(step="2019-08", opening="stope_2")).all()
    assert found["filled"].sel(step="2019-08").values.tolist() == [0, 0, -1]
    assert (found["velocity"].sel(step="2019-09") > 0.0).all()
    rows = table_of(found)
    assert len(rows) == 3 * (2 + 3)
    assert not ((rows["step"] == "2019-08") & (rows["opening"] == "stope_2")).any()


def test_filled_openings_say_so():
    openings = [OPENINGS[0], OPENINGS[1] | {"filled": "2019-09"}, OPENINGS[2] | {"filled": "2019-09"}]
    found = shake(catalogue(*scattered(20)), openings=openings)
    assert found["filled"].values.tolist() == [[0, 0, -1], [0, 1, 1]]
    assert set(table_of(found)["state"]) == {"open", "filled"}


def test_events_of_too_few_particles_count_nowhere():
    size, place, step = scattered(60)
    kept = np.arange(60) % 3 > 0
    loud = np.where(kept, size, 3.0)  # those that do not count would shake most
    mixed = shake(catalogue(loud, place, step, kept.astype(int)))
    alone = shake(catalogue(size[kept], place[kept], step[kept]))
    xr.testing.assert_identical(mixed, alone)


def test_an_event_without_a_size_counts_nowhere():
    size, place, step = scattered(20)
    weak = catalogue(np.append(size, -np.inf), np.vstack([place, place[:1]]), np.append(step, 1))
    xr.testing.assert_identical(shake(weak), shake(catalogue(size, place, step)))


def test_members_are_runs_of_one_process():
    """Five copies of a run are the run, with a narrower interval; five runs are their mean rate."""
    runs = [catalogue(*scattered(40, seed)) for seed in range(5)]
    own = shake(runs[0])
    copies = shake(runs[0], members=[runs[0]] * 4)
    np.testing.assert_allclose(copies["velocity"], own["velocity"], rtol=1e-4)
    np.testing.assert_allclose(copies["share"], own["share"], atol=1e-12)
    widths = [np.ptp(one["velocity_interval"].sel(step="2019-09").values, axis=-1) for one in (copies, own)]
    assert np.all(widths[0] < widths[1])
    assert int(shake(runs[0], members=runs[1:]).attrs["runs"]) == 5


def turned(points: np.ndarray) -> np.ndarray:
    """Places turned by 90 degrees about z."""
    return np.stack([-points[:, 1], points[:, 0], points[:, 2]], axis=1)


@pytest.mark.parametrize("how", ["mirrored", "turned", "shifted", "reordered"])
def test_the_same_mine_elsewhere_shakes_alike(how):
    """Openings and events mirrored, turned, moved by whole cells, or in another order."""
    size, place, step = scattered(50)
    grid, expected = made_up_grid(), shake(catalogue(*scattered(50)))
    if how == "mirrored":
        origin = grid["piece_origin"].values * [-1.0, 1.0, 1.0] + [32.0 - EDGE, 0.0, 0.0]
        grid = grid.assign(piece_origin=(("piece", "xyz"), origin))
        place = place * [-1.0, 1.0, 1.0] + [32.0, 0.0, 0.0]
    elif how == "turned":
        corner = grid["piece_origin"].values
        origin = turned(corner) - [EDGE, 0.0, 0.0]  # the lower corner of a cell that is turned
        grid, place = grid.assign(piece_origin=(("piece", "xyz"), origin)), turned(place)
    elif how == "shifted":
        shift = np.array([20.0, -10.0, 6.0])
        grid = grid.assign(piece_origin=grid["piece_origin"] + shift)
        place = place + shift
    else:
        order = np.random.default_rng(3).permutation(50)
        size, place, step = size[order], place[order], step[order]
    found = shake(catalogue(size, place, step), grid)
    for name in ("velocity", "velocity_interval", "distance", "magnitude", "share", "curve"):
        np.testing.assert_allclose(found[name], expected[name], rtol=1e-6, atol=1e-9, err_msg=name)


def test_distances_are_those_to_the_nearest_cell():
    """Against all cells one by one; an event inside of an opening is at 0 m."""
    openings = Openings.of(made_up_grid(), ShakingSlice.of(slice_of()).openings, STEPS)
    points = np.concatenate([scattered(40)[1], [[26.0, 10.0, 15.0]]])
    for number, cells in enumerate(openings.cells):
        below, above = cells[:, None] - points, points - cells[:, None] - EDGE
        apart = np.linalg.norm(np.maximum(np.maximum(below, above), 0.0), axis=2).min(axis=0)
        np.testing.assert_allclose(openings.distances(number, points), apart, atol=1e-9)
    assert openings.distances(1, points)[-1] == 0.0


def test_a_record_that_clusters_makes_shaking_rarer():
    record = xr.Dataset({"dispersion_index": 4.0, "event_ratio": 0.5})
    alone, beside = shake(catalogue(*scattered(60))), shake(catalogue(*scattered(60)), record=record)
    assert np.all(beside["velocity"].sel(step="2019-09") < alone["velocity"].sel(step="2019-09"))
    assert beside.attrs["dispersion"] == 4.0
    assert beside.attrs["event_ratio"] == 0.5


def opening_table(rows: list[tuple]) -> xr.Dataset:
    """openings.nc with these rows of step, excavation, side, start of a stretch, p90 and largest depth."""
    known = dict(
        zip(
            ("step", "excavation", "side", "chainage_from", "depth_p90", "depth_largest"),
            zip(*rows, strict=True),
            strict=True,
        )
    )
    values = {}
    for field in FIELDS:
        column = known.get(field.name, [0] * len(rows))
        values[field.name] = ("row", np.array(column, field.dtype), field.attributes)
    return xr.Dataset(values)


def test_depths_come_from_failed_rock_unless_they_are_stated(tmp_path):
    """Rows of whole excavations by step and side; stretches of drives and sums of all sides are left out."""
    whole = [
        (step.name, opening["name"], side, np.nan, 0.1 * number + depth, 1.0 + depth)
        for number, step in enumerate(STEPS)
        for opening in OPENINGS[: 2 + number]
        for side, depth in (("roof", 0.8), ("walls", 0.3), ("all", 7.0))
    ]
    stretches = [("2019-09", "drive", "roof", 5.0, 9.0, 9.0)]
    write_dataset(opening_table([*whole, *stretches]), tmp_path / "openings.nc")
    write_files(tmp_path, catalogue(*scattered(30)))
    paths = {name: tmp_path / f"{name}.nc" for name in ("grid", "catalog")}

    def depths(**motion) -> np.ndarray:
        given = slice_of(ground_motion={"displacement": 200.0} | motion)
        found = shaking_stage(given, failed_rock=tmp_path / "openings.nc", **paths)
        return found["depth"].values

    np.testing.assert_allclose(depths()[1, 0], [0.9, 0.4, np.nan, np.nan])
    np.testing.assert_allclose(depths()[0, 0], [0.8, 0.3, np.nan, np.nan])
    assert np.isnan(depths()[0, 2]).all()  # not mined yet
    np.testing.assert_allclose(depths(depth="largest")[1, 2], [1.8, 1.3, np.nan, np.nan])
    np.testing.assert_allclose(depths(depth={"walls": 2.0})[1, 1], [0.9, 2.0, np.nan, np.nan])
    np.testing.assert_allclose(depths(depth=0.5)[1, 1], [0.5] * 4)
    with pytest.raises(InputError, match=r"no depth of failed rock is known; give ground_motion\.depth"):
        shaking_stage(slice_of(ground_motion={"displacement": 200.0}), **paths)
    write_dataset(opening_table(whole[-9:]), tmp_path / "openings.nc")
    assert np.isnan(depths()[0]).all()  # nothing stands open
    np.testing.assert_allclose(depths()[1, 0], [0.9, 0.4, np.nan, np.nan])
    write_dataset(opening_table([("other", *row[1:]) for row in whole]), tmp_path / "openings.nc")
    with pytest.raises(InputError, match="has none of the steps 2019-08"):
        depths()


def test_no_event_is_no_velocity_and_no_failure():
    found = shake(catalogue([], np.empty((0, 3)), []), ground_motion={"displacement": 200.0, "depth": 1.0})
    assert found["velocity"].sel(step="2019-09").values.tolist() == [[0.0] * 3] * 3
    assert np.isnan(found["velocity_interval"].sel(step="2019-09", interval="upper")).all()
    assert (table_of(found)["velocity_m_s"] == "0").all()


def test_demand_by_hand():
    """2700 kg/m3 and 1 m of roof at 2 m/s over 0.2 m: 5400 J/m2 of velocity and 5297 of weight; in walls none."""
    assert energy_demand(2.0, 1.0, 2700.0, 0.2, 1.0) == pytest.approx(0.5 * 2700.0 * 4.0 + 2700.0 * GRAVITY * 0.2)
    assert energy_demand(2.0, 1.0, 2700.0, 0.2, 0.0) == pytest.approx(5400.0)
    assert energy_demand(0.0, 0.0, 2700.0, 0.2, 1.0) == 0.0


@given(st.floats(0.0, 10.0), st.floats(0.0, 5.0), st.floats(1.0, 4.0))
def test_demand_grows_with_mass_and_with_the_square_of_velocity(velocity, depth, factor):
    walls = energy_demand(velocity, depth, 2700.0, 0.2, 0.0)
    assert energy_demand(factor * velocity, depth, 2700.0, 0.2, 0.0) == pytest.approx(factor**2 * walls)
    assert energy_demand(velocity, factor * depth, 2700.0, 0.2, 1.0) == pytest.approx(
        factor * energy_demand(velocity, depth, 2700.0, 0.2, 1.0)
    )
    assert energy_demand(velocity, depth, 2700.0, 0.2, 1.0) >= walls


def test_the_weakest_class_above_the_demand_is_named():
    support = [
        SupportClass.read({"name": name, "energy": f"{energy} kJ/m^2", "displacement": "100 mm"})
        for name, energy in (("strong", 40), ("weak", 5), ("middle", 15))
    ]
    found = [weakest_class(demand, support) for demand in (4.9e3, 5.0e3, 14e3, 20e3, 60e3, np.nan)]
    assert found == ["weak", "middle", "middle", "strong", "", ""]
    assert weakest_class(1.0, []) == ""


SUPPORT = [
    {"name": "mesh", "energy": 8.0, "displacement": 100.0},
    {"name": "yielding", "energy": 40.0, "displacement": 200.0},
]


def test_demands_stand_beside_velocities_by_side(tmp_path):
    """Stated depths by side; a side without one has no demand; the table has a row for each side."""
    motion = {"displacement": 200.0, "depth": {"roof": 1.0, "walls": 0.5}}
    found = shake(catalogue(*scattered(60)), ground_motion=motion, support=SUPPORT)
    at = found.sel(step="2019-09", opening="stope_1", chance=0.1)
    velocity = float(at["velocity"])
    mass = 2700.0
    roof = 0.5 * mass * velocity**2 + mass * GRAVITY * 0.2
    np.testing.assert_allclose(at["demand"].values[:2], [roof, 0.25 * mass * velocity**2], rtol=1e-9)
    assert np.isnan(at["demand"].values[2:]).all()
    assert at["carried_by"].values.tolist()[:2] == ["mesh" if roof < 8e3 else "yielding", "mesh"]
    not_yet = found.sel(step="2019-08", opening="stope_2")
    assert np.isnan(not_yet["depth"]).all()
    assert np.isnan(not_yet["demand"]).all()
    low, high = at["demand_interval"].values[0]
    assert low <= roof <= high
    write_csv(found, tmp_path / "shaking.csv")
    rows = table_of(found)
    assert len(rows) == 2 * 3 * (2 + 3)
    assert set(rows["side"]) == {"roof", "walls"}
    assert (tmp_path / "shaking.csv").read_text().splitlines()[0].split(",")[:5] == [
        "step", "opening", "state", "chance", "velocity_m_s",
    ]  # fmt: skip
    weak = shake(catalogue(*scattered(60)), ground_motion=motion, support=[SUPPORT[0] | {"energy": 1e-6}])
    assert set(table_of(weak)["carried_by"]) == {"none"}


def test_depths_of_failed_rock_stand_in_for_sides_that_have_none_stated():
    """(step, opening, side) in the order of the slice; what the mine file states comes first."""
    depths = np.full((2, 3, 4), np.nan)
    depths[1, 1] = [0.8, 0.4, np.nan, 0.2]
    motion = {"displacement": 200.0, "depth": {"roof": 1.0}}
    found = shake(catalogue(*scattered(60)), ground_motion=motion, depths=depths)
    at = found["depth"].sel(step="2019-09", opening="stope_1").values
    np.testing.assert_equal(at, [1.0, 0.4, np.nan, 0.2])


def write_files(folder, events, mine="made_up"):
    write_dataset(made_up_grid(), folder / "grid.nc")
    write_events(events, folder / "catalog.nc")


def test_files_are_read_and_written(tmp_path):
    """A run with a member; what is written is what is read."""
    own = catalogue(*scattered(30))
    write_files(tmp_path, own)
    member = tmp_path / "ensemble/1/events"
    for number, step in enumerate(STEPS):
        one = scattered(20, 5 + number)
        write_events(catalogue(one[0], one[1], np.full(20, number)), member / f"{step.name}.nc")
    paths = {"grid": tmp_path / "grid.nc", "catalog": tmp_path / "catalog.nc"}
    found = shaking_stage(slice_of(), members=[member.parent], **paths)
    assert found.attrs["runs"] == 2
    in_first = np.sum(scattered(30)[2] == 0)
    np.testing.assert_allclose(found["expected_events"], [(in_first + 20) / 2, (30 - in_first + 20) / 2])
    write_dataset(found, tmp_path / "shaking.nc")
    again = read_shaking(tmp_path / "shaking.nc")
    np.testing.assert_array_equal(again["velocity"], found["velocity"])
    assert again["carried_by"].values.tolist() == found["carried_by"].values.tolist()
    with pytest.raises(InputError, match="is of mine made_up, not of other"):
        shaking_stage(slice_of(mine="other"), **paths)


def test_a_plan_shakes_as_a_mine_with_its_events(tmp_path):
    """An outcome with the events of a run and of a member, among them a run on other cells, which does not count."""
    own, member = scattered(30), scattered(25, 7)
    events = [np.concatenate(pair) for pair in zip(own, member, strict=True)]
    number = np.zeros((3, 2, 4))
    number[1] = np.nan  # coarse
    outcome = xr.Dataset(
        {
            "number": (("run", "step", "opening_or_any"), number),
            "event_location": (("event", "xyz"), events[1]),
            "event_potency": ("event", 10.0 ** events[0]),
            "event_step": ("event", events[2].astype(np.int32)),
            "event_run": ("event", np.repeat([0, 2], [30, 25]).astype(np.int32)),
            "step": ("step", np.array([step.name for step in STEPS], object)),
        },
        attrs={"mine": MINE, "shear_modulus": SHEAR},
    )
    write_dataset(outcome, tmp_path / "outcome.nc")
    write_dataset(made_up_grid(), tmp_path / "grid.nc")
    paths = {"grid": tmp_path / "grid.nc", "outcome": tmp_path / "outcome.nc"}
    found = plan_shaking_stage(slice_of(), **paths)
    expected = shake(catalogue(*own), members=[catalogue(*member)])
    for name in ("velocity", "velocity_interval", "distance", "magnitude", "expected_events"):
        np.testing.assert_allclose(found[name], expected[name], rtol=1e-9, err_msg=name)
    with pytest.raises(InputError, match="has other steps than the plan"):
        plan_shaking_stage(slice_of(steps=[STEPS[0].given()], openings=[dict(OPENINGS[0])]), **paths)


def test_each_plan_has_the_demand_of_its_own_failed_rock(tmp_path):
    """Two plans of the same events; the roof of a stope fails twice as deep in one. There the mass doubles, and with it
    m v^2 / 2 + m g d. Nothing changes at the drive, nor do velocities. Without a table it is one line."""
    size, place, step = scattered(30)
    outcome = xr.Dataset(
        {
            "number": (("run", "step", "opening_or_any"), np.zeros((1, 2, 4))),
            "event_location": (("event", "xyz"), place),
            "event_potency": ("event", 10.0**size),
            "event_step": ("event", step.astype(np.int32)),
            "event_run": ("event", np.zeros(30, np.int32)),
            "step": ("step", np.array([step.name for step in STEPS], object)),
        },
        attrs={"mine": MINE, "shear_modulus": SHEAR},
    )
    write_dataset(outcome, tmp_path / "outcome.nc")
    write_dataset(made_up_grid(), tmp_path / "grid.nc")
    paths = {"grid": tmp_path / "grid.nc", "outcome": tmp_path / "outcome.nc"}
    found = []
    for deep in (0.5, 1.0):
        rows = [
            (one.name, name, "roof", np.nan, depth, 9.0)
            for one in STEPS
            for name, depth in (("drive", 0.4), ("stope_1", deep))
        ]
        write_dataset(opening_table(rows), tmp_path / f"{deep}.nc")
        given = slice_of(ground_motion={"displacement": 200.0})
        found.append(plan_shaking_stage(given, failed_rock=tmp_path / f"{deep}.nc", **paths).sel(side="roof"))
    first, second = found
    np.testing.assert_array_equal(first["velocity"], second["velocity"])
    ratio = (second["demand"] / first["demand"]).sel(step="2019-09")
    np.testing.assert_allclose(ratio.sel(opening="stope_1"), 2.0)
    np.testing.assert_allclose(ratio.sel(opening="drive"), 1.0)
    velocity = second["velocity"].sel(step="2019-09", opening="stope_1").values
    by_hand = 2700.0 * 1.0 * (0.5 * velocity**2 + 9.81 * 0.2)
    np.testing.assert_allclose(second["demand"].sel(step="2019-09", opening="stope_1"), by_hand)
    assert np.isnan(second["demand"].sel(opening="stope_2")).all()  # no failed rock is known
    with pytest.raises(InputError, match=r"no depth of failed rock is known; give ground_motion\.depth"):
        plan_shaking_stage(given, **paths)


def test_a_relation_that_fits_no_event_is_one_line():
    motion = {"relation": {"name": "mcgarr_1981", "scatter": 0.3}}
    size, place, step = scattered(30)
    with pytest.raises(InputError) as error:
        shake(catalogue(size - 6.0, place, step), ground_motion=motion)
    assert len(error.value.lines) == 1
    assert "mcgarr_1981 was found from log10 M0" in str(error.value)
    found = shake(catalogue(size, place, step), ground_motion=motion)  # some are in its range
    assert 0.0 < float(found["outside_share"].sel(step="2019-09", opening="stope_1", chance=0.1)) <= 1.0


@pytest.mark.parametrize(
    ("grid", "changes", "message"),
    [
        (made_up_grid().assign_attrs(dimension=2), {}, "plane-strain"),
        (made_up_grid(), {"openings": [{"name": "shaft"}]}, "the grid has no excavation shaft"),
        (made_up_grid(), {"openings": [{"name": "drive", "step": "2020-01"}]}, "drive: '2020-01' is no dated step"),
    ],
)
def test_scenes_without_an_answer_are_one_line(grid, changes, message):
    with pytest.raises(InputError, match=message) as error:
        shake(catalogue(*scattered(10)), grid, **changes)
    assert len(error.value.lines) == 1
