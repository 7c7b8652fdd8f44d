"""Synthetic mining steps: what the mechanics would hand over, with known contents."""

import numpy as np
import pytest
import xarray as xr

LAME_LAMBDA, SHEAR_MODULUS = 22.8e9, 22.8e9  # Pa: 57 GPa, Poisson 0.25


def synthetic_step(
    position,
    seismic_strain,
    *,
    spacing=1.25,
    volume=None,
    failure_order=None,
    failed=True,
    overshoot_strain=0.0,
    later_strain=0.0,
    step="2019-08",
    step_index=2,
    start="2019-08-01",
    end="2019-09-01",
    dated=1,
    mine="testmine",
):
    """A step dataset of particles at position (particle, 3) m with seismic_strain (particle, 6)."""
    position = np.asarray(position, dtype=float).reshape(-1, 3)
    count = len(position)
    spacing = np.broadcast_to(np.asarray(spacing, dtype=float), count)
    volume = spacing**3 if volume is None else np.broadcast_to(np.asarray(volume, dtype=float), count)
    order = np.zeros((count, 2)) if failure_order is None else np.asarray(failure_order).reshape(-1, 2)
    strains = [
        np.broadcast_to(np.asarray(strain, dtype=float), (count, 6))
        for strain in (seismic_strain, overshoot_strain, later_strain)
    ]
    voigt = ("particle", "voigt")
    return xr.Dataset(
        {
            "position": (("particle", "xyz"), position),
            "spacing": ("particle", spacing),
            "volume": ("particle", volume),
            "failed": ("particle", np.where(np.broadcast_to(failed, count), step_index, -1).astype(np.int32)),
            "failure_order": (("particle", "order"), order.astype(np.int32)),
            "seismic_strain": (voigt, strains[0]),
            "overshoot_strain": (voigt, strains[1]),
            "later_strain": (voigt, strains[2]),
            "plastic_strain_step": (voigt, strains[0] + strains[1] + strains[2]),
        },
        attrs={
            "mine": mine,
            "stage": "step",
            "step": step,
            "step_index": step_index,
            "start": start,
            "end": end,
            "dated": dated,
            "lame_lambda": LAME_LAMBDA,
            "shear_modulus": SHEAR_MODULUS,
            "truncated": 0,
            "truncated_share": 0.0,
            "truncated_where": "",
        },
    )


def scattered_step(seed=0, count=400, **attributes):
    """A step of failed, intact and flowing particles on a lattice, with negative strain components and mixed orders."""
    rng = np.random.default_rng(seed)
    lattice = np.stack(np.meshgrid(*[np.arange(12)] * 3, indexing="ij"), -1).reshape(-1, 3)
    position = 1.25 * lattice[rng.choice(len(lattice), count, replace=False)] + [1e5, 2e5, -300.0]
    failed = rng.random(count) < 0.7
    mechanism = rng.normal(size=(5, 6))[rng.integers(0, 5, count)] + 0.2 * rng.normal(size=(count, 6))
    size = 10 ** rng.normal(-3.5, 0.4, (count, 1))
    return synthetic_step(
        position,
        np.where(failed[:, None], mechanism * size, 0.0),
        volume=1.25**3 * rng.uniform(0.1, 1.0, count),
        failed=failed,
        failure_order=rng.integers(0, 4, (count, 2)),
        overshoot_strain=rng.normal(size=(count, 6)) * 1e-5 * failed[:, None],
        later_strain=rng.normal(size=(count, 6)) * 1e-4,
        **attributes,
    )


def event_settings(**changes):
    """Settings of the event stage, with some of them changed."""
    cluster = {"method": "dbscan", "radius_cells": 1.8, "min_samples": 3}
    settings = {"mine": "testmine", "closeness": 0.8, "cluster": cluster, "seismic_fraction": 1.0}
    return settings | {"frame": {"latitude": -41.8, "longitude": 145.4, "surface": 2000.0}} | changes


@pytest.fixture(scope="session")
def make_step():
    """Factory of a step dataset from particles."""
    return synthetic_step


@pytest.fixture(scope="session")
def make_scattered_step():
    """Factory of a step dataset with hundreds of failed particles."""
    return scattered_step


@pytest.fixture(scope="session")
def make_settings():
    """Factory of the event stage's settings."""
    return event_settings
