"""From a step's failed particles to events: values worked out by hand, a closed budget, order in time, empty steps."""

import json

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from common.datasets import read_dataset
from common.errors import InputError
from common.event_table import FIELDS, NAMES, read_events, write_events
from common.source_tensors import scalar_potency
from common.voigt import tensor_from_voigt
from seismic.budget import BUDGET_PARTS
from seismic.events import extract_events

SHEAR = np.array([0, 0, 0, 0, 0, 1e-3])
OPENING = np.array([0, 0, 1e-3, 0, 0, 0])


def line(start, count, spacing=1.25):
    """Particles in a row along x."""
    return np.asarray(start, dtype=float) + spacing * np.arange(count)[:, None] * [1, 0, 0]


def test_one_event_by_hand(make_step, make_settings):
    """Four particles in a row, the last with twice the drop: weights 1, 1, 1, 2 of 2e-3 * 1.25^3 m3."""
    unit = 2e-3 * 1.25**3
    strain = np.array([SHEAR, SHEAR, SHEAR, 2 * SHEAR])
    events, budget = extract_events(make_step(line([1e5, 50, -800], 4), strain), make_settings())
    assert events.sizes["event"] == 1
    event = events.isel(event=0)
    assert_allclose(event.potency, 5 * unit, rtol=1e-14)
    assert_allclose(event.potency_tensor, [[0, 2.5 * unit, 0], [2.5 * unit, 0, 0], [0, 0, 0]], rtol=1e-14)
    assert_allclose(event.moment, 22.8e9 * 5 * unit, rtol=1e-14)
    assert_allclose(event.mw, 2 / 3 * (np.log10(22.8e9 * 5 * unit) - 9.1), rtol=1e-14)
    assert_allclose(event.location, [1e5 + 1.25 * (0 + 1 + 2 + 2 * 3) / 5, 50, -800], rtol=1e-15)
    assert_allclose([event.iso, event.clvd, event.dc], [0, 0, 1], atol=1e-12)
    assert_allclose(np.abs(event.p_axis), [np.sqrt(0.5), np.sqrt(0.5), 0], atol=1e-12)
    assert_allclose(np.sign(event.p_axis[0] * event.p_axis[1]), -1)  # slip along +x above +y: P from north-west
    assert_allclose(np.sign(event.t_axis[0] * event.t_axis[1]), 1)
    assert (int(event.particles), int(event.resolved), str(event.step.values)) == (4, 1, "2019-08")
    # row at 0, 1, 2, 3 spacings, weights 1 1 1 2, mean 1.8: mean square (3.24 + 0.64 + 0.04 + 2 * 1.44) / 5 = 1.36,
    # a full cube adds 3/12; the ball of that mean square radius has the radius sqrt(5/3 * 1.61) spacings
    assert_allclose(event.source_size, 2 * 1.25 * np.sqrt(5 / 3 * 1.61), rtol=1e-9)
    assert budget["particle_scalars"] == pytest.approx(5 * unit, rel=1e-14)
    assert budget["scalar_ratio"] == pytest.approx(1.0, rel=1e-14)


def test_a_single_particle_is_as_large_as_its_cube(make_step, make_settings):
    """Mean square radius of a cube: s^2 / 4, of a square s^2 / 6; balls 5/3 and discs 2 times that, squared radius."""
    step = make_step([[0, 0, 0]], [SHEAR], spacing=2.0)
    events, _ = extract_events(step, make_settings())
    assert_allclose(events.source_size, 2 * np.sqrt(5 / 3), rtol=1e-14)
    assert_array_equal(events.resolved, 0)
    events, _ = extract_events(step, make_settings(thickness=3.0))
    assert_allclose(events.source_size, 2 * np.sqrt(4 / 3), rtol=1e-14)


