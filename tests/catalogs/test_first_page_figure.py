"""The section that shows openings best, what it shows, and what the picture of the first page holds."""

import numpy as np
import pytest
import xarray as xr
from matplotlib.collections import PathCollection
from matplotlib.colors import to_rgb
from matplotlib.patches import Rectangle

from catalogs.figures import first_page_figure, style
from catalogs.figures.first_page_figure import Mined, box_of, frame, section_of
from catalogs.figures.silhouettes import PLAN, SECTIONS, cells_covered
from catalogs.figures.step_key import shortened

EDGE = 2.0
STEPS = ["a $step_1$ of a mine", *(f"2020-{month:02d}" for month in range(1, 13))]


def grid_of(cells: np.ndarray, fraction=1.0, owner=None) -> xr.Dataset:
    """A grid whose excavations take these cells (piece, 3), whole numbers of 2 m, from a domain of 400 m about 0."""
    count = len(cells)
    data = {
        "piece_origin": (("piece", "xyz"), EDGE * np.asarray(cells, float)),
        "piece_fraction": ("piece", np.broadcast_to(np.asarray(fraction, float), count)),
        "piece_excavation": ("piece", np.zeros(count, int) if owner is None else np.asarray(owner)),
    }
    corners = {"domain_lower": np.full(3, -200.0), "domain_upper": np.full(3, 200.0)}
    return xr.Dataset(data, attrs=corners | {"fine_cell": EDGE, "dimension": 3, "plane": ""})


def drive(azimuth: float, length: int = 60) -> np.ndarray:
    """Cells along a level line in this direction, degrees from north."""
    along = np.linspace(-length / 2, length / 2, 4 * length)
    direction = np.array([np.sin(np.radians(azimuth)), np.cos(np.radians(azimuth)), 0.0])
    return np.unique(np.floor(along[:, None] * direction).astype(int), axis=0)


def events_at(places, magnitudes) -> xr.Dataset:
    return xr.Dataset({"location": (("event", "xyz"), np.array(places, float)), "mw": ("event", np.array(magnitudes))})


@pytest.mark.parametrize(
    ("azimuth", "name"),
    [
        (90, "looking north"), (100, "looking north"), (0, "looking west"), (350, "looking west"),
        (45, "looking north-west"), (135, "looking north-east"), (60, "looking north-west"),
    ],
)  # fmt: skip
def test_the_section_is_along_the_openings(azimuth, name):
    """Across a drive it would show a dot. East, or what is nearer to it than west, is on the right."""
    section = section_of(grid_of(drive(azimuth)), [0])
    assert section.name.removeprefix("Section ") == name
    right, up = np.array(section.right), np.array(section.up)
    np.testing.assert_allclose([right @ right, up @ up, right @ up], [1, 1, 0], atol=1e-12)
    assert right[0] > 0 or (right[0] == 0 and right[1] == 1)
    facing = np.cross(up, right)
    words = {"north": (0, 1), "west": (-1, 0), "north-west": (-1, 1), "north-east": (1, 1)}
    seen = np.array(words[name.removeprefix("looking ")])
    np.testing.assert_allclose(facing[:2], seen / np.linalg.norm(seen), atol=1e-12)


def test_of_square_openings_the_section_is_along_an_axis():
    cells = np.stack(np.meshgrid(np.arange(9), np.arange(9), np.arange(3)), axis=-1).reshape(-1, 3)
    assert section_of(grid_of(cells), [0]) is SECTIONS[0]
    assert section_of(grid_of(cells), [5]) is SECTIONS[0]  # without any of its cells


def covered(lower: np.ndarray, size: np.ndarray, place: np.ndarray) -> np.ndarray:
    """Which places (place, 2) lie within one of these rectangles."""
    return ((place[:, None] >= lower - 1e-9) & (place[:, None] <= lower + size + 1e-9)).all(axis=2).any(axis=1)


@pytest.mark.parametrize("plane", [PLAN, *SECTIONS], ids=lambda plane: plane.name)
def test_the_silhouette_covers_the_projection_of_all_cells(plane):
    """Points of every cell are covered, and no rectangle lies where no cell is."""
    generator = np.random.default_rng(1)
    cells = np.unique(generator.integers(-8, 8, (60, 3)), axis=0)
    lower, size = cells_covered(plane, grid_of(cells), [0])
    inside = EDGE * (cells[:, None, :] + generator.random((len(cells), 30, 3))).reshape(-1, 3)
    assert covered(lower, size, plane.project(inside)).all()
    middle = plane.project(EDGE * (cells + 0.5))
    apart = np.abs((lower + size / 2)[:, None] - middle[None]).max(axis=2).min(axis=1)
    assert apart.max() < 1e-9


def test_cells_that_excavations_share_count_together_and_thin_openings_are_drawn():
    """Two of 30 % make 60 %; alone neither is drawn beside a full cell; a slot of 30 % throughout is."""
    cells = np.array([[0, 0, 0], [0, 0, 0], [5, 0, 0]])
    lower, _ = cells_covered(PLAN, grid_of(cells, [0.3, 0.3, 1.0], [0, 1, 2]), [0, 1, 2])
    assert len(lower) == 2
    assert len(cells_covered(PLAN, grid_of(cells[1:], [0.3, 1.0], [1, 2]), [1, 2])[0]) == 1
    assert len(cells_covered(PLAN, grid_of(drive(0), 0.3), [0])[0]) == len(drive(0))
    assert len(cells_covered(PLAN, grid_of(drive(0)), [7])[0]) == 0


