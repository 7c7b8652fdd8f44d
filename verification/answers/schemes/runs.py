"""Runs of one brittle scene that differ by unknown details, and the failed rock and events of each.

Brittle failure localises, so one run is one realisation. Schemes are compared by all their runs.
"""

import copy
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import xarray as xr

from catalogs.sources.sizes import MIN_EVENTS_FOR_B, BValue, estimate_b, log_potency
from common.errors import InputError
from common.source_tensors import scalar_potency
from common.voigt import tensor_from_voigt
from mpm_core.kernels.threads import use_threads
from mpm_core.scene.scene import parse_scene
from mpm_core.stages.equilibrium_stages import mining_step
from seismic.events import extract_events
from verification.results import Variant
from workflow.mine import Mine


@dataclass(frozen=True)
class Run:
    """Results of a run's last step.

    potency: sum over particles of the scalar of seismic strain times volume, m3. failed_volume: m3. failed: whether a
    particle has failed by its end. sizes: log10 potency (m3) of resolved events. floor: smallest potency that can be
    resolved, m3. iterations: of all steps. in_parts: generations of failure that were solved in a subdomain.
    """

    potency: float
    failed_volume: float
    failed: np.ndarray
    sizes: np.ndarray
    floor: float
    iterations: int
    in_parts: int

    @property
    def events(self) -> int:
        """Number of resolved events."""
        return len(self.sizes)


@dataclass(frozen=True)
class Pairs:
    """The same runs of two variants in one order, by name of the scheme, explicit first, or of the variant."""

    runs: dict[str, list[Run]]

    @cached_property
    def cut(self) -> float:
        """log10 potency (m3) from which b is estimated: the largest floor of all runs; NaN without failed rock."""
        return float(log_potency(np.max([run.floor for runs in self.runs.values() for run in runs])))

    def b_values(self) -> dict[str, list[BValue]]:
        """b of log potency of each run's resolved events from the cut on; NaN of fewer than MIN_EVENTS_FOR_B."""
        return {name: [estimate_b(run.sizes, self.cut) for run in runs] for name, runs in self.runs.items()}

    def values(self, quantity: str) -> tuple[np.ndarray, np.ndarray]:
        """potency, failed_volume, events or b of the runs (run,) of both."""
        if quantity == "b":
            first, other = ([value.b for value in values] for values in self.b_values().values())
        else:
            first, other = ([getattr(run, quantity) for run in runs] for runs in self.runs.values())
        return np.array(first, float), np.array(other, float)

    @property
    def has_b(self) -> bool:
        """Whether every run has enough events for a b-value."""
        return bool(np.isfinite(self.values("b")).all())

    @property
    def why_no_b(self) -> str:
        """Remark with the number of events where they are too few."""
        counted = [value.events for values in self.b_values().values() for value in values]
        return (
            f"too few events: {min(counted)} to {max(counted)} from the cut on, {MIN_EVENTS_FOR_B} needed in every run"
        )

    @property
    def count(self) -> int:
        """Number of runs of each variant."""
        return min(len(runs) for runs in self.runs.values())

    @property
    def same_scene(self) -> bool:
        """Whether the runs of a pair differ by their scheme alone, so that their particles can be compared."""
        return set(self.runs) == {"explicit", "multigrid"}

    @property
    def alike(self) -> int:
        """Number of pairs in which the same particles fail."""
        return sum(np.array_equal(one.failed, other.failed) for one, other in zip(*self.runs.values(), strict=True))


def read_pairs(variants: tuple[Variant, Variant], increments: list[int]) -> Pairs:
    """The runs of two variants that differ by their scheme alone or, with one scheme, by a mirror."""
    schemes = [variant.mine.settings.solver.scheme for variant in variants]
    names = schemes if schemes[0] != schemes[1] else [variant.mine.name.partition("-")[2] for variant in variants]
    return Pairs({name: list(read_runs(variant, increments)) for name, variant in zip(names, variants, strict=True)})


def read_runs(variant: Variant, increments: list[int]) -> Iterator[Run]:
    """Runs of a variant: the members of its ensemble, or, without one, one for each number of increments.

    One of those may be the variant's own. The others are computed here from its grid and elastic state, since starting
    a process for each stage would cost more than the stages of these small scenes.
    """
    if variant.mine.settings.ensemble:
        for number in range(1, variant.mine.members + 1):
            states = [variant.read(f"ensemble/{number}/steps/{step}.nc") for step in variant.step_names]
            yield describe(states, variant.mine.member(number))
        return
    use_threads(1)
    for parts in increments:
        mine = with_increments(variant.mine, parts)
        own = parts == variant.mine.settings.solver.increments
        states = [variant.step(step) for step in variant.step_names] if own else compute(mine, variant)
        yield describe(states, mine)


def with_increments(mine: Mine, increments: int) -> Mine:
    """The same mine, whose steps are unloaded in so many increments."""
    changed = copy.copy(mine)
    changed.change("solver", increments=increments)
    return changed


def compute(mine: Mine, variant: Variant) -> list[xr.Dataset]:
    """States after each step, by the ordinary stage. Raises InputError where a step finds no equilibrium."""
    states = [variant.elastic]
    with TemporaryDirectory() as folder:
        for step in mine.mined_steps:
            try:
                scene = parse_scene(mine.step_slice(step))
                states.append(mining_step(scene, variant.grid, states[-1], Path(folder) / "failed.npz")[0])
            except InputError as error:
                parts = mine.settings.solver.increments
                raise InputError(f"{mine.name}, {parts} increments, step {step}: {error}") from error
    return states[1:]


def describe(states: list[xr.Dataset], mine: Mine) -> Run:
    """Run of these states."""
    last = states[-1]
    events = extract_events(last, mine.event_slice())[0]
    strain, volume = tensor_from_voigt(last.seismic_strain.values), last.volume.values
    return Run(
        potency=float(np.sum(scalar_potency(strain) * volume)),
        failed_volume=float(last.attrs["failed_volume"]),
        failed=last.failed.values >= 0,
        sizes=log_potency(events.potency.values[events.resolved.values == 1]),
        floor=float(events.attrs["potency_floor"]),
        iterations=sum(int(state.attrs["iterations"]) for state in states),
        in_parts=sum(_generations_in_parts(state) for state in states),
    )


def _generations_in_parts(state: xr.Dataset) -> int:
    """Number of generations of failure after which a subdomain reached equilibrium before the whole mine."""
    part = state.convergence_cells.values < state.sizes["cell"]
    generations = state.convergence_increment.values[part], state.convergence_generation.values[part]
    return len(np.unique(np.stack(generations), axis=1).T)
