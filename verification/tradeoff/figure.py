"""Figure of one scene: error against time with the Pareto front, and what each knob changes by itself."""

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from catalogs.figures import style
from verification.plots import plain_ticks
from verification.tradeoff.knobs import BY_KEY, KNOBS
from verification.tradeoff.measures import ITSELF
from verification.tradeoff.points import Point
from verification.tradeoff.runs import Line, SceneRuns
from workflow.accuracy import DRAFT, FINE, STANDARD

COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#555555", "#882255")  # Okabe, Ito; Tol
MARKS = ("o", "s", "^", "D", "v", "P", "X", "h")
PRESET_LOOKS = {DRAFT: ("<", 8), STANDARD: ("*", 13), FINE: (">", 8)}  # Mark and its size.
MIN_DRAWN_CHANGE = 1e-5  # Smaller changes, as shares, stand at the lower edge.
LOOKS = {
    knob.key: {"color": COLOURS[index % len(COLOURS)], "marker": MARKS[(index + index // len(COLOURS)) % len(MARKS)]}
    for index, knob in enumerate(KNOBS)
}


def draw(scene: SceneRuns) -> Figure:
    """Left: error of the main measure against time, a line for each knob. Right: change of measure and time by knob."""
    figure = style.new_figure(height=5.2)
    left, right = figure.subplots(1, 2)
    prices(left, scene)
    changes(right, scene)
    for panel in (left, right):
        panel.grid(which="major", color="#e8e8e8", linewidth=0.6)
    handles, labels = right.get_legend_handles_labels()
    handles += left.get_legend_handles_labels()[0]
    labels += left.get_legend_handles_labels()[1]
    figure.legend(handles, labels, loc="outside lower center", ncols=6)
    return figure


def prices(panel: Axes, scene: SceneRuns) -> None:
    """Error against time, log-log. The front is drawn as steps; its runs have the numbers of the table."""
    for line in scene.lines:
        numbers = [member for member in line.members if not isinstance(member.settings[line.knob], str)]
        for members, look in ((numbers, "-"), ([m for m in line.members if m not in numbers], "none")):
            x, y = [scene.cost(member) for member in members], [_error(scene, member) for member in members]
            _plot(panel, x, y, line, None, look)
    single = {point.variant for line in scene.lines for point in line.members}
    rest = [point for point in scene.points if point.variant not in single]
    work, error = [scene.work(point) for point in rest], [_error(scene, point) for point in rest]
    panel.plot(work, error, ".", color="#999999", markersize=5, label="several knobs, or repeated")
    for point in scene.presets:
        mark, size = PRESET_LOOKS[point.accuracy]
        label = "base" if point is scene.base else f"accuracy {point.accuracy}"
        panel.plot(scene.cost(point), _error(scene, point), mark, color="black", markersize=size, zorder=4,
                   linestyle="none", label=label)  # fmt: skip
    if scene.front:
        cost, error = [scene.cost(point) for point in scene.front], [_error(scene, point) for point in scene.front]
        panel.step(cost, error, where="post", color="black", linewidth=1.0, alpha=0.5, zorder=1)
        panel.plot(cost, error, "o", markersize=12, markerfacecolor="none", markeredgecolor="black",
                   label="Pareto front")  # fmt: skip
        for number, place in enumerate(zip(cost, error, strict=True), start=1):
            panel.annotate(str(number), place, xytext=(7, 7), textcoords="offset points")
    panel.set(xscale="log", yscale="log", title="Error against processor time")
    panel.set_xlabel("processor time of all stages, less the start of their processes (s)")
    panel.set_ylabel(f"error of {scene.main.title} (%)")
    plain_ticks(panel.xaxis)
    plain_ticks(panel.yaxis)


def changes(panel: Axes, scene: SceneRuns) -> None:
    """Change of the main measure against the gain in speed, for each value of a knob, log-log."""
    for line in scene.lines:
        moved = [100 * max(MIN_DRAWN_CHANGE, abs(scene.change(line, member))) for member in line.others]
        fast = [scene.speed(line, member) for member in line.others]
        title = BY_KEY[line.knob].title + ("*" if line.beside else "")
        _plot(panel, fast, moved, line, title, linestyle="none")
        for member, x, y in zip(line.others, fast, moved, strict=True):
            if x > scene.clear or y > 5.0:
                text = BY_KEY[line.knob].text(member.settings[line.knob])
                panel.annotate(text, (x, y), xytext=(4, 3), textcoords="offset points", fontsize=7, color="#444444")
    panel.axvspan(1 / scene.clear, scene.clear, color="#eeeeee", zorder=0)
    panel.axvline(1.0, color="#888888", linewidth=0.8)
    panel.set(xscale="log", yscale="log", title="What each knob does by itself (grey: too little to be told)")
    panel.set_xlabel("times as fast as the base; left of 1 slower")
    what = "change of the error" if scene.main.kind == ITSELF else "change"
    panel.set_ylabel(f"{what} of {scene.main.title} (%)")
    panel.text(0.01, 0.01, "at the bottom: this or less", transform=panel.transAxes, fontsize=7.5, color="#666666")
    plain_ticks(panel.xaxis)
    plain_ticks(panel.yaxis)


def _error(scene: SceneRuns, point: Point) -> float:
    return 100 * scene.error(point, scene.main)


def _plot(panel: Axes, x: list, y: list, line: Line, label: str | None, linestyle: str = "-") -> None:
    panel.plot(x, y, linestyle=linestyle, linewidth=1.0, markersize=5, label=label, **LOOKS[line.knob])
