"""The view that can be turned, in a real browser, from a file, without a network, as a reader would use it."""

import json
import re
from pathlib import Path

import matplotlib.image
import numpy as np
import pytest
import report_fixtures as fixtures
import xarray as xr
from browser import Browser, find_browser

from catalogs.figures import events_figure
from common.datasets import read_dataset, write_dataset
from common.event_table import read_events

HOSTILE = "</script><script>window.harmed = 1</script><img src=x onerror='window.harmed = 1'><!--"
VIEW = "document.getElementById('view-{}')"
READY = f"{VIEW.format('root')}?.dataset.ready"
SIDES = ("Modelled", "Recorded (twin)")
WHITE = 0.98


@pytest.fixture(scope="module")
def mine(tmp_path_factory) -> fixtures.Mine:
    find_browser()  # skips before anything is made
    made = fixtures.make_mine(tmp_path_factory.mktemp("mine"), coarse=16.0)
    fixtures.write_page(**made.arguments())
    return made


@pytest.fixture(scope="module")
def browser(tmp_path_factory):
    with Browser(tmp_path_factory.mktemp("profile")) as one:
        yield one


@pytest.fixture
def page(browser, mine) -> Browser:
    """The report, opened anew, with the view in the window; whatever a test does, no script has failed after it."""
    browser.errors.clear()
    browser.requests.clear()
    browser.open(mine.folder / "report.html")
    browser.wait_for(READY)
    browser.value("document.getElementById('view').scrollIntoView()")
    yield browser
    assert browser.errors == []


def frames(browser: Browser) -> None:
    """Wait until what was changed is drawn."""
    browser.value("new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(() => done(true))))")


def halves(browser: Browser, path: Path) -> list[np.ndarray]:
    """What the two sides show (row, column, colour) 0 to 1; their titles, the scale and the arrows left out."""
    frames(browser)
    box = browser.value(f"JSON.stringify({VIEW.format('canvas')}.getBoundingClientRect())")
    box = {name: round(value) for name, value in json.loads(box).items()}
    shown = matplotlib.image.imread(browser.picture(path))[..., :3]
    shown = shown[box["top"] + 40 : box["bottom"] - 130, box["left"] + 2 : box["right"] - 2]
    middle = shown.shape[1] // 2
    return [shown[:, : middle - 3], shown[:, middle + 3 :]]


def coloured(picture: np.ndarray) -> float:
    """Which share of a picture is not white."""
    return float((picture.min(axis=-1) < WHITE).mean())


def set_to(browser: Browser, name: str, value) -> None:
    """Move a slider as a script would; keys are tested apart."""
    control = VIEW.format(name)
    browser.value(f"{control}.value = {json.dumps(value)}, {control}.dispatchEvent(new Event('input')), 1")


def counts(browser: Browser) -> list[int]:
    """How many events each side says it shows."""
    titles = [browser.value(f"{VIEW.format(f'title-{side}')}.textContent") for side in (0, 1)]
    for title, label in zip(titles, SIDES, strict=True):
        assert title.startswith(f"{label}: ")
    return [int(title.split(": ")[1].split(" of ")[0].replace("\u202f", "")) for title in titles]


def shown_catalogs(mine: fixtures.Mine) -> list[xr.Dataset]:
    """Events of both sides, in the order in which the view has them."""
    catalog = read_events(mine.catalog)
    return [catalog.isel(event=np.flatnonzero(catalog["resolved"].values == 1)), read_events(mine.record)]


def steps_and_sizes(mine: fixtures.Mine) -> list[tuple[np.ndarray, np.ndarray]]:
    """Of each side's events the number of their step, from their months, and log P."""
    both = shown_catalogs(mine)
    months = [one["time"].values.astype("datetime64[M]").astype(int) for one in both]
    first = np.datetime64("2019-07").astype(int)  # August is step 1
    return [(month - first, np.log10(one["potency"].values)) for one, month in zip(both, months, strict=True)]


def picked(browser: Browser, mine: fixtures.Mine):
    """The event that the view says it reads, as the dataset has it, and the sentence."""
    side, event = map(int, browser.value(f"{VIEW.format('root')}.dataset.picked").split(":"))
    return side, shown_catalogs(mine)[side].isel(event=event), browser.value(f"{VIEW.format('reading')}.textContent")


