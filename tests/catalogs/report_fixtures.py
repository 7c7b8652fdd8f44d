"""A small synthetic mine in the dataset contract's form: grid, elastic state, steps, events, catalogue, twin record.

Nothing here is mechanics: stresses and strains are plausible shapes, so that the report has something to show.
"""

import json
from dataclasses import dataclass, replace
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pandas as pd
import xarray as xr
from matplotlib.figure import Figure

from catalogs.compare.comparison import compare
from catalogs.report.evidence import DATASETS, Evidence, read_evidence
from catalogs.report.page import write_report
from catalogs.report.verdict import verdict
from catalogs.settings import ReportSlice
from common.datasets import write_dataset
from common.event_table import new_catalog

SMALL = {"coarse": 16.0}  # 4 m in the finest of three levels: about 4,000 cells
LAME, SHEAR = 22.8e9, 22.8e9
ORIGIN = np.array([10_000.0, 20_000.0, -1_060.0])  # mine coordinates, far from zero
NAMES = ["drive", "stope_1", "stope_2", "stope_9"]
BOXES = np.array(  # lower and upper corners in the domain, as shares of its edge
    [
        [[0.00, 0.45, 0.45], [1.00, 0.51, 0.51]],
        [[0.25, 0.53, 0.38], [0.45, 0.62, 0.60]],
        [[0.50, 0.53, 0.38], [0.70, 0.62, 0.60]],
        [[0.72, 0.53, 0.62], [0.82, 0.62, 0.80]],
    ]
)
BUDGET = {
    "components": ["xx", "yy", "zz", "yz", "xz", "xy"], "unit": "m3",
    "events": [1.0, 2.0, -3.0, 0.0, 1e-4, 0.1], "aseismic_share": [0.1, 0.2, -0.3, 0.0, 1e-5, 0.01],
    "overshoot": [0.2, 0.1, -0.2, 0.0, 0.0, 0.0], "later": [0.7, 0.7, -0.5, 0.0, 0.0, 0.0],
    "plastic": [2.0, 3.0, -4.0, 0.0, 1.1e-4, 0.11], "closure": [1e-16, 0.0, 2e-16, 0.0, 0.0, 0.0],
    "particle_scalars": 9.5, "event_scalars": 7.6, "resolved_scalars": 7.4, "scalar_ratio": 0.8,
}  # fmt: skip
STEPS = [("history", "", "", 0), ("2019-08", "2019-08-01", "2019-09-01", 1), ("2019-09", "2019-09-01", "2019-10-01", 1)]
CONFIG = {
    "name": "testmine",
    "solver": {"scheme": "multigrid", "tolerance": 1e-5, "increments": 2},
    "seismic": {"closeness": 0.85},
    "excavations": [
        {"name": "drive", "step": "history", "shape": "box", "fill": "none"},
        {"name": "stope_1", "step": "2019-08", "file": "geometry/stope_1.stl", "fill": "fill"},
        {"name": "stope_2", "step": "2019-09", "file": "geometry/stope_2.stl", "fill": "fill", "filled": "planned"},
        {"name": "stope_9", "step": "planned", "file": "geometry/<stope_9>.stl", "fill": "fill"},
    ],
    "steps": [{"name": name, "start": start, "end": end} for name, start, end, _ in STEPS],
}
DEFAULT = {
    "solver": {"scheme": "multigrid", "tolerance": 1e-5, "increments": 4},
    "seismic": {"closeness": 0.8},
    "grid": {"levels": 3},
}


@dataclass
class Mine:
    """Paths of a synthetic mine's files, ready for write_page(**mine.arguments(...))."""

    folder: Path
    grid: Path
    elastic: Path
    steps: list[Path]
    events: list[Path]
    catalog: Path
    record: Path
    comparison: Path

    def arguments(self, **changes) -> dict:
        given = {
            name: getattr(self, name)
            for name in ("grid", "elastic", "steps", "events", "catalog", "record", "comparison")
        }
        given |= {"config": CONFIG, "default": DEFAULT, "logs": None}
        given |= {"output": self.folder / "report.html", "figures": self.folder / "figures"}
        return given | changes


def evidence_of(**arguments) -> Evidence:
    """What write_page reads where it is given these arguments."""
    return read_evidence(*_inputs(arguments), arguments.get("logs"))


def write_page(*, output: Path, figures: Path, logs: Path | None = None, processes: int = 1, **arguments) -> None:
    """The report of datasets and settings, given by name as Mine.arguments does."""
    write_report(*_inputs(arguments), output, figures, logs, processes=processes)


