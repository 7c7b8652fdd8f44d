"""Cells across an opening: its thickness whatever its place and direction, and how many cells it needs."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mpm_core.geometry.shapes import shape_of, solid_of
from mpm_core.geometry.solids import Outside, Solid
from mpm_core.geometry.thickness import cells_across

CELL = 4.0


def solid(shape: str, **keys) -> Solid:
    return solid_of(shape_of({"shape": shape} | keys, 3, "excavations.x"), 3, "x")


def turned(box: Solid, angles, shift) -> Solid:
    """The solid turned about z, then about x, and moved."""
    turn, tilt = angles
    about_z = np.array([[np.cos(turn), -np.sin(turn), 0], [np.sin(turn), np.cos(turn), 0], [0, 0, 1]])
    about_x = np.array([[1, 0, 0], [0, np.cos(tilt), -np.sin(tilt)], [0, np.sin(tilt), np.cos(tilt)]])
    return Solid(box.name, box.vertices @ (about_x @ about_z).T + shift, box.facets)


@settings(max_examples=30, deadline=None)
@given(
    cells=st.sampled_from([1.2, 2.0, 2.9, 3.0, 4.0, 4.8]),
    angles=st.tuples(st.floats(0, 3.2), st.floats(-1.5, 1.5)),
    shift=st.tuples(*[st.floats(-1e4, 1e4)] * 3),
)
def test_a_drive_is_narrow_below_three_cells_wherever_it_lies(cells, angles, shift):
    """At any offset and turn: 1.2 cells are told, three are not; a square drive needs three."""
    width = cells * CELL
    drive = turned(solid("box", lower=[0, 0, 0], upper=[width, 100, width]), angles, shift)
    across = cells_across(drive, CELL)
    assert across.cells == pytest.approx(cells, rel=0.005)
    assert across.needed == 3
    assert across.is_narrow() == (cells < 2.95)
    assert across.largest_cell(CELL) == pytest.approx(width / 3, rel=0.1)
    assert across.largest_cell(CELL) <= 1.006 * width / 3


@pytest.mark.parametrize(
    ("opening", "thickness"),
    [
        (solid("tunnel", profile="arched", width=4.8, height=4.8, path=[[0, 0, 0], [90, 20, 5], [120, 80, 9]]), 4.8),
        (solid("tunnel", width=6.0, height=4.5, path=[[0, 0, 0], [9, 9, 1], [12, 0, 2], [30, 2, 2]]), 4.5),
        (solid("cylinder", start=[0, 0, 0], end=[3, 4, 50], radius=3.0), 6.0),
        (solid("sphere", center=[5, 5, 5], radius=7.0), 14.0),
        (solid("prism", lower=0, upper=30, polygon=[[0, 0], [13, 2], [13, 20], [0, 18]]), 13.0),
    ],
)
def test_shapes_are_as_thick_as_their_least_width(opening, thickness):
    """Drives round bends, too, whose stretches overlap; of an oblique stope along the normal of its walls."""
    assert cells_across(opening, CELL).cells * CELL == pytest.approx(thickness, rel=0.03)


def test_a_surface_that_looks_inward_or_has_a_hole_changes_nothing():
    drive = solid("box", lower=[0, 0, 0], upper=[7, 60, 9])
    inward = Solid("x", drive.vertices, drive.facets[:, ::-1])
    opened = Solid("x", drive.vertices, np.delete(drive.facets, 3, axis=0))
    assert cells_across(inward, CELL) == cells_across(drive, CELL)
    assert cells_across(opened, CELL).cells == pytest.approx(7 / CELL, rel=0.01)


@pytest.mark.parametrize(("sides", "needed"), [((8, 60, 60), 2), ((8, 48, 60), 2), ((8, 20, 40), 3), ((8, 8, 60), 3)])
def test_a_slot_needs_two_cells(sides, needed):
    """Thin in one direction only: long and high for its width."""
    across = cells_across(solid("box", lower=[0, 0, 0], upper=list(sides)), CELL)
    assert (across.cells, across.needed) == (pytest.approx(2.0, rel=1e-3), needed)
    assert across.is_narrow() == (needed == 3)
    assert across.is_narrow(4)  # for fill


def test_openings_of_a_section_are_measured_in_its_plane():
    for sides, needed in (((5.0, 5.0), 3), ((5.0, 40.0), 2)):
        shape = shape_of({"shape": "box", "lower": [0, 0], "upper": list(sides)}, 2, "excavations.x")
        across = cells_across(solid_of(shape, 2, "x"), 2.0)
        assert (across.cells, across.needed) == (pytest.approx(2.5, rel=1e-3), needed)


def test_a_surface_without_area_or_volume_is_no_cell_thick():
    corners = np.array([[0.0, 0, 0], [9, 0, 0], [0, 9, 0]])
    for facets in ([[0, 0, 1], [1, 1, 2]], [[0, 1, 2], [0, 2, 1]]):
        assert cells_across(Solid("x", corners, np.array(facets)), CELL).cells == pytest.approx(0.0, abs=1e-3)


def test_a_body_under_load_is_no_opening():
    disc = solid("box", lower=[0, 0, 0], upper=[1, 1, 1])
    assert not cells_across(Outside(disc, np.zeros(3), np.ones(3)), CELL).is_narrow()