def assert_reads(sentence: str, side: int, event) -> None:
    """Catalogue, step, time, size and place are those of the event."""
    month = str(event["time"].values.astype("datetime64[M]"))
    moment = str(event["time"].values.astype("datetime64[m]")).replace("T", " ") + " UTC"
    place = ", ".join(f"{axis} {value:.1f} m" for axis, value in zip("xyz", event["location"].values, strict=True))
    parts = [
        f"{SIDES[side]} event",
        f"step {month}",
        moment + ("" if side else " (order within the step, not a date)"),
        f"log P {np.log10(float(event['potency'])):.2f}",
        f"Mw {float(event['mw']):.2f}",
        place,
    ]
    assert sentence == "; ".join(parts).replace(" -", " −")


def ring(browser: Browser) -> tuple[float, float]:
    """Where in the window the event that is read is marked."""
    frames(browser)
    box = "document.querySelector('.view-ring').getBoundingClientRect()"
    return tuple(browser.value(f"[{box}.left + {box}.width / 2, {box}.top + {box}.height / 2]"))


def metres_per_pixel(browser: Browser) -> float:
    """What the bar of the scale says."""
    length = browser.value("document.querySelector('.view-length').textContent").removesuffix(" m")
    return float(length) / browser.value("document.querySelector('.view-scale').getBBox().width")


# ---- what is drawn ----


def test_both_sides_are_drawn_and_nothing_is_asked_of_a_network(page, tmp_path):
    """A canvas that stays empty must not pass: with all hidden the same measure finds it white."""
    for side in halves(page, tmp_path / "view.png"):
        assert coloured(side) > 0.03
    addresses = {address.split(":")[0] for address in page.requests}
    assert addresses == {"file", "data"}
    assert sum(address.startswith("file:") for address in page.requests) == 1
    for name in ("openings", "rock", "names"):
        page.value(f"{VIEW.format(name)}.click()")
    set_to(page, "step", 0)
    assert counts(page) == [0, 0]
    assert [coloured(side) for side in halves(page, tmp_path / "empty.png")] == [0.0, 0.0]


def test_the_picture_has_the_colours_of_the_key(page, tmp_path):
    """Events of each dated step in exactly the colour that the key gives it."""
    page.value(f"{VIEW.format('rock')}.click(), {VIEW.format('openings')}.click()")
    colours = page.value("[...document.querySelectorAll('.view-key rect')].map((one) => one.getAttribute('fill'))")
    drawn = np.rint(255 * np.concatenate([half.reshape(-1, 3) for half in halves(page, tmp_path / "view.png")]))
    for colour in colours[1:3]:
        rgb = [int(colour[at : at + 2], 16) for at in (1, 3, 5)]
        assert (np.abs(drawn - rgb) <= 1).all(axis=1).sum() > 100, colour


def test_the_page_may_run_its_own_scripts_only(page):
    """Neither a script put into it nor a request gets through: the policy says so before any network is reached."""
    page.value(
        "window.refused = [], document.addEventListener('securitypolicyviolation', "
        "(event) => refused.push(event.effectiveDirective)), 1"
    )
    page.value(
        "document.body.appendChild(Object.assign(document.createElement('script'), {text: 'window.harmed = 1'})), 1"
    )
    page.value("fetch('http://127.0.0.1:9/').catch(() => 0).then(() => 1)")
    page.value("Object.assign(new Image(), {src: 'http://127.0.0.1:9/'}), 1")
    page.wait_for("refused.length >= 3")
    assert set(page.value("refused")) == {"script-src-elem", "connect-src", "img-src"}
    assert page.value("window.harmed") is None
    page.errors.clear()  # each refusal is reported


# ---- what the controls do ----


def test_steps_are_chosen_with_the_keyboard(page, mine):
    """The slider says the step's name; each side counts the events up to it, and those of it alone."""
    steps = [own for own, _ in steps_and_sizes(mine)]
    assert page.value(f"{VIEW.format('step-name')}.textContent") == "2019-09"
    assert counts(page) == [len(own) for own in steps]
    page.value(f"{VIEW.format('step')}.focus()")
    page.press("ArrowLeft", 37)
    assert page.value(f"{VIEW.format('step-name')}.textContent") == "2019-08"
    assert page.value(f"{VIEW.format('step')}.getAttribute('aria-valuetext')") == "2019-08"
    assert counts(page) == [int((own <= 1).sum()) for own in steps]
    page.press("ArrowRight", 39)
    page.value(f"{VIEW.format('only')}.click()")
    assert counts(page) == [int((own == 2).sum()) for own in steps]


