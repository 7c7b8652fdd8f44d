"""The arrays that mining changes, declared once.

The declaration makes a virgin state, says what a checkpoint keeps (stages/checkpoint.py) and what a subdomain
copies and copies back (equilibrium/subdomain.py), and names, measures and describes each array in the files
(files/state_datasets.py). Another array is one more declaration here, one line in files/state_datasets.py
if its file holds something else than the array, and one in stages/state_transfer.py unless only failed rock has it.
"""

from dataclasses import dataclass, fields
from enum import Enum, auto
from typing import Annotated, Any, get_type_hints

import numpy as np

from common.fields import Field
from mpm_core.model.particles import Particles

PARTICLES = ("particle",)
TENSORS = ("particle", "voigt")
FORCES, BOUNDARY, SEISMIC, OVERSHOOT, FLOW, GAINED, HOURGLASS, MOTION, UNBALANCED, REFINED = range(10)
"""entries of State.energy, J (per m in 2-D): see equilibrium.energy_balance"""


class Extent(Enum):
    """The particles or nodes at which a stage changes an array."""

    ALL = auto()
    FAILED = auto()
    """where rock has failed; elsewhere zeros, which need no memory until they are written"""
    NONE = auto()
    """nowhere, unless particles move: such stages have neither checkpoints nor subdomains"""


@dataclass(frozen=True)
class Array:
    """One array of a state: the variable of the files that it becomes (a vector has three components there, d here).

    start: its value in virgin rock, None: the array of that name of the model's particles. of_stage: it starts from
    zero in every stage. stored: whether the files have it.
    """

    field: Field
    start: float | None = 0
    changes: Extent = Extent.ALL
    of_stage: bool = False
    stored: bool = True

    @property
    def dims(self) -> tuple[str, ...]:
        """Its dimensions."""
        return self.field.dims


def _strain(name: str, meaning: str) -> Array:
    """A plastic strain of this stage alone."""
    return Array(Field(name, TENSORS, np.float64, "1", f"{meaning}, this step"), changes=Extent.FAILED, of_stage=True)


@dataclass
class State:
    """The arrays that mining changes. Components in the computation's axes.

    stress (particle, 6) Pa: change since virgin (rock) or full stress (fill), the full stress of both in files;
    plastic_strain (particle, 6) up to the stage before, with this stage in files; displacement, velocity (node, d);
    hourglass_force (cell, 2^d - 1 - d, d) by mode; energy (10,), per m in 2-D, of this stage: see FORCES.
    Where particles move: position (particle, d), cell (particle,), and how often they changed it in this stage.
    """

    stress: Annotated[
        np.ndarray,
        Array(Field("stress", TENSORS, np.float64, "Pa", "Cauchy stress, tension positive; 0 where nothing is")),
    ]
    failed: Annotated[
        np.ndarray,
        Array(Field("failed", PARTICLES, np.int32, "1", "index of the step of first failure, -1 intact"), start=-1),
    ]
    failure_order: Annotated[
        np.ndarray,
        Array(
            Field(
                "failure_order",
                ("particle", "order"),
                np.int32,
                "1",
                "increment and generation of first failure, -1 intact",
            ),
            start=-1,
            changes=Extent.FAILED,
        ),
    ]
    seismic_strain: Annotated[np.ndarray, _strain("seismic_strain", "brittle drop from peak to residual strength")]
    overshoot_strain: Annotated[
        np.ndarray, _strain("overshoot_strain", "drop from trial stress to peak strength before it")
    ]
    later_strain: Annotated[np.ndarray, _strain("later_strain", "plastic strain of failed rock at residual strength")]
    plastic_strain: Annotated[
        np.ndarray,
        Array(
            Field("plastic_strain", TENSORS, np.float64, "1", "plastic strain of all steps so far"),
            changes=Extent.NONE,
        ),
    ]
    displacement: Annotated[
        np.ndarray, Array(Field("node_displacement", ("node", "xyz"), np.float64, "m", "displacement since virgin"))
    ]
    velocity: Annotated[
        np.ndarray,
        Array(Field("node_velocity", ("node", "xyz"), np.float64, "m/s", "velocity of the scheme, for restart")),
    ]
    hourglass_force: Annotated[
        np.ndarray,
        Array(
            Field(
                "hourglass_force",
                ("cell", "mode", "xyz"),
                np.float64,
                "N",
                "force on each hourglass mode of a cell, for restart",
            )
        ),
    ]
    energy: Annotated[
        np.ndarray,
        Array(
            Field("energy", ("entry",), np.float64, "J", "terms of the stage's balance"), of_stage=True, stored=False
        ),
    ]
    position: Annotated[
        np.ndarray,
        Array(
            Field("position", ("particle", "xyz"), np.float64, "m", "place of the particle"),
            start=None,
            changes=Extent.NONE,
        ),
    ]
    cell: Annotated[
        np.ndarray,
        Array(Field("cell", PARTICLES, np.int32, "1", "cell of the particle"), start=None, changes=Extent.NONE),
    ]
    cell_changes: int = 0

    @classmethod
    def virgin(cls, particles: Particles, nodes: int, cells: int, dimension: int) -> "State":
        """Nothing mined: all changes are zero. Position, cell: the particles' own arrays, to be copied if they move."""
        modes = (1 << dimension) - 1 - dimension
        sizes = {"particle": particles.count, "node": nodes, "cell": cells, "entry": REFINED + 1}
        sizes |= {"voigt": 6, "xyz": dimension, "order": 2, "mode": modes}

        def begin(name: str, array: Array) -> np.ndarray:
            if array.start is None:
                return getattr(particles, name)
            shape, dtype = [sizes[dim] for dim in array.dims], array.field.dtype
            return np.full(shape, array.start, dtype) if array.start else np.zeros(shape, dtype)

        arrays: dict[str, Any] = {name: begin(name, array) for name, array in ARRAYS.items()}
        return cls(**arrays)


