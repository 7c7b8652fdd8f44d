"""The clustering study reduced to seconds, and what its measures must say of cases known by hand."""

import copy
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as some
from matplotlib.figure import Figure
from running import run_study

from common.voigt import tensor_from_voigt
from seismic.families import closeness
from verification.answers import clustering
from verification.answers.clustering.family_recovery import certainly_recovered, least_angle, recover
from verification.answers.clustering.known_truth import (
    NOISE,
    balls,
    elongation,
    elongations,
    index_of_clusters,
    make_points,
    share_of_noise_taken,
    turned,
)


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    return run_study("clustering", tmp_path_factory.mktemp("clustering")).study


@pytest.fixture
def reduced(study):
    """Two draws, few particles and two sizes; the sets as they are."""
    chosen = copy.deepcopy(study.settings)
    chosen |= {"draws": 2}
    chosen["timing"] |= {"counts": [300, 1000], "kmeans_most_products": 1000}
    chosen["cracks"] |= {"dips": [0, 30, 45], "turned": [0, 17], "radius": 6}
    chosen["families"] |= {"particles": 150, "repeats": 2, "scatter": [0, 9, 40], "closeness": [0.7, 0.8, 0.95]}
    return chosen


def test_every_bound_of_the_reduced_study_holds(study, reduced, tmp_path):
    results = run_study("clustering", tmp_path)
    results.study = replace(study, settings=reduced)
    rows, figure = clustering.answer(results)
    assert isinstance(figure, Figure)
    assert [row.quantity for row in rows if row.passed is False] == []
    assert sum(row.passed is True for row in rows) == 49
    found = {row.quantity: row for row in rows}
    assert len(found) == len(rows)
    # the paper's reasons for DBSCAN (3.2): k-means cuts what is long, single linkage joins what a chain touches
    assert found["elongated, k-means: adjusted Rand index"].obtained < 0.5
    assert found["chain, single linkage: adjusted Rand index"].obtained == 0.0
    assert found["chain, DBSCAN 3: adjusted Rand index"].obtained == 0.0  # a default that does not do it
    # with links of one cell a crack that dips is cut at each step between its level stretches
    short = found["regions linked within 1 cell: events of one crack, one cell thick, most of 12 ways to lie"]
    assert short.obtained > 5.0
    assert "too slow" in found["time, k-means, 1,000 particles, s"].remark


@pytest.mark.parametrize(("samples", "same"), [(3, True), (4, False)])
def test_from_four_samples_on_dbscan_and_single_linkage_differ(study, reduced, samples, same):
    """The row that says they are one with min_samples 3 can fail."""
    reduced["sets"] = {"chain": reduced["sets"]["chain"]}
    other = copy.deepcopy(reduced)
    other["methods"]["DBSCAN 3"]["min_samples"] = samples
    row = clustering.separation_rows(clustering.separate(other), reduced, study.allowed)[-1]
    assert row.passed is same


def test_elongation_of_a_rod_a_sheet_and_an_ellipsoid():
    """n cubes in a row: variance n^2 / 12 of cubes against 1 / 12, so n. An ellipsoid: its axes' ratio, here 4."""
    rod = np.indices((7, 1, 1)).reshape(3, -1).T * 2.5
    assert elongation(rod, np.full(7, 2.5)) == pytest.approx(7.0)
    sheet = np.indices((9, 1, 4)).reshape(3, -1).T.astype(float)
    assert elongation(sheet, np.ones(36)) == pytest.approx(9.0)
    whole = make_points({"bodies": [{"centre": [0, 0, 0], "semi_axes": [32, 8, 16]}]}, 1.0, [0, 0, 0], None)
    assert elongation(whole.position, whole.spacing) == pytest.approx(4.0, rel=0.02)


def test_a_coarse_particle_weighs_as_the_fine_ones_in_its_place():
    fine = np.indices((4, 2, 2)).reshape(3, -1).T.astype(float)
    both = np.concatenate([fine[fine[:, 0] < 2], [[2.5, 0.5, 0.5]]])
    assert elongation(both, np.array([1.0] * 8 + [2.0])) == pytest.approx(2.0)


