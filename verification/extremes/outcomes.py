"""Outcome of a scene after its stages, and what must be true of every state that they store."""

import signal
import traceback
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import xarray as xr
import yaml

from common.errors import InputError
from mpm_core.files.state_datasets import read_edge_nodes, read_grid
from mpm_core.grid.distorted_cells import distorted_cells
from verification.scenes import value_of
from verification.studies import default_settings, for_verification, merge
from workflow.configuration import load
from workflow.run_mine import run_stages

RESTS, REFUSED, ENDED, BROKEN, HANGS, WRONG = "at rest", "refused", "ended", "traceback", "hangs", "wrong"
FAULTS = (BROKEN, HANGS, WRONG)
MAX_SCENE_SECONDS = 120  # Processor time of a scene above which it counts as hanging.
LAST = "last"  # Stands for the state at the end.
MIN_ROCK_SHARE = 0.5  # Of a cell whose rock may fail by itself; of less only next to failed rock.
MAX_OVERSTRESS_SHARE = 1e-3  # A stored stress may exceed strength by this share of strength and stress.


@dataclass
class Outcome:
    """End of a scene: its kind, a line about it, and the stored datasets by name: the grid, then each state.

    has_begun: whether a solution was under way when it ended. Its last state then lies beside the output, or is stored.
    """

    kind: str
    message: str = ""
    stored: dict[str, xr.Dataset] = field(default_factory=dict)
    has_begun: bool = False

    @property
    def states(self) -> dict[str, xr.Dataset]:
        """The stored states by name, in order."""
        return {name: dataset for name, dataset in self.stored.items() if name != "grid"}

    def state(self, name: str) -> xr.Dataset:
        """The state of a name, or the LAST one."""
        return list(self.stored.values())[-1] if name == LAST else self.stored[name]


