"""All knobs, by key: one job of the target each."""

from verification.stability.keys import KEYS
from verification.stability.random_scenes import RANDOM
from verification.stability.rock import ROCK
from verification.stability.shapes import SHAPES

_ALL = {knob.key: knob for knob in (*ROCK, *SHAPES, *RANDOM)}
BY_KEY = {key: _ALL.pop(key) for key in KEYS}
if _ALL:
    raise KeyError(f"verification/stability/keys.py: these knobs are missing: {', '.join(_ALL)}")
