"""The catalogues of both baselines, drawn at random from the elastic stress of a mine, and the file of all their runs.

Each has the form of common.event_table, and as many events as recorded: of seeded flaws that slip, and at random where
mining raises excess shear stress (Ryder 1988).
"""

import json
import logging
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike, NDArray

from baselines.elastic_rock import ElasticRock, principal, read_rock
from baselines.flaws import (
    NotPossible,
    RadiusLaw,
    draw_poisson_flaws,
    expected_per_density,
    find_slips,
    potency_tensors,
)
from baselines.settings import FlawSlice, FlawStrength, StressSlice
from catalogs.compare.exposure import Exposure, common_period
from catalogs.settings import DatedStep
from common.costs import duration_text
from common.datasets import read_dataset
from common.errors import InputError
from common.event_table import new_catalog, read_events
from common.modelled_events import describe_sources, spread_in_time
from common.source_tensors import moment_from_potency, scalar_potency

RUNS = 10  # Catalogues that each baseline draws at random: one that stands for it, and the others for its chance.
RUN = "run"  # variable that tells the runs of one file apart
LEFT_OUT = "left_out"  # attribute of a baseline that cannot be made: the reason
MAX_SEEDS = 1_000_000  # Flaws of one run. Time and memory of their slips grow with it.
# Number of flaws per volume times their mean cubed radius. With more, all that a slip reaches overlaps.
MAX_CRACK_DENSITY = 30.0
BALL_OF_DISC = np.sqrt(5.0 / 6.0)  # Radius of the uniform ball as spread out as a disc, over that of the disc.


@dataclass(frozen=True)
class RecordedTargets:
    """Number of recorded events from `cut`, m3, on, and their potencies: a baseline takes these from the record.

    sizes (event,): these potencies, m3; floor: that of the mine's own catalogue, m3, so that all models are compared
    from the same cut on; weight (step,): the share of each dated step in which both catalogues are known.
    """

    cut: float
    floor: float
    number: int
    sizes: NDArray
    weight: NDArray

    @classmethod
    def of(cls, record: xr.Dataset, comparison: xr.Dataset, steps: Sequence[DatedStep]) -> "RecordedTargets":
        """The targets that a record and its comparison with the mine's own catalogue set. Raises InputError for a
        record without an event to scale to."""
        sizes = record["potency"].values[comparison["record_used"].values == 1]
        if not len(sizes):
            raise InputError(
                f"record: no event that is compared ({comparison.attrs['cut_text']}); baselines are scaled to their "
                "number, so give a record with events in the dated steps"
            )
        shared, whole = (Exposure.of(tuple(steps), period) for period in (common_period(record), None))
        weight = (shared.end - shared.start) / (whole.end - whole.start)
        cut, floor = (10.0 ** float(comparison[name]) for name in ("cut", "model_floor"))
        return cls(cut, floor, len(sizes), sizes, weight)

    def state_weights(self, states: int) -> NDArray:
        """Weights (state,): those of the dated steps, which are the last states, and 0 of the others."""
        return np.concatenate([np.zeros(states - len(self.weight)), self.weight])


def make_catalogue(
    mine: str, steps: Sequence[DatedStep], step: NDArray, attributes: dict, **values: NDArray
) -> xr.Dataset:
    """Events of the dated steps, by time.

    step (event,): index of each one's step; values (event, ...): variables of the event table, in the order in which
    the events of a step happen.
    """
    order = np.argsort(step, kind="stable")
    step = step[order]
    values = {name: array[order] for name, array in values.items()}
    times = [
        spread_in_time((one.start, one.end), int(np.sum(step == index)), f"step {one.name}")
        for index, one in enumerate(steps)
    ]
    values |= {name: np.concatenate([part[name] for part in times]) for name in times[0]}
    values["step"] = np.array([one.name for one in steps], object)[step]
    known = {"mine": mine, "kind": "synthetic", "steps": json.dumps([one.name for one in steps])}
    return new_catalog(len(step), known | attributes, **values)


def join_runs(runs: Sequence[xr.Dataset]) -> xr.Dataset:
    """One catalogue of all runs, in which each event has the number of its run."""
    joined = xr.concat([run.drop_attrs(deep=False) for run in runs], "event").assign_attrs(runs[0].attrs)
    number = np.repeat(np.arange(len(runs)), [run.sizes["event"] for run in runs])
    joined[RUN] = ("event", number.astype(np.int32), {"units": "1", "long_name": "number of the run, from 0"})
    return joined.assign_attrs(runs=len(runs))


def split_runs(joined: xr.Dataset) -> list[xr.Dataset]:
    """The catalogues of all runs of a file of join_runs, in order."""
    number = joined[RUN].values
    return [joined.isel(event=number == run).drop_vars(RUN) for run in range(int(joined.attrs["runs"]))]


