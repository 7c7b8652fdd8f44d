"""Grids and runs made up for the tests: no mechanics, only what their files look like."""

import json
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import xarray as xr

from catalogs.settings import DatedStep
from common.datasets import write_dataset
from common.event_table import new_catalog, write_events
from common.modelled_events import spread_in_time
from plans.settings import OutcomeSlice

MINE, SHEAR, EDGE = "made_up", 2.5e10, 2.0
STEPS = (
    DatedStep(name="2019-08", start="2019-08-01", end="2019-09-01"),
    DatedStep(name="2019-09", start="2019-09-01", end="2019-10-01"),
)
BOXES = {  # lower and upper corner of each opening, m
    "drive": ((0.0, 0.0, 0.0), (4.0, 60.0, 4.0)),
    "stope_1": ((20.0, 0.0, 0.0), (32.0, 20.0, 30.0)),
    "stope_2": ((20.0, 30.0, 0.0), (32.0, 50.0, 30.0)),
}
OPENINGS = (
    {"name": "drive"},
    {"name": "stope_1", "step": "2019-08"},
    {"name": "stope_2", "step": "2019-09"},
)
HAZARD = {
    "distances": [10.0, 30.0],
    "magnitudes": {"felt": -0.3, "damaging": 0.6},
    "likelihoods": {"rare": 0.0, "possible": 0.1, "likely": 0.5},
}


def made_up_grid(mirrored: bool = False) -> xr.Dataset:
    """The openings as whole cells of EDGE; mirrored: at x = 16 m."""
    origins, numbers, volumes = [], [], []
    for number, (lower, upper) in enumerate(BOXES.values()):
        axes = [np.arange(low, high, EDGE) for low, high in zip(lower, upper, strict=True)]
        cells = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
        origins.append(cells)
        numbers.append(np.full(len(cells), number))
        volumes.append(len(cells) * EDGE**3)
    origin = np.concatenate(origins)
    if mirrored:
        origin[:, 0] = 32.0 - origin[:, 0] - EDGE
    return xr.Dataset(
        {
            "piece_origin": (("piece", "xyz"), origin),
            "piece_excavation": ("piece", np.concatenate(numbers).astype(np.int16)),
            "piece_fraction": ("piece", np.ones(len(origin))),
            "piece_samples": ("piece", np.full(len(origin), 255, np.uint8)),
            "piece_volume": ("piece", np.full(len(origin), EDGE**3)),
        },
        attrs={
            "mine": MINE,
            "dimension": 3,
            "plane": "none",
            "thickness": 1.0,
            "fine_cell": EDGE,
            "domain_lower": [-128.0, -128.0, -128.0],
            "domain_upper": [160.0, 192.0, 160.0],
            "excavation_names": json.dumps(list(BOXES)),
            "excavation_volume_grid": json.dumps(volumes),
        },
    )


def drawn_events(number: int, generator: np.random.Generator, b: float = 0.7, centre: float = 26.0):
    """Log potency from -2 on with an end at 0.5, and places about the stopes."""
    rate = b * np.log(10.0)
    size = -2.0 - np.log1p(generator.random(number) * np.expm1(-rate * 2.5)) / rate
    place = np.array([centre, 25.0, 15.0]) + generator.normal(size=(number, 3)) * np.array([9.0, 18.0, 10.0])
    return size, place


def write_run(
    folder: Path,
    kind: str,
    events: Sequence[tuple[np.ndarray, np.ndarray]],
    steps: Sequence[DatedStep] = STEPS,
    floor: float = -2.0,
    energy: float = 1e9,
    collapsed: str = "",
    fallen: float = 0.0,
) -> dict:
    """Files of a run with such (log potency, place) in each step, as a slice names them.

    collapsed: step from which on rock found no equilibrium; fallen: rock that falls in each step, m3.
    """
    names, has_collapsed = [], False
    for step, (size, place) in zip(steps, events, strict=True):
        has_collapsed |= step.name == collapsed
        made_of = f"{folder.name} {kind} {step.name} {np.sum(size):.9f} {step.start} {step.end}"
        attributes = {"mine": MINE, "step": step.name, "potency_floor": 10.0**floor, "kind": "synthetic"}
        attributes |= {"made_from": made_of, "location_error": EDGE, "collapsed": int(has_collapsed)}
        times = spread_in_time((step.start, step.end), len(size), step.name)
        named = np.full(len(size), step.name, object)
        catalog = new_catalog(len(size), attributes, location=place, potency=10.0**size, step=named, **times)
        write_events(catalog, folder / "events" / f"{step.name}.nc")
        state = {"mine": MINE, "step": step.name, "energy_released": energy, "failed_volume": 100.0}
        state["made_from"] = f"{folder.name} {kind} {step.name}"
        state["falls"] = json.dumps([{"volume": fallen}] if fallen else [])
        write_dataset(xr.Dataset(attrs=state), folder / "steps" / f"{step.name}.nc")
        names.append(step.name)
    return {
        "kind": kind,
        "events": [str(folder / "events" / f"{name}.nc") for name in names],
        "states": [str(folder / "steps" / f"{name}.nc") for name in names],
    }


def drawn_run(folder: Path, kind: str, seed: int, numbers: Sequence[float] = (40, 25), **options) -> dict:
    """Files of a run with Poisson numbers of these means."""
    generator = np.random.default_rng(seed)
    return write_run(folder, kind, [drawn_events(generator.poisson(mean), generator) for mean in numbers], **options)


def drawn_ensemble(folder: Path, seed: int, numbers: Sequence[float] = (40, 25), **options) -> list[dict]:
    """Files of a plan's own run and of four members, as many as a verdict needs."""
    kinds = ["own", *["member"] * 4]
    return [drawn_run(folder / str(n), kind, 100 * seed + n, numbers, **options) for n, kind in enumerate(kinds)]


def outcome_slice(runs: Sequence[dict], plan: str = "as_planned", **others) -> OutcomeSlice:
    """The slice of a plan's outcome with these runs."""
    given = {
        "mine": MINE,
        "plan": plan,
        "steps": [step.given() for step in STEPS],
        "openings": list(OPENINGS),
        "hazard": HAZARD,
        "shear_modulus": SHEAR,
        "runs": list(runs),
    }
    return OutcomeSlice.of(given | others)


def made_up_record(
    number: int, seed: int, start: str = "2019-08-01", end: str = "2019-09-01", known: tuple[str, str] | None = None
) -> xr.Dataset:
    """A record with so many events, evenly drawn between two dates, that covers a period (these dates if not given)."""
    generator = np.random.default_rng(seed)
    size, place = drawn_events(number, generator)
    first, last = (np.datetime64(text, "ns").astype(np.int64) for text in (start, end))
    time = np.sort(generator.integers(first, last, number)).astype("datetime64[ns]")
    covered = list(known or (start, end))
    recorded = [str(time.min())[:19], str(time.max())[:19]] if number else covered
    period = {"modelled": covered, "recorded": recorded, "common": covered}
    attributes = {"mine": MINE, "kind": "recorded", "location_error": 6.0, "period": json.dumps(period)}
    return new_catalog(number, attributes, time=time, location=place, potency=10.0**size)


def comparison_of(cut: float = -2.0) -> xr.Dataset:
    """What is used of comparison.nc."""
    return xr.Dataset({"cut": ((), cut)}, attrs={"mine": MINE})
