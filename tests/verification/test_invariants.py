"""The closed forms of the invariants against finite differences and limits, and the study on its coarser grids."""

import numpy as np
import pytest
from running import run_study

from verification.answers.invariants import answer
from verification.answers.invariants.closed_form import Column, Elastic, Smooth

ROCK, FILL = Elastic(57e9, 0.25), Elastic(1e9, 0.3)


@pytest.mark.parametrize("dimension", [2, 3])
def test_the_smooth_field_is_in_equilibrium_with_its_force(dimension):
    """div sigma + b = 0 by central differences of the stress, and the gradient by those of the displacement."""
    random = np.random.default_rng(5)
    field = Smooth(random.normal(size=(dimension, dimension)), random.normal(size=dimension))
    x, step = random.uniform(-2, 2, (20, dimension)), 1e-5
    divergence = np.zeros_like(x)
    for k in range(dimension):
        shift = step * np.eye(dimension)[k]
        ahead, behind = (ROCK.stress(field.gradient(x + sign * shift)) for sign in (1, -1))
        divergence += (ahead - behind)[:, :dimension, k] / (2 * step)
        slope = (field.displacement(x + shift) - field.displacement(x - shift)) / (2 * step)
        np.testing.assert_allclose(field.gradient(x)[:, :, k], slope, atol=1e-8)
    force = field.body_force(x, ROCK)
    np.testing.assert_allclose(divergence, -force, rtol=0, atol=1e-8 * np.abs(force).max())


def test_plane_strain_has_a_stress_across_the_plane():
    """nu (sxx + syy), and Hooke's law in the plane as in space with no strain across."""
    gradient = np.array([[1e-4, 3e-4], [-1e-4, -2e-4]])
    flat = FILL.stress(gradient)
    full = np.zeros((3, 3))
    full[:2, :2] = gradient
    np.testing.assert_allclose(flat, FILL.stress(full))
    assert flat[2, 2] == pytest.approx(0.3 * (flat[0, 0] + flat[1, 1]))
    assert flat[0, 1] == pytest.approx(1e9 / 1.3 * 1e-4)


def test_the_column_is_in_equilibrium_and_continuous():
    """M u'' = fill weight in the fill, u linear in the rock, stress of M u' from the joint on, no stress on top."""
    column = Column(ROCK, FILL, rock_weight=28e3, fill_weight=17e3, joint=16.0, top=24.0)
    step = 1e-3
    z = np.linspace(16.1, 23.9, 9)
    u = column.displacement
    second = (u(z + step) - 2 * u(z) + u(z - step)) / step**2
    np.testing.assert_allclose(FILL.confined_modulus * second, 17e3, rtol=1e-3)
    slope = (u(z + step) - u(z - step)) / (2 * step)
    np.testing.assert_allclose(FILL.confined_modulus * slope, column.fill_stress(z), rtol=1e-9)
    assert column.fill_stress(np.array([24.0])) == 0.0
    below = np.array([4.0, 8.0, 16.0])
    np.testing.assert_allclose(u(below) * ROCK.confined_modulus, (28e3 - 17e3) * 8.0 * below)
    assert u(np.array([16.0 + 1e-9]))[0] == pytest.approx(u(np.array([16.0]))[0])
    # fill as heavy as the rock was: the rock below does not notice, the fill settles by weight h^2 / 2 M
    same = Column(ROCK, FILL, 17e3, 17e3, 16.0, 24.0)
    assert same.displacement(np.array([16.0]))[0] == 0.0
    assert same.displacement(np.array([24.0]))[0] == pytest.approx(-17e3 * 64 / 2 / FILL.confined_modulus)


FULL_SIZE = {"section_8", "block_4", "block_8"}


def test_all_invariants_hold_and_the_smooth_field_converges(tmp_path):
    """Every variant but the largest grids of the two series."""
    whole = run_study("invariants", tmp_path)
    results = run_study("invariants", tmp_path, [name for name in whole.variants if name not in FULL_SIZE])
    rows, figure = answer(results)
    assert [row.quantity for row in rows if row.passed is False] == []
    kinds = ("virgin", "patch", "unloading", "column", "space", "section", "block")
    for kind in kinds:
        assert any(row.quantity.startswith(kind) for row in rows), kind
    assert len(figure.axes) == 3
    flights = [row for row in rows if "momentum" in row.quantity]
    assert all(int(row.remark.split()[0]) > 100 for row in flights)  # cells did change
    for row in rows:
        if "hang" in row.remark:
            assert int(row.remark.split()[0]) > 0


def test_a_hanging_node_let_loose_fails_the_patch_test(tmp_path):
    """One of them without parents: the coarse cell beside it no longer holds its other half."""
    results = run_study("invariants", tmp_path, ["patch_section"])
    grid = results["patch_section"].grid
    hanging = np.flatnonzero(grid["node_parents"].values[:, 0] >= 0)
    grid["node_parents"].values[hanging[0]] = -1
    rows, _ = answer(results)
    assert any(row.passed is False for row in rows)