def test_events_tell_how_much_of_them_is_slip_on_weak_planes(make_step, make_settings):
    """A row of three materials: shear xy is slip on planes across x and across y, not across z, and rock without planes
    has none. Weights 1, 1, 2, 4: the last particle's is none. Without planes anywhere nothing is said."""
    strain = np.array([SHEAR, SHEAR, 2 * SHEAR, 4 * SHEAR])
    step = make_step(line([0, 0, 0], 4), strain)
    assert "on_planes" not in extract_events(step, make_settings())[0]
    step = step.assign(material=("particle", np.array([0, 1, 1, 2], np.int16)))
    names = json.dumps(["bedded", "fault", "host"])

    def share(**normals):
        moduli = json.dumps({name: [2e10, 2e10] for name in ("bedded", "fault", "host")})
        labelled = step.assign_attrs(material_names=names, elastic_moduli=moduli, plane_normals=json.dumps(normals))
        return extract_events(labelled, make_settings())[0]["on_planes"].values

    assert_allclose(share(bedded=[1.0, 0.0, 0.0], fault=[0.0, -1.0, 0.0]), [4 / 8])
    assert_allclose(share(bedded=[1.0, 0.0, 0.0], fault=[0.0, 0.0, 1.0]), [1 / 8])
    assert_allclose(share(bedded=[0.6, 0.8, 0.0]), [0.0])  # some of it deforms these planes


@pytest.mark.parametrize("plane", ["none", "xz"])
@pytest.mark.parametrize("method", ["simultaneous", "families"])
def test_rock_of_cells_that_a_wall_cuts_hangs_together_by_its_cells(method, plane, make_step, make_settings):
    """Rock that lies anywhere in its cells is linked as rock in their middles is, and located where it is."""
    random, count, size = np.random.default_rng(2), 12, 1.25
    middle = line([100.0, 200.0 * (plane == "none"), -30.0], count, size)
    axes = [0, 1, 2] if plane == "none" else [0, 2]
    origin, position = np.zeros((count, 3)), middle.copy()
    origin[:, axes] = middle[:, axes] - 0.5 * size
    position[:, axes] += random.uniform(-0.45, 0.45, (count, len(axes))) * size
    step = make_step(position, np.tile([0.0, 0.0, 0.0, 0.0, 1e-3, 0.0], (count, 1)))
    step = step.assign_attrs(plane=plane).assign(
        cell=("particle", np.arange(count)),
        cell_origin=(("cell", "xyz"), origin),
        cell_size=("cell", np.full(count, size)),
    )
    settings = make_settings(method=method)
    if method == "simultaneous":
        del settings["cluster"]
    events, _ = extract_events(step, settings)
    assert events.particles.values.tolist() == [count]
    np.testing.assert_allclose(events.location.values[0][axes], position.mean(axis=0)[axes], atol=1e-9)


def test_two_mechanisms_at_one_place_are_two_events(make_step, make_settings):
    position = np.repeat(line([0, 0, 0], 5), 2, axis=0)
    strain = np.tile([SHEAR, 0.5 * OPENING], (5, 1))
    events, budget = extract_events(make_step(position, strain), make_settings())
    assert_array_equal(events.particles, [5, 5])
    assert_allclose(events.iso, [0, 1 / 3], atol=1e-12)
    assert budget["event_scalars"] == pytest.approx(float(events.potency.sum()), rel=1e-14)


def test_scalar_of_a_sum_is_less_than_the_sum_of_scalars(make_step, make_settings):
    """Shear and stretch of equal size, 45 degrees apart about their mean, in one family: ratio cos(22.5 degrees)."""
    mixed = np.array([[1e-3, -1e-3, 0, 0, 0, 1e-3], [0, 0, 0, 0, 0, np.sqrt(2) * 1e-3]])
    events, budget = extract_events(make_step(line([0, 0, 0], 2), mixed), make_settings(closeness=0.7))
    assert events.sizes["event"] == 2  # noise: too few for DBSCAN
    chained = make_settings(closeness=0.7, cluster={"method": "single_linkage", "radius_cells": 1.8, "min_samples": 2})
    events, budget = extract_events(make_step(line([0, 0, 0], 2), mixed), chained)
    assert events.sizes["event"] == 1
    assert budget["scalar_ratio"] == pytest.approx(np.cos(np.pi / 8), rel=1e-12)


