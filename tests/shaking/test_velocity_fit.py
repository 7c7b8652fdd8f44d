"""Coefficients from recorded velocities: twins of known truth, a slow twin of the solver, and files as mines export."""

import numpy as np
import pytest
from scipy.optimize import minimize_scalar

from common.errors import InputError
from shaking.fit import LOG_RATIO_BOUNDS, Velocities, fit_relation, fitted_relation, read_velocities
from shaking.relations import GroundMotion
from shaking.settings import FittedRelation

TRUE = GroundMotion("site", "mw", -1.4, 0.55, 1.25, 0.0, length=2.0, exponent=0.5)
CURVE = {"length": 2.0, "exponent": 0.5}


def drawn(seed: int, between: float, within: float, events: int = 30, sensors: int = 8) -> Velocities:
    """Velocities of TRUE: events of Mw -0.5 to 2.5, each at up to so many sensors, 20 to 800 m away."""
    generator = np.random.default_rng(seed)
    count = generator.integers(max(1, sensors // 2), sensors + 1, events) if sensors > 1 else np.ones(events, int)
    event = np.repeat(np.arange(events), count)
    size = generator.uniform(-0.5, 2.5, events)[event]
    distance = 10.0 ** generator.uniform(1.3, 2.9, len(event))
    error = between * generator.standard_normal(events)[event] + within * generator.standard_normal(len(event))
    return Velocities(event, size, distance, TRUE.log_median(size, distance) + error)


def test_velocities_without_scatter_give_the_coefficients_back():
    fit = fit_relation(drawn(1, 0.0, 0.0), **CURVE)
    np.testing.assert_allclose(fit.coefficients, [-1.4, 0.55, 1.25], atol=1e-9)
    assert fit.scatter < 1e-6


@pytest.mark.parametrize(("between", "within", "sensors"), [(0.25, 0.2, 8), (0.0, 0.3, 8), (0.2, 0.2, 1)])
def test_intervals_hold_the_truth_as_often_as_they_say(between, within, sensors):
    """400 records: each coefficient in 92 to 98.5 % of them (three Monte Carlo errors), the scatter without a bias."""
    records, truth, held, scatter = 400, np.array([-1.4, 0.55, 1.25]), np.zeros(3), []
    for seed in range(records):
        fit = fit_relation(drawn(1000 + seed, between, within, sensors=sensors), **CURVE)
        held += (fit.intervals[:, 0] <= truth) & (truth <= fit.intervals[:, 1])
        scatter.append(fit.scatter**2)
    assert np.all(held / records >= 0.92), held / records
    assert np.all(held / records <= 0.985), held / records
    assert np.mean(scatter) == pytest.approx(between**2 + within**2, rel=0.05)


def test_the_interval_of_the_distance_holds_where_distances_differ_between_events_alone():
    """Sensors of a cluster at one distance from each of few events: c is known from the events, not from velocities."""
    generator, held = np.random.default_rng(12), 0
    for _ in range(300):
        event = np.repeat(np.arange(6), 8)
        size, distance = (generator.uniform(*ends, 6)[event] for ends in ((-0.5, 2.5), (1.3, 2.9)))
        distance = 10.0 ** (distance + 0.01 * generator.standard_normal(48))
        error = 0.3 * generator.standard_normal(6)[event] + 0.1 * generator.standard_normal(48)
        records = Velocities(event, size, distance, TRUE.log_median(size, distance) + error)
        low, high = fit_relation(records, **CURVE).intervals[2]
        held += low <= 1.25 <= high
    assert 0.91 <= held / 300 <= 0.985


def test_least_squares_alone_would_state_intervals_too_narrow():
    """With a scatter of events the same number of velocities counts as less: what the random effect is for."""
    held = 0
    for seed in range(200):
        records = drawn(5000 + seed, 0.3, 0.1)
        alone = Velocities(np.arange(len(records.event)), records.size, records.distance, records.log_velocity)
        low, high = fit_relation(alone, **CURVE).intervals[1]
        held += low <= 0.55 <= high
    assert held / 200 < 0.75


def test_the_solver_is_generalised_least_squares_with_whole_matrices():
    """Restricted likelihood and coefficients with the covariance of all velocities written out."""
    records = drawn(3, 0.3, 0.2, events=12, sensors=5)
    x = TRUE.factors(records.size, records.distance)
    same = (records.event[:, None] == records.event).astype(float)

    def solve(log_ratio: float):
        v = np.eye(len(same)) + np.exp(log_ratio) * same
        inverse = np.linalg.inv(v)
        normal = x.T @ inverse @ x
        coefficients = np.linalg.solve(normal, x.T @ inverse @ records.log_velocity)
        rest = records.log_velocity - x @ coefficients
        variance = rest @ inverse @ rest / (len(rest) - 3)
        likelihood = (len(rest) - 3) * np.log(variance) + np.linalg.slogdet(v)[1] + np.linalg.slogdet(normal)[1]
        return likelihood, coefficients, variance * np.linalg.inv(normal), variance

    best = minimize_scalar(lambda one: solve(one)[0], bounds=LOG_RATIO_BOUNDS, method="bounded")
    _, coefficients, covariance, variance = solve(best.x)
    fit = fit_relation(records, **CURVE)
    np.testing.assert_allclose(fit.coefficients, coefficients, rtol=1e-5)
    np.testing.assert_allclose(fit.covariance, covariance, rtol=1e-3)
    assert fit.within == pytest.approx(np.sqrt(variance), rel=1e-4)
    assert fit.between == pytest.approx(np.sqrt(variance * np.exp(best.x)), rel=1e-3)


def write(path, records: Velocities, places: bool = False, comma: bool = False) -> None:
    """A file as a mine exports it, velocities in mm/s."""
    head = ["event", "mw", "ppv", *("ex,ey,ez,sx,sy,sz".split(",") if places else ["r"])]
    rows = []
    for event, size, distance, log_velocity in zip(
        records.event, records.size, records.distance, records.log_velocity, strict=True
    ):
        where = [100.0, 200.0, -300.0, 100.0, 200.0, -300.0 + distance] if places else [distance]
        rows.append([f"E{event}", *(f"{one:.10g}" for one in (size, 1000.0 * 10.0**log_velocity, *where))])
    separator = ";" if comma else ","
    text = "\n".join(separator.join(row) for row in [head, *rows]) + "\n"
    path.write_text(text.replace(".", ",") if comma else text)


COLUMNS = {"event": "event", "size": "mw", "velocity": "ppv"}
PLACES = {"event_place": ["ex", "ey", "ez"], "station_place": ["sx", "sy", "sz"]}


def settings(path, **changes) -> FittedRelation:
    given = {"name": "fitted", "file": str(path), "size": "mw", "velocity_unit": "mm/s", "nearest": "5 m"}
    given |= {"columns": COLUMNS | {"distance": "r"}, "saturation": {"length": "2 m", "exponent": 0.5}}
    return FittedRelation.read(given | changes, "ground_motion.relation")


@pytest.mark.parametrize(("places", "comma"), [(False, False), (True, False), (False, True)])
def test_a_file_is_read_in_its_units(tmp_path, places, comma):
    """Velocities in mm/s; distances, or both places; points or commas as decimals."""
    records = drawn(4, 0.1, 0.1)
    write(tmp_path / "v.csv", records, places, comma)
    given = settings(tmp_path / "v.csv", columns=COLUMNS | (PLACES if places else {"distance": "r"}))
    read = read_velocities(given)
    np.testing.assert_allclose(read.log_velocity, records.log_velocity, atol=1e-8)
    np.testing.assert_allclose(read.distance, records.distance, rtol=1e-6)
    assert len(np.unique(read.event)) == 30
    relation, fit = fitted_relation(given, 3.0)
    assert (relation.a, relation.b, relation.c) == tuple(fit.coefficients)
    assert relation.scatter == fit.scatter
    assert relation.sizes == pytest.approx((records.size.min(), records.size.max()))
    assert "velocities of 30 events give a = " in fit.text
    assert (
        fitted_relation(settings(tmp_path / "v.csv", scatter=0.4, columns=given.columns.given()), 3.0)[0].scatter == 0.4
    )


def changed(records: Velocities, **values) -> Velocities:
    return Velocities(**{name: values.get(name, getattr(records, name)) for name in Velocities.__dataclass_fields__})


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda one: changed(one, size=np.ones_like(one.size)), "all sizes are alike, which leaves b open"),
        (lambda one: changed(one, distance=np.full_like(one.distance, 1.0)), "which leaves c open"),
        (lambda one: Velocities(*(getattr(one, n)[:4] for n in Velocities.__dataclass_fields__)), "too few to fit"),
        (lambda one: changed(one, log_velocity=-one.log_velocity), "the velocities shrink with the size"),
    ],
)
def test_velocities_that_no_relation_follows_from_are_one_line(tmp_path, make, message):
    write(tmp_path / "v.csv", make(drawn(5, 0.1, 0.1)))
    with pytest.raises(InputError) as error:
        fitted_relation(settings(tmp_path / "v.csv", saturation={"length": "2 m"}), np.inf)
    assert len(error.value.lines) == 1
    assert message in str(error.value)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (",ppv,", ",speed,", "column 'ppv' (velocity)"),
        ("E0,", ",", "'' is empty (1 such); name the event, or leave the row out"),
        ("", "E0,9.5,1.0,20\n", "is not the size in the event's first row"),
        ("", "E99,1.0,-1.0,20\n", "is no velocity above 0"),
        ("", "E99,1.0,1.0,\n", "'' is empty (1 such); give a number, or leave the row out"),
    ],
)
def test_a_file_with_mistakes_is_one_line(tmp_path, old, new, message):
    path = tmp_path / "v.csv"
    write(path, drawn(6, 0.1, 0.1))
    text = path.read_text()
    path.write_text(text.replace(old, new, 1) if old else text + new)
    with pytest.raises(InputError) as error:
        read_velocities(settings(path))
    assert len(error.value.lines) == 1
    assert message in str(error.value)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"velocity_unit": "m"}, "velocity_unit: 'm' is not convertible to m/s"),
        ({"velocity_unit": "furlongs"}, "velocity_unit: 'furlongs' "),
        ({"columns": {"distance": "r", **PLACES}}, "columns: give either distance, or event_place and station_place"),
        ({"columns": {"event_place": ["x", "y", "z"]}}, "columns: give either distance, or event_place"),
        ({"nearest": None, "saturation": None}, "a velocity without limit at the source"),
    ],
)
def test_settings_with_mistakes_are_one_line(changes, message):
    given = {"name": "fitted", "file": "v.csv", "size": "mw", "velocity_unit": "mm/s", "nearest": "5 m"} | changes
    with pytest.raises(InputError) as error:
        FittedRelation.read({key: value for key, value in given.items() if value is not None}, "relation")
    assert len(error.value.lines) == 1, error.value
    assert message in str(error.value)
