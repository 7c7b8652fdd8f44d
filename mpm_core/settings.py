"""The settings of the mechanics: those of a mine's configuration, and the slice that the grid is made from."""

import inspect
from typing import Annotated, Any, ClassVar, Literal, Self

from pydantic import BeforeValidator, Field, create_model, model_validator

from common.mine_grid import MineGrid
from common.setting_types import (
    AsTuple,
    Length,
    Name,
    Point,
    Settings,
    Size,
    Unit,
    choose,
    is_list,
    is_section,
    real_number,
    refusal,
    whole,
    whole_number,
)
from mpm_core.block_settings import PlacedBlocks
from mpm_core.geometry.shapes import SHAPES
from mpm_core.geometry.shapes.prism import DrawnPrism

FACES = ("x_lower", "x_upper", "y_lower", "y_upper", "z_lower", "z_upper")
MAX_LEVELS = 12  # sizes of cell
DEFAULT_COARSE_CELL = 10.0  # m; of a mine that gives no size of cell, with this number of levels
DEFAULT_LEVELS = 4
MAX_PARTS = 50  # of a solid in a file
Condition = Literal["fixed", "roller", "traction", "free"]
Angle = Annotated[float, Unit("deg", ge=0, lt=90)]
StrengthPart = Annotated[float, Unit("Pa", ge=0, le=1e13)]
Tolerance = real_number(ge=1e-15, le=0.1)
Many = whole_number(ge=1, le=1_000_000_000)


class Boundary(Settings):
    """Conditions by face or axis. `x` is both x_lower and x_upper. `others` is all faces that are not named; without it
    they are fixed."""

    x: Condition = None
    """Condition of both faces across x."""
    y: Condition = None
    """Condition of both faces across y."""
    z: Condition = None
    """Condition of both faces across z."""
    x_lower: Condition = None
    """Condition of the face at the lowest x."""
    x_upper: Condition = None
    """Condition of the face at the highest x."""
    y_lower: Condition = None
    """Condition of the face at the lowest y."""
    y_upper: Condition = None
    """Condition of the face at the highest y."""
    z_lower: Condition = None
    """Condition of the face at the lowest z."""
    z_upper: Condition = None
    """Condition of the face at the highest z."""
    others: Condition = None
    """Condition of all faces that are not named. Default: `fixed`."""

    @model_validator(mode="after")
    def _each_once(self) -> Self:
        for face in FACES:
            if {face, face[0]} <= self.model_fields_set:
                raise refusal(f"also given by '{face[0]}'; keep one of the two", face)
        return self

    def by_face(self) -> dict[str, str]:
        """Condition of each face."""
        others = self.others or "fixed"
        return {face: getattr(self, face) or getattr(self, face[0]) or others for face in FACES}


class DomainSettings(Settings):
    """The box of rock that is modelled. Without corners it follows from grid.finest_cell and from all excavations and
    loads, planned ones included. It is so large that its boundary changes no wall stress by more than 0.5 %, but it
    leaves out virgin rock above its strength."""

    lower: Point = None
    """Lower corner of the domain. Two coordinates in plane strain."""
    upper: Point = None
    """Upper corner of the domain. Its sides are whole multiples of grid.coarse_cell, or of grid.finest_cell."""
    boundary: choose(is_section, Boundary, Condition) = None
    """Condition of all faces: `fixed`, `roller`, `traction` (the face keeps its in-situ stress) or `free`; or by face:
    {x: roller, z_upper: free, others: fixed}. Default: `fixed`. A derived domain that reaches frame.surface ends there
    with a free top: give that face `free`, or leave boundary out."""


