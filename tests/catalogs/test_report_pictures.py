"""Pictures of the report: numbers by hand, places by the eye's rules."""

from types import SimpleNamespace

import numpy as np
import pytest
import report_fixtures as fixtures
import xarray as xr
from matplotlib import dates
from step_fixtures import events_of, step

from catalogs.figures import events_figure, panels, style, views
from catalogs.report.sections import events, rock, sizes
from catalogs.report.sections.axes import insitu_axes
from catalogs.settings import InsituStress


def test_insitu_axes_are_those_at_the_depth_of_the_events():
    """East most compressed at the surface, north 50 m below it; potency decides where between events that is."""
    stress = InsituStress(constant=(-3.0, -1.0, -2.0, 0, 0, 0), gradient=(0, -0.1, 0, 0, 0, 0), surface=100.0)
    catalog = events_of([1e-9, 1.0])
    catalog["location"].values[:, 2] = [100.0, 50.0]
    axes = insitu_axes(SimpleNamespace(insitu=stress, resolved=catalog))
    np.testing.assert_allclose(np.abs(axes), [[0, 1, 0], [1, 0, 0], [0, 0, 1]], atol=1e-9)
    shallow = insitu_axes(SimpleNamespace(insitu=stress, resolved=catalog.isel(event=[0])))
    np.testing.assert_allclose(np.abs(shallow), [[1, 0, 0], [0, 0, 1], [0, 1, 0]], atol=1e-9)
    assert insitu_axes(SimpleNamespace(insitu=None, resolved=catalog)) is None


def test_record_in_time_adds_up_what_counts():
    """Cumulative potency ends at the sum above the cut; the model's stands at the end of its step."""
    generator = np.random.default_rng(0)
    recorded = events_of(10 ** generator.uniform(-3, -1, 300), days=generator.uniform(0, 59, 300))
    model = events_of([0.5, 0.25, 1e-4], ["a", "b", "b"])
    with style.applied():
        figure = events.in_time(recorded, model, [step("a", 0.0, 1), step("b", 0.0, 2)], "Recorded", -2.0)
    below = figure.axes[1]
    ends = {line.get_label(): line.get_xydata()[-1] for line in below.get_lines()}
    potency = recorded["potency"].values
    assert ends["Recorded"][1] == pytest.approx(potency[potency >= 1e-2].sum())
    assert ends["Modelled, by step"].tolist() == [dates.date2num(np.datetime64("2019-03-01")), 0.75]
    assert events.in_time(events_of([]), model, [], "Recorded", -2.0) is None


def test_completeness_in_time_follows_a_network_that_gets_better():
    """200 events from log P -2 on, then 200 from -3 on: fullest bins of exact power laws lie at their lower ends."""
    generator = np.random.default_rng(0)
    sizes = [start + generator.exponential(0.3, 200) for start in (-2.0, -3.0)]
    middle, fullest = events.completeness(np.arange(400.0), np.concatenate(sizes))
    assert np.all(np.abs(fullest[middle < 140] + 2.0) <= 0.3)
    assert np.all(np.abs(fullest[middle > 260] + 3.0) <= 0.3)


def test_very_many_events_are_counted_per_square():
    grid = fixtures.make_grid(**{"coarse": 16.0})
    place = np.tile(grid["cell_origin"].values.mean(axis=0), (events_figure.MAX_EVENTS_DRAWN_SINGLY + 1, 1))
    catalog = events_of(np.ones(len(place))).assign(location=(("event", "xyz"), place))
    lower, upper = views.domain(grid)
    with style.applied():
        figure = style.new_figure()
        axes = figure.subplots()
        events_figure.draw_density(figure, axes, catalog, views.PLAN, lower, upper)
    (mesh,) = [artist for artist in axes.collections if artist.get_array() is not None]
    assert events_figure.is_crowd(catalog)
    assert not events_figure.is_crowd(catalog.isel(event=slice(events_figure.MAX_EVENTS_DRAWN_SINGLY)))
    assert np.nansum(mesh.get_array()) == events_figure.MAX_EVENTS_DRAWN_SINGLY + 1
    assert np.isfinite(mesh.get_array()).sum() == 1


