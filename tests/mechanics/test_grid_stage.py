"""From a grid slice to grid.nc and back."""

import json
import logging
from collections import Counter

import numpy as np
import psutil
import pytest
import trimesh
from hypothesis import example, given, settings
from hypothesis import strategies as st

from common.errors import InputError
from mechanics.scenes import ball, excavation, grid_around, make_dataset, make_scene
from mpm_core.files.state_datasets import grid_dataset, read_edge_nodes, read_edge_points, read_grid, read_pieces
from mpm_core.geometry.inside import OUTSIDE, classify_cells
from mpm_core.geometry.shapes import build_shape
from mpm_core.grid.domain import Domain
from mpm_core.grid.octree import all_cells
from mpm_core.model.occupancy import ALL_SAMPLES
from mpm_core.stages import grid_stage, stage_memory
from mpm_core.stages.equilibrium_stages import elastic_stage
from mpm_core.stages.grid_stage import make_grid
from mpm_core.stages.stage_memory import stage_bytes, usable


def grid_slice(*excavations, plane=None, bodies=(), cut_cells="mean", thickness=1.0, **grid):
    """A grid slice: 24 m block (or section), cells of 8 and 4 m."""
    dimension = 2 if plane else 3
    return {
        "name": "test",
        "plane": plane,
        "thickness": thickness,
        "domain": {"lower": [0.0] * dimension, "upper": [24.0] * dimension},
        "grid": {"coarse_cell": 8.0, "levels": 2, "buffer_cells": 1, "cut_cells": cut_cells, "volume_error": 0.2}
        | grid,
        "excavations": list(excavations),
        "rock_bodies": list(bodies),
    }


def block(lower, upper, name="stope", **more):
    return {"name": name, "shape": "box", "lower": lower, "upper": upper} | more


def places_of_pieces(dataset) -> set[tuple]:
    """Lower corners of the finest cells that excavations take parts of."""
    return {tuple(place) for place in dataset.piece_origin.values.tolist()}


def finest_places(dataset) -> set[tuple]:
    """Lower corners of the finest cells there are."""
    return {tuple(place) for place in dataset.cell_origin.values[dataset.cell_level.values == 1].tolist()}


@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 10**6), plane=st.booleans(), shuffled=st.booleans())
@example(seed=0, plane=False, shuffled=True)
def test_cells_that_any_of_many_solids_touches_are_those_of_each_alone(seed, plane, shuffled):
    """Small solids are looked up by the cells of their box, large ones by all cells; some lie beyond the domain."""
    random, dimension = np.random.default_rng(seed), 2 if plane else 3
    domain = Domain(np.full(dimension, -3.0), np.full(dimension, 6), 4.0, 3)
    middle, half = random.uniform(-8.0, 30.0, (6, dimension)), random.choice([0.7, 3.0, 12.0], (6, dimension))
    corners = zip((middle - half).tolist(), (middle + half).tolist(), strict=True)
    solids = [build_shape(block(*ends), dimension) for ends in corners]
    index = all_cells(domain.base_shape << 1)
    index = index[random.random(len(index)) < 0.7]
    if shuffled:
        random.shuffle(index)
    alone = [classify_cells(solid, domain.lower, domain.cell(1), index) != OUTSIDE for solid in solids]
    np.testing.assert_array_equal(grid_stage.touches(solids, domain, 1, index), np.any(alone, axis=0))
    assert not len(grid_stage.touches(solids, domain, 1, index[:0]))


def test_what_a_later_step_mines_has_its_parts_but_no_fine_cells_yet():
    """The same parts as if it were mined at once; fine cells are those of the others alone, whatever comes later."""
    any_width = {"buffer_cells": 0, "volume_error": 1.0}
    now, later = block([4.0] * 3, [7.0] * 3, "now"), block([17.0] * 3, [21.0, 21.0, 19.0], "later")
    both = make_grid(grid_slice(now, later, **any_width), {})
    at_first = make_grid(grid_slice(now, later, **any_width) | {"later": [1]}, {})
    assert finest_places(at_first) == finest_places(make_grid(grid_slice(now, **any_width), {}))
    assert finest_places(both) > finest_places(at_first)
    for name in ("piece_origin", "piece_excavation", "piece_samples"):
        assert np.array_equal(at_first[name].values, both[name].values), name
    assert at_first.attrs["excavation_volume_grid"] == both.attrs["excavation_volume_grid"]


