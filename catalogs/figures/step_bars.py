"""Bars of all steps: modelled beside recorded events and potency, above blocks in the colours of the steps."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from matplotlib.ticker import LogLocator, MaxNLocator, NullFormatter
from numpy.typing import NDArray

from catalogs.figures import style
from catalogs.figures.step_key import BLOCK_HEIGHT, draw_steps

WIDTH, HEIGHT = 7.6, 1.6  # Inches.
LEFT, RIGHT, TOP, BOTTOM, GAP = 0.68, 0.12, 0.2, 0.3, 0.1  # Inches around the panels, and between them.
FILLED = 0.8  # Share of a step's width that its bars fill.
MAX_LINEAR_RANGE = 20.0  # The axis is logarithmic where the largest value is more times the smallest.
NO_RECORD = "#eeeeee"


@dataclass(frozen=True)
class Bars:
    """Values (step,) of one quantity by the label of the catalogue, the modelled one first, and its name with unit."""

    name: str
    values: Mapping[str, NDArray]


def step_bars(
    names: Sequence[str],
    step_colours: Sequence,
    quantities: Sequence[Bars],
    colours: Mapping[str, str],
    is_recorded: NDArray,
) -> Figure:
    """A panel of bars for each quantity, one above the other.

    names, step_colours (step,): of all steps, in order; colours: of the catalogues, by label; is_recorded (step,) bool:
    True where there is a record of a part of the step; the others are shaded.
    """
    figure = style.new_figure(WIDTH, HEIGHT, layout=None)
    tall = (HEIGHT - TOP - BOTTOM - GAP * (len(quantities) - 1)) / len(quantities)
    width = WIDTH - LEFT - RIGHT
    place, many = np.arange(len(names)) + 0.5, style.are_many(names)
    for number, quantity in enumerate(quantities):
        bottom = BOTTOM + (len(quantities) - 1 - number) * (tall + GAP)
        axes = figure.add_axes([LEFT / WIDTH, bottom / HEIGHT, width / WIDTH, tall / HEIGHT])
        count = len(quantity.values)
        thick = FILLED / count
        for one, (label, values) in enumerate(quantity.values.items()):
            axes.bar(
                place + (one - (count - 1) / 2) * thick, values, thick, color=colours[label], label=label,
                rasterized=many,
            )  # fmt: skip
        for step in np.flatnonzero(~is_recorded):
            axes.axvspan(step, step + 1, color=NO_RECORD, zorder=0, linewidth=0, rasterized=many)
        _scale(axes, np.concatenate([np.asarray(values, float) for values in quantity.values.values()]))
        axes.set_xlim(0, len(names))
        axes.set_xticks([])
        axes.set_ylabel(quantity.name, fontsize=7.5, linespacing=1.0, va="center")
        axes.yaxis.set_label_coords(-0.5 / width, 0.5)
        axes.tick_params(labelsize=7, length=2, pad=1.5)
        axes.grid(axis="y", color="#dddddd", linewidth=0.5)
    draw_steps(figure, names, step_colours, LEFT, BOTTOM - BLOCK_HEIGHT - 0.03, width)
    handles = [Patch(color=colours[label], label=label) for label in quantities[0].values]
    if not is_recorded.all():
        handles.append(Patch(color=NO_RECORD, label="no record"))
    figure.legend(
        handles=handles, loc="upper right", bbox_to_anchor=(1 - RIGHT / WIDTH, 1.0), ncols=len(handles), fontsize=7.5,
        borderaxespad=0.0, handlelength=1.0, handletextpad=0.4, columnspacing=1.2,
    )  # fmt: skip
    return figure


def _scale(axes, values: NDArray) -> None:
    """A logarithmic axis, from less than the smallest value on, where values differ much; else one from zero."""
    above = values[values > 0]
    if not len(above):
        axes.set_ylim(0, 1)
        axes.set_yticks([0])
    elif above.max() > MAX_LINEAR_RANGE * above.min():
        low, high = np.log10(above.min()), np.log10(above.max())
        axes.set_yscale("log")
        axes.set_ylim(10 ** (np.floor(low) - (0.4 if low == np.floor(low) else 0.0)), 10 ** (high + 0.1))
        axes.yaxis.set_major_locator(LogLocator(numticks=4))
        axes.yaxis.set_minor_formatter(NullFormatter())
        axes.minorticks_off()
    else:
        axes.set_ylim(0, 1.1 * above.max())
        axes.yaxis.set_major_locator(MaxNLocator(3, integer=bool((values == np.rint(values)).all())))
