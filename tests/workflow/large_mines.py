"""Mines as large as real ones: thousands of stopes in hundreds of months, drawn by seed.

python -m tests.workflow.large_mines 5000 200 FILE     writes one
"""

import copy
import sys
from itertools import pairwise
from pathlib import Path

import numpy as np
import yaml

sys.path.insert(0, str(Path(__file__).parent))
from tiny_mines import TINY

CELL = 40.0  # m; stopes are of one to two finest cells, so that the grid is quick


def large_mine(excavations: int, steps: int, seed: int = 1) -> dict:
    """A mine file of so many boxes and prisms with fill: the first history, the others by month; no record.

    Every quantity is a text with a unit, as a user writes it.
    """
    random = np.random.default_rng(seed)
    places = int(np.ceil((2 * excavations) ** (1 / 3))) + 1  # for stopes along each axis: twice as many as there are
    side = (places + 2) * CELL
    place = np.array(np.unravel_index(random.choice(places**3, excavations, replace=False), (places,) * 3)).T
    half = random.uniform(0.5, 0.9, (excavations, 3)) * CELL / 2
    corners = np.stack([(place + 1.5) * CELL - half, (place + 1.5) * CELL + half], axis=1).round(2)
    months = [f"{1980 + month // 12}-{month % 12 + 1:02d}" for month in range(steps)]
    names = ["history", *months[:-1]]
    mine = copy.deepcopy({key: TINY[key] for key in ("frame", "insitu_stress", "materials")})
    mine["frame"]["surface"] = f"{side:g} m"
    mine["materials"]["host"]["cohesion"] = {"intact": "50 MPa", "residual": "1 MPa"}
    listed = [
        {
            "name": f"stope_{number}",
            "step": names[number * steps // excavations],
            **_shape(number, *ends),
            "fill": "fill",
        }
        for number, ends in enumerate(corners.tolist())
    ]
    dated = pairwise(months)
    return {
        "name": f"large-{excavations}",
        **mine,
        "domain": {"lower": ["0 m"] * 3, "upper": [f"{side:g} m"] * 3},
        "grid": {"coarse_cell": f"{CELL:g} m", "levels": 2, "buffer_cells": 0, "volume_error": 1.0},
        "excavations": listed,
        "steps": [
            {"name": "history"},
            *({"name": start, "start": f"{start}-01", "end": f"{end}-01"} for start, end in dated),
        ],
    }


def _shape(number: int, lower: list[float], upper: list[float]) -> dict:
    """Every fourth a prism, the others boxes, between two corners, m."""
    low, high = ([f"{value:g} m" for value in corner] for corner in (lower, upper))
    if number % 4:
        return {"shape": "box", "lower": low, "upper": high}
    outline = [[low[0], low[1]], [high[0], low[1]], [high[0], high[1]], [low[0], high[1]]]
    return {"shape": "prism", "polygon": outline, "lower": low[2], "upper": high[2]}


if __name__ == "__main__":
    count, months, file = sys.argv[1:]
    Path(file).write_text(yaml.safe_dump(large_mine(int(count), int(months)), sort_keys=False))
