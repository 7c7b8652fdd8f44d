"""The surface of failed rock encloses the volume of the failed particles, whatever cells they are in."""

import numpy as np
import pytest
from mechanics.scenes import ball, excavation, grid_around, host_everywhere, make_dataset, make_scene, pieces_of
from mechanics.test_grid_stage import block, grid_slice

from export.failed_boxes import first_particles, is_failed, rock_samples
from export.failed_rock import failed_surface, failed_volume
from mpm_core.files.state_datasets import read_grid, state_dataset
from mpm_core.model.model import build_model
from mpm_core.model.occupancy import Unsupported
from mpm_core.stages.grid_stage import make_grid
from mpm_core.stages.ground import Ground


def dataset_of(model, step: int = 0):
    """A state of a model in which nothing has happened but mining, as its file has it."""
    state, count = model.virgin_state(), model.particles.count
    rating = np.ones(count), np.zeros(count)
    return state_dataset(
        model, state, model.material_volumes(step), rating, {}, {"step_index": step, "step": "2019-08"}
    )


def let_fail(state, seed: int, share: float):
    """Some particles of rock have failed, in runs, and one half of the scene more than the other."""
    generator = np.random.default_rng(seed)
    draw = generator.random(state.sizes["particle"]) + 0.3 * np.sin(state["position"].values[:, 0])
    state["failed"].values[:] = np.where(draw < share, 0, -1)
    return state


@pytest.mark.parametrize("cut_cells", ["mean", "whole", "subdivide"])
@pytest.mark.parametrize(("plane", "particles"), [(None, 1), (None, 2), (None, 3), ("xz", 1), ("xz", 2), ("xz", 3)])
def test_the_surface_encloses_the_volume_of_the_particles(cut_cells, plane, particles):
    """Cells of three levels, a cut void that is filled in part and mined again: any particles that fail."""
    dimension = 2 if plane else 3
    shapes = [ball([13.0] * dimension, 5.2), ball([17.0] * dimension, 4.1)]
    excavations = [excavation(fill="fill"), excavation(name="second")]
    scene = make_scene(plane, excavations=excavations, thickness=7.0, particles_per_cell=particles, cut_cells=cut_cells)
    grid = grid_around(shapes, [3] * dimension, 3, 10.0, origin=[-3.0] * dimension)
    first = make_dataset(scene, grid, shapes)
    model = build_model(scene, grid, host_everywhere(grid), pieces_of(grid, shapes))
    for seed, share in enumerate((0.02, 0.3, 0.9, 2.0)):
        state = let_fail(dataset_of(model), seed, share)
        surface = failed_surface(state, first, excavations)
        volume = failed_volume(state)
        assert surface.volume == pytest.approx(volume, rel=5e-3)
        assert volume > 0
        directed = {tuple(edge) for edge in surface.triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2).tolist()}
        assert all((end, start) in directed for start, end in directed)


@pytest.mark.parametrize("plane", [None, "xz"])
def test_cells_hold_the_rock_that_the_particles_have(plane):
    """What is rock in each cell by the samples is what its particles have by volume, also where rock has fallen."""
    dimension = 2 if plane else 3
    center = np.full(dimension, 12.0)

    def shell(points):
        return ball(center, 7.0)(points) & ~ball(center, 3.1)(points)

    scene = make_scene(plane, excavations=[excavation()])
    grid = grid_around([ball(center, 7.0)], [3] * dimension, 3, 8.0)
    first = make_dataset(scene, grid, [shell])
    model = build_model(scene, grid, host_everywhere(grid), pieces_of(grid, [shell]))
    state = dataset_of(model)
    assert state.sizes["loose"] > 0  # the middle falls
    samples = rock_samples(state, first, [excavation()], grid)
    rock = state["excavation"].values < 0
    volume = np.bincount(state["cell"].values[rock], state["volume"].values[rock], minlength=len(samples))
    np.testing.assert_allclose(np.bitwise_count(samples) / 64 * grid.cell_size**dimension, volume, rtol=1e-12)
    state["failed"].values[:] = 0
    assert failed_surface(state, first, [excavation()]).volume == pytest.approx(failed_volume(state), rel=1e-3)


@pytest.mark.parametrize("plane", [None, "xz"])
def test_cells_at_edges_that_nodes_were_moved_to(plane):
    """Rock around a block whose walls lie within cells: the surface is the block's own wall, to round-off."""
    dimension = 2 if plane else 3
    lower, upper = [9.5] * dimension, [17.5] * dimension
    values = grid_slice(block(lower, upper), plane=plane, levels=3)
    first = make_grid(values | {"later": []}, {})
    assert first.sizes["edge_node"] > 0
    scene = make_scene(plane, excavations=[excavation()])
    grid, body = read_grid(first)
    model = Ground.of(scene, first).model(grid, body, Unsupported.none())
    state = dataset_of(model)
    state["failed"].values[:] = 0
    surface = failed_surface(state, first, [excavation()])
    assert surface.volume == pytest.approx(failed_volume(state), rel=2e-3)
    size = np.prod(np.array(first.attrs["domain_upper"])[[0, 2] if plane else slice(None)] - 0.0)
    assert surface.volume == pytest.approx(size - 8.0**dimension, rel=5e-3)
    axes = [0, 2] if plane else [0, 1, 2]
    corner = np.linalg.norm(surface.vertices[:, axes] - lower, axis=1).min()
    assert corner < 1e-9


def test_rock_that_is_mined_later_has_failed_no_more():
    shape = ball([12.0] * 3, 4.0)
    scene = make_scene(excavations=[excavation()])
    grid = grid_around([shape], [3] * 3, 2, 8.0)
    first = make_dataset(scene, grid, [shape])
    model = build_model(scene, grid, host_everywhere(grid), pieces_of(grid, [shape]))
    state = dataset_of(model)
    state["failed"].values[np.linalg.norm(state["position"].values - 12.0, axis=1) < 3.0] = 0
    assert not is_failed(state).any()
    surface = failed_surface(state, first, [excavation()])
    assert surface.volume == 0.0
    assert not len(surface.triangles)


def test_particles_of_cells_are_counted_by_their_spacing():
    spacing = np.array([4.0, *[1.0] * 8, 2.0, *[1.0] * 8])
    np.testing.assert_array_equal(first_particles(spacing, np.array([4.0, 2.0, 2.0, 2.0]), 3), [0, 1, 9, 10, 18])
