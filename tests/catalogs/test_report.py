"""The report: complete, self-contained, honest about what is missing, the same bytes twice."""

import base64
import re
from unittest import mock

import numpy as np
import pytest
import report_fixtures as fixtures
import yaml
from report_fixtures import SMALL, make_page

from catalogs.report.sections import axes
from catalogs.report.sections.config import config_lines
from catalogs.report.text import number
from common.datasets import read_dataset, write_dataset
from common.errors import InputError

pytestmark = pytest.mark.usefixtures("without_drawing")


SECTIONS = (
    "first", "warnings", "record", "scene", "view", "rock", "planes", "openings", "observations", "steps", "events",
    "sizes", "axes", "balls", "parameters", "uncertainty", "convergence", "spread", "forecasts", "truncated", "budget",
    "shaking", "loading", "resources", "config",
)  # fmt: skip


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


def test_the_caption_of_the_first_picture_says_whose_potency_names_openings(page):
    assert " to look at first and " in page.sections["first"]


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


def test_twin_is_labelled_wherever_the_record_shows(page):
    for name in ("first", "warnings", "record", "steps", "events", "sizes", "axes"):
        assert "twin" in page.sections[name], name


def test_record_of_measured_events_is_not_called_a_twin(mine, tmp_path):
    record = read_dataset(mine.record)
    write_dataset(record.assign_attrs(kind="recorded"), tmp_path / "record.nc")
    content = make_page(mine, tmp_path, record=tmp_path / "record.nc", comparison=None, steps=[])
    assert "Recorded" in content.sections["sizes"]
    assert not [name for name, section in content.sections.items() if "twin" in section]


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
    assert names - named == {"first_page.svg", "first_page_steps.svg"}  # which the first page does not name
    assert len(names) == sum(tag == "img" for tag, _ in page.tags)


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


def test_config_lines_are_yaml_again():
    lines = config_lines(fixtures.CONFIG, fixtures.DEFAULT)
    assert yaml.safe_load("\n".join(line for line, _ in lines)) == fixtures.CONFIG


@pytest.mark.parametrize(
    ("value", "expected"),
    [
        (0.0, "0"),
        (np.nan, "–"),
        (-1234.5, "−1\u202f234"),
        (0.01234, "0.0123"),
        (1.5e-7, "1.50·10⁻⁷"),
        (-3.2e9, "−3.20·10⁹"),
    ],
)
def test_numbers_read_as_a_person_writes_them(value, expected):
    assert number(value) == expected
