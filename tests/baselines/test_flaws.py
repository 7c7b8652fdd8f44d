"""Seeded flaws: laws of their radii, which of them slip, by how much, and how many are expected to."""

import dataclasses

import numpy as np
import pytest
from rock_fixtures import QUIET, SHEAR, SLIPPING, STRENGTH, block

from baselines import flaws
from baselines.flaws import (
    FlawedRock,
    Neighbours,
    RadiusLaw,
    Seeds,
    draw_flaws,
    draw_poisson_flaws,
    expected_per_density,
    find_slips,
    potency_tensors,
)
from baselines.point_source import crack_factor, slip_tensor, smearing, source_stress, traction
from catalogs.sources.sizes import estimate_b, log_potency
from common.errors import InputError
from common.source_tensors import scalar_potency
from common.voigt import tensor_from_voigt

LAW = RadiusLaw(0.5, 6.0, 2.0)
PLANE = np.array([1.0, 0.0, 1.0]) / np.sqrt(2.0)  # across x and z in equal parts


def single(places, radius=1.0, normal=PLANE, cohesion=1.0) -> Seeds:
    """Flaws at these places, of one radius and plane."""
    count = len(places)
    return Seeds(
        part=np.zeros(count, int),
        place=np.asarray(places, float),
        radius=np.broadcast_to(np.asarray(radius, float), count).copy(),
        normal=np.broadcast_to(normal, (count, 3)).copy(),
        rank=np.zeros(count),
        cohesion=np.broadcast_to(np.asarray(cohesion, float), count).copy(),
    )


@pytest.mark.parametrize("exponent", [0.5, 2.0, 3.0, 4.0])
def test_radii_follow_their_law(exponent):
    """Share and radius are inverse; the mean cube is that of many radii; both bounds hold."""
    law = RadiusLaw(0.5, 6.0, exponent)
    shares = (np.arange(200_000) + 0.5) / 200_000
    radii = law.radius_of(shares)
    np.testing.assert_allclose(law.share_above(radii), shares, atol=1e-12)
    np.testing.assert_allclose(law.share_above(np.array([0.1, 0.5, 6.0, 7.0])), [1, 1, 0, 0])
    assert (0.5 <= radii.min()) & (radii.max() <= 6.0)
    assert law.mean_cube() == pytest.approx(np.mean(radii**3), rel=1e-3)


def test_flaws_lie_in_their_parts_on_planes_of_any_direction():
    """Poisson numbers of the density; normals have no preferred direction; the mean cohesion is that of the rock."""
    rock = block([QUIET], cells=4)
    seeds = draw_poisson_flaws(rock, 0.5, LAW, np.random.default_rng(1))
    assert len(seeds) == pytest.approx(32_000, abs=3.5 * np.sqrt(32_000))
    np.testing.assert_array_equal(np.abs(seeds.place - rock.centre[seeds.part]).max(axis=1) <= 5.0, True)
    np.testing.assert_allclose(seeds.normal.T @ seeds.normal / len(seeds), np.eye(3) / 3, atol=0.01)
    assert seeds.cohesion.mean() == pytest.approx(1.0, abs=0.01)
    assert np.log(seeds.cohesion).std() == pytest.approx(0.3, abs=0.01)