@pytest.mark.parametrize("plane", [None, "xz"])
def test_volume_on_the_grid_is_that_of_a_box_along_its_samples(plane):
    """A box whose faces lie on quarters of 4 m cubes: the samples give its volume exactly, thickness included in
    2-D and left out in 3-D."""
    d = 2 if plane else 3
    values = grid_slice(block([5.0] * d, [15.0] * d), plane=plane, thickness=3.0, cut_cells="subdivide")
    dataset = make_grid(values, {})
    volume = 10.0**d * (3.0 if plane else 1.0)
    assert json.loads(dataset.attrs["excavation_volume"]) == pytest.approx([volume], rel=1e-12)
    assert json.loads(dataset.attrs["excavation_volume_grid"]) == pytest.approx([volume], rel=1e-12)
    assert np.sum(dataset.piece_fraction.values) * 4.0**d == pytest.approx(10.0**d, rel=1e-12)
    assert finest_places(dataset) >= places_of_pieces(dataset)


@pytest.mark.parametrize("plane", [None, "xz"])
@given(offset=st.floats(0.0, 4.0), edge=st.floats(9.0, 12.0))
@example(offset=0.5, edge=11.25)
@example(offset=0.765625, edge=9.625)
@settings(max_examples=10, deadline=None)
def test_volume_of_a_box_is_kept_where_cells_are_distorted(plane, offset, edge):
    """A box two to three cells wide at any place, however little of it fills whole ones: each wall to a 64th of a cell,
    which is what one of its cells' samples stands for."""
    d = 2 if plane else 3
    box = block([8.0 + offset] * d, [8.0 + offset + edge] * d)
    dataset = make_grid(grid_slice(box, plane=plane, volume_error=1.0), {})
    volume = edge**d * dataset.attrs["thickness"]
    walls = 2 * d * 4.0 / 64 / edge
    assert json.loads(dataset.attrs["excavation_volume_grid"]) == pytest.approx([volume], rel=walls)


def test_whole_cells_are_in_or_out():
    """By the half of a cell: 3/4 along two axes (36/64) is in, 3/4 along all three (27/64) is out, so is 1/4."""
    dataset = make_grid(grid_slice(block([5.0] * 3, [13.0, 12.0, 12.0]), cut_cells="whole"), {})
    assert (dataset.piece_samples.values == ALL_SAMPLES).all()
    both = (4.0, 8.0)
    expected = {(x, y, z) for x in both for y in both for z in both} - {(4.0, 4.0, 4.0)}
    assert places_of_pieces(dataset) == expected


def test_overlapping_excavations_keep_both_claims():
    """Who mines an overlap is decided by the steps, later: the grid stores every excavation whole."""
    dataset = make_grid(grid_slice(block([4.0] * 3, [12.0] * 3), block([8.0] * 3, [16.0] * 3, "next")), {})
    assert max(Counter(map(tuple, dataset.piece_origin.values.tolist())).values()) == 2
    assert json.loads(dataset.attrs["excavation_volume_grid"]) == pytest.approx([512.0, 512.0])


def test_an_excavation_outside_the_domain_is_refused_and_one_partly_outside_is_cut(caplog):
    with pytest.raises(InputError, match=r"excavations\.stope: lies outside the domain"):
        make_grid(grid_slice(block([30.0] * 3, [32.0] * 3)), {})
    with caplog.at_level(logging.WARNING):
        dataset = make_grid(grid_slice(block([-4.0, 4.0, 4.0], [8.0, 12.0, 12.0])), {})
    assert "reaches beyond the domain" in caplog.text
    assert json.loads(dataset.attrs["excavation_volume_grid"]) == pytest.approx([512.0])


