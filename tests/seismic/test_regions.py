"""Events as regions: what is linked, what may join, and that neither order nor rock far away decides."""

from unittest import mock

import numba
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_array_equal
from scipy.ndimage import gaussian_filter
from sklearn.metrics import adjusted_rand_score

from common.voigt import tensor_from_voigt
from seismic import regions
from seismic.events import at_once_share, extract_events, unlike_share
from seismic.families import closeness
from seismic.regions import CORNERS, EDGES, FACES, MAX_JOINING_SHARE, find_regions

SHEAR = np.array([0, 0, 0, 0, 0, 1.0])
OPENING = np.array([1.0, 0, 0, 0, 0, 0])


def lattice(*counts):
    """Centres of cubes of 1 m, (particle, 3), far from the origin."""
    place = np.stack(np.meshgrid(*map(np.arange, counts), indexing="ij"), -1).reshape(-1, len(counts))
    return place + np.array([1e5, 2e5, -300.0])


def smooth_field(seed, *counts):
    """Particles of a lattice whose mechanisms, sizes, increments and generations change over some cells."""
    generator = np.random.default_rng(seed)

    def smooth(width):
        return gaussian_filter(generator.normal(size=counts), width).ravel()

    potency = np.stack([smooth(2.0) for _ in range(6)], -1)
    potency += 0.4 * potency.std() * generator.normal(size=potency.shape)
    increment = (smooth(4.0) > 0.0).astype(int)
    generation = smooth(3.0)
    generation = np.floor(12 * (generation - generation.min()) / np.ptp(generation)).astype(int)
    size = 10 ** generator.normal(-3.0, 0.4, (len(potency), 1))
    return lattice(*counts), np.ones(len(potency)), size * potency, np.column_stack([increment, generation])


def regions_of(potency, position=None, order=None, threshold=0.8):
    """Regions of a row of particles, all of one generation unless given."""
    potency = np.asarray(potency, float)
    position = lattice(len(potency), 1, 1) if position is None else position
    order = np.zeros((len(potency), 2), int) if order is None else np.asarray(order)
    return find_regions(position, np.ones(len(potency)), potency, order, threshold)


def test_what_touches_fails_together_and_is_alike_is_one_event():
    assert_array_equal(regions_of([SHEAR] * 4), 0)
    assert_array_equal(regions_of([SHEAR, SHEAR, OPENING, OPENING]), [0, 0, 1, 1])
    assert_array_equal(regions_of([SHEAR, -SHEAR, SHEAR]), [0, 1, 2])


@pytest.mark.parametrize(
    ("order", "expected"),
    [
        ([[1, 3], [1, 4], [1, 5]], [0, 0, 0]),  # linked one to the next
        ([[1, 3], [1, 5], [1, 6]], [0, 1, 1]),  # two generations apart
        ([[1, 0], [2, 0], [2, 0]], [0, 1, 1]),  # the same generation of another increment
    ],
)
def test_generations_are_linked_within_an_increment_only(order, expected):
    assert_array_equal(regions_of([SHEAR] * 3, order=order), expected)


@pytest.mark.parametrize(
    ("second", "shared"),
    [
        ([1, 0, 0], FACES),
        ([1, 1, 0], EDGES),
        ([1, -1, 1], CORNERS),
        ([2, 0, 0], None),  # a cell between them
        ([2, 1, 1], None),
    ],
)
def test_cells_that_share_a_face_an_edge_or_a_corner_touch(second, shared):
    position = np.array([[0, 0, 0], second], float)
    assert_array_equal(regions_of([SHEAR] * 2, position=position), [0, int(shared is None)])
    for reach in (FACES, EDGES, CORNERS):
        label = find_regions(position, np.ones(2), np.tile(SHEAR, (2, 1)), np.zeros((2, 2), int), 0.8, reach)
        assert_array_equal(label, [0, int(shared is None or shared > reach)])


