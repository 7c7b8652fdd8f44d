"""Comparison of particles that move through the grid (solver.move, paper section 2.2) with particles that rest."""

import numpy as np
from matplotlib.figure import Figure

from catalogs.figures import style
from verification.answers.schemes import QUANTITIES, Means, Pairs, read_pairs
from verification.comparisons import convergence_orders, vanishing
from verification.plots import GRID, plot_convergence, plot_series
from verification.results import Results, Variant
from verification.rows import Row


def answer(results: Results) -> tuple[list[Row], Figure]:
    """Rows and figure of the study."""
    settings, allowed = results.settings, results.allowed
    rows, closures = elastic_rows(results)
    resting, moving = (results[name] for name in settings["brittle"])
    pairs = read_pairs((resting, moving), settings["increments"])
    rows += brittle_rows(f"brittle, {settings['judged']}", pairs, allowed["standard_errors"])
    return rows, draw(resting, closures, pairs, settings["increments"])


def elastic_rows(results: Results) -> tuple[list[Row], list[tuple[float, float]]]:
    """Closure with moving particles beside that with resting ones, and the order of their difference.

    Returns the rows, and for each rock the closure (m) with resting particles and the share that it differs by.
    """
    settings, allowed = results.settings, results.allowed
    rows, closures = [], []
    for rock, (resting, moving) in settings["elastic"].items():
        first, other = (wall_closure(results[name]) for name in (resting, moving))
        closures.append((first, abs(other / first - 1.0)))
        bound = allowed["closure"] if rock == settings["judged"] else None
        remark = f"{results[moving].elastic.attrs['cell_changes']} particles changed their cell"
        quantity = f"elastic, {rock}: closure of the wall with moving particles, mm"
        rows.append(Row.relative(quantity, 1e3 * first, 1e3 * other, bound, remark))
    (small, least), *_, (large, most) = closures
    (order,) = convergence_orders((large, small), (most, least))
    quantity = "elastic: order of the difference in the closure, stiffest to softest rock"
    return [*rows, Row.absolute(quantity, 1.0, order, allowed["order"])], closures


def brittle_rows(scene: str, pairs: Pairs, allowed: float) -> list[Row]:
    """Differences of the means of all runs, in standard errors; b only where every run has enough events."""
    rows = []
    for key, (name, _) in QUANTITIES.items():
        if key == "b" and not pairs.has_b:
            continue
        means = Means(*pairs.values(key))
        remark = f"means {means.first.mean():.4g} resting, {means.other.mean():.4g} moving, {pairs.count} runs each"
        quantity = f"{scene}: {name}, difference of the means in standard errors"
        rows.append(vanishing(quantity, means.apart, allowed, remark))
    return rows


def wall_closure(variant: Variant) -> float:
    """Mean inward displacement of the particles within one cell of the wall of a circular hole, m.

    The particles are chosen by the places at which they start, which are the same whether they move or not.
    """
    state, hole = variant.elastic, variant.mine.grid_slice()["excavations"][0]
    displacement = state.displacement.values[:, :2]
    start = state.position.values[:, :2] - (displacement if variant.values["solver"]["move"] else 0.0)
    offset = start - hole["center"]
    distance = np.hypot(*offset.T)
    volume = state.volume.values
    beside = (volume > 0.0) & (distance < hole["radius"] + float(variant.grid.attrs["fine_cell"]))
    inward = -(displacement * offset).sum(axis=1) / distance
    return float(np.average(inward[beside], weights=volume[beside]))


def draw(brittle: Variant, closures: list[tuple[float, float]], pairs: Pairs, increments: list[int]) -> Figure:
    """Difference of the closure against the closure in cells; potency of the brittle runs by their increments."""
    figure = style.new_figure(height=3.4)
    elastic, runs = figure.subplots(1, 2)
    closure, difference = np.array(closures).T
    found = {"moving beside resting particles": (closure / float(brittle.grid.attrs["fine_cell"]), difference)}
    labels: dict = {"xlabel": "closure of the wall (cells)", "ylabel": "difference of the closure (share)"}
    plot_convergence(elastic, found, 1.0, "first order", ticks=False, marks="o", title="elastic", **labels)
    potency = {f"{name.split('_')[0]} particles": [run.potency for run in some] for name, some in pairs.runs.items()}
    series = {name: (increments, values) for name, values in potency.items()}
    labels = {"xlabel": "increments of the run", "ylabel": "seismic potency (m³)"}
    plot_series(runs, series, marks=("o", "s"), title="brittle", **labels)
    runs.set_ylim(bottom=0.0)
    runs.grid(**GRID)
    return figure