def test_a_solid_too_thin_to_be_seen_is_refused():
    """2 cm across a place between the samples of 4 m cells."""
    with pytest.raises(InputError, match="adds no volume"):
        make_grid(grid_slice(block([8.02, 8.0, 8.0], [8.04, 16.0, 16.0])), {})


def test_later_rock_bodies_win_and_only_refined_ones_shape_the_grid():
    seam = block([0.0, 0.0, 8.0], [24.0, 24.0, 16.0], "seam", refine=False)
    dike = block([8.0, 0.0, 0.0], [16.0, 24.0, 24.0], "dike", refine=False)
    dataset = make_grid(grid_slice(bodies=[seam, dike]), {})
    assert (dataset.cell_level == 0).all()
    center = dataset.cell_origin.values + 4.0
    in_dike, in_seam = np.abs(center[:, 0] - 12.0) < 4.0, np.abs(center[:, 2] - 12.0) < 4.0
    assert np.array_equal(dataset.cell_body, np.where(in_dike, 1, np.where(in_seam, 0, -1)))
    dike["refine"] = True
    dike["lower"], dike["upper"] = [7.0, 0.0, 0.0], [17.0, 24.0, 24.0]  # through cells, not between them
    refined = make_grid(grid_slice(bodies=[seam, dike], buffer_cells=0, levels=3), {})
    assert (refined.cell_level == 2).any()


def test_rock_that_no_cell_is_of_is_told(caplog):
    """A sheet between cell centres, and a body that a later one covers; one whose surface encloses nothing is
    refused, and the rock of its fault was left out without a word."""
    seam = block([0.0, 0.0, 8.0], [24.0, 24.0, 16.0], "seam", refine=False)
    sheet = block([5.0, 0.0, 0.0], [6.0, 24.0, 24.0], "sheet", refine=False)
    make_grid(grid_slice(bodies=[seam]), {})
    assert "rock_bodies" not in caplog.text
    make_grid(grid_slice(bodies=[sheet]), {})
    assert "rock_bodies.sheet: no cell has its centre in this rock, which counts only where a step" in caplog.text
    assert "refine: true gives it those of 4 m" in caplog.text
    make_grid(grid_slice(bodies=[seam, seam | {"name": "again"}]), {})
    assert "rock_bodies.seam: no cell" in caplog.text
    assert "rock_bodies.again" not in caplog.text


def test_a_rock_body_that_encloses_nothing_is_refused(tmp_path):
    outward = trimesh.creation.box(bounds=[[4.0] * 3, [20.0] * 3])
    inward = outward.copy()
    inward.invert()
    trimesh.util.concatenate([outward, inward]).export(tmp_path / "twice.stl")
    body = {"name": "fault", "file": str(tmp_path / "twice.stl"), "refine": False}
    with pytest.raises(InputError, match=r"^rock_bodies.fault: its surface encloses nothing"):
        make_grid(grid_slice(bodies=[body]), {})


@pytest.mark.parametrize(("plane", "beyond"), [("xz", 0.0), (None, 0.0), (None, 3.0)])
def test_what_a_solid_leaves_of_the_domain_is_mined(plane, beyond):
    """A disc or a cylinder of 9 m radius in 24 m, its ends at or beyond the faces: the rest is the excavation, to 1 %,
    in cells as fine as any excavation's, and with the ordinary cells of the cylinder it fills every cell."""
    across = [12.0, 12.0]
    if plane:
        shape = {"name": "rest", "shape": "circle", "center": across, "radius": 9.0}
    else:
        shape = {"name": "rest", "shape": "cylinder", "start": [12.0, -beyond, 12.0], "radius": 9.0}
        shape["end"] = [12.0, 24.0 + beyond, 12.0]
    inside = make_grid(grid_slice(shape, plane=plane, buffer_cells=0), {})
    outside = make_grid(grid_slice({**shape, "outside": True}, plane=plane, buffer_cells=0), {})
    thick = 1.0 if plane else 24.0
    expected = (24.0**2 - 81.0 * np.pi) * thick
    assert json.loads(outside.attrs["excavation_volume"]) == pytest.approx([expected], rel=1e-9)
    assert json.loads(outside.attrs["excavation_volume_grid"]) == pytest.approx([expected], rel=1e-2)
    gridded = [json.loads(grid.attrs["excavation_volume_grid"])[0] for grid in (inside, outside)]
    assert sum(gridded) == pytest.approx(24.0**2 * thick, rel=1e-2)  # less dropped slivers
    corner = (outside.cell_origin.values[:, [0, 2]] < 4.0).all(axis=1)
    assert (outside.cell_level.values[corner] == 1).all()


