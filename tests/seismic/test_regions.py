"""Events as regions: what is linked, what leads, and that neither order nor cells nor rock far away decide."""

import numba
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_array_equal
from scipy.ndimage import gaussian_filter
from sklearn.metrics import adjusted_rand_score

from common.voigt import tensor_from_voigt
from seismic.event_settings import EventSettings
from seismic.events import extract_events, failed_rock, middle_of_increments, potency_floor, unlike_share
from seismic.families import closeness
from seismic.regions import find_regions

SHEAR = np.array([0, 0, 0, 0, 0, 1.0])
OPENING = np.array([1.0, 0, 0, 0, 0, 0])


def lattice(*counts):
    """Centres of cubes of 1 m, (particle, 3), far from the origin."""
    place = np.stack(np.meshgrid(*map(np.arange, counts), indexing="ij"), -1).reshape(-1, len(counts))
    return place + np.array([1e5, 2e5, -300.0])


def smooth_field(seed, *counts):
    """Particles of a lattice whose mechanisms, sizes and parts of the step change over some cells."""
    generator = np.random.default_rng(seed)

    def smooth(width):
        return gaussian_filter(generator.normal(size=counts), width).ravel()

    potency = np.stack([smooth(2.0) for _ in range(6)], -1)
    potency += 0.2 * potency.std() * generator.normal(size=potency.shape)
    part = (smooth(4.0) > 0.0).astype(int)
    size = 10 ** generator.normal(-3.0, 0.4, (len(potency), 1))
    return lattice(*counts), size * potency, part


def regions_of(potency, position=None, part=None, length=1.0, threshold=0.8):
    """Regions of a row of particles a metre apart, all of one part of the step unless given."""
    potency = np.asarray(potency, float)
    position = lattice(len(potency), 1, 1) if position is None else np.asarray(position, float)
    part = np.zeros(len(potency), int) if part is None else np.asarray(part)
    return find_regions(position, potency, part, length, threshold)


def test_what_hangs_together_and_is_alike_is_one_event():
    assert_array_equal(regions_of([SHEAR] * 4), 0)
    assert_array_equal(regions_of([SHEAR] * 3 + [OPENING] * 3), [0, 0, 0, 1, 1, 1])
    assert_array_equal(regions_of([SHEAR] * 4, part=[0, 0, 1, 1]), [0, 0, 1, 1])


@pytest.mark.parametrize(("gap", "events"), [(2.0, 1), (2.001, 2)])
def test_rock_hangs_together_within_the_link_length(gap, events):
    """Also across a corner of the cubes in which particles are sought, and where the gap is the length itself."""
    for way in ([1, 0, 0], [0, -1, 0], [0.6, 0, 0.8], [-2 / 3, 2 / 3, 1 / 3]):
        for origin in (0.0, 0.999, 1e5 / 3):
            position = origin + np.outer([0.0, gap], way)
            assert regions_of([SHEAR] * 2, position=position, length=2.0).max() + 1 == events


def test_the_largest_potency_leads():
    """Between two mechanisms (cosine 0.5), a little rock of the mean of both is near to each (0.87). It belongs to the
    one with more potency around it."""
    one, other = SHEAR, 0.5 * SHEAR + np.sqrt(0.75) * np.sqrt(2.0) * OPENING
    between = (one + other) / 10
    assert_array_equal(regions_of([2 * one, 2 * one, between, other, other]), [0, 0, 0, 1, 1])
    assert_array_equal(regions_of([one, one, between, 2 * other, 2 * other]), [0, 0, 1, 1, 1])


def test_a_mechanism_that_turns_is_divided():
    """A row whose mechanism turns by 5 degrees a cell: rock of an event is near its leader, and no two are opposed."""
    angle = np.radians(5.0 * np.arange(73))
    potency = np.cos(angle)[:, None] * SHEAR + np.sin(angle)[:, None] * OPENING * np.sqrt(2.0)
    label = regions_of(potency, length=1.0)
    tensor = tensor_from_voigt(potency)
    for region in range(label.max() + 1):
        own = tensor[label == region]
        assert closeness(own[:, None], own[None]).min() > np.cos(2 * np.arccos(0.8)) - 1e-9
    assert 5 <= label.max() + 1 <= 14


