"""Answer of one study of a catalogue's spread: standard deviations as rows without bounds."""

from matplotlib.figure import Figure

from verification.results import Results
from verification.rows import Row
from verification.spread.figure import draw
from verification.spread.page import Scene
from verification.spread.runs import SOURCES


def answer(results: Results) -> tuple[list[Row], Figure]:
    """Rows and figure of the study. expected: the mine's own run; obtained: the mean; error: the deviation."""
    scene, rows = Scene.of(results), []
    for variance in scene.variances:
        known = variance.defined
        mean = float(known.mean()) if len(known) else float("nan")
        quantity = f"{variance.quantity.title}: {SOURCES[variance.source]}, mean and standard deviation"
        remark = f"{100 * variance.share:.0f} % of the variance" if variance.share == variance.share else ""
        remark = "; ".join(text for text in (remark, variance.why) if text)
        rows.append(Row(quantity, variance.quantity.of(scene.base), mean, variance.deviation, None, remark))
    return rows, draw(scene.base, scene.variances)
