"""One study of speed against accuracy as any study is answered: errors as rows, its figure; nothing is demanded."""

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
