"""A reduced set of the scenes at the extremes, and of their relations; all of them: ``snakemake extremes``."""

import numba
import pytest

from verification.extremes.mines import random_mine
from verification.extremes.outcomes import FAULTS, run
from verification.extremes.relations import RELATIONS, compare


@pytest.fixture(autouse=True)
def one_thread():
    before = numba.get_num_threads()
    numba.set_num_threads(1)
    yield
    numba.set_num_threads(before)


@pytest.mark.parametrize("seed", range(16))
def test_a_scene_at_the_extremes_rests_or_says_in_one_line_why_not(seed, tmp_path):
    outcome = run(random_mine(seed), tmp_path)
    assert outcome.kind not in FAULTS, outcome.message


@pytest.mark.parametrize("relation", RELATIONS)
def test_scenes_that_are_alike_answer_alike(relation, tmp_path):
    for seed in (1, 9):
        values = random_mine(seed)
        first = run(values, tmp_path)
        assert "elastic" in first.stored
        assert not compare(first, run(RELATIONS[relation](values), tmp_path))