def test_small_events_are_left_out(page, mine):
    sizes = [size for _, size in steps_and_sizes(mine)]
    set_to(page, "least", -2.5)
    assert page.value(f"{VIEW.format('least-value')}.textContent") == "−2.5"
    assert counts(page) == [int((size >= -2.5).sum()) for size in sizes]
    assert min(counts(page)) > 0


def test_dragging_and_keys_turn_both_sides(page, tmp_path):
    """And the arrow for north turns with them."""

    def seen() -> tuple:
        return halves(page, tmp_path / "view.png"), page.value("document.querySelectorAll('.view-arrow')[1].outerHTML")

    box = page.value(f"(({{left, top}}) => [left, top])({VIEW.format('canvas')}.getBoundingClientRect())")
    start = (box[0] + 60, box[1] + 150)
    before, arrow = seen()
    for turn in (
        lambda: page.drag(start, (start[0] + 80, start[1] + 20)),
        lambda: page.press("ArrowLeft", 37),
        lambda: page.press("ArrowUp", 38),
    ):
        turn()
        after, turned = seen()
        for old, new in zip(before, after, strict=True):
            assert (np.abs(old - new).max(axis=-1) > 0.1).mean() > 0.01
        assert turned != arrow
        before, arrow = after, turned


def test_the_plan_has_north_up_and_a_true_scale(page, mine):
    """Two recorded events lie as far apart on the screen as the scale says, the northern one above."""
    set_to(page, "direction", "plan")
    page.value(f"{VIEW.format('largest')}.click()")
    found = []
    for _ in range(6):
        side, event, _ = picked(page, mine)
        found.append((side, event["location"].values, ring(page)))
        page.value(f"{VIEW.format('smaller')}.click()")
    pairs = [(a, b) for a in found for b in found if a[0] == b[0] and a is not b]
    assert len(pairs) >= 6
    for (_, place, screen), (_, other, there) in pairs:
        shift = np.subtract(screen, there) * [1, -1] * metres_per_pixel(page)
        np.testing.assert_allclose(shift, (place - other)[:2], atol=0.3)


@pytest.mark.parametrize(("direction", "right", "above"), [("plan", 0, 1), ("north", 0, 2), ("west", 1, 2)])
def test_arrows_point_east_north_and_up(page, direction, right, above):
    """Of the three, one points right, one up, and the one along the line of sight is not drawn."""
    set_to(page, "direction", direction)
    frames(page)
    place = page.value(
        "[...document.querySelectorAll('.view-axis')].map((one) => "
        "one.getAttribute('visibility') === 'hidden' ? null : [Number(one.getAttribute('x')), -one.getAttribute('y')])"
    )
    assert page.value("[...document.querySelectorAll('.view-axis')].map((one) => one.textContent)") == ["E", "N", "up"]
    assert [axis for axis in range(3) if place[axis]] == sorted((right, above))
    assert place[right][0] - place[above][0] > 30
    assert place[above][1] - place[right][1] > 30


# ---- what an event says ----


def test_the_largest_event_is_read_and_then_the_next(page, mine):
    sizes = steps_and_sizes(mine)
    order = np.sort(np.concatenate([size for _, size in sizes]))[::-1]
    page.value(f"{VIEW.format('largest')}.click()")
    for size in order[:3]:
        side, event, sentence = picked(page, mine)
        assert np.log10(float(event["potency"])) == pytest.approx(size)
        assert_reads(sentence, side, event)
        page.value(f"{VIEW.format('smaller')}.click()")