@pytest.mark.parametrize(
    ("fine", "shared"),
    [
        ([1.5, 0.5, 0.5], FACES),
        ([1.5, 1.5, 0.5], EDGES),
        ([1.5, -1.5, 1.5], CORNERS),
        ([2.5, 0.5, 0.5], None),  # a fine cell between them
        ([0.5, 2.5, 1.5], None),
    ],
)
def test_a_coarse_cell_touches_the_fine_ones_around_it(fine, shared):
    """A cube of 2 m beside one of 1 m: as far apart as the gap says, whatever the larger one's size."""
    position, spacing = np.array([[0.0, 0, 0], fine]), np.array([2.0, 1.0])
    for reach in (FACES, EDGES, CORNERS):
        label = find_regions(position, spacing, np.tile(SHEAR, (2, 1)), np.zeros((2, 2), int), 0.8, reach)
        assert_array_equal(label, [0, int(shared is None or shared > reach)])


def test_no_chain_turns_a_mechanism_round():
    """A row whose mechanism turns by 10 degrees a cell is alike all along (0.98); no member is opposed to its event,
    and the mean cosine with it is at least the threshold."""
    angle = np.radians(10.0 * np.arange(37))
    potency = np.cos(angle)[:, None] * SHEAR + np.sin(angle)[:, None] * OPENING * np.sqrt(2.0)
    label = regions_of(potency)
    tensor = tensor_from_voigt(potency)
    for region in range(label.max() + 1):
        own = tensor[label == region]
        cosine = closeness(own, own.sum(axis=0)[None])
        assert cosine.min() > 0.0
        assert np.average(cosine, weights=np.linalg.norm(own, axis=(1, 2))) >= 0.8
    assert 4 <= label.max() + 1 <= 10


def test_a_small_opposed_particle_joins_no_event():
    """Its weight would hardly move the mean cosine; a chain of small ones leads to it."""
    angle = np.radians(30.0 * np.arange(7))
    chain = 1e-6 * (np.cos(angle)[:, None] * SHEAR + np.sin(angle)[:, None] * OPENING * np.sqrt(2.0))
    potency = np.concatenate([np.tile(SHEAR, (4, 1)), chain])
    label = regions_of(potency)
    own = tensor_from_voigt(potency)[label == 0]
    assert 4 <= len(own) <= 4 + 3
    assert (closeness(own, own.sum(axis=0)[None]) > 0.0).all()


@pytest.mark.parametrize("seed", range(3))
def test_order_of_particles_is_nothing(seed):
    position, spacing, potency, order = smooth_field(seed, 9, 8, 7)
    label = find_regions(position, spacing, potency, order, 0.8)
    shuffled = np.random.default_rng(seed).permutation(len(label))
    again = find_regions(position[shuffled], spacing[shuffled], potency[shuffled], order[shuffled], 0.8)
    assert adjusted_rand_score(label[shuffled], again) == 1.0
    assert 20 < label.max() < len(label) / 2


def test_equal_particles_in_any_order_are_one_event():
    """All choices are equal: lots decide, whatever the order, and the end is the same."""
    position = lattice(6, 6, 6)
    shuffled = np.random.default_rng(0).permutation(len(position))
    assert_array_equal(regions_of(np.tile(SHEAR, (216, 1)), position=position[shuffled]), 0)


@pytest.mark.parametrize("seed", range(3))
def test_rock_far_away_changes_no_event(seed):
    """Half of a field alone, against the whole: the same events from 15 cells off the cut on."""
    position, spacing, potency, order = smooth_field(seed, 60, 12, 12)
    label = find_regions(position, spacing, potency, order, 0.8)
    half = position[:, 0] < 1e5 + 40
    alone = find_regions(position[half], spacing[half], potency[half], order[half], 0.8)
    away = position[half, 0] < 1e5 + 25
    assert adjusted_rand_score(label[half][away], alone[away]) >= 0.99