def slow_regions(position, potency, part, length, threshold):
    """The definition, over sets of particles. Leaders of equal size are the test's to avoid."""
    tensor = tensor_from_voigt(potency)
    near = np.linalg.norm(position[:, None] - position[None], axis=2) <= length * (1 + 1e-9)
    near &= part[:, None] == part[None]
    around = np.einsum("ab,bij->aij", near, tensor)
    label = np.full(len(position), -1)
    for leader in np.argsort(-np.linalg.norm(around, axis=(1, 2))):
        if label[leader] >= 0:
            continue
        alike = (closeness(around, around[leader]) > threshold) & (label < 0)
        region, rim = {leader}, [leader]
        while rim:
            fresh = set(np.flatnonzero(near[rim.pop()] & alike)) - region
            region |= fresh
            rim += fresh
        label[list(region)] = leader
    return label


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 10**6), st.sampled_from([0.6, 0.8, 0.95]), st.sampled_from([1.0, 1.5, 2.0]))
def test_the_definition_written_plainly_gives_the_same(seed, threshold, length):
    position, potency, part = smooth_field(seed, 6, 5, 4)
    label = find_regions(position, potency, part, length, threshold)
    assert adjusted_rand_score(label, slow_regions(position, potency, part, length, threshold)) == 1.0
    _, first = np.unique(label, return_index=True)
    assert_array_equal(np.argsort(first), np.arange(len(first)))  # numbered by the first particle of each


@pytest.mark.parametrize("seed", range(3))
def test_order_and_threads_are_nothing(seed):
    position, potency, part = smooth_field(seed, 15, 12, 10)
    label = find_regions(position, potency, part, 2.0, 0.8)
    shuffled = np.random.default_rng(seed).permutation(len(label))
    numba.set_num_threads(1)
    again = find_regions(position[shuffled], potency[shuffled], part[shuffled], 2.0, 0.8)
    numba.set_num_threads(numba.config.NUMBA_NUM_THREADS)
    assert adjusted_rand_score(label[shuffled], again) == 1.0
    assert 20 < label.max() < len(label) / 2


@pytest.mark.parametrize("seed", range(3))
def test_mirrored_turned_and_scaled_rock_has_the_same_events(seed):
    """The tensors of a mirrored or turned field are so, too; units of length and potency are nothing."""
    position, potency, part = smooth_field(seed, 10, 9, 8)
    label = find_regions(position, potency, part, 2.0, 0.8)
    swap = np.array([1, 0, 2, 4, 3, 5])  # x and y
    for place, tensor, length in (
        (position * [-1, 1, 1], potency * [1, 1, 1, 1, -1, -1], 2.0),
        (position[:, [1, 0, 2]], potency[:, swap], 2.0),
        (1e-3 * position, 1e-12 * potency, 2e-3),
    ):
        assert adjusted_rand_score(label, find_regions(place, tensor, part, length, 0.8)) == 1.0


@pytest.mark.parametrize("seed", range(3))
def test_rock_far_away_changes_no_event(seed):
    """Half of a field alone, against the whole: the same events from 15 cells off the cut on."""
    position, potency, part = smooth_field(seed, 60, 12, 12)
    label = find_regions(position, potency, part, 2.0, 0.8)
    half = position[:, 0] < 1e5 + 40
    alone = find_regions(position[half], potency[half], part[half], 2.0, 0.8)
    away = position[half, 0] < 1e5 + 25
    assert adjusted_rand_score(label[half][away], alone[away]) >= 0.99


@pytest.mark.parametrize("seed", range(3))
def test_half_the_cells_give_the_events_of_the_whole_ones(seed):
    """A field whose particles are each split into eight: potencies of events in order, the largest of them."""
    position, potency, part = smooth_field(seed, 14, 12, 10)
    potency = np.stack([gaussian_filter(one.reshape(14, 12, 10), 1.0).ravel() for one in potency.T], -1)
    offsets = 0.25 * (2.0 * np.stack(np.meshgrid(*[[0, 1]] * 3, indexing="ij"), -1).reshape(-1, 3) - 1.0)
    fine = (position[:, None] + offsets).reshape(-1, 3)
    coarse_label = find_regions(position, potency, part, 3.0, 0.8)
    fine_label = find_regions(fine, np.repeat(potency / 8.0, 8, axis=0), np.repeat(part, 8), 3.0, 0.8)
    assert adjusted_rand_score(np.repeat(coarse_label, 8), fine_label) > 0.7
    sizes = [
        np.sort(np.linalg.norm([potencies[label == one].sum(axis=0) for one in range(label.max() + 1)], axis=1))[::-1]
        for label, potencies in ((coarse_label, potency), (fine_label, np.repeat(potency / 8.0, 8, axis=0)))
    ]
    assert sizes[1][:5] == pytest.approx(sizes[0][:5], rel=0.25)


def test_no_rock_and_rock_whose_mechanisms_cancel():
    assert len(regions_of(np.empty((0, 6)), position=np.empty((0, 3)))) == 0
    assert_array_equal(regions_of([SHEAR, -SHEAR], length=1.0), [0, 1])  # around both is nothing
    assert_array_equal(regions_of([SHEAR] * 3, position=np.zeros((3, 3))), 0)  # all at one place


