"""First pages of drawn catalogues: right models pass, wrong ones are named by the sentence that they are wrong in."""

import numpy as np
import pytest

from verification.answers.coverage.first_page import CLOSER, Wrong, condemned, pages

CHOSEN = {"catalogues": 12, "resamplings": 99, "days": 90.0, "steps": 3, "spread": 20.0}
CASE = {"events": 60, "modelled": 60, "b": 0.67, "error": 10.0, "bursts": 30}


def shares(case: dict, wrong: Wrong, count: int = 12) -> dict[str, float]:
    """Share of first pages that call the model wrong, by question."""
    found = [condemned(sentences) for _, sentences in pages(case, CHOSEN | {"catalogues": count}, wrong, [3])]
    return {name: np.mean([name in one for one in found]) for name in set().union(*found)}


@pytest.mark.parametrize("runs", [1, 5])
def test_right_models_are_hardly_ever_called_wrong(runs):
    """At most one in 20, over all sentences; of 12 two would be as many as chance allows."""
    assert sum(shares(CASE | {"runs": runs}, Wrong()).values()) <= 2.5 / 12


def test_few_modelled_and_many_recorded_events_miss_no_places():
    """They were always said to."""
    found = shares(CASE | {"events": 200, "modelled": 40, "bursts": 100}, Wrong(), 8)
    assert found.get("places", 0.0) <= 1.5 / 8
    assert found["number and potency"] > 0.2


@pytest.mark.parametrize(
    ("wrong", "question"),
    [
        (Wrong(shift=80.0), "places"),
        (Wrong(scale=5.0), "places"),
        (Wrong(turn=75.0), "directions"),
        (Wrong(b_more=1.5, times=4.0), "sizes"),
        (Wrong(times=8.0), "number and potency"),
    ],
)
def test_wrong_models_are_called_wrong_in_what_they_are(wrong, question):
    assert shares(CASE | {"bursts": 60}, wrong, 8).get(question, 0.0) > 0.6


def test_random_directions_are_not_called_close():
    found = pages(CASE, CHOSEN, Wrong(random=True), [4])
    assert np.mean([bool(CLOSER.search(" ".join(sentences))) for _, sentences in found]) <= 2.5 / 12
