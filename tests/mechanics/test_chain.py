"""Steps one after another: what must not depend on the way, and what must not change at all."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from common.datasets import read_dataset, write_dataset
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
from mpm_core.equilibrium.cascade import run_cascade
from mpm_core.geometry.inside import SAMPLES_PER_CELL
from mpm_core.grid.distorted_cells import DistortedCells
from mpm_core.model.occupancy import ALL_SAMPLES, MIN_SAMPLES_KEPT, ROCK_OWNER, Pieces, Unsupported, changes_of
from mpm_core.model.particles import seed, volumes
from mpm_core.stages import equilibrium_stages
from mpm_core.stages.equilibrium_stages import elastic_stage, mining_step

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
        scene = make_scene("xz", **{"stress": STRESS} | options, excavations=entries, steps=last + 1)
        if grid is None:
            grid = make_dataset(scene, grid_around(shapes, [5, 5], 2, 8.0), shapes)
            states.append(elastic_stage(scene, grid, tmp_path / "failed.npz")[0])
        states.append(mining_step(scene, grid, states[-1], tmp_path / "failed.npz")[0])
    return states


@pytest.mark.parametrize("cut_cells", ["mean", "subdivide"])
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


def test_fill_bears_the_load_of_the_step_that_places_it(tmp_path):
    """A void is filled in the step that mines a second one beside it: the fill is there when that rock is unloaded. Its
    stress is that of fill that was placed a step earlier (1e-6); fill of the step after has none."""

    def fill_stress(filled: int) -> np.ndarray:
        state = chain(tmp_path, [(0, "fill", filled), (2, None, 2)], 4, solver=TIGHT)[-1]
        return state.stress.values[(state.excavation.values == 0) & (state.volume.values > 0)]

    early, with_mining, late = (fill_stress(filled) for filled in (1, 2, 3))
    assert np.abs(early).max() > 1e3
    np.testing.assert_allclose(with_mining, early, rtol=0, atol=1e-6 * np.abs(early).max())
    assert np.abs(late).max() < 1.0


WEIGHT = {"constant": [0.0] * 6, "gradient": [-0.0149e6, -0.0149e6, -0.0278e6, 0.0, 0.0, 0.0]}


@pytest.mark.parametrize("stress", [STRESS, WEIGHT], ids=["uniform", "weight"])
@pytest.mark.parametrize(("cut_cells", "per_edge"), [("mean", 1), ("mean", 2), ("subdivide", 1)])
def test_fill_that_is_mined_again_leaves_no_trace(stress, cut_cells, per_edge, tmp_path):
    """A stope is filled, a second one beside it loads the fill, then all of the fill is mined: elastic rock stands as
    if there had never been any, and what is left of the fill weighs and carries nothing. 1e-5 of the largest change;
    1e-3 where a cut cell's rock and fill share one hourglass force, which goes by their stiffness."""
    share = 1e-3 if per_edge == 1 and cut_cells != "subdivide" else 1e-5
    options = {"solver": TIGHT, "cut_cells": cut_cells, "particles_per_cell": per_edge, "stress": stress}
    shapes = [*SHAPES, SHAPES[0]]
    never = chain(tmp_path, [(0, None, 0), (2, None, 2)], 3, **options)[-1]
    states = chain(tmp_path, [(0, "fill", 1), (2, None, 2), (3, None, 3)], 4, shapes=shapes, **options)
    loaded, mined = states[-2:]
    rock = never.sizes["particle"]
    fill = loaded.excavation.values == 0
    assert loaded.volume.values[fill].sum() > 40.0
    assert np.abs(loaded.stress.values[fill]).max() > 1e3
    assert mined.volume.values[fill].max() == 0.0
    assert np.array_equal(mined.volume.values[:rock], never.volume.values)
    largest = np.abs(never.stress.values - states[0].stress.values[:rock]).max()
    np.testing.assert_allclose(mined.stress.values[:rock], never.stress.values, rtol=0, atol=share * largest)
    np.testing.assert_allclose(
        mined.node_displacement, never.node_displacement, rtol=0, atol=share * np.abs(never.node_displacement).max()
    )


