"""The first page in a real browser: one screen of a laptop and one sheet of paper, whatever it has to say."""

import base64
import json
import re
from pathlib import Path

import numpy as np
import pytest
import report_fixtures as fixtures
from browser import Browser, find_browser

from catalogs.compare.comparison import compare
from catalogs.report import first_page, verdict
from catalogs.report.sections.steps import MAX_LINES
from common.datasets import read_dataset, write_dataset

MILLIMETRE = 96 / 25.4  # px
STEPS = 14
NAME = "2019-{:02d} a long name of a step"
FACTS = (  # as sections on openings, instruments and shaking write them
    "Of what stands open, rock has failed deepest at stope_1010_north, walls 21 m, closure 60 mm; drive_1010_north, "
    "floor 14 m (deepest 60 to 65 m along it), closure 68 mm; decline_1010, walls 12 m (deepest 45 to 50 m along it), "
    "closure 69 mm. 33 % of 24 readings of 11 instruments lie within the errors of model and reading; farthest off: "
    "extensometer_12, 11 mm (r.m.s.). Most is felt by stope_1010_north in 2019-08: with a chance of 10 % a peak ground "
    "velocity above 0.26 m/s. Largest demand on support: drive_1010_north, roof, 71 kJ/m² in 2019-10, above every "
    "stated capacity."
)


@pytest.fixture(scope="module")
def mine(tmp_path_factory) -> fixtures.Mine:
    find_browser()  # skips before anything is made
    return fixtures.make_mine(tmp_path_factory.mktemp("mine"), coarse=16.0)


@pytest.fixture(scope="module")
def usual(mine) -> Path:
    """With a twin, two steps and a warning."""
    fixtures.write_page(**mine.arguments())
    return mine.folder / "report.html"


@pytest.fixture(scope="module")
def fullest(mine, tmp_path_factory) -> Path:
    """Many steps with long names, more warnings than there is room for, a twin, everything else that is ever said."""
    folder = tmp_path_factory.mktemp("fullest")
    state, catalog = read_dataset(mine.steps[-1]), read_dataset(mine.catalog)
    months = np.datetime64("2019-08") + np.arange(STEPS + 1)
    names, steps, events = [NAME.format(number) for number in range(STEPS)], [], []
    for number, name in enumerate(names):
        steps.append(folder / "steps" / f"{number}.nc")
        write_dataset(state.assign_attrs(step=name, step_index=number + 1), steps[-1])
        dates = {"start": f"{months[number]}-01", "end": f"{months[number + 1]}-01", "dated": 1}
        events.append(folder / "events" / f"{number}.nc")
        write_dataset(catalog.isel(event=slice(0, 1)).assign_attrs(step=name, **dates), events[-1])
    own = np.array([names[number % STEPS] for number in range(catalog.sizes["event"])])
    write_dataset(catalog.assign(step=("event", own, catalog["step"].attrs)), folder / "catalog.nc")
    record = read_dataset(mine.record)
    shown = [
        {"name": name, "start": f"{months[at]}-01", "end": f"{months[at + 1]}-01"} for at, name in enumerate(names)
    ]
    write_dataset(
        compare(read_dataset(folder / "catalog.nc"), record, {"resamplings": 99, "steps": shown}),
        folder / "comparison.nc",
    )
    grid = read_dataset(mine.grid)
    solid = np.array(json.loads(grid.attrs["excavation_volume"]))
    grid.attrs |= {
        "excavation_volume_grid": json.dumps((solid * 1.3).tolist()),
        "excavation_narrow": grid.attrs["excavation_names"],
        "excavation_cells_across": json.dumps([1.2] * 4),
        "excavation_cells_needed": json.dumps([4] * 4),
        "excavation_open_share": json.dumps([0.2] * 4),
    }
    write_dataset(grid, folder / "grid.nc")
    mined = [one | {"step": names[at]} for one, at in zip(fixtures.CONFIG["excavations"], (0, 1, 5, -1), strict=True)]
    config = fixtures.CONFIG | {"accuracy": "draft", "steps": shown, "excavations": mined}
    made = {name: folder / f"{name}.nc" for name in ("catalog", "comparison", "grid")}
    where = {"output": folder / "report.html", "figures": folder / "figures"}
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(first_page, "worst", lambda evidence: FACTS)
        fixtures.write_page(**mine.arguments(config=config, steps=steps, events=events, **made, **where))
    return where["output"]


