"""Terms of the likelihood: closed forms, limits, and intervals that hold known truths."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2, multivariate_t, nbinom, norm, poisson

from calibration.likelihood import Likelihood, number_term, student_term
from calibration.posterior import find_posterior
from calibration.recorded import RecordedOutputs, mean_excess
from calibration.student import DEGREES_OF_FREEDOM
from calibration.trials import MEAN_POTENCY, CellCorrection, Discrepancy

NONE = Discrepancy()


def errors_of(*variances):
    """Errors (draw, value) of independent values with these variances."""
    parts = np.sqrt(len(variances) * np.array(variances)) * np.eye(len(variances))
    return np.concatenate([parts, -parts])


def recorded(log_potency, variance=0.04, number=(40, 60), dispersion_index=3.0):
    """Two steps; variance: of the mean potency of each."""
    errors = errors_of(variance, variance, 0.01)
    return RecordedOutputs(np.array(log_potency, float), np.array(number), dispersion_index, 0.0, errors)


def potency_term(mean, deviation, record, discrepancy, terms=("potency",)):
    """Of two steps of a record."""
    outputs = (np.concatenate([part, np.zeros((len(part), 5))], axis=1) for part in (mean, deviation))
    return student_term(judge(record, terms, discrepancy).size_differences(*outputs))


def numbers(mean, deviation, record, discrepancy):
    """Of the numbers of a record."""
    return number_term(mean, deviation, record.number, np.full(2, record.dispersion_index), discrepancy)


def judge(record, terms=("potency",), error=NONE, model_error=0.0):
    """Likelihood of a record of two steps, all outputs side by side."""
    columns = {"potency": slice(0, 2), "number": slice(2, 4), "places": slice(4, 6), "sizes": slice(6, 7)}
    errors = dict.fromkeys([*columns, MEAN_POTENCY], error)
    return Likelihood(record, terms, columns, CellCorrection(np.zeros(7), errors), model_error, np.zeros(7))


def test_potency_term_is_the_density_of_a_student_t_with_the_stated_covariance():
    """Against scipy; the covariance is that of surrogate, record (sizes and number), both parts of the discrepancy."""
    mean, deviation = np.array([[1.0, 2.0], [0.3, 2.5]]), np.array([[0.1, 0.2], [0.4, 0.1]])
    discrepancy = Discrepancy(common=0.3, own=0.2)
    record = recorded([1.2, 1.7])
    for point, found in enumerate(potency_term(mean, deviation, record, discrepancy)):
        covariance = np.diag(deviation[point] ** 2 + 0.04 + 0.04 + 3.0 / np.array([40, 60])) + 0.09
        shape = covariance * (DEGREES_OF_FREEDOM - 2) / DEGREES_OF_FREEDOM
        expected = multivariate_t(mean[point], shape, DEGREES_OF_FREEDOM).logpdf(record.log_potency)
        np.testing.assert_allclose(found, expected, rtol=1e-12)


def test_number_term_is_negative_binomial_and_poisson_without_clusters():
    """Nothing left open: the closed forms; variance over mean is the dispersion index."""
    expected = np.array([[35.0, 70.0]])
    record = recorded([0, 0])
    exact = sum(nbinom(mean / 2.0, 1 / 3.0).logpmf(number) for mean, number in zip(expected[0], (40, 60), strict=True))
    nothing = np.zeros((1, 2))
    np.testing.assert_allclose(numbers(np.log(expected), nothing, record, NONE), exact, rtol=1e-9)
    record = recorded([0, 0], dispersion_index=1.0)
    exact = poisson(expected[0]).logpmf([40, 60]).sum()
    np.testing.assert_allclose(numbers(np.log(expected), nothing, record, NONE), exact, atol=5e-3)


def test_number_term_sums_to_one_over_all_numbers():
    """It stays a distribution when the expected number is uncertain, for one step."""
    every = np.arange(2000)
    discrepancy = Discrepancy(common=0.3, own=0.2)
    total = sum(
        np.exp(number_term(np.log([[30.0]]), np.array([[0.2]]), np.array([n]), np.array([2.0]), discrepancy))[0]
        for n in every
    )
    np.testing.assert_allclose(total, 1.0, atol=1e-3)


def test_an_error_that_all_steps_share_excuses_a_common_shift_only():
    """All steps too large by as much are likelier than steps too large and too small, given a common discrepancy."""
    mean, deviation = np.zeros((1, 2)), np.full((1, 2), 0.1)
    shared = Discrepancy(common=0.8)
    together, apart = (recorded(values, number=n) for values, n in (((0.8, 0.8), (22, 22)), ((0.8, -0.8), (22, 5))))
    assert potency_term(mean, deviation, together, shared) > potency_term(mean, deviation, apart, shared) + 2.0
    tens = np.log(10.0) + mean
    shared_gain, own_gain = (
        numbers(tens, deviation, together, error) - numbers(tens, deviation, apart, error)
        for error in (shared, Discrepancy(own=0.8))
    )
    assert shared_gain > own_gain + 0.5
    implausible = [judge(together, error=error).implausibility(mean, deviation) for error in (NONE, shared)]
    assert implausible[0] > implausible[1]


@pytest.mark.parametrize("shift", [0.0, 0.4])
def test_intervals_hold_the_truth_as_often_as_they_say(shift):
    """A linear model of two quantities, records drawn from it with a common error: 90 % intervals hold the truth in 83
    to 96 % of 100 records, and take less than two thirds of the prior. Without the common error in the likelihood
    they hold it less often."""
    random = np.random.default_rng(5)
    truth = random.uniform(0.15, 0.85, (100, 2))
    slopes = np.array([[3.0, 0.5], [1.0, 2.5]])
    held, blind, widths = [], [], []
    for true in truth:
        log_potency = true @ slopes.T + shift * random.normal() + random.normal(0, 0.2, 2)
        record = recorded(log_potency, variance=0.03, number=(300, 300))
        for discrepancy, result in ((Discrepancy(common=shift), held), (NONE, blind)):

            def evaluate(points, record=record, discrepancy=discrepancy):
                nothing = np.zeros((len(points), 7))
                mean = np.concatenate([points @ slopes.T, nothing[:, 2:]], axis=1)
                judged = judge(record, error=discrepancy)
                return judged(mean, nothing), judged.implausibility(mean, nothing)

            found = find_posterior(evaluate, 2, seed=7, points=2**10)
            low, high = found.quantiles(np.array([0.05, 0.95]))
            result.append((low < true) & (true < high))
            if discrepancy.common == shift:
                widths.append(found.width_left())
    assert 0.83 < np.mean(held) < 0.96
    assert np.mean(widths) < 0.67
    if shift:
        assert np.mean(blind) < np.mean(held) - 0.05


def test_terms_add_up_and_each_can_be_left_out():
    """All four, in any order: number and places by themselves, potency and sizes together."""
    random = np.random.default_rng(1)
    mean, deviation = random.normal(size=(5, 7)), random.uniform(0.1, 0.3, (5, 7))
    record = recorded([0.1, 0.2])
    terms = ("potency", "number", "places", "sizes")
    every = judge(record, terms[::-1])
    single = [judge(record, (term,))(mean, deviation) for term in ("number", "places")]
    single.append(student_term(every.size_differences(mean, deviation)))
    np.testing.assert_allclose(every(mean, deviation), sum(single))
    assert every.size_differences(mean, deviation).off.shape == (5, 3)


def test_chance_of_the_number_does_not_count_again_in_the_potency():
    """Twice the expected events, of the expected mean potency: the potency says nothing beside the number. A step
    without events has no mean event, and what trials err by in both is no error of the mean event."""
    mean, deviation = np.zeros((1, 7)), np.full((1, 7), 0.2)
    mean[0, :4] = *np.log([80.0, 120.0]), *np.log([40.0, 60.0])
    double = recorded(np.log([160.0, 240.0]), number=(80, 120))
    both = judge(double, ("potency", "number"))
    np.testing.assert_allclose(both.size_differences(mean, deviation).off, 0.0, atol=1e-12)
    alone = judge(double).size_differences(mean, deviation)
    np.testing.assert_allclose(alone.off, np.log(2.0))
    shared = replace(both, shared=0.9).size_differences(mean, deviation).covariance[0, 0, 0]
    np.testing.assert_allclose(both.size_differences(mean, deviation).covariance[0, 0, 0] - shared, 2 * 0.9 * 0.04)
    empty = judge(recorded(np.log([160.0, 0.1]), number=(80, 0)), ("potency", "number"))
    assert empty.size_differences(mean, deviation).off.shape == (1, 1)


def test_the_larger_chance_of_record_and_runs_counts():
    """Runs that scatter less than the record add nothing; runs that scatter more set number and potency."""
    mean, nothing = np.zeros((1, 7)), np.zeros((1, 7))
    judged = judge(recorded([0.1, 0.2]), ("potency", "number"))
    calm, wild = (replace(judged, chance=np.full(7, chance)) for chance in (0.1, 0.5))
    np.testing.assert_array_equal(
        calm.differences(mean, nothing).covariance, judged.differences(mean, nothing).covariance
    )
    np.testing.assert_allclose(np.diag(wild.differences(mean, nothing).covariance[0]), [0.5, 0.5, 0.25, 0.25])
    np.testing.assert_allclose(wild.dispersion_index, [10.0, 15.0])
    only = replace(wild, terms=("potency",)).differences(mean, nothing).covariance[0]
    np.testing.assert_allclose(np.diag(only), 0.25)


def test_places_count_by_independent_events():
    """A gain of one nat in a step of forty events that come three at a time is worth 13.3 nats."""
    mean = np.zeros((2, 7))
    mean[1, 4] = 1.0
    judged = judge(recorded([0, 0], number=(40, 60), dispersion_index=3.0), ("places",))
    first, other = judged(mean, np.zeros((2, 7)))
    assert other - first == pytest.approx(40 / 3)
    unsure = replace(judged, gain_error=np.array([0.5, 0.01]))
    np.testing.assert_allclose(unsure.place_weights(), [2.0, 20.0])  # one over the error; sixty over three


def test_numbers_and_sizes_that_no_values_give_are_implausible():
    """Potency right, number or mean size far off: only a likelihood that counts them says so."""
    record = RecordedOutputs(np.zeros(2), np.array([100, 100]), 1.0, 0.0, errors_of(0.01, 0.01, 0.01))
    mean = np.array([[0.0, 0.0, np.log(100), np.log(100), 0, 0, 0.0]])
    few, large = mean.copy(), mean.copy()
    few[0, 3], large[0, 6] = np.log(50), 0.5
    nothing = np.zeros((1, 7))
    for terms, expected in (
        (("potency",), (0.0, 0.0)),
        (("number",), (np.log(2) * 10, 0.0)),
        (("sizes",), (0.0, 5.0)),
    ):
        found = [judge(record, terms).implausibility(one, nothing)[0] for one in (few, large)]
        np.testing.assert_allclose(found, expected, atol=1e-9)


def test_steps_that_are_all_off_a_little_are_implausible_together():
    """Four values, each 2.2 standard deviations off, are more than three off together. A common error excuses them."""
    record = RecordedOutputs(np.zeros(2), np.array([100, 100]), 1.0, 0.0, errors_of(0.01, 0.01, 0.01))
    mean = np.array([[0.44, 0.44, np.log(100) + 0.22, np.log(100) + 0.22, 0, 0, 0.0]])
    judged = judge(replace(record, log_potency=np.zeros(2)), ("potency", "number"))
    found = judged.implausibility(mean, np.zeros((1, 7)))[0]
    expected = -norm.ppf(0.5 * chi2.sf(4 * 2.2**2, 4))
    assert found == pytest.approx(expected)
    assert found > 3.0
    excused = judge(record, ("potency", "number"), error=Discrepancy(common=0.2))
    assert excused.implausibility(mean, np.zeros((1, 7)))[0] < 2.0


@pytest.mark.parametrize("share", [1.0, 0.2])
@pytest.mark.parametrize(("modelled", "number"), [(200, (2, 1)), (2, (150, 50)), (40, (20, 20)), (3, (0, 0))])
def test_mean_sizes_of_one_law_agree_whatever_the_numbers(modelled, number, share):
    """Each holds one event more, which counts for more beside few. That of whole steps is compared, however long the
    record was taken in them."""
    excess, events = 0.36, sum(number)
    mean = np.zeros((1, 7))
    mean[0, 2:4], mean[0, 6] = np.log(share * modelled / 2), mean_excess(np.full(modelled, excess))
    record = replace(recorded([0.0, 0.0], number=number), log_excess=mean_excess(np.full(events, excess)))
    likelihood = judge(record, ("sizes",))
    correction = replace(likelihood.correction, share=np.full(2, share))
    found = replace(likelihood, correction=correction).size_differences(mean, np.full((1, 7), 0.1))
    assert found.off[0, 0] == pytest.approx(0.0, abs=1e-6)
