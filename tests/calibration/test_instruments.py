"""Readings of instruments: contrasts, densities against slow twins, states, tests of agreement, and the whole fit."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import xarray as xr
from scipy.stats import kstest

from calibration.fit import Rows, calibrate, calibrate_to_trials
from calibration.instrument_findings import MIN_ODDS, by_terms, find, other_values_odds, p_value, sentences
from calibration.instruments import (
    SCALED,
    SCALED_FACTOR,
    SILENT,
    SILENT_ERROR,
    STATE_SHARES,
    STATED_AS_95,
    UNKNOWN_ERRORS,
    WORKS,
    instrument_term,
)
from calibration.limits import beyond_range
from calibration.posterior import find_posterior
from calibration.recorded import RecordedOutputs
from calibration.settings import CalibrationSettings
from calibration.student import widened_density
from calibration.tradeoffs import further_points
from calibration.trials import CellCorrection, Outputs
from common.errors import InputError

MODEL_ERROR = 0.1
DATES = 3
COUNT = 5  # Instruments of the made-up mine.
SLOPES = np.array([[1.5, 0.2], [-0.8, 1.0], [0.3, -1.4], [1.0, 1.0], [-0.2, 1.6]])
LARGEST = 8.0


def table(measured, error=0.3, zeroed=True, places=1, names=None) -> xr.Dataset:
    """Readings (instrument, place, date) flat; each at DATES dates."""
    rows = len(measured)
    instruments = rows // (DATES * places)
    names = names or [f"I{number}" for number in range(instruments)]
    return xr.Dataset(
        {
            "instrument": ("row", np.repeat(np.array(names, object), DATES * places)),
            "distance": ("row", np.tile(np.repeat(np.arange(places, dtype=float), DATES), instruments)),
            "step": ("row", np.array([f"s{number % DATES}" for number in range(rows)], object)),
            "unit": ("row", np.full(rows, "MPa", object)),
            "measured": ("row", np.array(measured, float)),
            "measured_error": ("row", np.full(rows, error)),
            "zeroed": ("row", np.full(rows, int(zeroed), np.int8)),
        }
    )


def modelled(points):
    """Values (point, row) of COUNT instruments: stress that changes with the steps, and with two quantities."""
    change = LARGEST * np.exp(0.5 * (points - 0.5) @ SLOPES.T)
    return (change[:, :, None] * np.array([0.2, 0.7, 1.0])).reshape(len(points), -1)


POINTS = np.random.default_rng(2).uniform(size=(30, 2))
CELLS = 0.2  # MPa


def term_of(measured, **more):
    """Term and scores of the trials at POINTS."""
    values = modelled(POINTS)
    return instrument_term(table(measured, **more), values, np.full_like(values, STATED_AS_95 * CELLS), MODEL_ERROR)


def fitted(term, scores, terms=("instruments",), surrogate=None):
    """Calibrated to the readings alone."""
    outputs = Outputs({name: np.zeros((len(scores), 0)) for name in ("potency", "number", "sizes")})
    outputs.by_term["instruments"] = scores
    rows = Rows(POINTS, outputs, np.arange(len(POINTS)))
    known = CellCorrection.none(outputs), RecordedOutputs.none(), terms, MODEL_ERROR, 1
    return calibrate(rows, *known, surrogate, 2**11, term), rows


def made_readings(truth, generator, factor=None):
    """Readings of instruments that work, at the true values (quantity,)."""
    exact = modelled(truth[None])[0].reshape(COUNT, DATES)
    value = exact * np.exp(MODEL_ERROR * generator.standard_normal((COUNT, 1)))
    value += CELLS * np.sqrt(0.5) * (generator.standard_normal((COUNT, 1)) + generator.standard_normal((COUNT, DATES)))
    value += 0.3 * generator.standard_normal((COUNT, DATES)) + 20.0 * generator.standard_normal((COUNT, 1))
    return (value if factor is None else value * np.array(factor)[:, None]).ravel()


def test_the_zero_of_an_instrument_changes_nothing():
    """Any constant added to all readings of a place; without `since` it does."""
    readings = modelled(POINTS[:1])[0]
    moved = readings + np.repeat(np.arange(COUNT) - 40.0, DATES)
    variance = np.full((30, 1), 0.1)
    for zeroed in (True, False):
        (first, scores), (other, _) = (term_of(one, zeroed=zeroed) for one in (readings, moved))
        same = np.allclose(first(scores, variance), other(scores, variance))
        assert same == zeroed
    assert [len(one.value) for one in first.instruments] == [DATES] * COUNT
    assert [len(one.value) for one in term_of(readings)[0].instruments] == [DATES - 1] * COUNT


@pytest.mark.parametrize("zeroed", [True, False])
def test_densities_are_those_of_whole_covariances(zeroed):
    """Each state and error, with the covariance written out."""
    term, scores = term_of(made_readings(POINTS[3], np.random.default_rng(1)), error=np.nan, zeroed=zeroed)
    one, number = term.instruments[1], 4
    variance = np.random.default_rng(4).uniform(0.01, 0.2, scores.shape)
    found = term.by_error(1, scores, variance)
    assert found.shape == (30, len(UNKNOWN_ERRORS), 3)
    contrasts = np.linalg.qr(np.eye(DATES) - 1.0 / DATES)[0][:, : DATES - 1].T if zeroed else np.eye(DATES)
    turn = one.contrasts @ contrasts.T  # the density does not depend on which contrasts are taken
    np.testing.assert_allclose(turn @ turn.T, np.eye(len(turn)), atol=1e-12)
    by_cells = 0.5 * CELLS**2 * (np.ones((DATES, DATES)) + np.eye(DATES))
    given = modelled(POINTS).reshape(-1, COUNT, DATES)[:, 1] @ one.contrasts.T
    left = given - one.expected(scores)  # by the scores that are kept
    assert np.abs(left).max() < 0.3
    for error, share in enumerate(UNKNOWN_ERRORS):
        cov = by_cells + (share * one.size) ** 2 * np.eye(DATES)
        cov = (
            one.contrasts @ cov @ one.contrasts.T
            + left.T @ left / len(left)
            + one.basis @ np.diag(variance[number]) @ one.basis.T
        )
        mean = one.expected(scores[number : number + 1])[0]
        offset = np.zeros((len(mean), len(mean))) if zeroed else np.ones((DATES, DATES)) * one.size**2
        for state, more in (
            (WORKS, MODEL_ERROR**2 * np.outer(mean, mean)),
            (SCALED, (MODEL_ERROR**2 + SCALED_FACTOR**2) * np.outer(mean, mean) + offset),
            (SILENT, MODEL_ERROR**2 * np.outer(mean, mean) + (SILENT_ERROR * one.size) ** 2 * np.eye(len(mean))),
        ):
            off = one.value - mean
            squares, half_log_det = off @ np.linalg.solve(cov + more, off), 0.5 * np.linalg.slogdet(cov + more)[1]
            wanted = widened_density(squares, half_log_det, len(off)) + np.log(
                STATE_SHARES[state] / len(UNKNOWN_ERRORS)
            )
            np.testing.assert_allclose(found[number, error, state], wanted, rtol=1e-8)


def test_order_and_units_of_the_readings_do_not_matter():
    """Instruments and dates in another order; everything in kPa: log-densities differ by a constant at most."""
    measured = made_readings(POINTS[3], np.random.default_rng(1))
    (first, scores), values = term_of(measured), modelled(POINTS)
    order = np.random.default_rng(3).permutation(len(measured))
    errors = np.full_like(values, STATED_AS_95 * CELLS)
    shuffled, others = instrument_term(table(measured).isel(row=order), values[:, order], errors, MODEL_ERROR)
    in_kpa, scaled = instrument_term(table(1e3 * measured, error=300.0), 1e3 * values, 1e3 * errors, MODEL_ERROR)
    nothing = np.zeros(scores.shape)
    densities = [term(at, nothing).sum(axis=1) for term, at in ((first, scores), (shuffled, others), (in_kpa, scaled))]
    np.testing.assert_allclose(densities[1], densities[0], atol=0.02)
    np.testing.assert_allclose(np.diff(densities[2]), np.diff(densities[0]), atol=1e-6)


def test_anchors_have_a_zero_each_and_one_factor():
    """Two places of an instrument: contrasts of each; a reading without rock in one trial does not count."""
    values = np.concatenate([modelled(POINTS)[:, :DATES], 2.0 * modelled(POINTS)[:, :DATES]], axis=1)
    measured = values[0] + np.repeat([5.0, -7.0], DATES)
    holes = values.copy()
    holes[2, DATES] = np.nan
    for given, contrasts, counted in ((values, 4, 6), (holes, 3, 5)):
        term, _ = instrument_term(table(measured, places=2), given, np.zeros_like(values), MODEL_ERROR)
        (one,) = term.instruments
        assert (len(one.value), len(one.step)) == (contrasts, counted)
        np.testing.assert_allclose(one.contrasts @ (one.distance == 1.0), 0.0, atol=1e-12)


def test_instruments_whose_readings_do_not_count_are_named_and_none_is_refused():
    """One reading of an instrument that was zeroed; no other instrument: one line."""
    measured = modelled(POINTS[:1])[0]
    measured[1:DATES] = np.nan
    term, _ = term_of(measured)
    assert term.unused == ("I0",)
    assert [one.name for one in term.instruments] == ["I1", "I2", "I3", "I4"]
    with pytest.raises(InputError, match="no reading counts: an instrument that was zeroed") as refused:
        term_of(np.where(np.arange(len(measured)) % DATES, np.nan, measured))
    assert "\n" not in str(refused.value)


def test_intervals_hold_the_truth_as_often_as_they_say():
    """95 % intervals of 40 sets of readings, and p-values of instruments that work are uniform. Without the factor of
    the model the intervals hold less."""
    generator = np.random.default_rng(5)
    held, blind, p_values, surrogate = [], [], [], None
    for _ in range(40):
        truth = generator.uniform(size=2)
        term, scores = term_of(made_readings(truth, generator))
        fit, _ = fitted(term, scores, surrogate=surrogate)
        surrogate = fit.surrogate
        low, _, high = fit.posterior.intervals(0.95)
        held.append((low <= truth) & (truth <= high))
        p_values += [one.p_rest for one in find(fit, by_terms(fit, 1), 1).instruments]
        sure = replace(fit.likelihood, instruments=replace(term, model_error=0.01))
        low, _, high = replace(fit, likelihood=sure).with_terms(("instruments",), 1).posterior.intervals(0.95)
        blind.append((low <= truth) & (truth <= high))
    assert 0.90 <= np.mean(held) <= 0.99
    assert np.mean(blind) < np.mean(held) - 0.05
    assert np.mean(np.array(p_values) < 0.05) < 0.10
    assert np.median(p_values) < 0.75


FAULTS = {"factor": 2.5, "sign": -1.0, "kPa": 1000.0}


@pytest.mark.parametrize("fault", FAULTS)
def test_a_broken_instrument_is_called_out_and_hardly_counts(fault):
    """One of five: the page names it, and the interval stays where it was."""
    generator, surrogate = np.random.default_rng(6), None
    named, moved = [], []
    for _ in range(8):
        truth = generator.uniform(0.2, 0.8, size=2)
        right = made_readings(truth, generator)
        fits = []
        for measured in (right, right * np.repeat([FAULTS[fault], *np.ones(COUNT - 1)], DATES)):
            term, scores = term_of(measured)
            fits.append(fitted(term, scores, surrogate=surrogate)[0])
            surrogate = fits[-1].surrogate
        found = find(fits[1], by_terms(fits[1], 1), 1)
        named.append("I0" in [one.name for one in found.contradicts_rest()])
        low, middle, high = fits[0].posterior.intervals(0.9)
        moved.append((fits[1].posterior.intervals(0.9)[1] - middle) / (high - low))
        if named[-1]:
            (line,) = [one for one in sentences(found) if "Instrument I0" in one]
            assert "times what the model gives there" in line
    assert np.mean(named) >= 0.75
    assert np.sqrt(np.mean(np.array(moved) ** 2)) < 0.25


@pytest.mark.parametrize(
    ("quantities", "truth", "deviations"),
    [
        (2, 0.5, (0.09, 0.16)),
        (4, 0.5, (0.1, 0.1)),
        (4, 0.95, (0.05, 0.5)),
        (4, 0.95, (0.05, 10.0)),
        (1, 1.0, (0.05, 0.5)),
    ],
)
def test_right_data_are_seldom_said_to_want_other_values(quantities, truth, deviations):
    """Normal likelihoods within the ranges, in their middle and at their ends, of data that say much and nothing: at
    most one pair in twenty. Of values that are far apart most are."""
    generator, found = np.random.default_rng(8), {0.0: [], 1.0: []}
    for apart, odds in found.items():
        for _ in range(40):
            middles = truth + np.array(deviations)[:, None] * generator.standard_normal((2, quantities))
            middles[1, 0] -= apart * truth

            def log_density(points, of, middles=middles):
                return sum(-0.5 * (((points - middles[one]) / deviations[one]) ** 2).sum(axis=1) for one in of)

            fits = {
                name: SimpleNamespace(
                    posterior=find_posterior(
                        lambda points, of=of: (log_density(points, of), np.ones(len(points))), quantities, 1, 2**11
                    )
                )
                for name, of in (("catalogue alone", (0,)), ("instruments alone", (1,)), ("both", (0, 1)))
            }
            odds.append(other_values_odds(fits))
    assert np.mean(np.array(found[0.0]) >= MIN_ODDS) <= 0.1
    if max(deviations) < 0.2:
        assert np.mean(np.array(found[1.0]) >= MIN_ODDS) > 0.4
    assert np.isnan(other_values_odds({"instruments": None}))


def test_p_values_are_uniform_where_the_posterior_is_not_normal():
    """Points in two far groups: no shape is assumed."""
    term, scores = term_of(modelled(POINTS[:1])[0])
    one, generator = term.instruments[0], np.random.default_rng(17)
    groups = np.argsort(POINTS @ SLOPES[0])[[0, 1, 2, -3, -2, -1]]
    at, variance, weights = scores[groups], np.zeros((6, scores.shape[1])), np.array([0.3, 0.2, 0.1, 0.2, 0.1, 0.1])
    found = []
    for _ in range(400):
        drawn = generator.choice(6, p=weights)
        (made, *_) = term.made(at[drawn], variance[0], [0] * COUNT, generator).instruments
        found.append(p_value(made, 0, MODEL_ERROR, generator, at, variance, weights))
    assert kstest(found, "uniform").pvalue > 0.01
    assert p_value(replace(one, value=one.value + 50.0), 0, MODEL_ERROR, generator, at, variance, weights) < 0.001


def test_all_that_follows_a_fit_takes_readings_alone():
    """Self-test, the test of the ends of the ranges, further trials, and readings beyond all values."""
    term, scores = term_of(made_readings(np.array([0.4, 0.6]), np.random.default_rng(8)))
    fit, rows = fitted(term, scores)
    tested = calibrate_to_trials(fit, rows, np.arange(0, 30, 2), seed=2)
    assert 0.75 < tested.coverage <= 1.0
    assert not beyond_range(fit, 1).is_told
    assert further_points(fit, 3, seed=1).shape == (3, 2)
    assert fit.fits
    assert fit.intervals().shape == (3, 0)
    large = modelled(np.array([[0.4, 0.6]]))[0] * 12.0
    term, scores = term_of(large)
    assert not fitted(term, scores)[0].fits


def test_pairs_correct_instruments_by_score():
    """A shift of each score is found again, and the scatter of each is its own."""
    generator = np.random.default_rng(9)
    coarse = generator.normal(size=(200, 3))
    finer = coarse + np.array([1.0, -2.0, 0.5]) + generator.normal(size=(200, 3)) * np.array([0.5, 0.1, 0.0])
    empty = {"potency": np.zeros((200, 0)), "number": np.zeros((200, 0))}
    found = CellCorrection.of(Outputs(empty | {"instruments": coarse}), Outputs(empty | {"instruments": finer}), 200)
    np.testing.assert_allclose(found.shift, [1.0, -2.0, 0.5], atol=0.1)
    np.testing.assert_allclose(found.scatter, [0.5, 0.1, 0.0], atol=0.06)


def test_instruments_are_a_term_by_name():
    """Beside those of the catalogue; by default they stay out."""
    one = {"key": "materials.host.youngs_modulus", "range": ["40 GPa", "60 GPa"], "source": "test"}
    settings = CalibrationSettings.read({"quantities": [one], "terms": ["instruments", "number"]})
    assert (settings.catalogue_terms, settings.uses_instruments) == (("number",), True)
    assert not CalibrationSettings.read({"quantities": [one]}).uses_instruments
    with pytest.raises(InputError, match=r"terms\[0\]"):
        CalibrationSettings.read({"quantities": [one], "terms": ["instrument"]})


def test_readings_are_made_with_the_covariance_that_judges_them():
    """About what is expected: the page's figure draws its intervals from them."""
    term, scores = term_of(modelled(POINTS[:1])[0])
    one, generator = term.instruments[0], np.random.default_rng(18)
    same, variance = np.repeat(scores[:1], 20_000, axis=0), np.full((20_000, scores.shape[1]), 0.02)
    made = one.made(same, variance, MODEL_ERROR, 0, generator)
    expected = one.covariance(scores[:1], variance[:1], MODEL_ERROR, 0)[0]
    np.testing.assert_allclose(np.cov(made.T), expected, atol=0.03 * np.abs(expected).max())
    np.testing.assert_allclose(made.mean(axis=0), one.expected(scores[:1])[0], atol=0.03 * np.sqrt(expected.max()))
