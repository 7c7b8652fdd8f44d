"""Synthetic mining steps: what the mechanics would hand over, with known contents."""

import numpy as np
import pytest

from verification.answers.clustering.known_truth import synthetic_step


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
    settings = {"mine": "testmine", "closeness": 0.8, "seismic_fraction": 1.0, "least_particles": 3}
    settings |= {"method": "families", "cluster": cluster}
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
