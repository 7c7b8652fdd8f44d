"""Pictures of the report: beach balls, and the planes and outlines of its views."""

import itertools

import numpy as np
import pytest
import report_fixtures as fixtures
import xarray as xr
from hypothesis import given
from hypothesis import strategies as some

from catalogs.figures import beachballs, style, views
from catalogs.report.sections.scene import grid_levels
from common.source_tensors import moment_from_potency

SMALL = {"coarse": 16.0}  # 4 m in the finest of three levels: about 4,000 cells


DOUBLE_COUPLE = np.array(
    [[0, 1, 0], [1, 0, 0], [0, 0, 0]], float
)  # vertical fault; outward to north-east and south-west


def rotation(first: float, second: float, third: float) -> np.ndarray:
    """Product of rotations about z, x, z."""

    def about(axis: int, angle: float) -> np.ndarray:
        turned = np.eye(3)
        i, j = [(1, 2), (2, 0), (0, 1)][axis]
        turned[i, i] = turned[j, j] = np.cos(angle)
        turned[i, j], turned[j, i] = -np.sin(angle), np.sin(angle)
        return turned

    return about(2, first) @ about(0, second) @ about(2, third)


def shaded_share(tensor: np.ndarray) -> float:
    """Share of the lower hemisphere with outward first motion."""
    x, y, motion = beachballs.first_motion(tensor)
    return float((motion[np.hypot(x, y[:, None]) <= 1.0] > 0).mean())


@given(some.tuples(*[some.floats(0, 6.28)] * 3))
def test_half_of_any_double_couple_is_shaded(angles):
    """Its signs are antisymmetric under a quarter turn about B, so half of the sphere; 1 %: 201 samples across."""
    turn = rotation(*angles)
    assert shaded_share(turn @ DOUBLE_COUPLE @ turn.T) == pytest.approx(0.5, abs=0.01)


def test_explosion_is_full_and_implosion_empty():
    assert shaded_share(np.eye(3)) == 1.0
    assert shaded_share(-np.eye(3)) == 0.0


@pytest.mark.parametrize(("east", "north", "sign"), [(0.5, 0.5, 1), (-0.5, -0.5, 1), (-0.5, 0.5, -1), (0.5, -0.5, -1)])
def test_quadrants_of_a_strike_slip_source(east, north, sign):
    """Potency xy > 0 stretches along north-east: outward there and to the south-west, inward in the other two."""
    x, y, motion = beachballs.first_motion(DOUBLE_COUPLE)
    assert np.sign(motion[np.argmin(np.abs(y - north)), np.argmin(np.abs(x - east))]) == sign


