"""VTK files of a state and of the solids: what ParaView shows is what the dataset holds, by name and unit."""

import json
from xml.etree import ElementTree

import meshio
import numpy as np
import pytest

from mechanics.scenes import ball, excavation, grid_around, make_dataset, make_scene, uniform
from mechanics.test_grid_stage import block, grid_slice
from mpm_core.files.state_datasets import read_edge_nodes, read_grid, read_pieces
from mpm_core.files.state_vtk import main_excavation, principal, write_solids, write_vtu
from mpm_core.geometry import Outside, build_shape
from mpm_core.grid.adjacency import holding_cells
from mpm_core.model.occupancy import FinestPieces
from mpm_core.stages.equilibrium_stages import elastic_stage
from mpm_core.stages.grid_stage import make_grid

PARAVIEW = ("xx", "yy", "zz", "xy", "yz", "xz")  # what ParaView calls the components of an array of six


@pytest.fixture(params=[(None, 3), ("xz", 2)], ids=["solid", "section"])
def stage(request, tmp_path):
    """A void in rock under six different stresses, its dataset, its state and the file of it."""
    plane, dimension = request.param
    shape = ball([12.0] * dimension, 4.5)
    stress = uniform(-1e6, -2e6, -4e6, 0.0 if plane else 3e5, 2e5, 0.0 if plane else 1e5)
    scene = make_scene(plane, stress=stress, excavations=[excavation()], thickness=5.0)
    dataset = make_dataset(scene, grid_around([shape], [3] * dimension, 2, 8.0), [shape])
    state, _ = elastic_stage(scene, dataset, tmp_path / "failed.npz")
    write_vtu(read_grid(state)[0], read_pieces(dataset), read_edge_nodes(dataset), state, tmp_path / "state.vtu")
    return dataset, state, meshio.read(tmp_path / "state.vtu")


def test_a_state_is_a_vtk_file_that_others_read(stage):
    """All cells, in the mine's frame; the solid share of a cell is 1 less what is mined, whatever the thickness."""
    dataset, state, mesh = stage
    grid, pieces = read_grid(dataset)[0], read_pieces(dataset)
    assert sum(len(block.data) for block in mesh.cells) == len(grid.cell_level)
    np.testing.assert_allclose(mesh.points, state.node_position.values)
    np.testing.assert_array_equal(mesh.point_data["displacement_m"], state.node_displacement.values)
    share = np.ones(len(grid.cell_level))
    share[holding_cells(grid, pieces.place)] -= np.bitwise_count(pieces.samples) / 64
    np.testing.assert_allclose(mesh.cell_data["solid_fraction"][0], share, rtol=1e-12)
    excavated = np.isin(np.arange(len(share)), holding_cells(grid, pieces.place))
    np.testing.assert_array_equal(mesh.cell_data["excavation"][0], np.where(excavated, 0, -1))


@pytest.mark.parametrize("plane", ["xz", None])
def test_cells_at_an_edge_are_drawn_as_they_are(plane, tmp_path):
    """Nodes lie on the edges, and a cell of rock is solid whatever its shape."""
    dimension = 2 if plane else 3
    values = grid_slice(block([9.5] * dimension, [17.5] * dimension), plane=plane, levels=3)
    dataset = make_grid(values | {"later": []}, {})
    scene = make_scene(plane, stress=uniform(-1e6, -1e6, -1e6), excavations=[excavation()])
    state, _ = elastic_stage(scene, dataset, tmp_path / "failed.npz")
    write_vtu(
        read_grid(state)[0], read_pieces(dataset), read_edge_nodes(dataset), state, tmp_path / "state.vtu"
    )  # fmt: skip
    mesh = meshio.read(tmp_path / "state.vtu")
    axes = [0, 2] if plane else [0, 1, 2]
    corner = np.linalg.norm(mesh.points[:, axes] - 9.5, axis=1)
    assert corner.min() < 1e-9
    solid = mesh.cell_data["solid_fraction"][0]
    assert solid.max() == pytest.approx(1.0, rel=1e-12)
    whole = len(solid) - len(np.unique(holding_cells(read_grid(state)[0], read_pieces(dataset).place)))
    assert (np.abs(solid - 1.0) < 1e-12).sum() >= whole


