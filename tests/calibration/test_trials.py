"""From catalogues to outcomes, from a record to what a calibration needs of it, and mine files with other values."""

from types import SimpleNamespace

import numpy as np
import pytest
import xarray as xr
import yaml

from calibration.fit import Rows, calibrate, calibrate_to_trials
from calibration.mine_files import is_draw_of, with_values, write_mine
from calibration.page import Trials, trials_sentence
from calibration.recorded import RecordedOutputs, mean_excess
from calibration.settings import CalibratedQuantity, CalibrationSettings, cohesion_of, strength_under
from calibration.tradeoffs import best_known_strengths, further_points, telling_observations
from calibration.trials import (
    CellCorrection,
    Discrepancy,
    Outputs,
    Places,
    common_cut,
    gains,
    nothing_fails_before_record,
    outputs,
    read_places,
)
from catalogs.compare.exposure import Exposure
from common.errors import InputError
from seismic.catalog import extractions, join_extractions

STEPS = ["one", "two"]


def catalogue(sizes: dict[str, list[float]], floor=0.01, before=1.0, resolved=1):
    """Events of these potencies (m3) by step."""
    potency = np.array([value for values in sizes.values() for value in values], float)
    step = np.array([name for name, values in sizes.items() for _ in values], object)
    return xr.Dataset(
        {
            "potency": ("event", potency),
            "resolved": ("event", np.full(len(potency), resolved, np.int8)),
            "step": ("event", step),
        },
        attrs={"potency_floor": floor, "potency_before_record": before},
    )


def record(days: list[float], sizes: list[float]):
    """Recorded events at days of 2019-08 and later, far from each other."""
    time = np.datetime64("2019-08-01", "ns") + (np.array(days) * 86400e9).astype("timedelta64[ns]")
    return xr.Dataset(
        {
            "time": ("event", time),
            "potency": ("event", np.array(sizes, float)),
            "resolved": ("event", np.ones(len(sizes), np.int8)),
            "location": (("event", "xyz"), 1e3 * np.arange(3.0 * len(sizes)).reshape(-1, 3)),
        },
        attrs={"location_error": 1.0},
    )


EXPOSURE = Exposure(
    np.array(["2019-08-01", "2019-09-01"], "datetime64[ns]"), np.array(["2019-09-01", "2019-10-01"], "datetime64[ns]")
)


def test_outputs_sum_all_potency_and_count_resolved_events_above_the_cut():
    """Two runs; a step without anything counts as the cut, and as half an event."""
    runs = [catalogue({"one": [1.0, 2.0, 0.001], "two": []}), catalogue({"one": [0.5], "two": [4.0, 0.1]})]
    made = outputs(runs, STEPS, -1.0).by_term
    assert list(made) == ["potency", "number", "sizes"]
    np.testing.assert_allclose(np.exp(made["potency"]), [[3.001, 0.1], [0.5, 4.1]])
    np.testing.assert_allclose(np.exp(made["number"]), [[2.0, 0.5], [1.0, 2.0]])
    unresolved = outputs([catalogue({"one": [1.0]}, resolved=0)], STEPS, -1.0)
    np.testing.assert_allclose(np.exp(unresolved.by_term["number"]), 0.5)


def test_mean_size_of_a_power_law_is_that_of_its_b():
    """1 / (b ln 10), the same for model and record; one event a decade above the cut is all that an empty run has."""
    x = -1.0 + np.random.default_rng(0).exponential(1 / (1.2 * np.log(10)), 4000)
    made = outputs([catalogue({"one": 10.0**x}), catalogue({})], STEPS, -1.0).by_term["sizes"]
    np.testing.assert_allclose(np.exp(made[0, 0]), 1 / (1.2 * np.log(10)), rtol=0.05)
    assert made[1, 0] == 0.0
    np.testing.assert_allclose(made[0, 0], mean_excess(x + 1.0))


