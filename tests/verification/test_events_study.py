"""The study of events, on made-up rock."""

import numpy as np
import pytest

from verification.answers import events
from verification.answers.events import JUDGED, RULES, Rock, halves, measures

SETTINGS = {"link_length": 2.0, "closeness": 0.8}
SHEAR = np.array([0.0, 0, 0, 0, 0, 1.0])
OTHER = np.array([1.0, -1, 0, 0, 0, 0])


def two_bodies(gap=6.0) -> Rock:
    """Two cubes of 64 particles each, a metre apart, with unlike mechanisms."""
    place = np.stack(np.meshgrid(*[np.arange(4.0)] * 3, indexing="ij"), -1).reshape(-1, 3)
    position = np.concatenate([place, np.add(place, [gap + 3.0, 0, 0])])
    return Rock(position, np.repeat([SHEAR, OTHER], 64, axis=0), np.zeros(128, int))


@pytest.mark.parametrize("name", RULES)
def test_every_rule_finds_two_bodies_apart_and_two_parts_of_one(name):
    rock = two_bodies()
    label = RULES[name](rock, 2.0, 0.8)
    assert len(np.unique(label)) == 2
    assert len(np.unique(label[:64])) == len(np.unique(label[64:])) == 1
    alike = Rock(rock.position[:64], rock.potency[:64], np.repeat([0, 1], 32))
    assert len(np.unique(RULES[name](alike, 2.0, 0.8))) == 2


def test_measures_are_those_of_the_potencies():
    """Scalar potency is the root of twice the squares: 2 for SHEAR and for OTHER (tensor shear 1)."""
    number, b, largest = measures(two_bodies(), RULES[JUDGED], 64.0, SETTINGS)
    assert (number, largest) == (2.0, pytest.approx(128.0))
    assert np.isnan(b)  # of two events


def test_halves_of_bodies_apart_are_those_of_the_whole_and_a_rule_that_looks_at_all_rock_is_not():
    rock = two_bodies(gap=20.0)
    assert min(halves(rock, RULES[JUDGED], SETTINGS)) == 1.0

    def by_median(rock, length, closeness):
        return (rock.position > np.median(rock.position, axis=0)).any(axis=1).astype(int)

    wide = Rock(np.random.default_rng(0).uniform(0, 40, (400, 3)), np.tile(SHEAR, (400, 1)), np.zeros(400, int))
    assert min(halves(wide, by_median, SETTINGS)) < 0.5


def test_rows_compare_means_over_runs(monkeypatch):
    monkeypatch.setattr(events, "RULES", {JUDGED: lambda rock, *_: rock})
    monkeypatch.setattr(events, "measures", lambda rock, *_: rock)
    base, found = ([((n, 1.0, 5.0), 0.1) for n in numbers] for numbers in ((10.0, 12.0), (13.0, 11.0)))
    rows = events.compare("a", base, found, 0.1, {}, {"events": 0.1, "b": 0.1, "largest": 0.1})
    assert [row.quantity for row in rows] == [f"a, {JUDGED}: {name}" for name in events.MEASURES]
    assert (rows[0].expected, rows[0].obtained, rows[0].passed) == (11.0, 12.0, True)
    assert rows[0].error == pytest.approx(1 / 11)
