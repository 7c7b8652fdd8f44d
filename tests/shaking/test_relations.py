"""Relations of velocity, size and distance, against the published equations in their own units and against draws."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from common.errors import InputError
from shaking.relations import GroundMotion, exceedance, relation_of, sizes_of
from shaking.settings import GroundMotionSettings

MCGARR = {"relation": {"name": "mcgarr_1981", "scatter": 0.3}}
ROCK = {"s_wave_velocity": "3500 m/s", "strain_drop": 1e-4, "c_l": 12.0, "c_r": 1.4}
MENDECKI = {"relation": {"name": "mendecki_2019", "scatter": 0.3} | ROCK}
SITE = {"name": "site", "size": "mw", "a": -1.0, "b": 0.6, "c": 1.1, "scatter": 0.3}


def read(values: dict) -> GroundMotion:
    return relation_of(GroundMotionSettings.read(values, "ground_motion"))


def site(**changes) -> dict:
    """A site relation with changes; None leaves a key out."""
    relation = {key: value for key, value in (SITE | {"nearest": "10 m"} | changes).items() if value is not None}
    return {"relation": relation}


def test_mcgarr_is_the_equation_in_centimetres_and_dyn():
    """log10(R v) = -4.68 + 0.49 log10 M0: R v in cm2/s, M0 in dyn cm. A tremor of 1e19 dyn cm, 200 m away."""
    centimetres_per_second = 10.0 ** (-4.68 + 0.49 * 19.0) / 20_000.0
    assert 10.0 ** read(MCGARR).log_median(12.0, 200.0) == pytest.approx(centimetres_per_second / 100.0)


def test_mcgarr_by_moment_and_by_magnitude_are_one_relation():
    """The paper's other regression of the same tremors, log10(R v) = 3.95 + 0.57 ML, by log10 M0 = 17.7 + 1.2 ML."""
    magnitude = np.linspace(-0.76, 1.45, 12)
    by_magnitude = 3.95 + 0.57 * magnitude - 4.0 - np.log10(300.0)
    np.testing.assert_allclose(read(MCGARR).log_median(17.7 + 1.2 * magnitude - 7.0, 300.0), by_magnitude, atol=0.08)


def test_mcgarr_is_not_used_nearer_than_its_data_unless_told():
    near = read({"relation": MCGARR["relation"] | {"nearest": "10 m"}})
    assert read(MCGARR).log_median(12.0, 1.0) == read(MCGARR).log_median(12.0, 50.0)
    assert near.log_median(12.0, 10.0) == pytest.approx(read(MCGARR).log_median(12.0, 50.0) + np.log10(5.0))
    assert read(MCGARR).is_outside(np.array([12.0, 12.0, 13.0, 8.0]), np.array([60.0, 49.0, 60.0, 60.0])).tolist() == [
        False, True, True, True,
    ]  # fmt: skip


@given(st.floats(-4.0, 3.0), st.floats(0.0, 2000.0))
def test_mendecki_is_its_own_equation(log_potency, distance):
    """PGV0 [L / (R + L)]^cR, L = cL P^(1/3); at the source 0.63 vS strain drop, whatever the size."""
    length = 12.0 * 10.0 ** (log_potency / 3.0)
    expected = 0.63 * 3500.0 * 1e-4 * (length / (distance + length)) ** 1.4
    relation = read(MENDECKI)
    assert 10.0 ** relation.log_median(log_potency, distance) == pytest.approx(expected, rel=1e-9)
    assert 10.0 ** relation.log_median(log_potency, 0.0) == pytest.approx(0.63 * 0.35, rel=1e-9)


@given(st.floats(-3.0, 2.0), st.floats(1.0, 500.0), st.floats(1.1, 50.0))
def test_sources_that_are_alike_shake_alike(log_potency, distance, scale):
    """A source k times as large in all lengths has k^3 times the potency, and the same velocity k times as far away."""
    relation = read(MENDECKI)
    assert relation.log_median(log_potency + 3.0 * np.log10(scale), scale * distance) == pytest.approx(
        float(relation.log_median(log_potency, distance)), abs=1e-9
    )


@given(st.floats(-2.0, 4.0), st.floats(0.0, 1000.0), st.floats(0.0, 1000.0))
def test_velocity_falls_with_distance_and_grows_with_size(size, first, second):
    relation = read(site(saturation={"length": "3 m", "exponent": 0.5}, nearest=None))
    near, far = sorted([first, second])
    assert relation.log_median(size, near) >= relation.log_median(size, far)
    assert relation.log_median(size + 0.1, far) > relation.log_median(size, far) - 1e-12


