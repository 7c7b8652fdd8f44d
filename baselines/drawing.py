"""The catalogues of both baselines, drawn at random from the elastic stress of a mine."""

import logging
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from baselines.catalogue import RUNS, Asked, make_catalogue
from baselines.elastic_rock import ElasticRock, read_rock
from baselines.excess_shear import draw_places, excess_shear_stress, raised_excess
from baselines.flaws import expected_per_density, find_slips, potency_tensors
from baselines.seeds import RadiusLaw, sow_poisson
from baselines.settings import FlawSlice, StressSlice
from common.errors import InputError
from common.modelled_events import describe_sources
from common.source_tensors import moment_from_potency, scalar_potency

MAX_SEEDS = 1_000_000  # Flaws of one run: their slips take some minutes and 1 GB of memory at most.
# Number of flaws per volume times their mean cubed radius. With more, all that a slip reaches overlaps.
MAX_CRACK_DENSITY = 30.0
BALL_OF_DISC = np.sqrt(5.0 / 6.0)  # Radius of the uniform ball as spread out as a disc, over that of the disc.


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


def _attributes(rock: ElasticRock, asked: Asked) -> dict:
    """What a catalogue says of its floor and of how well its events are located: as the mine's own catalogue does."""
    return {"potency_floor": asked.floor, "location_error": float(rock.edge.min())}


def draw_flaws(states: Sequence[Path], asked: Asked, settings: FlawSlice) -> list[xr.Dataset]:
    """Catalogues of seeded flaws. Raises InputError if none would slip, or if they would be too many."""
    strength = settings.strength
    rock = _read(states, settings)
    smallest, largest = settings.radii
    law = RadiusLaw(smallest, largest, settings.exponent)
    weight = asked.of_states(rock.states)
    generator = np.random.default_rng([settings.seed, RUNS])
    expected = expected_per_density(rock, law, strength, asked.cut, weight, generator)
    if not expected > 0.0:
        raise InputError(
            f"baselines: no flaw slips by log P {np.log10(asked.cut):.2f} or more in the dated steps; give a larger "
            "largest radius in baselines.radii, or a lower baselines.friction_angle or baselines.cohesion"
        )
    density = asked.number / expected
    seeds = density * float(np.sum(rock.share[0] * rock.edge**3))
    crack_density = density * law.mean_cube()
    logging.info("%.3g flaws per m3, %.3g in rock that they may slip in", density, seeds)
    if crack_density > MAX_CRACK_DENSITY:
        raise InputError(
            f"baselines: flaws that make {asked.number} events from log P {np.log10(asked.cut):.2f} on would overlap "
            f"many times (crack density {crack_density:.0f}); give a smaller largest radius in baselines.radii, or a "
            "lower baselines.friction_angle or baselines.cohesion"
        )
    if seeds > MAX_SEEDS:
        raise InputError(
            f"baselines: {seeds:.2g} flaws are needed for the recorded number, and {MAX_SEEDS:.0e} at most are "
            "possible; give a larger smallest radius in baselines.radii, or a lower baselines.cohesion"
        )
    attributes = _attributes(rock, asked) | {
        "flaws_per_m3": density,
        "flaws": seeds,
        "crack_density": crack_density,
    }
    runs = []
    for run in range(RUNS):
        generator = np.random.default_rng([settings.seed, run])
        runs.append(_slip_once(rock, law, density, asked, settings, attributes, generator))
        logging.info("run %d: %d events, %d recorded", run, runs[-1].sizes["event"], asked.number)
    return runs


def _slip_once(
    rock: ElasticRock,
    law: RadiusLaw,
    density: float,
    asked: Asked,
    settings: FlawSlice,
    attributes: dict,
    generator: np.random.Generator,
) -> xr.Dataset:
    """One catalogue of seeded flaws: the slips of dated steps from the cut on."""
    seeds = sow_poisson(rock, density, law, generator)
    slips = find_slips(rock, seeds, settings.strength)
    tensor = potency_tensors(rock, seeds, slips)
    step = slips.state - (rock.states - len(settings.steps))
    kept = np.flatnonzero((step >= 0) & (scalar_potency(tensor) >= asked.cut))
    seed, tensor = slips.seed[kept], tensor[kept]
    moment = moment_from_potency(tensor, 0.0, rock.shear_modulus[seeds.part[seed]])  # slip changes no volume
    return make_catalogue(
        settings.mine,
        settings.steps,
        step[kept],
        attributes,
        location=seeds.place[seed],
        source_size=2.0 * BALL_OF_DISC * seeds.radius[seed],
        **describe_sources(tensor, moment),
    )


def draw_excess_shear(states: Sequence[Path], asked: Asked, settings: StressSlice) -> list[xr.Dataset]:
    """Catalogues of events where mining raises excess shear stress. Raises InputError if it does so nowhere."""
    rock = _read(states, settings)
    raised = raised_excess(rock, settings.strength)
    total = float(np.sum(raised.sum(axis=1) * asked.of_states(rock.states)))
    if not total > 0.0:
        raise InputError(
            "baselines: no dated step raises shear stress above friction; give a lower baselines.friction_angle"
        )
    first = rock.states - len(settings.steps)
    numbers = asked.number / total * raised[first:]
    attributes = _attributes(rock, asked)
    runs = []
    for run in range(RUNS):
        generator = np.random.default_rng([settings.seed, run])
        step, place = draw_places(rock, numbers, generator)
        potency = generator.choice(asked.sizes, len(step))
        runs.append(make_catalogue(settings.mine, settings.steps, step, attributes, location=place, potency=potency))
        logging.info("run %d: %d events, %d recorded", run, len(step), asked.number)
    return runs
