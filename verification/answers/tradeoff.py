"""Answer of one study of speed against accuracy: errors as rows without bounds, and its figure."""

from matplotlib.figure import Figure

from verification.results import Results
from verification.rows import Row
from verification.tradeoff.figure import draw
from verification.tradeoff.points import measure_study
from verification.tradeoff.runs import Scene


def answer(results: Results) -> tuple[list[Row], Figure]:
    """Rows and figure of the study."""
    scene = Scene(results.study, measure_study(results))
    rows = []
    for point in scene.points:
        remark = f"{scene.work(point):.3g} s"
        for measure in scene.measures:
            value, error = point.measures[measure.key], scene.error(point, measure)
            quantity = f"{point.variant}: {measure.title}, {measure.unit}"
            rows.append(Row(quantity, scene.truths[measure.key].value, value, error, None, remark))
    return rows, draw(scene)
