"""Scanned voids in the report: a line for each side, figures with all their walls, and what is not seen said so."""

import logging
from types import SimpleNamespace

import numpy as np
import pytest
from small_mines import load, states_of
from test_scans import BOX, LOWER, compared, prism

from catalogs.figures import style
from catalogs.report import sections
from catalogs.report.gallery import Gallery
from catalogs.report.page import _environment
from catalogs.report.scanned_voids import _in_plane, shown_scans, walls_figure
from catalogs.report.sections import observations


@pytest.fixture(scope="module")
def table(tmp_path_factory):
    """A stope whose eastern wall has broken out by 0.8 m, scanned up to y = 2 m."""
    folder = tmp_path_factory.mktemp("scanned")
    mine = load(folder, [BOX])
    mesh = prism(0.0, LOWER, [6.8, 2.0, 4.0])
    return compared((mine, *states_of(mine, folder)), mesh, folder)[1]


def rendered(content, folder) -> str:
    """Text of the section on instruments."""
    template = _environment(folder / "report.html").get_template("sections/observations.html.j2")
    return template.render(
        observations=content, evidence=None, many=sections.MAX_ROWS_UNFOLDED, section_number=sections.section_number
    )


def test_the_section_shows_scans_without_instruments(table, tmp_path):
    evidence = SimpleNamespace(observations=None, scans=table)
    with style.applied():
        content = observations.section(evidence, Gallery(tmp_path))
    lines = {line.side: line for line in content["scans"]["lines"]}
    assert lines["wall 090"].mean == pytest.approx(0.8, abs=2e-3)
    assert lines["wall 090"].seen == pytest.approx(0.7, abs=0.05)
    assert lines["wall 000"].under == pytest.approx(3.0, abs=2e-3)
    assert content["scans"]["half_cell"] == 0.5
    page = rendered(content, tmp_path)
    assert page.count("<figure>") == 1
    assert page.count("<tr>") == 1 + len(lines)
    assert "0.80" in page
    assert (tmp_path / "scan_1.svg").is_file()
    assert "names no instruments" in rendered(None, tmp_path)
    assert observations.section(SimpleNamespace(observations=None, scans=None), Gallery(tmp_path)) is None


def test_a_figure_has_each_side_twice_and_grey_where_nothing_is_seen(table):
    with style.applied():
        figure = walls_figure(table, "CMS")
    panels = [axes for axes in figure.axes if axes.get_label() != "<colorbar>"]
    assert [axes.get_title(loc="left") for axes in panels[:6]] == [
        "roof", "floor", "wall 000", "wall 090", "wall 180", "wall 270",
    ]  # fmt: skip
    unseen, means = (mesh.get_array() for mesh in panels[3].collections)  # the eastern wall, scanned
    assert np.ma.count(unseen) == pytest.approx(24, abs=9)  # squares of a metre between y = 2 m and 5 m
    np.testing.assert_allclose(means.compressed(), 0.8, atol=2e-3)
    assert np.ma.count(panels[9].collections[0].get_array()) == 0  # the model has values everywhere


def test_a_wall_is_drawn_as_seen_from_within(table):
    """To the right of the eastern wall is the south, of the northern one the east."""
    names = [str(side) for side in table["side"].values]
    for side, axis, sign in (("wall 090", 1, -1.0), ("wall 000", 0, 1.0), ("wall 180", 0, -1.0)):
        row = names.index(side)
        own = np.flatnonzero(table["point_row"].values == row)
        along, up, _ = _in_plane(table, row, own)
        np.testing.assert_allclose(np.diff(along), sign * np.diff(table["place"].values[own, axis]), atol=1e-9)
        np.testing.assert_allclose(up, table["place"].values[own, 2])


def test_a_scan_that_shows_no_wall_has_no_value(tmp_path, caplog):
    """An excavation within another one that is mined: no wall has rock behind it."""
    outer = BOX | {"name": "outer", "lower": ["-9 m", "-8 m", "-7 m"], "upper": ["9 m", "8 m", "7 m"]}
    mine = load(tmp_path, [BOX, outer])
    with caplog.at_level(logging.WARNING):
        rows, table = compared((mine, *states_of(mine, tmp_path)), prism(0.0), tmp_path)
    assert "no wall of its excavations has rock behind it" in caplog.text
    assert list(rows.index) == ["all"]
    assert np.isnan(rows[["overbreak_mean", "elos", "misfit", "depth_mean"]].to_numpy(float)).all()
    with style.applied():
        content = {"lines": [], "curves": None, "others": 0, "scans": shown_scans(table, Gallery(tmp_path))}
    assert "CMS" in rendered(content, tmp_path)
