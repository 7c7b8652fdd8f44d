"""The section of events: in space, in time and against the face."""

from types import SimpleNamespace
from unittest import mock

import numpy as np
import pytest
import report_fixtures as fixtures
import xarray as xr
from catalog_fixtures import made_up_catalog
from matplotlib import dates
from matplotlib.collections import PathCollection
from report_fixtures import make_page
from step_fixtures import events_of, step

from catalogs.compare.comparison import compare
from catalogs.figures import events_figure, panels, style, views
from catalogs.report import verdict
from catalogs.report.gallery import Gallery
from catalogs.report.sections import events
from catalogs.report.text import number
from common.datasets import read_dataset, write_dataset


def test_undated_events_are_drawn(mine):
    """A record may lack times: the picture shows its events in grey instead of failing."""
    record = read_dataset(mine.record)
    record["time"].values[:] = np.datetime64("NaT")
    with style.applied():
        everything = {"Recorded": np.ones(record.sizes["event"], bool)}
        figure = events_figure.locations(read_dataset(mine.grid), {"Recorded": record}, everything, [])
    assert [axes.get_title(loc="left").split("\n")[0] for axes in figure.axes[:3]] == ["Recorded"] * 3


def test_pictures_show_the_events_that_the_numbers_are_of(mine, tmp_path):
    """A cut above half of the events: so many circles are full and so many dots on nets as the numbers count; the other
    circles are hollow, and every caption says how many."""
    catalog, record = read_dataset(mine.catalog), read_dataset(mine.record)
    catalog.attrs["potency_floor"] = float(np.median(catalog["potency"].values))
    write_dataset(catalog, tmp_path / "catalog.nc")
    comparison = compare(catalog, record, {"resamplings": 99})
    write_dataset(comparison, tmp_path / "comparison.nc")
    counts = comparison["events_above_cut"].values
    resolved = int(comparison["events_resolved"].values[0])
    assert 0 < counts[0] < resolved
    assert 0 < counts[1] < record.sizes["event"]
    drawn = {}

    def keep(gallery, name, figure):
        drawn[name] = figure
        return {"name": f"{name}.svg", "uri": "", "width": "1"}

    changed = {name: tmp_path / f"{name}.nc" for name in ("catalog", "comparison")}
    with mock.patch.object(Gallery, "add", keep):
        content = make_page(mine, tmp_path, **changed)
    totals = (resolved, record.sizes["event"])
    for index in (0, 1):  # modelled and recorded, side by side
        hollow, full = (one for one in drawn["events"].axes[index].collections if isinstance(one, PathCollection))
        assert len(full.get_offsets()) == counts[index]
        assert len(hollow.get_offsets()) == totals[index] - counts[index]
        assert not len(hollow.get_facecolors())
    titles = [title for panel in drawn["stereonets"].axes if (title := panel.get_title(loc="left"))]
    assert titles[::3] == [f"Modelled: {counts[0]} P", f"Recorded (twin): {counts[1]} P"]
    dots = [one.get_offsets() for panel in drawn["source_types"].axes for one in panel.collections]
    assert [len(one) for one in dots] == counts.tolist()
    said = f"{counts[0]} of {resolved} modelled and {counts[1]} of {totals[1]} recorded (twin) events are compared"
    assert said in content.sections["events"]
    assert said in content.sections["axes"]
    assert "moves each at random by the record's location error, 5.00 m" in content.sections["events"]


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


def evidence_of_face(**counts) -> SimpleNamespace:
    """A comparison of a mine whose face advances east over the synthetic mine, or of one without a face."""
    catalog, record = made_up_catalog(200), made_up_catalog(200, 1, "twin")
    for one in (catalog, record):
        one.attrs["location_error"] = 5.0
    face = [
        {"date": "2019-08-01", "ends": [[-100.0, -50.0], [-100.0, 50.0]]},
        {"date": counts.get("until", "2019-10-01"), "ends": [[10.0, -50.0], [10.0, 50.0]]},
    ]
    steps = [{"name": "2019-08", "start": "2019-08-01", "end": "2019-10-01"}]
    asked = {"resamplings": 99, "steps": steps, **({"face": face} if counts.get("face", True) else {})}
    comparison = compare(catalog, record, asked)
    return SimpleNamespace(comparison=comparison, record_label="Recorded (twin)", is_twin=True)


def test_places_against_the_face_are_a_figure_and_a_table_and_say_what_is_out_of_reach():
    """A value in its row; a model that ran once has no interval, and it is said why."""
    evidence, figures = evidence_of_face(), []
    shown = events._against_face(evidence, SimpleNamespace(add=lambda name, figure: figures.append((name, figure))))
    assert [name for name, _ in figures] == ["face"]
    assert len(figures[0][1].axes) == 4
    rows = {(row["name"], row["weight"]): row["cells"] for row in shown["rows"]}
    value = evidence.comparison["face_measure"].sel(catalogue="record", weight="potency", measure="median ahead")
    assert rows["median distance ahead of the face (m)", "potency"][1].startswith(number(float(value)))
    assert all("(" in recorded and "(" not in modelled for modelled, recorded in rows.values())
    assert "fewer than three of its runs" in shown["text"]
    assert "5 % of them lie anywhere" in shown["text"].replace("5.0 %", "5 %")
    assert "drifts along a panel" in shown["text"]


def test_without_a_face_there_is_nothing_and_with_one_that_ends_early_it_is_said():
    """No figure is made."""
    assert events._against_face(evidence_of_face(face=False), None) is None
    shown = events._against_face(evidence_of_face(until="2019-09-30"), None)
    assert shown["figure"] is None
    assert "no event of the model that counts" in shown["text"]


def test_the_first_page_says_how_far_events_are_from_the_face():
    """Behind and ahead in words, with the interval of either that is known; the test of places gives the verdict."""
    evidence = evidence_of_face()
    (sentence,) = verdict._against_face(evidence)
    measure = evidence.comparison["face_measure"].sel(weight="number", measure="median ahead").values
    side = ["behind" if ahead < 0 else "ahead of" for ahead in measure]
    assert f"{number(abs(measure[0]), 2)} m {side[0]} the face, that of recorded events " in sentence
    assert f"{number(abs(measure[1]), 2)} m {side[1]} the face (95 %: " in sentence
    assert sentence.endswith(" the face).")
    moved = evidence.comparison.copy(deep=True)
    moved["face_measure"].loc[{"catalogue": "model"}] += 500.0
    (sentence,) = verdict._against_face(SimpleNamespace(comparison=moved))
    assert "m ahead of the face, that of" in sentence
    assert verdict._against_face(evidence_of_face(face=False)) == []
    assert verdict._against_face(evidence_of_face(until="2019-09-30")) == []