def test_a_drive_through_fill_moves_what_the_fill_held_and_is_filled_again(tmp_path):
    """A drive through loaded fill: its part of the fill goes, the rest closes in on it, the rock around it moves too;
    fill in the drive starts without stress, and carries once the rock beside is mined."""
    shapes = [*SHAPES, box([16.0, 18.0], [20.0, 22.0]), ball([18.0, 28.0], 3.0)]
    plan = [(0, "fill", 1), (2, None, 2), (3, "fill", 4), (5, None, 5)]
    *_, loaded, dug, again, last = chain(tmp_path, plan, 6, shapes=shapes, solver=TIGHT)

    def volume(state, excavation):
        return state.volume.values[state.excavation.values == excavation].sum()

    assert volume(dug, 0) == pytest.approx(volume(loaded, 0) - 16.0, rel=1e-12)
    moved = np.abs(dug.node_displacement.values - loaded.node_displacement.values)
    assert moved.max() > 1e-3 * np.abs(loaded.node_displacement.values).max()
    assert volume(again, 2) == pytest.approx(16.0, rel=1e-12)
    fresh = again.excavation.values == 2
    assert np.abs(again.stress.values[fresh]).max() < 1.0
    assert np.abs(last.stress.values[fresh]).max() > 1e3


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


def slow_occupancy(parts, mined, filled, last):
    """What holds each sample of each of 6 cells after each step, by the rule, one sample at a time: -1 rock, -2 void,
    else the excavation whose fill it is. parts: (cell, excavation, set of samples)."""
    held = {cell: [-1] * SAMPLES_PER_CELL for cell in range(6)}
    after = []

    def take(cell, wanted, owner, new):
        have = [i for i in range(SAMPLES_PER_CELL) if held[cell][i] == owner]
        gone = [i for i in have if i in wanted]
        if len(gone) < MIN_SAMPLES_KEPT:
            return
        for i in have if len(have) - len(gone) < MIN_SAMPLES_KEPT else gone:
            held[cell][i] = new

    for step in range(last + 1):
        for number, when in enumerate(mined):
            for cell, solid, samples in parts:
                if when == step and solid == number:
                    owners = [-1, *sorted((n for n in range(len(filled)) if n != number), key=lambda n: filled[n])]
                    for owner in owners:
                        take(cell, samples, owner, -2)
        for number, when in enumerate(filled):
            for cell, solid, samples in parts:
                if when == step and solid == number:
                    take(cell, samples, -2, number)
        after.append({cell: list(row) for cell, row in held.items()})
    return after


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 10_000), st.sampled_from(["mean", "subdivide"]))
def test_samples_change_hands_as_rock_is_mined_and_filled_and_fill_is_mined(seed_number, cut_cells):
    """Random overlapping solids in 6 cells, mined and filled over 4 steps: volumes of rock and of each fill after every
    step are those of a slow twin, and later stages leave the particles of earlier ones as they are."""
    random = np.random.default_rng(seed_number)
    grid = grid_around([], [3, 2], 1, 1.0)
    mined = random.integers(0, 4, 5)
    filled = mined + random.integers(0, 3, 5)
    sets = []
    for number in range(5):
        for cell in random.choice(6, 4, replace=False):
            some = random.choice([2, 3, 20, 62, 63, 64])
            sets.append((int(cell), number, set(random.choice(SAMPLES_PER_CELL, some, replace=False).tolist())))
    cell, number, bits = zip(*((c, n, sum(1 << i for i in samples)) for c, n, samples in sets), strict=True)
    raw = Pieces(np.array(cell, np.int32), np.array(number, np.int16), np.array(bits, np.uint64))
    twin = slow_occupancy(sets, mined, filled, 3)
    previous = changes_before = None
    for last in range(4):
        entries = [
            excavation(int(m) if m <= last else -1, "fill" if f <= last else None, int(f), name=f"e{i}")
            for i, (m, f) in enumerate(zip(mined, filled, strict=True))
        ]
        scene = make_scene("xz", excavations=entries, steps=last + 1, cut_cells=cut_cells)
        changes = changes_of(raw, scene.excavations, Unsupported.none())
        particles = seed(grid, host_everywhere(grid), changes, scene, raw, DistortedCells.none(grid.dimension))
        for step in range(last + 1):
            volume = volumes(particles, changes, step)
            found = np.zeros((6, 6))
            np.add.at(found, (particles.cell, particles.excavation), volume)
            expected = [
                [twin[step][cell].count(owner) / SAMPLES_PER_CELL for owner in (0, 1, 2, 3, 4, -1)] for cell in range(6)
            ]
            np.testing.assert_allclose(found, expected, rtol=1e-12)
            if previous is not None and step < last:
                assert np.array_equal(volume[: previous.count], volumes(previous, changes_before, step))
        if previous is not None:
            for name in ("cell", "material", "excavation", "full_volume", "sample"):
                assert np.array_equal(getattr(particles, name)[: previous.count], getattr(previous, name)), name
        previous, changes_before = particles, changes


