"""Bars of all steps, and the blocks in their colours."""

from itertools import pairwise

import numpy as np
import pytest
from matplotlib.colors import to_rgb
from matplotlib.patches import Rectangle

from catalogs.figures import style
from catalogs.figures.step_bars import FILLED, Bars, step_bars
from catalogs.figures.step_key import draw_steps, named_steps

COLOURS = {"Modelled": style.MODELLED, "Recorded": style.RECORDED}


def figure_of(count: int, recorded=True, potency=None):
    names, generator = (
        [f"{2020 + month // 12}-{month % 12 + 1:02d}" for month in range(count)],
        np.random.default_rng(1),
    )
    events = {label: generator.integers(0, 50, count) for label in COLOURS}
    potency = {label: 10 ** generator.normal(0, 2, count) for label in COLOURS} if potency is None else potency
    is_recorded = np.full(count, recorded)
    with style.applied():
        figure = step_bars(
            names, style.step_colours([True] * count), [Bars("events", events), Bars("potency (m³)", potency)], COLOURS,
            is_recorded,
        )  # fmt: skip
        figure.canvas.draw()
    return figure, names, [events, potency]


@pytest.mark.parametrize("count", [2, 3, 12, 60])
def test_every_step_has_its_bars_and_its_block(count):
    """Each bar as high as its value, in the colour of its catalogue, within the step; logarithmic where values differ
    much."""
    figure, names, quantities = figure_of(count)
    for axes, values, scale in zip(figure.axes, quantities, ("linear", "log"), strict=True):
        if scale == "log":
            assert axes.get_yscale() == "log"
        for number, (label, container) in enumerate(zip(COLOURS, axes.containers, strict=True)):
            assert [bar.get_height() for bar in container] == pytest.approx(values[label])
            assert {to_rgb(bar.get_facecolor()) for bar in container} == {to_rgb(COLOURS[label])}
            middle = np.arange(count) + 0.5 + (number - 0.5) * FILLED / 2
            assert [bar.get_x() + bar.get_width() / 2 for bar in container] == pytest.approx(middle)
        low, high = axes.get_ylim()
        shown = np.concatenate(list(values.values()))
        assert high > shown.max()
        assert low == 0 or low < shown[shown > 0].min()
    blocks = [artist for artist in figure.artists if isinstance(artist, Rectangle)]
    expected = [to_rgb(colour) for colour in style.step_colours([True] * count)]
    assert [to_rgb(block.get_facecolor()) for block in blocks] == expected
    named = [text.get_text() for text in figure.texts]
    assert named == names[:: names.index(named[1]) if len(named) > 1 else 1]
    assert len(named) == count or count > 12
    renderer = figure.canvas.get_renderer()
    edges = [text.get_window_extent(renderer) for text in figure.texts]
    assert all(one.x1 < other.x0 for one, other in pairwise(edges))


def test_steps_without_a_record_are_shaded_and_no_events_are_no_error():
    nothing = {label: np.zeros(3) for label in COLOURS}
    figure, _, _ = figure_of(3, recorded=False, potency=nothing)
    assert [text.get_text() for text in figure.legends[0].get_texts()] == ["Modelled", "Recorded", "no record"]
    assert len(figure.axes[1].patches) == 2 * 3 + 3
    assert figure.axes[1].get_ylim() == (0, 1)


def test_names_of_steps_are_letters_and_evenly_spaced():
    """No formula, whatever a name holds; a long one is cut."""
    figure = style.new_figure(8.0, 1.0, layout=None)
    draw_steps(figure, ["a $step_1$", "one of a very long name"], ["red", "blue"], 0.5, 0.5, 4.0)
    assert [text.get_text() for text in figure.texts] == ["a $step_1$", "one of a very…"]
    assert not any(text.get_parse_math() for text in figure.texts)
    assert named_steps(0.1, ["2020-01"] * 50, figure) == list(range(0, 50, 6))
