"""Stress and displacement at points of lines through the rock, against a closed form and their own stated errors."""

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from response.field import values_at
from response.rock import Rock, Voids
from verification.comparisons import reaching
from verification.rows import Row

RADII = np.concatenate([np.linspace(1.0, 1.6, 13), np.linspace(1.7, 3.0, 8)])  # Of the points of a line.
NEAR_WALL = 1.2  # Radii; points up to here are counted apart.
COVERED = 0.95  # Level of the stated errors.
MULTIPLICITY = np.array([1.0, 1.0, 1.0, 2.0, 2.0, 2.0])


def line_points(directions: NDArray, radius: float) -> NDArray:
    """Points (line * point, xyz) m from the middle of an opening, on a line in each direction (line, xyz)."""
    return (directions[:, None] * RADII[None, :, None] * radius).reshape(-1, 3)


def field_rows(
    name: str, grid: xr.Dataset, state: xr.Dataset, centre: NDArray, off: NDArray, stress: NDArray, moved: NDArray
) -> list[Row]:
    """Share of points whose error is within the stated one, of stress and displacement, near the wall and beyond.

    off (n, xyz) m: places of `line_points`; stress (n, 6) Pa with NaN for components that are not compared, moved (n,
    xyz) m: exact fields there.
    """
    found = values_at(Rock(state, Voids.of(grid, np.ones(1, bool))), off + centre)
    compared = np.isfinite(stress[0])
    difference = (found.stress - stress)[:, compared] ** 2
    errors = {
        "stress": (np.sqrt(difference @ MULTIPLICITY[compared]) / 1e6, found.stress_error / 1e6, "MPa"),
        "displacement": (
            1e3 * np.linalg.norm(found.displacement - moved, axis=1),
            1e3 * found.displacement_error,
            "mm",
        ),
    }
    wall = np.tile(RADII <= NEAR_WALL + 1e-9, len(off) // len(RADII))
    rows = []
    for where, chosen in (("up to 1.2 radii", wall), ("beyond 1.2 radii", ~wall)):
        for what, (error, stated, unit) in errors.items():
            share = float(np.mean(error[chosen] <= stated[chosen]))  # NaN counts as missed
            root = float(np.sqrt(np.nanmean(error[chosen] ** 2)))
            remark = (
                f"{int(chosen.sum())} points; r.m.s. error {root:.3g} {unit}, stated {np.nanmean(stated[chosen]):.3g}"
            )
            quantity = f"{name}: {what} along lines, {where}, share of points within the stated error"
            rows.append(reaching(f"{quantity} (error: short of {COVERED:g})", 1.0, share, COVERED, 0.0, remark))
    return rows