def test_two_clusters_taken_as_one_have_no_index_and_are_longer():
    points = balls(500, [4, 4, 4], 14, 1.25)
    assert points.clusters == 2
    assert index_of_clusters(points, 1 - points.truth) == 1.0
    assert index_of_clusters(points, np.zeros(len(points.truth), int)) == 0.0
    true, found = elongations(points, np.zeros(len(points.truth), int))
    assert np.all(true == pytest.approx(1.0))
    assert np.all(found > 3.0)


def test_scattered_particles_lie_outside_the_bodies_and_are_counted():
    shape = {
        "bodies": [{"centre": [0.5, 0.5, 0.5], "semi_axes": [4, 4, 4], "cell": 2, "share": 0.5}],
        "noise": [{"lower": [-6, -6, -6], "cells": [12, 12, 12], "share": 1.0}],
    }
    points = make_points(shape, 1.0, [100.0, 0.0, 0.0], np.random.default_rng(0))
    body, noise = points.position[points.truth == 0], points.position[points.truth == NOISE]
    apart = np.max(np.abs(noise[:, None] - body[None]), axis=2)
    assert apart.min() >= 1.5  # half a coarse cell and half a fine one
    whole = make_points({"bodies": [shape["bodies"][0] | {"share": 1.0}]}, 1.0, [0, 0, 0], None)
    assert len(noise) == 12**3 - 8 * len(whole.truth)
    alone = np.arange(len(points.truth))
    assert share_of_noise_taken(points, alone) == 0.0
    assert share_of_noise_taken(points, np.zeros_like(alone)) == 1.0


@given(some.floats(0.0, 90.0), some.integers(0, 1000))
@settings(max_examples=50, deadline=None)
def test_a_turn_moves_a_mechanism_by_at_most_twice_its_angle(largest, seed):
    """The bound that makes recovery certain, for any traceless tensor."""
    generator = np.random.default_rng(seed)
    tensor = generator.normal(size=(50, 3, 3))
    tensor = tensor + np.swapaxes(tensor, 1, 2)
    tensor -= np.trace(tensor, axis1=1, axis2=2)[:, None, None] / 3.0 * np.eye(3)
    angle = np.degrees(np.arccos(np.clip(closeness(tensor, turned(tensor, largest, generator)), -1.0, 1.0)))
    assert np.all(angle <= 2.0 * largest + 1e-5)


def test_where_recovery_is_certain(study):
    """Mechanisms 90 degrees apart, closeness 0.8 is 36.9 degrees: up to 9.2 degrees; 0.5 is 60: below 7.5 degrees."""
    mechanisms = tensor_from_voigt(np.array(study.settings["families"]["mechanisms"], float))
    assert least_angle(mechanisms) == pytest.approx(90.0)
    assert certainly_recovered(mechanisms, 9.2, 0.8)
    assert not certainly_recovered(mechanisms, 9.3, 0.8)
    assert certainly_recovered(mechanisms, 7.4, 0.5)
    assert not certainly_recovered(mechanisms, 7.6, 0.5)


def test_mechanisms_too_near_for_the_threshold_are_one_family(study):
    """Two double couples 20 degrees apart in direction, closeness 0.9 (25.8 degrees): one family, index 0."""
    chosen = study.settings["families"] | {"scatter": [0], "closeness": [0.9], "particles": 40, "repeats": 1}
    half = np.radians(10.0)  # a turn by 10 about the null axis: 20 in direction
    cosine, sine = np.cos(2 * half), np.sin(2 * half)
    found = recover(chosen | {"mechanisms": [[1, -1, 0, 0, 0, 0], [cosine, -cosine, 0, 0, 0, sine]]}, 1)
    assert found.families.item() == 1
    assert found.index.item() == 0.0
    assert not found.certain.item()
