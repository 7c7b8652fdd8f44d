"""The largest modelled events: place, size, mechanism, and their beach balls.

The template is "balls.html.j2".
"""

import numpy as np
import xarray as xr

from catalogs.figures import beachballs, style
from catalogs.report.evidence import Evidence
from catalogs.report.gallery import Gallery
from catalogs.report.text import DASH, fixed, whole
from common.mine_grid import GridMap

LARGEST_EVENTS_DRAWN = 10  # Number of beach balls.


def section(evidence: Evidence, gallery: Gallery) -> dict | None:
    """Content of the section on the largest events: the figure of their beach balls, and a row of text for each. None
    without modelled events."""
    if evidence.catalog is None:
        return None
    largest = largest_events(evidence.resolved, LARGEST_EVENTS_DRAWN)
    if not len(largest):
        return None
    chosen = evidence.resolved.isel(event=largest)
    rows = ball_rows(chosen, evidence.mine_grid)
    titles = [
        f"{row['rank']}: log P {row['log_potency']}, Mw {row['mw']}\n{row['location']} m\n{row['step']}" for row in rows
    ]
    axes_of = np.stack([chosen["p_axis"].values, chosen["t_axis"].values], axis=1)
    tensors = chosen["moment_tensor"].values
    return {
        "figure": gallery.add("beach_balls", beachballs.beach_balls(tensors, titles, axes_of, style.MODELLED)),
        "rows": rows,
    }


def largest_events(catalog: xr.Dataset, count: int) -> np.ndarray:
    """Indices of the events with the largest potency, largest first (ties: the earlier), tensors known."""
    known = np.isfinite(catalog["potency_tensor"].values).all(axis=(1, 2))
    potency = np.where(known, np.nan_to_num(catalog["potency"].values, nan=-1.0), -1.0)
    order = np.argsort(-potency, kind="stable")[:count]
    return order[known[order]]


def ball_rows(events: xr.Dataset, grid: GridMap | None = None) -> list[dict]:
    """One row of text per event, in the given order; in_grid: its place in the mine's own grid, if there is one."""
    rows = []
    own = grid.to_grid(events["location"].values) / grid.metres_per_unit if grid else None
    for index in range(events.sizes["event"]):
        event = events.isel(event=index)
        rows.append(
            {
                "rank": index + 1,
                "date": str(event["time"].values.astype("datetime64[D]")).replace("NaT", DASH),
                "step": str(event["step"].values),
                "location": ", ".join(fixed(value, 0) for value in event["location"].values),
                "in_grid": "" if own is None else ", ".join(fixed(value, 0) for value in own[index]),
                "log_potency": fixed(float(np.log10(event["potency"].values)), 2),
                "mw": fixed(float(event["mw"].values), 2),
                "particles": whole(event["particles"].values),
                "shares": [f"{fixed(100 * float(event[name].values), 0)} %" for name in ("iso", "clvd", "dc")],
            }
        )
    return rows