@pytest.mark.parametrize("seismic_fraction", [1.0, 0.3])
@pytest.mark.parametrize("method", ["dbscan", "single_linkage", "kmeans"])
def test_budget_closes_in_every_component(make_scattered_step, make_settings, method, seismic_fraction):
    """Every part against a plain loop over particles, negative components included; closure to 1e-12."""
    step = make_scattered_step()
    cluster = {"method": method, "radius_cells": 1.8, "min_samples": 3}
    events, budget = extract_events(step, make_settings(cluster=cluster, seismic_fraction=seismic_fraction))
    parts = {name: np.zeros(6) for name in ("seismic", "overshoot", "later")}
    for particle in range(step.sizes["particle"]):
        for name in parts:
            parts[name] += step[f"{name}_strain"].values[particle] * step["volume"].values[particle]
    assert np.min(parts["seismic"]) < 0 < np.max(parts["seismic"])
    assert_allclose(budget["events"], seismic_fraction * parts["seismic"], rtol=1e-10)
    assert_allclose(budget["aseismic_share"], (1 - seismic_fraction) * parts["seismic"], rtol=1e-10)
    assert_allclose(budget["overshoot"], parts["overshoot"], rtol=1e-10)
    assert_allclose(budget["later"], parts["later"], rtol=1e-10)
    assert_allclose(sum(np.array(budget[name]) for name in BUDGET_PARTS), budget["plastic"], rtol=1e-10)
    assert max(budget["closure"]) <= 1e-12
    assert json.loads(events.attrs["budget"]) == budget
    tensor = events["potency_tensor"].values.sum(axis=0)
    assert_allclose(tensor, tensor.T, rtol=1e-14)
    assert_allclose(tensor[[0, 1, 2, 1, 0, 0], [0, 1, 2, 2, 2, 1]], budget["events"], rtol=1e-12)
    assert budget["scalar_ratio"] <= 1.0
    resolved = events["resolved"].values == 1
    assert budget["resolved_scalars"] == pytest.approx(float(events["potency"].values[resolved].sum()))


def test_budget_that_does_not_close_is_refused(make_scattered_step, make_settings):
    step = make_scattered_step()
    step["plastic_strain_step"][5, 4] += 1e-8
    with pytest.raises(InputError, match="step 2019-08: potency budget of component xz misses"):
        extract_events(step, make_settings())


def test_every_failed_particle_is_in_one_event(make_scattered_step, make_settings):
    step = make_scattered_step()
    events, budget = extract_events(step, make_settings())
    assert int(events["particles"].sum()) == int((step["failed"] == 2).sum())
    assert_allclose(scalar_potency(events["potency_tensor"].values), events["potency"], rtol=1e-12)
    assert 0 < int(events["resolved"].sum()) < events.sizes["event"]
    small = events["potency"].values < events.attrs["potency_floor"]
    unresolved = events["resolved"].values == 0
    assert np.all(unresolved[small])
    assert np.all(events["particles"].values[unresolved & ~small] == 1)
    assert budget["event_scalars"] == pytest.approx(float(events["potency"].sum()))


def test_events_follow_increment_then_earliest_generation(make_step, make_settings):
    """Three patches far apart. Earliest (increment, generation): first (1, 0), second (0, 7), third (0, 2)."""
    position = np.concatenate([line([0, 0, 0], 3), line([100, 0, 0], 3), line([200, 0, 0], 3)])
    order = [[1, 0], [2, 0], [3, 0], [0, 9], [0, 7], [1, 0], [3, 3], [0, 2], [0, 4]]
    step = make_step(position, np.tile(SHEAR, (9, 1)), failure_order=order, end="2019-08-31")
    events, _ = extract_events(step, make_settings())
    assert_allclose(events["location"][:, 0], [201.25, 101.25, 1.25])
    hours = (events["time"].values - np.datetime64("2019-08-01")) / np.timedelta64(1, "h")
    assert_allclose(hours, [5 * 24, 15 * 24, 25 * 24])  # 30 days: (rank - 1/2) / 3
    assert_allclose(events["time_lower_uncertainty"], [5 * 86400, 15 * 86400, 25 * 86400])
    assert_allclose(events["time_upper_uncertainty"], [25 * 86400, 15 * 86400, 5 * 86400])


def test_an_events_time_less_and_plus_its_uncertainty_is_its_step(make_scattered_step, make_settings):
    """To the microsecond, for every event; it was half a step on both sides, right for the middle event alone."""
    events, _ = extract_events(make_scattered_step(2, 150), make_settings())
    assert events.sizes["event"] > 20
    for name, sign, date in (("lower", -1, "2019-08-01"), ("upper", 1, "2019-09-01")):
        reach = np.rint(events[f"time_{name}_uncertainty"].values * 1e6).astype("timedelta64[us]")
        assert_array_equal(events["time"].values + sign * reach, np.datetime64(date))