def located(location, step, floor=0.01, error=2.0):
    """Resolved events of 1 m3 at these places."""
    count = len(location)
    return xr.Dataset(
        {
            "potency": ("event", np.ones(count)),
            "resolved": ("event", np.ones(count, np.int8)),
            "step": ("event", np.array(step, object)),
            "location": (("event", "xyz"), np.array(location, float)),
        },
        attrs={"potency_floor": floor, "potency_before_record": 1.0, "location_error": error},
    )


def test_places_near_recorded_ones_gain_most_in_their_own_step():
    """A run with events where they were recorded gains; one that has them in the other step loses."""
    there, away = np.tile([[0.0, 0, 0]], (5, 1)), np.tile([[50.0, 0, 0]], (5, 1))
    right = located(np.concatenate([there, away]), ["one"] * 5 + ["two"] * 5)
    swapped = located(np.concatenate([there, away]), ["two"] * 5 + ["one"] * 5)
    recorded = record([*range(5), *range(40, 45)], [1.0] * 10)
    recorded["location"] = (("event", "xyz"), np.concatenate([there, away]) + 1.0)
    recorded.attrs["location_error"] = 5.0
    places = read_places(recorded, EXPOSURE, -1.0, [right, swapped])
    np.testing.assert_allclose(places.error, 5.0 / np.sqrt(3))
    np.testing.assert_allclose(places.deviation, np.hypot(5.0, 2.0) / np.sqrt(3))
    found = gains([right, swapped], STEPS, -1.0, places)
    assert gains([], STEPS, -1.0, places).shape == (0, 2)  # there may be no pairs of runs on two sizes of cells
    assert (found[0] > 2.0).all()
    np.testing.assert_allclose(found[1], np.log(0.05), atol=0.1)
    made = Places.of_events(there, np.zeros(5, int), places, np.random.default_rng(1))
    assert 0.5 < (made.location - there).std() / (5.0 / np.sqrt(3)) < 1.5


def test_runs_with_more_events_gain_no_more_at_places_of_the_same_law():
    """All events of one normal law, sparse for the location error: a run of 160 gains what one of 20 does."""
    generator = np.random.default_rng(1)
    runs = [
        located(20.0 * generator.standard_normal((count, 3)), ["one"] * count) for count in (20, 160) for _ in range(12)
    ]
    recorded = record(list(np.linspace(0.0, 20.0, 40)), [1.0] * 40)
    recorded["location"] = (("event", "xyz"), 20.0 * generator.standard_normal((40, 3)))
    recorded.attrs["location_error"] = 10.0
    gain = gains(runs, STEPS, -1.0, read_places(recorded, EXPOSURE, -1.0, runs))[:, 0]
    few, many = gain[:12], gain[12:]
    error = np.sqrt(few.var(ddof=1) / len(few) + many.var(ddof=1) / len(many))
    assert abs(many.mean() - few.mean()) < 2.5 * error


def test_a_trial_with_several_extractions_is_so_many_catalogues():
    """In order, an empty one among them."""
    sets = [catalogue({"one": sizes}, floor=floor) for sizes, floor in (([1.0], 0.01), ([], 0.02), ([2.0, 3.0], 0.04))]
    together = join_extractions(sets)
    assert [one["potency"].values.tolist() for one in extractions(together)] == [[1.0], [], [2.0, 3.0]]
    assert [one.attrs["potency_floor"] for one in extractions(together)] == [0.01, 0.02, 0.04]
    assert len(extractions(join_extractions(sets[:1]))) == 1


def test_events_count_from_the_largest_floor_of_all_runs_on():
    """A record that is complete further down does not lower it, one that is not raises it."""
    runs = [catalogue({"one": [1.0]}, floor=0.01), catalogue({"one": [1.0]}, floor=0.03)]
    sizes = np.random.default_rng(1).normal(size=50)
    found = [common_cut(runs, -3.0, sizes), common_cut(runs, -1.0, sizes)]
    np.testing.assert_allclose(found, [np.log10(0.03), -1.0])


