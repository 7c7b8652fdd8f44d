"""A reduced set of the random scenes of random_scenes.py."""

import pytest

from tests.mechanics.random_scenes import elastic_difference, make, outcome

SEEDS = [*range(48), 658]
"""some 30 at rest, 15 refused; a third of them with loose pieces; and what has failed"""


@pytest.mark.parametrize("seed", SEEDS)
def test_a_random_scene_comes_to_rest_or_is_refused_in_one_line(seed, tmp_path):
    """Any mix of faces, voids and blocks: no other end, finite stress, motion of less than a cell."""
    kind, words = outcome(seed, tmp_path)
    assert kind in ("rest", "refused"), words


@pytest.mark.parametrize("seed", range(0, 40, 2))
def test_both_schemes_give_the_elastic_stress_of_a_random_scene(seed, tmp_path):
    """The scene's own scheme at the default tolerance and the other one at 1e-9."""
    difference = elastic_difference(seed, tmp_path)
    assert difference is None or difference < 1e-3, make(seed).keywords