def test_a_click_reads_the_foremost_event_there(page, mine):
    """In plan, at the ten largest events: of those whose symbols cover the place, the one highest up."""
    shown = shown_catalogs(mine)
    scale = events_figure.common_scale(shown)
    set_to(page, "direction", "plan")
    page.value(f"{VIEW.format('largest')}.click()")
    covered = 0
    for _ in range(10):
        wanted, at, _ = picked(page, mine)
        place = ring(page)
        page.drag(place, place)
        side, found, sentence = picked(page, mine)
        assert side == wanted
        assert_reads(sentence, side, found)
        location = shown[side]["location"].values
        radius = scale.diameter(np.log10(shown[side]["potency"].values)) * 96 / 72 / 2 * metres_per_pixel(page)
        beside = np.linalg.norm((location - at["location"].values)[:, :2], axis=1)
        heights = location[beside < radius - 1.5 * metres_per_pixel(page), 2]  # surely, within the pixels
        assert float(found["location"][2]) >= heights.max() - 1e-6
        covered += len(heights) > 1
        page.value(f"{VIEW.format('smaller')}.click()")
    assert covered > 0


def test_a_click_reads_no_event_that_is_hidden(page, mine):
    """Where the largest events were before all but the last step were hidden."""
    page.value(f"{VIEW.format('largest')}.click()")
    places = []
    for _ in range(20):
        places.append(ring(page))
        page.value(f"{VIEW.format('smaller')}.click()")
    page.value(f"{VIEW.format('only')}.click()")
    read = []
    for place in places:
        page.drag(place, place)
        if page.value(f"{VIEW.format('root')}.dataset.picked"):
            read.append(str(picked(page, mine)[1]["time"].values.astype("datetime64[M]")))
    assert set(read) == {"2019-09"}


def test_a_click_beside_all_events_reads_none(page):
    page.value(f"{VIEW.format('largest')}.click()")
    box = page.value(f"(({{left, top}}) => [left, top])({VIEW.format('canvas')}.getBoundingClientRect())")
    page.drag((box[0] + 8, box[1] + 45), (box[0] + 8, box[1] + 45))
    assert page.value(f"{VIEW.format('root')}.dataset.picked") == ""
    assert page.value(f"{VIEW.format('reading')}.textContent") == "No event is chosen."


def test_an_event_that_is_no_longer_shown_is_not_read(page):
    page.value(f"{VIEW.format('largest')}.click()")
    assert page.value(f"{VIEW.format('root')}.dataset.picked")
    set_to(page, "step", 0)
    assert page.value(f"{VIEW.format('root')}.dataset.picked") == ""


# ---- names of openings ----


def names_shown(browser: Browser) -> list[str]:
    """The names over both sides."""
    frames(browser)
    return browser.value(
        "[...document.querySelectorAll('.view-name')].filter((one) => one.getAttribute('visibility') !== 'hidden')"
        ".map((one) => one.textContent)"
    )


def choose_opening(browser: Browser, name: str) -> str:
    """Choose an opening in the list; what is said of it."""
    set_to(browser, "opening", name)
    return browser.value(f"{VIEW.format('opening-reading')}.textContent")


def test_openings_are_named_on_both_sides_until_names_are_switched_off(page):
    """Those that are mined by the step, and planned ones."""
    assert sorted(names_shown(page)) == sorted(["drive", "stope_1", "stope_2", "stope_9"] * 2)
    assert page.value(f"{VIEW.format('named')}.textContent") == "All openings are named."
    set_to(page, "step", 0)
    assert sorted(names_shown(page)) == sorted(["drive", "stope_9"] * 2)
    page.value(f"{VIEW.format('names')}.click()")
    assert names_shown(page) == []
    assert page.value(f"{VIEW.format('named')}.textContent") == ""


def test_a_chosen_opening_is_read_by_step(page):
    assert choose_opening(page, "stope_1") == "stope_1: mined in step 2019-08; filled in step 2019-08."
    assert choose_opening(page, "stope_9") == "stope_9: planned, not mined yet."
    assert choose_opening(page, "stope_2") == "stope_2: mined in step 2019-09."
    frames(page)
    assert page.value("document.querySelectorAll('.view-name-chosen').length") == 2
    set_to(page, "step", 1)
    reading = page.value(f"{VIEW.format('opening-reading')}.textContent")
    assert reading == "stope_2: mined in step 2019-09, which comes later."
    assert choose_opening(page, "") == "No opening is chosen."


