"""Scenes in which failed rock hangs loose: every step comes to rest, and what fell does not hang on two limits."""

import json
import math
import tempfile
from pathlib import Path
from unittest import mock

import numpy as np
from matplotlib.figure import Figure

from catalogs.figures import style
from common.part_centers import part_centers
from mpm_core.equilibrium import falls
from verification.page_tables import Pivot
from verification.results import Results, Variant
from verification.rows import Row
from workflow.run_mine import run_stages

TABLES = (
    Pivot(
        "Rock that fell, by scene",
        r"(?P<row>\w+): (?P<column>falls|volume that fell, m3|volume that failed and stayed, m3)",
        "measured",
    ),
)
STEP = "mined"
LIMITS = {"least_motion": ("MIN_FALL", "least motion of {:g} m"), "moves_along": ("MOVES_ALONG", "share of {:g}")}
SHOWN = ("skin_12", "skin_residual", "pit")


def answer(results: Results) -> tuple[list[Row], Figure]:
    """Rows for each scene and limit, and a figure of the failed and fallen rock of some."""
    settings, allowed, rows = results.settings, results.allowed["fallen"], []
    for name, variant in results.variants.items():
        attributes = variant.step(STEP).attrs
        pieces = json.loads(attributes["falls"])
        told = f"{pieces[0]['side']} of {pieces[0]['opening']}" if pieces else "nothing fell"
        rows += [
            Row.absolute(
                f"{name}: steps without rest", 0.0, float(attributes["collapsed"]), 0.0, attributes["collapse"]
            ),
            _reported(f"{name}: falls", len({piece["fall"] for piece in pieces}), told),
            _reported(f"{name}: volume that fell, m3", _volume(pieces)),
            _reported(f"{name}: volume that failed and stayed, m3", attributes["failed_volume"]),
            Row.absolute(f"{name}: energy that is left over", 0.0, float(attributes["energy_left_share"]), 1e-9),
        ]
    for key, (constant, words) in LIMITS.items():
        variant = results[settings[key]["of"]]
        expected = _volume(json.loads(variant.step(STEP).attrs["falls"]))
        for value in settings[key]["values"]:
            fallen, collapsed, reason = _with(variant, constant, value)
            title = f"{settings[key]['of']}, {words.format(value)}"
            rows.append(Row.absolute(f"{title}: steps without rest", 0.0, collapsed, 0.0, reason))
            rows.append(Row.relative(f"{title}: volume that fell, m3", expected, fallen, allowed))
    cells = settings["cells"]
    one, half = (_volume(json.loads(results[cells[key]].step(STEP).attrs["falls"])) for key in ("of", "half"))
    rows.append(Row.relative(f"{cells['half']}: volume that fell against the larger cells, m3", one, half, allowed))
    return rows, draw({name: results[name] for name in SHOWN})


def _reported(quantity: str, value: float, remark: str = "") -> Row:
    """A row without an expected value."""
    return Row(quantity, math.nan, float(value), math.nan, None, remark)


def _volume(pieces: list[dict]) -> float:
    return float(sum(piece["volume"] for piece in pieces))


def _with(variant: Variant, constant: str, value: float) -> tuple[float, float, str]:
    """Volume m3 that falls with another limit; 1 where the step does not come to rest, else 0, and why."""
    with tempfile.TemporaryDirectory() as folder, mock.patch.object(falls, constant, value):
        states = dict(
            (name, state)
            for name, state, _ in run_stages(variant.mine.run_slices(extracted_as=()), Path(folder) / "failed.npz")
        )
    attributes = states[f"steps/{STEP}"].attrs
    return _volume(json.loads(attributes["falls"])), float(attributes["collapsed"]), attributes["collapse"]


def draw(variants: dict[str, Variant]) -> Figure:
    """Centres of cells that failed and stayed, and of those that fell."""
    figure = style.new_figure(height=3.2)
    for axes, (name, variant) in zip(figure.subplots(1, len(variants)), variants.items(), strict=True):
        step = variant.step(STEP)
        failed = (step["failed"].values >= 0) & (step["volume"].values > 0.0)
        gone = np.unique(step["loose_cell"].values[step["loose_fall"].values > 0])
        fell = step["cell_origin"].values[gone] + 0.5 * step["cell_size"].values[gone, None]
        axes.plot(*part_centers(step)[failed][:, [0, 2]].T, ".", ms=1.5, color=style.MODELLED, label="failed, stayed")
        axes.plot(*fell[:, [0, 2]].T, ".", ms=1.5, color=style.RECORDED, label="fell")
        axes.set(aspect="equal", title=name.replace("_", " "), xlabel="x (m)", ylabel="z (m)")
    axes.legend(markerscale=4)
    return figure