def slow_regions(position, potency, order, threshold, small_share=MAX_JOINING_SHARE):
    """The definition, over sets of particles. Equal choices, drawn by lot there, are the test's to avoid."""

    def cosine(a, b):
        return np.sum(a * b) / np.sqrt(np.sum(a * a) * np.sum(b * b))

    tensor = tensor_from_voigt(potency)
    linked = {
        (i, j)
        for i in range(len(tensor))
        for j in range(len(tensor))
        if np.abs(position[i] - position[j]).max() == 1.0
        and order[i][0] == order[j][0]
        and abs(order[i][1] - order[j][1]) <= 1
        and cosine(tensor[i], tensor[j]) > threshold
    }
    regions = [{i} for i in range(len(tensor))]

    def may_join(one, other):
        parts = [sum(tensor[i] for i in region) for region in (one, other)]
        whole = parts[0] + parts[1]
        if np.linalg.norm(whole) < threshold * sum(np.linalg.norm(tensor[i]) for i in one | other):
            return False
        return all(cosine(tensor[i], whole) > 0.0 for i in one | other)

    while True:
        best, score = [], []
        for one in regions:
            own, choices = sum(tensor[i] for i in one), []
            for number, other in enumerate(regions):
                shared = sum((i, j) in linked for i in one for j in other)
                if other is not one and shared and may_join(one, other):
                    value = cosine(own, sum(tensor[i] for i in other)) * shared / np.sqrt(min(len(one), len(other)))
                    choices.append((value, number))
            best.append(max(choices)[1] if choices else None)
            score.append(max(choices)[0] if choices else 0.0)
        pairs = [(a, b) for a, b in enumerate(best) if b is not None and best[b] == a and a < b]
        if not pairs:
            return regions
        gone = {b for _, b in pairs}
        hub = {b: a for a, b in pairs} | {a: a for a, _ in pairs}
        for a, b in pairs:
            regions[a] |= regions[b]
        for other in sorted(set(range(len(regions))) - set(hub), key=lambda number: -score[number]):
            own = hub.get(best[other])
            small = own is not None and len(regions[other]) <= small_share * len(regions[own])
            if small and may_join(regions[own], regions[other]):
                regions[own] |= regions[other]
                gone.add(other)
        regions = [region for number, region in enumerate(regions) if number not in gone]


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 10**6), st.sampled_from([0.6, 0.8, 0.95]))
def test_the_definition_written_plainly_gives_the_same(seed, threshold):
    position, spacing, potency, order = smooth_field(seed, 5, 4, 3)
    order //= 4  # more links
    label = find_regions(position, spacing, potency, order, threshold)
    expected = np.empty(len(label), int)
    for number, region in enumerate(slow_regions(position, potency, order, threshold)):
        expected[list(region)] = number
    assert adjusted_rand_score(label, expected) == 1.0


@pytest.mark.parametrize("seed", range(6))
def test_small_regions_that_join_at_once_are_those_of_the_plain_definition(seed):
    """With the share at a half, as regions here are too small for its own: 60 particles, mostly of one mechanism."""
    position, spacing, potency, order = smooth_field(seed, 5, 4, 3)
    potency = potency / np.linalg.norm(potency, axis=1)[:, None] + SHEAR
    order *= 0
    tensor = potency * regions.NINE_COMPONENT_WEIGHTS
    sorted_by_place = np.lexsort(position.T)  # as find_regions sorts
    pairs = regions.links(position[sorted_by_place], spacing, tensor[sorted_by_place], order, 0.9)
    arguments = (tensor[sorted_by_place], regions.lots(position[sorted_by_place]), *pairs, 0.9)
    label = np.empty(len(position), int)
    label[sorted_by_place] = regions.grow(*arguments, small=0.5)
    expected = np.empty(len(label), int)
    for number, region in enumerate(slow_regions(position, potency, order, 0.9, small_share=0.5)):
        expected[list(region)] = number
    assert adjusted_rand_score(label, expected) == 1.0
    assert len(np.unique(label)) < len(label)


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
        assert_array_equal(events.resolved, events.particles >= 2)
        assert 0.0 <= events.attrs["unlike_share"] < 1.0
        assert 0.0 <= events.attrs["at_once_share"] <= 1.0


@pytest.mark.parametrize("seed", range(5))
def test_share_that_the_load_made_events_of_at_once_is_that_of_a_loop(seed):
    """Rock of generation 0 that shares event and increment with enough of its like; in any order of particles."""
    random = np.random.default_rng(seed)
    event, weight = random.integers(0, 6, 80), random.uniform(0.1, 1.0, 80)
    order = random.integers([1, 0], [3, 2], (80, 2))
    key = [(number, *when) for number, when in zip(event, order.tolist(), strict=True)]
    expected = sum(w for w, one in zip(weight, key, strict=True) if one[2] == 0 and key.count(one) >= 3)
    assert 0.0 < expected < weight.sum()
    assert at_once_share(weight, event, order, 3) == pytest.approx(expected / weight.sum(), rel=1e-12)
    shuffled = random.permutation(80)
    again = at_once_share(weight[shuffled], event[shuffled], order[shuffled], 3)
    assert again == pytest.approx(expected / weight.sum(), rel=1e-12)
    assert at_once_share(weight, event, order, 1) == pytest.approx(weight[order[:, 1] == 0].sum() / weight.sum())
    assert at_once_share(weight[:0], event[:0], order[:0], 3) == 0.0