def test_events_of_a_step_by_regions_close_the_budget(make_scattered_step, make_settings):
    """In space and in a plane: all particles are in events, what is resolved, the share of unlike particles."""
    chosen = make_settings(method="simultaneous", least_particles=2)
    del chosen["cluster"]
    step = make_scattered_step()
    flat = step.assign(position=step["position"] * [1.0, 1.0, 0.0])
    for chosen_here, rock in ((chosen, step), (chosen | {"thickness": 2.0}, flat)):
        events, budget = extract_events(rock, chosen_here)
        assert int(events.particles.sum()) == int((rock["failed"] == 2).sum())
        assert max(budget["closure"]) <= 1e-12
        assert budget["event_scalars"] == pytest.approx(float(events.potency.sum()), rel=1e-14)
        floor = events.attrs["potency_floor"]
        assert_array_equal(events.resolved, events.potency >= floor)
        assert 0 < int(events.resolved.sum()) < events.sizes["event"]
        assert events.attrs["link_length"] == 4.0
        assert 0.0 <= events.attrs["unlike_share"] < 1.0


def test_parts_of_a_step_follow_from_the_load_and_not_from_the_increments(make_step):
    """Rock that fails at loads 0.1, 0.2, 0.6 and 0.9: two parts make two events of it, four make three."""
    position = np.zeros((4, 3)) + np.arange(4.0)[:, None]
    step = make_step(position, np.tile(1e-4 * SHEAR, (4, 1)), failure_order=[[1, 0], [2, 5], [3, 0], [4, 1]])
    assert step["convergence_increment"].values.tolist() == [1, 2, 3, 4]
    step["convergence_load"] = "iteration", [0.2, 0.2, 1.0, 1.0]  # the second adds nothing
    assert middle_of_increments(step).tolist() == [0.0, 0.1, 0.2, 0.6, 1.0]
    chosen = EventSettings(mine="testmine", frame={"surface": "0 m"}, link_length="2 m", least_particles=1)
    rock = failed_rock(step, chosen)
    for parts, expected in ((1, [0, 0, 0, 0]), (2, [0, 0, 1, 1]), (4, [0, 0, 1, 2]), (None, [0, 0, 1, 2])):
        assert_array_equal(rock.events(chosen, parts)[0], expected)


def test_an_increment_that_was_tried_before_counts_as_it_was_accepted(make_step):
    step = make_step(np.zeros((2, 3)), np.tile(1e-4 * SHEAR, (2, 1)), failure_order=[[1, 0], [2, 0]])
    step = step.drop_vars(["convergence_increment", "convergence_load"])
    step["convergence_increment"] = "iteration", [1, 1, 1, 2, 2]
    step["convergence_load"] = "iteration", [1.0, 0.25, 0.25, 1.0, 0.5]
    assert middle_of_increments(step).tolist() == [0.0, 0.125, 0.375]


def test_the_floor_is_that_of_full_particles_of_the_median_drop():
    """3 particles of 2 m cells with a drop of 1e-4 along a plane (potency 2e-4 of a unit volume); in plane strain 5 m
    thick."""
    strain = np.tile(1e-4 * SHEAR, (7, 1)) * np.array([1, 1, 1, 1, 9, 9, 0.1])[:, None]
    chosen = EventSettings(mine="a", frame={"surface": "0 m"}, seismic_fraction=0.5)
    assert potency_floor(strain, np.full(7, 2.0), chosen) == pytest.approx(3 * 0.5 * 2e-4 * 8.0)
    flat = chosen.model_copy(update={"thickness": 5.0})
    assert potency_floor(strain, np.full(7, 2.0), flat) == pytest.approx(3 * 0.5 * 2e-4 * 4.0 * 5.0)
    assert np.isnan(potency_floor(strain[:0], np.empty(0), chosen))


def test_share_of_unlike_particles_is_that_of_a_loop():
    _, potency, _ = smooth_field(0, 5, 5, 5)
    event = np.random.default_rng(0).integers(0, 30, len(potency))
    total = np.stack([potency[event == number].sum(axis=0) for number in range(30)])
    unlike = whole = 0.0
    for particle, number in zip(potency, event, strict=True):
        own, its = (tensor_from_voigt(one) for one in (particle, total[number]))
        whole += np.linalg.norm(own)
        if np.vdot(own, its) < 0.5 * np.linalg.norm(own) * np.linalg.norm(its):
            unlike += np.linalg.norm(own)
    assert 0.1 < unlike / whole < 0.9
    assert unlike_share(potency, event, total, 0.5) == pytest.approx(unlike / whole, rel=1e-12)
    assert unlike_share(potency[:0], event[:0], total[:0], 0.5) == 0.0
