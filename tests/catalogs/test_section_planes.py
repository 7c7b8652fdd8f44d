"""Planes by point, strike and dip: closed geometry, what their points lie in against a slow twin, pages, bad input."""

import numpy as np
import pytest
import report_fixtures as fixtures
from hypothesis import given
from hypothesis import strategies as st
from mechanics.scenes import ball, excavation, grid_around, make_dataset, make_scene
from mechanics.test_grid_stage import block, grid_slice

from catalogs.figures.planes import FILLED, NOWHERE, ROCK, VOID, look_up
from catalogs.report.sections import planes
from catalogs.settings import ReportSettings, SectionPlane
from catalogs.sources.section_planes import Plane, along_excavation
from common.errors import InputError
from mpm_core.stages.grid_stage import make_grid

ANGLES = {"strike": st.floats(-360, 360), "dip": st.floats(0, 90)}


@given(**ANGLES)
def test_the_strike_is_level_and_the_plane_dips_to_its_right(strike, dip):
    plane = Plane.of([1.0, 2.0, 3.0], strike, dip)
    basis = np.stack([plane.along, plane.up, plane.toward])
    np.testing.assert_allclose(basis @ basis.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(basis) == pytest.approx(1.0)  # seen from `toward`, along points right and up upward
    assert plane.along[2] == 0.0
    turn = np.degrees(np.arctan2(plane.along[0], plane.along[1])) - strike
    assert abs((turn + 180.0) % 360.0 - 180.0) < 1e-6
    right = np.array([plane.along[1], -plane.along[0], 0.0])
    down = -plane.up
    assert np.degrees(np.arctan2(-down[2], down @ right)) == pytest.approx(dip, abs=1e-6)


@given(seed=st.integers(0, 2**32 - 1), **ANGLES)
def test_coordinates_lead_back_and_distances_are_those_of_the_plane(seed, strike, dip):
    generator = np.random.default_rng(seed)
    plane = Plane.of(generator.normal(0, 1e6, 3), strike, dip)
    flat = generator.normal(0, 100, (9, 2))
    places = plane.places(flat)
    again, distance = plane.coordinates(places + 7.0 * plane.toward)
    np.testing.assert_allclose(again, flat, atol=1e-7)
    np.testing.assert_allclose(distance, 7.0, atol=1e-7)


@given(seed=st.integers(0, 2**32 - 1), **ANGLES)
def test_the_outline_is_on_the_faces_of_the_box(seed, strike, dip):
    """And there is one exactly where the plane does not miss the box."""
    generator = np.random.default_rng(seed)
    lower, upper = np.array([-3.0, -2.0, -1.0]), np.array([3.0, 4.0, 5.0])
    plane = Plane.of(generator.normal(0, 4, 3), strike, dip)
    outline = plane.outline(lower, upper)
    assert (len(outline) > 0) == (plane.misses(lower, upper) == 0.0)
    for place in plane.places(outline):
        assert (place >= lower - 1e-9).all()
        assert (place <= upper + 1e-9).all()
        assert min(np.abs(place - lower).min(), np.abs(place - upper).min()) < 1e-9


def test_distance_of_a_plane_from_a_box():
    plane = Plane.of([0.0, 0.0, 10.0], 90.0, 0.0)
    assert plane.misses(np.zeros(3), np.full(3, 4.0)) == pytest.approx(6.0)
    slanted = Plane.of([0.0, -10.0, 0.0], 90.0, 45.0)  # dips to the south
    assert slanted.misses(np.zeros(3), np.full(3, 1.0)) == pytest.approx(9.0 / np.sqrt(2.0))


@pytest.mark.parametrize(("upper", "strike"), [([22.0, 10.0, 10.0], 90.0), ([10.0, 22.0, 10.0], 0.0)])
def test_along_an_excavation(upper, strike):
    """A drive to the east, and one to the north: upright, through the middle."""
    grid = make_grid(grid_slice(block([2.0, 6.0, 6.0] if strike else [6.0, 2.0, 6.0], upper), coarse_cell=4.0), {})
    plane = along_excavation(grid, 0)
    assert (plane.strike, plane.dip) == (pytest.approx(strike, abs=1e-6), 90.0)
    np.testing.assert_allclose(plane.point, [12.0, 8.0, 8.0] if strike else [8.0, 12.0, 8.0], atol=1e-6)
    assert along_excavation(grid, 1) is None


@pytest.mark.parametrize(("fill", "cut_cells"), [(None, "mean"), ("fill", "mean"), (None, "subdivide")])
def test_what_points_lie_in_is_what_the_samples_say(fill, cut_cells):
    """Place by place: the sample of the void's own solid that it lies in; outside of the domain nothing."""
    from mechanics.scenes import host_everywhere, pieces_of

    from export.failed_boxes import rock_samples
    from mpm_core.files.state_datasets import state_dataset
    from mpm_core.model.model import build_model

    shape = ball([12.0, 11.0, 13.0], 5.3)
    scene = make_scene(None, excavations=[excavation(fill=fill)], cut_cells=cut_cells)
    cells = grid_around([shape], [3] * 3, 3, 8.0)
    grid = make_dataset(scene, cells, [shape])
    model = build_model(scene, cells, host_everywhere(cells), pieces_of(cells, [shape]))
    rating = np.ones(model.particles.count), np.zeros(model.particles.count)
    state = state_dataset(model, model.virgin_state(), model.material_volumes(0), rating, {}, {"step_index": 0})
    places = np.random.default_rng(1).uniform(-1.0, 25.0, (3000, 3))
    kind, particle = look_up(grid, state, [], places)
    samples = rock_samples(state, grid, [excavation(fill=fill)], cells)
    origin, size = grid["cell_origin"].values, grid["cell_size"].values
    for place, found, own in zip(places, kind, particle, strict=True):
        (cell,) = (
            np.flatnonzero(((place >= origin) & (place < origin + size[:, None])).all(axis=1))
            if ((place >= 0).all() and (place < 24).all())
            else (-1,)
        )
        if cell < 0:
            assert found == NOWHERE
            continue
        sub = np.floor((place - origin[cell]) / size[cell] * 4).astype(int) @ [1, 4, 16]
        is_rock = bool(samples[cell] >> np.uint64(sub) & np.uint64(1))
        assert found == (ROCK if is_rock else FILLED if fill else VOID)
        assert not is_rock or state["cell"].values[own] == cell
    assert (kind == (FILLED if fill else VOID)).sum() > 50
    planned, _ = look_up(grid, state, [0], places)
    assert not (planned == FILLED).any() or fill
    assert (planned == VOID).sum() < (kind == VOID).sum() or fill


def test_the_report_shows_chosen_planes(mine, tmp_path, monkeypatch):
    """One by its point, one along an excavation, and one that misses the surroundings, in one line."""
    evidence = fixtures.evidence_of(**mine.arguments())
    grid = evidence.grid
    name = fixtures.evidence_of(**mine.arguments()).excavations[0].name
    lower, upper = np.array(grid.attrs["domain_lower"]), np.array(grid.attrs["domain_upper"])
    middle = (0.5 * (lower + upper)).tolist()
    far = [middle[0], middle[1], float(upper[2]) + 500.0]
    given = [
        {"name": "by_point", "point": middle, "strike": 30.0, "dip": 70.0},
        {"name": "along", "excavation": name, "within": 1000.0},
        {"name": "far", "point": far, "strike": 0.0, "dip": 0.0},
    ]
    evidence.sections = tuple(SectionPlane.of(one) for one in given)
    saved = {}

    class Gallery:
        def add(self, name, figure):
            figure.canvas.draw()
            saved[name] = figure
            return {"name": name}

    shown = planes.section(evidence, Gallery())
    assert list(saved) == ["section_by_point", "section_along"]
    assert [one["name"] for one in shown] == ["by_point", "along", "far"]
    assert f"{evidence.resolved.sizes['event']} modelled" in shown[1]["about"]
    assert "passes the surroundings of the excavations" in shown[2]["none"]
    for figure in saved.values():
        axes = figure.axes[0]
        assert "(m)" in axes.get_xlabel()
        assert "(m)" in axes.get_ylabel()
        image = axes.images[0].get_array()
        assert (image[..., 3] > 0).any()
    assert saved["section_along"].axes[0].get_ylabel() == "upward (m)"
    evidence.sections = ()
    assert planes.section(evidence, Gallery()) is None


def test_the_point_of_a_plane_is_told_to_the_decimetre():
    """Of six digits a northing had ten metres."""
    assert "(512345.3, 4096123.4, -55.0) m" in planes.about(
        Plane.of([512345.26, 4096123.4, -55.0], 30.0, 70.0), 5.0, {}
    ).replace("\u2212", "-")


def test_only_events_near_a_plane_are_drawn(mine):
    """On both sides of it, at their coordinates in it."""
    evidence = fixtures.evidence_of(**mine.arguments())
    events = evidence.resolved
    plane = Plane.of(events["location"].values.mean(axis=0), 40.0, 60.0)
    apart = (events["location"].values - plane.point) @ plane.toward
    within = float(np.median(np.abs(apart)))
    place, size = planes._near(events, plane, within)
    near = np.abs(apart) <= within
    assert 0 < near.sum() < len(near)
    assert (apart[near] > 0).any()
    assert (apart[near] < 0).any()
    np.testing.assert_allclose(size, np.log10(events["potency"].values[near]))
    np.testing.assert_allclose(plane.places(place) + apart[near, None] * plane.toward, events["location"].values[near])


def test_colours_are_those_of_the_particles(mine):
    """Failed rock in a horizontal plane is red where the particle of the cell has failed."""
    evidence = fixtures.evidence_of(**mine.arguments())
    state = evidence.state
    place = state["position"].values[np.flatnonzero((state["failed"].values >= 0) & (state["volume"].values > 0))[0]]
    plane = Plane.of(place, 90.0, 0.0)
    tiny = np.full(2, 1e-3)
    colour = planes.picture(evidence.grid, state, evidence.planned, plane, -tiny, tiny)
    np.testing.assert_allclose(colour[..., :3], np.broadcast_to(planes.to_rgb(planes.FAILED), colour[..., :3].shape))


def test_names_of_planes_differ():
    with pytest.raises(InputError, match="stands twice"):
        ReportSettings.of({"sections": [{"name": "a", "excavation": "x"}, {"name": "A", "excavation": "y"}]}, "report")
