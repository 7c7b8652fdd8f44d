"""Loose pieces: found against a dense lattice of samples, fallen with the same answer as if they had been excavated."""

import re

import numpy as np
import pytest
from scipy import ndimage

from common.datasets import read_dataset, write_dataset
from mpm_core.geometry.inside import SAMPLES_PER_CELL
from mpm_core.model.occupancy import ALL_SAMPLES
from mpm_core.model.unsupported import find_unsupported, hang_together
from mpm_core.stages.equilibrium_stages import elastic_stage, mining_step
from tests.mechanics.scenes import (
    COULOMB,
    FACES,
    box,
    excavation,
    grid_around,
    make_dataset,
    make_scene,
    pieces_of,
    uniform,
)

WEIGHT = {"constant": [0.0] * 6, "gradient": [-0.02e6, -0.02e6, -0.028e6, 0, 0, 0]}


@pytest.mark.parametrize("dimension", [2, 3])
def test_samples_of_a_cell_hang_together_through_faces(dimension):
    """Against scipy's labels, for random masks of all densities."""
    random = np.random.default_rng(dimension)
    bits = random.random((300, SAMPLES_PER_CELL)) < random.random((300, 1))
    mask = (bits * (np.uint64(1) << np.arange(SAMPLES_PER_CELL, dtype=np.uint64))).sum(axis=1, dtype=np.uint64)
    parts, rows = hang_together(mask, dimension)
    per_edge = round(SAMPLES_PER_CELL ** (1 / dimension))
    for row, dense in enumerate(bits):
        labels, count = ndimage.label(dense.reshape((per_edge,) * dimension))  # last axis fastest: faces all the same
        expected = sorted(int(sum(1 << int(k) for k in np.flatnonzero(labels == n))) for n in range(1, count + 1))
        assert sorted(parts[rows == row].tolist()) == expected


def lattice(grid, values):
    """Values (cell, 64) on the lattice of finest cells' samples, axes in order; one per cell counts for all of it."""
    per_edge = round(SAMPLES_PER_CELL ** (1 / grid.dimension))
    dense = np.zeros(grid.shape * per_edge, values.dtype)
    for cell, (index, width) in enumerate(zip(grid.cell_index, grid.cell_width, strict=True)):
        own = values[cell].reshape((per_edge,) * grid.dimension).T  # first axis fastest
        for axis in range(grid.dimension):
            own = np.repeat(own, width, axis)
        dense[tuple(slice(i * per_edge, (i + width) * per_edge) for i in index)] = own
    return dense


def random_holes(random, dimension):
    """Points of three boxes in which random cubes, not aligned with cells, are taken out."""
    holes = random.random((24,) * dimension) < (0.55 if dimension == 2 else 0.75)
    edge, boxes = 0.7 + 0.6 * random.random(), []
    for _ in range(3):
        lower = random.uniform(-2.0, 12.0, dimension)
        boxes.append(box(lower, lower + random.uniform(3.0, 7.0, dimension)))

    def inside(x):
        return np.any([one(x) for one in boxes], axis=0)

    return inside, lambda x: inside(x) & holes[tuple(np.moveaxis((x / edge).astype(int) % 24, -1, 0))]


@pytest.mark.parametrize("dimension", [2, 3])
def test_loose_pieces_are_those_of_the_dense_lattice(dimension):
    """Random holes in a box held on all sides but one; pieces by scipy's labels of all samples, as fine everywhere."""
    found = 0
    for seed in range(12):
        random = np.random.default_rng([dimension, seed])
        zone, holes = random_holes(random, dimension)
        grid = grid_around([zone], (4,) * dimension, 3 if dimension == 2 else 2, 4.0, rings=0)
        solid = np.full(len(grid.cell_level), ALL_SAMPLES)
        pieces = pieces_of(grid, [holes])
        np.bitwise_and.at(solid, pieces.cell, ~pieces.samples)
        faces = {(axis, side): list(range(dimension)) for axis in range(dimension) for side in range(2)}
        del faces[0, 1]
        bits = (solid[:, None] >> np.arange(SAMPLES_PER_CELL, dtype=np.uint64)) & np.uint64(1) == 1
        dense = lattice(grid, bits)
        labels, _ = ndimage.label(dense)
        held = set(np.unique(labels[0])) | {
            label for axis in range(1, dimension) for side in (0, -1) for label in np.unique(labels.take(side, axis))
        }
        per_edge = round(SAMPLES_PER_CELL ** (1 / dimension))
        sizes = np.bincount(labels.ravel()) / per_edge**dimension  # in finest cells
        own = lattice(grid, np.tile(np.arange(len(solid))[:, None], SAMPLES_PER_CELL))
        with_held = np.unique(own[np.isin(labels, sorted(held - {0}))])
        expected = []
        for label in set(range(1, len(sizes))) - held:
            crumb = sizes[label] < 1.0 and np.isin(np.unique(own[labels == label]), with_held).all()
            expected += [] if crumb else [sizes[label]]
        unsupported = find_unsupported(grid, solid, faces, 3)
        volume = (
            np.bitwise_count(unsupported.samples)
            / SAMPLES_PER_CELL
            * grid.cell_width[unsupported.cell].astype(float) ** dimension
        )
        assert (unsupported.step == 3).all()
        assert (unsupported.samples & ~solid[unsupported.cell] == 0).all()
        np.testing.assert_allclose(np.bincount(unsupported.piece, volume), sorted(expected, reverse=True))
        found += len(expected)
    assert found > 10


