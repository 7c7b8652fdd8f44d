"""Outlines of solids as they are seen along a direction, and which opening hides which."""

import numpy as np
import pytest
import xarray as xr
from matplotlib.figure import Figure
from scipy.spatial import Delaunay
from trimesh.creation import icosphere

from catalogs.figures.silhouettes import MAX_FACETS, PIXELS, PLAN, SECTIONS, Plane, Silhouettes, draw, drawing_order

BOX_FACETS = np.array(
    [
        [0, 2, 1], [0, 3, 2], [4, 5, 6], [4, 6, 7], [0, 1, 5], [0, 5, 4], [1, 2, 6], [1, 6, 5], [2, 3, 7], [2, 7, 6],
        [3, 0, 4], [3, 4, 7],
    ]
)  # fmt: skip
CORNERS = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]], float)


def box(lower, upper) -> tuple[np.ndarray, np.ndarray]:
    """Vertices and facets of a box."""
    lower, upper = np.array(lower, float), np.array(upper, float)
    return lower + CORNERS * (upper - lower), BOX_FACETS


def grid_of(*solids, pieces=None, edge: float = 1.0) -> xr.Dataset:
    """A grid with these surfaces (vertices, facets); pieces: (excavation, cell, samples) of each part of a cell."""
    starts = np.cumsum([0] + [len(vertices) for vertices, _ in solids])
    pieces = pieces or []
    data = {
        "solid_position": (("solid_vertex", "xyz"), np.concatenate([vertices for vertices, _ in solids])),
        "solid_facets": (
            ("solid_facet", "corner"),
            np.concatenate([facets + start for (_, facets), start in zip(solids, starts, strict=False)]),
        ),
        "solid_excavation": ("solid_facet", np.repeat(np.arange(len(solids)), [len(facets) for _, facets in solids])),
        "piece_origin": (("piece", "xyz"), edge * np.array([cell for _, cell, _ in pieces], float).reshape(-1, 3)),
        "piece_excavation": ("piece", np.array([owner for owner, _, _ in pieces], np.int16)),
        "piece_samples": ("piece", np.array([samples for *_, samples in pieces], np.uint64)),
    }
    corners = {"domain_lower": np.full(3, -50.0), "domain_upper": np.full(3, 50.0)}
    return xr.Dataset(data, attrs=corners | {"fine_cell": edge, "dimension": 3, "plane": "none"})


def winding(curves: list[np.ndarray], points: np.ndarray) -> np.ndarray:
    """How often closed curves wind around points (point, 2): (point,), whole numbers."""
    total = np.zeros(len(points))
    for curve in curves:
        away = curve[None] - points[:, None]
        angle = np.arctan2(away[..., 1], away[..., 0])
        turn = np.diff(np.concatenate([angle, angle[:, :1]], axis=1), axis=1)
        total += ((turn + np.pi) % (2 * np.pi) - np.pi).sum(axis=1)
    return np.rint(total / (2 * np.pi)).astype(int)


def in_a_triangle(plane: Plane, vertices, facets, points) -> np.ndarray:
    """True (point,) for points (point, 2) that a facet covers, as it is seen on a plane."""
    a, b, c = (plane.project(vertices[facets[:, corner]])[:, None] for corner in range(3))

    def side(p, q):
        return (q - p)[..., 0] * (points - p)[..., 1] - (q - p)[..., 1] * (points - p)[..., 0]

    signs = np.stack([side(a, b), side(b, c), side(c, a)])
    return ((signs > 0).all(axis=0) | (signs < 0).all(axis=0)).any(axis=0)


def ring() -> tuple[np.ndarray, np.ndarray]:
    """Four boxes around a square hole, as one surface: their common walls stay."""
    parts = [box(*ends) for ends in (
        ([0, 0, 0], [9, 3, 2]), ([0, 6, 0], [9, 9, 2]), ([0, 3, 0], [3, 6, 2]), ([6, 3, 0], [9, 6, 2]),
    )]  # fmt: skip
    return np.concatenate([vertices for vertices, _ in parts]), np.concatenate(
        [facets + 8 * number for number, (_, facets) in enumerate(parts)]
    )


@pytest.mark.parametrize("plane", [PLAN, *SECTIONS], ids=lambda plane: plane.name)
def test_what_the_curves_wind_round_is_what_the_facets_cover(plane):
    """A convex solid, one with a hole, one open at the top, and one whose corners are repeated as an STL file does."""
    generator = np.random.default_rng(3)
    vertices, facets = box([1.0, -2.0, 0.0], [6.0, 1.0, 9.0])
    vertices = vertices + generator.normal(0.0, 0.6, vertices.shape)
    soup = vertices[facets].reshape(-1, 3), np.arange(3 * len(facets)).reshape(-1, 3)
    for solid in ((vertices, facets), (vertices, facets[:2].tolist() + facets[4:].tolist()), ring(), soup):
        solid = solid[0], np.asarray(solid[1])
        curves = Silhouettes(grid_of(box([20, 20, 20], [21, 21, 21]), solid)).curves(plane, 1)
        seen = plane.project(solid[0])
        points = generator.uniform(seen.min(axis=0) - 1, seen.max(axis=0) + 1, (2000, 2))
        covered = in_a_triangle(plane, *solid, points)
        assert covered.any()
        assert not covered.all()
        np.testing.assert_array_equal(winding(curves, points) > 0, covered)


