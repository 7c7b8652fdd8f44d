"""Figure of the statistics study: b and its intervals, Kagan angles, locations."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from catalogs.figures import style
from verification.answers.statistics.location_recovery import Power
from verification.answers.statistics.mechanism_recovery import RandomPairs, share_closer
from verification.answers.statistics.size_recovery import Estimates


def draw(
    estimates: list[Estimates],
    pairs: RandomPairs,
    alarms: dict[str, float],
    power: Power,
    settings: dict,
    allowed: dict,
) -> Figure:
    """All panels. estimates: one for each case. alarms: share of false alarms by situation."""
    figure = style.new_figure(height=9.0)
    top, bottom = figure.subfigures(2, 1, height_ratios=[1.25, 1.0])
    scatter, bias, coverage = top.subplots(1, 3)
    kagan, false, found = bottom.subplots(1, 3)
    _draw_scatter(scatter, estimates)
    _draw_bias(bias, estimates, allowed["bias"])
    _draw_coverage(coverage, estimates, settings["sizes"]["confidence"], allowed["coverage"])
    _draw_kagan(kagan, pairs)
    _draw_alarms(false, alarms, settings["locations"], allowed["false_alarms"])
    _draw_power(found, power, settings["locations"]["shift"])
    return figure


def _draw_scatter(axes: Axes, estimates: list[Estimates]) -> None:
    """Central 95 % of b over its true value, and its mean, case by case."""
    place = np.arange(len(estimates))
    for row, one in enumerate(estimates):
        lower, upper = np.quantile(one.value, [0.025, 0.975]) / one.case["b"]
        axes.plot([lower, upper], [row, row], color=style.MODELLED, linewidth=5, alpha=0.35, solid_capstyle="butt")
    axes.plot([one.value.mean() / one.case["b"] for one in estimates], place, "o", color=style.MODELLED, markersize=5)
    axes.axvline(1.0, color=style.OUTLINE, linewidth=0.8)
    axes.set_yticks(place, [one.name for one in estimates])
    axes.invert_yaxis()
    axes.set_xlabel("estimated b / true b\n(mean, 95 % of the catalogues)")
    axes.set_title("b of simulated catalogues")


def _draw_bias(axes: Axes, estimates: list[Estimates], allowed: float) -> None:
    """Bias over standard error with three Monte Carlo errors."""
    place = np.arange(len(estimates))
    bias = [one.bias / one.value.std() for one in estimates]
    error = 3.0 / np.sqrt(len(estimates[0].value))
    axes.axvspan(-allowed, allowed, color=style.BOTH, alpha=0.15, linewidth=0)
    axes.errorbar(bias, place, xerr=error, fmt="o", color=style.MODELLED, markersize=4)
    axes.axvline(0.0, color=style.OUTLINE, linewidth=0.8)
    axes.set_yticks(place, [])
    axes.invert_yaxis()
    axes.set_xlabel("bias / standard error\n(bars: 3 Monte Carlo errors)")
    axes.set_title("Bias")


def _draw_coverage(axes: Axes, estimates: list[Estimates], confidence: float, allowed: float) -> None:
    """Share of intervals that hold the truth with three Monte Carlo errors."""
    place = np.arange(len(estimates))
    error = 300.0 * np.sqrt(confidence * (1.0 - confidence) / len(estimates[0].value))
    axes.axvspan(100 * (confidence - allowed), 100 * (confidence + allowed), color=style.BOTH, alpha=0.15, linewidth=0)
    coverage = [100.0 * one.coverage for one in estimates]
    axes.errorbar(coverage, place, xerr=error, fmt="o", color=style.MODELLED, markersize=4)
    axes.axvline(100 * confidence, color=style.OUTLINE, linewidth=0.8)
    axes.set_yticks(place, [])
    axes.invert_yaxis()
    axes.set_xlabel(f"truth inside the {100 * confidence:g} % interval (%)\n(shaded: allowed)")
    axes.set_title("Coverage")


def _draw_kagan(axes: Axes, pairs: RandomPairs) -> None:
    """Density of the angle between random double couples, with the closed form up to 90 degrees."""
    edges = np.arange(0.0, 121.0, 3.0)
    share = np.histogram(pairs.random, bins=edges)[0] / len(pairs.random)
    axes.stairs(100.0 * share / np.diff(edges), edges, fill=True, color=style.MODELLED, alpha=0.35, label="simulated")
    degrees = np.linspace(0.0, 90.0, 91)
    cumulative = np.array([share_closer(one) for one in degrees])
    axes.plot(degrees, 100.0 * np.gradient(cumulative, degrees), color=style.RECORDED, label="exact, up to 90 degrees")
    axes.set_xlabel("angle between random double couples (degrees)")
    axes.set_ylabel("pairs (% per degree)")
    axes.set_title("Kagan angles")
    axes.legend()


def _draw_alarms(axes: Axes, alarms: dict[str, float], settings: dict, allowed: float) -> None:
    """False alarms per situation."""
    level = settings["level"]
    place = np.arange(len(alarms))
    error = 200.0 * np.sqrt(level * (1.0 - level) / settings["pairs"])
    axes.axhspan(100.0 * (level - allowed), 100.0 * (level + allowed), color=style.BOTH, alpha=0.15, linewidth=0)
    axes.axhline(100.0 * level, color=style.OUTLINE, linewidth=0.8)
    axes.errorbar(place, [100.0 * share for share in alarms.values()], yerr=error, fmt="o", color=style.MODELLED)
    axes.set_xticks(place, [name.replace(" ", "\n") for name in alarms], fontsize=8)
    axes.set_xlim(-0.5, len(alarms) - 0.5)
    axes.set_ylim(0.0, None)
    axes.set_ylabel("one process said to be two (%)\n(bars: 2 Monte Carlo errors)")
    axes.set_title("Locations: false alarms")


def _draw_power(axes: Axes, power: Power, shift: dict) -> None:
    """Share of shifts found by the comparison and by the best test."""
    error = 200.0 * np.sqrt(shift["power"] * (1.0 - shift["power"]) / power.pairs)
    names = ["this\ncomparison", "Hotelling,\nsame draws"]
    axes.errorbar([0, 1], [100 * power.found, 100 * power.hotelling], yerr=error, fmt="o", color=style.MODELLED)
    axes.axhline(
        100 * power.best, color=style.RECORDED, linewidth=1.0, label=f"Hotelling, exact: {100 * power.best:.1f}"
    )
    axes.axhline(100 * shift["power"], color=style.OUTLINE, linewidth=0.8, linestyle=":", label="asked for")
    axes.set_xticks([0, 1], names)
    axes.set_xlim(-0.6, 1.6)
    axes.set_ylim(100 * power.found - 2 * error, 100 * power.best + 2 * error)
    axes.set_ylabel(f"shift of {shift['metres']:g} m found (%)")
    axes.set_title("Locations: power")
    axes.legend()