def test_one_flaw_slips_along_its_shear_traction_down_to_friction():
    """On a plane across x and z of compressions 40 and 10 MPa: 15 MPa of shear and 25 MPa of normal stress."""
    rock = block([SLIPPING], cells=1)
    seeds = single([[5.0, 5, 5]], radius=2.0)
    slips = find_slips(rock, seeds, STRENGTH)
    drop = 15e6 - 25e6 * np.tan(np.radians(20.0))
    np.testing.assert_allclose(slips.drop, drop)
    tensor = potency_tensors(rock, seeds, slips)[0]
    assert scalar_potency(tensor) == pytest.approx(crack_factor(0.25) * drop / SHEAR * 8.0)
    assert np.trace(tensor) == pytest.approx(0.0, abs=1e-12)
    # it does what stress wants: work is released, and the axis of compression is x
    assert np.sum(tensor * tensor_from_voigt(SLIPPING)) > 0.0
    np.testing.assert_allclose(np.abs(np.linalg.eigh(tensor)[1][:, 0]), [1.0, 0, 0], atol=1e-12)
    flawed = FlawedRock(rock, seeds, STRENGTH)
    flawed.slip(slips.seed, slips.drop, slips.direction)
    across, shear = flawed._tractions(0, np.array([0]))
    assert np.linalg.norm(shear) == pytest.approx(25e6 * np.tan(np.radians(20.0)))
    assert across[0] == pytest.approx(-25e6)


@pytest.mark.parametrize(
    ("stress", "slips"),
    [
        (SLIPPING, True),
        (SLIPPING + QUIET, False),  # the same shear, and more compression
        (SLIPPING - 1.3 * QUIET, True),  # in tension friction bears nothing
        (np.array([3e6, 0, 0, 0, 0, 0]), True),  # uniaxial tension: a shear of 1.5 MPa, and 1.5 MPa of opening
        (np.array([-5e6, 0, 0, 0, 0, 0]), False),  # below the cohesion
    ],
)
def test_compression_holds_a_flaw_and_tension_does_not(stress, slips):
    """Strength is c - sigma_n tan phi with tension positive."""
    found = find_slips(block([stress], cells=1), single([[5.0, 5, 5]]), STRENGTH)
    assert bool(len(found.seed)) == slips


def test_a_flaw_slips_again_from_its_residual_strength():
    """By what the stress adds, since slip has taken its cohesion; a load below the least drop makes none, nor does one
    that stays."""
    scales = [1.0, 1.0, 1.005, 1.2]
    rock = block([scale * SLIPPING for scale in scales], cells=1)
    slips = find_slips(rock, single([[5.0, 5, 5]]), STRENGTH)
    first = 15e6 - 25e6 * np.tan(np.radians(20.0))
    np.testing.assert_array_equal(slips.state, [0, 3])
    np.testing.assert_allclose(slips.drop, [first, 0.2 * first])


def test_mined_flaws_slip_no_more():
    """A flaw is gone once its rank is not below the share of rock."""
    rock = block([QUIET, SLIPPING, SLIPPING], cells=1, share=[1.0, 0.4, 0.4])
    seeds = dataclasses.replace(single([[5.0, 5, 5], [2.0, 2, 2]]), rank=np.array([0.3, 0.5]))
    slips = find_slips(rock, seeds, STRENGTH, interacting=False)
    np.testing.assert_array_equal(slips.seed, [0])


def test_the_flaw_furthest_above_its_strength_slips_first_and_loads_the_other():
    """Two coplanar flaws: slip of the weaker one raises shear on the other, which would not have slipped alone."""
    rock = block([SLIPPING], cells=1)
    beside = 2.5 * np.array([1.0, 0.0, -1.0]) / np.sqrt(2.0)  # along the direction of slip
    drop = 15e6 - 25e6 * np.tan(np.radians(20.0))
    seeds = single([[5.0, 5, 5], np.array([5.0, 5, 5]) + beside], cohesion=[1.0, 1.01 * drop / 2e6])
    together, alone = (find_slips(rock, seeds, STRENGTH, interacting=both) for both in (True, False))
    np.testing.assert_array_equal(alone.seed, [0])
    np.testing.assert_array_equal(together.seed[:2], [0, 1])
    assert together.drop[1] > drop
    order = find_slips(rock, single(seeds.place, cohesion=[0.5, 0.1]), STRENGTH)
    assert order.seed[0] == 1