@pytest.mark.parametrize("rows", range(4))
def test_few_parts_beside_many_bodies(rows):
    """Full base cells in a checkerboard, each a body of its own, and one cell of half material: all loose but one row
    at the held face."""
    grid = grid_around([], (8, 8), 1, 1.0)
    solid = np.where(grid.cell_index.sum(axis=1) % 2 == 0, ALL_SAMPLES, np.uint64(0))
    half = np.flatnonzero((grid.cell_index == [3, rows]).all(axis=1))
    solid[half] &= np.uint64(2**32 - 1)
    unsupported = find_unsupported(grid, solid, {(1, 0): [0, 1]}, 0)
    assert len(np.unique(unsupported.piece)) == 32 - 4
    assert set(unsupported.cell) == set(np.flatnonzero((solid != 0) & (grid.cell_index[:, 1] > 0)))


def ring(inner, outer):
    """Points of a box outside another."""
    return lambda x: outer(x) & ~inner(x)


SIDES = {f"{axis}_{side}": "roller" for axis in "xy" for side in ("lower", "upper")}
HANGS = SIDES | {"z_lower": "fixed", "z_upper": "free"}
BLOCKS = {
    "one cell": ([7.0, 7.0], [8.0, 8.0]),
    "a sliver of 0.3 m": ([6.2, 7.0], [6.5, 9.0]),
    "a block at an edge": ([5.0, 5.0], [7.0, 7.0]),  # touches the rock at (5, 5) only
    "some cells": ([6.3, 6.6], [9.2, 9.7]),
}


def run(plane, boundary, excavations, shapes, stress, steps, tmp_path, solver=None, host=COULOMB):
    """Elastic stage and all steps: (datasets, facts) of each; shapes in 2-D (x, z)."""
    states, facts, state = [], [], None
    grid = grid_around(shapes, (4,) * 2 if plane else (4,) * 3, 3, 4.0, rings=1)
    settings = {"scheme": "multigrid", "increments": 2} | (solver or {})
    for step in range(-1, steps):
        known = [
            entry | {key: entry[key] if entry[key] <= max(step, 0) else -1 for key in ("mined", "filled")}
            for entry in excavations
        ]
        scene = make_scene(
            plane,
            boundary=boundary,
            excavations=known,
            surface=20.0,
            stress=stress,
            host=host,
            steps=max(step, 0) + 1,
            solver=settings,
        )
        data = make_dataset(scene, grid, shapes)
        path = tmp_path / "failed.npz"
        state, fact = elastic_stage(scene, data, path) if step < 0 else mining_step(scene, data, state, path)
        write_dataset(state, tmp_path / "state.nc")
        state = read_dataset(tmp_path / "state.nc")
        states.append(state)
        facts.append(fact)
    return states, facts


def same_answer(one, other):
    present = one.volume.values > 0.0
    np.testing.assert_array_equal(one.volume.values, other.volume.values)
    scale = np.abs(one.stress.values).max()
    np.testing.assert_allclose(one.stress.values[present], other.stress.values[present], atol=1e-4 * scale)
    np.testing.assert_array_equal(one.failed.values[present], other.failed.values[present])


@pytest.mark.parametrize("scheme", ["explicit", "multigrid"])
@pytest.mark.parametrize("name", BLOCKS)
@pytest.mark.parametrize("stress", [WEIGHT, uniform(-3e6, -3e6, -3e6)], ids=["weight", "weightless"])
def test_a_loose_block_falls_as_if_excavated(name, stress, scheme, tmp_path):
    """In a void with weight and without: the same state as with the block in the excavation, and the block is named."""
    inner, outer = box(*BLOCKS[name]), box([5.0, 5.0], [11.0, 11.0])
    if name == "a block at an edge":
        outer = ring(box([3.0, 3.0], [5.0, 5.0]), box([3.0, 3.0], [11.0, 11.0]))
    around, settings = excavation(), {"scheme": scheme}
    (_, one), (facts, history) = run("xz", HANGS, [around], [ring(inner, outer)], stress, 1, tmp_path, settings)
    (_, other), _ = run("xz", HANGS, [around], [outer], stress, 1, tmp_path, settings)
    same_answer(one, other)
    lower, upper = (np.array(corner) for corner in BLOCKS[name])
    for fact in (facts, history):
        assert fact["loose_pieces"] == 1
        assert fact["loose_volume"] == pytest.approx(np.prod(upper - lower), rel=0.35 if "sliver" in name else 0.1)
        x, z = 0.5 * (lower + upper)
        place = re.fullmatch(r"largest .* m3 at \(x, z\) = \((.*), (.*)\) m", fact["loose_where"]).groups()
        np.testing.assert_allclose([float(value) for value in place], [x, z], atol=0.2)
    assert np.isfinite(one.stress.values).all()


