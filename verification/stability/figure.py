"""Figure of the limits: error of each run against the value of its knob, and which runs ended or were refused."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from catalogs.figures import style
from verification.stability.cases import Knob
from verification.stability.points import ENDED, FAULT, REFUSED, RIGHT, SOUND, WRONG, Point

LOOKS = {  # Mark and colour of each kind, in the palette of Okabe and Ito (2008).
    RIGHT: ("o", "#009e73"),
    SOUND: ("o", "#56b4e9"),
    WRONG: ("X", "#d55e00"),
    ENDED: ("v", "#e69f00"),
    REFUSED: ("s", "#999999"),
    FAULT: ("*", "#000000"),
}
COLUMNS = 3
MIN_DRAWN_ERROR = 1e-9  # Smaller errors are round-off and stand at the lower edge.
BANDS = {SOUND: 2e1, ENDED: 2e2, REFUSED: 2e3, FAULT: 2e4}  # Heights of points that have no error.
BAND_NAMES = ("sound", "ended", "refused", "fault")
AXIS_TOP = 1e5
ERROR_TICKS = (1e-8, 1e-6, 1e-4, 1e-2, 1.0)


def draw(knobs: list[tuple[Knob, list[Point]]]) -> Figure:
    """One panel for each knob with the error of each run. Runs without an error stand in bands above."""
    rows = -(-len(knobs) // COLUMNS)
    figure = style.new_figure(height=2.5 * rows + 0.5)
    panels = figure.subplots(rows, COLUMNS, squeeze=False).reshape(-1)
    for panel, (knob, points) in zip(panels, knobs, strict=False):
        _draw(panel, knob, points)
    for panel in panels[len(knobs) :]:
        panel.set_axis_off()
    handles = [panels[0].plot([], [], mark, color=colour, label=kind)[0] for kind, (mark, colour) in LOOKS.items()]
    handles += panels[0].plot([], [], "_", color="#444444", label="allowed")
    figure.legend(handles=handles, loc="outside lower center", ncols=4)
    return figure


def _draw(panel: Axes, knob: Knob, points: list[Point]) -> None:
    series = list(dict.fromkeys(point.series for point in points))
    # Values that are words are evenly spaced, and their series stand beside each other.
    words = list(dict.fromkeys(point.value for point in points)) if knob.scale == "words" else []
    spread = 0.25 if words else 0.0
    for point in points:
        shift = spread * (series.index(point.series) / max(1, len(series) - 1) - 0.5) * 2
        mark, colour = LOOKS[point.kind]
        x = (words.index(point.value) if words else float(point.value)) + shift
        y = BANDS.get(point.kind) or float(np.clip(point.error, MIN_DRAWN_ERROR, 10.0))
        panel.plot(x, y, mark, color=colour, markersize=4.5, alpha=0.8, markeredgewidth=0.0)
        if point.kind in (RIGHT, WRONG) and point.allowed > 0.0:
            panel.plot(x, point.allowed, "_", color="#444444", markersize=6, zorder=1)
    panel.set(yscale="log", ylim=(MIN_DRAWN_ERROR / 3, AXIS_TOP), title=f"{knob.title[0].upper()}{knob.title[1:]}")
    panel.set_yticks([*ERROR_TICKS, *BANDS.values()], [*(f"{error:.0e}" for error in ERROR_TICKS), *BAND_NAMES])
    panel.minorticks_off()
    panel.axhspan(1.2e1, AXIS_TOP, color="#f4f4f4", zorder=0)
    if words:
        panel.set_xticks(range(len(words)), [_tick(word) for word in words], rotation=90 if len(words) > 6 else 0)
        panel.tick_params(axis="x", labelsize=6.5)
    elif knob.scale == "log":
        panel.set_xscale("log")


def _tick(word) -> str:
    return f"{word:g}" if isinstance(word, float | int) else word
