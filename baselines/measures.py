"""Modelled measures of each dated step, by which a number of events may go (baselines.rate_law)."""

import json
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from common.datasets import read_dataset


@dataclass(frozen=True)
class Measure:
    """A measure of what a step mines, or of what mining does to the rock: label, name in a sentence, unit."""

    label: str
    name: str
    unit: str


METRES = Measure("metres", "metres advanced", "m")
OF_STATES = (
    Measure("mined_volume", "volume mined", "m³"),
    Measure("failed_volume", "failed volume", "m³"),
    Measure("plastic_strain", "plastic strain times volume", "m³"),
    Measure("plastic_work", "plastic work", "J"),
    Measure("energy_released", "released energy", "J"),
)
MEASURES = (METRES, *OF_STATES)
# those that are attributes of a state, by label
OF_ATTRIBUTES = {
    "failed_volume": "failed_volume",
    "plastic_work": "energy_dissipated",
    "energy_released": "energy_released",
}


def read_measures(states: Sequence[Path], steps: int) -> dict[str, NDArray]:
    """Measures (step,) of the dated steps by label, from the states of a mine, of which these are the last ones.

    There is one more state before them, with what was mined earlier. Plastic strain is that of potency: sqrt(2 e:e) of
    the plastic strain e of the step, times the volume of the rock, summed. Plastic work is all that plastic strain
    dissipates. Released energy is Salamon's (1984). From the step on in which the mine collapses, all are NaN.
    """
    if not steps:
        return {measure.label: np.zeros(0) for measure in OF_STATES}
    rock = [_rock_volume(path) for path in states[-steps - 1 :]]
    mined = zip(states[-steps:], pairwise(rock), strict=True)
    rows = [_of_step(path, before - after) for path, (before, after) in mined]
    return {measure.label: np.array([row[measure.label] for row in rows]) for measure in OF_STATES}


def _rock_volume(path: Path) -> float:
    """Volume of the rock of a state that is not mined, m3; fill does not count."""
    state = read_dataset(path, ["volume", "excavation"])
    return float(state["volume"].values[state["excavation"].values < 0].sum())


def _of_step(path: Path, removed: float) -> dict[str, float]:
    """Measures of a step; removed: rock that is not there any more, m3."""
    state = read_dataset(path, ["volume", "plastic_strain_step"])
    attributes = state.attrs
    if attributes.get("collapsed") or not attributes.get("computed", 1):
        return {measure.label: np.nan for measure in OF_STATES}
    fallen = sum(fall["volume"] for fall in json.loads(attributes.get("falls", "[]")))
    strain = state["plastic_strain_step"].values
    potency = np.sqrt(2.0 * np.sum(strain[:, :3] ** 2, axis=1) + 4.0 * np.sum(strain[:, 3:] ** 2, axis=1))
    return {
        "mined_volume": max(removed - fallen, 0.0),
        "plastic_strain": float(potency @ state["volume"].values),
        **{label: max(float(attributes[name]), 0.0) for label, name in OF_ATTRIBUTES.items()},
    }