def test_moments_have_the_moduli_of_the_rock_that_failed(make_step, make_settings):
    """Shear in a soft seam has M0 = mu P with the seam's mu, not the host's; an opening that spans both rocks has the
    sum lambda tr(P) I + 2 mu P of its two parts. It was the host's everywhere: Mw 0.64 too large in this seam."""
    moduli = {"host": [22.8e9, 22.8e9], "seam": [5e9, 2.5e9]}
    position = np.concatenate([line([0, 0, 0], 3), line([100, 0, 0], 3), line([200, 0, 0], 4)])
    strain = np.concatenate([np.tile(SHEAR, (6, 1)), np.tile(OPENING, (4, 1))])
    step = make_step(position, strain, failure_order=np.repeat([[0, 0], [1, 0], [2, 0]], [3, 3, 4], axis=0))
    step = step.assign(material=("particle", np.array([0, 0, 0, 1, 1, 1, 0, 0, 0, 1], np.int16)))
    step.attrs |= {"material_names": json.dumps(list(moduli)), "elastic_moduli": json.dumps(moduli)}
    events, _ = extract_events(step, make_settings())
    assert_array_equal(events["particles"], [3, 3, 4])
    potency = events["potency"].values
    assert_allclose(events["moment"][:2], [22.8e9 * potency[0], 2.5e9 * potency[1]], rtol=1e-12)
    assert float(events["mw"][0] - events["mw"][1]) == pytest.approx(2 / 3 * np.log10(22.8 / 2.5))
    one = tensor_from_voigt(np.asarray(OPENING)) * 1.25**3
    expected = sum(
        count * (lame * np.trace(one) * np.eye(3) + 2 * mu * one)
        for count, (lame, mu) in zip((3, 1), moduli.values(), strict=True)
    )
    assert_allclose(events["moment_tensor"][2], expected, rtol=1e-12)
    assert_allclose(events["moment"][2], np.sqrt((expected**2).sum() / 2), rtol=1e-12)


def test_equal_order_falls_back_to_the_first_particle(make_step, make_settings):
    position = np.concatenate([line([0, 0, 0], 3), line([100, 0, 0], 3)])[[3, 0, 1, 2, 4, 5]]
    events, _ = extract_events(make_step(position, np.tile(SHEAR, (6, 1))), make_settings())
    assert_allclose(events["location"][:, 0], [101.25, 1.25])


def test_dates_with_a_zone_are_utc_in_the_dataset(make_step, make_settings):
    step = make_step([[0, 0, 0]], [SHEAR], start="2019-08-01T10:00:00+10:00", end="2019-08-01T04:00:00Z")
    events, _ = extract_events(step, make_settings())
    assert events["time"].values[0] == np.datetime64("2019-08-01T02:00:00")


def test_floor_is_that_of_min_samples_full_cells_at_the_median_drop(make_step, make_settings):
    """Drops 1, 2, 9: median 2, times 2e-3 (scalar of tensor shear 1e-3) times 3 times 1.25^3, for any volumes."""
    strain = np.array([1.0, 2.0, 9.0])[:, None] * SHEAR
    step = make_step(line([0, 0, 0], 3), strain, volume=[0.1, 0.2, 0.3])
    events, _ = extract_events(step, make_settings(seismic_fraction=0.5))
    assert events.attrs["potency_floor"] == pytest.approx(0.5 * 3 * 2 * 2e-3 * 1.25**3, rel=1e-14)
    assert events.attrs["location_error"] == 1.25
    events, _ = extract_events(step, make_settings(thickness=4.0))
    assert events.attrs["potency_floor"] == pytest.approx(3 * 2 * 2e-3 * 1.25**2 * 4, rel=1e-14)


def test_mined_particles_and_those_without_a_drop_make_no_event(make_step, make_settings):
    strain = np.array([SHEAR, SHEAR, SHEAR, 0 * SHEAR, SHEAR])
    step = make_step(line([0, 0, 0], 5), strain, volume=[1, 1, 1, 1, 0])
    events, _ = extract_events(step, make_settings())
    assert_array_equal(events["particles"], [3])