def test_chance_of_a_velocity_is_that_of_draws():
    """With scatter, with none, and above the largest velocity."""
    generator = np.random.default_rng(1)
    drawn = -1.2 + 0.35 * generator.standard_normal(200_000)
    for at in (-1.8, -1.2, -0.7):
        found = exceedance(at, np.array([-1.2]), np.array([0.35]), np.inf)
        assert found[0] == pytest.approx(np.mean(drawn > at), abs=0.004)
    assert exceedance(-1.0, np.array([-1.1, -0.9]), np.array([0.0, 0.0]), np.inf).tolist() == [0.0, 1.0]
    assert exceedance(-1.0, np.array([2.0]), np.array([0.3]), -1.0).tolist() == [0.0]


def test_uncertain_coefficients_widen_the_scatter_as_draws_of_them_do():
    """The chance that an event exceeds a velocity, over draws of coefficients and of its own scatter."""
    generator = np.random.default_rng(2)
    root = 0.05 * generator.standard_normal((3, 3))
    covariance = root @ root.T
    relation = GroundMotion("fitted", "mw", -1.0, 0.5, 1.0, 0.25, nearest=10.0, covariance=covariance)
    drawn = generator.multivariate_normal([-1.0, 0.5, 1.0], covariance, 200_000)
    logs = drawn @ relation.factors(1.5, 80.0) + 0.25 * generator.standard_normal(200_000)
    assert relation.deviation(1.5, 80.0) == pytest.approx(logs.std(), rel=0.01)
    at = float(relation.log_median(1.5, 80.0)) + 0.5
    found = exceedance(at, relation.log_median(1.5, 80.0), relation.deviation(1.5, 80.0), np.inf)
    assert found == pytest.approx(np.mean(logs > at), abs=0.004)


def test_sizes_by_kind():
    """A shear of 1 m3 in rock of 30 GPa: log10 P = 0, log10 M0 = 10.48, Mw = 0.92."""
    potency, moment = np.array([1.0]), np.array([30e9])
    found = [float(sizes_of(kind, potency, moment)[0]) for kind in ("log_potency", "log_moment", "mw")]
    assert found == pytest.approx([0.0, 10.4771, 0.9181], abs=1e-4)


@pytest.mark.parametrize(
    ("values", "message"),
    [
        (site(scatter=-0.1), "ground_motion.relation.scatter: -0.1 is less than the minimum of 0"),
        (site(scatter=None), "ground_motion.relation.scatter: missing key"),
        ({"relation": {"name": "mcgar_1981"}}, "relation.name: 'mcgar_1981' is not one of site, mcgarr_1981, mendecki"),
        (site(nearest=None), "ground_motion.relation: a velocity without limit at the source; give nearest, or satur"),
        (site(nearest=10), "ground_motion.relation.nearest: 10 has no unit; write it as text with one"),
        (site(sizes=[2, 1]), "ground_motion.relation.sizes: 1 is not larger than 2; give the smaller one first"),
        (site(c_l=3), "ground_motion.relation.c_l: not used by name site, by mendecki_2019 only; leave it out"),
        (site() | {"chances": [0.1, 0.5]}, "ground_motion.chances[1]: 0.5 is not smaller than 0.1"),
        (site() | {"chances": [1.0]}, "ground_motion.chances[0]: 1.0 is not below the maximum of 1"),
        (site() | {"depth": "1 m"}, "ground_motion.depth: stands without displacement"),
        (site() | {"displacement": "200 mm", "depth": "p95"}, "ground_motion.depth: 'p95' is not one of p90, largest"),
        (site() | {"displacement": "200 mm", "depth": 1}, "ground_motion.depth: 1 has no unit; write it as text with"),
        (site() | {"displacement": "200 mm", "depth": {}}, "ground_motion.depth: gives no side"),
        (site() | {"largest": "3 m"}, "ground_motion.largest: '3 m' is not convertible to m/s"),
    ],
)  # fmt: skip
def test_bad_input_is_one_line(values, message):
    with pytest.raises(InputError) as error:
        GroundMotionSettings.read(values, "ground_motion")
    assert len(error.value.lines) == 1, error.value
    assert message in str(error.value)
