"""Claims of the study of a calibration on known truth, on a simulator of one strength and one modulus."""

import json

import numpy as np
import pytest

from calibration.fit import Rows, calibrate
from calibration.posterior import sobol_points
from calibration.recorded import RecordedOutputs
from calibration.settings import CalibrationSettings, strength_under
from calibration.stages import Calibration, TrialCatalogues
from calibration.trials import MEAN_POTENCY, CellCorrection, Discrepancy, Outputs
from verification.calibration_truth import claims
from verification.calibration_truth.settings import SAME_LAW, case_slice, records, truths
from verification.calibration_truth.study import draw, intervals
from workflow.calibration_trials import CalibrationTrials
from workflow.configuration import load
from workflow.strict_yaml import read_yaml

HOST = "materials.host"
SETTINGS = CalibrationSettings.read(
    {
        "quantities": [
            {"key": f"{HOST}.friction_angle.residual", "range": ["16 deg", "24 deg"], "source": "test"},
            {"key": f"{HOST}.cohesion.residual", "range": ["1 MPa", "4 MPa"], "source": "test", "scale": "log"},
            {"key": f"{HOST}.youngs_modulus", "range": ["45 GPa", "70 GPa"], "source": "test"},
        ]
    }
)
TRUTH = np.array([[0.5, 0.5, 0.4]])
CONFINEMENT = 6e6  # Pa, under which the simulator knows a strength.


def simulator(points):
    """ln potency of two steps: they fall with the strength, and with the modulus."""
    friction, cohesion, modulus = (
        np.array([quantity.value(share) for share in column])
        for quantity, column in zip(SETTINGS.quantities, points.T, strict=True)
    )
    strength = [strength_under(CONFINEMENT, 1e6 * c, angle) for c, angle in zip(cohesion, friction, strict=True)]
    fallen = np.array(strength) / 5e6
    return np.stack([5.0 - fallen - 0.02 * modulus, 4.0 - 0.8 * fallen - 0.01 * modulus], axis=1)


def calibrated(shift=0.0, correction=None) -> Calibration:
    """40 trials calibrated to a record of TRUTH, which is larger by `shift` in ln."""
    points = sobol_points(40, 3, seed=1)
    chance = 0.05 * np.random.default_rng(2).standard_normal((2, 40, 2))
    made = {"potency": simulator(points) + chance[0], "number": simulator(points) + 3.0 + chance[1]}
    rows = Rows(points, Outputs(made), np.arange(40))
    expected = simulator(TRUTH)[0] + shift
    number = np.round(np.exp(expected + 3.0)).astype(int)
    recorded = RecordedOutputs(expected, number, 1.5, 0.0, np.sqrt(0.03) * np.concatenate([np.eye(3), -np.eye(3)]))
    correction = correction or CellCorrection.none(rows.outputs)
    fit = calibrate(rows, correction, recorded, ("potency", "number"), 0.1, seed=1)
    return Calibration(SETTINGS, ("one", "two"), [], -2.0, rows, None, fit, TrialCatalogues(points, [], rows.trials))


@pytest.fixture(scope="module")
def found():
    """Trials and record agree."""
    return calibrated()


def test_trials_as_records_are_covered_and_the_strength_is_what_is_known(found):
    """All claims hold; the strength near 6 MPa has the narrowest interval, and cohesion alone is hardly known."""
    trials = np.arange(40)
    rows = claims.self_test_claims(found, found.self_test(trials), trials)
    assert all(row.holds for row in rows), rows
    width = {row.quantity: float(row.measured) for row in rows if row.claim == "width left"}
    (strength,) = (name for name in width if "strength" in name)
    assert abs(float(strength.split()[-2]) - 6.0) < 2.5
    assert width[strength] < 0.5
    assert width[f"{HOST}.cohesion.residual"] > 1.3 * width[strength]


