"""The plots that figures of studies are made of: points beside closed forms, errors by name, cells, and sections.

All draw into given axes. Other keywords than those named go to `Axes.set` (title, xlabel, xlim, xscale, ...), so that
one call makes a finished panel.
"""

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.collections import PolyCollection
from matplotlib.image import AxesImage
from matplotlib.patches import Circle
from matplotlib.patheffects import withStroke
from matplotlib.ticker import LogLocator, NullFormatter
from numpy.typing import ArrayLike
from scipy.spatial import cKDTree

from catalogs.figures import style

COLOURS = (style.MODELLED, style.RECORDED, style.BOTH, "#cc79a7", "#e69f00", "#555555")  # Okabe and Ito (2008)
GRID = {"color": "#e2e2e2", "linewidth": 0.6}
SQUARE = np.array([[0, 0], [1, 0], [1, 1], [0, 1]])
BAR = "|"  # The mark of means and bounds among the points of a name.
NOTE_OFFSETS = ((5, 3, "left"), (5, -9, "left"), (-5, 3, "right"), (-5, -9, "right"))  # By series, points.
FEW_POINTS = 300  # A series of more points is drawn with small marks, as pixels.
MAX_SPAN_WITH_TICKS_BETWEEN = 300.0  # Largest over least value of a logarithmic axis.
SECTION_PIXELS = 240  # Along each side.

# Places x (k,) and values y (k,) by the name of what they belong to.
Curves = Mapping[str, tuple[ArrayLike, ArrayLike]]


def plot_series(
    axes: Axes,
    series: Curves,
    exact: Curves | None = None,
    *,
    marks: str | Sequence[str] = "o",
    colours: Sequence[str] = COLOURS,
    notes: Mapping[str, Sequence[str]] | None = None,
    legend: str | None = "best",
    **labels,
) -> None:
    """Draw points by case, and closed forms as lines.

    A closed form with the name of a series has its colour; each other one is a dark line with an entry of its own.
    marks: matplotlib's format of the points, a text for all series or a sequence of one each. notes: short texts beside
    the points of each series. legend: its place; None leaves it out.
    """
    for number, (name, (x, y)) in enumerate(series.items()):
        colour = colours[number % len(colours)]
        mark = marks if isinstance(marks, str) else marks[number % len(marks)]
        many = np.size(x) > FEW_POINTS
        axes.plot(x, y, mark, color=colour, markersize=2 if many else 4.5, linewidth=1.0, rasterized=many, label=name)
        for text, *place in zip(notes[name], np.ravel(x), np.ravel(y), strict=True) if notes else ():
            if np.isfinite(place).all():
                *offset, side = NOTE_OFFSETS[number % len(NOTE_OFFSETS)]
                look = {"textcoords": "offset points", "ha": side, "color": colour, "fontsize": 7}
                axes.annotate(text, place, offset, **look)
        if exact and name in exact:
            halo = [withStroke(linewidth=1.9, foreground="white")]
            axes.plot(*exact[name], color=colour, linewidth=1.1, path_effects=halo)
    dark = [name for name in exact or {} if name not in series]
    for name, line in zip(dark, ("-", "--", "-.", ":"), strict=False):
        axes.plot(*(exact or {})[name], line, color="black", linewidth=1.0, label=name)
    axes.set(**labels)
    if legend and len(axes.get_legend_handles_labels()[0]) > 1:
        axes.legend(loc=legend)


def plot_convergence(axes: Axes, series: Curves, order: float, name: str = "", ticks: bool = True, **options) -> None:
    """Draw errors against a size (or costs against a number) by case, both logarithmic, and a dotted line of an order.

    name: of the dotted line, else its order. ticks: whether the axis has its ticks at the sizes. options: as
    plot_series.
    """
    options = {"marks": "o-", "legend": None} | options
    plot_series(axes, series, xscale="log", yscale="log", **options)
    sizes = np.unique(np.concatenate([np.ravel(x).astype(float) for x, _ in series.values()] or [np.ones(1)]))
    drawn = np.concatenate([np.ravel(line.get_ydata()).astype(float) for line in axes.lines] or [np.ones(1)])
    lowest = np.nanmin(drawn[drawn > 0.0], initial=np.inf)
    if np.isfinite(lowest):
        axes.plot(
            sizes, 0.5 * lowest * (sizes / sizes[0]) ** order, ":", color="black", label=name or f"order {order:g}"
        )
    if ticks:
        axes.set_xticks(sizes, [f"{size:g}" for size in sizes])
        axes.minorticks_off()
    axes.grid(which="major", **GRID)
    axes.legend()


