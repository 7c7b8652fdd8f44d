"""Specimens and a fault of rock with weak planes: Jaeger's closed form by what makes it right, and both studies."""

import math

import numpy as np
import pytest
from running import run_study

from verification.answers import fault, jaeger
from verification.answers.fault import normal_of, share_within
from verification.answers.jaeger import jaeger_strength

ROCK, PLANE = (10e6, 40.0), (2e6, 30.0)


@pytest.mark.parametrize("angle", [40.0, 50.0, 60.0, 75.0])
def test_jaegers_planes_are_at_their_strength(angle):
    """Resolved on the plane: tau = c - sn tan phi; at 45 + phi / 2 it is least, 2 c sqrt N unconfined."""
    confinement = 5e6
    deviator, slips = jaeger_strength(angle, confinement, ROCK, PLANE)
    assert slips
    normal = np.array([math.sin(math.radians(angle)), 0.0, math.cos(math.radians(angle))])
    traction = np.diag([-confinement, -confinement, -confinement - deviator]) @ normal
    across = traction @ normal
    shear = np.linalg.norm(traction - across * normal)
    assert shear == pytest.approx(PLANE[0] - across * math.tan(math.radians(PLANE[1])), rel=1e-12)
    assert deviator >= jaeger_strength(60.0, confinement, ROCK, PLANE)[0]
    assert jaeger_strength(60.0, 0.0, ROCK, PLANE)[0] == pytest.approx(2 * 2e6 * math.sqrt(3.0))


@pytest.mark.parametrize("angle", [0.0, 20.0, 30.0, 90.0])
def test_where_planes_cannot_slip_the_rock_fails(angle):
    """Along, across, and where friction holds the plane: N p + sigma_c - p."""
    factor = (1 + math.sin(math.radians(40))) / (1 - math.sin(math.radians(40)))
    expected = (factor - 1) * 5e6 + 2 * 10e6 * math.sqrt(factor)
    assert jaeger_strength(angle, 5e6, ROCK, PLANE) == (pytest.approx(expected), False)


def test_share_within_sees_what_is_no_slip():
    """Slip along the plane has none; opening, and shear within the plane, are all of it."""
    normal = normal_of({"planes": {"dip": 60.0, "dip_direction": 90.0}})
    np.testing.assert_allclose(normal, [math.sqrt(0.75), 0.0, 0.5], atol=1e-15)
    along, other = np.array([0.5, 0.0, -math.sqrt(0.75)]), np.array([0.0, 1.0, 0.0])
    slip = np.outer(along, normal) + np.outer(normal, along)
    opening, within = np.outer(normal, normal), np.outer(along, other) + np.outer(other, along)
    np.testing.assert_allclose(share_within(np.array([slip, opening, within]), normal), [0.0, 1.0, 1.0], atol=1e-12)


def test_specimens_are_as_strong_as_jaeger_says(tmp_path):
    """Three of the study, one that drops: the same bounds."""
    results = run_study("jaeger", tmp_path, ["dip_20", "dip_45", "brittle_60"])
    rows, figure = jaeger.answer(results)
    assert figure.axes
    assert len(rows) == 5
    assert all(row.passed for row in rows), [row for row in rows if not row.passed]


def test_events_of_a_fault_slip_along_its_planes(tmp_path):
    """The study on cells of 2 m: its bounds, and a fault of the other dip would not do."""
    results = run_study("fault", tmp_path, ["mean"], **{"grid.levels": 3})
    rows, figure = fault.answer(results)
    assert figure.axes
    assert all(row.passed is not False for row in rows), [row for row in rows if row.passed is False]
    variant = results["mean"]
    tensors = np.concatenate([variant.events(step)["potency_tensor"].values for step in variant.step_names])
    turned = normal_of({"planes": {"dip": 60.0, "dip_direction": 270.0}})
    assert share_within(tensors, turned).min() > 0.1