def opened(browser: Browser, page: Path, width: int, height: int, media: str = "") -> dict:
    """Where the parts of the first page lie in a window of this size, px."""
    browser.call("Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1, mobile=False)
    browser.call("Emulation.setEmulatedMedia", media=media)
    browser.open(page)
    browser.wait_for("document.readyState === 'complete' && document.querySelector('#first img')?.complete")
    script = (
        "JSON.stringify(Object.fromEntries(['#first', '#first .left', '#first .right', '#first .terms', "
        "'#first img', '#first table', '#first .frame', '#first .bars']"
        ".map((name) => [name.replace('#first', '').trim(), "
        "((one) => [one.left, one.top, one.right, one.bottom])("
        "document.querySelector(name).getBoundingClientRect())])))"
    )
    found = json.loads(browser.value(script))
    assert browser.value("document.getElementById('first').scrollWidth") <= width
    return found


def assert_fits(parts: dict, width: float, height: float) -> None:
    """All within the page, nothing over another, and the picture large enough to be read."""
    left, top, right, bottom = parts[""]
    assert (left, top) == (0, 0) or left >= 0
    assert right <= width + 0.5
    assert bottom <= height + 0.5
    for name, part in parts.items():
        assert part[2] <= right + 0.5, name
        assert part[3] <= bottom + 0.5, name
    assert parts[".left"][2] < parts[".right"][0]
    assert parts[".frame"][3] < parts["table"][1] < parts["table"][3] <= parts[".bars"][1]
    assert max(parts[".left"][3], parts[".right"][3], parts["table"][3]) <= parts[".terms"][1] + 0.5
    assert parts[".frame"][3] - parts[".frame"][1] > 190


@pytest.fixture(scope="module")
def browser(tmp_path_factory):
    with Browser(tmp_path_factory.mktemp("profile")) as one:
        yield one
        assert one.errors == []


@pytest.mark.parametrize("report", ["usual", "fullest"])
@pytest.mark.parametrize("size", [(1366, 768), (1280, 720), (1920, 1080)])
def test_it_is_one_screen(browser, request, report, size):
    """Of a laptop without scrolling, and of a desk's larger screen."""
    assert_fits(opened(browser, request.getfixturevalue(report), *size), *size)


@pytest.mark.parametrize("report", ["usual", "fullest"])
def test_it_is_one_sheet(browser, request, report):
    """Of A4 on its side, alone; all that follows is upright. Its text is as large as print needs."""
    page = request.getfixturevalue(report)
    sheet = 279 * MILLIMETRE, 192 * MILLIMETRE  # within its margins
    assert_fits(opened(browser, page, round(sheet[0]), 900, "print"), *sheet)
    assert browser.value("parseFloat(getComputedStyle(document.querySelector('#first .right p')).fontSize)") >= 10.5
    browser.call("Emulation.setEmulatedMedia", media="")
    printed = base64.b64decode(browser.call("Page.printToPDF", preferCSSPageSize=True, printBackground=True)["data"])
    sizes = [tuple(map(float, one.split()[2:])) for one in re.findall(rb"/MediaBox *\[([^]]*)\]", printed)]
    assert sum(width > height for width, height in sizes) == 1
    assert len(sizes) > 5


@pytest.mark.parametrize("report", ["usual", "fullest"])
def test_on_paper_no_table_is_cut(browser, request, report):
    """A4 upright within its margins. A table that is wider than its sheet, or scrolls, would lose columns or rows."""
    opened(browser, request.getfixturevalue(report), round(186 * MILLIMETRE), 900, "print")
    tables = "[...document.querySelectorAll('#appendix table, #appendix pre, #appendix .aside')]"
    assert browser.value(f"{tables}.length") > 15
    cut = "(one) => one.getBoundingClientRect().right > innerWidth + 1 || one.scrollHeight > one.clientHeight + 1"
    cut += " || one.scrollWidth > one.clientWidth + 1"
    names = f"{tables}.filter({cut}).map((one) => one.closest('section').id + ': ' + one.innerText.slice(0, 40))"
    assert browser.value(f"JSON.stringify({names})") == "[]"
    assert browser.value("[...document.querySelectorAll('#appendix table')].every((one) => one.tHead)")


def test_on_a_phone_it_is_one_column(browser, usual):
    parts = opened(browser, usual, 390, 844)
    assert parts[".right"][1] >= parts[".left"][3]
    assert parts["img"][2] <= 390
    assert parts[""][2] <= 390


def test_the_fullest_page_is_full(browser, fullest):
    """Else the tests above would show little: of each kind as much as there can be."""
    opened(browser, fullest, 1366, 768)
    rows = browser.value("document.querySelectorAll('#first tr').length")
    assert rows == 2 + MAX_LINES + 1
    said = browser.value("document.getElementById('first').textContent")
    assert f"has all {STEPS}" in said
    assert "Do not use these numbers yet: this is a draft" in said
    assert re.search(r"; \d more\.", said)
    assert first_page.TWIN in said
    assert FACTS in said
    assert said.count(";") >= first_page.MAX_BRIEF
    assert browser.value("document.querySelectorAll('#first .right p').length") >= 4
    assert verdict.SIGNIFICANCE == 0.05