def test_cells_tell_their_material_and_what_share_of_them_it_takes(stage, tmp_path):
    """Rock of another material east of the middle, and a cell that holds nothing: numbers, shares by name, -1."""
    dataset, state, _ = stage
    grid = read_grid(state)[0]
    state = state.copy(deep=True)
    state.attrs["material_names"] = json.dumps(["host", "fill", "solid"])
    east = state.position.values[:, 0] > 12.0
    state.material.values[:] = np.where(east, 2, 0)
    state.volume.values[state.cell.values == 0] = 0.0
    write_vtu(grid, read_pieces(dataset), read_edge_nodes(dataset), state, tmp_path / "materials.vtu")
    cells = {name: values[0] for name, values in meshio.read(tmp_path / "materials.vtu").cell_data.items()}
    shares = np.stack([cells[f"fraction_of_{name}"] for name in ("host", "fill", "solid")])
    np.testing.assert_allclose(shares.sum(axis=0), cells["solid_fraction"], atol=1e-6)
    full = grid.cell_size**grid.dimension * state.attrs["thickness"]
    for index in range(3):
        own = (state.material.values == index) & (state.volume.values > 0)
        expected = np.zeros(len(full))
        for particle in np.flatnonzero(own):
            expected[state.cell.values[particle]] += state.volume.values[particle] / full[state.cell.values[particle]]
        np.testing.assert_allclose(shares[index], expected, atol=1e-6)
        assert set(cells["material"][expected > 0.5]) <= {index}
    assert cells["material"][0] == -1
    assert set(cells["material"][1:]) == {0, 2}


