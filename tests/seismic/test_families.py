"""Families of like mechanisms: invariants, a slow twin, and known mechanisms found again."""

import numba
import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal
from scipy.spatial.transform import Rotation

from common.errors import InputError
from common.source_tensors import scalar_potency
from common.voigt import tensor_from_voigt, voigt_from_tensor
from seismic import families
from seismic.families import closeness, find_families

SCENE = {"count": st.integers(1, 60), "seed": st.integers(0, 10**6), "threshold": st.sampled_from([0.3, 0.8, 0.95])}
quick = settings(max_examples=40, deadline=None)


def particles(count, seed):
    """Potency (count, 6) of random direction and of sizes over four decades."""
    rng = np.random.default_rng(seed)
    return rng.normal(size=(count, 6)) * 10.0 ** rng.uniform(-4, 0, (count, 1))


def slow_families(potency, threshold):
    """The algorithm as the paper's reader would write it: 3 x 3 tensors, one pair at a time."""
    tensor = tensor_from_voigt(potency)
    order = sorted(range(len(potency)), key=lambda i: (-scalar_potency(tensor[i]), i))
    leaders = []
    for particle in order:
        if not any(closeness(tensor[particle], tensor[leader]) >= threshold for leader in leaders):
            leaders.append(particle)
    family = [int(np.argmax([closeness(tensor[i], tensor[leader]) for leader in leaders])) for i in range(len(potency))]
    return np.array(family), np.array(leaders)


def margin(potency, threshold):
    """Distance of the nearest pair from the threshold, so that round-off cannot decide."""
    tensor = tensor_from_voigt(potency)
    return np.min(np.abs(closeness(tensor[:, None], tensor[None]) - threshold))


def same_partition(first, second):
    """Whether two labellings put the same particles together."""
    return len(np.unique(np.stack([first, second]), axis=1).T) == len(np.unique(first)) == len(np.unique(second))


def test_closeness_is_the_cosine_of_tensors():
    """Eq. 13 as printed fails the first line (departures.md). Shear and stretch of one plane are orthogonal."""
    shear, stretch = tensor_from_voigt([0, 0, 0, 0, 0, 3.0]), np.diag([1.0, -1, 0])
    assert closeness(shear, 7 * shear) == pytest.approx(1.0, rel=1e-15)
    assert closeness(shear, -shear) == pytest.approx(-1.0, rel=1e-15)
    assert closeness(shear, stretch) == 0.0
    both = stretch + tensor_from_voigt([0, 0, 0, 0, 0, 1.0])  # 45 degrees between two equal parts of the 9-norm
    assert closeness(both, stretch) == pytest.approx(np.sqrt(0.5), rel=1e-15)


@given(**SCENE)
@quick
def test_slow_twin(count, seed, threshold):
    potency = particles(count, seed)
    family, leader = find_families(potency, threshold)
    expected_family, expected_leader = slow_families(potency, threshold)
    assert_array_equal(leader, expected_leader)
    assert_array_equal(family, expected_family)


@pytest.mark.parametrize("threshold", [0.5, 0.9])
def test_slow_twin_over_several_blocks(monkeypatch, threshold):
    """Small blocks, so that leaders are found in many of them."""
    monkeypatch.setattr(families, "PARTICLES_PER_BLOCK", 7)
    monkeypatch.setattr(families, "PARTICLES_PER_CHUNK", 5)
    potency = particles(150, 3)
    family, leader = families.find_families(potency, threshold)
    expected_family, expected_leader = slow_families(potency, threshold)
    assert_array_equal(leader, expected_leader)
    assert_array_equal(family, expected_family)


@pytest.mark.parametrize("threshold", [0.5, 0.95])
def test_every_particle_is_with_its_closest_leader(threshold):
    """20,000 particles, more than a block: members within the threshold of their leader, leaders not of each other."""
    potency = particles(20_000, 5)
    family, leader = find_families(potency, threshold)
    unit = voigt_from_tensor(tensor_from_voigt(potency)) * np.sqrt([1, 1, 1, 2, 2, 2])
    unit /= np.linalg.norm(unit, axis=1, keepdims=True)
    cosine = unit @ unit[leader].T
    own = cosine[np.arange(len(unit)), family]
    assert np.all(own >= threshold - 1e-12)
    assert_allclose(own, cosine.max(axis=1), atol=1e-14)
    between = unit[leader] @ unit[leader].T
    assert np.all(between[~np.eye(len(leader), dtype=bool)] < threshold + 1e-12)
    assert_array_equal(family[leader], np.arange(len(leader)))
    assert np.all(np.diff(scalar_potency(tensor_from_voigt(potency[leader]))) <= 0)


