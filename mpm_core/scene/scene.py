"""A stage's slice of the configuration as frozen dataclasses, in SI units, physically checked.

Virgin stress is linear in depth, with the body force that balances it.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from common.errors import InputError
from common.voigt import tensor_from_voigt
from mpm_core.block_settings import PlacedBlocks
from mpm_core.constitutive.laws import Materials, can_fail, law_of
from mpm_core.settings import FACES, MaterialSettings, PlacedSolid, ShapeSettings, SolverSettings

PLANES = {"xz": (0, 2), "xy": (0, 1), None: (0, 1, 2)}  # axes of the computation in the mine's frame


@dataclass(frozen=True)
class InsituStress:
    """sigma0 = constant + gradient * D, with depth D = surface - z (paper, Table 2; tension positive).

    constant (6,) Pa, gradient (6,) Pa/m in Voigt order xx, yy, zz, yz, xz, xy; surface: elevation of D = 0, m.
    """

    constant: np.ndarray
    gradient: np.ndarray
    surface: float

    def at(self, elevation: ArrayLike) -> np.ndarray:
        """Virgin stress (..., 6) Pa at elevations z (...) m."""
        depth = self.surface - np.asarray(elevation, float)
        stress = self.gradient * depth[..., None]
        stress += self.constant
        return stress

    @property
    def body_force(self) -> np.ndarray:
        """b = -div sigma0, (3,) N/m3: what keeps the virgin field in equilibrium, whether or not it equals gravity.

        With D = surface - z only z derivatives remain: d sigma/dz = -gradient, so b_i = gradient_iz.
        """
        return self.gradient[[4, 3, 2]].copy()

    @property
    def weightless(self) -> bool:
        """True if the field is uniform, so that nothing weighs anything."""
        return not np.any(self.gradient)


@dataclass(frozen=True)
class Excavation:
    """The steps in which a solid is mined and filled: indices into the stage's steps; fill None for a void.

    pressure: (step, Pa) pairs, the pressure on its walls from that step on, steps ascending.
    """

    name: str
    mined: int
    fill: str | None
    filled: int
    pressure: tuple[tuple[int, float], ...] = ()

    def pressure_at(self, step: int) -> float:
        """Pressure inside once `step` is mined and filled, Pa; 0 before it is mined and once it is filled."""
        if not 0 <= self.mined <= step or (self.fill is not None and 0 <= self.filled <= step):
            return 0.0
        return next((value for since, value in reversed(self.pressure) if since <= step), 0.0)


@dataclass(frozen=True)
class Load:
    """A total force N shared by volume among the rock particles inside a shape, from step `since` on.

    force: its components (3,), or, with `toward` a point (d,) m or two points of a line (2, d) m, the sum of the sizes
    of forces that all point there, to the line by the shortest way.
    """

    name: str
    since: int
    force: tuple[float, float, float] | float
    toward: tuple | None
    shape: ShapeSettings


@dataclass(frozen=True)
class BoundaryStrain:
    """A homogeneous strain of the domain from step `since` on, (6,) in Voigt order, tensor shear.

    Held components of the boundary move by strain . (x - lower corner of the domain); strains add up.
    """

    name: str
    since: int
    strain: tuple[float, ...]


@dataclass(frozen=True)
class Refinement:
    """Cells that follow the rock: rings of fine cells around what is mined, most cells, rock bodies and a block
    model."""

    rings: int
    max_cells: int
    bodies: tuple[PlacedSolid, ...]
    blocks: PlacedBlocks | None = None


@dataclass(frozen=True)
class Scene:
    """All that the mechanics of one stage depends on. `steps` are the names of those up to this stage, in order."""

    mine: str
    plane: str | None
    thickness: float
    particles_per_cell: int
    cut_cells: str
    boundary: dict[str, str]
    insitu: InsituStress
    materials: dict[str, MaterialSettings]
    rock_bodies: tuple[str, ...]
    excavations: tuple[Excavation, ...]
    loads: tuple[Load, ...]
    strains: tuple[BoundaryStrain, ...]
    steps: tuple[str, ...]
    solver: SolverSettings
    refinement: Refinement | None = None
    """how cells are split in a step; None: they are not"""
    realization: int = 0
    """number of the random field of strength (model/variability.py): the ensemble's member; 0: the mine's own run"""

    @property
    def axes(self) -> tuple[int, ...]:
        """Axes of the mine's frame that the computation uses: two in plane strain."""
        return PLANES[self.plane]

    @property
    def frame_axes(self) -> tuple[int, int, int]:
        """Axis of the mine's frame along each axis of the computation, whose third is out of the plane in 2-D."""
        first, second, third = (*self.axes, *({0, 1, 2} - set(self.axes)))
        return first, second, third

    @property
    def voigt(self) -> list[int]:
        """Voigt components of the mine's frame in the computation's order, whose third axis is out of the plane."""
        return [0, 2, 1, 3, 5, 4] if self.plane == "xz" else [0, 1, 2, 3, 4, 5]


