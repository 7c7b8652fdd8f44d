"""A reduced set of the scenes at the extremes, and of their relations; all of them: ``snakemake extremes``."""

import pytest

from verification.extremes.mines import random_mine
from verification.extremes.outcomes import ENDED, FAULTS, Outcome, faults, run
from verification.extremes.relations import RELATIONS, compare, is_rest


@pytest.mark.parametrize("seed", range(16))
def test_a_scene_at_the_extremes_rests_or_says_in_one_line_why_not(seed, tmp_path):
    outcome = run(random_mine(seed), tmp_path)
    assert outcome.kind not in FAULTS, outcome.message


def test_a_distorted_cell_is_rock_by_its_volume_and_not_by_its_samples(tmp_path):
    """In this mine a cell with half of its samples, but less than half of its volume, holds rock above its strength: it
    may fail only next to failed rock. In a cell that is rock by half the same stress is a fault."""
    values = random_mine(337)
    outcome = run(values, tmp_path)
    assert outcome.kind not in FAULTS, outcome.message
    state = outcome.state("second")
    whole = (state.volume.values > 0.0) & (state.failed.values < 0) & (state.excavation.values < 0)
    whole &= state.volume.values > 0.9 * state.cell_size.values[state.cell.values] ** 3
    state.stress.values[whole] *= 100.0
    assert any("above its strength" in fault for fault in faults(values, outcome.stored["grid"], state))


@pytest.mark.parametrize("relation", RELATIONS)
def test_scenes_that_are_alike_answer_alike(relation, tmp_path):
    for seed in (1, 9):
        values = random_mine(seed)
        first = run(values, tmp_path)
        assert "elastic" in first.stored
        assert not compare(relation, values, first, lambda scene: run(scene, tmp_path))


def test_a_rest_from_which_the_other_scheme_runs_away_holds_at_a_tenth_of_the_tolerance(tmp_path):
    """That it runs away is made up."""
    values = random_mine(1)
    first = run(values, tmp_path)
    asked = []

    def other(scene):
        asked.append(scene)
        return Outcome(ENDED, "rock runs away") if len(asked) == 1 else run(scene, tmp_path)

    assert not compare("other scheme", values, first, other)
    assert [scene["solver"]["tolerance"] for scene in asked] == [1e-4, pytest.approx(1e-5)]


def test_a_rest_that_a_tighter_tolerance_undoes_is_none(tmp_path):
    values = random_mine(1)
    first = run(values, tmp_path)
    assert not is_rest(values, first, lambda scene: Outcome(ENDED, "rock runs away"))
    for state in first.stored.values():
        if "node_displacement" in state:
            state.node_displacement.values *= 1.1
    assert not is_rest(values, first, lambda scene: run(scene, tmp_path))


def test_a_rest_may_move_rock_that_has_failed_otherwise(tmp_path):
    """In this mine rock without residual cohesion has failed all around two nodes, and comes to rest elsewhere at a
    tenth of the tolerance; all other nodes move alike."""
    values = random_mine(80)
    assert is_rest(values, run(values, tmp_path), lambda scene: run(scene, tmp_path))