def test_share_of_unlike_particles_is_that_of_a_loop():
    _, _, potency, _ = smooth_field(0, 5, 5, 5)
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


def test_in_a_plane_edges_and_corners_touch():
    position = np.array([[0.0, 0, 0], [1, 0, 0], [2, 1, 0], [2, 4, 0], [3.5, 1.5, 0]])
    spacing = np.array([1.0, 1, 1, 1, 2])  # the last touches the third; a cell lies between the fourth and the others
    label = find_regions(position, spacing, np.tile(SHEAR, (5, 1)), np.zeros((5, 2), int), 0.8)
    assert_array_equal(label, [0, 0, 0, 1, 0])


def test_threads_are_nothing():
    field = smooth_field(1, 20, 12, 12)
    found = []
    for threads in (1, numba.config.NUMBA_NUM_THREADS):
        numba.set_num_threads(threads)
        found.append(find_regions(*field, 0.8))
    assert_array_equal(*found)


@pytest.mark.parametrize("seed", range(3))
def test_order_of_links_is_nothing_even_where_all_choices_are_equal(seed):
    """Few mechanisms, and lots that eight particles share, as if at one place: the smaller number is chosen."""
    position, spacing, potency, order = smooth_field(seed, 8, 8, 8)
    tensor = np.round(2.0 * potency / np.linalg.norm(potency, axis=1)[:, None]) + 0.5 * SHEAR
    lot = regions.lots(position // 2)
    first, second = regions.links(position, spacing, tensor, order // 3, 0.6)
    generator, found = np.random.default_rng(seed), []
    for shuffled in (np.arange(len(first)), generator.permutation(len(first)), generator.permutation(len(first))):
        found.append(regions.grow(tensor, lot, first[shuffled], second[shuffled], 0.8))
    assert_array_equal(found[0], found[1])
    assert_array_equal(found[0], found[2])
    assert 10 < len(np.unique(found[0])) < 100


@pytest.mark.parametrize("seed", range(20))
def test_links_gathered_are_those_of_a_dictionary(seed):
    """Of regions that join any others, whatever their numbers; twice with the same arrays to work with."""
    generator = np.random.default_rng(seed)
    count, expected = 30, {}
    first, second = np.sort(generator.integers(0, count, (80, 2)), axis=1).T
    region, shared = np.arange(count), np.ones(80)
    start, place = np.empty(count, np.int64), np.full(count, -1)
    linked = np.arange(count)
    for _ in range(2):
        region[linked] = generator.permutation(linked)[generator.integers(0, len(linked) // 3 + 1, len(linked))]
        expected = {}
        for a, b, many in zip(region[first], region[second], shared, strict=True):
            if a != b:
                expected[min(a, b), max(a, b)] = expected.get((min(a, b), max(a, b)), 0) + many
        first, second, shared = regions._gather(linked, region, first, second, shared, start, place)
        assert dict(zip(zip(first, second, strict=True), shared, strict=True)) == expected
        assert len(first) == len(expected)
        assert (np.diff(first) >= 0).all()
        linked = regions._with_links(linked, first, second, start)
        assert_array_equal(linked, np.unique([first, second]))


def test_small_neighbours_join_a_large_region_at_once():
    """A row of 900 like particles is one event after some tens of rounds; one at a time it would take hundreds."""
    potency = SHEAR + 0.05 * np.random.default_rng(0).normal(size=(8000, 6))
    position = lattice(20, 20, 20)
    with mock.patch("seismic.regions._choose", wraps=regions._choose) as choose:
        assert_array_equal(regions_of(potency, position=position), 0)
    assert choose.call_count < 300
