"""Figures of a calibration: posterior and prior, predictions and the record, the surrogate and the trials."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axis import Axis
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter

from calibration.fit import Fit
from calibration.posterior import weighted_quantiles
from calibration.settings import CalibratedQuantity
from catalogs.figures import style

BINS = 24
SMOOTHING = 1.5  # Standard deviation, in bins, of the kernel that lines of a pair are smoothed with.
MAX_INSTRUMENTS = 12  # Whose readings are drawn.
INSTRUMENT_COLUMNS = 3
MAX_LABELS = 6  # Steps whose names stand below a panel.
MODEL_DRAWS = 400  # Points of the posterior whose readings make the interval of an instrument.
LEVELS = (0.9, 0.5)  # Shares of the posterior within the lines of a pair.


def axis_label(quantity: CalibratedQuantity) -> str:
    """Last parts of the key, or the strength meant, and the unit."""
    if quantity.confinement is not None:
        return f"{quantity.title.split(': ')[1].replace(' under', chr(10) + 'under')} ({quantity.unit})"
    name = " ".join(part.replace("_", " ") for part in quantity.key.split(".")[-2:])
    return f"{name} ({quantity.unit})" if quantity.unit else name


def label_log_axis(axis: Axis) -> None:
    """Plain numbers at 1, 2 and 5 of each decade: ranges of less than a decade have labels, too."""
    axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axis.set_minor_formatter(NullFormatter())


def draw_pairs(fit: Fit, quantities: Sequence[CalibratedQuantity], trials: NDArray) -> Figure:
    """Marginals on the diagonal, the prior as a line; below it lines around half and 90 % of each pair, and trials."""
    count = len(quantities)
    size = min(2.4 * count, style.PAGE_WIDTH)
    figure = style.new_figure(width=max(size, 4.0), height=max(size, 3.2))
    panels = figure.subplots(count, count, squeeze=False)
    points, weights = fit.posterior.points, fit.posterior.weights
    edges = np.linspace(0.0, 1.0, BINS + 1)
    values = [np.array([quantity.value(edge) for edge in edges]) for quantity in quantities]
    for row in range(count):
        for column in range(count):
            panel = panels[row, column]
            if column > row:
                panel.set_visible(False)
                continue
            panel.set_xlim(values[column][0], values[column][-1])
            if quantities[column].scale == "log":
                panel.set_xscale("log")
                label_log_axis(panel.xaxis)
            if row == column:
                shares = np.histogram(points[:, row], edges, weights=weights)[0] * BINS
                panel.stairs(shares, values[row], fill=True, color=style.MODELLED, alpha=0.7)
                panel.plot(values[row][[0, -1]], [1.0, 1.0], color=style.OUTLINE, linewidth=0.9)
                panel.set_yticks([])
            else:
                _draw_pair(panel, fit, (column, row), (values[column], values[row]), edges)
                found = [[quantities[part].value(share) for share in trials[:, part]] for part in (column, row)]
                panel.plot(*found, ".", color=style.OUTLINE, markersize=2.0)
                panel.set_ylim(values[row][0], values[row][-1])
                if quantities[row].scale == "log":
                    panel.set_yscale("log")
                    label_log_axis(panel.yaxis)
            if row == count - 1:
                panel.set_xlabel(axis_label(quantities[column]))
            if column == 0 and row > 0:
                panel.set_ylabel(axis_label(quantities[row]))
    panels[0, 0].set_title("posterior; line: prior")
    return figure


def _draw_pair(panel, fit: Fit, pair: tuple[int, int], values: tuple[NDArray, NDArray], edges: NDArray) -> None:
    """Shares of the posterior in bins of two quantities, and lines around the bins that hold LEVELS of it."""
    points, weights = fit.posterior.points, fit.posterior.weights
    shares = np.histogram2d(points[:, pair[0]], points[:, pair[1]], [edges, edges], weights=weights)[0]
    panel.pcolormesh(*values, np.ma.masked_less(shares.T, 1e-4), cmap="Blues", rasterized=True)
    smooth = gaussian_filter(shares, SMOOTHING, mode="nearest")
    ordered = np.sort(smooth.ravel())[::-1]
    lines = sorted({float(ordered[np.searchsorted(np.cumsum(ordered) / smooth.sum(), level)]) for level in LEVELS})
    middles = [0.5 * (value[1:] + value[:-1]) for value in values]
    if len(lines) == len(LEVELS):
        panel.contour(*middles, smooth.T, levels=lines, colors=style.MODELLED, linewidths=(0.8, 1.4))


def draw_predictions(fit: Fit, steps: Sequence[str], prior: NDArray) -> Figure:
    """Potency and number by step: recorded, predicted by the posterior (90 %), and computed by trials of the prior.

    prior: ln potency and ln number of the trials, corrected for the cells (trial, output). Half an event is drawn
    where there is none.
    """
    figure = style.new_figure(height=3.6)
    intervals, count = fit.intervals(), fit.steps
    spread = np.exp(weighted_quantiles(prior, np.full(len(prior), 1.0 / len(prior)), np.array([0.05, 0.5, 0.95])))
    recorded = (np.exp(fit.recorded.log_potency), np.exp(fit.recorded.log_number))
    for part, (panel, label) in enumerate(
        zip(figure.subplots(1, 2), ("potency (m³)", "number of events above the cut"), strict=True)
    ):
        columns = slice(part * count, (part + 1) * count)
        places = np.arange(count)
        for shift, values, colour, name in (
            (-0.16, spread[:, columns], style.OUTLINE, "trials, before calibration (90 %)"),
            (0.0, intervals[:, columns], style.MODELLED, "calibrated (90 %)"),
        ):
            low, middle, high = values
            panel.errorbar(
                places + shift, middle, [middle - low, high - middle], fmt="o", color=colour, capsize=3, label=name
            )
        panel.plot(places + 0.16, recorded[part], "D", color=style.RECORDED, label="recorded")
        panel.set_yscale("log")
        label_log_axis(panel.yaxis)
        panel.set_xticks(places, steps)
        panel.set_xlim(-0.5, count - 0.5)
        panel.set(xlabel="step", ylabel=label)
        panel.grid(axis="y", color="#e2e2e2", linewidth=0.6)
    figure.axes[0].legend()
    return figure


def draw_surrogate(fit: Fit, steps: Sequence[str]) -> Figure:
    """Potency and number of each trial as all others predict them, against those computed."""
    figure = style.new_figure(height=3.6)
    mean, deviation = fit.surrogate.left_out()
    computed, count = fit.surrogate.outputs, fit.steps
    colours = (style.MODELLED, style.RECORDED, style.BOTH, style.OUTLINE)
    for part, (panel, label) in enumerate(
        zip(figure.subplots(1, 2), ("potency (m³)", "number of events above the cut"), strict=True)
    ):
        for index, step in enumerate(steps):
            output = part * count + index
            low, middle, high = (np.exp(mean[:, output] + shift * deviation[:, output]) for shift in (-1.645, 0, 1.645))
            panel.errorbar(
                np.exp(computed[:, output]),
                middle,
                [middle - low, high - middle],
                fmt=".",
                color=colours[index % len(colours)],
                elinewidth=0.5,
                label=step,
            )
        ends = np.exp(
            [computed[:, part * count : (part + 1) * count].min(), computed[:, part * count : (part + 1) * count].max()]
        )
        panel.plot(ends, ends, color=style.OUTLINE, linewidth=0.8)
        panel.set(xscale="log", yscale="log", xlabel=f"{label}, computed", ylabel="predicted by the other trials")
        label_log_axis(panel.xaxis)
        label_log_axis(panel.yaxis)
    figure.axes[0].legend()
    return figure


def draw_instruments(fit: Fit) -> Figure:
    """Readings of each instrument by step, as points, and the 90 % interval of the calibrated model's; an interval
    contains all errors. Where the zero is unknown, values are those relative to the mean of the place."""
    term = fit.likelihood.instruments
    assert term is not None
    scores, variance = fit.instrument_scores()
    chosen = fit.posterior.draws_of(MODEL_DRAWS, seed=0)
    errors = term.likeliest_errors(scores, variance, fit.posterior.weights)
    generator = np.random.default_rng(0)
    shown = list(zip(term.instruments, errors, strict=True))[:MAX_INSTRUMENTS]
    rows = -(-len(shown) // INSTRUMENT_COLUMNS)
    figure = style.new_figure(height=0.5 + 2.2 * rows)
    panels = figure.subplots(rows, INSTRUMENT_COLUMNS, squeeze=False).ravel()
    for panel, (one, error) in zip(panels, shown, strict=False):
        drawn = one.centred(one.made(scores[chosen], variance[chosen], term.model_error, error, generator))
        low, high = np.quantile(drawn, [0.05, 0.95], axis=0)
        measured, steps = one.centred(one.value), list(dict.fromkeys(one.step))
        at = np.array([steps.index(step) for step in one.step])
        places = np.unique(one.distance, return_inverse=True)[1]
        for place in range(places.max() + 1):
            own = places == place
            label = f"{one.distance[own][0]:g} m" if np.isfinite(one.distance[own][0]) else None
            shift = 0.12 * (place - 0.5 * places.max())
            middle = 0.5 * (low + high)[own]
            panel.errorbar(
                at[own] + shift, middle, [(high - low)[own] / 2] * 2, fmt="none", color=f"C{place}", capsize=2
            )
            panel.plot(at[own] + shift, measured[own], "o", color=f"C{place}", fillstyle="none", label=label)
        panel.set_title(one.name, loc="left")
        every = -(-len(steps) // MAX_LABELS)
        panel.set(ylabel=one.unit, xlim=(-0.5, len(steps) - 0.5), xticks=np.arange(0, len(steps), every))
        panel.set_xticklabels(steps[::every], rotation=30, ha="right")
        if places.max():
            panel.legend(fontsize="x-small")
    for panel in panels[len(shown) :]:
        panel.set_axis_off()
    return figure
