"""What the view that can be turned is given: surfaces that enclose what cells hold, events with their steps."""

import base64
import hashlib
import json
import re
import zlib
from dataclasses import replace

import numpy as np
import pytest
import report_fixtures as fixtures
from hypothesis import given, settings
from hypothesis import strategies as some

from catalogs.figures import events_figure, style, views
from catalogs.report.evidence import Evidence
from catalogs.report.page import SCRIPTS, content_security_policy
from catalogs.report.sections import view
from catalogs.report.sections.balls import ball_rows
from catalogs.report.sections.view import CellSet, enclosed_volume, section
from common.mine_grid import GridMap
from common.part_centers import part_centers

MODELLED, RECORDED = "Modelled", "Recorded (twin)"
BROWSER = SCRIPTS[0].parent
OWN_SCRIPTS = ("view_names.js", "view.js")


def evidence_of(mine: fixtures.Mine, **changes) -> Evidence:
    return fixtures.evidence_of(**mine.arguments(**changes))


@pytest.fixture(scope="module")
def evidence(mine) -> Evidence:
    return evidence_of(mine)


@pytest.fixture(scope="module")
def data(evidence) -> dict:
    """As the page hands it over: through JSON."""
    shown = {MODELLED: evidence.resolved, RECORDED: evidence.record}
    return json.loads(json.dumps(view.view_data(evidence, shown)))


def unpacked(array: dict) -> np.ndarray:
    """As view.js does it."""
    flat = np.frombuffer(zlib.decompress(base64.b64decode(array["base64"])), np.dtype(array["type"])).copy()
    stride = array["stride"]
    for place in range(stride, len(flat) if stride else 0):
        flat[place] += flat[place - stride]
    return flat


def is_closed(triangles: np.ndarray) -> bool:
    """Whether every edge is passed as often in one direction as in the other: no hole, and one orientation."""
    edges = triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    _, index = np.unique(np.sort(edges, axis=1), axis=0, return_inverse=True)
    return not np.bincount(index.ravel(), np.where(edges[:, 0] < edges[:, 1], 1, -1)).any()


def cells_of(share: np.ndarray, edge: float = 1.0) -> CellSet:
    """The cells of a box of shares, those that hold nothing left out."""
    cell = np.argwhere(share > 0)
    return CellSet.of(cell, share[share > 0], edge, np.zeros(3))


# ---- surfaces ----


def test_surface_of_a_ball_lies_at_its_radius():
    """A ball of 7 edges' radius, shares by distance from the wall; 0.15 edges, since walls curve within a cell."""
    distance = np.linalg.norm(np.indices((18, 18, 18)).transpose(1, 2, 3, 0) + 0.5 - 9.0, axis=-1)
    vertices, triangles = cells_of(np.clip(7.5 - distance, 0, 1)).surface()
    np.testing.assert_allclose(np.linalg.norm(vertices - 9.0, axis=1), 7.0, atol=0.15)
    assert enclosed_volume(vertices, triangles) == pytest.approx(4 / 3 * np.pi * 7**3, rel=0.01)
    assert is_closed(triangles)


def test_surface_of_a_box_has_its_walls():
    """Twelve by ten by eight whole cells: walls at the cells' faces, within a tenth of an edge, and its volume."""
    share = np.zeros((14, 12, 10))
    share[1:13, 1:11, 1:9] = 1.0
    vertices, triangles = cells_of(share).surface()
    np.testing.assert_allclose(vertices.min(axis=0), 1.0, atol=0.1)
    np.testing.assert_allclose(vertices.max(axis=0), [13.0, 11.0, 9.0], atol=0.1)
    assert enclosed_volume(vertices, triangles) == pytest.approx(12 * 10 * 8, rel=0.01)


def test_an_opening_narrower_than_a_cell_is_drawn():
    """A slot of a third of a cell's width: it has that width, where a level of one half would leave nothing."""
    share = np.zeros((3, 20, 20))
    share[1] = 1 / 3
    vertices, triangles = cells_of(share).surface()
    assert np.ptp(vertices[:, 0]) == pytest.approx(1 / 3, rel=0.1)
    assert enclosed_volume(vertices, triangles) == pytest.approx(400 / 3, rel=0.02)


