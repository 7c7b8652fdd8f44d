"""Consistent tangent of the return, against differences of two returns of whole tensors."""

import numpy as np
import pytest

from mpm_core.constitutive.coulomb_strength import strength_row
from mpm_core.constitutive.general import tangent_by_differences
from mpm_core.constitutive.laws.coulomb import return_to_surface, stiffness_reduction

LAME, SHEAR = 20e9, 25e9


def fallen(stress, strain, row):
    """Trial stress less returned stress after an elastic change by strain (engineering shear)."""
    trial = stress + LAME * strain[:3].sum() * np.array([1, 1, 1, 0, 0, 0]) + SHEAR * strain * [2, 2, 2, 1, 1, 1]
    return trial - np.array(return_to_surface(*trial, LAME, SHEAR, row)[:6])


@pytest.mark.parametrize(
    "strength",
    [
        (30.0, 10.0, 5e6, None),
        (30.0, 30.0, 2e6, 1e6),
        (20.0, 0.0, 0.0, 0),
        (0.0, 0.0, 1e6, None),
        (40.0, 9.0, 1e6, 0),
    ],
)
def test_tangent_is_the_slope_of_the_return(strength):
    """Random stress that yields: faces, edges, apex, cut-off. 1e-7 of G: differences over 2e-7 of the stress."""
    row, random = tuple(strength_row(*strength)), np.random.default_rng(0)
    matrix, yielding = np.zeros((6, 6)), 0
    for _ in range(600):
        stress = random.normal(size=6) * 10.0 ** random.uniform(5, 8)
        stress[:3] += 10.0 ** random.uniform(5, 8) * random.choice([-1.0, 1.0], p=[0.8, 0.2])
        strain = random.normal(size=6)
        strain *= 1e-7 * np.abs(stress).max() / SHEAR / np.linalg.norm(strain)
        if stiffness_reduction(*stress, LAME, SHEAR, row, matrix):
            yielding += 1
            slope = (fallen(stress, strain, row) - fallen(stress, -strain, row)) / 2.0
            assert np.abs(slope - matrix @ strain).max() < 1e-7 * SHEAR * np.linalg.norm(strain)
        else:
            assert not fallen(stress, 0.0 * strain, row).any()
    assert yielding > 200


def test_differences_of_the_return_are_its_tangent():
    """What a law without a tangent of its own takes: within 1e-4 of G, as its step is 1e-6 of the stress."""
    by_differences, random = tangent_by_differences(return_to_surface), np.random.default_rng(1)
    row, one, other, yielding = tuple(strength_row(30.0, 10.0, 5e6, 1e6)), np.zeros((6, 6)), np.zeros((6, 6)), 0
    for _ in range(300):
        stress = random.normal(size=6) * 1e7 - np.array([2e7, 2e7, 2e7, 0, 0, 0])
        yields = stiffness_reduction(*stress, LAME, SHEAR, row, one)
        assert by_differences(*stress, LAME, SHEAR, row, other) == yields
        if yields:
            yielding += 1
            assert np.abs(one - other).max() < 1e-4 * SHEAR
    assert 100 < yielding < 300


def test_associated_flow_has_a_symmetric_tangent():
    """Dilation equal to friction; else it is not."""
    stress, sizes = np.array([-2e6, -60e6, -25e6, 3e6, -2e6, 8e6]), []
    for dilation in (30.0, 10.0):
        matrix = np.zeros((6, 6))
        assert stiffness_reduction(*stress, LAME, SHEAR, tuple(strength_row(30.0, dilation, 1e6)), matrix)
        sizes.append(np.abs(matrix - matrix.T).max() / np.abs(matrix).max())
    assert sizes[0] < 1e-8 < 1e-2 < sizes[1]
