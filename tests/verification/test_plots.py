"""The plots that figures of studies are made of."""

import numpy as np
import pytest

from catalogs.figures import style
from verification.plots import BAR, plot_cells, plot_convergence, plot_errors, plot_section, plot_series


@pytest.fixture
def axes():
    return style.new_figure().subplots()


def test_a_closed_form_has_the_colour_of_its_series(axes):
    plot_series(axes, {"a": ([1, 2], [3, 4])}, {"a": ([1, 2], [3, 4]), "theory": ([1, 2], [0, 0])}, notes={"a": "xy"})
    points, own, other = axes.lines
    assert points.get_color() == own.get_color() != other.get_color()
    assert [text.get_text() for text in axes.get_legend().get_texts()] == ["a", "theory"]
    assert [text.get_text() for text in axes.texts] == ["x", "y"]


def test_the_dotted_line_has_its_order(axes):
    """Below all errors, one of which is not known."""
    plot_convergence(axes, {"a": ([4, 2, 1], [16.0, np.nan, 1.0])}, 2.0)
    x, y = axes.lines[-1].get_data()
    np.testing.assert_allclose(y, 0.5 * x**2)


def test_values_stand_at_their_names(axes):
    plot_errors(axes, ["one", "two"], {"each": [[1.0, 3.0], []], "mean": [2.0, 5.0]}, truth=2.0, marks="o" + BAR)
    assert [label.get_text() for label in axes.get_yticklabels()] == ["one", "two"]
    each, mean = (line for line in axes.lines if line.get_linestyle() == "None")
    assert each.get_xydata().tolist() == [[1.0, 0.0], [3.0, 0.0]]
    assert mean.get_xydata().tolist() == [[2.0, 0.0], [5.0, 1.0]]


def test_sections_show_the_nearest_particle_and_cells_their_squares(axes):
    place = np.array([[-0.5, -0.5], [0.5, -0.5], [-0.5, 0.5], [0.5, 0.5]])
    image = plot_section(axes, place, np.arange(4.0), (-1.0, 1.0), void=0.2).get_array()
    assert [image[i, j] for i in (10, -10) for j in (10, -10)] == [0.0, 1.0, 2.0, 3.0]
    assert np.ma.getmaskarray(image)[120, 120]
    drawn = plot_cells(axes, np.array([[2.0, 3.0]]), np.array([4.0]), np.ones(1))
    assert drawn.get_paths()[0].get_extents().bounds == (2.0, 3.0, 4.0, 4.0)
