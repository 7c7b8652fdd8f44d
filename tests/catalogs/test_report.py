"""The report: complete, self-contained, honest about what is missing, the same bytes twice."""

import base64
import json
import re
from html.parser import HTMLParser
from pathlib import Path
from types import SimpleNamespace
from unittest import mock

import numpy as np
import pytest
import report_fixtures as fixtures
import yaml
from matplotlib.collections import PathCollection

from catalogs.compare.comparison import compare
from catalogs.figures import events_figure, style
from catalogs.report import sections
from catalogs.report.gallery import Gallery
from catalogs.report.sections import axes
from catalogs.report.sections.config import config_lines
from catalogs.report.sections.rock import energy_table
from catalogs.report.sections.warnings import banners
from catalogs.report.text import between, number
from common.costs import Costs
from common.datasets import read_dataset, write_dataset
from common.errors import InputError
from common.event_table import ON_PLANES, read_events, write_events

SMALL = {"coarse": 16.0}  # 4 m in the finest of three levels: about 4,000 cells
SECTIONS = (
    "first", "warnings", "record", "scene", "view", "rock", "steps", "events", "sizes", "axes", "balls", "convergence",
    "spread", "forecasts", "truncated", "budget", "resources", "config",
)  # fmt: skip


class Page(HTMLParser):
    """Attributes of every tag, and the text of each section without its tags."""

    def __init__(self, content: str):
        super().__init__()
        self.tags: list[tuple[str, dict]] = []
        self.sections: dict[str, str] = {}
        self.current = ""
        self.feed(content)

    def handle_starttag(self, tag, attributes):
        self.tags.append((tag, dict(attributes)))
        if tag == "section":
            self.current = dict(attributes)["id"]
            self.sections[self.current] = ""

    def handle_data(self, data):
        if self.current:
            self.sections[self.current] += data


@pytest.fixture(scope="module")
def mine(tmp_path_factory) -> fixtures.Mine:
    return fixtures.make_mine(tmp_path_factory.mktemp("mine"), **SMALL)


@pytest.fixture(scope="module")
def page(mine) -> Page:
    """The report with everything."""
    logs = mine.folder / "logs"
    (logs / "steps").mkdir(parents=True)
    (logs / "steps" / "2019-08.log").write_text(f"at work\n{Costs(12.5, 20.25, 1.5, 345.0).closing_line('step')}\n")
    fixtures.write_page(**mine.arguments(logs=logs))
    return Page((mine.folder / "report.html").read_text())


@pytest.fixture(autouse=True)
def without_drawing(monkeypatch):
    """Figures are empty files, but for those of `page`."""
    monkeypatch.setattr(style, "save", fixtures.write_nothing)
    return monkeypatch


def make_page(mine: fixtures.Mine, folder: Path, **changes) -> Page:
    """A report in a folder of its own."""
    output = folder / "report.html"
    fixtures.write_page(**mine.arguments(output=output, figures=folder / "figures", **changes))
    return Page(output.read_text())


def warnings_of(mine: fixtures.Mine, **changes) -> str:
    """The banners of a report, as they stand in its section of warnings."""
    return "\n".join(one.text for one in banners(fixtures.evidence_of(**mine.arguments(**changes))))


# ---- the page ----


def test_page_has_every_section_in_order(page):
    assert tuple(page.sections) == SECTIONS


def test_the_contents_lead_to_every_section(page):
    links = [attributes["href"] for tag, attributes in page.tags if tag == "a"]
    assert [link for link in links if link in {f"#{name}" for name in SECTIONS[1:]}] == [
        f"#{name}" for name in SECTIONS[1:]
    ]
    names = {attributes.get("id") for _, attributes in page.tags}
    assert {link.removeprefix("#") for link in links} <= names


def test_the_first_page_needs_no_other_page_to_be_understood(page):
    """No logarithm, no name of the statistics behind it, no document; it is the first thing in the page."""
    for word in ("log P", "README", "docs/", "energy distance", "Kagan", "p =", "p <"):
        assert word not in page.sections["first"], word
    assert "appendix for the specialist" in page.sections["first"]
    first = next(attributes["id"] for tag, attributes in page.tags if "id" in attributes)
    assert first == "first"