def test_rounded_sizes_count_by_whole_bins():
    """Of Mw to 0.1 a cut in the midst of a bin counted its smaller events, half a bin too many, or none of it."""
    sizes = 0.15 * np.random.default_rng(1).integers(-20, 10, 200)
    cut = common_cut([catalogue({"one": [1.0]}, floor=10**-1.13)], -3.0, sizes)
    assert cut == pytest.approx(-1.125)
    assert common_cut([catalogue({"one": [1.0]}, floor=10**-1.2)], -3.0, sizes) == pytest.approx(-1.125)
    low = [catalogue({"one": [1.0]}, floor=10**-1.1)]
    assert common_cut(low, -3.0, sizes) == pytest.approx(-0.975)
    for complete, edge in ((-0.6, -0.675), (-0.675, -0.675), (-0.53, -0.675), (-0.52, -0.525)):  # the bin that holds it
        assert common_cut(low, complete, sizes) == pytest.approx(edge)


def test_nothing_fails_before_the_record_where_no_rock_fails_in_any_trial():
    """One trial with failure before the record is enough."""
    silent = catalogue({"one": [1.0]}, before=0.0)
    assert nothing_fails_before_record([silent, silent])
    assert not nothing_fails_before_record([silent, catalogue({"one": [1.0]})])


def test_cells_are_corrected_by_pairs():
    """A shift that a run's steps share, and one of each step: mean, common and own error are found again."""
    generator = np.random.default_rng(4)
    runs, steps = 400, 3
    coarse = {term: generator.normal(size=(runs, steps)) for term in ("potency", "number")}
    shift = (
        np.array([0.5, 0.2, 0.1]) + 0.3 * generator.normal(size=(runs, 1)) + 0.1 * generator.normal(size=(runs, steps))
    )
    found = CellCorrection.of(Outputs(coarse), Outputs({**coarse, "potency": coarse["potency"] + shift}), runs)
    np.testing.assert_allclose(found.shift, [0.5, 0.2, 0.1, 0, 0, 0], atol=0.05)
    np.testing.assert_allclose(found.errors["potency"].common, np.sqrt(0.3**2 + 0.1**2 / 3), rtol=0.1)
    np.testing.assert_allclose(found.errors["potency"].own, 0.1 * np.sqrt(2 / 3), rtol=0.1)
    assert found.errors["number"] == Discrepancy(0.0, 0.0)
    half = found.during(np.array([1.0, 0.5, 0.25]), Outputs(coarse))
    np.testing.assert_allclose(half.shift - found.shift, [0, -np.log(2), -np.log(4)] * 2)
    fit = SimpleNamespace(
        likelihood=SimpleNamespace(correction=half, columns={"potency": slice(0, 3)}),
        surrogate=SimpleNamespace(left_out=lambda: np.ones((2, 4, 6)), outputs=np.zeros((4, 6))),
        steps=3,
    )
    said = trials_sentence(fit, Trials(["a"], ["design"], 2, {}, False))
    factors = ", ".join(f"{one:.2f}" for one in np.exp(found.shift[:3]))  # of the cells, not of what is recorded
    assert f"multiply the potency of the steps by {factors}. " in said


def test_sets_of_events_of_one_rock_are_one_pair():
    """Four rocks of four sets each have the errors of four rocks of one set."""
    generator = np.random.default_rng(5)
    coarse, shift = np.zeros((4, 3)), generator.normal(size=(4, 3))
    single = CellCorrection.of(Outputs({"potency": coarse}), Outputs({"potency": shift}), 4)
    rows = np.repeat(np.arange(4), 4)
    several = CellCorrection.of(Outputs({"potency": coarse[rows]}), Outputs({"potency": shift[rows]}), 4)
    assert several.errors == single.errors
    np.testing.assert_allclose(several.shift, single.shift)


def simulator(points):
    """ln potency of two steps from two quantities."""
    return np.stack([2 + 2 * points[:, 0] + 0.5 * points[:, 1], 1 + 0.5 * points[:, 0] + 2 * points[:, 1]], axis=1)