@contextmanager
def _limit(seconds: int):
    """Raise TimeoutError after so many seconds of processor time (main thread only), independent of other work."""

    def end(number, frame):
        raise TimeoutError

    before = signal.signal(signal.SIGPROF, end)
    signal.setitimer(signal.ITIMER_PROF, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
        signal.signal(signal.SIGPROF, before)


def run(values: dict, folder: Path, seconds: int = MAX_SCENE_SECONDS) -> Outcome:
    """Run a configuration through its stages in this process."""
    outcome, failed = Outcome(RESTS), folder / "failed.npz"
    failed.unlink(missing_ok=True)
    try:
        with _limit(seconds):
            mine = load(merge(default_settings(), for_verification(values)), folder / "mine.yaml", default_settings())
            for name, dataset, _ in run_stages(mine.run_slices(extracted_as=()), failed):
                outcome.stored[name.removeprefix("steps/")] = dataset
        grid = outcome.stored["grid"]
        wrong = [fault for state in outcome.states.values() for fault in faults(values, grid, state)]
        collapse = [state.attrs["collapse"] for state in outcome.states.values() if state.attrs["collapsed"]]
        if wrong:
            outcome.kind, outcome.message = WRONG, wrong[0]
        elif collapse:
            outcome.kind, outcome.message, outcome.has_begun = ENDED, collapse[0], True
    except InputError as error:
        outcome.kind, outcome.message = ENDED if "elastic" in outcome.stored else REFUSED, str(error)
    except TimeoutError:
        stored = ", ".join(outcome.stored) or "nothing"
        outcome.kind, outcome.message = HANGS, f"not done after {seconds} s: {stored} stored"
    except Exception:  # A traceback that a user would see is a finding here.
        outcome.kind, outcome.message = BROKEN, traceback.format_exc().strip().replace("\n", " | ")
    outcome.has_begun |= failed.exists()
    return outcome


def faults(values: dict, grid: xr.Dataset, state: xr.Dataset) -> list[str]:
    """One line for each fault of a stored state; none for a sound one."""
    name, found = state.attrs["step"], []
    volume, failed = state.volume.values, state.failed.values >= 0
    present = volume > 0.0
    for variable in ("stress", "displacement", "plastic_strain"):
        if not np.isfinite(state[variable].values).all():
            found.append(f"{name}: {variable} is not finite")
    span = grid.node_position.values.max(axis=0) - grid.node_position.values.min(axis=0)
    if np.abs(state.node_displacement.values).max() > span.max():
        found.append(f"{name}: rock moved farther than the domain is wide")
    rests = not state.attrs["collapsed"]  # else it is the last equilibrium before rock would have failed on
    ratio = float(state.attrs["unbalanced_ratio"])
    if rests and ratio > float(state.attrs["tolerance"]):
        found.append(f"{name}: stored with {ratio:.2g} unbalanced")
    if state.attrs["stage"] == "step":
        parts = state.seismic_strain.values + state.overshoot_strain.values + state.later_strain.values
        if np.abs(parts - state.plastic_strain_step.values).max() > 1e-12 * max(np.abs(parts).max(), 1e-300):
            found.append(f"{name}: strains do not add up")
        if (state.plastic_strain.values[~failed] != 0.0).any():
            found.append(f"{name}: intact rock has flowed")
        if rests:
            found += [f"{name}: {fault}" for fault in _above_strength(values, grid, state, present, failed)]
        dissipated = float(state.attrs["energy_dissipated"])
        scale = float(np.sum(np.abs(state.stress.values).max(axis=1) * np.abs(parts).max(axis=1) * volume))
        if dissipated < -1e-3 * scale:
            found.append(f"{name}: {dissipated:.3g} J dissipated")
    return found


def _rock_share(grid: xr.Dataset, state: xr.Dataset) -> np.ndarray:
    """Share (cell,) of the volume of each cell of a state that is rock. Cells at edges of openings are no cubes."""
    cells, nodes = read_grid(state)[0], read_edge_nodes(grid)
    distorted = distorted_cells(cells, nodes.place, nodes.shift)
    number = np.arange(len(cells.cell_level))
    full = cells.cell_size**cells.dimension * distorted.volumes(number) * float(state.attrs["thickness"])
    rock = np.where(state.excavation.values < 0, state.volume.values, 0.0)
    return np.bincount(state.cell.values, rock, minlength=len(number)) / full


def _above_strength(values, grid, state, present, failed):
    """Yield a line for each rock above its strength: intact rock in finest cells that are rock by half, and failed
    rock. In other cells rock fails only next to failed rock."""
    names = yaml.safe_load(state.attrs["material_names"])
    level = state.cell_level.values[state.cell.values]
    whole = (level == level.max()) & (_rock_share(grid, state)[state.cell.values] >= MIN_ROCK_SHARE)
    rock_here = present & (state.excavation.values < 0)
    tensor = state.stress.values[:, [0, 5, 4, 5, 1, 3, 4, 3, 2]].reshape(-1, 3, 3)
    for number, material in enumerate(names):
        rock = values["materials"][material]
        if rock["model"] != "coulomb":
            continue
        for kind, chosen in (("intact", ~failed & whole), ("residual", failed)):
            chosen = np.flatnonzero(chosen & rock_here & (state.material.values == number))
            if not len(chosen):
                continue
            if kind == "intact" and rock.get("variability", {}).get("share"):
                # Its strength is known to the stage alone.
                least = float(state.strength_factor.values[chosen].min())
                if least < 1.0 - MAX_OVERSTRESS_SHARE:
                    yield f"intact {material} has a strength factor of {least:.4g}"
                continue
            s3, _, s1 = np.linalg.eigvalsh(tensor[chosen]).T
            phi, cohesion = np.radians(value_of(rock["friction_angle"][kind])), value_of(rock["cohesion"][kind])
            slope = (1.0 + np.sin(phi)) / (1.0 - np.sin(phi))
            strength = 2.0 * cohesion * np.cos(phi) / (1.0 - np.sin(phi))
            excess = slope * s1 - s3 - strength
            if rock["tension_cutoff"] != "none":
                excess = np.maximum(excess, s1 - value_of(rock["tension_cutoff"][kind]))
            size = strength + slope * np.abs(s1) + np.abs(s3) + np.abs(tensor[present]).max()
            if (excess > MAX_OVERSTRESS_SHARE * size).any():
                yield f"{kind} {material} stands {excess.max():.3g} Pa above its strength"