def test_headline_counts_the_events_of_the_catalogue(page, mine):
    """150 events; how many in each step is counted anew here."""
    step = list(read_dataset(mine.catalog)["step"].values)
    expected = f"150 events in 2 dated steps: {step.count('2019-08')} in 2019-08, {step.count('2019-09')} in 2019-09."
    assert expected in page.sections["steps"]


def test_headline_tells_of_events_on_weak_planes(page, mine, tmp_path):
    """Half of the events slipped on planes wholly, the others not at all; without planes not a word."""
    catalog = read_events(mine.catalog)
    share = np.arange(150) % 2.0
    write_events(catalog.assign(on_planes=("event", share, ON_PLANES.attributes)), tmp_path / "catalog.nc")
    potency = catalog["potency"].values
    percent = 100 * potency[1::2].sum() / potency.sum()
    expected = f"75 events slipped mostly on weak planes: {percent:.0f} %"
    assert expected in make_page(mine, tmp_path, catalog=tmp_path / "catalog.nc").sections["steps"]
    assert "weak planes" not in page.sections["steps"]


def test_numbers_of_the_datasets_reach_the_page(page, mine):
    """Largest event, budget, floor, truncated share, resources: read from the files, found in their sections."""
    catalog = read_dataset(mine.catalog)
    resolved = catalog.isel(event=np.flatnonzero(catalog["resolved"].values == 1))
    assert f"{np.log10(resolved['potency'].values.max()):.2f}".replace("-", "−") in page.sections["balls"]
    assert "−4.00" in page.sections["budget"]
    assert "log P −3.92" in page.sections["budget"]
    assert "3.4 %" in page.sections["truncated"]
    assert all(number in page.sections["resources"] for number in ("12.5", "20.2", "1.5", "345"))
    cells = read_dataset(mine.grid)["cell_level"].values
    for level in range(3):
        assert f"{(cells == level).sum():,}".replace(",", "\u202f") in page.sections["scene"]


def test_loose_rock_is_named_before_anything_else(page):
    """Count, volume and place of the step's attributes, once: steps without loose rock say nothing."""
    assert page.sections["warnings"].count("Unsupported rock in step") == 1
    expected = "2019-09: 3 pieces, 1.20 m³, largest 0.7 m³ at (x, y, z) = (10052.0, 20051.5, −1020.2) m, counts as"
    assert expected in page.sections["warnings"]


def test_the_page_says_where_the_energy_of_each_step_went(page, mine):
    """Each term in its column, in MJ; hourglass energy held and lost at failure together; what is left as a share."""
    attributes = read_dataset(mine.steps[-1]).attrs
    table = energy_table(SimpleNamespace(steps=[attributes]))
    assert dict(zip(table["columns"], table["rows"][0]["values"], strict=True)) == {
        "work done on the rock": "2.00", "increase of stored energy": "−33.0", "taken up by the mined rock": "6.00",
        "seismic drop": "1.00", "overshoot": "2.00", "later plastic flow": "8.00", "hourglass": "1.00",
        "motion": "16.9", "unbalanced": "0.100",
    }  # fmt: skip
    assert table["rows"][0]["left"] == "6.0·10⁻¹⁰ %"
    assert not table["gains"]
    for text in (
        "where the energy went",
        "later plastic flow",
        "16.9",
        "6.0·10⁻¹⁰ %",
        "closure depend on the cell size",
    ):
        assert text in page.sections["rock"]
    gains = energy_table(SimpleNamespace(steps=[attributes | {"energy_gained": 1e6}]))
    assert gains["gains"]
    assert gains["rows"][0]["values"][-1] == "1.00"
    round_off = {key: 1e-4 for key in attributes if key.startswith("energy_")} | {"energy_round_off": 1e-3}
    nothing = energy_table(SimpleNamespace(steps=[attributes | round_off]))
    assert set(nothing["rows"][0]["values"]) == {"0"}
    assert nothing["rows"][0]["left"] == "no energy"
    assert not nothing["gains"]
    assert not nothing["splits"]
    moving = energy_table(SimpleNamespace(steps=[attributes | {"energy_left_share": np.nan}]))
    assert moving["unknown"]
    assert moving["rows"][0]["left"] == "–"


