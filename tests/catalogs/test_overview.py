"""The picture of a scene before anything is solved: what it shows of grid, solids and record."""

import json

import numpy as np
import pytest
from report_fixtures import NAMES, STEPS, make_catalog, make_grid, make_state

from catalogs.figures import style, views
from catalogs.figures.overview import cut_rectangles, overview, rock_colours, write_overview
from catalogs.figures.silhouettes import HALF, SECTIONS
from catalogs.figures.style import MAX_STEPS_IN_KEY, thinned

MINED = [
    {"name": name, "dated": bool(dated), "excavations": [excavation]}
    for (name, *_, dated), excavation in zip(STEPS, NAMES, strict=False)
][:2]  # the last is planned


@pytest.fixture(scope="module")
def grid():
    return make_grid(dimension=3)


@pytest.fixture(scope="module")
def record(grid):
    """Events in the domain, and a note of others that lay outside."""
    events = make_catalog(make_state(grid, len(STEPS) - 1), 60, kind="twin", seed=4)
    events.attrs["filter"] = json.dumps([{"filter": "domain", "before": 66, "after": 60, "farthest": 172004.4}])
    return events


@pytest.fixture(autouse=True)
def report_style():
    """As where the picture is written."""
    with style.applied():
        yield


def labels(figure) -> list[str]:
    return [text.get_text() for text in figure.legends[0].get_texts()]


def texts(figure) -> list[str]:
    """Below the key and below the blocks of the steps."""
    return [text.get_text() for text in figure.texts]


def test_key_names_cells_steps_and_events_outside_the_domain(grid, record):
    """What a user looks for before a run of hours: does all of it lie where it should?"""
    figure = overview(grid, MINED, record)
    found = labels(figure)
    assert found[0] == f"cells of {grid.attrs['coarse_cell']:g} m"
    assert texts(figure)[-2:] == ["history", "2019-08"]
    assert "planned" in found
    assert found[-1] == "60 recorded events\n6 more outside the domain, up to 172,004 m away"


def test_each_material_of_a_block_model_has_a_colour_and_the_host_has_none(grid):
    """The kinds of rock of a model, after one rock body; two kinds are of one material, and one is of no cell."""
    body = np.arange(grid.sizes["cell"]) % 5 - 1
    kinds = {"block_materials": json.dumps(["ore", "host", "ore", "dyke"]), "rock_body_names": json.dumps(["lens"])}
    rock = grid.assign(cell_body=("cell", body.astype(np.int16))).assign_attrs(kinds)
    found = rock_colours(rock)
    assert {label: bodies for label, (_, bodies) in found.items()} == {"rock bodies": [0], "blocks: ore": [1, 3]}
    assert len({colour for colour, _ in found.values()}) == 2
    assert set(found) <= set(labels(overview(rock, MINED, None)))


def test_a_section_and_a_scene_without_record_or_steps(tmp_path):
    """One panel in two dimensions; nothing but planned solids; the file is a picture, twice the same."""
    flat = make_grid(dimension=2)
    figure = overview(flat, [], None)
    assert [axes.get_title(loc="left").split("\n")[0] for axes in figure.axes] == [
        "Section looking north",
        "Domain (section looking north), 96 × 96 m;",
    ]
    assert labels(figure)[-1] == "planned"
    for name in ("one.png", "two.png"):
        write_overview(flat, [], None, tmp_path / name)
    assert (tmp_path / "one.png").read_bytes() == (tmp_path / "two.png").read_bytes()
    assert (tmp_path / "one.png").read_bytes().startswith(b"\x89PNG")


def test_it_is_zoomed_on_the_openings_which_are_named_and_the_domain_is_an_inset(grid, record):
    """Every panel shows all openings, and little else; a name each; the frame in the domain is the plan's."""
    figure = overview(grid, MINED, record)
    along, across, plan, domain = figure.axes
    assert [axes.get_title(loc="left").split("\n")[0] for axes in figure.axes[:3]] == [
        "Section looking north", "Section looking west", "Plan",
    ]  # fmt: skip
    corners = views.piece_corners(grid)
    for axes, sides in ((along, [0, 2]), (across, [1, 2]), (plan, [0, 1])):
        for side, (low, high) in zip(sides, (axes.get_xlim(), axes.get_ylim()), strict=True):
            margin = 0.2 * np.ptp(corners, axis=0).max()
            assert corners[:, side].min() - margin < low <= corners[:, side].min()
            assert corners[:, side].max() <= high < corners[:, side].max() + margin
    assert {text.get_text() for axes in figure.axes for text in axes.texts} == set(NAMES)
    assert not any("are named" in text for text in texts(figure))
    frame = domain.patches[0]
    assert [frame.get_x(), frame.get_x() + frame.get_width()] == pytest.approx(plan.get_xlim())
    assert domain.get_xlim() == pytest.approx([grid.attrs["domain_lower"][0], grid.attrs["domain_upper"][0]])
    for axes in figure.axes:
        box = axes.get_position()
        assert min(box.x0, box.y0) > 0
        assert max(box.x1, box.y1) < 1


def test_a_record_that_is_not_drawn_is_told_and_of_many_openings_the_picture_says_how_many_it_names(grid):
    figure = overview(grid, MINED, None, ["The record is not drawn, since it cannot be read: $events.csv$"])
    assert texts(figure)[0].replace("\n", " ") == "The record is not drawn, since it cannot be read: $events.csv$"
    many = grid.assign_attrs(excavation_names=json.dumps([f"an opening of a long name {n}" * 12 for n in range(4)]))
    figure = overview(many, [], None)
    assert "openings are named, first those of the last step, then the largest." in texts(figure)[0].replace("\n", " ")


@pytest.mark.parametrize("turned", [(1, 1), (1, -1)])
def test_an_oblique_plane_cuts_cells_into_rectangles(grid, turned):
    """Their area is that of the plane in the domain, and each lies in its cell: its middle does."""
    plane = next(one for one in SECTIONS if np.allclose(one.right[:2], np.array(turned) * HALF))
    lower, upper = views.domain(grid)
    middle = (lower + upper) / 2 + [0.3, 0.1, 0.0]
    at = float(plane.normal @ middle)
    cell, corner, size = cut_rectangles(grid, plane, at)
    place = at * plane.normal + (corner + size / 2) @ np.array([plane.right, plane.up])
    inside = place - grid["cell_origin"].values[cell]
    assert (inside >= -1e-6).all()
    assert (inside <= grid["cell_size"].values[cell][:, None] + 1e-6).all()
    x, y = middle[:2] - lower[:2]
    edge = (upper - lower)[0]
    first, last = (min(x, y), min(edge - x, edge - y)) if turned == (1, 1) else (min(x, edge - y), min(edge - x, y))
    assert np.prod(size, axis=1).sum() == pytest.approx((first + last) * np.sqrt(2) * (upper - lower)[2])


@pytest.mark.parametrize("count", [0, 1, MAX_STEPS_IN_KEY, MAX_STEPS_IN_KEY + 1, 200])
def test_the_key_of_many_steps_names_some_from_the_first_to_the_last(count):
    """In order, none twice, with gaps that differ by one at most."""
    named = thinned(list(range(count)))
    assert len(named) == min(count, MAX_STEPS_IN_KEY)
    assert named == sorted(set(named))
    if count:
        assert (named[0], named[-1]) == (0, count - 1)
        assert np.ptp(np.diff(named)) <= 1 if count > 1 else True
