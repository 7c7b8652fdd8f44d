"""Sentences on what each knob gains, made from the runs."""

import numpy as np

from verification.tradeoff.knobs import BY_KEY, SEISMIC
from verification.tradeoff.measures import ITSELF
from verification.tradeoff.points import Point
from verification.tradeoff.runs import Line, Scene

MAX_CHEAP_CHANGE = 0.01  # Change of the main measure up to which a gain in speed is cheap, as a share.
MIN_ERROR_GAIN = 0.1  # Share by which an error has to be smaller before accuracy counts as gained.
CHEAP_TEXT = f"{100 * MAX_CHEAP_CHANGE:g} %"


def share(value: float, sign: bool = False) -> str:
    """A share in per cent with two digits."""
    if not np.isfinite(value):
        return "–"
    percent = 100 * value
    digits = max(0, 1 - int(np.floor(np.log10(abs(percent))))) if abs(percent) >= 0.005 else 2
    return f"{percent:{'+' if sign else ''}.{min(digits, 2)}f} %"


def speed(scene: Scene, line: Line, member: Point) -> float:
    """How many times as fast a member is as the line's anchor."""
    return scene.cost(line.anchor) / scene.cost(member)


def is_faster(scene: Scene, line: Line, member: Point) -> bool:
    """Whether a member is faster than the anchor by more than the noise."""
    return speed(scene, line, member) > scene.clear


def pace(scene: Scene, line: Line, member: Point) -> str:
    """Speed of a member over that of the anchor, in words."""
    return in_words(scene, speed(scene, line, member))


def in_words(scene: Scene, ratio: float) -> str:
    """A ratio of speeds in words; it counts as one where it is within the noise."""
    if 1 / scene.clear <= ratio <= scene.clear:
        return "takes as long"
    return f"{ratio:.2g} x as fast" if ratio > 1 else f"{1 / ratio:.2g} x as long"


def change(scene: Scene, line: Line, member: Point) -> float:
    """Signed change of the main measure as a share of the anchor's; the difference where the measure is an error."""
    before, after = (point.measures[scene.main.key] for point in (line.anchor, member))
    return after - before if scene.main.kind == ITSELF else after / before - 1.0 if before else np.nan


def effect(scene: Scene, line: Line, member: Point) -> str:
    """Changes in words: of the main measure and its error, or of the events where only these change."""
    before, after = line.anchor.measures, member.measures
    if before[scene.main.key] == after[scene.main.key]:
        if before.get("events", 0) != after.get("events", 0):
            parts = [f"{after['events']:.0f} events instead of {before['events']:.0f}"]
            parts.append(f"the largest log P {after['largest']:.2f} instead of {before['largest']:.2f}")
            if np.isfinite(after["b"]) and np.isfinite(before["b"]):
                parts.append(f"b {after['b']:.2f} instead of {before['b']:.2f}")
            return ", ".join(parts)
        return "the same to the last digit"
    errors = [scene.error(point, scene.main) for point in (line.anchor, member)]
    was, now = share(errors[0]), share(errors[1])
    if scene.main.kind == ITSELF:
        return f"error of {scene.main.title} {now} instead of {was}"
    text = f"{scene.main.title} {share(change(scene, line, member), sign=True)}"
    return f"{text} (error {now} instead of {was})" if np.isfinite(errors).all() else text


def verdict(scene: Scene, line: Line) -> str:
    """Sentence on whether the knob gains speed or accuracy."""
    knob = BY_KEY[line.knob]
    if line.knob in SEISMIC:
        return "A choice of what one event is, of which time knows nothing."
    others = [member for member in line.members if member is not line.anchor]
    faster = [member for member in others if is_faster(scene, line, member)]
    if not faster:
        slower = [member for member in others if speed(scene, line, member) < 1 / scene.clear]
        better = [member for member in slower if gain(scene, line, member) > MIN_ERROR_GAIN]
        if better:
            return "Buys no speed here; it can buy accuracy."
        return "Buys nothing here: no value is clearly faster."
    cheap = [member for member in faster if abs(change(scene, line, member)) <= MAX_CHEAP_CHANGE]
    if not cheap:
        return f"Buys speed for more than {CHEAP_TEXT} of {scene.main.title}."
    best = max(cheap, key=lambda member: speed(scene, line, member))
    value = knob.text(best.settings[line.knob])
    return f"Buys {speed(scene, line, best):.2g} x at {value}, for less than {CHEAP_TEXT} of {scene.main.title}."


def gain(scene: Scene, line: Line, member: Point) -> float:
    """Share by which the error of the main measure is smaller than the anchor's."""
    return 1.0 - scene.error(member, scene.main) / (scene.error(line.anchor, scene.main) or np.nan)


def sentence(scene: Scene, line: Line) -> str:
    """Sentence on a whole line: speed and changes from its anchor to each other value."""
    knob = BY_KEY[line.knob]
    parts = [
        f"to {knob.text(member.settings[line.knob])}: {pace(scene, line, member)}, {effect(scene, line, member)}"
        for member in line.members
        if member is not line.anchor
    ]
    at = f" (with {line.beside})" if line.beside else ""
    return f"From {knob.text(line.anchor.settings[line.knob])}{at} {'; '.join(parts)}."


def preset_sentence(scene: Scene, point: Point) -> str:
    """Sentence on whether a preset's run is on the Pareto front, and which run dominates it otherwise."""
    error = scene.error(point, scene.main)
    is_base = point is scene.base
    text = f"{'accuracy standard (the base)' if is_base else scene.label(point)}: error {share(error)}"
    if not is_base:
        text += f", {in_words(scene, scene.cost(scene.base) / scene.cost(point))}"
    if not np.isfinite(error):
        return f"{text}: nothing to judge it by."
    better = scene.beaten_by(point)
    if better is None:
        return f"{text}; on the Pareto front."
    words = in_words(scene, scene.cost(point) / scene.cost(better))
    verb = "" if words.startswith("takes") else "is "
    nearer = share(scene.error(better, scene.main))
    return f"{text}; not on the Pareto front: {scene.label(better)} {verb}{words}, error {nearer}."


def price(scene: Scene, line: Line) -> str:
    """Fastest value of a knob in a few words, for the table of all scenes."""
    others = [member for member in line.members if member is not line.anchor]
    fastest = max(others, key=lambda member: speed(scene, line, member))
    knob = BY_KEY[line.knob]
    if not is_faster(scene, line, fastest):
        return "no speed"
    moved = share(change(scene, line, fastest), sign=True)
    return f"{knob.text(fastest.settings[line.knob])}: {speed(scene, line, fastest):.2g} x, {moved}"
