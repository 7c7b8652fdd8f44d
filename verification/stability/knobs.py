"""All knobs by key. Those of scenes drawn by seed, with their relations (verification.extremes), and of mistakes in a
mine's file are defined here."""

import copy
import re
from collections.abc import Iterable, Iterator

from verification.extremes.bad_input import FAULTS
from verification.extremes.mines import random_mine
from verification.extremes.outcomes import Outcome
from verification.extremes.relations import RELATIONS, compare
from verification.extremes.tiny_mine import TINY, changed
from verification.stability import SEEDS
from verification.stability.cases import Case, Knob
from verification.stability.rock import ROCK
from verification.stability.shapes import SHAPES

SCENES_PER_COMPARISON = 5  # One in so many scenes is compared with its relations.


def related(name: str):
    """An error that is 0 where the relation of this name holds, else inf."""

    def judge(values: dict, outcome: Outcome, run) -> float:
        return float("inf") if compare(name, values, outcome, run) else 0.0

    return judge


def drawn(seeds: Iterable[int]) -> Iterator[Case]:
    """One case for each seed, and one for each relation where the scene is compared."""
    for seed in seeds:
        if seed % SCENES_PER_COMPARISON:
            yield Case("by itself", seed, random_mine(seed), None, 0.0)
            continue
        for name in RELATIONS:
            yield Case(f"beside itself, {name}", seed, random_mine(seed), related(name), 0.0)


def of_seeds(first: int, last: int) -> Knob:
    """Knob of the scenes of seeds `first` to `last` - 1."""
    return Knob(
        f"seeds_{first}_{last}",
        f"scenes of seeds {first} to {last - 1}",
        "none",
        "Sizes, stresses, strengths, moduli, boundaries and openings over many orders; a third with strength that "
        "varies and rock that may fall; a fifth also scaled, shifted, reordered and by the other scheme.",
        lambda: drawn(range(first, last)),
    )


def mistakes() -> Iterator[Case]:
    """A tiny mine with one mistake in each case, which must be refused in the words of the list."""
    for number, (key, value, begins, says) in enumerate(FAULTS, 1):
        scene = changed(copy.deepcopy(TINY), **{key: value})
        yield Case("one mistake", f"{number}. {key}: {value}"[:64], scene, None, 0.0, refused=(begins, says))


MISTAKES = Knob(
    "mistakes",
    "mistakes in a mine's file",
    "none",
    "Each is to be refused in one line that names its key.",
    mistakes,
)
BY_KEY = {knob.key: knob for knob in (*ROCK, *SHAPES, MISTAKES)}


def knob_of(key: str) -> Knob:
    """The knob of a key. Raises KeyError if there is none."""
    seeds = re.fullmatch(SEEDS, key)
    return of_seeds(*map(int, seeds.groups())) if seeds else BY_KEY[key]
