"""Each designed trial as the record: the interval of each quantity beside the value that made it."""

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from calibration.figures import axis_label, label_log_axis
from calibration.fit import SHARES, SelfTest
from calibration.settings import CalibratedQuantity
from catalogs.figures import style


def draw(tested: SelfTest, true: NDArray, quantities: Sequence[CalibratedQuantity]) -> Figure:
    """One panel for each quantity; true (trial, quantity): values in the unit cube."""
    count = len(quantities)
    columns = min(count, 2)
    rows = -(-count // columns)
    figure = style.new_figure(width=3.6 * columns, height=3.1 * rows)
    for number, quantity in enumerate(quantities):
        panel = figure.add_subplot(rows, columns, number + 1)
        low, middle, high = np.array([posterior.quantiles(SHARES)[:, number] for posterior in tested.posteriors]).T
        at, low, middle, high = (
            np.array([quantity.value(share) for share in one]) for one in (true[:, number], low, middle, high)
        )
        for held, colour, label in ((True, style.MODELLED, "holds the value"), (False, style.RECORDED, "misses it")):
            chosen = tested.held[:, number] == held
            bars = [(middle - low)[chosen], (high - middle)[chosen]]
            panel.errorbar(at[chosen], middle[chosen], bars, fmt=".", color=colour, elinewidth=0.8, label=label)
        ends = [quantity.value(0.0), quantity.value(1.0)]
        panel.plot(ends, ends, color=style.OUTLINE, linewidth=0.8)
        panel.set(xlabel=f"true {axis_label(quantity)}", ylabel="90 % interval")
        if quantity.scale == "log":
            panel.set(xscale="log", yscale="log")
            label_log_axis(panel.xaxis)
            label_log_axis(panel.yaxis)
        if number == 0:
            panel.legend(loc="upper left", bbox_to_anchor=(0.0, 1.22), ncols=2)
    return figure
