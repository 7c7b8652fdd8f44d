"""The rock of a mine in parts, each with its stress in every state of elastic rock.

Cells are split from one state to the next, never joined. So the parts are those of the last state, and each lies within
one part of every earlier state.
"""

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from common.datasets import read_dataset
from common.errors import InputError
from common.part_centers import PLACE_VARIABLES, part_centers
from common.voigt import tensor_from_voigt

VARIABLES = {*PLACE_VARIABLES, "stress", "volume", "material", "excavation"}
NUMBERING = np.array([1 << 42, 1 << 21, 1])  # Makes one number of 63 bits of three of 21.

MayHoldEvents = Callable[[NDArray, str], NDArray]
"""which stresses (part, 6), Pa, of a rock may make events there, (part,) bool"""


@dataclass(frozen=True)
class ElasticRock:
    """Cubes of rock: centre (part, 3) and edge (part,) m; material (part,) as an index into `materials`.

    shear_modulus (part,) Pa, poisson_ratio (part,); share (state, part): of the cube that is rock in each state, 0 once
    it is mined; stress (state, part, 6) Pa, tension positive.
    """

    centre: NDArray
    edge: NDArray
    material: NDArray
    materials: tuple[str, ...]
    shear_modulus: NDArray
    poisson_ratio: NDArray
    share: NDArray
    stress: NDArray

    @property
    def states(self) -> int:
        """Number of states."""
        return len(self.share)

    def by_material(self, values: Mapping[str, float]) -> NDArray:
        """A value of each part's own material, (part,)."""
        return np.array([values.get(name, np.nan) for name in self.materials])[self.material]


def principal(stress: NDArray) -> tuple[NDArray, NDArray]:
    """Largest and smallest principal stress (n,), tension positive, of stresses (n, 6)."""
    values = np.linalg.eigvalsh(tensor_from_voigt(stress))
    return values[..., 2], values[..., 0]


def read_rock(
    states: Sequence[Path], may_hold: MayHoldEvents, rocks: Sequence[str], box: tuple[NDArray, NDArray] | None = None
) -> ElasticRock:
    """The rock that may hold events in some state, from states in order.

    rocks: names of the materials that may, of which a state may lack some; box: lower and upper corner, m, that its
    centres lie in. Raises InputError for plane strain.
    """
    last = _read(states[-1])
    if last.attrs["plane"] != "none":
        raise InputError(
            f"{states[-1]}: is of plane strain; flaws and their stress are three-dimensional, so baselines need a mine "
            "with plane: none"
        )
    names = tuple(json.loads(last.attrs["material_names"]))
    wanted = np.isin(last["material"].values, [names.index(name) for name in rocks if name in names])
    parts = np.flatnonzero(wanted)
    centre, edge = part_centers(last)[parts], last["spacing"].values[parts]
    if box is not None:
        inside = np.all((centre >= box[0]) & (centre <= box[1]), axis=1)
        parts, centre, edge = parts[inside], centre[inside], edge[inside]
    material = last["material"].values[parts]

    is_candidate = np.zeros(len(parts), bool)
    for path in states:
        state = _read(path)
        rows, share = _rows_of(state, centre, material, names)
        stress = state["stress"].values[rows]
        for index, name in enumerate(names):
            own = np.flatnonzero((material == index) & (share > 0.0) & ~is_candidate)
            if len(own):
                is_candidate[own] = may_hold(stress[own], name)
    centre, edge, material = centre[is_candidate], edge[is_candidate], material[is_candidate]
    shares, stresses = [], []
    for path in states:
        state = _read(path)
        rows, share = _rows_of(state, centre, material, names)
        shares.append(share)
        stresses.append(state["stress"].values[rows])
    moduli = json.loads(last.attrs["elastic_moduli"])
    lame, shear = np.array([moduli[name] for name in names]).T[:, material]
    poisson = lame / (2.0 * (lame + shear))
    return ElasticRock(centre, edge, material, names, shear, poisson, np.array(shares), np.array(stresses))


def _read(path: Path) -> xr.Dataset:
    return read_dataset(path, VARIABLES)


def _rows_of(state: xr.Dataset, centre: NDArray, material: NDArray, names: tuple[str, ...]) -> tuple[NDArray, NDArray]:
    """Row of the rock of a state that each centre (part, 3) lies in, and the share of its cube that is rock (part,).

    Where rocks share a cube, the row is of the given material (part,), an index into `names`, if there is one. Without
    rock the share is 0.
    """
    rock = np.flatnonzero(state["excavation"].values < 0)
    index = {name: number for number, name in enumerate(names)}
    numbers = np.array([index.get(name, -1) for name in json.loads(state.attrs["material_names"])])
    kinds = numbers[state["material"].values[rock]]  # a state names what is there by then
    cubes = part_centers(state)[rock], state["spacing"].values[rock]
    lower = np.asarray(state.attrs["domain_lower"], float)
    rows = np.full(len(centre), -1)
    for kind in np.unique(material):
        own, sought = np.flatnonzero(kinds == kind), np.flatnonzero(material == kind)
        cube = _cube_of(centre[sought], cubes[0][own], cubes[1][own], lower)
        rows[sought[cube >= 0]] = rock[own[cube[cube >= 0]]]
    rest = np.flatnonzero(rows < 0)  # in a coarse cell that counts as of the other rock
    cube = _cube_of(centre[rest], *cubes, lower)
    rows[rest[cube >= 0]] = rock[cube[cube >= 0]]
    share = np.minimum(state["volume"].values[rows] / state["spacing"].values[rows] ** 3, 1.0)
    return rows, np.where(rows >= 0, share, 0.0)


def _cube_of(points: NDArray, centre: NDArray, edge: NDArray, lower: NDArray) -> NDArray:
    """Index (point,) of the cube that each point (point, 3) lies in, of cubes on a grid from `lower`; -1 for none."""
    cube = np.full(len(points), -1)
    for size in np.unique(edge):
        own = np.flatnonzero(edge == size)
        there, sought = (
            np.floor((places - lower) / size).astype(np.int64) @ NUMBERING for places in (centre[own], points)
        )
        order = np.argsort(there, kind="stable")
        at = np.minimum(np.searchsorted(there[order], sought), len(own) - 1)
        cube = np.where(there[order[at]] == sought, own[order[at]], cube)
    return cube
