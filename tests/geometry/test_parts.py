"""Parts of a solid: equal volumes that fill it and do not overlap, whatever its form."""

import numpy as np
import pytest

from mpm_core.geometry import Solid, build_shape, contains
from mpm_core.geometry.parts import part_of

U_SHAPE = [[0, 0], [40, 0], [40, 10], [10, 10], [10, 30], [40, 30], [40, 40], [0, 40]]
FORMS = {
    "box far from the origin": {"shape": "box", "lower": [1e6, 7e6, 0], "upper": [1e6 + 40, 7e6 + 20, 30]},
    "sphere": {"shape": "sphere", "center": [5, 5, 5], "radius": 10},
    "two prongs": {"shape": "prism", "polygon": U_SHAPE, "lower": 0, "upper": 20},
}


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("bearing", [0.0, 90.0, 217.0])
@pytest.mark.parametrize("is_inverted", [False, True])
def test_parts_have_equal_volumes_and_fill_the_solid(form, bearing, is_inverted):
    """And follow each other in the direction of advance."""
    solid = build_shape({"name": form, **FORMS[form]}, 3)
    if is_inverted:
        solid = Solid(form, solid.vertices, solid.facets[:, ::-1])
    parts = [part_of(solid, number, 4, bearing) for number in range(1, 5)]
    assert all(part.is_closed for part in parts)
    assert [part.volume for part in parts] == pytest.approx([solid.volume / 4] * 4, rel=1e-9)
    points = np.random.default_rng(1).uniform(*solid.bounds, (3000, 3))
    inside = np.stack([contains(part, points) for part in parts])
    assert (inside.sum(axis=0) == contains(solid, points)).all()
    direction = np.array([np.sin(np.radians(bearing)), np.cos(np.radians(bearing)), 0.0])
    means = [(points[within] @ direction).mean() for within in inside]
    assert (np.diff(means) > 0).all()


def test_a_plane_through_corners_cuts_cleanly():
    """The halves of a prism whose corners lie in the plane between them."""
    points = [[0, 0], [10, 0], [20, 0], [20, 10], [10, 10], [0, 10]]
    solid = build_shape({"name": "b", "shape": "prism", "polygon": points, "lower": 0, "upper": 5}, 3)
    halves = [part_of(solid, number, 2, 90.0) for number in (1, 2)]
    assert all(half.is_closed for half in halves)
    assert [half.volume for half in halves] == pytest.approx([500.0, 500.0])
    assert halves[0].bounds[1][0] == pytest.approx(10.0)
    assert halves[1].bounds[0][0] == pytest.approx(10.0)
