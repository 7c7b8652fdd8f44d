"""Study `moving`: particles that move beside particles that rest."""

import numpy as np

from tests.verification.running import run_study
from verification.answers.moving import brittle_rows, elastic_rows
from verification.answers.schemes import Pairs, Run

ELASTIC = ["resting_stiff", "moving_stiff", "resting_medium", "moving_medium", "resting_soft", "moving_soft"]


def test_difference_vanishes_with_the_displacement(tmp_path):
    """The elastic rows of the study, at its own size and bounds."""
    rows, closures = elastic_rows(run_study("moving", tmp_path, ELASTIC))
    assert len(rows) == 4
    assert all(row.passed is not False for row in rows), rows
    closure, difference = np.array(closures).T
    np.testing.assert_allclose(closure / closure[0], [1.0, 10.0, 100.0], rtol=1e-6)
    assert (difference > 0.0).all(), "moving particles must change something"


def test_brittle_runs_that_differ_in_the_mean_are_told_apart():
    """Runs whose mean is one standard deviation apart are within two standard errors of four runs, five are not."""

    def run(potency):
        return Run(potency, 1.0, np.zeros(1, bool), np.zeros(0), 1.0, 1, 0)

    values = np.array([9.0, 11.0, 9.0, 11.0])
    for shift, passed in ((1.0, True), (5.0, False)):
        pairs = Pairs({"resting": [run(v) for v in values], "moving": [run(v + shift) for v in values]})
        potency = brittle_rows("made up", pairs, 2.0)[0]
        assert potency.passed is passed