def test_a_click_at_an_opening_reads_it(page):
    """At the end of the drive, far from its name, with all events hidden; a click at nothing reads none."""
    set_to(page, "direction", "plan")
    set_to(page, "step", 0)
    names_shown(page)
    metres = metres_per_pixel(page)
    box = page.value(f"(({{left, top, width, height}}) => [left, top, width, height])"
                     f"({VIEW.format('canvas')}.getBoundingClientRect())")  # fmt: skip
    middle = np.array([box[0] + box[2] / 4, box[1] + box[3] / 2])  # of the left side
    centre = np.array(page.value("JSON.parse(document.getElementById('view-data').textContent).centre"))
    end = fixtures.ORIGIN + 96.0 * np.array([0.97, 0.48, 0.48]) - centre
    place = tuple(middle + end[:2] * [1, -1] / metres)
    page.drag(place, place)
    assert page.value(f"{VIEW.format('opening')}.value") == "drive"
    assert page.value(f"{VIEW.format('opening-reading')}.textContent").startswith("drive: mined in step history")
    page.drag((box[0] + 8, box[1] + 45), (box[0] + 8, box[1] + 45))
    assert page.value(f"{VIEW.format('opening')}.value") == ""


def test_of_many_openings_the_first_are_named_and_no_name_covers_another(page):
    """Random places, crowded and not: at most twelve names, apart from each other and from what is taken."""
    generator = np.random.default_rng(7)
    for count, spread in [(1, 200), (30, 300), (141, 300), (141, 20), (141, 0)]:
        wanted = [
            {"name": f"drive {i}", "x": 250 + x, "y": 200 + y, "width": 60.0}
            for i, (x, y) in enumerate(generator.uniform(-spread, spread, (count, 2)))
        ]
        taken = {"left": 0, "right": 150, "top": 300, "bottom": 400}
        area = {"left": 0, "right": 500, "top": 30, "bottom": 400}
        placed = page.value(f"ViewNames.place({json.dumps(wanted)}, {json.dumps(area)}, [{json.dumps(taken)}])")
        boxes = [one["box"] for one in placed]
        assert all(
            box["left"] >= 0 and box["right"] <= 500 and box["top"] >= 30 and box["bottom"] <= 400 for box in boxes
        )
        boxes.append(taken)
        for i, a in enumerate(boxes):
            for b in boxes[:i]:
                assert (
                    a["left"] >= b["right"]
                    or b["left"] >= a["right"]
                    or a["top"] >= b["bottom"]
                    or b["top"] >= a["bottom"]
                )
        assert len(placed) == min(count, 12) if spread else 5 <= len(placed) <= 12
        order = [int(one["name"].split()[1]) for one in placed]
        assert order == sorted(order)
        inside = [i for i, one in enumerate(wanted) if 0 <= one["x"] <= 500 and 30 <= one["y"] <= 400]
        assert order[0] == inside[0]


def test_the_deepest_failure_comes_first(page):
    """Openings by hand: deepest first, those without rows after them, planned ones last, the chosen one before all."""
    data = {
        "openings": [{"name": name, "step": step, "filled": -1, "places": 1, "reach": 1.0}
                     for name, step in [("large", 0), ("planned", -1), ("deep", 0), ("later", 1)]],
        "sides": ["roof", "walls", "floor", "face"], "measured": True,
    }  # fmt: skip
    numbers = {"places": [0.0] * 12, "depth": [0.0, 2.0, 0, 0, 3.04, 1.0, 0, 9.0], "side": [0, 0, -1, -1, 1, 2, -1, 0],
               "closure": [0.0, 0.0, 0, 0, 0.0124, 0, 0, 0]}  # fmt: skip
    make = f"new ViewNames.Openings({json.dumps(data)}, {json.dumps(numbers)}, [{{name: 'first'}}, {{name: 'second'}}])"
    assert page.value(f"{make}.inOrder(0, null)") == [2, 0, 1]
    assert page.value(f"{make}.inOrder(1, null)") == [3, 0, 2, 1]
    assert page.value(f"{make}.inOrder(0, 3)") == [3, 2, 0, 1]
    sentence = page.value(f"{make}.sentence([2], 0)")
    assert sentence == (
        "1 of 3 openings are named: those in which rock has failed deepest, if their names have room. "
        "Deepest failure after first: deep 3.0 m (walls)."
    )
    assert page.value(f"{make}.reading(2, 0)") == (
        "deep: mined in step first; after first rock has failed to a depth of 3.0 m (walls); closure 12 mm"
    )
    assert "after first no failed rock" in page.value(f"{make}.reading(0, 0)")