def test_many_excavations_are_folded_under_their_sums(page, mine, tmp_path, monkeypatch):
    """Four here; a list of over a hundred would hide what follows."""
    assert not any(tag == "details" for tag, _ in page.tags)
    monkeypatch.setattr(sections, "MAX_ROWS_UNFOLDED", 2)
    folded = make_page(mine, tmp_path)
    assert [tag for tag, _ in folded.tags if tag in ("details", "summary")] == ["details", "summary"]
    names = ("excavation_volume", "excavation_volume_grid")
    volumes = [sum(json.loads(read_dataset(mine.grid).attrs[name])) for name in names]
    expected = f"4 excavations, {number(volumes[0], 4)} m³ as solids, {number(volumes[1], 4)} m³ on the grid"
    assert expected in folded.sections["scene"]


def test_match_is_given_in_numbers_with_intervals(page, mine):
    """Ratio of potencies, difference of b, centroid distance, angle of P axes: each in its section."""
    comparison = read_dataset(mine.comparison)
    angle, interval = comparison["mean_angle"].values[0], comparison["mean_angle_interval"].values[0]
    ratio, distance = comparison["potency_ratio"], comparison["centroid_distance"]
    b_difference = [float(comparison["b_difference"]), *comparison["b_difference_interval"].values]
    b_difference = [f"{value:.2f}".replace("-", "−") for value in b_difference]
    expected = (
        ("sizes", number(ratio), between(comparison["potency_ratio_interval"].values)),
        ("sizes", b_difference[0], f"{b_difference[1]} to {b_difference[2]}"),
        ("events", f"{number(distance)} m", between(comparison["centroid_distance_interval"].values)),
        ("axes", f"{number(angle)}°", between(interval)),
    )
    for section, value, text in expected:
        assert re.search(rf"{re.escape(value)}\s*{re.escape(text)}", page.sections[section]), (section, value)


def test_twin_is_labelled_wherever_the_record_shows(page):
    for name in ("first", "warnings", "record", "steps", "events", "sizes", "axes"):
        assert "twin" in page.sections[name], name


def test_record_of_measured_events_is_not_called_a_twin(mine, tmp_path):
    record = read_dataset(mine.record)
    write_dataset(record.assign_attrs(kind="recorded"), tmp_path / "record.nc")
    content = make_page(mine, tmp_path, record=tmp_path / "record.nc", comparison=None, steps=[])
    assert "Recorded" in content.sections["sizes"]
    assert not [name for name, section in content.sections.items() if "twin" in section]


def test_banners_name_truncation(page):
    assert "of potency is missing from the 0.629 m³" in page.sections["warnings"]
    assert "3.4 % of the rock that reached its strength lies in cells too coarse to fail" in page.sections["warnings"]


def test_stopes_filled_while_they_are_mined_are_named(page):
    """Only stope_1 is mined in a dated step and filled in the same one; the table says of each when it is filled."""
    assert "These excavations are filled while they are mined: stope_1. " in page.sections["warnings"]
    assert "fill, at once" in page.sections["scene"]
    assert "fill, planned" in page.sections["scene"]


def test_every_banner_stands_in_the_section_of_warnings(page, mine):
    """Each text once, with what it says; the tests below read the texts themselves."""
    texts = [one.text for one in banners(fixtures.evidence_of(**mine.arguments()))]
    assert len(texts) > 2
    assert all(page.sections["warnings"].count(text) == 1 for text in texts)


def test_banner_names_excavations_whose_volume_the_grid_misses(mine, tmp_path):
    """By more than 5 %, the worst first; a planned one does not count yet, and 4.9 % is no matter."""
    grid = read_dataset(mine.grid)
    solid = np.array(json.loads(grid.attrs["excavation_volume"]))
    grid.attrs["excavation_volume_grid"] = json.dumps((solid * [1.049, 0.93, 1.18, 9.0]).tolist())
    write_dataset(grid, tmp_path / "grid.nc")
    wrong = warnings_of(mine, grid=tmp_path / "grid.nc")
    assert "misses the volume of 2 excavations by more than 5.0 %: stope_2 +18 %, stope_1 −7 %. Refine" in wrong
    grid.attrs["excavation_volume_grid"] = json.dumps((solid * 1.049).tolist())
    write_dataset(grid, tmp_path / "good.nc")
    assert "misses the volume" not in warnings_of(mine, grid=tmp_path / "good.nc")


