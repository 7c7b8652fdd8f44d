"""Estimates and tests of the catalogue comparison against catalogues of known truth."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from catalogs.figures import style
from verification.answers.statistics.location_recovery import Power, false_alarms, find_shift, location_rows, step_rows
from verification.answers.statistics.mechanism_recovery import RandomPairs, mechanism_rows, random_pairs, share_closer
from verification.answers.statistics.size_recovery import Estimates, difference_row, estimate_cases, size_rows
from verification.comparisons import monte_carlo_error
from verification.page_tables import Pivot
from verification.plots import plot_errors, plot_series
from verification.results import Results
from verification.rows import Row

NUMERICS = ("catalogs/compare", "catalogs/sources")  # Folders that the results may change with.

TABLES = (
    Pivot(
        "Estimates of b",
        r"(?P<row>b .+?): (?P<column>mean of b|coverage of the 95 % interval|mean stated error of b)(?: .+)?",
        "measured",
    ),
    Pivot("Three steps that lie apart", r"three steps (?P<row>\d+ m apart), (?P<column>.+?)(?: \(.+\))?", "measured"),
)


def answer(results: Results) -> tuple[list[Row], Figure]:
    """Rows on b-values, axes and angles, and locations; one figure of all."""
    settings, allowed, seed = results.settings, results.allowed, results.settings["seed"]
    estimates = estimate_cases(settings["sizes"], seed)
    uncorrected = estimate_cases(settings["sizes"], seed, "uncorrected")
    pairs = random_pairs(settings["mechanisms"], seed)
    alarms = false_alarms(settings["locations"], seed)
    power = find_shift(settings["locations"], seed)
    rows = [
        *size_rows(estimates, uncorrected, settings["sizes"]["confidence"], allowed),
        difference_row(settings["sizes"], seed, allowed["coverage"]),
        *mechanism_rows(settings["mechanisms"], pairs, seed, allowed),
        *location_rows(alarms, power, settings["locations"], allowed),
        *step_rows(settings["locations"], seed, allowed),
    ]
    return rows, draw(estimates, pairs, alarms, power, settings, allowed)


def draw(
    estimates: list[Estimates],
    pairs: RandomPairs,
    alarms: dict[str, float],
    power: Power,
    settings: dict,
    allowed: dict,
) -> Figure:
    """b and its intervals, Kagan angles, locations. estimates: one for each case. alarms: shares by situation."""
    figure = style.new_figure(height=9.0)
    top, bottom = figure.subfigures(2, 1, squeeze=False, height_ratios=[1.25, 1.0])[:, 0]
    draw_sizes(top.subplots(1, 3, sharey=True), estimates, settings["sizes"]["confidence"], allowed)
    kagan, false, found = bottom.subplots(1, 3)
    draw_kagan(kagan, pairs)
    level, chosen = settings["locations"]["level"], settings["locations"]
    error = 200.0 * monte_carlo_error(level, chosen["pairs"])
    limits = 100.0 * (level - allowed["false_alarms"]), 100.0 * (level + allowed["false_alarms"])
    names = [name.replace(", ", ",\n") for name in alarms]
    what = "one process said to be two (%)\n(bars: 2 Monte Carlo errors)"
    shares = {"": [100.0 * share for share in alarms.values()]}
    labels: dict = {"title": "Locations: false alarms", "xlabel": what, "xlim": (0.0, None)}
    plot_errors(false, names, shares, error, truth=100.0 * level, band=limits, **labels)
    shift = chosen["shift"]
    error = 200.0 * monte_carlo_error(shift["power"], power.pairs)
    names = ["this\ncomparison", "Hotelling,\nsame draws"]
    what = f"shift of {shift['metres']:g} m found (%)\n(bars: 2 Monte Carlo errors)"
    shares = {"": [100 * power.found, 100 * power.hotelling]}
    plot_errors(found, names, shares, error, title="Locations: power", xlabel=what)
    found.axvline(100 * power.best, color=style.RECORDED, label=f"Hotelling, exact: {100 * power.best:.1f}")
    found.axvline(100 * shift["power"], color=style.OUTLINE, linestyle=":", label="asked for")
    found.legend(loc="center")
    return figure


def draw_sizes(panels, estimates: list[Estimates], confidence: float, allowed: dict) -> None:
    """Scatter of b over its true value, bias over standard error, and coverage, case by case."""
    names = [one.name for one in estimates]
    mean = np.array([one.value.mean() / one.case["b"] for one in estimates])
    ends = np.array([np.quantile(one.value, [0.025, 0.975]) / one.case["b"] for one in estimates]).T
    what = "estimated b / true b\n(mean, 95 % of the catalogues)"
    title = "b of simulated catalogues"
    plot_errors(panels[0], names, {"": mean}, np.abs(ends - mean), truth=1.0, title=title, xlabel=what)
    count = len(estimates[0].value)
    bias = [one.bias / one.value.std() for one in estimates]
    limits = -allowed["bias"], allowed["bias"]
    what = "bias / standard error\n(shaded: allowed;\nbars: 3 Monte Carlo errors)"
    plot_errors(panels[1], names, {"": bias}, 3.0 / np.sqrt(count), truth=0.0, band=limits, title="Bias", xlabel=what)
    error = 300.0 * monte_carlo_error(confidence, count)
    limits = 100 * (confidence - allowed["coverage"]), 100 * (confidence + allowed["coverage"])
    coverage = {"": [100.0 * one.coverage for one in estimates]}
    what = f"truth inside the\n{100 * confidence:g} % interval (%)\n(shaded: allowed)"
    plot_errors(panels[2], names, coverage, error, truth=100 * confidence, band=limits, title="Coverage", xlabel=what)


def draw_kagan(axes: Axes, pairs: RandomPairs) -> None:
    """Density of the angle between random double couples, with the closed form up to 90 degrees."""
    edges = np.arange(0.0, 121.0, 3.0)
    share = np.histogram(pairs.random, bins=edges)[0] / len(pairs.random)
    axes.stairs(100.0 * share / np.diff(edges), edges, fill=True, color=style.MODELLED, alpha=0.35, label="simulated")
    degrees = np.linspace(0.0, 90.0, 91)
    density = 100.0 * np.gradient(np.array([share_closer(one) for one in degrees]), degrees)
    what = "angle between random double couples (degrees)"
    exact = {"exact, up to 90 degrees": (degrees, density)}
    axes.set_ylim(top=1.5 * density.max())
    plot_series(axes, {}, exact, title="Kagan angles", xlabel=what, ylabel="pairs (% per degree)")
