"""Radius, stress drop, energy and energy index against closed forms, scaling relations and units."""

import numpy as np
import pytest
import xarray as xr

from catalogs.sources.source_parameters import (
    FIELDS,
    crack_radius,
    drop_energies,
    fit_energy,
    parameters,
    stress_drop,
    table_columns,
)
from common.event_table import new_catalog
from seismic.events import _locate

LAME = SHEAR = 30e9  # Poisson's ratio 1/4


def crack_source(radius: float, dimension: int, spacing: float):
    """Particles of a plane crack with Eshelby's slip, and their source size as events have it."""
    along = np.arange(-radius, radius + spacing, spacing)
    place = np.stack(np.meshgrid(*[along] * (dimension - 1), indexing="ij"), -1).reshape(-1, dimension - 1)
    inside = (place**2).sum(axis=1) < radius**2
    place = np.column_stack([place[inside], np.zeros((inside.sum(), 4 - dimension))])
    slip = np.sqrt(radius**2 - (place**2).sum(axis=1))
    found = _locate(place, np.full(len(place), spacing), slip, np.zeros(len(place), int), 1, dimension)
    return slip, found["source_size"]


@pytest.mark.parametrize("dimension", [2, 3])
def test_the_radius_of_a_crack_comes_back(dimension):
    """From particles that slip as Eshelby's crack does; 1 %: fifty particles along the radius."""
    _, size = crack_source(50.0, dimension, 1.0)
    assert crack_radius(size, dimension)[0] == pytest.approx(50.0, rel=0.01)


def test_the_stress_drop_is_eshelbys():
    """7/16 M0 / a^3 for Poisson's ratio 1/4; the potency of slip 24 / (7 pi) stress / mu sqrt(a^2 - x^2) is its own."""
    radius, drop = 50.0, 3e6
    assert stress_drop(2.0, 5.0, LAME, SHEAR) == pytest.approx(7 / 16 * SHEAR * 2.0 / 125.0)
    slip, _ = crack_source(radius, 3, 0.5)
    potency = 24 / (7 * np.pi) * drop / SHEAR * slip.sum() * 0.5**2
    assert stress_drop(potency, radius, LAME, SHEAR) == pytest.approx(drop, rel=0.01)
    nu = 0.1
    other = 2 * SHEAR * nu / (1 - 2 * nu)
    potency = 16 * (1 - nu) / (3 * (2 - nu)) * drop / SHEAR * radius**3
    assert stress_drop(potency, radius, other, SHEAR) == pytest.approx(drop)


def test_the_stress_drop_of_a_strip_is_starrs():
    """Slip 2 (1 - n) stress / mu sqrt(a^2 - x^2) over a strip of half-width a, times its thickness."""
    radius, drop, thickness, nu = 50.0, 3e6, 7.0, 0.25
    slip, _ = crack_source(radius, 2, 0.1)
    potency = 2 * (1 - nu) * drop / SHEAR * slip.sum() * 0.1 * thickness
    assert stress_drop(potency, radius, LAME, SHEAR, thickness) == pytest.approx(drop, rel=0.01)


def test_scaling():
    """Twice as large in all lengths: the same stress drop with eight times the potency; the energy grows as volume."""
    assert stress_drop(8.0, 2.0, LAME, SHEAR) == pytest.approx(float(stress_drop(1.0, 1.0, LAME, SHEAR)))
    strain = np.array([[1e-3, 0, -1e-3, 0, 2e-3, 0]])
    one, two = (drop_energies(strain, np.array([v]), np.array([LAME]), np.array([SHEAR])) for v in (1.0, 8.0))
    assert two == pytest.approx(8.0 * one)


