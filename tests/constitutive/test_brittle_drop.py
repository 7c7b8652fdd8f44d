"""The brittle drop of Table 2 rock (E 57 GPa, nu 0.25, phi 30 / 20, psi 10, c 2 / 1 MPa) by hand and as a property."""

import numpy as np
import pytest
from hypothesis import assume, given, settings

from common.source_tensors import shear_iso_share, source_shares
from mpm_core.constitutive import general
from mpm_core.constitutive.coulomb_return import EDGE, ELASTIC, TENSION
from mpm_core.constitutive.coulomb_strength import residual_outside_intact, strength_row
from mpm_core.constitutive.elastic import stress_increment
from mpm_core.constitutive.laws.coulomb import return_to_surface
from mpm_core.settings import lame_parameters

from . import law_twins
from .law_twins import strength_rows, stresses

ROCK = lame_parameters(57e9, 0.25)  # lambda = G = 22.8 GPa
INTACT = strength_row(30, 10, 2e6)
RESIDUAL = strength_row(20, 10, 1e6)


def brittle_drop(*arguments):
    """Of Coulomb rock."""
    return general.brittle_drop(return_to_surface, *arguments, 1.0)


def test_uniaxial_drop_by_hand():
    """A pillar loaded to its 6.928203 MPa and 0.5 MPa beyond, sideways free.

    Both drops run along the edge s1 = s2 with strain L (m/2, m/2, -1), m = N_psi = 1.420277, and
    L = excess / (lambda (N - 1)(m - 1) + G (N m + 2)). Peak: N = 3, L = 0.5e6 / 22.8e9 / 7.101383 = 3.088106e-6, so
    s1 = -L (lambda (m - 1) + G m) = -0.129591 MPa and s3 = 3 s1 - 6.928203 = -7.316977 MPa. Residual: N = 2.039607,
    sigma_c = 2.856296 MPa; the excess is N s1 - s3 - sigma_c = 4.196366 MPa; L = 4.196366e6 / 22.8e9 / 5.333728.
    """
    peak, residual, overshoot, seismic, region = brittle_drop(
        0.0, 0.0, -7.42820323e6, 0.0, 0.0, 0.0, *ROCK, INTACT, RESIDUAL
    )
    half = 0.5 * 1.420276625
    assert region == EDGE
    np.testing.assert_allclose(overshoot, 3.088106e-6 * np.array([half, half, -1, 0, 0, 0]), rtol=1e-6, atol=1e-15)
    np.testing.assert_allclose(peak, [-0.129591e6, -0.129591e6, -7.316977e6, 0, 0, 0], rtol=3e-6, atol=1e-3)
    np.testing.assert_allclose(seismic, 3.450703e-5 * np.array([half, half, -1, 0, 0, 0]), rtol=1e-6, atol=1e-15)
    assert 2.0396067 * residual[0] - residual[2] == pytest.approx(2.856296e6, rel=1e-6)


@pytest.mark.parametrize("confinement", [1e6, 5e6, 20e6])
def test_triaxial_drop_does_not_depend_on_the_overshoot_much(confinement):
    """The seismic part of a step twice as far beyond strength changes by what the peak point moves, not by the step.

    From just beyond strength to 10 % beyond: seismic strain grows by less than 10 %, overshoot a thousandfold.
    """
    strength = 3.0 * confinement + INTACT[2]
    drops = [
        brittle_drop(-confinement, -confinement, -strength * beyond, 0, 0, 0, *ROCK, INTACT, RESIDUAL)
        for beyond in (1.0001, 1.1)
    ]
    (_, _, small, seismic_small, _), (_, _, large, seismic_large, _) = drops
    assert large[2] / small[2] == pytest.approx(1000.0, rel=1e-6)
    assert 1.0 < seismic_large[2] / seismic_small[2] < 1.1


