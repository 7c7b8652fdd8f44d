"""Steps one after another: what must not depend on the way, and what must not change at all."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mechanics.scenes import (
    COULOMB,
    ball,
    box,
    excavation,
    grid_around,
    host_everywhere,
    make_dataset,
    make_model,
    make_scene,
    pieces_of,
    uniform,
)
from mpm_core import stages
from mpm_core.equilibrium.cascade import run_cascade
from mpm_core.particles import FULL, SLIVER, Pieces, exclusive_pieces, seed, volumes
from mpm_core.stages import elastic_stage, mining_step
from pipeline.datasets import read_dataset, write_dataset

SHAPES = [ball([18.0, 20.0], 4.3), ball([25.0, 20.0], 4.6)]
STRESS = uniform(-20e6, -12e6, -10e6, 0.0, 3e6)
TIGHT = {"tolerance": 1e-8}


def chain(tmp_path, plan, steps, *, shapes=SHAPES, **options):
    """States of the elastic stage and of every step; `plan`: (mined, fill, filled) of each shape."""
    grid = None
    states = []
    for last in range(steps):
        entries = [
            excavation(m if m <= last else -1, f if fl <= last else None, fl, name=f"e{i}")
            for i, (m, f, fl) in enumerate(plan)
        ]
        scene = make_scene("xz", stress=STRESS, excavations=entries, steps=last + 1, **options)
        if grid is None:
            grid = make_dataset(scene, grid_around(shapes, [5, 5], 2, 8.0), shapes)
            states.append(elastic_stage(scene, grid, tmp_path / "failed.npz")[0])
        states.append(mining_step(scene, grid, states[-1], tmp_path / "failed.npz")[0])
    return states


@pytest.mark.parametrize("cut_cells", ["fraction", "subdivide"])
@pytest.mark.parametrize("per_edge", [1, 2])
def test_elastic_rock_forgets_the_order_of_mining(cut_cells, per_edge, tmp_path):
    """Two overlapping voids in one step or in two: linear elasticity knows the end only. Tolerance 1e-8 of the force;
    1e-5 of the largest stress change and displacement."""
    options = {"solver": TIGHT, "cut_cells": cut_cells, "particles_per_cell": per_edge}
    once = chain(tmp_path, [(0, None, 0), (0, None, 0)], 1, **options)[-1]
    twice = chain(tmp_path, [(0, None, 0), (1, None, 1)], 2, **options)[-1]
    assert np.array_equal(once.volume, twice.volume)
    np.testing.assert_allclose(twice.stress, once.stress, rtol=0, atol=1e-5 * 20e6)
    moved = np.abs(once.node_displacement.values).max()
    held = np.bincount(once.cell.values, once.volume.values, minlength=once.sizes["cell"])
    assert moved > 0.0
    assert held.min() == 0.0
    solid = once.volume.values > 0.0
    np.testing.assert_allclose(
        twice.displacement.values[solid], once.displacement.values[solid], rtol=0, atol=1e-5 * moved
    )


def test_fill_is_placed_without_stress_in_the_deformed_rock(tmp_path):
    """Mine in step 0, fill in step 1 (weightless field): nothing happens in step 1, the fill has no stress; mining
    beside it in step 2 loads it."""
    states = chain(tmp_path, [(0, "fill", 1), (2, None, 2)], 3, solver=TIGHT)
    mined, filled, loaded = states[1:]
    rock = mined.sizes["particle"]
    fill = (filled.excavation.values == 0) & (filled.volume.values > 0)
    assert fill.any()
    assert not fill[:rock].any()
    assert np.abs(filled.stress.values[fill]).max() < 1.0
    np.testing.assert_allclose(filled.stress.values[:rock], mined.stress.values, rtol=0, atol=1.0)
    assert np.abs(loaded.stress.values[fill]).max() > 1e3


def test_a_step_that_mines_nothing_changes_nothing(tmp_path):
    """Elastic rock, nothing new: no iteration, the same displacement to the bit, the same stress to its round-off."""
    _, first, second = chain(tmp_path, [(0, None, 0)], 2, shapes=SHAPES[:1])
    assert second.attrs["iterations"] == 0
    assert second.attrs["energy_released"] == pytest.approx(0.0, abs=1e-12)
    assert np.array_equal(first.node_displacement, second.node_displacement)
    np.testing.assert_allclose(second.stress, first.stress, rtol=0, atol=1e-6)


def test_a_step_restarts_from_a_file_to_the_bit(tmp_path):
    """The state in memory, written and read, and read twice: three equal results of a brittle step."""
    entries = [excavation(0, None, name="e0"), excavation(1, None, name="e1")]
    options = {"stress": STRESS, "host": COULOMB}
    early = make_scene("xz", excavations=[entries[0], excavation(-1, None, name="e1")], **options)
    late = make_scene("xz", excavations=entries, steps=2, **options)
    grid = make_dataset(early, grid_around(SHAPES, [5, 5], 2, 8.0), SHAPES)
    elastic, _ = elastic_stage(early, grid, tmp_path / "f.npz")
    state, _ = mining_step(early, grid, elastic, tmp_path / "f.npz")
    write_dataset(grid, tmp_path / "grid.nc")
    write_dataset(state, tmp_path / "state.nc")
    straight, _ = mining_step(late, grid, state, tmp_path / "f.npz")
    assert (straight.failed >= 0).any()
    for _ in range(2):
        again, _ = mining_step(
            late, read_dataset(tmp_path / "grid.nc"), read_dataset(tmp_path / "state.nc"), tmp_path / "f.npz"
        )
        for name in straight.variables:
            assert np.array_equal(straight[name], again[name]), name


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 10_000), st.sampled_from(["fraction", "subdivide"]))
def test_pieces_are_exclusive_and_later_steps_only_add(seed_number, cut_cells):
    """Random overlapping samples in 6 cells, mined over 3 steps: the earliest step (then the first listed) owns a
    sample, no piece and no remainder is a sliver; later stages leave earlier pieces and particles as they are."""
    random = np.random.default_rng(seed_number)
    grid = grid_around([], [3, 2], 1, 1.0)
    mined = random.integers(0, 3, 4)
    filled = mined + random.integers(0, 2, 4)
    parts = []
    for number in range(4):
        for cell in random.choice(6, 4, replace=False):
            some = random.choice([1, 2, 20, 62, 63, 64])
            bits = np.uint64(0)
            for bit in random.choice(64, some, replace=False):
                bits |= np.uint64(1) << np.uint64(bit)
            if some >= SLIVER:
                parts.append((cell, number, bits))
    cell, number, bits = zip(*parts, strict=True)
    raw = Pieces(np.array(cell, np.int32), np.array(number, np.int16), np.array(bits, np.uint64))
    previous = None
    for last in range(4):
        entries = [
            excavation(int(m) if m <= last else -1, "fill" if f <= last else None, int(f), name=f"e{i}")
            for i, (m, f) in enumerate(zip(mined, filled, strict=True))
        ]
        scene = make_scene("xz", excavations=entries, steps=last + 1, cut_cells=cut_cells)
        pieces = exclusive_pieces(raw, scene)
        taken = np.zeros(6, np.uint64)
        wanted = np.zeros(6, np.uint64)
        for cell, bits in zip(pieces.cell, pieces.samples, strict=True):
            assert taken[cell] & bits == 0
            assert np.bitwise_count(bits) >= SLIVER
            taken[cell] |= bits
        for cell, number, bits in parts:
            if mined[number] <= last:
                wanted[cell] |= bits
        left = np.bitwise_count(~taken)
        assert ((left == 0) | (left >= SLIVER)).all()
        # what was wanted and what was taken differ by slivers: less than 2 samples for each excavation
        assert (np.bitwise_count(taken ^ wanted) <= 4 * (SLIVER - 1) + SLIVER - 1).all()
        particles = seed(grid, host_everywhere(grid), pieces, scene, raw)
        volume = volumes(particles, pieces, scene, 6, last)
        owner = zip(pieces.cell.tolist(), pieces.excavation.tolist(), strict=True)
        now = dict(zip(owner, pieces.samples.tolist(), strict=True))
        solid = np.bincount(particles.cell, volume, minlength=6)
        void = np.zeros(6)
        for cell, number, bits in zip(pieces.cell, pieces.excavation, pieces.samples, strict=True):
            if not 0 <= filled[number] <= last:
                void[cell] += np.bitwise_count(bits) / 64
        np.testing.assert_allclose(solid + void, 1.0, rtol=1e-12)
        if previous is not None:
            pieces_before, particles_before, volume_before = previous
            for key, value in pieces_before.items():
                assert now[key] == value
            count = particles_before.count
            for name in ("cell", "material", "excavation", "xi", "full_volume", "sample"):
                assert np.array_equal(getattr(particles, name)[:count], getattr(particles_before, name)), name
            assert np.array_equal(volumes(particles, pieces, scene, 6, last - 1)[:count], volume_before)
        previous = now, particles, volume


def test_the_earliest_step_owns_an_overlap():
    """Two boxes overlap in one cell column: each sample belongs to the one that is mined first, listed last or not."""
    shapes = [box([0, 0], [6, 8]), box([2, 0], [8, 8])]
    grid = grid_around(shapes, [1, 1], 1, 8.0)
    raw = pieces_of(grid, shapes)
    for mined, counts in (((0, 1), [48, 16]), ((1, 0), [16, 48]), ((0, 0), [48, 16])):
        entries = [excavation(m, name=f"e{i}") for i, m in enumerate(mined)]
        pieces = exclusive_pieces(raw, make_scene("xz", excavations=entries, steps=2))
        got = {int(e): int(np.bitwise_count(s)) for e, s in zip(pieces.excavation, pieces.samples, strict=True)}
        assert [got[0], got[1]] == counts
    model = make_model(make_scene("xz", excavations=[excavation(), excavation(name="b")]), grid, shapes)
    assert (model.volumes(0) == 0.0).all()
    assert FULL == np.bitwise_or.reduce(model.pieces.samples)


def test_a_step_starts_from_the_rest_of_the_step_before(tmp_path, monkeypatch):
    """What mined rock held, hourglass forces included, becomes an external force: with the whole of it nothing moves.
    The unbalanced force at the start of a step that mines failed rock and places fill is that of the state before."""
    starts = []

    def look_first(scheme, brittle, ramp, step, history):
        unbalanced = ramp.start + scheme.internal_force()
        starts.append((np.linalg.norm(unbalanced), np.linalg.norm(ramp.target - ramp.start), ramp.reference))
        return run_cascade(scheme, brittle, ramp, step, history)

    monkeypatch.setattr(stages, "run_cascade", look_first)
    states = chain(tmp_path, [(0, "fill", 1), (1, None, 1)], 2, host=COULOMB, solver={"hourglass": 0.3})
    assert (states[1].failed >= 0).any()
    failed = np.flatnonzero(states[1].failed.values >= 0)
    assert (states[2].volume.values[failed] < states[1].volume.values[failed]).any()
    for unbalanced, _, reference in starts:
        assert unbalanced <= 1.01e-5 * reference
    assert starts[1][1] > 0.1 * starts[1][2]
