"""Figure of the Brazilian disc: stress and first failure on the loaded diameter, the crack's growth, and its stages."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure, FigureBase
from matplotlib.patches import Circle, Wedge

from catalogs.figures import style
from catalogs.figures.beachballs import draw_ball
from verification.answers.brazilian_disc.crack import STAGE_COUNT, Crack, Moment
from verification.answers.brazilian_disc.elastic_rock import PressedDisc
from verification.plots import COLOURS, plot_series

MPA, KILO, MILLI = 1e-6, 1e-3, 1e3
STRESSES = ("across the load", "along the load", "out of the plane")  # xx, yy and zz.
OLDER, NEW = style.BEFORE_RECORD, "#000000"
ARC_WIDTH = 2.5  # Width of the drawn load, mm.
MIN_BALL_RADIUS, MAX_BALL_RADIUS = 1.4, 5.5  # Radii of beach balls, mm.
MAX_BALLS_PER_STAGE = 14  # The largest events of a stage are drawn.
BALL_SAMPLES = 61  # Samples along a side of a beach ball.
COLUMNS = 3


def draw(discs: dict[str, PressedDisc], cracks: dict[str, Crack | None], settings: dict) -> Figure:
    """All panels; without a crack only those of the elastic field."""
    shown = [discs[name] for name in settings["compared"] if name in discs]
    crack = cracks.get(settings["shown"])
    if crack is None:
        crack = next((found for found in cracks.values() if found), None)
    rows = -(-STAGE_COUNT // COLUMNS)
    figure = style.new_figure(height=3.9 + (4.1 * rows if crack else 0.0))
    if crack:
        upper, lower = figure.subfigures(2, 1, height_ratios=[3.9, 4.1 * rows])
        draw_stages(lower, crack)
    else:
        upper = figure
    stress, strength, growth = upper.subplots(1, 3)
    height, found = shown[0].along_diameter()
    line = np.linspace(-1.0, 1.0, 401) * shown[0].disc.radius * 0.999
    title = f"Loaded diameter at {KILO * shown[0].loading.before:.3g} kN"
    draw_stress(stress, title, height, found.T, (line, shown[0].exact_along_diameter(line).T))
    draw_first_failure(strength, shown)
    draw_growth(growth, {name: found for name, found in cracks.items() if found and name not in settings["spread"]})
    return figure


def draw_stress(axes: Axes, title: str, height: np.ndarray, found: np.ndarray, exact: tuple) -> None:
    """Stresses on the loaded diameter with Hondros' lines.

    found: at heights (k,) m, Pa, of each component of STRESSES; exact: heights and stresses of the lines.
    """
    line, stress = exact
    plot_series(
        axes,
        {name: (MILLI * height, MPA * some) for name, some in zip(STRESSES, found, strict=False)},
        {name: (MILLI * line, MPA * some) for name, some in zip(STRESSES, stress, strict=False)},
        marks=".",
        legend="lower center",
        title=title,
        xlabel="height above the centre (mm)",
        ylabel="stress (MPa), lines Hondros",
    )


def draw_first_failure(axes: Axes, discs: list[PressedDisc]) -> None:
    """Load at which rock on the loaded diameter would reach strength, with the exact one."""
    found, lines, first = {}, {}, [disc.first_failure()[1] for disc in discs]
    for disc in discs:
        height, stress = disc.along_diameter()
        line = np.linspace(0.0, 0.97, 300) * disc.disc.radius
        upper, unit = (height >= 0.0) & (height < line[-1]), KILO * disc.loading.before
        exact = disc.strength.load_factor(disc.exact_along_diameter(line))
        found[disc.name] = MILLI * height[upper], unit * disc.strength.load_factor(stress)[upper]
        lines[disc.name] = MILLI * line, unit * exact
    labels = {"xlabel": "height above the centre (mm)", "ylabel": "load (kN), lines exact"}
    plot_series(axes, found, lines, marks=".", legend="upper left", title="Load of first failure", **labels)
    for place, colour in zip(first, COLOURS, strict=False):
        at = MILLI * place.place[1], KILO * place.resultant
        axes.plot(*at, "v", color=colour, markersize=7)
        look = {"textcoords": "offset points", "va": "top", "color": colour, "fontsize": 8.5}
        axes.annotate(f"{at[1]:.2f} kN", at, (6, -8), **look)
    lowest = KILO * min(place.resultant for place in first)
    axes.set_ylim(0.8 * lowest, 2.2 * lowest)


def draw_growth(axes: Axes, cracks: dict[str, Crack]) -> None:
    """Span of the crack against the cells that have failed."""
    growth = {}
    for name, crack in cracks.items():
        cells = [moment.failed_cells for moment in crack.moments]
        label = f"{name}, {crack.text_of(crack.last_part)}"
        growth[label] = cells, [100.0 * moment.span for moment in crack.moments]
    labels = {"xlabel": "failed cells", "ylabel": "span (% of the loaded diameter)"}
    plot_series(axes, growth, marks=".-", title="Growth of the crack, by generation", **labels)
    if cracks:
        axes.set(xscale="log", ylim=(0.0, 105.0))
        axes.legend(loc="upper left")
    else:
        axes.text(0.5, 0.5, "no state of rest\nwith failed rock", ha="center", transform=axes.transAxes)


def draw_stages(figure: FigureBase, crack: Crack, stages: list[Moment] | None = None) -> None:
    """The disc as the crack grows: what failed before (grey) and in this stage (black), and the stage's events."""
    stages = stages or crack.stages()
    sections = [crack.events_between(before, stage.generation) for before, stage in _pairs(stages)]
    largest = max(float(events.potency.max()) for events in sections if events.sizes["event"])
    radius = MILLI * crack.disc.disc.radius
    marker = max(1.1, 1.1 * MILLI * crack.disc.cell_size)  # of a cell
    for number, (axes, stage, events) in enumerate(
        zip(figure.subplots(-(-STAGE_COUNT // COLUMNS), COLUMNS).ravel(), stages, sections, strict=True), start=1
    ):
        axes.add_patch(Circle((0, 0), radius, facecolor="#f4f4f4", edgecolor=style.OUTLINE, linewidth=0.8, zorder=1))
        half = np.degrees(crack.disc.disc.half_arc)
        for middle in (90.0, 270.0):
            axes.add_patch(
                Wedge((0, 0), radius + ARC_WIDTH, middle - half, middle + half, width=ARC_WIDTH, color=style.RECORDED)
            )
        before = stages[number - 2].generation if number > 1 else -1
        for chosen, colour in (
            (crack.rank <= before, OLDER),
            ((crack.rank > before) & (crack.rank <= stage.generation), NEW),
        ):
            place = MILLI * crack.place[chosen]
            axes.plot(*place.T, "s", color=colour, markersize=marker, markeredgewidth=0, zorder=2, rasterized=True)
        draw_events(axes, crack, events, largest)
        axes.set_title(
            f"{number}: {crack.text_of(stage.part)}, {100 * stage.span:.0f} % spanned\n"
            f"generation {stage.generation + 1}, {stage.failed_cells} cells, {events.sizes['event']} more events",
            fontsize=9.0, fontweight="normal",
        )  # fmt: skip
        reach = -1.15 * radius, 1.15 * radius
        axes.set(xlim=reach, ylim=reach, aspect="equal", xlabel="x (mm)", ylabel="y (mm)")


def _pairs(stages):
    return zip([-1, *(stage.generation for stage in stages)], stages, strict=False)


def draw_events(axes: Axes, crack: Crack, events, largest: float) -> None:
    """The stage's largest events as beach balls beside the crack, joined to their places; area by potency.

    They are seen along the disc's axis.
    """
    order = np.argsort(-events.potency.values, kind="stable")[:MAX_BALLS_PER_STAGE]
    radius = MILLI * crack.disc.disc.radius
    place = MILLI * (events.location.values[order, :2] - crack.disc.center)
    size = np.clip(MAX_BALL_RADIUS * np.sqrt(events.potency.values[order] / largest), MIN_BALL_RADIUS, MAX_BALL_RADIUS)
    for number, (x, y) in enumerate(spread(place, size, radius)):
        axes.plot([place[number, 0], x], [place[number, 1], y], color=style.OUTLINE, linewidth=0.5, zorder=3)
        tensor, look = events.potency_tensor.values[order[number]], {"samples": BALL_SAMPLES, "linewidth": 0.6}
        draw_ball(axes, tensor, style.RECORDED, centre=(x, y), radius=size[number], **look)


def spread(place: np.ndarray, size: np.ndarray, radius: float) -> np.ndarray:
    """Places of balls (ball, 2): for each, largest first, the nearest free place of a lattice beside the crack.

    place (ball, 2), size (ball,), radius of the disc: mm.
    """
    line = np.arange(-0.95 * radius, 0.96 * radius, 0.05 * radius)
    free = np.stack(np.meshgrid(line, line), axis=-1).reshape(-1, 2)
    free = free[(np.abs(free[:, 0]) > 0.2 * radius) & (np.hypot(*free.T) < 0.95 * radius)]
    result = np.empty_like(place)
    for number, (own, where) in enumerate(zip(size, place, strict=True)):
        apart = np.hypot(*(free[:, None] - result[:number]).transpose(2, 0, 1)) - size[:number] - own - 0.5
        allowed = free[(apart > 0.0).all(axis=1)]
        side = 1.0 if number % 2 else -1.0  # Balls on the crack go left and right in turn.
        result[number] = allowed[np.argmin(np.hypot(*(allowed - where - [0.1 * side, 0.0]).T))]
    return result