@pytest.mark.parametrize(("east", "north"), [(30.0, 200.0), (200.0, 30.0)])
def test_the_plan_has_north_up_and_equal_scales(east, north):
    """East to the right, north up, whichever way the mine reaches."""
    lower, upper = np.zeros(3), np.array([east, north, 40.0])
    grid = xr.Dataset(attrs={"dimension": 3})
    with style.applied():
        figure, array, _ = panels.panels(views.projections(grid), lower, upper)
        figure.canvas.draw()
    axes = array[2]
    assert [axes.get_xlabel(), axes.get_ylabel()] == ["east x (m)", "north y (m)" if north > 100 else "y (m)"]
    scales = []
    for one in array:
        (left, right), (bottom, top) = one.get_xlim(), one.get_ylim()
        box = one.get_position()
        scales += [box.width * figure.get_figwidth() / (right - left)]
        scales += [box.height * figure.get_figheight() / (top - bottom)]
    assert min(scales) > 0.0
    np.testing.assert_allclose(scales, scales[0], rtol=1e-6)


@pytest.mark.parametrize(
    ("days", "title"),
    [(0.3, "01 Feb 2020"), (2.0, "Feb 2020"), (10.0, "Feb 2020"), (92.0, "2020"), (800.0, "2020 to 2022")],
)
def test_marks_of_time_can_be_told_apart(days, title):
    """Two days read "02 Feb" twice. What the marks leave out stands above them."""
    scale = events_figure.Scale((-2.0, 0.0), (18293.25, 18293.25 + days))
    with style.applied():
        figure = style.new_figure(layout=None)
        bar = figure.add_axes([0.4, 0.3, 0.05, 0.6])
        events_figure._keys(figure, bar, scale, hollow=False)
        figure.canvas.draw()
        low, high = bar.get_ylim()
        marks = [mark.get_text() for mark in bar.get_yticklabels() if low <= mark.get_position()[1] <= high]
    assert len(marks) >= 2
    assert all(marks[index] != marks[index + 1] for index in range(len(marks) - 1))
    assert bar.get_title(loc="left") == title


def test_panels_of_sizes_hold_the_counts_of_both():
    """The second catalogue has a hundred times the events of the first."""
    generator, catalogs = np.random.default_rng(0), []
    for count in (40, 4000):
        size = generator.exponential(0.5, count)
        catalogs.append(sizes.Sizes("", "k", size, 0.9, (0.8, 1.0), np.log10(count), 0.0, np.zeros((3, 0))))
    with style.applied():
        figure = sizes.potency_frequency(catalogs)
    for axes, count in zip(figure.axes, (40, 4000), strict=True):
        low, high = axes.get_ylim()
        assert low <= 1.0
        assert count <= high


def test_rock_above_strength_in_coarse_cells_is_not_shown_as_rock_that_fails_next():
    """Every coarse cell above strength, and no fine one, has its own colour."""
    grid = fixtures.make_grid(**{"coarse": 16.0})
    state = fixtures.make_state(grid, 2)
    state["failed"][:] = -1
    state["excavation"][:] = -1
    state["volume"][:] = grid["cell_size"].values ** 3
    state["strength_factor"][:] = 0.9
    with style.applied():
        cuts = views.cuts(grid, state["position"].values, np.ones(grid.sizes["cell"]))[:1]
        figure = rock.strength_factor(grid, state, cuts, [])
    colour = np.array(style.mpl.colors.to_rgb(rock.TOO_COARSE))
    drawn = [
        one
        for one in figure.axes[0].collections
        if one.get_array() is None and len(one.get_facecolors()) and np.allclose(one.get_facecolors()[0, :3], colour)
    ]
    cells = views.cut_cells(grid, cuts[0])
    coarse = grid["cell_size"].values[cells] > grid["cell_size"].values.min()
    assert sum(len(one.get_paths()) for one in drawn) == coarse.sum() > 0