@settings(max_examples=30, deadline=None)
@given(some.integers(0, 2**32 - 1), some.floats(0.05, 0.9))
def test_any_failed_rock_keeps_its_volume(seed, density):
    """Whole cells here and there, however they touch: a closed surface of their volume."""
    share = (np.random.default_rng(seed).random((6, 6, 6)) < density).astype(float)
    vertices, triangles = cells_of(share).surface()
    assert enclosed_volume(vertices, triangles) == pytest.approx(share.sum(), rel=0.03)
    assert is_closed(triangles)


def test_larger_cells_hold_the_same_volume_in_the_same_place():
    share = np.random.default_rng(2).random((7, 5, 9))
    fine = cells_of(share, edge=2.0)
    coarse = fine.coarsened()
    assert coarse.edge == 4.0

    def moments(cells: CellSet) -> np.ndarray:
        volume = cells.share * cells.edge**3
        middle = (cells.cell // (1 if cells is coarse else 2) + 0.5) * 4.0  # of the larger cell
        return np.array([volume.sum(), *(volume @ middle)])

    np.testing.assert_allclose(moments(coarse), moments(fine))


# ---- the data of a mine ----


def volumes_of(surfaces: dict) -> list[tuple[float, np.ndarray, np.ndarray]]:
    """Volume m3 and the extent of each part of surfaces, relative to the middle of the view."""
    vertices = np.array(surfaces["origin"]) + unpacked(surfaces["vertices"]).reshape(-1, 3) * surfaces["unit"]
    triangles = unpacked(surfaces["triangles"]).reshape(-1, 3)
    found, vertex, triangle = [], 0, 0
    for part in surfaces["parts"]:
        own = vertices[vertex : vertex + part["vertices"]]
        corners = triangles[triangle : triangle + part["triangles"]] - vertex
        found.append((enclosed_volume(own, corners), own.min(0), own.max(0)))
        vertex, triangle = vertex + part["vertices"], triangle + part["triangles"]
    assert (vertex, triangle) == (len(vertices), len(triangles))
    return found


def test_openings_have_volume_place_step_and_fill_of_the_excavations(data, mine, evidence):
    """A drive that stays open, a stope filled at once, one whose fill is planned, one that is planned itself."""
    openings = {
        (part["step"], part["filled"]): volume
        for name in ("openings", "planned")
        for part, volume in zip(data[name]["parts"], volumes_of(data[name]), strict=True)
    }
    assert set(openings) == {(0, -1), (1, 1), (2, -1), (-1, -1)}
    drawn = json.loads(evidence.grid.attrs["excavation_volume_grid"])
    for key, index in (((0, -1), 0), ((1, 1), 1), ((2, -1), 2), ((-1, -1), 3)):
        volume, low, high = openings[key]
        box = fixtures.ORIGIN + fixtures.BOXES[index] * 96.0 - data["centre"]
        assert volume == pytest.approx(drawn[index], rel=0.05)
        np.testing.assert_allclose([low, high], box, atol=0.6 * 4.0)  # cells of 4 m


def test_failed_rock_has_the_volume_of_the_particles_that_the_figures_draw(data, evidence):
    state = evidence.state
    spacing, failed = state["spacing"].values, state["failed"].values
    drawn = state["volume"].values > (1 - views.MIN_EXCAVATED_SHARE_DRAWN) * spacing**3
    steps = [part["step"] for part in data["rock"]["parts"]]
    assert steps == [0, 1, 2]  # in order: the view draws a run of them
    for step, (volume, low, high) in zip(steps, volumes_of(data["rock"]), strict=True):
        own = (failed == step) & drawn
        assert volume == pytest.approx((spacing[own] ** 3).sum(), rel=0.01)
        place = part_centers(state)[own] - data["centre"]
        np.testing.assert_allclose([low, high], [place.min(0) - 2.0, place.max(0) + 2.0], atol=2.1)


def test_particles_of_two_sizes_fill_their_cells(evidence):
    """One cell with one particle, its neighbour with eight: both are full."""
    state = evidence.state.isel(particle=slice(0, 9)).copy(deep=True)
    corner, size = np.array([10.0, 20.0, 30.0]) + evidence.grid.attrs["domain_lower"], 4.0
    eighth = (np.indices((2, 2, 2)).reshape(3, 8).T + 0.5) * size / 2
    state["position"][:] = corner + np.concatenate([[[2.0, 2.0, 2.0]], eighth + np.array([size, 0.0, 0.0])])
    state["spacing"][:] = [size] + [size / 2] * 8
    state["volume"][:] = state["spacing"] ** 3
    state["failed"][:] = 1
    state = state.drop_vars(["cell_origin", "cell_size"])
    (found,) = view.failed_cells(replace(evidence, state=state)).values()
    assert found.edge == size / 2
    assert len(found.cell) == 16
    np.testing.assert_allclose(found.cell.min(axis=0) * found.edge, [10.0, 20.0, 30.0])
    np.testing.assert_allclose((found.cell.max(axis=0) + 1) * found.edge, [18.0, 24.0, 34.0])


def test_many_cells_are_drawn_as_fewer_larger_ones(evidence, monkeypatch):
    own = view.failed_cells(evidence)
    count = sum(len(one.cell) for one in own.values())
    monkeypatch.setattr(view, "MAX_CELLS", count // 2)
    larger = view.failed_cells(evidence)
    assert sum(len(one.cell) for one in larger.values()) <= count // 2
    for step, cells in larger.items():
        assert cells.edge > own[step].edge
        assert (cells.share * cells.edge**3).sum() == pytest.approx((own[step].share * own[step].edge ** 3).sum())


def test_events_have_the_numbers_of_the_catalogues(data, evidence):
    for one, catalog in zip(data["catalogues"], (evidence.resolved, evidence.record), strict=True):
        assert one["count"] == catalog.sizes["event"]
        place = unpacked(one["position"]).reshape(-1, 3) + data["centre"]
        np.testing.assert_allclose(place, catalog["location"].values, atol=1e-3)
        np.testing.assert_allclose(unpacked(one["log_potency"]), np.log10(catalog["potency"].values), atol=1e-5)
        np.testing.assert_allclose(unpacked(one["mw"]), catalog["mw"].values, atol=1e-5)
        seconds = catalog["time"].values.astype("datetime64[ms]").astype(float) / 1e3
        np.testing.assert_allclose(unpacked(one["time"]), seconds, atol=1e-3)
    names = np.array([step["name"] for step in data["steps"]])
    modelled, recorded = (unpacked(one["step"]) for one in data["catalogues"])
    assert list(names[modelled]) == list(evidence.resolved["step"].values)
    assert list(names[recorded]) == list(evidence.record["time"].values.astype("datetime64[M]").astype(str))


def test_places_in_the_mines_own_grid(evidence, data):
    """As view.js computes them from the places of events, and as the table of the largest events gives them."""
    grid = GridMap(("north", "east"), 32.0, 0.9996, (100.0, 200.0, 0.0), (7.0, 8.0, 9.0), "ft")
    assert "grid" not in data
    shown = {MODELLED: evidence.resolved}
    found = json.loads(json.dumps(view.view_data(replace(evidence, mine_grid=grid), shown)))
    place = unpacked(found["catalogues"][0]["position"]).reshape(-1, 3)
    own = found["grid"]["centre"] + place @ np.array(found["grid"]["rows"]).T
    location = np.array(found["centre"]) + place
    np.testing.assert_allclose(own, grid.to_grid(location) / 0.3048, atol=1e-6, rtol=0)
    assert found["grid"]["units"] == "ft"
    rows = ball_rows(evidence.resolved, grid)
    expected = grid.to_grid(evidence.resolved["location"].values) / 0.3048
    numbers = [[float(text.replace("−", "-")) for text in row["in_grid"].split(", ")] for row in rows]
    np.testing.assert_allclose(numbers, expected, atol=0.5001)


def test_colours_and_diameters_are_those_of_the_figures(data, evidence):
    rgb = [[int(step["colour"][at : at + 2], 16) / 255 for at in (1, 3, 5)] for step in data["steps"]]
    np.testing.assert_allclose(rgb, style.step_colours([False, True, True]), atol=1 / 255)
    scale = events_figure.common_scale([evidence.resolved, evidence.record])
    sizes = data["sizes"]
    assert (sizes["low"], sizes["high"]) == scale.log_potency
    ends = [float(scale.diameter(np.array(sizes[name]))) for name in ("low", "high")]
    assert [sizes["smallest"], sizes["largest"]] == pytest.approx([end * 96 / 72 for end in ends])


def test_recorded_events_outside_of_the_steps_are_left_out_and_counted(evidence):
    """One before, one at the end of the last step (which does not belong to it), one without a time."""
    record = evidence.record.copy(deep=True)
    record["time"].values[:3] = np.array(["2019-07-31T23:59", "2019-10-01", "NaT"], "datetime64[ns]")
    shown = section(replace(evidence, record=record), None)
    assert view.shown_events(evidence, record).tolist() == list(range(3, record.sizes["event"]))
    assert shown["notes"] == [f"{RECORDED}: the view leaves out 3 events outside of the dates of the steps."]
    assert section(evidence, None)["notes"] == []


def test_of_very_many_events_the_largest_are_shown(evidence, monkeypatch):
    monkeypatch.setattr(view, "MAX_EVENTS", 20)
    chosen = view.shown_events(evidence, evidence.record)
    potency = evidence.record["potency"].values
    assert sorted(potency[chosen]) == sorted(potency)[-20:]
    assert (np.diff(chosen) > 0).all()
    note = section(evidence, None)["notes"][1]
    assert note == f"{RECORDED}: the view leaves out the {len(potency) - 20} smallest."


def test_without_a_record_there_is_one_side(evidence):
    assert section(replace(evidence, record=None), None)["titles"] == [MODELLED]


def test_without_events_rock_and_openings_are_left(evidence):
    none = evidence.catalog.isel(event=slice(0))
    shown = section(replace(evidence, catalog=none, record=None), None)
    assert shown["titles"] == [MODELLED]
    assert not shown["has_events"]
    assert shown["data"]["catalogues"][0]["count"] == 0
    assert shown["data"]["rock"]["parts"]
    assert shown["data"]["openings"]["parts"]


def test_a_mine_in_a_plane_and_one_without_steps_have_no_view(mine, tmp_path):
    flat = fixtures.make_mine(tmp_path, dimension=2, coarse=16.0)
    assert section(evidence_of(flat), None) is None
    assert section(evidence_of(mine, steps=[], events=[], catalog=None, record=None, comparison=None), None) is None


# ---- the scripts ----


def test_the_bundle_is_the_one_that_its_readme_records():
    """Its hash, its version, its licence; smaller than 1 MB."""
    bundle, readme = (BROWSER / "three.min.js").read_bytes(), (BROWSER / "README.md").read_text()
    assert re.findall(r"`([0-9a-f]{64})`", readme) == [hashlib.sha256(bundle).hexdigest()]
    assert len(bundle) < 1e6
    version = re.search(r"three@(\S+)", readme)[1]
    head = f"/* three.js {version}\n{(BROWSER / 'three.LICENSE').read_text().rstrip()}\n*/\n"
    assert bundle.decode().startswith(head)


def test_the_bundle_holds_what_our_script_uses():
    used = set(re.findall(r"THREE\.(\w+)", "".join((BROWSER / name).read_text() for name in OWN_SCRIPTS)))
    listed = re.findall(r"export \{(.*?)\}", (BROWSER / "three.entry.js").read_text(), re.DOTALL)
    assert used == set(re.findall(r"\w+", " ".join(listed)))
    assert all(f"{name}:()=>" in (BROWSER / "three.min.js").read_text() for name in used)


@pytest.mark.parametrize("path", SCRIPTS, ids=lambda path: path.name)
def test_scripts_can_stand_in_a_page_and_ask_no_address(path):
    """No end of a script element, no code from text, and no request."""
    text = path.read_text()
    assert not re.search(r"</script|<!--", text, re.IGNORECASE)
    assert not re.search(r"\beval\(|new Function\(|\bfetch\(|XMLHttpRequest|WebSocket|importScripts|localStorage", text)
    assert {address for address in re.findall(r"https?://[\w./]+", text) if "w3.org" not in address} == set()


def test_the_policy_names_each_script_by_its_digest():
    """The digest of a script is given by https://www.w3.org/TR/CSP3/: here that of the empty text, a constant."""
    policy = content_security_policy(["", "1"])
    assert policy.startswith("default-src 'none'; ")
    assert "script-src 'sha256-47DEQpj8HBSa+/TImW+5JCeuQeRkm5NMpJWZG3hSuFU=' 'sha256-" in policy
    assert "'unsafe-eval'" not in policy
    assert content_security_policy([]).endswith("script-src 'none'")
