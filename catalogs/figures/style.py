"""Style of every figure: colours, fonts, and files whose bytes depend on their content alone."""

import base64
from collections.abc import Iterator, Sized
from contextlib import contextmanager
from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.font_manager import FontProperties

from common.datasets import atomic_path

MODELLED = "#0072b2"  # Okabe and Ito (2008): blue and vermilion stay apart for colour-blind readers
RECORDED = "#d55e00"
BOTH = "#009e73"  # a measure of the two together
EXCAVATION = "#d9d9d9"
OUTLINE = "#4d4d4d"
BEFORE_RECORD = "#a6a6a6"  # rock that failed in history, before the record begins
FILL = "#efe6d0"
PAGE_WIDTH = 11.0  # inches: about the width of the report's text at 96 dots per inch
DOTS_PER_INCH = 120  # of the rasterised layers
# Share of a panel's height at which its title stands, where nothing is in its way: matplotlib would measure all labels
# of the panel to find the same place.
TITLE_PLACE = 1.0
MAX_STEPS_IN_KEY = 24  # steps that a key names
MAX_STEPS_AS_SHAPES = 100  # shapes of more steps are drawn as pixels, which take less room in a file

SETTINGS = {
    "font.family": "DejaVu Sans",  # shipped with matplotlib: the same on every machine
    "font.size": 9.5,
    "axes.titlesize": 10.5,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "axes.labelsize": 9.5,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.axisbelow": True,
    "axes.formatter.useoffset": False,
    "legend.frameon": False,
    "legend.fontsize": 8.5,
    "xtick.labelsize": 8.5,
    "ytick.labelsize": 8.5,
    "figure.dpi": DOTS_PER_INCH,
    "savefig.dpi": DOTS_PER_INCH,
    "svg.hashsalt": "rockburst-mpm",  # element names from content, not from a random number
    "svg.fonttype": "path",  # letters as shapes: the reader's machine needs no font
    "path.simplify": True,
}


@contextmanager
def applied() -> Iterator[None]:
    """Draw within this context: the settings above on matplotlib's own defaults, not on the user's matplotlibrc."""
    with mpl.rc_context():
        mpl.rcdefaults()
        mpl.rcParams.update(SETTINGS)
        yield


def new_figure(width: float = PAGE_WIDTH, height: float = 4.0, layout: str | None = "constrained") -> Figure:
    """A figure without pyplot's global state (inches); its layout keeps labels from being clipped."""
    figure = Figure(figsize=(width, height), layout=layout)
    FigureCanvasAgg(figure)
    return figure


def text_extent(figure: Figure, text: str, size: float) -> np.ndarray:
    """Width and height (2,) of a line of text in letters of a size, points, pixels of the figure."""
    canvas = figure.canvas
    assert isinstance(canvas, FigureCanvasAgg)
    width, height, _ = canvas.get_renderer().get_text_width_height_descent(
        text, FontProperties(size=size), ismath=False
    )
    return np.array([width, height])


def step_colours(dated: list[bool]) -> list:
    """One colour per step: grey before the record, then a perceptual sequence in the order of mining."""
    count = sum(dated)
    sequence = iter(mpl.colormaps["viridis"](np.linspace(0.0, 0.92, max(count, 1)))[:, :3])
    return [next(sequence) if flag else mpl.colors.to_rgb(BEFORE_RECORD) for flag in dated]


def level_colours(levels: int) -> ListedColormap:
    """Grid levels from coarse (light) to fine (dark)."""
    return ListedColormap(mpl.colormaps["YlGnBu"](np.linspace(0.08, 0.62, levels)))


def save(figure: Figure, path: Path) -> str:
    """Write `figure` as SVG (atomically, without a date) and return it as a data URI for an <img> element."""
    with atomic_path(path) as temporary:
        # figure.savefig() would draw a figure with a layout twice, the first time for its layout alone.
        FigureCanvasSVG(figure).print_svg(temporary, metadata={"Date": None, "Creator": None})
        content = temporary.read_bytes()
    return "data:image/svg+xml;base64," + base64.b64encode(content).decode()


def are_many(steps: Sized) -> bool:
    """True if the shapes of so many steps are drawn as pixels."""
    return len(steps) > MAX_STEPS_AS_SHAPES


def thinned(entries: list) -> list:
    """Entries of a key, thinned to at most MAX_STEPS_IN_KEY evenly spaced ones with the first and the last."""
    if len(entries) <= MAX_STEPS_IN_KEY:
        return entries
    return [entries[index] for index in np.linspace(0, len(entries) - 1, MAX_STEPS_IN_KEY).round().astype(int)]
