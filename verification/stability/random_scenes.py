"""The core: mines drawn by seed and their relations (verification.extremes), and mistakes in a mine's file."""

import copy
from collections.abc import Iterator

from verification.extremes.bad_input import FAULTS
from verification.extremes.mines import random_mine
from verification.extremes.outcomes import Outcome
from verification.extremes.relations import RELATIONS, compare
from verification.extremes.tiny_mine import TINY, changed
from verification.stability.cases import Case, Knob

SCENES, EVERY = 100, 5  # of which one is compared with its relations
BATCHES = 2


def related(name: str):
    """Judge: 0 where the relation of this name holds, else inf."""

    def judge(values: dict, outcome: Outcome, run) -> float:
        return float("inf") if compare(name, values, outcome, run) else 0.0

    return judge


def drawn(batch: int) -> Iterator[Case]:
    """Every BATCHES-th scene."""
    for seed in range(batch, SCENES, BATCHES):
        names = RELATIONS if seed // BATCHES % EVERY == 0 else ()
        for name in names:
            yield Case(f"beside itself, {name}", seed, random_mine(seed), related(name), 0.0)
        if not names:
            yield Case("by itself", seed, random_mine(seed), None, 0.0)


def mistakes() -> Iterator[Case]:
    """A tiny mine with one mistake each: to be refused, in the words that the list says."""
    for number, (key, value, begins, says) in enumerate(FAULTS, 1):
        scene = changed(copy.deepcopy(TINY), **{key: value})
        yield Case("one mistake", f"{number}. {key}: {value}"[:64], scene, None, 0.0, refused=(begins, says))


RANDOM = (
    *(Knob(f"random_{batch + 1}", f"scenes by seed, {batch + 1} of {BATCHES}", "linear", "Sizes, stresses, strengths, "
         "moduli, boundaries and openings over many orders; a fifth also scaled, shifted, reordered and by the other "
         "scheme.", lambda batch=batch: drawn(batch))
      for batch in range(BATCHES)),
    Knob("mistakes", "mistakes in a mine's file", "words", "Each is to be refused in one line that names its key.",
         mistakes),
)  # fmt: skip
