"""Made-up openings and events for the tests of the stage: no mechanics, only what their files look like."""

import json

import numpy as np
import xarray as xr

from catalogs.settings import DatedStep
from common.event_table import new_catalog
from common.source_tensors import moment_magnitude

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
OPENINGS = ({"name": "drive"}, {"name": "stope_1", "step": "2019-08"}, {"name": "stope_2", "step": "2019-09"})
RELATION = {"name": "site", "size": "log_potency", "a": 0.2, "b": 0.45, "c": 1.2, "scatter": 0.25, "nearest": 5.0}


def made_up_grid() -> xr.Dataset:
    """The openings as whole cells of EDGE."""
    corners = []
    for lower, upper in BOXES.values():
        axes = [np.arange(low, high, EDGE) for low, high in zip(lower, upper, strict=True)]
        corners.append(np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3))
    origin = np.concatenate(corners)
    number = np.repeat(np.arange(len(corners)), list(map(len, corners)))
    pieces = {
        "piece_origin": (("piece", "xyz"), origin),
        "piece_excavation": ("piece", number.astype(np.int16)),
        "piece_samples": ("piece", np.full(len(origin), 255, np.uint8)),
        "piece_volume": ("piece", np.full(len(origin), EDGE**3)),
    }
    attributes = {"mine": MINE, "dimension": 3, "fine_cell": EDGE, "excavation_names": json.dumps(list(BOXES))}
    return xr.Dataset(pieces, attrs=attributes | {"domain_lower": [-128.0, -128.0, -128.0]})


def slice_of(**changes) -> dict:
    """The stage's slice, in numbers; changes of ground_motion are merged into it."""
    motion = {"relation": dict(RELATION)} | changes.pop("ground_motion", {})
    given = {
        "mine": MINE,
        "ground_motion": motion,
        "density": 2700.0,
        "steps": [step.given() for step in STEPS],
        "openings": [dict(opening) for opening in OPENINGS],
    }
    return given | changes


def scattered(number: int, seed: int = 1) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """log10 potency, place and index of the step of events about the stopes."""
    generator = np.random.default_rng(seed)
    place = np.array([26.0, 25.0, 15.0]) + generator.normal(size=(number, 3)) * np.array([15.0, 30.0, 15.0])
    return generator.uniform(-2.0, 1.0, number), place, generator.integers(0, len(STEPS), number)


def catalogue(size, place, step, resolved=None, mine: str = MINE) -> xr.Dataset:
    """A modelled catalogue with these events."""
    potency = 10.0 ** np.asarray(size, float)
    return new_catalog(
        len(potency),
        {"mine": mine, "kind": "synthetic"},
        location=np.asarray(place, float).reshape(-1, 3),
        potency=potency,
        moment=SHEAR * potency,
        mw=moment_magnitude(SHEAR * potency),
        step=np.array([STEPS[int(one)].name for one in step], object),
        resolved=np.ones(len(potency), int) if resolved is None else resolved,
    )