def test_banner_names_excavations_too_narrow_for_the_cells(mine, tmp_path):
    """The narrowest first; a planned one does not count yet."""
    grid = read_dataset(mine.grid)
    grid.attrs["excavation_whole_share"] = json.dumps([0.31, 0.29, 0.0, 0.0])
    write_dataset(grid, tmp_path / "grid.nc")
    said = warnings_of(mine, grid=tmp_path / "grid.nc")
    assert "Narrow for cells of 4.00 m: stope_2 0 %, stope_1 29 % of the volume lies in whole cells." in said
    assert "Narrow for" not in warnings_of(mine)


def test_banner_names_excavations_whose_surface_is_open(mine, tmp_path):
    """The most open first; a planned one does not count yet, and 4 % is no matter."""
    grid = read_dataset(mine.grid)
    grid.attrs["excavation_open_share"] = json.dumps([0.04, 0.08, 0.22, 0.25])
    write_dataset(grid, tmp_path / "grid.nc")
    said = warnings_of(mine, grid=tmp_path / "grid.nc")
    assert "or look the other way: stope_2 22 %, stope_1 8.0 % of the volume depends on how it is closed." in said
    assert "depends on how it is closed" not in warnings_of(mine)


def test_banner_says_where_failed_rock_has_reached_the_boundary(mine, tmp_path):
    """Of the step in which most of it lies there."""
    steps = []
    for rank, path in enumerate(mine.steps):
        facts = {"boundary_failed_volume": 64.0 * rank, "boundary_failed_faces": "z_lower" if rank else ""}
        steps.append(tmp_path / path.name)
        write_dataset(read_dataset(path).assign_attrs(facts), steps[-1])
    said = warnings_of(mine, steps=steps)
    assert "(z_lower; " + number(64.0 * (len(steps) - 1)) + " m³ of its cells lie there in step 2019-09)" in said
    assert "boundary (" not in warnings_of(mine)


def test_page_asks_nothing_of_the_network(page):
    """No linked files; every image and every reference inside the drawings is data or local.

    What scripts do is seen in a browser (test_view_in_browser.py).
    """
    assert not {"link", "iframe", "object"} & {tag for tag, _ in page.tags}
    sources = [attributes["src"] for tag, attributes in page.tags if "src" in attributes]
    assert len(sources) >= 10
    for source in sources:
        kind, content = source.split(",", 1)
        assert kind == "data:image/svg+xml;base64"
        drawing = base64.b64decode(content).decode()
        assert all(link.startswith(("#", "data:")) for link in re.findall(r'href="([^"]*)"', drawing))
        assert "font-family" not in drawing
    assert all(attributes.get("href", "#").startswith("#") for _, attributes in page.tags)


def test_every_figure_is_a_file_and_in_the_page(page, mine):
    names = {path.name for path in (mine.folder / "figures").iterdir()}
    named = {name for name in names if f"figures/{name}" in "".join(page.sections.values())}
    assert names - named == {"first_page.svg"}  # which stands in the first page without its name
    assert len(names) == sum(tag == "img" for tag, _ in page.tags)


def test_a_draft_says_so_first(tmp_path, mine):
    page = tmp_path / "report.html"
    where = {"output": page, "figures": tmp_path / "figures"}
    fixtures.write_page(**mine.arguments(config=fixtures.CONFIG | {"accuracy": "draft"}, **where))
    said = page.read_text()
    assert "A draft has cells of twice the size" in said
    draft = said.index("<strong>Do not use these numbers yet:</strong> this is a draft")
    assert draft < said.index('<p class="lead">') < said.index("A draft has")
    assert "A draft has" not in warnings_of(mine, config=fixtures.CONFIG | {"accuracy": "standard"})
    grid = read_dataset(mine.grid).assign_attrs(draft_would_lose='["stope_a", "drive"]')
    write_dataset(grid, tmp_path / "kept.nc")
    kept = warnings_of(mine, config=fixtures.CONFIG | {"accuracy": "draft"}, grid=tmp_path / "kept.nc")
    assert "A draft has looser tolerances" in kept
    assert "hardly any cell of twice the size would lie wholly in stope_a and 1 other excavation" in kept