def trials_at(points, noise=0.05, seed=6):
    """Rows of the made-up simulator, expected number in proportion to potency, chance of each by itself."""
    chance = noise * np.random.default_rng(seed).normal(size=(2, len(points), 2))
    made = {"potency": simulator(points) + chance[0], "number": np.log(20.0) + simulator(points) + chance[1]}
    return Rows(points, Outputs(made), np.arange(len(points)))


def fitted(rows, values, number, variance=0.01):
    """Calibrated to a record of these values."""
    errors = np.sqrt(3 * variance) * np.concatenate([np.eye(3), -np.eye(3)])
    recorded = RecordedOutputs(values, number, 2.0, 0.0, errors)
    return calibrate(rows, CellCorrection.none(rows.outputs), recorded, ("potency", "number"), 0.1, seed=1)


def test_calibration_of_a_made_up_simulator_holds_the_truth_and_refuses_another_law():
    """Potency of two steps from two quantities: the truth lies within the 90 % intervals, which take less than seven
    tenths of the prior; a record that no values give is called implausible."""
    rows = trials_at(np.random.default_rng(6).uniform(size=(40, 2)))
    truth = np.array([[0.3, 0.7]])
    expected = simulator(truth)[0]
    number = np.round(20.0 * np.exp(expected)).astype(int)
    fits, misses = (fitted(rows, values, number) for values in (expected, expected + np.array([3.0, -3.0])))
    assert fits.fits
    low, high = fits.posterior.quantiles(np.array([0.05, 0.95]))
    assert ((low < truth) & (truth < high)).all()
    assert (fits.posterior.width_left() < 0.7).all()
    predicted = fits.intervals()
    assert (predicted[0, :2] < np.exp(expected)).all()
    assert (np.exp(expected) < predicted[2, :2]).all()
    assert not misses.fits
    tested = calibrate_to_trials(fits, rows, np.arange(40), seed=2)
    assert tested.held.shape == (40, 2)
    assert 0.8 < tested.coverage < 0.98
    assert (tested.width.mean(axis=0) < 0.7).all()


def test_further_trials_lie_where_the_record_points_and_teach_more_than_even_ones():
    """A curved simulator with few trials: as many further ones as even ones lower the error of the prediction near the
    truth more. They keep apart."""
    truth = np.array([[0.25, 0.8]])
    designed = np.random.default_rng(3).uniform(size=(48, 2))

    def curved(points):
        wave = 1.5 * np.sin(5 * points[:, 0] + 4 * points[:, 1])
        return Rows(
            points,
            Outputs({"potency": simulator(points) + wave[:, None], "number": np.log(20) + simulator(points)}),
            np.arange(len(points)),
        )

    at = curved(truth).outputs.by_term
    number = np.round(np.exp(at["number"][0])).astype(int)
    first = fitted(curved(designed[:16]), at["potency"][0], number)
    added = further_points(first, 8, seed=1)
    assert added.shape == (8, 2)
    assert len(np.unique(added.round(2), axis=0)) > 4
    near = first.posterior.draws(200, seed=5)
    errors = []
    for points in (np.concatenate([designed[:16], added]), designed[:24]):
        found = fitted(curved(points), at["potency"][0], number)
        predicted = found.surrogate.predict(near)[0][:, :2]
        errors.append(np.sqrt(np.mean((predicted - curved(near).outputs.by_term["potency"]) ** 2)))
    assert errors[0] < 0.7 * errors[1]


def quantity(key, low, high, unit="", **more):
    """A quantity with a range."""
    return CalibratedQuantity.read({"key": key, "range": [f"{low} {unit}", f"{high} {unit}"], "source": "test", **more})


def test_strength_and_cohesion_are_inverse_and_agree_with_mohr_coulomb():
    """On the circle that touches the line: (s1 - s3) / 2 = c cos + (s1 + s3) / 2 sin."""
    for friction in (0.0, 20.0, 45.0):
        strength = strength_under(5e6, 3e6, friction)
        sine, cosine = np.sin(np.radians(friction)), np.cos(np.radians(friction))
        np.testing.assert_allclose((strength - 5e6) / 2, 3e6 * cosine + (strength + 5e6) / 2 * sine)
        np.testing.assert_allclose(cohesion_of(strength, 5e6, friction), 3e6)