def parse_scene(values: dict) -> Scene:
    """Build a Scene from a stage's configuration slice (plain SI values, see workflow/mine.py). Raises InputError."""
    if "solver" not in values or "insitu_stress" not in values:
        raise InputError("not the settings of stage elastic or step; jobs stand in results/<mine>/jobs")
    stress = values["insitu_stress"]
    scene = Scene(
        mine=values["name"],
        plane=values["plane"],
        thickness=float(values["thickness"]) if values["plane"] else 1.0,
        particles_per_cell=int(values["particles_per_cell"]),
        cut_cells=values["cut_cells"],
        boundary=values["boundary"],
        insitu=InsituStress(
            np.array(stress["constant"], float), np.array(stress["gradient"], float), float(values["surface"])
        ),
        materials=Materials.of({"materials": values["materials"]}).materials,
        rock_bodies=tuple(body["material"] for body in values["rock_bodies"]),
        excavations=tuple(_excavation(entry) for entry in values["excavations"]),
        loads=tuple(_load(entry) for entry in values["loads"]),
        strains=tuple(
            BoundaryStrain(entry["name"], entry["since"], tuple(entry["strain"])) for entry in values.get("strains", [])
        ),
        steps=tuple(step["name"] for step in values["steps"]),
        solver=SolverSettings.of(values["solver"], "solver"),
        refinement=_refinement(values.get("refinement")),
        realization=values.get("realization", 0),
    )
    check_boundary(scene)
    check_strains(scene)
    return scene


def _excavation(entry: dict) -> Excavation:
    pressure = tuple((int(since), float(value)) for since, value in entry.get("pressure", ()))
    return Excavation(**entry | {"pressure": pressure})


def _refinement(entry: dict | None) -> Refinement | None:
    if entry is None:
        return None
    bodies = tuple(PlacedSolid.of(body, "rock_bodies") for body in entry["bodies"])
    blocks = PlacedBlocks.of(entry["blocks"], "block_model") if "blocks" in entry else None
    return Refinement(entry["rings"], entry["max_cells"], bodies, blocks)


def _load(entry: dict) -> Load:
    force, toward = entry["force"], entry.get("toward")
    return Load(
        entry["name"],
        entry["since"],
        force if toward else tuple(force),
        tuple(toward) if toward else None,
        ShapeSettings.of(entry["shape"], f"loads.{entry['name']}"),
    )


def check_boundary(scene: Scene) -> None:
    """Raise InputError for boundaries that hold nothing up in a scene that has weight."""
    faces = [face for axis in scene.axes for face in FACES[2 * axis : 2 * axis + 2]]
    holding = [
        face
        for face in faces
        if scene.boundary.get(face) == "fixed" or (scene.boundary.get(face) == "roller" and face.startswith("z"))
    ]
    if not holding and 2 in scene.axes and not scene.insitu.weightless:
        raise InputError(
            "domain.boundary: no face holds the rock up, and this stress field has weight (insitu_stress.gradient); "
            "give z_lower fixed or roller, or fix a side"
        )


def check_strains(scene: Scene) -> None:
    """Raise InputError for a boundary strain that moves no held face, or with particles that move."""
    for entry in scene.strains:
        if scene.solver.move:
            raise InputError(
                f"strains.{entry.name}: the boundary cannot be strained while particles move through the grid; "
                "set solver.move: false"
            )
        tensor = tensor_from_voigt(entry.strain)
        moves = False
        for axis in scene.axes:
            for side, face in enumerate(FACES[2 * axis : 2 * axis + 2]):
                condition = scene.boundary.get(face, "")
                held = {"fixed": list(scene.axes), "roller": [axis]}.get(condition, [])
                # on a lower face x - lower has no component along its normal
                along = [other for other in scene.axes if side == 1 or other != axis]
                moves |= bool(tensor[np.ix_(held, along)].any())
        if not moves:
            raise InputError(
                f"strains.{entry.name}: moves no face that is held; give faces fixed or roller (domain.boundary), "
                "or a strain along what they hold"
            )


def virgin_excess(rock: MaterialSettings, insitu: InsituStress, elevation: float) -> float:
    """Overstress of virgin rock over its intact strength at an elevation, Pa; 0 or less where it bears its stress,
    everywhere if it cannot fail."""
    if not can_fail(rock):
        return 0.0
    law = law_of(rock)
    intact, _ = law.strength_rows(rock, (0, 1, 2))
    return law.overstress_of_tensor(tensor_from_voigt(insitu.at(elevation)), intact)


def virgin_stress(scene: Scene, position: np.ndarray) -> np.ndarray:
    """Virgin stress (n, 6) Pa in the computation's axes at positions (n, d)."""
    axes, insitu = list(scene.axes), scene.insitu
    elevation = position[:, axes.index(2)] if 2 in axes else np.full(len(position), insitu.surface)
    own = replace(insitu, constant=insitu.constant[scene.voigt], gradient=insitu.gradient[scene.voigt])
    return own.at(elevation)


def virgin_body_force(scene: Scene) -> np.ndarray:
    """b = -div sigma0 (d,) N/m3 in the computation's axes; a plan section ("xy") is uniform and weightless."""
    axes = list(scene.axes)
    return scene.insitu.body_force[axes] if 2 in axes else np.zeros(len(axes))