def test_the_energy_of_a_shear_drop_is_half_stress_drop_times_potency():
    """Shear g: stress mu g, potency g V, apparent stress mu g / 2; of pure opening e: (lambda / 2 + mu) e^2 V."""
    shear, volume = 2e-3, 5.0
    energy = drop_energies(
        np.array([[0, 0, 0, 0, 0, shear / 2]]), np.array([volume]), np.array([LAME]), np.array([SHEAR])
    )
    assert energy == pytest.approx(0.5 * SHEAR * shear * shear * volume)
    assert energy / (shear * volume) == pytest.approx(0.5 * SHEAR * shear)
    opening = drop_energies(np.array([[1e-3, 0, 0, 0, 0, 0]]), np.array([1.0]), np.array([LAME]), np.array([SHEAR]))
    assert opening == pytest.approx((0.5 * LAME + SHEAR) * 1e-6)


def test_energy_does_not_depend_on_the_axes():
    """A turned tensor has the same energy."""
    from scipy.spatial.transform import Rotation

    from common.voigt import tensor_from_voigt, voigt_from_tensor

    strain = np.random.default_rng(1).normal(0, 1e-3, (9, 6))
    turn = Rotation.from_euler("xyz", [0.3, 1.1, -0.7]).as_matrix()
    turned = voigt_from_tensor(turn @ tensor_from_voigt(strain) @ turn.T)
    many = np.ones(9)
    energies = [drop_energies(one, many, LAME * many, SHEAR * many) for one in (strain, turned)]
    np.testing.assert_allclose(*energies, rtol=1e-12)


def test_the_energy_index_is_relative_to_the_catalogue():
    """A known law comes back; an event of ten times the energy has index ten; a factor on all energies changes none."""
    generator = np.random.default_rng(2)
    moment = 10.0 ** generator.uniform(8, 12, 4000)
    energy = 10.0 ** (1.4 * np.log10(moment) - 11.0 + generator.normal(0, 0.3, 4000))
    counted = np.ones(4000, bool)
    fit = fit_energy(energy, moment, counted)
    assert fit.slope == pytest.approx(1.4, abs=0.02)
    assert fit.scatter == pytest.approx(0.3, rel=0.05)
    index = fit.index(energy, moment)
    assert np.log10(index).mean() == pytest.approx(0.0, abs=1e-9)
    assert fit.index(10 * energy[0], moment[0]) == pytest.approx(10 * index[0])
    np.testing.assert_allclose(fit_energy(7 * energy, moment, counted).index(7 * energy, moment), index)
    other = counted.copy()
    other[:2000] = False
    assert fit_energy(energy, moment, other).count == 2000
    assert np.isnan(fit_energy(energy[:5], moment[:5], counted[:5]).slope)


def catalogue(count: int) -> xr.Dataset:
    generator = np.random.default_rng(3)
    potency = 10.0 ** generator.uniform(-3, 1, count)
    attributes = {"mine": "m", "kind": "synthetic", "lame_lambda": LAME, "shear_modulus": SHEAR}
    size = generator.uniform(2, 30, count)
    return new_catalog(count, attributes, potency=potency, moment=SHEAR * potency, source_size=size)


@pytest.mark.parametrize("count", [0, 1, 40])
def test_parameters_of_a_catalogue(count):
    catalog = catalogue(count)
    energy = 1e6 * catalog["potency"].values
    found = parameters(catalog, energy, 3, None)
    assert set(found.data_vars) == {field.name for field in FIELDS}
    np.testing.assert_allclose(found["apparent_stress"], 1e6)
    assert found["drop_energy"].attrs["units"] == "J"
    assert np.isnan(found["energy_index"].values).all() == (count < 10)
    columns = table_columns(found)
    assert list(columns) == ["source_radius_m", "static_stress_drop_pa", "drop_energy_j", "apparent_stress_pa",
                             "energy_index"]  # fmt: skip
    assert all(len(column) == count for column in columns.values())


def test_what_is_not_known_stays_unknown():
    """A record without extents and energies: empty cells, no error."""
    catalog = catalogue(12)
    catalog["source_size"].values[:] = np.nan
    found = parameters(catalog, np.full(12, np.nan), 3, None)
    assert all(np.isnan(found[field.name].values).all() for field in FIELDS)
    assert table_columns(found)["drop_energy_j"] == [""] * 12