class GridSettings(Settings):
    """Size of the cells, and where they are small."""

    finest_cell: Size = None
    """Edge of the smallest cells. coarse_cell and levels follow from it. In a domain with corners the largest cells
    divide its sides; else there are at least four along its shortest side. Each size is twice the one before."""
    coarse_cell: Size = None
    """Edge of the largest cells. The sides of the domain are whole multiples of it. Default without finest_cell: 10 m,
    or 5, 2.5 or 1.25 m with fewer levels where that divides the domain and 10 m does not."""
    levels: whole_number(ge=1, le=MAX_LEVELS) = None
    """Number of cell sizes, each half the one before: 10, 5, 2.5, 1.25 m. Default without finest_cell: 4."""
    buffer_cells: whole_number(ge=0, le=100) = 3
    """Number of rings of cells, on each level, that are refined around an excavation."""
    particles_per_cell: Annotated[Literal[1, 4, 8, 9, 16, 25, 27, 64], BeforeValidator(whole)] = 1
    """Number of points per cell that carry stress: 1, 8 or 27 (in 2-D 1, 4 or 9). In cut cells the number follows from
    cut_cells."""
    refinement: Literal["adaptive", "static"] = "adaptive"
    """`adaptive`: cells are split to the finest size where rock is mined and where stress comes near its strength.
    `static`: cells are fine around all excavations from the start, and nowhere else. With solver.move the grid is
    always static."""
    max_cells: Many = 20_000_000
    """Largest number of cells of an adaptive grid. Where more would be needed, rock stays in coarse cells and the step
    is labelled truncated. The cells of openings are refined in any case."""
    cut_cells: Literal["mean", "whole", "subdivide"] = "mean"
    """Treatment of cells that a surface cuts. `mean`: each material has its share of the cell and acts at its true
    position. `whole`: a cell is inside or outside. `subdivide`: 64 points."""
    volume_error: real_number(ge=0) = 0.2
    """Largest difference between the volume of an excavation on the grid and that of its solid, as a share of the
    latter. A larger one is an error, and more than 0.05 is a warning in the report. From 1 on, openings with almost no
    whole cell are accepted, too, although the rock in their cut cells supports them; those too thin for any part of a
    cell are left out."""


class AnglePair(Settings):
    """Values of intact rock and of rock that has failed."""

    intact: Angle
    residual: Angle


class StrengthPair(Settings):
    """Values of intact rock and of rock that has failed."""

    intact: StrengthPart
    residual: StrengthPart


def lame_parameters(youngs_modulus: float, poisson_ratio: float) -> tuple[float, float]:
    """(lambda, shear modulus) in Pa from Young's modulus in Pa and Poisson's ratio; numbers or arrays.

    >>> lame_parameters(57e9, 0.25)
    (22800000000.0, 22800000000.0)
    """
    lame_lambda = youngs_modulus * poisson_ratio / ((1 + poisson_ratio) * (1 - 2 * poisson_ratio))
    return lame_lambda, youngs_modulus / (2 * (1 + poisson_ratio))


class MaterialSettings(Settings):
    """What all rocks and fills have. A law of failure (mpm_core.constitutive.laws) adds its strength."""

    model: str
    """Law of failure, or `elastic`."""
    youngs_modulus: Annotated[float, Unit("Pa", ge=1e-3, le=1e21)]
    """Young's modulus."""
    poisson_ratio: real_number(ge=0, le=0.4999)
    """Poisson's ratio."""
    density: Annotated[float, Unit("kg/m^3", ge=1e-3, le=1e6)]
    """Density."""

    @property
    def lame_lambda(self) -> float:
        """First Lame parameter, Pa."""
        return lame_parameters(self.youngs_modulus, self.poisson_ratio)[0]

    @property
    def shear_modulus(self) -> float:
        """Shear modulus, Pa."""
        return lame_parameters(self.youngs_modulus, self.poisson_ratio)[1]


class Variability(Settings):
    """Strength of intact rock that varies from place to place: a log-normal random field, the same on cells of all
    sizes. Each member of an ensemble has another one."""

    share: real_number(ge=0, le=0.5) = 0.1
    """Coefficient of variation of cohesion, tensile and uniaxial strength. 0: the rock is uniform, and the cells choose
    among the bands in which it may break as well."""
    length: Size = None
    """Distance over which strength varies: its correlation is exp(-(distance / length)^2). At least two of the finest
    cells, which is the default."""


class RockSettings(MaterialSettings):
    """What all rocks that can fail have."""

    variability: Variability = None
    """Strength that varies from place to place. Default: by 10 % in rock that loses strength when it fails."""


class ElasticMaterial(MaterialSettings):
    """Rock or fill that does not fail."""

    model: Literal["elastic"]