_HINTS = get_type_hints(State, include_extras=True)
ARRAYS: dict[str, Array] = {
    entry.name: _HINTS[entry.name].__metadata__[0] for entry in fields(State) if entry.name != "cell_changes"
}
"""by name in a State"""


def changed_in(extent: Extent) -> tuple[str, ...]:
    """Names of the arrays that a stage changes there."""
    return tuple(name for name, array in ARRAYS.items() if array.changes is extent)


def copy_to_subdomain(state: State, own: State, places: dict[str, np.ndarray]) -> None:
    """Fill the state of a subdomain; places: the cells, nodes and particles of the whole that it has, by dimension."""
    for name, array in ARRAYS.items():
        if array.dims[0] in places and array.start is not None:
            setattr(own, name, getattr(state, name).take(places[array.dims[0]], axis=0))


def copy_from_subdomain(own: State, state: State, places: dict[str, np.ndarray]) -> None:
    """Write what has changed in a subdomain into the state of the whole mine; its energy is added to that."""
    state.energy += own.energy
    failed = np.flatnonzero(own.failed >= 0)
    for name, array in ARRAYS.items():
        if array.dims[0] in places and array.changes is not Extent.NONE:
            index, rows = places[array.dims[0]], failed if array.changes is Extent.FAILED else slice(None)
            getattr(state, name)[index[rows]] = getattr(own, name)[rows]


def snapshot(state: State, moving: bool = False, into: dict[str, np.ndarray] | None = None) -> dict[str, np.ndarray]:
    """A copy of what a stage changes, by name: of arrays that only failed rock has, its rows; all of all arrays where
    particles move. into: an earlier copy, whose memory is used again."""
    rows = np.flatnonzero(state.failed >= 0)
    values = {}
    for name, array in ARRAYS.items():
        value, before = getattr(state, name), (into or {}).get(name)
        if array.changes is Extent.FAILED and not moving:
            values[name] = value[rows]
        elif name == "velocity" and not value.any():
            # Nodes rest with scheme multigrid. Zeros need no memory, but zeros_like would write them.
            values[name] = np.zeros(value.shape, value.dtype)
        elif array.changes is Extent.ALL or moving:
            if before is None or before.shape != value.shape:
                before = np.empty_like(value)
            np.copyto(before, value)
            values[name] = before
    return values


def restore(values: dict[str, np.ndarray], state: State) -> None:
    """Write a snapshot's values into the state that it was taken of; what has failed since then has not."""
    since, rows = np.flatnonzero(state.failed >= 0), np.flatnonzero(values["failed"] >= 0)
    for name, value in values.items():
        array = getattr(state, name)
        if len(value) < len(array):
            array[since] = ARRAYS[name].start
            array[rows] = value
        else:
            array[...] = value
