"""Convergence of Kirsch's hole as cells are halved: closure, stress at a distance, and stress at the wall.

A cut wall disturbs the cells beside it in the same pattern whatever their size, so stress at the wall converges slowly.
"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from verification.answers.kirsch.hole_fields import Rock, mean_square_root
from verification.results import Results
from verification.rows import Row

ANGLES = 2 * np.pi * (np.arange(360) + 0.5) / 360
CLEAR_CELLS = 1.0  # Cells next to the wall that the extrapolation leaves out.


@dataclass(frozen=True)
class Point:
    """R.m.s. errors of one grid around the hole. cell: the finest, m.

    closure: of the wall's inward displacement, over its mean. mean_closure: signed error of that mean. stress: of
    radial and hoop stress at a distance, over the far stress. wall: of the hoop stress in particles within a cell of
    the wall, each compared at its own place, over the mean at the wall. extrapolated: the same of a fit to particles
    farther out, at the wall.
    """

    cell: float
    closure: float
    mean_closure: float
    stress: float
    wall: float
    extrapolated: float


def interpolated(rock: Rock, points: np.ndarray) -> np.ndarray:
    """Polar stress (3, point), Pa, inside the rock: a plane fitted to the four cells around each point."""
    return rock.fitted_stress(points, degree=1, cells=4)


def extrapolated(rock: Rock, points: np.ndarray) -> np.ndarray:
    """Polar stress (3, point), Pa, at the wall: a quadratic fitted to fifteen cells beyond CLEAR_CELLS."""
    return rock.fitted_stress(points, degree=2, cells=15, clear=CLEAR_CELLS * rock.hole.cell)


def measure(rock: Rock, distance: float) -> Point:
    """Errors of a run. distance: at which stress is compared, radii."""
    hole, around = rock.hole, np.exp(1j * ANGLES)
    wall = hole.radius * around
    exact = hole.plate.at(wall)
    inward = -(rock.wall_displacement(ANGLES) / around).real
    true_inward = -exact.polar_displacement(ANGLES)[0]
    wall_hoop = exact.polar_stress(ANGLES)[1]
    hoop = np.abs(wall_hoop.mean())
    away = interpolated(rock, distance * wall) - hole.plate.at(distance * wall).polar_stress(ANGLES)
    beside = rock.between(0.0, hole.radius + hole.cell)
    error = rock.polar[1, beside] - rock.exact(beside).polar_stress(rock.angle[beside])[1]
    return Point(
        cell=hole.cell,
        closure=float(mean_square_root(inward - true_inward) / true_inward.mean()),
        mean_closure=float(inward.mean() / true_inward.mean() - 1.0),
        stress=float(mean_square_root(away[:2].ravel()) / hole.far_stress),
        wall=float(mean_square_root(error, rock.volume[beside]) / hoop),
        extrapolated=float(mean_square_root(extrapolated(rock, wall)[1] - wall_hoop) / hoop),
    )


def read_series(results: Results) -> dict[str, list[Point]]:
    """Points by treatment of cut cells, from coarse to fine."""
    distance = results.settings["stress_distance"]
    series = {
        method: [measure(Rock(results[name]), distance) for name in names if name in results.variants]
        for method, names in results.settings["series"].items()
    }
    return {method: sorted(points, key=lambda point: -point.cell) for method, points in series.items() if points}


def order(points: list[Point], name: str) -> float:
    """Order of convergence of an error over a series: slope of its logarithm by least squares."""
    return float(np.polyfit(np.log([p.cell for p in points]), np.log([getattr(p, name) for p in points]), 1)[0])


def order_rows(series: dict[str, list[Point]], least: float, distance: float) -> list[Row]:
    """Orders of closure and of stress at a distance, and the mean closure of the finest, for each treatment."""
    rows = []
    for method, points in series.items():
        span = f"h {points[0].cell:g} to {points[-1].cell:g} m"
        for name, what in (("closure", "closure of the wall"), ("stress", f"stress at r = {distance:g} a")):
            found = order(points, name)
            errors = [getattr(point, name) for point in points]
            halvings = ", ".join(f"{np.log2(a / b):.2f}" for a, b in pairwise(errors))
            remark = (
                f"r.m.s. errors {', '.join(f'{100 * error:.2f}' for error in errors)} %; halving by halving {halvings}"
            )
            rows.append(
                Row(
                    f"{method}: order of convergence, {what}, {span}",
                    least,
                    found,
                    max(0.0, least - found),
                    0.0,
                    remark,
                )
            )
        means = [point.mean_closure for point in points]
        remark = f"{', '.join(f'{100 * mean:+.2f}' for mean in means)} % from coarse to fine"
        quantity = f"{method}: mean closure over the exact one, h = {points[-1].cell:g} m"
        rows.append(Row(quantity, 1.0, 1.0 + means[-1], abs(means[-1]), remark=remark))
    return rows


def wall_rows(series: dict[str, list[Point]], cell: float, method: str, allowed: float) -> list[Row]:
    """Rows of the hoop stress at the wall on every grid; on those of one cell size it is extrapolated to the wall.

    method: treatment of cut cells that is extrapolated. allowed: extrapolated error over the least of the others.
    """
    rows = []
    for name, points in series.items():
        for point in points:
            quantity = f"{name}: hoop stress within a cell of the wall, h = {point.cell:g} m, r.m.s. share"
            rows.append(Row(quantity, 0.0, point.wall, point.wall))
    found = {name: point for name, points in series.items() for point in points if np.isclose(point.cell, cell)}
    if method in found:
        best = min(point.wall for point in found.values())
        error = found[method].extrapolated
        coarser = ", ".join(f"{100 * point.extrapolated:.1f} % at {point.cell:g} m" for point in series[method])
        quantity = f"{method}, extrapolated: hoop stress of the wall, h = {cell:g} m, r.m.s. share"
        rows.append(Row(quantity, 0.0, error, error, remark=f"by cell: {coarser}"))
        quantity = f"{method}: extrapolated over the best error within a cell of the wall, h = {cell:g} m"
        rows.append(Row(quantity, allowed, error / best, error / best, allowed))
    return rows