def test_the_silhouette_of_a_convex_solid_is_its_hull_and_a_few_edges():
    vertices, facets = box([0, 0, 0], [4, 2, 1])
    curves = Silhouettes(grid_of((vertices, facets))).curves(PLAN, 0)
    points = np.random.default_rng(1).uniform(-1, 5, (500, 2))
    hull = Delaunay(vertices[:, :2]).find_simplex(points) >= 0
    np.testing.assert_array_equal(winding(curves, points) > 0, hull)
    assert sum(map(len, curves)) == 8  # of floor and roof; no edge within


def test_a_solid_of_very_many_facets_has_few_curves_known_to_a_pixel():
    """A rough ball of 20,480 facets, thousands of which are folds: one curve, near its rim. A ring keeps its hole."""
    ball = icosphere(subdivisions=5)
    generator = np.random.default_rng(4)
    vertices = 50.0 * np.asarray(ball.vertices) + generator.normal(0, 0.3, ball.vertices.shape)
    (curve,) = Silhouettes(grid_of((vertices, np.asarray(ball.faces)))).curves(PLAN, 0)
    assert np.linalg.norm(curve, axis=1) == pytest.approx(50.0, abs=1.5)
    vertices, facets = ring()
    many = np.tile(facets, (MAX_FACETS // len(facets) + 1, 1))
    points = generator.uniform(-1, 10, (2000, 2))
    points = points[np.abs(points[..., None] - [0, 3, 6, 9]).min(axis=(1, 2)) > 2 * 9 / PIXELS]
    found = winding(Silhouettes(grid_of((vertices, many))).curves(PLAN, 0), points)
    np.testing.assert_array_equal(found > 0, in_a_triangle(PLAN, vertices, facets, points))
    assert set(found) == {0, 1}


def test_in_a_plane_the_segments_are_the_curves_and_a_hole_stays_free():
    """Outer square counter-clockwise, inner one clockwise, as segments in any order."""
    outer, inner = np.array([[0, 0], [9, 0], [9, 9], [0, 9]]), np.array([[3, 3], [3, 6], [6, 6], [6, 3]])
    place = np.zeros((8, 3))
    place[:, [0, 2]] = np.concatenate([outer, inner])
    around = np.stack([np.arange(4), np.roll(np.arange(4), -1)], axis=1)
    segments = np.random.default_rng(2).permutation(np.concatenate([around, around + 4]))
    grid = grid_of((place, segments)).assign_attrs(dimension=2, plane="xz")
    curves = Silhouettes(grid).curves(SECTIONS[0], 0)
    assert winding(curves, np.array([[1.0, 4.0], [4.5, 4.5], [10.0, 4.0]])).tolist() == [1, 0, 0]


def test_an_excavation_without_a_surface_is_its_cells():
    grid = grid_of(box([0, 0, 0], [1, 1, 1]), pieces=[(1, (4, 4, 4), 2**64 - 1)])
    grid["piece_fraction"] = "piece", np.ones(1)
    assert np.concatenate(Silhouettes(grid).curves(PLAN, 1)).tolist() == [[4, 4], [5, 4], [5, 5], [4, 5]]
    assert Silhouettes(grid).curves(PLAN, 2) == []
    assert Silhouettes(grid.drop_vars(["solid_facets", "solid_position", "solid_excavation"])).curves(PLAN, 0) == []


def test_what_is_mined_first_is_drawn_over_later_solids_that_overlap_it():
    """Pushbacks 0, 1 and 2 around one pit; 3 shares a cell with 2 and no point of it; 4 lies apart."""
    full, left, right = 2**64 - 1, 2**32 - 1, (2**32 - 1) << 32
    cells = [(0, (0, 0, 0), full), (1, (0, 0, 0), full), (1, (1, 0, 0), full)]
    cells += [(2, (1, 0, 0), full), (2, (2, 0, 0), left), (3, (2, 0, 0), right), (4, (9, 9, 9), full)]
    grid = grid_of(box([0, 0, 0], [1, 1, 1]), pieces=cells)
    assert drawing_order(grid, [0, 1, 2, 3, 4]) == [2, 1, 0, 3, 4]
    assert drawing_order(grid, [4, 3, 2, 1, 0]) == [4, 3, 0, 1, 2]  # mined in the other order
    assert drawing_order(grid, [3, 4]) == [3, 4]
    without = grid.isel(piece=slice(0, 0)).assign_attrs(excavation_overlaps="[[1, 2]]")  # as Mining.first_mined has it
    assert drawing_order(without, [0, 1, 2]) == [0, 2, 1]
    assert drawing_order(grid.drop_vars("piece_samples"), [0, 1, 2]) == [0, 1, 2]


def test_later_bodies_hide_earlier_ones_and_each_has_an_outline():
    """Pixels of a picture: the second square's colour over the first one's, and dark around both."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    figure = Figure(figsize=(1, 1), dpi=100)
    canvas = FigureCanvasAgg(figure)
    axes = figure.add_axes([0, 0, 1, 1])
    axes.axis("off")
    axes.set_xlim(0, 10)
    axes.set_ylim(0, 10)
    square = np.array([[1, 1], [6, 1], [6, 6], [1, 6]], float)
    draw(axes, [([square, square], (1.0, 0.0, 0.0)), ([square + 3], (0.0, 0.0, 1.0)), ([], (0.0, 1.0, 0.0))])
    canvas.draw()
    pixels = np.asarray(canvas.buffer_rgba())[::-1]
    assert pixels[20, 20, :3].tolist() == [255, 0, 0]
    assert pixels[50, 50, :3].tolist() == [0, 0, 255]
    assert pixels[8:11, 30, :3].max(axis=1).min() < 150