def excess_shear_stress(stress: NDArray, friction_angle: ArrayLike) -> NDArray:
    """Largest shear traction above friction of all planes (n,), Pa: max of |tau| + sigma_n tan phi.

    stress (n, 6) Pa, sigma_n tension positive; friction_angle, degrees, of all or (n,). With principal stresses
    s1 >= s3 and N = (1 + sin phi) / (1 - sin phi) it is (N s1 - s3) / (2 sqrt N).

    Compression of 30 and 10 MPa, which a friction angle of 30 degrees just bears:

    >>> stress = np.array([[-30e6, -20e6, -10e6, 0.0, 0.0, 0.0]])
    >>> print((excess_shear_stress(stress, 30.0) / 1e6).round(6), (excess_shear_stress(stress, 20.0) / 1e6).round(2))
    [0.] [3.36]
    """
    sine = np.sin(np.radians(friction_angle))
    factor = (1.0 + sine) / (1.0 - sine)
    largest, smallest = principal(stress)
    return (factor * largest - smallest) / (2.0 * np.sqrt(factor))


def raised_excess(rock: ElasticRock, strength: Mapping[str, FlawStrength]) -> NDArray:
    """Rise of excess shear stress above 0 in each state, times volume of rock (state, part), Pa m3.

    The dynamic strength is friction alone. The first state raises nothing: it is what the others start from.
    """
    friction = rock.by_material({name: one.friction_angle for name, one in strength.items()})
    positive = np.array([np.maximum(excess_shear_stress(stress, friction), 0.0) for stress in rock.stress])
    raised = np.zeros_like(positive)
    raised[1:] = np.maximum(np.diff(positive, axis=0), 0.0)
    return raised * rock.share * rock.edge**3


def draw_places(rock: ElasticRock, numbers: NDArray, generator: np.random.Generator) -> tuple[NDArray, NDArray]:
    """State (event,) and place (event, 3), m, of Poisson numbers of events in parts, of means (state, part)."""
    drawn = generator.poisson(numbers)
    state, part = (np.repeat(index, drawn[drawn > 0]) for index in np.nonzero(drawn))
    place = rock.centre[part] + (generator.uniform(size=(len(part), 3)) - 0.5) * rock.edge[part, None]
    order = generator.permutation(len(state))
    return state[order], place[order]


def _read(states: Sequence[Path], settings: StressSlice) -> ElasticRock:
    """Rock in which a flaw without cohesion would slip in some state, in the box that the record is taken from."""

    def may_slip(stress: NDArray, name: str) -> NDArray:
        return excess_shear_stress(stress, settings.strength[name].friction_angle) > 0.0

    lower, upper = settings.lower, settings.upper
    box = (
        np.full(3, -np.inf) if lower is None else np.array(lower),
        np.full(3, np.inf) if upper is None else np.array(upper),
    )
    return read_rock(states, may_slip, list(settings.strength), box)


def _attributes(rock: ElasticRock, targets: RecordedTargets) -> dict:
    """Attributes of a catalogue: its potency floor, m3, and the location error of its events, m."""
    return {"potency_floor": targets.floor, "location_error": float(rock.edge.min())}


def flaw_runs(states: Sequence[Path], targets: RecordedTargets, settings: FlawSlice) -> list[xr.Dataset]:
    """Catalogues of seeded flaws. Raises NotPossible if none would slip, or if they would be too many."""
    strength = settings.strength
    rock = _read(states, settings)
    smallest, largest = settings.radii
    law = RadiusLaw(smallest, largest, settings.exponent)
    weight = targets.state_weights(rock.states)
    generator = np.random.default_rng([settings.seed, RUNS])
    expected = expected_per_density(rock, law, strength, targets.cut, weight, generator)
    if not expected > 0.0:
        raise NotPossible(
            f"baselines: no flaw slips by log P {np.log10(targets.cut):.2f} or more in the dated steps; give a larger "
            "largest radius in baselines.radii, or a lower baselines.friction_angle or baselines.cohesion"
        )
    density = targets.number / expected
    seeds = density * float(np.sum(rock.share[0] * rock.edge**3))
    crack_density = density * law.mean_cube()
    logging.info("%.3g flaws per m3, %.3g in rock that they may slip in", density, seeds)
    if crack_density > MAX_CRACK_DENSITY:
        raise NotPossible(
            f"baselines: flaws that make {targets.number} events from log P {np.log10(targets.cut):.2f} on would "
            f"overlap many times (crack density {crack_density:.0f}); give a smaller largest radius in "
            "baselines.radii, or a lower baselines.friction_angle or baselines.cohesion"
        )
    if seeds > MAX_SEEDS:
        raise NotPossible(
            f"baselines: {seeds:.2g} flaws are needed for the recorded number, and {MAX_SEEDS:.0e} at most are "
            "possible; give a larger smallest radius in baselines.radii, or a lower baselines.cohesion"
        )
    attributes = _attributes(rock, targets) | {
        "flaws_per_m3": density,
        "flaws": seeds,
        "crack_density": crack_density,
    }
    runs, start = [], time.perf_counter()
    for run in range(RUNS):
        generator = np.random.default_rng([settings.seed, run])
        runs.append(_slip_once(rock, law, density, targets, settings, attributes, generator))
        left = (time.perf_counter() - start) / len(runs) * (RUNS - len(runs))
        logging.info(
            "run %d: %d events, %d recorded; about %s left",
            *(run, runs[-1].sizes["event"], targets.number, duration_text(left)),
        )
    return runs


