"""Steps and events by hand: attributes, sizes and days of 2019, a grid of four cells."""

import numpy as np
import xarray as xr

from catalogs.report.evidence import ExcavationRow
from catalogs.sources.openings import NEVER, ROCK, Mining
from common.source_tensors import moment_magnitude
from mpm_core.model.occupancy import FinestPieces

SHEAR = 30e9  # Pa


def step(name: str, share: float, month: int) -> dict:
    """Attributes of a dated step of 2019."""
    return {
        "step": name,
        "dated": 1,
        "start": f"2019-{month:02d}-01T00:00:00Z",
        "end": f"2019-{month + 1:02d}-01T00:00:00Z",
        "truncated": int(share > 0),
        "truncated_share": share,
        "collapsed": 0,
        "truncated_where": f"x 0 to {month} m; more grid.buffer_cells would let it fail" if share else "",
    }


def events_of(potency, step_names=None, days=None) -> xr.Dataset:
    """A catalogue of sizes, steps and days of 2019 (1 January is 0); a modelled one has steps."""
    count = len(potency)
    time = np.datetime64("2019-01-01", "ns") + np.array(np.zeros(count) if days is None else days) * np.timedelta64(
        1, "D"
    )
    return xr.Dataset(
        {
            "potency": ("event", np.array(potency, float)),
            "step": ("event", np.array(step_names if step_names is not None else [""] * count, object)),
            "time": ("event", time.astype("datetime64[ns]")),
            "location": (("event", "xyz"), np.zeros((count, 3))),
            "mw": ("event", moment_magnitude(SHEAR * np.array(potency, float))),
        },
        attrs={"shear_modulus": SHEAR, "kind": "recorded" if step_names is None else "synthetic"},
    )


def mined_in(parts: list[tuple[int, str, int]]) -> dict:
    """A grid of four cells of 2 m and its excavations, one each: place of its cell, its step, how many of the 64
    samples, the first ones. Steps are in the order of their names."""
    places = np.array([[place, 0, 0] for place, *_ in parts], np.int32).reshape(-1, 3)
    samples = np.array([2**count - 1 for *_, count in parts], np.uint64)
    pieces = FinestPieces(places, np.arange(len(parts), dtype=np.int16), samples).apart()
    data = {
        "piece_origin": (("piece", "xyz"), [100.0, 0.0, -8.0] + 2.0 * pieces.place),
        "piece_samples": ("piece", pieces.samples),
        "piece_excavation": ("piece", pieces.excavation),
        "piece_volume": ("piece", np.bitwise_count(pieces.samples) / 8.0),
    }
    corners = {"domain_lower": [100.0, 0.0, -8.0], "domain_upper": [108.0, 2.0, -6.0]}
    grid = xr.Dataset(data, attrs=corners | {"fine_cell": 2.0, "dimension": 3, "thickness": 1.0})
    steps = sorted({step for _, step, _ in parts})
    mining = Mining.of(grid, np.array([steps.index(step) for _, step, _ in parts], int), np.full(len(parts), NEVER))
    rows = [
        ExcavationRow(f"e{at}", step, "none", step, 9.0, 9.0, False, True, mined)
        for at, ((_, step, _), mined) in enumerate(zip(parts, mining.volumes(ROCK).tolist(), strict=True))
    ]
    return {"grid": grid, "excavations": rows, "mining": mining}