def test_dip_of_a_thrust_shades_the_middle():
    """Shortening along x, extension along z: the middle of the ball, straight down, is dilated."""
    x, y, motion = beachballs.first_motion(np.diag([-1.0, 0.0, 1.0]))
    assert motion[len(y) // 2, len(x) // 2] > 0
    assert motion[len(y) // 2, -1] < 0


def test_tensile_crack_is_outward_all_round():
    """A crack opening along x, lambda = mu: M = mu diag(3, 1, 1), all outward; its deviator has nodal planes."""
    moment = moment_from_potency(np.diag([1.0, 0.0, 0.0])[None], 1.0, 1.0)[0]
    np.testing.assert_allclose(moment, np.diag([3.0, 1.0, 1.0]))
    assert shaded_share(moment) == 1.0


@given(some.floats(0.01, 0.99), some.floats(0, 6.28))
def test_projection_inverts_the_hemisphere(depth, azimuth):
    across = np.sqrt(1 - depth**2)
    vector = np.array([across * np.cos(azimuth), across * np.sin(azimuth), -depth])
    np.testing.assert_allclose(beachballs.lower_hemisphere(*beachballs.project(vector)), vector, atol=1e-9)
    np.testing.assert_allclose(beachballs.project(-vector), beachballs.project(vector), atol=1e-12)


# ---- views ----


def test_cuts_go_through_the_fullest_layer():
    """Two stopes of one height: the section along strike halves them, the plan lies within both."""
    grid = fixtures.make_grid(**SMALL)
    centre, volume = views.piece_centres(grid)
    stopes = np.isin(grid["piece_excavation"].values, [1, 2])
    cuts = {view.normal: view.at for view in views.cuts(grid, centre, volume * stopes)}
    lower, upper = fixtures.ORIGIN + fixtures.BOXES[1] * 96.0
    assert lower[1] < cuts[1] < upper[1]
    assert lower[2] < cuts[2] < upper[2]


def test_cut_cells_tile_the_domain():
    """The squares of the cells that a plane cuts fill the plane once: areas add up to the domain's."""
    grid = fixtures.make_grid(**SMALL)
    for view in views.cuts(grid, np.zeros((0, 3)), np.zeros(0)):
        size = grid["cell_size"].values[views.cut_cells(grid, view)]
        assert (size**2).sum() == pytest.approx(96.0**2)


@given(some.sets(some.tuples(some.integers(0, 5), some.integers(0, 5)), min_size=1))
def test_outline_of_squares_is_their_boundary(squares):
    """Against a slow count: an edge is outline if the square on its other side is absent."""
    expected = sum((x + dx, y + dy) not in squares for x, y in squares for dx, dy in ((1, 0), (-1, 0), (0, 1), (0, -1)))
    lower = np.array(sorted(squares), float) * 2.5 + 1e5
    assert len(views.outline_segments(lower, np.full(len(lower), 2.5))) == expected


def test_projection_keeps_the_larger_share():
    """A drive seen end on is as full as its fullest cell; no cell is drawn twice."""
    grid = fixtures.make_grid(**SMALL)
    lower, _, share = views.silhouette(grid, views.LOOKING_WEST, [0])
    assert len(np.unique(lower, axis=0)) == len(lower)
    drive = grid["piece_excavation"].values == 0
    assert share.max() == pytest.approx(grid["piece_fraction"].values[drive].max())


FAR = np.array([1e6, 5_400_000.3, -1_060.0])  # grid coordinates that are no whole number of cells


def moved(grid, by):
    """The same grid elsewhere."""
    grid = grid.copy(deep=True)
    for name in ("cell_origin", "piece_origin"):
        grid[name] = grid[name] + by - fixtures.ORIGIN
    for name in ("domain_lower", "domain_upper"):
        grid.attrs[name] = np.asarray(grid.attrs[name], float) + by - fixtures.ORIGIN
    return grid


def test_large_coordinates_are_whole_numbers_in_titles_and_on_axes():
    """Not 5.40005e+06 m, nor an offset; every number of an axis is within its panel, and none runs into the next."""
    grid = moved(fixtures.make_grid(**SMALL), FAR)
    with style.applied():
        figure = grid_levels(grid, views.cuts(grid, np.zeros((0, 3)), np.zeros(0)))
        figure.draw_without_rendering()
        renderer = figure.canvas.get_renderer()
        for axes in figure.axes:
            place = axes.title.get_text() or axes.get_title(loc="left")
            assert "e+" not in place
            assert "." not in place or "z =" in place
            assert axes.xaxis.get_offset_text().get_text() == ""
            low, high = axes.get_xlim()
            shown = [label for label in axes.get_xticklabels() if low <= label.get_position()[0] <= high]
            assert len(shown) >= 2
            assert all(float(label.get_text().replace("\N{MINUS SIGN}", "-")).is_integer() for label in shown)
            boxes = [label.get_window_extent(renderer) for label in shown]
            assert all(one.x1 < other.x0 for one, other in itertools.pairwise(boxes))
            assert boxes[-1].x1 <= figure.bbox.x1


def test_small_coordinates_keep_their_digits():
    """A cut through the middle of a cell of a metre."""
    assert views.View("Plan", 0, 1, 2, at=-1012.5).title == "Plan\nz = -1012.5 m"


def test_outlines_lie_on_the_cells_wherever_the_domain_begins():
    """Silhouettes were moved to multiples of half a cell: by up to a quarter of one beside the cells."""
    near = fixtures.make_grid(**SMALL)
    far = moved(near, FAR)
    for view in views.projections(near):
        expected, size, share = views.silhouette(near, view)
        found, far_size, far_share = views.silhouette(far, view)
        np.testing.assert_allclose(found - FAR[view.axes], expected - fixtures.ORIGIN[view.axes], atol=1e-6)
        np.testing.assert_allclose((far_size, far_share), (size, share))
        edges = len(views.outline_segments(expected, size))
        shift = np.array([0.125, 0.375]) * size.min()  # where a quarter of a cell rounds either way
        assert len(views.outline_segments(found + shift, far_size)) == edges


def test_rock_is_drawn_beside_a_cell_that_is_larger_than_its_cube():
    """A cell whose corner lies on an edge may hold more than its cube: the others are whole all the same."""
    state = xr.Dataset(
        {
            "position": (("particle", "xyz"), np.array([[0.5, 0.5, 0.5], [1.5, 0.5, 0.5], [2.5, 0.5, 0.5]])),
            "spacing": ("particle", np.ones(3)),
            "volume": ("particle", np.array([1.0, 2.4, 0.3])),
            "excavation": ("particle", np.full(3, -1)),
        },
        attrs={"plane": "none", "thickness": 1.0},
    )
    plan = views.View("Plan", 0, 1, 2, at=0.5)
    assert views.cut_particles(state, plan).tolist() == [0, 1]
