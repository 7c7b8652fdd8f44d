"""The array kernels do what the scalar ones do, to the bit, on one thread and on two."""

import numba
import numpy as np
import pytest

from mpm_core.constitutive.coulomb_strength import strength_row
from mpm_core.constitutive.elastic import strain_from_stress
from mpm_core.constitutive.general import make_return_particles
from mpm_core.constitutive.laws import coulomb
from mpm_core.constitutive.laws.coulomb import return_to_surface
from mpm_core.settings import lame_parameters

ROWS = np.array([strength_row(30, 10, 2e6, 1e6), strength_row(20, 10, 1e6, 0.0), strength_row(0, 0, 5e6)])


def particles(count):
    """Stresses (Pa) of which most yield, moduli and strength rows of a mixed rock mass."""
    random = np.random.default_rng(11)
    stress = random.normal(size=(count, 6)) * 5e6 - np.array([10e6, 10e6, 10e6, 0, 0, 0])
    constants = np.array([lame_parameters(young, 0.25) for young in (57e9, 1e9)])[random.integers(0, 2, count)]
    return stress, constants[:, 0].copy(), constants[:, 1].copy(), random.integers(0, len(ROWS), count)


def test_array_kernels_repeat_the_scalar_kernels():
    stress, lame_lambda, shear_modulus, indices = particles(300)
    returned, plastic, regions = stress.copy(), np.ones((300, 6)), np.full(300, 9, np.int8)
    make_return_particles(coulomb)(returned, lame_lambda, shear_modulus, ROWS, indices, plastic, regions)
    assert 0 < np.count_nonzero(regions) < 300
    for p in range(300):
        constants, row = (lame_lambda[p], shear_modulus[p]), ROWS[indices[p]]
        *expected, region = return_to_surface(*stress[p], *constants, row)
        np.testing.assert_array_equal(returned[p], expected)
        assert regions[p] == region
        np.testing.assert_array_equal(
            plastic[p], 1.0 + np.array(strain_from_stress(*constants, *(stress[p] - expected)))
        )


@pytest.mark.skipif(numba.config.NUMBA_NUM_THREADS < 2, reason="needs two threads")
def test_one_and_two_threads_give_the_same_bits():
    outcomes = []
    for threads in (1, 2):
        numba.set_num_threads(threads)
        stress, lame_lambda, shear_modulus, indices = particles(20_001)
        plastic, regions = np.zeros_like(stress), np.zeros(len(stress), np.int8)
        make_return_particles(coulomb)(stress, lame_lambda, shear_modulus, ROWS, indices, plastic, regions)
        outcomes.append(stress.tobytes() + plastic.tobytes() + regions.tobytes())
    assert outcomes[0] == outcomes[1]