def test_tensile_drop_by_hand():
    """Cut-offs 1 and 0 MPa, tension of 1.3 MPa: overshoot opens by 0.3 MPa / (lambda + 2G), seismic by 1 MPa / same."""
    peak, residual, overshoot, seismic, region = brittle_drop(
        1.3e6, 0, 0, 0, 0, 0, *ROCK, strength_row(30, 10, 2e6, 1e6), strength_row(20, 10, 1e6, 0.0)
    )
    assert region == TENSION
    np.testing.assert_allclose(peak, [1e6, -0.1e6, -0.1e6, 0, 0, 0], rtol=1e-12, atol=1e-3)
    np.testing.assert_allclose(overshoot, [0.3e6 / 68.4e9, 0, 0, 0, 0, 0], rtol=1e-11, atol=1e-17)
    np.testing.assert_allclose(seismic, [1e6 / 68.4e9, 0, 0, 0, 0, 0], rtol=1e-11, atol=1e-17)
    np.testing.assert_allclose(residual, [0, -1.3e6 / 3, -1.3e6 / 3, 0, 0, 0], rtol=1e-12, atol=1e-3)


def test_stress_below_intact_strength_drops_nothing_though_above_residual():
    stress = (-1e6, -1e6, -8e6, 0.0, 0.0, 0.0)
    assert law_twins.overstress(stress, RESIDUAL) > 0.0
    nothing = (0.0,) * 6
    assert brittle_drop(*stress, *ROCK, INTACT, RESIDUAL) == (stress, stress, nothing, nothing, ELASTIC)


@given(stress=stresses(), intact=strength_rows(), residual=strength_rows())
@settings(max_examples=300, deadline=None)
def test_strains_account_for_the_whole_stress_drop(stress, intact, residual):
    """trial - D : (overshoot + seismic) = residual stress; peak is admissible to intact rock, the last to both."""
    assume(not residual_outside_intact(intact, residual))
    peak, last, overshoot, seismic, _ = brittle_drop(*stress, *ROCK, intact, residual)
    drop = stress_increment(*ROCK, *(np.array(overshoot) + np.array(seismic)))
    np.testing.assert_allclose(stress - drop, last, rtol=0, atol=1e-13 * np.abs(stress).max())
    for outcome, row in ((peak, intact), (last, intact)):
        assert law_twins.overstress(outcome, row) <= 1e-11 * (row[0] + 1.0) * max(np.abs(outcome).max(), 1e-300)


@pytest.mark.parametrize("dilation", [0.0, 5.0, 10.0, 20.0])
def test_isotropic_share_of_a_drop_in_shear_is_that_of_the_dilation_angle(dilation):
    """6,000 states of stress above strength, none of which tears: all within the closed form's bounds, and both
    reached; the residual angle decides. What tears opens: a third and more of its share is isotropic."""
    generator = np.random.default_rng(1)
    intact, residual = strength_row(30, 2.0, 8e6), strength_row(20, dilation, 2e6)
    torn = strength_row(20, dilation, 2e6, 0.0)
    shares, tears = [], []
    for row, found in ((residual, shares), (torn, tears)):
        for _ in range(3000):
            s3 = -generator.uniform(40e6, 120e6)
            s1 = -generator.uniform(0.0, 5e6)
            s2 = generator.choice([s1, s3, generator.uniform(s3, s1)])
            _, after, _, seismic, region = brittle_drop(s1, s2, s3, 0.0, 0.0, 0.0, *ROCK, intact, row)
            if region == ELASTIC or not np.any(seismic):
                continue
            if row is torn and max(after) < -1e-3 * abs(min(after)):
                continue
            found.append(source_shares(np.diag(seismic[:3]))[0])
    low, high = shear_iso_share(dilation)
    assert len(shares) > 2000
    assert min(shares) == pytest.approx(low, rel=1e-6, abs=1e-12)
    assert max(shares) == pytest.approx(high, rel=0.02, abs=1e-12)
    assert max(shares) <= high * (1.0 + 1e-9) + 1e-12
    assert len(tears) > 100
    assert max(tears) > high