def test_a_cohesion_given_by_a_strength_follows_from_the_friction_of_the_same_trial():
    """Written after the friction, whichever stands first; too small a strength is refused in one line."""
    text = {"materials": {"host": {"cohesion": {"residual": "2 MPa"}, "friction_angle": {"residual": "20 deg"}}}}
    strength = quantity("materials.host.cohesion.residual", 10, 30, "MPa", confinement="5 MPa")
    friction = quantity("materials.host.friction_angle.residual", 16, 24, "deg")
    for order in ((strength, friction), (friction, strength)):
        shares = [0.5 if one is strength else 1.0 for one in order]
        host = with_values(text, order, shares)["materials"]["host"]
        assert host["friction_angle"]["residual"] == "24 deg"
        cohesion = float(host["cohesion"]["residual"].removesuffix(" Pa"))
        np.testing.assert_allclose(strength_under(5e6, cohesion, 24.0), 20e6, rtol=1e-5)
    assert strength.title == "materials.host: residual strength under 5 MPa"
    with pytest.raises(InputError, match="less than friction of 20 deg alone gives"):
        with_values(text, [strength], [0.0])
    with pytest.raises(InputError, match="only a cohesion"):
        quantity("materials.host.friction_angle.residual", 10, 30, "deg", confinement="5 MPa")


def test_the_strength_that_a_ridge_tells_is_found_with_its_confinement():
    """A posterior along all pairs that have 25 MPa under 6 MPa: that confinement and strength are named. A measured
    friction angle would narrow the cohesion; two quantities that are unrelated are left alone."""
    friction = quantity("materials.host.friction_angle.residual", 16, 24, "deg")
    cohesion = quantity("materials.host.cohesion.residual", 0.5, 6, "MPa")
    idle = quantity("materials.host.youngs_modulus", 40, 70, "GPa")
    angles = np.linspace(16, 24, 401)
    bond = np.array([cohesion_of(25e6, 6e6, angle) for angle in angles]) / 1e6
    points = np.stack([(angles - 16) / 8, (bond - 0.5) / 5.5, np.random.default_rng(1).uniform(size=401)], axis=1)
    rows = trials_at(np.random.default_rng(6).uniform(size=(12, 2)))
    known = fitted(rows, np.zeros(2), np.ones(2, int))
    posterior = type(known.posterior)(points, np.full(401, 1 / 401), 0.0)
    fit = type(known)(known.surrogate, known.likelihood, posterior)
    (found,) = best_known_strengths(fit, [friction, cohesion, idle])
    assert found.confinement == pytest.approx(6.0, abs=0.3)
    assert (found.material, found.state) == ("materials.host", "residual")
    np.testing.assert_allclose([found.low, found.high], 25.0, rtol=0.02)
    assert found.width < 0.05
    telling = telling_observations(fit, [friction, cohesion, idle])
    assert {(one.measured.key, one.narrowed.key) for one in telling} == {
        (friction.key, cohesion.key),
        (cohesion.key, friction.key),
    }
    for one, variance in zip(telling, points.var(axis=0)[[1, 0]], strict=True):  # closed form of a straight ridge
        assert one.after / one.before == pytest.approx(np.sqrt(0.01 / (0.01 + variance)), rel=0.05)


@pytest.mark.parametrize(
    ("given", "problem"),
    [
        ({"range": ["2 MPa", "1 MPa"]}, "give the smaller value first"),
        ({"range": ["1 MPa", "2000 kPa"]}, "same unit"),
        ({"range": ["0 MPa", "2 MPa"], "scale": "log"}, "above 0"),
        ({"range": ["one", "2"]}, "is not a number"),
        ({"key": "cohesion"}, "does not match"),
        ({"source": ""}, "source"),
    ],
)
def test_wrong_quantities_are_refused(given, problem):
    """Each in one line."""
    right = {"key": "materials.host.cohesion.residual", "range": ["1 MPa", "2 MPa"], "source": "test"}
    CalibratedQuantity.read(right)
    with pytest.raises(InputError, match=problem):
        CalibratedQuantity.read(right | given)