def test_a_block_held_on_a_face_stays(tmp_path):
    """The same block with one cell's width of rock to a wall."""
    outer = ring(box([7.0, 7.0], [11.0, 9.0]), box([5.0, 5.0], [11.0, 11.0]))
    (_, state), (facts, _) = run("xz", HANGS, [excavation()], [outer], WEIGHT, 1, tmp_path)
    assert facts["loose_pieces"] == 0
    assert facts["loose_where"] == ""
    assert state.sizes["loose"] == 0


def test_mining_makes_a_block_loose_and_it_stays_out(tmp_path):
    """A block on a neck: the neck is mined in the second step, far rock in the third. From the second on the state is
    that of a block mined with its neck; the fallen block enters no excavation's volume."""
    hanging = ring(box([7.0, 7.0], [9.0, 11.0]), box([5.0, 5.0], [11.0, 11.0]))
    neck, more = box([7.0, 9.0], [9.0, 11.0]), box([12.0, 12.0], [13.0, 13.0])
    both = box([7.0, 7.0], [9.0, 11.0])
    steps = [excavation(), excavation(mined=1, name="neck"), excavation(mined=2, name="more")]
    states, facts = run("xz", HANGS, steps, [hanging, neck, more], WEIGHT, 3, tmp_path)
    others, _ = run("xz", HANGS, steps, [hanging, both, more], WEIGHT, 3, tmp_path)
    assert [fact["loose_pieces"] for fact in facts] == [0, 0, 1, 0]
    assert facts[2]["loose_volume"] == pytest.approx(4.0)
    assert facts[2]["loose_where"] == "largest 4 m3 at (x, z) = (8.0, 8.0) m"
    for one, other in zip(states[2:], others[2:], strict=True):
        same_answer(one, other)
    assert states[1].volume.values.sum() > states[2].volume.values.sum() + 7.9


def test_fill_that_nothing_holds_falls_and_its_place_is_filled_again(tmp_path):
    """Fill placed in the middle of an open stope falls at once; placed once more over all of the stope it stays."""
    stope, plug = box([5.0, 5.0], [11.0, 11.0]), box([7.0, 7.0], [9.0, 9.0])
    entries = [
        excavation(fill="fill", filled=2, name="stope"),
        excavation(fill="fill", filled=1, name="plug"),
    ]
    states, facts = run("xz", HANGS, entries, [stope, plug], WEIGHT, 3, tmp_path)
    assert [fact["loose_pieces"] for fact in facts] == [0, 0, 1, 0]
    assert facts[2]["loose_volume"] == pytest.approx(4.0)
    assert states[2].volume.values.sum() == pytest.approx(256.0 - 36.0)
    assert states[3].volume.values.sum() == pytest.approx(256.0)


def test_debris_around_a_free_body_falls(tmp_path):
    """Nothing holds a body in space: the largest piece is the model, smaller ones are loose, and no force is left."""
    boundary = dict.fromkeys(FACES, "free")
    body, debris = box([3.0, 3.0], [13.0, 11.0]), box([5.0, 13.0], [7.0, 14.0])

    def space(x):
        return ~body(x) & ~debris(x)

    (state, _), (facts, _) = run("xz", boundary, [excavation()], [space], uniform(-1e6, 0.0, -1e6), 1, tmp_path)
    assert facts["loose_pieces"] == 1
    assert state.volume.values.sum() == pytest.approx(80.0)


@pytest.mark.parametrize("turn", range(4))
def test_a_block_in_three_dimensions_hinged_at_an_edge_falls(turn, tmp_path):
    """A block that touches the rock along an edge would turn about it; mirrored and turned all the same."""
    room, block = [[4.0, 4.0, 4.0], [12.0, 12.0, 12.0]], [[4.0, 8.0, 6.0], [6.0, 10.0, 8.0]]
    ledge = [[2.0, 4.0, 4.0], [4.0, 10.0, 12.0]]  # behind the block the wall is mined, up to the block's upper edge

    def turned(corners):
        corners = np.array(corners)
        if turn & 1:
            corners = 16.0 - corners[::-1]
        return box(*(corners[:, [1, 0, 2]] if turn & 2 else corners))

    space = ring(turned(block), lambda x: turned(room)(x) | turned(ledge)(x))
    (state, _), (facts, _) = run(None, HANGS | {"x_lower": "fixed"}, [excavation()], [space], WEIGHT, 1, tmp_path)
    assert facts["loose_pieces"] == 1
    assert facts["loose_volume"] == pytest.approx(8.0)
    assert np.isfinite(state.displacement.values).all()