def test_the_frame_holds_openings_and_near_events_and_no_far_ones():
    """The drive is 122 m long: an event 100 m beside it is within its reach, one 150 m beside it is not."""
    grid = grid_of(drive(90))
    low, high = box_of(grid, [0])
    assert (high - low).max() == pytest.approx(122.0, abs=2.1)
    near, far = np.array([[0.0, 100.0, 0.0]]), np.array([[0.0, -150.0, 0.0]])
    lower, upper = frame(grid, [0], [near, far])
    assert (lower < np.minimum(low, near[0])).all()
    assert (upper > np.maximum(high, near[0])).all()
    assert lower[1] > far[0, 1]
    lower, upper = frame(grid, [4], [near])  # no such openings: the whole domain
    assert (lower.tolist(), upper.tolist()) == ([-200.0] * 3, [200.0] * 3)


def drawn(azimuth: float, catalogues: int = 2):
    """The figure of a drive, a planned one and three events of each catalogue."""
    cells = np.concatenate([drive(azimuth), drive(azimuth) + np.array([0, 0, 8])])
    grid = grid_of(cells, owner=np.repeat([0, 1], len(cells) // 2))
    places = [[[0, 0, 5], [10, 10, 0], [-20, 5, 9]], [[5, 5, 5], [0, 12, 1], [1, 2, 3]]]
    largest = {
        label: (colour, events_at(place, [2.0, 1.0, -0.5]))
        for label, colour, place in zip(("Modelled", "Recorded"), (style.MODELLED, style.RECORDED), places, strict=True)
    }
    openings = [Mined("planned", (1.0, 1.0, 1.0), [1], is_step=False)]
    openings += [Mined(name, (0.2, 0.5, 0.4), [0][number:]) for number, name in enumerate(STEPS)]
    with style.applied():
        shown = dict(list(largest.items())[:catalogues])
        figure = first_page_figure.first_page(grid, openings, [0], [1], shown, {0: "drive", 1: "planned drive"})
        figure.canvas.draw()
    return figure, largest


def circles_of(axes) -> list[PathCollection]:
    """The events of each catalogue."""
    return [one for one in axes.collections if isinstance(one, PathCollection) and len(one.get_offsets()) == 3]


def test_every_step_is_in_the_key_and_openings_are_named():
    """Thirteen steps, one of which mines; the names of two openings in both panels."""
    figure, _ = drawn(90)
    assert len([one for one in figure.artists if isinstance(one, Rectangle)]) == len(STEPS)
    assert [text.get_text() for text in figure.texts] == [shortened(name) for name in STEPS][::2]
    assert figure.legends[0].get_texts()[0].get_text() == "planned"
    for axes in figure.axes:
        assert {"drive", "planned drive"} <= {text.get_text() for text in axes.texts}


@pytest.mark.parametrize("azimuth", [90, 0, 45])
def test_plan_and_section_have_one_scale_and_lie_within_the_picture(azimuth):
    """North up and east to the right in the plan; elevation up in the section. Beside or above each other."""
    figure, largest = drawn(azimuth)
    assert figure.get_figwidth() == first_page_figure.WIDTH
    assert figure.get_figheight() <= first_page_figure.HEIGHT + 1e-9
    scales, boxes = [], []
    for axes in figure.axes:
        (left, right), (bottom, top), box = axes.get_xlim(), axes.get_ylim(), axes.get_position()
        scales += [
            box.width * figure.get_figwidth() / (right - left),
            box.height * figure.get_figheight() / (top - bottom),
        ]
        boxes.append((box.x0, box.y0, box.x1, box.y1))
        assert min(box.x0, box.y0) > 0
        assert max(box.x1, box.y1) < 1
    np.testing.assert_allclose(scales, scales[0], rtol=1e-6)
    assert boxes[0][2] < boxes[1][0] or boxes[0][1] > boxes[1][3]
    plan, section = figure.axes
    assert [plan.get_xlabel(), plan.get_ylabel(), section.get_ylabel()] == [
        "east x (m)",
        "north y (m)",
        "elevation z (m)",
    ]
    for number, (_, events) in enumerate(largest.values()):
        circles = circles_of(plan)[number]
        np.testing.assert_allclose(circles.get_offsets(), events["location"].values[:, :2])


def test_circles_grow_with_magnitude_full_for_the_model_and_hollow_for_the_record():
    figure, _ = drawn(90)
    model, record = circles_of(figure.axes[0])
    for circles in (model, record):
        sizes = np.sqrt(circles.get_sizes())
        assert sizes.tolist() == sorted(sizes, reverse=True)
        assert [sizes[0], sizes[2]] == pytest.approx([first_page_figure.LARGEST, first_page_figure.SMALLEST])
    assert tuple(model.get_facecolors()[0, :3]) == pytest.approx(to_rgb(style.MODELLED))
    assert not len(record.get_facecolors())
    texts = [text.get_text() for text in figure.legends[0].get_texts()]
    assert texts[-4:] == ["Modelled", "Recorded", "Mw −0.5", "Mw 2.0"]


@pytest.mark.parametrize("length", [0.7, 1.0, 3.0, 49.0, 50.0, 12345.0])
def test_scale_bars_are_round(length):
    found = first_page_figure.round_below(length)
    assert found <= length < 2.5 * found
    assert f"{found:e}"[0] in "125"
    assert float(f"{found:.0e}") == pytest.approx(found)


def test_a_mine_in_a_plane_has_one_panel():
    grid = grid_of(drive(90)).assign_attrs(dimension=2, plane="xz")
    for plane, name in (("xz", "Section looking north"), ("xy", "Plan")):
        with style.applied():
            figure = first_page_figure.first_page(grid.assign_attrs(plane=plane), [], [0], [], {})
        assert [axes.get_title(loc="left") for axes in figure.axes] == [name]
    assert first_page_figure.plane_of(grid) is SECTIONS[0]