def check_round_trip(events, path):
    """Write, read and compare values, types and attributes; write again and compare bytes."""
    write_events(events, path)
    assert read_dataset(path)["time"].encoding["units"] == "nanoseconds since 1970-01-01"  # whatever the events
    again = read_events(path)
    for field in FIELDS:
        assert (again[field.name].dims, again[field.name].dtype) == (field.dims, field.dtype)
        assert_array_equal(again[field.name].values, events[field.name].values)
    assert json.loads(again.attrs["budget"]) == json.loads(events.attrs["budget"])
    first = path.read_bytes()
    write_events(events, path)
    assert path.read_bytes() == first


def test_round_trip_and_bytes(make_scattered_step, make_settings, tmp_path):
    events, _ = extract_events(make_scattered_step(), make_settings())
    check_round_trip(events, tmp_path / "events.nc")
    again, _ = extract_events(make_scattered_step(), make_settings())
    write_events(again, tmp_path / "again.nc")
    assert (tmp_path / "again.nc").read_bytes() == (tmp_path / "events.nc").read_bytes()


@pytest.mark.parametrize("particles", [0, 4])
def test_a_step_where_nothing_fails_gives_no_events_but_a_valid_dataset(make_step, make_settings, particles, tmp_path):
    step = make_step(line([0, 0, 0], particles), np.zeros((particles, 6)), failed=False)
    events, budget = extract_events(step, make_settings())
    assert events.sizes["event"] == 0
    assert set(events.data_vars) == set(NAMES)
    assert budget["scalar_ratio"] is None
    assert_array_equal(budget["plastic"], 0.0)
    assert np.isnan(events.attrs["potency_floor"])
    check_round_trip(events, tmp_path / "empty.nc")


def test_an_undated_step_gives_events_without_times(make_step, make_settings, tmp_path):
    step = make_step(line([0, 0, 0], 4), np.tile(SHEAR, (4, 1)), step="history", start="", end="", dated=0)
    events, _ = extract_events(step, make_settings())
    assert events.sizes["event"] == 1
    assert np.isnat(events["time"].values).all()
    assert np.isnan(events["time_lower_uncertainty"].values).all()
    assert np.isnan(events["time_upper_uncertainty"].values).all()
    check_round_trip(events, tmp_path / "history.nc")


def test_a_step_that_contradicts_itself_is_refused(make_step, make_settings):
    good = make_step(line([0, 0, 0], 3), np.tile(SHEAR, (3, 1)))
    without_moduli = good.copy()
    del without_moduli.attrs["elastic_moduli"]
    for broken, message in (
        (good.drop_vars("overshoot_strain"), "it lacks overshoot_strain"),
        (without_moduli, "it lacks elastic_moduli"),
        (good.assign_attrs(mine="other"), "belongs to mine other, not to testmine"),
        (good.assign_attrs(step_index=5), "3 particles have seismic strain but did not fail in it"),
        (good.assign_attrs(end="2019-08-01"), "is not after start"),
        (good.assign_attrs(end=""), "end: '' is not an ISO date"),
        (good.assign(seismic_strain=good.seismic_strain * np.nan), "not finite"),
    ):
        with pytest.raises(InputError, match=message):
            extract_events(broken, make_settings())


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"seismic_fraction": 0.0}, r"seismic\.seismic_fraction: 0\.0"),
        ({"seismic_fraction": 1.5}, r"seismic\.seismic_fraction: 1\.5"),
        ({"closeness": 1.0}, r"seismic\.closeness: 1\.0"),
        ({"thickness": 0.0}, r"seismic\.thickness: 0\.0 is out of range"),
        ({"alpha": 1.0}, r"seismic\.alpha: unknown key"),
    ],
)
def test_impossible_settings_are_refused_even_without_events(make_step, make_settings, change, message):
    with pytest.raises(InputError, match=message):
        extract_events(make_step(np.empty((0, 3)), np.empty((0, 6))), make_settings(**change))


def test_missing_settings_are_refused(make_step, make_settings):
    settings = make_settings()
    del settings["frame"]
    with pytest.raises(InputError, match=r"seismic\.frame: missing key"):
        extract_events(make_step([[0, 0, 0]], [SHEAR]), settings)