def test_the_same_key_twice_is_refused():
    """The second would replace the first."""
    one = {"key": "seismic.closeness", "range": [0.7, 0.9], "source": "test"}
    with pytest.raises(InputError, match="stands twice"):
        CalibrationSettings.read({"quantities": [one, one]})
    with pytest.raises(InputError, match=r"terms\[1\]: potency stands twice"):
        CalibrationSettings.read({"quantities": [one], "terms": ["potency", "potency"]})


def test_values_of_a_range():
    """Ends, and the middle on both scales, as a mine file has them."""
    linear = CalibratedQuantity.read({"key": "a.b", "range": ["16 deg", "24 deg"], "source": "test"})
    assert [linear.written(share) for share in (0.0, 0.5, 1.0)] == ["16 deg", "20 deg", "24 deg"]
    log = CalibratedQuantity.read({"key": "a.b", "range": [1, 100], "scale": "log", "source": "test"})
    assert log.written(0.5) == 10.0


def test_entries_of_lists_are_named():
    """By their name, as messages name them; an unknown one is refused."""
    text = {"rock_bodies": [{"name": "dyke", "dip": "60 deg"}, {"name": "lens", "dip": "30 deg"}]}
    changed = with_values(text, [quantity("rock_bodies.lens.dip", 20, 40, "deg")], [1.0])
    assert [body["dip"] for body in changed["rock_bodies"]] == ["60 deg", "40 deg"]
    with pytest.raises(InputError, match=r"did you mean rock_bodies\.lens\?"):
        with_values(text, [quantity("rock_bodies.lense.dip", 20, 40, "deg")], [1.0])


def test_a_key_of_events_may_be_left_at_its_default():
    """It is written then; any other key that the mine file lacks is refused with what to do."""
    closeness = quantity("seismic.closeness", 0.7, 0.9)
    assert with_values({"name": "mine"}, [closeness], [0.5])["seismic"] == {"closeness": 0.8}
    assert with_values({"seismic": {"method": "families"}}, [closeness], [0.0])["seismic"]["closeness"] == 0.7
    with pytest.raises(InputError, match="write it there first"):
        with_values({"name": "mine"}, [quantity("solver.damping", 0.5, 0.9)], [0.5])


def test_mine_files_take_the_values_and_nothing_else(tmp_path):
    """Only the named key changes; a key that the mine file lacks is refused with the nearest one. A draw is known by
    its posterior, and by its content."""
    text = {"name": "mine", "materials": {"host": {"cohesion": {"intact": "8 MPa", "residual": "2 MPa"}}}}
    quantity = CalibratedQuantity.read(
        {"key": "materials.host.cohesion.residual", "range": ["1 MPa", "3 MPa"], "source": "test"}
    )
    write_mine(tmp_path / "middle.yaml", text, [quantity], [0.25], "posterior")
    written = yaml.safe_load((tmp_path / "middle.yaml").read_text())
    assert written["materials"]["host"]["cohesion"] == {"intact": "8 MPa", "residual": "1.5 MPa"}
    assert written["name"] == "mine_middle"
    assert text["materials"]["host"]["cohesion"]["residual"] == "2 MPa"
    assert is_draw_of(tmp_path / "middle.yaml", "posterior")
    assert not is_draw_of(tmp_path / "middle.yaml", "another")
    (tmp_path / "middle.yaml").write_text((tmp_path / "middle.yaml").read_text().replace("1.5 MPa", "1.6 MPa"))
    assert not is_draw_of(tmp_path / "middle.yaml", "posterior")
    slip = CalibratedQuantity.read(
        {"key": "materials.host.cohesion.residul", "range": ["1 MPa", "3 MPa"], "source": "test"}
    )
    with pytest.raises(InputError, match=r"did you mean materials\.host\.cohesion\.residual\?"):
        with_values(text, [slip], [0.5])