def test_marked_lines_are_those_that_differ_from_the_default(page, mine):
    content = (mine.folder / "report.html").read_text()
    marked = re.findall(r'<span class="changed">(.*?)</span>', content)
    assert "  closeness: 0.85" in marked
    assert "  increments: 2" in marked
    assert not any("scheme" in line for line in marked)
    assert "geometry/&lt;stope_9&gt;.stl" in content  # text of the config is text, not markup


def test_same_inputs_give_the_same_bytes(mine, tmp_path, without_drawing):
    """Twice, in two folders, drawn in one process and in several: no date, no random element names."""
    without_drawing.undo()
    first, second = tmp_path / "1", tmp_path / "2"
    for folder, processes in ((first, 1), (second, 3)):
        make_page(mine, folder, processes=processes)
    assert {path.name for path in (first / "figures").iterdir()} == {
        path.name for path in (second / "figures").iterdir()
    }
    assert (first / "report.html").read_bytes() == (second / "report.html").read_bytes()
    for path in (first / "figures").iterdir():
        assert path.read_bytes() == (second / "figures" / path.name).read_bytes()


@pytest.mark.parametrize("processes", [1, 2])
def test_a_section_that_fails_leaves_an_earlier_report(mine, tmp_path, monkeypatch, processes):
    """One line, whichever process it comes from."""
    (tmp_path / "report.html").write_text("earlier")
    monkeypatch.setattr(axes, "section", mock.Mock(side_effect=InputError("catalog.nc: no axes")))
    with pytest.raises(InputError, match=r"^catalog.nc: no axes$"):
        make_page(mine, tmp_path, processes=processes)
    assert (tmp_path / "report.html").read_text() == "earlier"


# ---- what is missing is said ----


def test_without_record_the_model_stands_alone(mine, tmp_path):
    content = make_page(mine, tmp_path, record=None, comparison=None)
    assert "No recorded catalogue was given" in content.sections["warnings"]
    assert "b of potency" in content.sections["sizes"]
    assert (tmp_path / "figures" / "beach_balls.svg").is_file()
    assert "recorded" not in content.sections["sizes"]


def test_no_events_is_said_and_figures_of_an_earlier_report_go(mine, tmp_path):
    write_dataset(fixtures.make_catalog(read_dataset(mine.steps[-1]), 0), tmp_path / "catalog.nc")
    (tmp_path / "figures").mkdir()
    (tmp_path / "figures" / "beach_balls.svg").write_text("old")
    without = {"catalog": tmp_path / "catalog.nc", "record": None, "comparison": None}
    content = make_page(mine, tmp_path, processes=2, **without)
    assert "The model made no events in its 2 dated steps" in content.sections["steps"]
    assert "no events" in content.sections["events"]
    assert not (tmp_path / "figures" / "beach_balls.svg").exists()


def test_elastic_scene_in_two_dimensions(tmp_path):
    """Plane strain, no steps: one section, no events, no crash."""
    mine = fixtures.make_mine(tmp_path, dimension=2, **SMALL)
    content = make_page(mine, tmp_path, steps=[], events=[], catalog=None, record=None, comparison=None)
    assert "stops at elastic equilibrium" in content.sections["first"]
    assert "2019-08 (planned)" in content.sections["scene"]  # its stope is not mined yet
    assert "history (planned)" not in content.sections["scene"]
    assert (tmp_path / "figures" / "displacement.svg").is_file()
    assert not (tmp_path / "figures" / "failed_rock.svg").exists()


@pytest.mark.filterwarnings("error::RuntimeWarning")
def test_a_stage_that_mines_nothing_has_no_finest_cells(mine, tmp_path):
    """Nothing is a share of them."""
    write_dataset(read_dataset(mine.elastic).assign_attrs(finest_cells=0), tmp_path / "elastic.nc")
    alone = {"steps": [], "events": [], "catalog": None, "record": None, "comparison": None}
    content = make_page(mine, tmp_path, elastic=tmp_path / "elastic.nc", **alone)
    assert "nan" not in content.sections["convergence"]


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


