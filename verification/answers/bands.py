"""Directions of bands of failed rock around a stope that is turned against the grid."""

from dataclasses import dataclass

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from catalogs.compare.bands import TOLERANCE, band_normals
from catalogs.figures import style
from common.part_centers import part_centers
from common.source_tensors import scalar_potency
from common.voigt import tensor_from_voigt
from verification.page_tables import Pivot
from verification.results import Results, Variant
from verification.rows import Row

TABLES = (
    Pivot(
        "Particles in bands along the axes of the grid, over those along their mirror images",
        r"turned by (?P<row>[\d.]+) degrees, (?P<column>uniform|varied): bands along the grid over their mirror images",
        "measured",
    ),
)
STEP = "mined"
RIGHT_ANGLE, HALF_TURN = 90.0, 180.0
RESAMPLINGS, SEED = 2000, 1


@dataclass(frozen=True)
class Failed:
    """Failed rock of a run: place (k, 2) m; direction (band,) degrees from x of the particles in bands; potency m3."""

    place: NDArray
    direction: NDArray
    potency: float


def answer(results: Results) -> tuple[list[Row], Figure]:
    """Rows for each turn, in uniform and in varied rock; a figure of the failed rock of the mine's own runs."""
    settings, allowed, rows = results.settings, results.allowed, []
    runs = {}
    for turn in settings["turns"]:
        for kind, prefix in (("uniform", "uniform"), ("varied", "turn")):
            variant = results[f"{prefix}_{str(turn).replace('.', '_')}"]
            runs[turn, kind] = _runs(variant, settings["radius"])
    for (turn, kind), found in runs.items():
        if 2.0 * turn % RIGHT_ANGLE:  # at other turns the mirror images are the axes themselves
            counts = np.array([[near(run.direction, turned) for turned in (0.0, 2.0 * turn)] for run in found])
            title = f"turned by {turn:g} degrees, {kind}: bands along the grid over their mirror images"
            bound = allowed["ratio"] if kind == "varied" else None
            rows.append(Row.relative(title, 1.0, _ratio(counts), bound, _resampled(counts)))
    varied = {
        turn: np.array([run.potency for run in found]) for (turn, kind), found in runs.items() if kind == "varied"
    }
    every = np.mean([potency.mean() for potency in varied.values()])
    for turn, potency in varied.items():
        title = f"turned by {turn:g} degrees: mean potency less that of all turns, standard deviations of the runs"
        told = f"{potency.mean():.3f} of {every:.3f} m3, standard deviation {potency.std(ddof=1):.3f} m3"
        rows.append(
            Row.absolute(title, 0.0, float((potency.mean() - every) / potency.std(ddof=1)), allowed["potency"], told)
        )
    return rows, draw(runs, settings)


def _ratio(counts: NDArray) -> float:
    """Sum over runs (run, 2) of the first over that of the second."""
    along, mirrored = counts.sum(axis=0)
    return float(along / max(mirrored, 1))


def _resampled(counts: NDArray) -> str:
    """Numbers of particles, and the 90 % interval of the ratio over resampled runs, where there are several."""
    told = f"{counts[:, 0].sum()} and {counts[:, 1].sum()} particles"
    if len(counts) == 1:
        return told
    chosen = np.random.default_rng(SEED).integers(0, len(counts), (RESAMPLINGS, len(counts)))
    low, high = np.quantile([_ratio(counts[one]) for one in chosen], [0.05, 0.95])
    return f"{told} in {len(counts)} runs; 90 % interval over resampled runs {low:.2f} to {high:.2f}"


def near(direction: NDArray, turned: float) -> int:
    """How many directions, degrees, lie along either of two axes at right angles, the first at an angle `turned`."""
    apart = (direction - turned + 0.5 * RIGHT_ANGLE) % RIGHT_ANGLE - 0.5 * RIGHT_ANGLE
    return int(np.count_nonzero(np.abs(apart) <= TOLERANCE))


def directions(place: NDArray, cell: float, radius: float) -> NDArray:
    """Direction (band,) degrees of the failed rock around each of its particles (k, 2) m that is in a band."""
    normal = band_normals(place, cell, radius / cell)[1]
    return (np.degrees(np.arctan2(normal[:, 1], normal[:, 0])) + RIGHT_ANGLE) % HALF_TURN


def _runs(variant: Variant, radius: float) -> list[Failed]:
    paths = [f"steps/{STEP}.nc", *(f"ensemble/{one}/steps/{STEP}.nc" for one in range(1, variant.mine.members + 1))]
    return [_failed(variant, path, radius) for path in paths]


def _failed(variant: Variant, path: str, radius: float) -> Failed:
    step = variant.read(path)
    here = np.flatnonzero((step["failed"].values == step.attrs["step_index"]) & (step["volume"].values > 0.0))
    place = part_centers(step)[here, :2]
    tensor = tensor_from_voigt(step["seismic_strain"].values[here] * step["volume"].values[here, None])
    return Failed(place, directions(place, variant.mine.finest_cell, radius), float(scalar_potency(tensor).sum()))


def draw(runs: dict, settings: dict) -> Figure:
    """Failed rock of the first run of each turn in the axes of the stope: uniform above, varied below."""
    turns, center = settings["turns"], np.array(settings["center"])
    figure = style.new_figure(height=4.4)
    panels = figure.subplots(2, len(turns), sharex=True, sharey=True)
    for row, kind in zip(panels, ("uniform", "varied"), strict=True):
        for axes, turn in zip(row, turns, strict=True):
            angle = np.radians(turn)
            own = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
            place = (runs[turn, kind][0].place - center) @ own
            axes.plot(*place.T, ".", color=style.MODELLED, markersize=0.8)
            axes.set(aspect="equal", title=f"{turn:g}°" if kind == "uniform" else None)
        row[0].set_ylabel(f"{kind} rock\nalong the stope (m)")
    for axes in panels[-1]:
        axes.set_xlabel("across (m)")
    return figure