def _inputs(arguments: dict) -> tuple[dict, ReportSlice]:
    """Paths of the datasets that are there, and the settings."""
    given = {name: value for name, value in arguments.items() if value is not None}
    settings = {name: given[name] for name in ("default", "excavations", "insitu") if name in given}
    paths = {name: given[name] for name in ("grid", "elastic", "steps", "events", *DATASETS) if name in given}
    return paths, ReportSlice(config=given.get("config", {}), **settings)


def write_nothing(figure: Figure, path: Path) -> str:
    """In place of style.save, which takes most of the time of a report."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.touch()
    return ""


def _distance(points: np.ndarray, lower: np.ndarray, upper: np.ndarray) -> np.ndarray:
    """Distance of points (n, d) from a box; zero inside."""
    return np.linalg.norm(np.maximum(np.maximum(lower - points, points - upper), 0.0), axis=1)


def make_grid(
    edge: float = 96.0, coarse: float = 8.0, levels: int = 3, rings: float = 3.0, dimension: int = 3
) -> xr.Dataset:
    """Octree (quadtree) cells, split where an excavation is nearer than `rings` of their own edges."""
    axes = [0, 1, 2] if dimension == 3 else [0, 2]
    boxes = ORIGIN[axes] + BOXES[:, :, axes] * edge
    count = round(edge / coarse)
    origin = (
        np.stack(np.meshgrid(*[np.arange(count)] * dimension, indexing="ij"), axis=-1).reshape(-1, dimension) * coarse
    )
    origin, size = origin + ORIGIN[axes], coarse
    found = []
    child = np.stack(np.meshgrid(*[[0, 1]] * dimension, indexing="ij"), axis=-1).reshape(-1, dimension)
    for level in range(levels):
        near = np.min([_distance(origin + size / 2, *box) for box in boxes], axis=0) < (rings + 0.5) * size
        if level == levels - 1:
            near[:] = False
        found.append((origin[~near], np.full((~near).sum(), size), np.full((~near).sum(), level)))
        origin, size = (origin[near][:, None, :] + child * size / 2).reshape(-1, dimension), size / 2
    origin, size, level = (np.concatenate(part) for part in zip(*found, strict=True))
    pieces = []
    for index, (lower, upper) in enumerate(boxes):
        overlap = np.minimum(origin + size[:, None], upper) - np.maximum(origin, lower)
        share = np.prod(np.clip(overlap, 0, None), axis=1) / size**dimension
        cell = np.flatnonzero(share > 0.02)
        pieces.append((cell, np.full(len(cell), index), share[cell]))
    cell, excavation, fraction = (np.concatenate(part) for part in zip(*pieces, strict=True))
    full = np.zeros((len(size), 3))
    full[:, axes] = origin
    lower, upper = np.zeros(3), np.zeros(3)
    lower[axes], upper[axes] = ORIGIN[axes], ORIGIN[axes] + edge
    volume = np.prod(np.ptp(boxes, axis=1).reshape(len(boxes), -1), axis=1)
    drawn = np.bincount(excavation, fraction * size[cell] ** dimension)
    return xr.Dataset(
        {
            "cell_origin": (("cell", "xyz"), full),
            "cell_size": ("cell", size),
            "cell_level": ("cell", level.astype(np.int8)),
            "cell_body": ("cell", np.full(len(size), -1, np.int16)),
            "piece_origin": (("piece", "xyz"), full[cell]),
            "piece_excavation": ("piece", excavation.astype(np.int16)),
            "piece_samples": ("piece", (2.0 ** np.round(63 * fraction)).astype(np.uint64) * 2 - 1),
            "piece_fraction": ("piece", fraction),
            "piece_volume": ("piece", fraction * size[cell] ** dimension),
        },
        attrs={
            "mine": "testmine", "dimension": dimension, "plane": "" if dimension == 3 else "xz", "thickness": 1.0,
            "domain_lower": lower, "domain_upper": upper, "coarse_cell": coarse,
            "fine_cell": coarse / 2 ** (levels - 1), "levels": levels, "excavation_names": json.dumps(NAMES),
            "excavation_volume": json.dumps(volume.tolist()), "excavation_volume_grid": json.dumps(drawn.tolist()),
            "config_hash": "1111", "source_hash": "aaaa", "versions": json.dumps({"numpy": "2.4"}),
        },
    )  # fmt: skip


def make_state(grid: xr.Dataset, index: int) -> xr.Dataset:
    """State after STEPS[index]; index -1: elastic. One particle per cell, fill in the dated stopes, the drive empty."""
    generator = np.random.default_rng(10 + index)
    size, level = grid["cell_size"].values, grid["cell_level"].values
    dimension = int(grid.attrs["dimension"])
    position = grid["cell_origin"].values + size[:, None] / 2 * (np.ptp(_corners(grid), axis=0) > 0)
    fraction = np.zeros((grid.sizes["cell"], len(NAMES)))
    number = {tuple(place): cell for cell, place in enumerate(grid["cell_origin"].values.tolist())}
    cell = [number[tuple(place)] for place in grid["piece_origin"].values.tolist()]
    fraction[cell, grid["piece_excavation"].values] = grid["piece_fraction"].values
    mined = [0] + [excavation for excavation in (1, 2) if excavation <= index]
    share = np.clip(fraction[:, mined].sum(axis=1), 0, 1)
    edge = float(np.ptp(_corners(grid), axis=0).max())
    plane = [0, 1, 2] if dimension == 3 else [0, 2]
    boxes = (ORIGIN + BOXES * edge)[:, :, plane]
    distance = np.array([_distance(position[:, plane], *boxes[i]) for i in range(3)])
    reach = np.array([2.2, 6.0, 7.5])
    failed = np.full(len(size), -1, np.int32)
    rough = 1 + 0.25 * np.sin(position[:, 0] / 2) * np.cos(position[:, 2] / 3)
    if index >= 0:
        for step in range(index, -1, -1):
            failed[(distance[step] < reach[step] * rough) & (level == level.max()) & (share < 0.5)] = step
    nearest = distance[: max(index, 0) + 1].min(axis=0)
    displacement = 0.01 * np.exp(-nearest / 10)[:, None] * np.array([0.2, 0.6, -0.9])
    fill = np.where(share > 0.5, np.argmax(fraction, axis=1), -1)
    volume = size**dimension * np.where(fill == 0, 0, np.where(fill > 0, share, 1 - share))
    count = len(size)
    history = np.tile([3e-1, 4e-2, 5e-3, 1e-3, 1e-4, 9e-6], 4)
    new = np.where(np.arange(24) % 6 == 0, 50 // (1 + np.arange(24) // 6), 0) * (index >= 0)
    name = STEPS[index][0] if index >= 0 else ""
    now = failed == index if index >= 0 else np.zeros(count, bool)
    truncated = index == 2
    return xr.Dataset(
        {
            **{name: grid[name] for name in ("cell_origin", "cell_size", "cell_level", "cell_body")},
            "position": (("particle", "xyz"), position),
            "cell": ("particle", np.arange(count, dtype=np.int32)),
            "spacing": ("particle", size),
            "volume": ("particle", volume),
            "material": ("particle", (fill > 0).astype(np.int16)),
            "excavation": ("particle", fill.astype(np.int16)),
            "displacement": (("particle", "xyz"), displacement + 1e-4 * generator.normal(size=(count, 3))),
            "failed": ("particle", np.where(fill >= 0, -1, failed).astype(np.int32)),
            "strength_factor": ("particle", 1 + nearest / 8),
            "seismic_strain": (("particle", "voigt"), np.where(now[:, None], 1e-4, 0) * np.ones(6)),
            "plastic_strain": (("particle", "voigt"), np.where(failed[:, None] >= 0, 1e-4, 0) * np.ones(6)),
            "convergence_increment": ("iteration", np.arange(24) // 12),
            "convergence_generation": ("iteration", np.arange(24) // 6 % 2),
            "convergence_iteration": ("iteration", np.tile(np.arange(6), 4)),
            "convergence_unbalanced_ratio": ("iteration", history),
            "convergence_max_ratio": ("iteration", history * 3),
            "convergence_cells": ("iteration", np.full(24, count)),
            "convergence_new_failures": ("iteration", new),
        },
        attrs={
            "plane": "none" if dimension == 3 else "xz", "thickness": 1.0,
            "mine": "testmine", "stage": "step" if index >= 0 else "elastic", "step": name, "step_index": index,
            "tolerance": 1e-5, "scheme": "multigrid", "iterations": 24,
            "unbalanced_ratio": 9e-6, "truncated": int(truncated), "truncated_share": 0.034 * truncated,
            "collapsed": 0, "collapse": "", "falls": "[]",
            "loose_pieces": 3 * truncated, "loose_volume": 1.2 * truncated,
            "loose_where": "largest 0.7 m3 at (x, y, z) = (10052.0, 20051.5, -1020.2) m" if truncated else "",
            "truncated_where": "x 10050 to 10070, y 20050 to 20060, z -1030 to -1010 m" if truncated else "",
            "failed_particles": int((now & (fill < 0)).sum()), "failed_volume": float(volume[now].sum()),
            "energy_released": 4.2e7, "energy_dissipated": 1.1e7, "lame_lambda": LAME, "shear_modulus": SHEAR,
            "energy_work": 2e6, "energy_stored": -3.3e7, "energy_support": 6e6, "energy_seismic": 1e6,
            "energy_overshoot": 2e6, "energy_flow": 8e6, "energy_gained": 0.0, "energy_hourglass": 5e5,
            "energy_hourglass_released": 5e5, "energy_refined": 0.0, "cells": count,
            "finest_cells": int((level == level.max()).sum()), "cell_splits": 0,
            "increments": 4, "overshoot_share": 0.12,
            "energy_motion": 1.69e7, "energy_unbalanced": 1e5, "energy_left": 2e-4, "energy_left_share": 6e-12,
            "energy_elastic": 1e9, "energy_round_off": 1e-3,
            "config_hash": f"22{index}", "source_hash": "aaaa", "versions": json.dumps({"numpy": "2.4"}),
        },
    )  # fmt: skip


def _corners(grid: xr.Dataset) -> np.ndarray:
    return np.stack([grid.attrs["domain_lower"], grid.attrs["domain_upper"]])


def tensors(generator: np.random.Generator, potency: np.ndarray) -> np.ndarray:
    """Potency tensors (event, 3, 3): scattered double couples with some opening, sqrt(2 P:P) = potency."""
    base = np.diag([0.2, 0.15, -1.0])
    result = []
    for value in potency:
        rotation, _ = np.linalg.qr(np.eye(3) + 0.35 * generator.normal(size=(3, 3)))
        tensor = rotation @ (base + np.diag([0.8, 0.0, 0.0])) @ rotation.T
        result.append(value * tensor / np.sqrt(2 * (tensor**2).sum()))
    return np.array(result).reshape(-1, 3, 3)


def decompose(tensor: np.ndarray) -> dict[str, np.ndarray]:
    """Sizes, axes and shares of potency tensors (event, 3, 3), as the contract defines them; written plainly."""
    value, vector = np.linalg.eigh(tensor)
    potency = np.sqrt(2 * (tensor**2).sum(axis=(1, 2)))
    trace = np.trace(tensor, axis1=1, axis2=2)
    moment_tensor = LAME * trace[:, None, None] * np.eye(3) + 2 * SHEAR * tensor
    moment = np.sqrt((moment_tensor**2).sum(axis=(1, 2)) / 2)
    smallest, middle, largest = value.T
    clvd = 2 / 3 * (largest + smallest - 2 * middle)
    parts = np.array([trace / 3, clvd, (largest - smallest - np.abs(largest + smallest - 2 * middle)) / 2])
    parts = parts / np.abs(parts).sum(axis=0)
    return {
        "potency_tensor": tensor, "potency": potency, "moment_tensor": moment_tensor, "moment": moment,
        "mw": 2 / 3 * (np.log10(moment) - 9.1),
        "p_axis": vector[:, :, 0], "b_axis": vector[:, :, 1], "t_axis": vector[:, :, 2],
        "iso": parts[0], "clvd": parts[1], "dc": parts[2],
    }  # fmt: skip


def make_catalog(state: xr.Dataset, count: int, kind: str = "synthetic", seed: int = 3) -> xr.Dataset:
    """`count` events on failed particles of the dated steps, sizes by a power law with b = 0.8 above 1e-4 m3."""
    generator = np.random.default_rng(seed)
    attributes = {
        "mine": "testmine", "kind": kind, "lame_lambda": LAME, "shear_modulus": SHEAR, "potency_floor": 1.2e-4,
        "location_error": 5.0 if kind == "twin" else 0.0, "seismic_fraction": 0.9, "config_hash": "3333",
        "source_hash": "bbbb", "versions": json.dumps({"numpy": "2.4"}), "frame": json.dumps({"surface": 0.0}),
        "budget": json.dumps(BUDGET) if kind == "synthetic" else "{}",
    }  # fmt: skip
    failed = state["failed"].values
    pool = np.flatnonzero(failed >= 1)
    if not len(pool):
        count = 0
    chosen = np.sort(generator.choice(pool, count)) if count else np.zeros(0, int)
    chosen = chosen[np.argsort(failed[chosen], kind="stable")]
    location = state["position"].values[chosen] + (5.0 if kind == "twin" else 0.5) * generator.normal(size=(count, 3))
    step = np.array([STEPS[index][0] for index in failed[chosen]], dtype=object)
    start = np.array([STEPS[index][1] for index in failed[chosen]], dtype="datetime64[ns]")
    rank = pd.Series(range(count)).groupby(pd.Series(step, dtype=object)).rank().to_numpy() if count else np.zeros(0)
    potency = 1e-4 * generator.random(count) ** (-1 / 0.8)
    catalog = new_catalog(
        count, attributes, time=start + (rank / (count + 1) * 29 * 86400e9).astype("timedelta64[ns]"),
        time_lower_uncertainty=np.full(count, 15 * 86400.0),
        time_upper_uncertainty=np.full(count, 15 * 86400.0), location=location, source_size=np.full(count, 2.0),
        step=step if kind == "synthetic" else np.full(count, "", dtype=object),
        particles=generator.integers(3, 90, count) if kind == "synthetic" else np.full(count, -1),
        resolved=(generator.random(count) > 0.05).astype(np.int8) if kind == "synthetic" else np.ones(count, np.int8),
        **decompose(tensors(generator, potency)),
    )  # fmt: skip
    if not count:
        catalog["step"] = catalog["step"].astype(str)  # as `seismic` writes it: no objects tell netCDF that it is text
    return catalog


def make_mine(folder: Path, events: int = 150, dimension: int = 3, **grid_options) -> Mine:
    """Write every file of the synthetic mine below `folder`."""
    grid = make_grid(dimension=dimension, **grid_options)
    write_dataset(grid, folder / "grid.nc")
    write_dataset(make_state(grid, -1), folder / "elastic.nc")
    steps, event_files = [], []
    for index, (name, *_) in enumerate(STEPS):
        state = make_state(grid, index)
        steps.append(folder / "steps" / f"{name}.nc")
        write_dataset(state, steps[-1])
    catalog = make_catalog(state, events)
    for name, start, end, dated in STEPS:
        if dated:
            event_files.append(folder / "events" / f"{name}.nc")
            own = catalog.isel(event=np.flatnonzero(catalog["step"].values == name))
            write_dataset(own.assign_attrs(step=name, start=start, end=end, dated=dated), event_files[-1])
    write_dataset(catalog, folder / "catalog.nc")
    record = make_catalog(state, round(0.8 * events), kind="twin", seed=4)
    write_dataset(record, folder / "record.nc")
    write_dataset(compare(catalog, record, {"resamplings": 99}), folder / "comparison.nc")
    names = ("grid", "elastic", "catalog", "record", "comparison")
    return Mine(folder, steps=steps, events=event_files, **{name: folder / f"{name}.nc" for name in names})


class Page(HTMLParser):
    """Attributes of every tag, and the text of each section without its tags."""

    def __init__(self, content: str):
        super().__init__()
        self.tags: list[tuple[str, dict]] = []
        self.sections: dict[str, str] = {}
        self.current = ""
        self.feed(content)

    def handle_starttag(self, tag, attributes):
        self.tags.append((tag, dict(attributes)))
        if tag == "section":
            self.current = dict(attributes)["id"]
            self.sections[self.current] = ""

    def handle_data(self, data):
        if self.current:
            self.sections[self.current] += data


def make_page(mine: Mine, folder: Path, **changes) -> Page:
    """A report in a folder of its own."""
    output = folder / "report.html"
    write_page(**mine.arguments(output=output, figures=folder / "figures", **changes))
    return Page(output.read_text())


def dated_steps() -> dict:
    """Settings of a comparison in the dated steps."""
    steps = [{"name": name, "start": start, "end": end} for name, start, end, dated in STEPS if dated]
    return {"resamplings": 99, "steps": steps}


def compared(evidence: Evidence, **values) -> Evidence:
    """With other numbers in the comparison; attributes where they are text or one of its attributes."""
    comparison = evidence.comparison.copy(deep=True)
    for name, value in values.items():
        if name in comparison.attrs:
            comparison.attrs[name] = value
        else:
            comparison[name] = (comparison[name].dims, np.asarray(value, comparison[name].dtype))
    return replace(evidence, comparison=comparison)


def said(evidence: Evidence) -> str:
    return " ".join(verdict(evidence))