def recorded(
    mine: fixtures.Mine, folder: Path, *, keep: slice = slice(None), tensors: bool = True, **attributes
) -> Page:
    """The report with another record: some of its events, with or without tensors, and what its reader tells of it."""
    record = read_dataset(mine.record).isel(event=keep).assign_attrs(attributes)
    if not tensors:
        for name in ("potency_tensor", "p_axis", "b_axis", "t_axis"):
            record[name][:] = np.nan
    write_dataset(record, folder / "record.nc")
    made = compare(read_dataset(mine.catalog), record, {"resamplings": 99})
    write_dataset(made, folder / "comparison.nc")
    return make_page(mine, folder, record=folder / "record.nc", comparison=folder / "comparison.nc", steps=[])


def test_result_counts_the_record_inside_and_outside_the_domain(mine, tmp_path):
    """300 of 565 events, a few without a size, and what their potency was: in the first section."""
    crop = {"filter": "domain", "before": 565, "after": 265, "potency_before": 4.0, "potency_after": 1.0}
    dates = {"filter": "start", "before": 580, "after": 565}
    content = recorded(
        mine, tmp_path, rows=595,
        dropped=json.dumps({"of type quarry blast": 2, "rejected": 1, "without a size": 8, "there twice": 4}),
        types_text="570 without a type, 10 rock burst",
        filter=json.dumps([dates, crop | {"farthest": 512.3}]), sizes_text="20 Mw, 560 ML as Mw = 0.9 ML - 0.2",
    )  # fmt: skip
    result = content.sections["record"]
    assert (
        "holds 595 events, of which 2 of type quarry blast, 1 rejected, 8 without a size, 4 there twice are" in result
    )
    assert "Event types of those that have a time, a place and a size: 570 without a type, 10 rock burst." in result
    assert "Of 565 events in the modelled months, 265 lie inside the model's domain and 300 outside, up to" in result
    assert "up to 512 m away, with 75 % of their potency" in result
    assert "560 ML as Mw = 0.9 ML − 0.2" in result


@pytest.mark.parametrize(
    ("keep", "tensors", "says"),
    [
        (
            slice(0, 0),
            True,
            (
                "Places, sizes and axes cannot be compared: the record has no event here. Events of log P ≥ ",
                "The record has no event. The expected number of recorded events is less than 3.69 (95 %). ",
            ),
        ),
        (slice(0, 7), True, ("b is not compared: 10 events are needed in each catalogue, and the record has ",)),
        (slice(0, 1), True, ("Locations cannot be compared: the comparison needs two modelled events",)),
        (slice(0, 40), False, ("The record has no tensors: axes cannot be compared.",)),
        (slice(0, 40), True, ("Differences of places and axes have no interval and no p-value: fewer than 3 runs",)),
    ],
)
def test_a_comparison_that_is_impossible_is_said_in_the_result(mine, tmp_path, keep, tensors, says):
    """It was left out without a word; and no number is 'nan'."""
    content = recorded(mine, tmp_path, keep=keep, tensors=tensors)
    for sentence in says:
        assert sentence in content.sections["record"]
    assert not [name for name, section in content.sections.items() if re.search(r"\bnan\b", section)]


def test_an_ensemble_with_too_few_events_is_not_told_to_run_one(mine, tmp_path):
    """Nine runs, two of which have events: the report asked for an ensemble of 8."""
    catalog, record = read_dataset(mine.catalog), read_dataset(mine.record)
    members = [catalog] + [catalog.isel(event=slice(0))] * 7
    write_dataset(compare(catalog, record, {"resamplings": 99, "members": 8}, members), tmp_path / "comparison.nc")
    said = make_page(mine, tmp_path, comparison=tmp_path / "comparison.nc", steps=[]).sections["record"]
    assert "fewer than 3 of the model's 9 runs have events of such a size in a step that the record shares" in said
    assert "Set ensemble: 8" not in said


def test_a_record_beside_a_mine_without_dates_is_not_denied(mine, tmp_path):
    """The report said that no record was given."""
    config = fixtures.CONFIG | {"record": {"file": "record.csv"}}
    content = make_page(mine, tmp_path, config=config, catalog=None, record=None, comparison=None, events=[])
    assert "No recorded catalogue was given" not in content.sections["warnings"]
    assert "The record is not compared: no step of this mine has dates" in content.sections["record"]


def test_config_lines_are_yaml_again():
    lines = config_lines(fixtures.CONFIG, fixtures.DEFAULT)
    assert yaml.safe_load("\n".join(line for line, _ in lines)) == fixtures.CONFIG
