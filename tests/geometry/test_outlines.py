"""Outlines of prisms: those that turn one way need no search for crossings, and levels that do not nest are refused."""

import numpy as np
import pytest

from common.errors import InputError
from mpm_core.geometry import outlines
from mpm_core.geometry.outlines import check_simple, is_convex, nest


def square(half: float, z: float) -> np.ndarray:
    """A closed line (point, 3) m about the origin."""
    return np.array([[-half, -half, z], [half, -half, z], [half, half, z], [-half, half, z]])


def polygon(count: int, turns: int = 1) -> np.ndarray:
    """Points (count, 2) of a regular polygon, or of a star that goes around several times."""
    angle = np.arange(count) * 2.0 * np.pi * turns / count
    return np.stack([np.cos(angle), np.sin(angle)], axis=1)


@pytest.mark.parametrize("line", [polygon(3), polygon(40), polygon(5)[::-1], square(2.0, 0.0)[:, :2]])
def test_a_line_that_turns_one_way_once_around_is_simple(line, monkeypatch):
    """And is not looked at any further."""
    assert is_convex(line)
    monkeypatch.setattr(outlines, "_pieces", None)
    check_simple(line)


@pytest.mark.parametrize("line", [polygon(5, 2), polygon(7, 3), polygon(4)[[0, 2, 1, 3]], np.tile(polygon(4), (2, 1))])
def test_stars_bow_ties_and_lines_drawn_twice_are_not(line):
    """A star turns one way, too, but more than once around."""
    assert not is_convex(line)
    with pytest.raises(InputError, match="crosses itself"):
        check_simple(line)


def test_lines_within_others_that_stand_above_one_another_are_refused():
    """The innermost of each would be a hole in one and rock beside the other: neither a prism nor a traceback."""
    for lines in ([square(1, 5), square(3, 0), square(4, 9)], [square(1, 5), square(2, 0), square(3, 0), square(4, 9)]):
        with pytest.raises(InputError, match="draw those of each level on a layer of their own"):
            nest(lines, 6.0)
    assert len(nest([square(1, 0), square(3, 0), square(1, 20), square(3, 20)], 6.0)) == 2