def test_a_body_outside_a_shape_is_all_the_rest():
    layer = block([0.0, 0.0, 8.0], [24.0, 24.0, 16.0], "walls", refine=False, outside=True)
    dataset = make_grid(grid_slice(bodies=[layer]), {})
    assert np.array_equal(dataset.cell_body == 0, np.abs(dataset.cell_origin.values[:, 2] + 4.0 - 12.0) > 4.0)


def test_a_shape_that_leaves_nothing_outside_is_refused():
    with pytest.raises(InputError, match="adds no volume"):
        make_grid(grid_slice(block([-1.0] * 3, [25.0] * 3, outside=True)), {})


def test_too_little_memory_is_said_before_anything_is_built(monkeypatch):
    monkeypatch.setattr(stage_memory, "usable", lambda: 10_000)
    with pytest.raises(InputError, match="GB of memory"):
        make_grid(grid_slice(block([4.0] * 3, [12.0] * 3)), {})


def test_too_little_memory_for_a_stage_is_said_before_it_starts(monkeypatch, tmp_path):
    """More particles to a cell than the grid counted with may be too many."""
    scene = make_scene(excavations=[excavation()], particles_per_cell=2)
    grid = make_dataset(scene, grid_around([ball([10.0] * 3, 3.0)], (5, 5, 5), 1, 4.0), [ball([10.0] * 3, 3.0)])
    needed = stage_bytes("explicit", 3, 125, 1000, elastic=True)
    monkeypatch.setattr(stage_memory, "usable", lambda: needed - 1.0)
    with pytest.raises(InputError, match=r"grid\.particles_per_cell"):
        elastic_stage(scene, grid, tmp_path / "state.npz")


def test_memory_that_a_process_holds_is_usable_by_it(monkeypatch):
    """A stage's peak is foreseen with what it holds when it asks: the grid, the state before."""
    held = psutil.Process().memory_info().rss
    monkeypatch.setattr(stage_memory, "free_memory", lambda: 1e9)
    assert usable() == pytest.approx(1e9 + held, rel=0.01)


@pytest.mark.parametrize(("plane", "dimension"), [(None, 3), ("xz", 2), ("xy", 2)])
def test_a_grid_comes_back_from_its_dataset_as_it_was(plane, dimension):
    """Origins that no binary fraction holds: integers come back equal, coordinates to their round-off."""
    shape = ball([7.3] * dimension, 1.0)
    grid = grid_around([shape], [3] * dimension, 3, 0.7, origin=[6.1, 5.9, 6.3][:dimension])
    scene = make_scene(plane, excavations=[excavation()])
    dataset = make_dataset(scene, grid, [shape])
    again, body = read_grid(dataset)
    for name in ("cell_index", "cell_level", "vtk_nodes", "node_index", "node_parents", "shape"):
        assert np.array_equal(getattr(again, name), getattr(grid, name)), name
    assert (again.fine_cell, again.levels) == (grid.fine_cell, grid.levels)
    assert np.array_equal(again.origin, grid.origin)
    volume = dataset.piece_volume.values
    edges = read_edge_nodes(dataset), read_edge_points(dataset)
    second = grid_dataset(again, body, read_pieces(dataset), volume, *edges, plane, {"mine": "test"})
    assert second.identical(dataset)


