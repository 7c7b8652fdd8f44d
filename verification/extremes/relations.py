"""Relations between scenes that must give the same answer: scaled, shifted, reordered, by the other scheme."""

import copy
from collections.abc import Callable

import numpy as np
import xarray as xr

from verification.extremes.outcomes import ENDED, RESTS, Outcome
from verification.scenes import other_scheme, quantity, value_of
from verification.studies import merge

STRESS_SCALE = 2.0**10  # A power of two keeps every digit.
SHIFT_CELLS = 1024.0  # Shift in coarsest cells. It is exact in binary where the cell is.
# Share of the largest motion. The scenes' own tolerance, a share of the force, is a tenth of it.
MAX_ELASTIC_DIFFERENCE = 1e-3
RUNS_AWAY = "runs away"
MAX_DIFFERENCE_BY_TOLERANCE = 0.02  # Share of the largest motion by which the tolerance may change an equilibrium.


def _scaled(values: dict) -> dict:
    """Stresses, strengths and moduli times STRESS_SCALE: strains and failed rock stay. Densities count as ratios."""

    def times(entry):
        if isinstance(entry, dict):
            return {key: times(value) for key, value in entry.items()}
        _, _, unit = entry.partition(" ") if isinstance(entry, str) else ("", "", "")
        return quantity(value_of(entry) * STRESS_SCALE, unit) if unit in ("Pa", "Pa/m") else entry

    return values | {key: times(values[key]) for key in ("insitu_stress", "materials")}


def _shifted(values: dict) -> dict:
    """The mine shifted along x. Strength that varies is a function of place, so it lies elsewhere in the mine: of such
    a mine only the elastic motion is the same."""
    by = SHIFT_CELLS * value_of(values["grid"]["coarse_cell"])
    result = copy.deepcopy(values)
    for entry in (result["domain"], *result["excavations"], *result["rock_bodies"]):
        for key in ("lower", "upper", "center"):
            if key in entry:
                entry[key][0] = quantity(value_of(entry[key][0]) + by, "m")
    return result


def _reordered(values: dict) -> dict:
    """Excavations in reverse order."""
    return values | {"excavations": list(reversed(values["excavations"]))}


def is_rest(values: dict, outcome: Outcome, run: Callable[[dict], Outcome]) -> bool:
    """True if a scene in equilibrium reaches it at a tenth of the tolerance as well, with the same motions of intact
    rock.

    It is asked where the rock runs away in the other scheme. Damped steps may move rock of little residual strength so
    far that they miss an equilibrium that exists.
    """
    other = run(merge(values, {"solver": {"tolerance": 0.1 * values["solver"]["tolerance"]}}))
    if other.kind != RESTS:
        return False
    return all(_stand_alike(state, other.stored[name]) for name, state in outcome.states.items())


def _stand_alike(state: xr.Dataset, other: xr.Dataset) -> bool:
    """True if the nodes of what has not failed in either state have the same motions. Motions of rock that has failed
    all around a node depend on the path by which it came to rest."""
    motions = [each.node_displacement.values for each in (state, other)]
    if motions[0].shape != motions[1].shape:
        return False
    intact = np.zeros(len(motions[0]), bool)
    has_failed = (state.failed.values >= 0) | (other.failed.values >= 0)
    intact[state.cell_nodes.values[state.cell.values[(state.volume.values > 0.0) & ~has_failed]]] = True
    apart = np.abs(motions[0] - motions[1])[intact]
    return bool(apart.max(initial=0.0) <= MAX_DIFFERENCE_BY_TOLERANCE * np.abs(motions[0]).max())


RELATIONS = {"scaled": _scaled, "shifted": _shifted, "reordered": _reordered, "other scheme": other_scheme}


def varies(values: dict) -> bool:
    """True if the strength of a rock varies."""
    return any(rock.get("variability", {}).get("share") for rock in values["materials"].values())


def compare(name: str, values: dict, first: Outcome, run: Callable[[dict], Outcome]) -> str:
    """Text on what differs between a scene (its values, its outcome) and the related one; empty where nothing does.

    The outcome and the elastic motion are compared. Failure is not: where brittle rock localises depends on round-off.
    """
    changed = RELATIONS[name](values)
    second = run(changed)
    if name == "other scheme" and {first.kind, second.kind} == {RESTS, ENDED}:
        rests, scene, ends = (first, values, second) if first.kind == RESTS else (second, changed, first)
        if RUNS_AWAY in ends.message:
            return "" if is_rest(scene, rests, run) else f"no rest at a tenth of the tolerance: {ends.message}"
    both = {first.kind, second.kind}
    if len(both) > 1 and not (name == "shifted" and varies(values) and both == {RESTS, ENDED}):
        return f"{first.kind} and {second.kind}: {first.message or second.message}"
    if "elastic" in first.stored and "elastic" in second.stored:
        motions = [outcome.state("elastic").node_displacement.values for outcome in (first, second)]
        if motions[0].shape != motions[1].shape:
            return f"{len(motions[0])} and {len(motions[1])} nodes"
        largest = np.abs(motions[0]).max()
        apart = np.abs(motions[0] - motions[1]).max()
        if apart > MAX_ELASTIC_DIFFERENCE * largest:
            return f"elastic motion differs by {apart / largest:.2g} of the largest"
    return ""
