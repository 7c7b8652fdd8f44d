"""A mine in closed form: what runs of a model and a record have in each step follows from its quantities and chance.

Each of STEPS steps of DAYS days has events from 1 m3 on. Their expected number, the longest size and the centre of
their places follow from two quantities, given as shares of their ranges.
"""

import numpy as np
import xarray as xr
from numpy.typing import NDArray
from scipy.stats import norm

from calibration.posterior import sobol_points
from catalogs.compare.exposure import Exposure
from catalogs.settings import DatedStep
from verification.answers.statistics.samples import branching_events, burst_events, dated, simulated_sizes

STEPS = ("one", "two", "three")
DAYS = 30.0
QUANTITIES = 2
# ln of the expected number: change over the range of each quantity (step, quantity).
SLOPES = np.array([[1.6, 0.2], [0.2, 1.6], [1.0, -0.8]])
CURVATURE = 0.2  # Of ln of the expected number over the range of the first quantity.
SPREAD = 40.0  # m, of places about the centre of a step, along each axis.
SHIFT = 40.0  # m, by which the centre moves over the range of the first quantity.
HALF_DETECTED = 0.6  # log10 of the size over the floor of which a network that fades out sees half.
FLOOR = 1.0  # m3, from which on runs and records have all events.
LOCATION_ERROR = 10.0  # m
MODEL_ERROR = 0.1  # Standard deviation of ln of the expected number of a recorded step about that of the model.


def expected_numbers(point: NDArray, events: float) -> NDArray:
    """Expected number of events (step,) at a point (quantity,); `events`: in the middle of both ranges."""
    off = np.asarray(point) - 0.5
    return events * np.exp(SLOPES @ off + CURVATURE * off[0] ** 2)


def dated_steps() -> tuple[DatedStep, ...]:
    """The steps with their dates."""
    ends = dated(DAYS * np.arange(len(STEPS) + 1)).astype("datetime64[s]").astype(str)
    return tuple(
        DatedStep(name=name, start=str(start), end=str(end))
        for name, start, end in zip(STEPS, ends[:-1], ends[1:], strict=True)
    )


def exposure() -> Exposure:
    """The time during which the record is taken: all steps."""
    return Exposure.of(dated_steps(), None)


def centre(point: NDArray, step: int) -> NDArray:
    """Centre of the places of a step, m, (xyz,)."""
    return np.array([SHIFT * point[0], 100.0 * step, 0.0])


def run(point: NDArray, case: dict, generator: np.random.Generator) -> xr.Dataset:
    """Events of a run of the model: independent, with slope `b`, which end `span` decades above the floor."""
    counts = generator.poisson(expected_numbers(point, case["events"]))
    step = np.repeat(np.arange(len(STEPS)), counts)
    location = np.array([centre(point, one) for one in range(len(STEPS))])[step]
    location = location + SPREAD * generator.normal(size=(len(step), 3))
    potency = FLOOR * 10.0 ** simulated_sizes(generator, len(step), case["b"], case["span"])
    return _dataset(
        {"potency": potency, "location": location, "step": np.array(STEPS, object)[step]},
        {"potency_floor": FLOOR, "potency_before_record": 1.0, "location_error": 0.0},
    )


def trials(case: dict, count: int, replicates: int, generator: np.random.Generator) -> tuple[NDArray, list[xr.Dataset]]:
    """Points (trial, quantity) of replicates and design, and the events of each trial."""
    points = np.concatenate([np.full((replicates, QUANTITIES), 0.5), sobol_points(count, QUANTITIES, 1)])
    return points, [run(point, case, generator) for point in points]


def record(point: NDArray, case: dict, generator: np.random.Generator) -> xr.Dataset:
    """A record of the mine with these values: independent events, `bursts_of` some events or triggered (`branching`).

    Its sizes have the slope `record_b`, if the case has one, in place of the model's. With `fade`, small events are
    missed: detection is a normal ramp of this deviation, log10 m3, about HALF_DETECTED above the floor.
    """
    times, places, steps = [], [], []
    errors = np.exp(MODEL_ERROR * generator.standard_normal(len(STEPS)))
    for step, expected in enumerate(errors * expected_numbers(point, case["events"])):
        if "bursts_of" in case:
            each = case["bursts_of"]
            time, place, _ = burst_events(generator, DAYS, expected / each, each, spread=SPREAD)
        else:
            time, place, _ = branching_events(generator, DAYS, expected, case.get("branching", 0.0), spread=SPREAD)
        times.append(time + DAYS * step)
        places.append(place + centre(point, step))
        steps.append(np.full(len(time), step))
    location = np.concatenate(places)
    location += LOCATION_ERROR / np.sqrt(3.0) * generator.normal(size=location.shape)
    sizes = simulated_sizes(generator, len(location), case.get("record_b", case["b"]), case["span"])
    time, seen = dated(np.concatenate(times)), np.ones(len(sizes), bool)
    if "fade" in case:
        seen = generator.random(len(sizes)) < norm.cdf((sizes - HALF_DETECTED) / case["fade"])
    return _dataset(
        {"time": time[seen], "potency": FLOOR * 10.0 ** sizes[seen], "location": location[seen]},
        {"location_error": LOCATION_ERROR},
    )


def _dataset(values: dict[str, NDArray], attributes: dict) -> xr.Dataset:
    """Events, all of them resolved."""
    dims = {"location": ("event", "xyz")}
    variables = {name: (dims.get(name, ("event",)), array) for name, array in values.items()}
    variables["resolved"] = (("event",), np.ones(len(values["potency"]), np.int8))
    return xr.Dataset(variables, attrs=attributes)
