"""Names of bodies in a panel: where they may stand, and that none hides another."""

import numpy as np
import pytest
from matplotlib.transforms import Bbox

from catalogs.figures import style
from catalogs.figures.names import Named, bodies_named, write_names

SQUARE = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], float)


def panel(width: float = 6.0, height: float = 4.0):
    """Axes of so many inches, an inch for each unit."""
    figure = style.new_figure(width, height, layout=None)
    axes = figure.add_axes([0, 0, 1, 1])
    axes.set_xlim(0, width)
    axes.set_ylim(0, height)
    return axes


def boxes(axes) -> list[Bbox]:
    """Boxes of the names, pixels."""
    renderer = axes.figure.canvas.get_renderer()
    return [text.get_window_extent(renderer) for text in axes.texts]


def rectangle(left, bottom, width, height) -> list[np.ndarray]:
    return [np.array([left, bottom]) + SQUARE * [width, height]]


def test_names_of_many_bodies_lie_in_the_panel_and_on_no_other_name():
    """Forty bodies of all forms, side by side and over each other."""
    generator = np.random.default_rng(5)
    axes = panel()
    named = [
        Named(f"stope_{number}", rectangle(*generator.uniform([0, 0], [5, 3]), *generator.uniform(0.05, 1.0, 2)))
        for number in range(40)
    ]
    avoid = np.array([[0.0, 0.0], [120.0, 60.0]])
    written = write_names(axes, named, 7.0, [avoid])
    found = boxes(axes)
    assert len(written) == len(found) > 25
    for number, one in enumerate(found):
        assert one.x0 >= 0
        assert one.y0 >= 0
        assert one.x1 <= 6 * axes.figure.dpi
        assert one.y1 <= 4 * axes.figure.dpi
        assert not any(one.overlaps(other) for other in found[:number])
        assert not one.overlaps(Bbox(avoid))


@pytest.mark.parametrize(("width", "height", "turned"), [(1.5, 0.5, False), (0.25, 1.5, True)])
def test_a_name_is_written_into_its_body_upright_where_it_only_fits_so(width, height, turned):
    axes = panel()
    write_names(axes, [Named("stope_12", rectangle(2, 1, width, height))], 8.0)
    (text,), (box,) = axes.texts, boxes(axes)
    assert text.get_rotation() == (90 if turned else 0)
    body = axes.transData.transform([(2, 1), (2 + width, 1 + height)])
    assert (box.min >= body[0]).all()
    assert (box.max <= body[1]).all()
    assert not axes.lines


def test_a_name_beside_its_body_has_a_line_that_ends_in_it():
    axes = panel()
    small = rectangle(3, 2, 0.1, 0.1)
    assert write_names(axes, [Named("a long name of a stope", small)], 8.0) == ["a long name of a stope"]
    (line,) = axes.lines
    end = line.get_xydata()[1]
    assert ((end > [3, 2]) & (end < [3.1, 2.1])).all()
    assert write_names(panel(), [Named("name", small)], 8.0, most_beside=0) == []


def test_the_first_has_the_choice_and_covered_bodies_are_named_where_they_have_to_be():
    """Two drives one above the other: the lower one is not seen in plan."""
    curves = {0: rectangle(1, 1, 3, 0.5), 1: rectangle(1, 1, 3, 0.5), 2: rectangle(1, 2.5, 3, 0.5)}
    for order, seen in (([0, 1, 2], "upper"), ([1, 0, 2], "lower")):
        bodies = bodies_named({0: "lower", 1: "upper", 2: "other"}, order, curves)
        assert write_names(panel(), bodies, 8.0) == [seen, "other"]
        assert len(write_names(panel(), bodies, 8.0, if_covered=True)) == 3


def test_a_name_leaves_events_uncovered_where_it_can():
    axes = panel()
    dots = np.array([[3.0, 2.0], [3.1, 2.0]])
    write_names(axes, [Named("stope", rectangle(2, 1, 2, 2))], 8.0, points=dots)
    (box,) = boxes(axes)
    assert not any(box.contains(*dot) for dot in axes.transData.transform(dots))
