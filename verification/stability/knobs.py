"""All knobs by key. Each is one job of the targets."""

import re

from verification.stability.cases import Knob
from verification.stability.keys import SEEDS
from verification.stability.random_scenes import MISTAKES, of_seeds
from verification.stability.rock import ROCK
from verification.stability.shapes import SHAPES

BY_KEY = {knob.key: knob for knob in (*ROCK, *SHAPES, MISTAKES)}


def knob_of(key: str) -> Knob:
    """The knob of a key. Raises KeyError if there is none."""
    seeds = re.fullmatch(SEEDS, key)
    return of_seeds(*map(int, seeds.groups())) if seeds else BY_KEY[key]
