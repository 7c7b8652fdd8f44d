"""Each designed trial as the record: the interval of each quantity beside the value that made it."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from calibration.figures import axis_label, label_log_axis
from calibration.fit import SHARES, SelfTest
from calibration.settings import CalibratedQuantity
from catalogs.figures import style


def intervals(tested: SelfTest, true: NDArray, quantities: Sequence[CalibratedQuantity]) -> list[dict[str, Any]]:
    """What a panel shows of each quantity, as JSON can hold it; true (trial, quantity): values in the unit cube."""
    found = []
    for number, quantity in enumerate(quantities):
        low, middle, high = np.array([posterior.quantiles(SHARES)[:, number] for posterior in tested.posteriors]).T
        shares = {"true": true[:, number], "low": low, "middle": middle, "high": high, "ends": (0.0, 1.0)}
        panel: dict[str, Any] = {name: [float(quantity.value(share)) for share in one] for name, one in shares.items()}
        panel |= {"held": tested.held[:, number].tolist(), "label": axis_label(quantity), "scale": quantity.scale}
        found.append(panel)
    return found


def draw(found: list[dict[str, Any]]) -> Figure:
    """One panel for each quantity of `intervals`."""
    count = len(found)
    columns = min(count, 2)
    rows = -(-count // columns)
    figure = style.new_figure(width=3.6 * columns, height=3.1 * rows)
    for number, quantity in enumerate(found):
        panel = figure.add_subplot(rows, columns, number + 1)
        at, low, middle, high, was_held = (np.array(quantity[key]) for key in ("true", "low", "middle", "high", "held"))
        for held, colour, label in ((True, style.MODELLED, "holds the value"), (False, style.RECORDED, "misses it")):
            chosen = was_held == held
            bars = [(middle - low)[chosen], (high - middle)[chosen]]
            panel.errorbar(at[chosen], middle[chosen], bars, fmt=".", color=colour, elinewidth=0.8, label=label)
        panel.plot(quantity["ends"], quantity["ends"], color=style.OUTLINE, linewidth=0.8)
        panel.set(xlabel=f"true {quantity['label']}", ylabel="90 % interval")
        if quantity["scale"] == "log":
            panel.set(xscale="log", yscale="log")
            label_log_axis(panel.xaxis)
            label_log_axis(panel.yaxis)
        if number == 0:
            panel.legend(loc="upper left", bbox_to_anchor=(0.0, 1.22), ncols=2)
    return figure