# ---- where there is no view ----


def displayed(browser: Browser, selector: str) -> bool:
    return browser.value(f"document.querySelector('{selector}').getClientRects().length > 0")


def test_print_has_the_figures_and_a_sentence_instead(page):
    assert displayed(page, "#view-root")
    assert not displayed(page, ".view-else")
    page.call("Emulation.setEmulatedMedia", media="print")
    assert not displayed(page, "#view-root")
    assert displayed(page, ".view-else")
    assert page.value("document.querySelectorAll('figure img').length") >= 10
    frames(page)
    page.call("Emulation.setEmulatedMedia", media="")
    frames(page)


@pytest.mark.parametrize("option", ["--disable-3d-apis", "--blink-settings=scriptEnabled=false"])
def test_without_webgl_or_scripts_a_sentence_stands_there(mine, tmp_path, option):
    with Browser(tmp_path, option) as plain:
        plain.open(mine.folder / "report.html")
        plain.wait_for("document.readyState === 'complete'")
        assert not displayed(plain, "#view-root")
        assert "Sections 5 and 10 show failed rock and events" in plain.value(
            "document.querySelector('.view-else').textContent"
        )
        assert displayed(plain, ".view-else")
        assert plain.errors == []


def test_names_from_files_stay_text(browser, mine, tmp_path):
    """A step, an excavation and the mine are called what would end the page's script."""
    renamed = {}
    for name in ("grid", "elastic", "catalog"):
        text = read_dataset(getattr(mine, name))
        text.attrs |= {"mine": HOSTILE}
        if name == "grid":
            text.attrs["excavation_names"] = json.dumps([HOSTILE, "stope_1", "stope_2", "stope_9"])
        if name == "catalog":
            steps = text["step"].values.astype(object)
            text["step"] = ("event", np.where(steps == "2019-09", HOSTILE, steps).astype(str), text["step"].attrs)
        renamed[name] = tmp_path / f"{name}.nc"
        write_dataset(text, renamed[name])
    steps = [tmp_path / path.name for path in mine.steps]
    for path, own in zip(steps, mine.steps, strict=True):
        state = read_dataset(own)
        write_dataset(state.assign_attrs(step=HOSTILE) if own.stem == "2019-09" else state, path)
    config = json.loads(json.dumps(fixtures.CONFIG).replace('"2019-09"', json.dumps(HOSTILE)))
    config["excavations"][0]["name"] = HOSTILE
    fixtures.write_page(**mine.arguments(
        config=config, steps=steps, events=[], record=None, comparison=None, output=tmp_path / "report.html",
        figures=tmp_path / "figures", **renamed,
    ))  # fmt: skip
    assert not re.search(re.escape(HOSTILE[:20]), (tmp_path / "report.html").read_text())
    browser.errors.clear()
    browser.open(tmp_path / "report.html")
    browser.wait_for(READY)
    assert browser.value("window.harmed") is None
    assert browser.value(f"{VIEW.format('step-name')}.textContent") == HOSTILE
    browser.value(f"{VIEW.format('only')}.click()")
    browser.value(f"{VIEW.format('largest')}.click()")
    assert choose_opening(browser, HOSTILE).startswith(HOSTILE)
    assert f"step {HOSTILE}; " in browser.value(f"{VIEW.format('reading')}.textContent")
    assert browser.errors == []


def test_a_mine_without_events_shows_rock_and_openings(browser, mine, tmp_path):
    none = {"catalog": None, "record": None, "comparison": None, "events": []}
    fixtures.write_page(**mine.arguments(output=tmp_path / "report.html", figures=tmp_path / "figures", **none))
    browser.errors.clear()
    browser.open(tmp_path / "report.html")
    browser.wait_for(READY)
    browser.value("document.getElementById('view').scrollIntoView()")
    frames(browser)
    assert coloured(np.concatenate(halves(browser, tmp_path / "view.png"), axis=1)) > 0.03
    assert not displayed(browser, "#view-reading")
    assert browser.errors == []
