"""A stage's slice of the configuration as frozen dataclasses, in SI units, physically checked."""

from dataclasses import dataclass

import numpy as np

from mpm_core.constitutive.strength import residual_outside_intact, strength_row
from mpm_core.insitu import InsituStress
from mpm_core.settings import FACES, MaterialSettings, ShapeSettings, SolverSettings
from pipeline.errors import InputError
from pipeline.voigt import tensor_from_voigt

DRAFT_LEVELS = 2  # that a draft run's grid lacks (workflow/draft.py, gridding.failure_zone)
PLANES = {"xz": (0, 2), "xy": (0, 1), None: (0, 1, 2)}  # axes of the computation in the mine's frame


@dataclass(frozen=True)
class Strength:
    """One strength set: angles in degrees, cohesion and tension cut-off in Pa (None: no cut-off)."""

    friction_angle: float
    dilation_angle: float
    cohesion: float
    tension_cutoff: float | None


@dataclass(frozen=True)
class Material:
    """Elastic constants (Pa, kg/m3), and for Coulomb rock its intact and residual strength."""

    name: str
    youngs_modulus: float
    poisson_ratio: float
    density: float
    intact: Strength | None = None
    residual: Strength | None = None

    @property
    def lame_lambda(self) -> float:
        """First Lame parameter, Pa."""
        return self.youngs_modulus * self.poisson_ratio / ((1 + self.poisson_ratio) * (1 - 2 * self.poisson_ratio))

    @property
    def shear_modulus(self) -> float:
        """Shear modulus, Pa."""
        return self.youngs_modulus / (2 * (1 + self.poisson_ratio))


@dataclass(frozen=True)
class Excavation:
    """When a solid is mined and filled: indices into the stage's steps; fill None for a void."""

    name: str
    mined: int
    fill: str | None
    filled: int


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
class Scene:
    """All that the mechanics of one stage depends on. `steps` are the names of those up to this stage, in order."""

    mine: str
    plane: str | None
    thickness: float
    particles_per_cell: int
    cut_cells: str
    boundary: dict[str, str]
    insitu: InsituStress
    materials: dict[str, Material]
    rock_bodies: tuple[str, ...]
    excavations: tuple[Excavation, ...]
    loads: tuple[Load, ...]
    strains: tuple[BoundaryStrain, ...]
    steps: tuple[str, ...]
    solver: SolverSettings
    draft: bool = False
    """whether rock may fail in cells of any size: only to find out where"""
    perturbation: int = 0
    """number of the ensemble's member (see equilibrium.perturbation); 0: the mine's own run"""

    @property
    def axes(self) -> tuple[int, ...]:
        """Axes of the mine's frame that the computation uses: two in plane strain."""
        return PLANES[self.plane]

    @property
    def voigt(self) -> list[int]:
        """Voigt components of the mine's frame in the computation's order, whose third axis is out of the plane."""
        return [0, 2, 1, 3, 5, 4] if self.plane == "xz" else [0, 1, 2, 3, 4, 5]


def _strength(values: MaterialSettings, state: str) -> Strength:
    cutoff = values.tension_cutoff
    return Strength(
        getattr(values.friction_angle, state),
        getattr(values.dilation_angle, state),
        getattr(values.cohesion, state),
        None if cutoff == "none" else getattr(cutoff, state),
    )


def parse_material(name: str, values: MaterialSettings) -> Material:
    """One entry of `materials`."""
    elastic = (values.youngs_modulus, values.poisson_ratio, values.density)
    if values.model == "elastic":
        return Material(name, *elastic)
    return Material(name, *elastic, intact=_strength(values, "intact"), residual=_strength(values, "residual"))


def check_material(material: Material, allow_psi_above_phi: bool) -> None:
    """Raise InputError where a strength cannot be: residual outside intact, dilation above friction."""
    if material.intact is None:
        return
    intact, residual = material.intact, material.residual
    where = f"materials.{material.name}"
    rows = [strength_row(s.friction_angle, s.dilation_angle, s.cohesion, s.tension_cutoff) for s in (intact, residual)]
    for key in ("friction_angle", "cohesion", "tension_cutoff"):
        low, high = (getattr(strength, key) for strength in (residual, intact))
        if low is not None and high is not None and low > high:
            raise InputError(
                f"{where}.{key}: residual {low:g} is above intact {high:g}; rock gains no strength by failing"
            )
    reason = residual_outside_intact(*rows)
    if reason:
        raise InputError(f"{where}: {reason}")
    for state, strength in (("intact", intact), ("residual", residual)):
        if strength.dilation_angle > strength.friction_angle and not allow_psi_above_phi:
            raise InputError(
                f"{where}.dilation_angle.{state}: {strength.dilation_angle:g} deg is above the friction angle "
                f"{strength.friction_angle:g} deg, which creates energy; set allow_psi_above_phi: true if that is meant"
            )


def parse_scene(values: dict) -> Scene:
    """Build a Scene from a stage's configuration slice (plain SI values, see workflow/mine.py)."""
    given = {name: MaterialSettings.of(entry, f"materials.{name}") for name, entry in values["materials"].items()}
    materials = {name: parse_material(name, entry) for name, entry in given.items()}
    for name, entry in given.items():
        check_material(materials[name], entry.allow_psi_above_phi)
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
        materials=materials,
        rock_bodies=tuple(body["material"] for body in values["rock_bodies"]),
        excavations=tuple(Excavation(**entry) for entry in values["excavations"]),
        loads=tuple(_load(entry) for entry in values["loads"]),
        strains=tuple(
            BoundaryStrain(entry["name"], entry["since"], tuple(entry["strain"])) for entry in values.get("strains", [])
        ),
        steps=tuple(step["name"] for step in values["steps"]),
        solver=SolverSettings.of(values["solver"], "solver"),
        draft=values.get("draft", False),
        perturbation=values.get("perturbation", 0),
    )
    check_boundary(scene)
    check_strains(scene)
    return scene


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
                condition = scene.boundary.get(face)
                held = {"fixed": list(scene.axes), "roller": [axis]}.get(condition, [])
                # on a lower face x - lower has no component along its normal
                along = [other for other in scene.axes if side == 1 or other != axis]
                moves |= bool(tensor[np.ix_(held, along)].any())
        if not moves:
            raise InputError(
                f"strains.{entry.name}: moves no face that is held; give faces fixed or roller (domain.boundary), "
                "or a strain along what they hold"
            )


def check_virgin_stress(scene: Scene, lowest: float, highest: float) -> None:
    """Raise InputError if virgin rock stands above its intact strength anywhere between two elevations, m.

    N s1 - s3 and s1 are convex along a line of stresses, and stress is linear in depth: the ends decide.
    """
    for name in ("host",):
        material = scene.materials[name]
        if material.intact is None:
            continue
        strength = material.intact
        row = strength_row(strength.friction_angle, strength.dilation_angle, strength.cohesion, strength.tension_cutoff)
        for elevation in (lowest, highest):
            s3, _, s1 = np.linalg.eigvalsh(tensor_from_voigt(scene.insitu.at(elevation)))
            excess = max(row[0] * s1 - s3 - row[2], s1 - row[3])
            if excess > 0.0:
                raise InputError(
                    f"insitu_stress: at elevation {elevation:.10g} m virgin stress is {excess / 1e6:.3g} MPa above the "
                    f"intact strength of materials.{name}: it would fail before anything is mined; check stress, depth "
                    "and strength"
                )