def test_the_earliest_step_mines_an_overlap():
    """Two boxes overlap in one cell column: each sample goes when the first of both is mined, listed last or not."""
    shapes = [box([0, 0], [6, 8]), box([2, 0], [8, 8])]
    grid = grid_around(shapes, [1, 1], 1, 8.0)
    raw = pieces_of(grid, shapes)
    for mined, counts in (((0, 1), [48, 16]), ((1, 0), [48, 16]), ((0, 0), [64])):
        entries = [excavation(m, name=f"e{i}") for i, m in enumerate(mined)]
        changes = changes_of(raw, make_scene("xz", excavations=entries, steps=2).excavations, Unsupported.none())
        assert (changes.owner == ROCK_OWNER).all()
        by_step = np.bincount(changes.step, np.bitwise_count(changes.samples))
        assert by_step.tolist() == counts
    model = make_model(make_scene("xz", excavations=[excavation(), excavation(name="b")]), grid, shapes)
    assert (model.volumes(0) == 0.0).all()
    assert ALL_SAMPLES == np.bitwise_xor.reduce(model.changes.samples)


def test_a_step_starts_from_the_rest_of_the_step_before(tmp_path, monkeypatch):
    """What mined rock held, hourglass forces included, becomes an external force: with the whole of it nothing moves.
    The unbalanced force at the start of a step that mines failed rock and places fill is that of the state before."""
    starts = []

    def look_first(scheme, brittle, ramp, *others):
        unbalanced = ramp.start + scheme.body.internal_force()
        starts.append((np.linalg.norm(unbalanced), np.linalg.norm(ramp.target - ramp.start), ramp.reference))
        return run_cascade(scheme, brittle, ramp, *others)

    monkeypatch.setattr(equilibrium_stages, "run_cascade", look_first)
    states = chain(tmp_path, [(0, "fill", 1), (1, None, 1)], 2, host=COULOMB)
    assert (states[1].failed >= 0).any()
    failed = np.flatnonzero(states[1].failed.values >= 0)
    assert (states[2].volume.values[failed] < states[1].volume.values[failed]).any()
    for (unbalanced, _, _), before in zip(starts, states, strict=False):
        assert unbalanced == pytest.approx(before.attrs["unbalanced_force"], rel=1e-6)
    assert starts[1][1] == pytest.approx(starts[1][2])


def test_a_small_step_in_a_large_mine_is_brought_to_rest_as_by_itself(tmp_path):
    """A cavern, then a hole whose force is 1e-4 of the cavern's, 16 m away, at a tolerance of 1e-3: the hole moves the
    rock by what it would move it alone, where the cavern had never been mined, but for the cavern's own pull on it."""
    shapes = [ball([14.0, 20.0], 8.0), box([33.0, 19.0], [34.0, 20.0])]
    options = {"shapes": shapes, "solver": {"tolerance": 1e-3, "scheme": "multigrid"}}
    before, after = chain(tmp_path, [(0, None, 0), (1, None, 1)], 2, **options)[1:]
    exact_before, exact = chain(
        tmp_path, [(0, None, 0), (1, None, 1)], 2, **options | {"solver": {"tolerance": 1e-9, "scheme": "multigrid"}}
    )[1:]
    moved = after.node_displacement.values - before.node_displacement.values
    expected = exact.node_displacement.values - exact_before.node_displacement.values
    assert after.attrs["iterations"] > 0
    np.testing.assert_allclose(moved, expected, rtol=0, atol=0.05 * np.abs(expected).max())