def _slip_once(
    rock: ElasticRock,
    law: RadiusLaw,
    density: float,
    targets: RecordedTargets,
    settings: FlawSlice,
    attributes: dict,
    generator: np.random.Generator,
) -> xr.Dataset:
    """One catalogue of seeded flaws: the slips of dated steps from the cut on."""
    seeds = draw_poisson_flaws(rock, density, law, generator)
    slips = find_slips(rock, seeds, settings.strength)
    tensor = potency_tensors(rock, seeds, slips)
    step = slips.state - (rock.states - len(settings.steps))
    counts = np.flatnonzero((step >= 0) & (scalar_potency(tensor) >= targets.cut))
    seed, tensor = slips.seed[counts], tensor[counts]
    moment = moment_from_potency(tensor, 0.0, rock.shear_modulus[seeds.part[seed]])  # slip changes no volume
    return make_catalogue(
        settings.mine,
        settings.steps,
        step[counts],
        attributes,
        location=seeds.place[seed],
        source_size=2.0 * BALL_OF_DISC * seeds.radius[seed],
        **describe_sources(tensor, moment),
    )


def excess_shear_runs(states: Sequence[Path], targets: RecordedTargets, settings: StressSlice) -> list[xr.Dataset]:
    """Catalogues of events where mining raises excess shear stress. Raises NotPossible if it does so nowhere."""
    rock = _read(states, settings)
    raised = raised_excess(rock, settings.strength)
    total = float(np.sum(raised.sum(axis=1) * targets.state_weights(rock.states)))
    if not total > 0.0:
        raise NotPossible(
            "baselines: no dated step raises shear stress above friction; give a lower baselines.friction_angle"
        )
    first = rock.states - len(settings.steps)
    numbers = targets.number / total * raised[first:]
    attributes = _attributes(rock, targets)
    runs = []
    for run in range(RUNS):
        generator = np.random.default_rng([settings.seed, run])
        step, place = draw_places(rock, numbers, generator)
        potency = generator.choice(targets.sizes, len(step))
        runs.append(make_catalogue(settings.mine, settings.steps, step, attributes, location=place, potency=potency))
        logging.info("run %d: %d events, %d recorded", run, len(step), targets.number)
    return runs


def flaw_stage(given: Mapping, states: Sequence[Path], record: Path, comparison: Path) -> list[xr.Dataset]:
    """Runs of the seeded flaws, the first of which is their catalogue; one without events where they cannot be made.

    given: the stage's slice (FlawSlice); states: files of the states of elastic rock, in order; comparison: file of the
    mine's own comparison with the record. Raises InputError as RecordedTargets.of.
    """
    settings = FlawSlice.of(given)
    return runs_if_possible(flaw_runs, states, _read_targets(record, comparison, settings), settings)


def runs_if_possible(
    runs_of: Callable[..., list[xr.Dataset]],
    states: Sequence[Path],
    targets: RecordedTargets,
    settings: FlawSlice | StressSlice,
) -> list[xr.Dataset]:
    """Runs of a baseline; if it is not possible, one catalogue without events, whose attribute LEFT_OUT says why."""
    try:
        return runs_of(states, targets, settings)
    except NotPossible as reason:
        logging.warning("%s; this baseline is left out", reason)
        attributes = {"potency_floor": targets.floor, LEFT_OUT: str(reason).removeprefix("baselines: ")}
        nowhere = {"location": np.zeros((0, 3)), "potency": np.zeros(0)}
        return [make_catalogue(settings.mine, settings.steps, np.zeros(0, int), attributes, **nowhere)]


def excess_shear_stage(given: Mapping, states: Sequence[Path], record: Path, comparison: Path) -> list[xr.Dataset]:
    """Runs of excess shear stress, the first of which is its catalogue; arguments as of flaw_stage, StressSlice."""
    settings = StressSlice.of(given)
    return runs_if_possible(excess_shear_runs, states, _read_targets(record, comparison, settings), settings)


def _read_targets(record: Path, comparison: Path, settings: StressSlice) -> RecordedTargets:
    return RecordedTargets.of(read_events(record), read_dataset(comparison), settings.steps)