def test_stress_components_are_those_that_paraview_names(stage):
    """Its order of a symmetric tensor is not ours: yz would be called xy."""
    _, state, mesh = stage
    whole = np.flatnonzero(mesh.cell_data["solid_fraction"][0] == 1.0)
    particle = {cell: index for index, cell in enumerate(state.cell.values) if state.excavation.values[index] < 0}
    found = mesh.cell_data["stress_Pa"][0]
    for cell in whole[:: max(len(whole) // 20, 1)]:
        ours = dict(zip(("xx", "yy", "zz", "yz", "xz", "xy"), state.stress.values[particle[cell]], strict=True))
        assert found[cell] == pytest.approx([ours[name] for name in PARAVIEW])


def test_principal_stresses_rebuild_the_tensor(stage):
    """Most compressive first; sum of s n n, unit directions at right angles, none of them upward; nothing in a void."""
    _, _, mesh = stage
    cells = {name: values[0] for name, values in mesh.cell_data.items()}
    size = np.stack([cells[f"principal_stress_{number}_Pa"] for number in (1, 2, 3)], axis=1)
    direction = np.stack([cells[f"principal_direction_{number}"] for number in (1, 2, 3)], axis=1)
    tensor = np.einsum("ck,cki,ckj->cij", size, direction, direction)
    rebuilt = tensor[:, [0, 1, 2, 0, 1, 0], [0, 1, 2, 1, 2, 2]]
    np.testing.assert_allclose(rebuilt, cells["stress_Pa"], atol=1e-9 * np.abs(size).max())
    rock = cells["stress_Pa"].any(axis=1)
    assert (np.diff(size[rock], axis=1) >= 0).all()
    np.testing.assert_allclose(
        direction[rock] @ direction[rock].transpose(0, 2, 1), np.eye(3)[None] + 0 * tensor[rock], atol=1e-12
    )
    assert (direction[:, :, 2] <= 0).all()
    assert not direction[~rock].any()


def test_vertical_stress_is_the_first_principal_stress_straight_down():
    """A limit case by hand: 30 MPa down, 20 north, 10 east, and nothing."""
    size, direction = principal(np.array([[-10e6, -20e6, -30e6, 0, 0, 0], [0.0] * 6]))
    np.testing.assert_array_equal(size, [[-30e6, -20e6, -10e6], [0, 0, 0]])
    np.testing.assert_array_equal(direction[0, 0], [0, 0, -1])
    np.testing.assert_array_equal(np.abs(direction[0, 1:]), [[0, 1, 0], [1, 0, 0]])
    assert not direction[1].any()


def test_a_cell_belongs_to_the_excavation_that_takes_most_of_it():
    """Equal shares: the first of the configuration, in whichever order the pieces stand."""
    samples = np.array([0b1, 0b111, 0b11, 0b11, 0b11], np.uint64)
    grid = grid_around([], [5, 1], 1, 8.0)
    place = np.array([[2, 0], [2, 0], [0, 0], [0, 0], [3, 0]], np.int32)
    pieces = FinestPieces(place, np.array([0, 1, 2, 1, 2], np.int16), samples)
    along = np.argsort(grid.cell_index[:, 0])
    np.testing.assert_array_equal(main_excavation(pieces, grid)[along], [1, -1, 1, 2, -1])
    turned = FinestPieces(place[::-1], pieces.excavation[::-1], samples[::-1])
    np.testing.assert_array_equal(main_excavation(turned, grid)[along], [1, -1, 1, 2, -1])


def test_solids_are_files_with_names_and_the_step_that_mines_them(tmp_path):
    """Block by block as the configuration lists them; their surfaces where it has them; a body by its own surface."""
    drive = build_shape({"name": "drive", "shape": "box", "lower": [1e6, 2.0, 3.0], "upper": [1e6 + 4, 4.0, 9.0]}, 3)
    ball_ = build_shape({"name": "cavern", "shape": "sphere", "center": [9.0, 9.0, 9.0], "radius": 2.0}, 3)
    body = Outside(drive, np.zeros(3), np.full(3, 2e6))
    path = tmp_path / "vtk" / "solids.vtm"
    write_solids({"excavations": [drive, ball_], "rock_bodies": [body]}, None, [1, -1], path)
    blocks = ElementTree.parse(path).getroot().findall(".//Block")
    names = {block.get("name"): {one.get("name"): one.get("file") for one in block} for block in blocks}
    assert {group: list(files) for group, files in names.items()} == {
        "excavations": ["drive", "cavern"],
        "rock_bodies": ["drive"],
    }
    mesh = meshio.read(path.parent / names["excavations"]["cavern"])
    np.testing.assert_array_equal(mesh.points, ball_.vertices)
    assert set(mesh.cell_data["excavation"][0]) == {1}
    assert set(mesh.cell_data["mined_in_step"][0]) == {-1}
    mesh = meshio.read(path.parent / names["rock_bodies"]["drive"])
    np.testing.assert_array_equal(mesh.points[mesh.cells[0].data], drive.vertices[drive.facets])
    assert set(mesh.cell_data["rock_body"][0]) == {0}


def test_solids_of_a_section_are_outlines_in_its_plane(tmp_path):
    """x and z of the mine; no group where there is none."""
    circle = build_shape({"name": "drive", "shape": "circle", "center": [5.0, 7.0], "radius": 2.0}, 2)
    write_solids({"excavations": [circle], "rock_bodies": []}, "xz", [0], tmp_path / "solids.vtm")
    mesh = meshio.read(tmp_path / "solids/excavations/drive.vtu")
    assert mesh.cells[0].type == "line"
    np.testing.assert_array_equal(mesh.points[:, [0, 2]], circle.vertices)
    assert not mesh.points[:, 1].any()
    assert "rock_bodies" not in (tmp_path / "solids.vtm").read_text()