class SolverSettings(Settings):
    """How equilibrium is computed, and in which increments and generations rock fails."""

    renamed_keys: ClassVar = {"increment_error": "max_overshoot"}

    scheme: Literal["multigrid", "explicit"] = "multigrid"
    """`multigrid`: a multigrid solver computes equilibrium. `explicit`: damped explicit time steps lead to it."""
    tolerance: Tolerance = 1e-3
    """Unbalanced force at equilibrium, relative to the force that the step releases (2-norms)."""
    cascade_tolerance: Tolerance = 3e-3
    """Unbalanced force between two generations of failure, relative to the force that the step releases (2-norms).
    Where no rock loses strength it is 50 times as large, but at most 0.05."""
    parts: whole_number(ge=1, le=1000) = 8
    """Number of equal parts in which a step is mined, one after the other: its blasts, or weeks. Rock that fails in
    different parts makes different events. Increments end with their part, unless increments gives their number."""
    increments: whole_number(ge=0, le=1000) = 0
    """Number of equal increments in which a step is unloaded. 0: their size follows from max_overshoot. The first step
    always takes one: in its elastic state, all that it mines is mined."""
    max_overshoot: real_number(ge=0.001, le=1) = 0.2
    """Largest overshoot of the rock that fails first in an increment, relative to its drop of strength. It applies
    where increments is 0. A step's potency is too large by roughly this share."""
    max_iterations: Many = 40000
    """Largest number of iterations to one equilibrium; more is an error."""
    max_generations: Many = 2000
    """Largest number of generations of brittle failure in one increment. With more, the rock counts as not coming to
    equilibrium (see collapse)."""
    weakest_first: real_number(ge=0, le=1) = 0.0
    """0: all rock above its strength fails at once. 0.9: only rock with at least 0.9 of the largest overstress in the
    mine fails."""
    collapse: Literal["fall", "error", "keep"] = "fall"
    """What happens if the rock finds no equilibrium after a failure, or does not stop failing. `fall`: rock that has
    come loose falls, as if excavated, and the step goes on; where nothing has, or too much, the last equilibrium is the
    result, and no later step is computed. `error`: the run stops. `keep`: as `fall`, but nothing falls."""
    damping: real_number(ge=0, lt=1) = 0.7
    """Coefficient of local damping (Cundall) of the explicit scheme, usually 0.7 to 0.85."""
    density_scaling: bool = True
    """Whether the explicit scheme scales densities so that all cells share one time step. Weights stay true."""
    move: bool = False
    """Whether particles move through the grid. This needs scheme `explicit`, several particles per cell, and cut_cells
    `whole` or `subdivide`."""


class FileSettings(Settings):
    """A solid, or the outlines of prisms, in a file."""

    file: str
    """File of the solid: STL, OBJ, PLY, DXF, OMF or GOCAD (`.ts`), relative to the mine file. With shape `prism`: a DXF
    layer with outlines."""
    layer: str = None
    """Layer of a DXF drawing. "*": all layers."""
    element: str = None
    """OMF or GOCAD surface, OBJ object or group, or solid of a text STL. "*": all of them."""
    units: Literal["m", "cm", "mm", "km", "ft", "us_ft", "inch"] = None
    """Unit of the file's coordinates, where the file does not state it. Default: that of frame.grid, or m."""
    scale: real_number(ge=1e-6, le=1e6) = None
    """Scale factor: metres = coordinate x units x scale + offset."""
    offset: Annotated[tuple[Length, ...], Field(min_length=3, max_length=3), AsTuple] = None
    """Vector that is added to the scaled coordinates."""
    closed_at_ground: bool = False
    """Whether the surface of an excavation is open at the ground, as that of a pit, and closed at frame.surface. What
    it has above is cut off."""


class PartSettings(FileSettings):
    """A solid in a file, or a part of it."""

    part: Annotated[tuple[whole_number(ge=1, le=MAX_PARTS), ...], Field(min_length=2, max_length=2), AsTuple] = None
    """Part of the solid of a file that is meant: [2, 4] is the second of four parts of equal volume, in the order in
    which they are mined along advance."""
    advance: Annotated[float, Unit("deg", ge=-360, le=360)] = None
    """Direction in which the parts follow each other, clockwise from the map's north. Upright planes across it cut the
    solid."""


class _ShapeOrFile(Settings):
    """Base of the model that has the keys of all shapes."""

    @classmethod
    def meanings(cls) -> dict[str, str]:
        """A key of shapes means what it does to each that has it, named; others as for any settings."""
        users: dict[str, dict[str, list[str]]] = {}  # by key and meaning
        for model, name in _named_shapes().items():
            for key in model.model_fields:
                users.setdefault(key, {}).setdefault(model.meanings().get(key, ""), []).append(name)
        of_shapes = {
            key: " ".join(f"{', '.join(some).capitalize()}: {' '.join(text.split())}." for text, some in texts.items())
            for key, texts in users.items()
        }
        return PartSettings.meanings() | of_shapes | super().meanings()