def test_slip_adds_stress_to_flaws_within_its_reach_only():
    """As the source says, smeared over the size of both."""
    rock = block([QUIET], cells=1)
    seeds = single([[5.0, 5, 5], [8.0, 5, 5], [5.0, 5.5, 5], [5.0, 5, 60]], radius=[1.0, 2.0, 0.5, 1.0])
    flawed = FlawedRock(rock, seeds, STRENGTH)
    direction = np.array([1.0, 0.0, -1.0]) / np.sqrt(2.0)
    near = Neighbours(flawed).add_stress(0, 5e6, direction)
    np.testing.assert_array_equal(np.sort(near), [1, 2])
    potency = crack_factor(0.25) * 5e6 / SHEAR * slip_tensor(PLANE, direction)
    width = smearing(0.25) * np.hypot(1.0, [2.0, 0.5])
    expected = source_stress(seeds.place[1:3] - seeds.place[0], potency, SHEAR, 0.25, width)
    np.testing.assert_allclose(flawed.added[1:3], expected)
    np.testing.assert_array_equal(flawed.added[[0, 3]], 0.0)


def test_flaws_come_to_rest_however_close_they_lie():
    """A crack density of 20: most of them overlap. No stress drop is larger than the shear of any plane."""
    rock = block([SLIPPING], cells=2, edge=15.0)
    law = RadiusLaw(4.0, 12.0, 2.0)
    seeds = draw_poisson_flaws(rock, 20.0 / law.mean_cube(), law, np.random.default_rng(11))
    slips = find_slips(rock, seeds, STRENGTH)
    assert 0 < len(slips.seed) < len(seeds)
    assert slips.drop.max() < 15e6


def test_without_mining_nothing_slips_after_history():
    """In the state that the flaws have come to rest in, interacting ones too: hundreds have slipped by then."""
    rock = block([SLIPPING, SLIPPING, SLIPPING], cells=3)
    seeds = draw_poisson_flaws(rock, 0.02, LAW, np.random.default_rng(5))
    slips = find_slips(rock, seeds, STRENGTH)
    assert len(slips.state) > 100
    assert np.count_nonzero(slips.state) == 0


def test_flaws_rest_at_or_below_their_strength():
    """After a state no flaw is above what it bears, whatever others have added."""
    rock = block([SLIPPING], cells=3)
    seeds = draw_poisson_flaws(rock, 0.02, LAW, np.random.default_rng(6))
    flawed = FlawedRock(rock, seeds, STRENGTH)
    flaws._cascade(flawed, Neighbours(flawed), 0, np.ones(len(seeds), bool))
    assert flawed.excess(0, np.arange(len(seeds))).max() <= 0.0
    assert np.abs(flawed.added).max() > 1e5


def test_mirrored_flaws_in_mirrored_rock_slip_as_mirror_images():
    """Same flaws in the same order, by the same amounts; tensors and places mirrored in x."""
    generator = np.random.default_rng(7)
    stress = np.array([SLIPPING, 1.1 * SLIPPING])[:, None, :] + 3e6 * generator.normal(size=(2, 27, 6))
    rock = block(stress, cells=3)
    seeds = draw_poisson_flaws(rock, 0.02, LAW, generator)
    mirror = np.diag([-1.0, 1.0, 1.0])
    signs = np.array([1.0, 1.0, 1.0, 1.0, -1.0, -1.0])
    image = dataclasses.replace(rock, centre=rock.centre @ mirror, stress=rock.stress * signs)
    other = dataclasses.replace(seeds, place=seeds.place @ mirror, normal=seeds.normal @ mirror)
    slips, mirrored = find_slips(rock, seeds, STRENGTH), find_slips(image, other, STRENGTH)
    np.testing.assert_array_equal(mirrored.seed, slips.seed)
    np.testing.assert_array_equal(mirrored.state, slips.state)
    np.testing.assert_allclose(
        potency_tensors(image, other, mirrored), mirror @ potency_tensors(rock, seeds, slips) @ mirror, atol=1e-12
    )
    assert len(np.unique(slips.state)) == 2


