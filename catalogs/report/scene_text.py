"""The scene in the report: excavations by step if they are many, and the expected error of the domain."""

import numpy as np
import xarray as xr

from catalogs.report.inputs import Evidence, Excavation
from catalogs.report.text import whole


def by_step(excavations: list[Excavation]) -> list[dict]:
    """One row per step, in the order in which excavations name them: how many, their volumes m3, what misses most.

    worst: the excavation whose volume the grid misses most, error: by which share of the solid's, NaN if none is known;
    planned: whether no step of the run mines them.
    """
    rows: dict[str, list[Excavation]] = {}
    for excavation in excavations:
        rows.setdefault(excavation.step, []).append(excavation)
    return [_row(step, members) for step, members in rows.items()]


def _row(step: str, members: list[Excavation]) -> dict:
    solid, drawn = (np.array([getattr(one, name) for one in members]) for name in ("solid", "drawn"))
    error = np.full(len(members), np.nan)
    np.divide(drawn - solid, solid, out=error, where=solid > 0)
    worst = int(np.nanargmax(np.abs(error))) if np.isfinite(error).any() else 0
    return {
        "step": step,
        "planned": members[0].planned,
        "count": len(members),
        "solid": float(solid.sum()),
        "drawn": float(drawn.sum()),
        "worst": members[worst].name,
        "error": float(error[worst]),
    }


def far_field(grid: xr.Dataset) -> str:
    """What is expected of a domain that follows from its openings, in a sentence; empty where it was given."""
    if "far_field_error" not in grid.attrs:
        return ""
    distance, error = float(grid.attrs["far_field_distance"]), float(grid.attrs["far_field_error"])
    short = {
        "memory": " A larger one would take too much memory on these cells.",
        "strength": " It ends there because virgin rock beyond it is above its strength.",
        "": "",
    }[grid.attrs["far_field_limited"]]
    return (
        f"The domain follows from the openings: its boundary is {distance:.0f} m from the nearest of them. In elastic "
        f"rock it changes the stress at a wall by at most {error:.2g} % of the largest (closed-form estimate).{short}"
    )


def above_cap(evidence: Evidence) -> str:
    """That there are more cells than grid.max_cells, in a sentence; empty where there are not, or on a static grid."""
    grid = evidence.config.get("grid", {})
    if not evidence.stages or grid.get("refinement") != "adaptive":
        return ""
    last = evidence.stages[-1].attrs
    if last["cells"] <= grid["max_cells"]:
        return ""
    return (
        f"The last step has {whole(last['cells'])} cells, more than grid.max_cells ({whole(grid['max_cells'])}). Cells "
        "of openings are refined in any case. Rock that comes near its strength then stays in coarse cells."
    )