def test_a_grid_that_misses_an_excavation_by_a_fifth_is_refused_unless_allowed():
    """Whole cells of 4 m take a slot of 2.2 m for one of 4."""
    slot = block([8.0] * 3, [10.2, 16.0, 16.0])
    with pytest.raises(InputError, match=r"stope: 140\.8 m3 .* 256 m3 on the grid \(\+82 %\).*volume_error"):
        make_grid(grid_slice(slot, cut_cells="whole"), {})
    gridded = make_grid(grid_slice(slot, cut_cells="whole", volume_error=0.9), {})
    assert json.loads(gridded.attrs["excavation_volume"]) == pytest.approx([140.8])


@pytest.mark.parametrize(("plane", "facets"), [(None, 12), ("xz", 4)])
def test_the_grid_holds_the_surfaces_of_the_solids(plane, facets):
    """Of each excavation its facets, in the mine's coordinates; none of one that lies outside a solid."""
    dimension = 2 if plane else 3
    solids = [
        block([4.0] * dimension, [12.0] * dimension),
        block([1.0] * dimension, [23.0] * dimension, "around", outside=True),
        block([14.0] * dimension, [20.0] * dimension, "second"),
    ]
    dataset = make_grid(grid_slice(*solids, plane=plane), {})
    assert dataset.solid_excavation.values.tolist() == [0] * facets + [2] * facets
    for index, ends in ((0, [4.0, 12.0]), (2, [14.0, 20.0])):
        own = dataset.solid_position.values[dataset.solid_facets.values[dataset.solid_excavation.values == index]]
        axes = [0, 2] if plane else [0, 1, 2]
        assert np.unique(own[..., axes]).tolist() == ends
        assert plane is None or not own[..., 1].any()


def test_the_solid_s_volume_is_that_of_its_part_in_the_domain():
    dataset = make_grid(grid_slice(block([-4.0, 4.0, 4.0], [8.0, 12.0, 12.0])), {})
    assert json.loads(dataset.attrs["excavation_volume"]) == pytest.approx([512.0])


def turned_block(random, plane, corner, **more):
    """A block from a corner (d,) on, turned at random across the last axis."""
    angle, width, depth = random.uniform(0.0, 0.5 * np.pi), *random.uniform(4.0, 7.0, 2)
    along, across = np.array([np.cos(angle), np.sin(angle)]), np.array([-np.sin(angle), np.cos(angle)])
    sides = np.array([0 * along, width * along, width * along + depth * across, depth * across])
    outline = (corner[:2] + sides).tolist()
    if plane:
        return {"shape": "polygon", "points": outline} | more
    return {
        "shape": "prism",
        "polygon": outline,
        "lower": corner[2],
        "upper": corner[2] + random.uniform(4.0, 8.0),
    } | more


@pytest.mark.parametrize("plane", [None, "xz"])
@pytest.mark.parametrize("outside", [False, True])
def test_distorted_cells_amid_alike_ones_need_no_points(plane, outside, monkeypatch):
    """What all cells around say of one is what its own points say, of blocks turned at random beside each other."""
    own, skipped = grid_stage._are_amid_alike, 0
    for seed in range(3):
        random, alike, pieces = np.random.default_rng(seed), [], []
        one, other = (
            turned_block(random, plane, random.uniform(6.0, 9.0, 2 if plane else 3), name=name)
            for name in ("one", "other")
        )
        scene = grid_slice(one, other | {"outside": outside}, plane=plane, coarse_cell=4.0, levels=3, volume_error=1.0)
        for skip in (True, False):

            def counted(*given, skip=skip, alike=alike):
                alike.append(own(*given))
                return alike[-1] & skip

            monkeypatch.setattr(grid_stage, "_are_amid_alike", counted)
            pieces.append(read_pieces(make_grid(scene, {})))
        skipped += sum(map(np.sum, alike))
        for name in ("place", "excavation", "samples"):
            np.testing.assert_array_equal(*(getattr(parts, name) for parts in pieces))
    assert skipped > 0