def test_number_of_slips_is_linear_in_density_and_as_expected():
    """Without interaction: one and three times as many flaws, each within Poisson error of what is expected; rank and
    size count."""
    rock = block([QUIET, 0.8 * SLIPPING, SLIPPING], cells=3, share=[0.7, 0.7, 0.6])
    cut, weight = 3e-5, np.array([0.0, 1.0, 0.5])
    expected = expected_per_density(rock, LAW, STRENGTH, cut, weight, np.random.default_rng(8))
    for density in (0.05, 0.15):
        counts = []
        for run in range(20):
            seeds = draw_poisson_flaws(rock, density, LAW, np.random.default_rng([9, run]))
            slips = find_slips(rock, seeds, STRENGTH, interacting=False)
            large = scalar_potency(potency_tensors(rock, seeds, slips)) >= cut
            counts.append([np.count_nonzero(large & (slips.state == state)) for state in (1, 2)])
        mean = np.mean(counts, axis=0) @ weight[1:]
        error = np.sqrt(np.mean(counts, axis=0) @ weight[1:] ** 2 / 20)
        assert mean > 10.0
        assert abs(mean - density * expected) < 3.5 * error + 0.02 * mean


def test_exponent_of_potency_is_a_third_of_that_of_radii():
    """b of log P = D / 3 where all slip at one stress drop: one plane, one strength."""
    rock = block([QUIET, SLIPPING], cells=2)
    law = RadiusLaw(0.5, 500.0, 2.4)
    seeds = draw_flaws(rock, np.full(8, 1000), law, np.random.default_rng(10))
    seeds = dataclasses.replace(seeds, normal=np.broadcast_to(PLANE, (8000, 3)), cohesion=np.ones(8000))
    slips = find_slips(rock, seeds, STRENGTH, interacting=False)
    size = log_potency(scalar_potency(potency_tensors(rock, seeds, slips)))
    found = estimate_b(size, size.min())
    assert len(size) == 8000
    assert np.ptp(slips.drop) < 1e-6 * slips.drop[0]
    assert found.b == pytest.approx(0.8, abs=3.5 * found.error)


def test_two_rocks_have_each_their_own_strength_and_stiffness():
    """The same stress: in the stronger rock nothing slips; potency falls with stiffness."""
    rock = dataclasses.replace(
        block([SLIPPING], cells=2),
        material=np.array([0, 0, 0, 0, 1, 1, 1, 1]),
        materials=("host", "hard"),
        shear_modulus=np.repeat([SHEAR, 2 * SHEAR], 4),
    )
    seeds = dataclasses.replace(single([[2.0, 2, 2], [12.0, 2, 2]]), part=np.array([0, 4]))
    soft = STRENGTH | {"hard": STRENGTH["host"]}
    slips = find_slips(rock, seeds, soft, interacting=False)
    size = scalar_potency(potency_tensors(rock, seeds, slips))
    assert size[0] == pytest.approx(2.0 * size[1])
    strong = STRENGTH | {"hard": STRENGTH["host"].model_copy(update={"cohesion": 50e6})}
    np.testing.assert_array_equal(find_slips(rock, seeds, strong).seed, [0])


def test_flaws_that_do_not_stop_are_refused(monkeypatch):
    """In one line."""
    rock = block([SLIPPING], cells=2)
    monkeypatch.setattr(flaws, "MAX_SLIPS_PER_FLAW", 0)
    with pytest.raises(InputError, match=r"baselines\.radii"):
        find_slips(rock, single([[5.0, 5, 5]]), STRENGTH)


def test_shear_traction_of_the_fixture_is_what_tests_take_it_for():
    """15 MPa of shear and 25 MPa of compression on the plane."""
    on_plane = traction(SLIPPING[None], PLANE[None])[0]
    assert on_plane @ PLANE == pytest.approx(-25e6)
    assert np.linalg.norm(on_plane - (on_plane @ PLANE) * PLANE) == pytest.approx(15e6)