def test_the_figure_has_a_panel_for_each_quantity_from_what_json_holds(found):
    trials = np.arange(0, 40, 2)
    tested = found.self_test(trials)
    held = intervals(tested, found.rows.points[trials], SETTINGS.quantities)
    assert json.loads(json.dumps(held)) == held
    assert [panel["true"][0] for panel in held] == [
        quantity.value(share) for quantity, share in zip(SETTINGS.quantities, found.rows.points[0], strict=True)
    ]
    assert [panel["held"] for panel in held] == tested.held.T.tolist()
    assert len(draw(held).axes) == 3


def test_a_twin_comes_back_and_one_from_other_cells_only_with_their_correction(found):
    """A record larger by 0.8 in ln is missed where cells are not corrected, and held with their shift and its error."""
    truth = TRUTH[0]
    assert all(row.holds for row in claims.twin_claims(found, "same", truth, found.fit, wanted_flag=False))
    blind = calibrated(shift=0.8)
    low, _, high = blind.fit.posterior.quantiles(claims.SHARES)
    assert not ((low <= truth) & (truth <= high)).all()
    error = {term: Discrepancy(0.2, 0.05) for term in ("potency", "number")} | {MEAN_POTENCY: Discrepancy(0.05, 0.05)}
    told = calibrated(shift=0.8, correction=CellCorrection(np.full(4, 0.8), error))
    assert all(row.holds for row in claims.twin_claims(told, "other cells", truth, told.fit, wanted_flag=False))


def test_a_record_of_another_law_is_flagged():
    """Its steps cannot both be right: the claim holds. A record that fits is not: the claim fails."""
    strange = calibrated(shift=np.array([2.0, -2.0]))
    assert claims.flag_claim("strange", strange.fit.posterior, wanted_flag=True).holds
    assert not claims.flag_claim("strange", strange.fit.posterior, wanted_flag=False).holds


def test_chains_and_weighted_points_agree(found, monkeypatch):
    """Quantiles of both samplers of one posterior; a posterior that is not that of the chains is told."""
    monkeypatch.setattr(claims, "STEPS", 500)
    monkeypatch.setattr(claims, "BURN_IN", 100)
    chain = claims.chain_quantiles(found.fit, claims.SHARES, found.settings.seed)
    monkeypatch.setattr(claims, "chain_quantiles", lambda *_: chain)  # of both posteriors: it depends on neither
    rows = claims.chain_claims(found)
    assert [row.holds for row in rows] == [True] * 4, rows
    other = calibrated(shift=0.5)
    mixed = Calibration(
        SETTINGS, found.steps, [], found.cut, found.rows, None,
        type(found.fit)(found.fit.surrogate, found.fit.likelihood, other.fit.posterior), found.trials,
    )  # fmt: skip
    assert not all(row.holds for row in claims.chain_claims(mixed))


def test_records_of_the_study_have_the_truth_of_the_mine_file_or_another_host():
    """The demo: its own values lie in the middle of their ranges or near; other hosts change the host only."""
    file = "config/mines/demo.yaml"
    trials = CalibrationTrials(load(read_yaml(file), file), file)
    found = truths(trials)
    np.testing.assert_allclose(found["truth"], [0.5, 0.5, 0.5, 0.48], atol=0.01)
    twin = read_yaml("config/mines/demo/twin.yaml")["materials"]["host"]
    values = [one.written(share) for one, share in zip(trials.settings.quantities, found["record_truth"], strict=True)]
    assert values[:2] == [twin["friction_angle"]["residual"], twin["cohesion"]["residual"]]
    slices = {case: case_slice(trials, case) for case in records()}
    same = slices[SAME_LAW]
    assert [step["scene"]["realization"] for step in same["steps"]] == [10_001] * 4
    for case, other in slices.items():
        assert other["grid"] == same["grid"]
        assert (other["elastic"]["materials"] == same["elastic"]["materials"]) == (case == SAME_LAW)