@given(**SCENE, scale=st.floats(1e-200, 1e100))
@quick
def test_scale_does_not_matter(count, seed, threshold, scale):
    potency = particles(count, seed)
    assume(margin(potency, threshold) > 1e-9)
    for first, second in zip(find_families(potency, threshold), find_families(scale * potency, threshold), strict=True):
        assert_array_equal(first, second)


@given(**SCENE)
@quick
def test_order_does_not_matter(count, seed, threshold):
    potency = particles(count, seed)
    shuffle = np.random.default_rng(seed).permutation(count)
    family, leader = find_families(potency, threshold)
    shuffled_family, shuffled_leader = find_families(potency[shuffle], threshold)
    assert_array_equal(shuffled_family, family[shuffle])
    assert_array_equal(shuffle[shuffled_leader], leader)


@given(**SCENE)
@quick
def test_frame_does_not_matter(count, seed, threshold):
    potency = particles(count, seed)
    assume(margin(potency, threshold) > 1e-9)
    rotation = Rotation.random(rng=seed).as_matrix()
    turned = voigt_from_tensor(rotation @ tensor_from_voigt(potency) @ rotation.T)
    assert_array_equal(find_families(turned, threshold)[0], find_families(potency, threshold)[0])


def test_ties_go_to_the_first_particle():
    """Three equal sizes: xx and yy lead; the third, as close to both (0.7071), joins the one found first."""
    equal = np.array([[1.0, 0, 0, 0, 0, 0], [0, 1.0, 0, 0, 0, 0], [0.5, 0.5, 0, 0, 0, 0]])
    family, leader = find_families(equal, 0.7)
    assert_array_equal(leader, [0, 1])
    assert_array_equal(family, [0, 1, 0])


def test_known_mechanisms_with_scatter_are_found_again():
    """Four mechanisms well apart (cosines below 0.5), each particle turned by some 8 degrees: four families of 500."""
    rng = np.random.default_rng(11)
    base = tensor_from_voigt(
        [[0, 0, 0, 0, 0, 1.0], [0, 0, 0, 1.0, 0, 0], [0, 0, 1.0, 0, 0, 0], [-1.0, 0.5, 0.5, 0, 0, 0]]
    )
    truth = np.repeat(np.arange(4), 500)
    turn = Rotation.from_rotvec(rng.normal(0, 0.08, (2000, 3))).as_matrix()
    tensor = turn @ base[truth] @ np.swapaxes(turn, 1, 2) * rng.lognormal(-6, 1, 2000)[:, None, None]
    family, leader = find_families(voigt_from_tensor(tensor), 0.8)
    assert len(leader) == 4
    assert same_partition(family, truth)


def test_opposite_mechanisms_never_share_a_family():
    family, _ = find_families(np.array([[0, 0, 0, 0, 0, 1.0], [0, 0, 0, 0, 0, -0.9]]), 0.01)
    assert_array_equal(family, [0, 1])


def test_threads_do_not_matter():
    potency = particles(30_000, 7)
    alone = find_families(potency, 0.9)
    numba.set_num_threads(min(4, numba.config.NUMBA_NUM_THREADS))
    together = find_families(potency, 0.9)
    for first, second in zip(alone, together, strict=True):
        assert_array_equal(first, second)


def test_no_particles_no_families():
    family, leader = find_families(np.empty((0, 6)), 0.8)
    assert family.shape == leader.shape == (0,)


@pytest.mark.parametrize("threshold", [0.0, 1.0, -0.5, float("nan")])
def test_impossible_threshold_is_refused(threshold):
    with pytest.raises(InputError, match=r"seismic\.closeness"):
        find_families(particles(3, 0), threshold)


@pytest.mark.parametrize("value", [0.0, np.nan, np.inf])
def test_a_particle_without_mechanism_is_refused(value):
    potency = particles(3, 0)
    potency[1] = value
    with pytest.raises(InputError, match="zero or not finite"):
        find_families(potency, 0.8)