def plain_decades(axes: Axes) -> None:
    """Write the ticks of logarithmic axes as plain numbers, at 1, 2 and 5 on the vertical one, over a light grid."""
    plain_ticks(axes.xaxis, False, "{x:,.10g}")
    plain_ticks(axes.yaxis, True, "{x:,.10g}")
    axes.grid(which="major", **GRID)


def plain_ticks(axis: Axis, between: bool | None = None, text: str = "{x:g}") -> None:
    """Write the ticks of a logarithmic axis as plain numbers.

    between: whether 2 and 5 of each decade have ticks as well as 1; None takes them where the view, which must be
    drawn already, spans few decades. text: format of the number x.
    """
    if between is None:
        low, high = axis.get_view_interval()
        between = high / low < MAX_SPAN_WITH_TICKS_BETWEEN
    axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0) if between else (1.0,)))
    axis.set_major_formatter(text)
    axis.set_minor_formatter(NullFormatter())


def plot_errors(
    axes: Axes,
    names: Sequence[str],
    series: Mapping[str, Sequence | np.ndarray],
    bars: ArrayLike | None = None,
    *,
    truth: float | None = None,
    band: tuple[float, float] | None = None,
    marks: Sequence[str] = "os^D",
    legend: str | None = "best",
    **labels,
) -> None:
    """Draw values by name, names down the vertical axis.

    series: by case, for each name a value or several. bars: half lengths (name,) or (2, name) of the bars of one
    series. truth: a line at the value that all should have. band: values that are allowed, shaded. marks: of each
    series; with a BAR among them all lie on one line.
    """
    rows = np.arange(len(names))
    if band:
        axes.axvspan(*band, color=style.BOTH, alpha=0.15, linewidth=0)
    if truth is not None:
        axes.axvline(truth, color=style.OUTLINE, linewidth=0.8)
    shifts = np.linspace(-0.15, 0.15, len(series)) if len(series) > 1 and BAR not in marks else np.zeros(len(series))
    for number, ((name, values), shift) in enumerate(zip(series.items(), shifts, strict=True)):
        count = [np.size(value) for value in values]
        x = np.concatenate([np.empty(0), *(np.ravel(value) for value in values)])
        y = np.repeat(rows + shift, count)
        size = {"markersize": 14, "markeredgewidth": 2} if marks[number] == BAR else {"markersize": 4.5, "alpha": 0.7}
        look = {"color": COLOURS[number], "label": name} | size
        axes.errorbar(x, y, xerr=bars, fmt=marks[number], **look)
    axes.set_yticks(rows, names)
    axes.set_ylim(len(names) - 0.5, -0.5)
    axes.grid(axis="x", **GRID)
    axes.set(**labels)
    if axes.get_xscale() == "linear":
        axes.locator_params(axis="x", nbins=6)
    if legend and len(series) > 1:
        axes.legend(loc=legend)


def plot_cells(axes: Axes, corner: np.ndarray, size: np.ndarray, values=None, **look) -> PolyCollection:
    """Draw cells as squares; returns them for a colour bar.

    corner (cell, 2): lower corners, m; size (cell,): edges, m; values (cell,): give the colours by `cmap`, where
    `look` has no facecolor.
    """
    squares = corner[:, None] + size[:, None, None] * SQUARE
    drawn = PolyCollection(list(squares), array=values, **({"cmap": "viridis", "rasterized": True} | look))
    axes.add_collection(drawn)
    return drawn


def plot_section(
    axes: Axes, place: np.ndarray, values: np.ndarray, reach: tuple[float, float], void: float = 0.0, **look
) -> AxesImage:
    """Draw, as an image, the value of the particle nearest to each pixel; returns it for a colour bar.

    place (particle, 2), m; values (particle,); reach: ends of both axes, m; void: radius around the origin that stays
    empty, m.
    """
    low, high = reach
    line = low + (np.arange(SECTION_PIXELS) + 0.5) / SECTION_PIXELS * (high - low)
    points = np.stack(np.meshgrid(line, line), axis=-1)
    image = np.where(np.hypot(*np.moveaxis(points, -1, 0)) < void, np.nan, values[cKDTree(place).query(points)[1]])
    look = {"cmap": "cividis", "interpolation": "nearest", "rasterized": True} | look
    return axes.imshow(image, origin="lower", extent=(low, high, low, high), **look)


def add_circle(axes: Axes, radius: float, **look) -> None:
    """Outline a circle around the origin."""
    look = {"facecolor": "none", "edgecolor": style.OUTLINE, "linewidth": 0.8} | look
    axes.add_patch(Circle((0.0, 0.0), radius, **look))