def _named_shapes() -> dict[type[Settings], str]:
    """What the models of shapes are called."""
    names: dict[type[Settings], str] = {}
    for shapes in SHAPES.values():
        for name, model in shapes.items():
            names.setdefault(model, name)
    return names | {DrawnPrism: "prism from a file"}


def _keys_of_shapes() -> dict[str, Any]:
    """Type of each key that any shape has. One that is a point to some and a number to others is either."""
    types: dict[str, list] = {}
    for model in _named_shapes():
        annotations = inspect.get_annotations(model)
        for key in model.model_fields:
            types.setdefault(key, [])
            types[key] += [annotations[key]] if annotations[key] not in types[key] else []
    return {key: (kinds[0] if len(kinds) == 1 else choose(is_list, *kinds), None) for key, kinds in types.items()}


_KEYS: dict[str, Any] = {
    "shape": (Literal[tuple(dict.fromkeys(name for shapes in SHAPES.values() for name in shapes))], None),
    **{
        key: (annotation, None)
        for model in (FileSettings, PartSettings)
        for key, annotation in inspect.get_annotations(model).items()
    },
    **_keys_of_shapes(),
}
# Any: its keys are found as the program runs
ShapeSettings: Any = create_model(
    "ShapeSettings",
    __base__=_ShapeOrFile,
    __doc__="A solid: a shape with its own keys, or a file. The meaning of a key names the shapes that have it.",
    __module__=__name__,
    **_KEYS,
)


class SolidSettings(ShapeSettings):
    """A named solid."""

    name: Name
    """Name of the solid."""
    outside: bool = False
    """Whether the solid is the part of the domain outside the shape or file."""


class BodySettings(SolidSettings):
    """A volume of other rock."""

    refine: bool = False
    """Whether cells are small along the surface of the body."""


class PlacedSolid(SolidSettings):
    """A solid in the slice of a stage. Its shape is on the map; a file has the coordinates of the mine's grid."""

    grid: MineGrid = None
    """grid of the coordinates of its file, if that is not the map's"""
    closed_at: Length = None
    """elevation of the ground on the map at which its surface is closed, if it is open there"""


class PlacedBody(PlacedSolid, BodySettings):
    """A rock body in the slice of a stage."""


class GridDomain(Settings):
    """The domain as the grid knows it."""

    lower: Point
    upper: Point


RESIZED = {
    "draft": "accuracy: draft doubles those of the file; leave it out to have them",
    "fine": "accuracy: fine halves those of the file; leave it out to have them",
    "grid_convergence": "the companion run of grid_convergence doubles those of the mine",
}


class GridCells(GridSettings):
    """Cells as the grid's slice has them: sizes are known."""

    coarse_cell: Size = DEFAULT_COARSE_CELL
    levels: whole_number(ge=1, le=MAX_LEVELS) = DEFAULT_LEVELS
    resized_by: Literal["draft", "fine", "grid_convergence"] | None = None
    """what has made the finest cells larger or smaller than the mine's file says"""

    @property
    def finest(self) -> float:
        """Size of the finest cells, m."""
        return self.coarse_cell / 2 ** (self.levels - 1)

    def size_text(self) -> str:
        """Size of the finest cells, and what made it so."""
        size = f"{self.finest:g} m"
        return size + (f" ({RESIZED[self.resized_by]})" if self.resized_by else "")


class GridFarField(Settings):
    """What is expected of a derived domain: as mpm_core.scene.far_field.FarField has it."""

    distance: Length
    error: float
    radius: Size
    limited: Literal["", "memory", "strength"]


class GridSlice(Settings):
    """What grid.nc depends on: shapes, cells, the domain; no material, of steps only what the first one mines. In m."""

    name: str
    plane: Literal["xz", "xy"] | None
    thickness: Size
    domain: GridDomain
    grid: GridCells
    excavations: Annotated[tuple[PlacedSolid, ...], AsTuple]
    rock_bodies: Annotated[tuple[PlacedBody, ...], AsTuple]
    blocks: PlacedBlocks | None = None
    """block model of the rock"""
    later: Annotated[tuple[int, ...], AsTuple] = ()
    """numbers of the excavations that have no fine cells yet"""
    mined: Annotated[tuple[int, ...], AsTuple] = ()
    """of the picture of the solids: index of the step that mines each excavation, -1 where it is planned"""
    far_field: GridFarField | None = None
    """of a derived domain"""

    @property
    def dimension(self) -> int:
        """2 (plane strain) or 3."""
        return 2 if self.plane else 3
