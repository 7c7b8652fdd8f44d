"""The settings of the mechanics: those of a mine's configuration, and the slice that the grid is made from."""

from typing import Annotated, Literal, Self

from pydantic import BeforeValidator, Field, model_validator

from pipeline.settings import (
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

FACES = ("x_lower", "x_upper", "y_lower", "y_upper", "z_lower", "z_upper")
Condition = Literal["fixed", "roller", "traction", "free"]
Stress = Annotated[float, Unit("Pa", ge=-1e13, le=1e13)]
Gradient = Annotated[float, Unit("Pa/m", ge=-1e12, le=1e12)]
Angle = Annotated[float, Unit("deg", ge=0, lt=90)]
StrengthPart = Annotated[float, Unit("Pa", ge=0, le=1e13)]
Tolerance = real_number(ge=1e-15, le=0.1)
Corner = Annotated[tuple[Length, ...], Field(min_length=2, max_length=2), AsTuple]
Many = whole_number(ge=1, le=1_000_000_000)


class Boundary(Settings):
    """Conditions by face or axis; `x` is both x_lower and x_upper, `others` all that are not named (else fixed)."""

    x: Condition = None
    y: Condition = None
    z: Condition = None
    x_lower: Condition = None
    x_upper: Condition = None
    y_lower: Condition = None
    y_upper: Condition = None
    z_lower: Condition = None
    z_upper: Condition = None
    others: Condition = None

    @model_validator(mode="after")
    def _each_once(self) -> Self:
        for face in FACES:
            if {face, face[0]} <= self.model_fields_set:
                raise refusal(f"also given by '{face[0]}'; keep one of the two", face)
        return self


class DomainSettings(Settings):
    """The box that is modelled. Without corners it follows from grid.finest_cell and all excavations and loads, planned
    ones too: large enough that its boundary moves no wall stress by more than 0.5 %, but not into virgin rock that
    stands above its strength."""

    lower: Point = None
    """its lower corner; two coordinates in plane strain"""
    upper: Point = None
    """its upper corner; the sides are whole multiples of grid.coarse_cell, or of grid.finest_cell"""
    boundary: choose(is_section, Boundary, Condition) = None
    """fixed | roller | traction (keeps in-situ stress) | free; or by face: {x: roller, z_upper: free, others: fixed}.
    fixed unless given; a domain that is derived and reaches frame.surface ends there, with its top free (say so, or
    leave boundary out)"""


class GridSettings(Settings):
    """Cells: how large, and where they are small."""

    finest_cell: Size = None
    """edge of the smallest cells; coarse_cell and levels follow: from a domain with corners the largest cells, each
    twice the one before, that divide its sides, else at least four along its shortest side"""
    coarse_cell: Size = None
    """edge of the largest cells; the sides of the domain are whole multiples of it; 10 m where finest_cell does not say
    it, and 5, 2.5 or 1.25 m with fewer levels where that divides the domain and 10 m does not"""
    levels: whole_number(ge=1, le=12) = None
    """sizes of cell, each half the one before: 10, 5, 2.5, 1.25 m; 4 where finest_cell does not say it"""
    buffer_cells: whole_number(ge=0, le=100) = 3
    """rings of cells, on each level, that are refined around an excavation"""
    particles_per_cell: Annotated[Literal[1, 4, 8, 9, 16, 25, 27, 64], BeforeValidator(whole)] = 1
    """1, 8, 27 (in 2-D 1, 4, 9): points per cell that carry stress; a cut cell has what cut_cells says"""
    refinement: Literal["adaptive", "static"] = "adaptive"
    """adaptive (cells are split to the finest where rock is mined and where it comes near its strength) | static (fine
    around all excavations from the start, and nowhere else; also where particles move)"""
    max_cells: Many = 20_000_000
    """of an adaptive grid: where it would have more, rock stays in coarse cells, and the step is labelled truncated;
    cells of openings are made all the same"""
    cut_cells: Literal["mean", "whole", "subdivide"] = "mean"
    """cells crossed by a surface: mean (each material has its share of the cell and acts where it is) | whole (in or
    out) | subdivide (64 points)"""
    volume_error: real_number(ge=0) = 0.2
    """share of its volume by which the grid may miss an excavation; more is an error, 0.05 a banner. From 1 on openings
    of which almost nothing fills a whole cell are let through, too: the rock in their cells props them; and those too
    thin for any part of a cell are left out"""


class StressComponents(Settings):
    """Components of a stress, tension positive; what is not given is zero."""

    xx: Stress = None
    yy: Stress = None
    zz: Stress = None
    yz: Stress = None
    xz: Stress = None
    xy: Stress = None


class GradientComponents(Settings):
    """Their change per metre of depth below frame.surface; compression is negative."""

    xx: Gradient = None
    yy: Gradient = None
    zz: Gradient = None
    yz: Gradient = None
    xz: Gradient = None
    xy: Gradient = None


class InsituSettings(Settings):
    """Stress in place: constant + gradient x depth."""

    constant: StressComponents
    gradient: GradientComponents = None


class AnglePair(Settings):
    """Of intact rock, and of rock that has failed."""

    intact: Angle
    residual: Angle


class StrengthPair(Settings):
    """Of intact rock, and of rock that has failed."""

    intact: StrengthPart
    residual: StrengthPart


class MaterialSettings(Settings):
    """What all rocks and fills have. A law of failure (mpm_core.constitutive.laws) adds its strength."""

    model: str
    youngs_modulus: Annotated[float, Unit("Pa", ge=1e-3, le=1e21)]
    poisson_ratio: real_number(ge=0, le=0.4999)
    density: Annotated[float, Unit("kg/m^3", ge=1e-3, le=1e6)]

    @property
    def lame_lambda(self) -> float:
        """First Lame parameter, Pa."""
        return self.youngs_modulus * self.poisson_ratio / ((1 + self.poisson_ratio) * (1 - 2 * self.poisson_ratio))

    @property
    def shear_modulus(self) -> float:
        """Shear modulus, Pa."""
        return self.youngs_modulus / (2 * (1 + self.poisson_ratio))


class ElasticMaterial(MaterialSettings):
    """Rock or fill that does not fail."""

    model: Literal["elastic"]


class SolverSettings(Settings):
    """How equilibrium is sought."""

    scheme: Literal["multigrid", "explicit"] = "multigrid"
    """multigrid (solves for equilibrium) | explicit (damped explicit stepping)"""
    tolerance: Tolerance = 1e-3
    """unbalanced force at rest over the force that the step releases, 2-norms"""
    cascade_tolerance: Tolerance = 3e-3
    """the same between two generations of failure; where no rock loses strength 50 times as much, up to 0.05"""
    increments: whole_number(ge=0, le=1000) = 0
    """parts in which the rock of one step is taken out; 0: as many as increment_error asks for"""
    increment_error: real_number(ge=0.001, le=1) = 0.2
    """where increments is 0: overshoot of the rock that fails first in each, over its drop: at most about the share by
    which a step's potency is too large"""
    max_iterations: Many = 40000
    """of one relaxation; more is an error"""
    max_generations: Many = 2000
    """of brittle failure in one increment; more is a collapse"""
    weakest_first: real_number(ge=0, le=1) = 0.0
    """0: all rock above strength fails at once; 0.9: only what has 0.9 of the overstress nearby"""
    collapse: Literal["error", "keep"] = "error"
    """rock that finds no rest after a failure, or fails on: error | keep (the last state of rest, the last step)"""
    damping: real_number(ge=0, lt=1) = 0.7
    """local damping (Cundall), 0.7 to 0.85"""
    density_scaling: bool = True
    """densities such that all cells share one time step; weights stay real"""
    hourglass: real_number(ge=0, le=1) = 0.05
    """Flanagan-Belytschko stiffness, share kappa, 0.001 to 1; of cells with one particle per material"""
    move: bool = False
    """particles move through the grid (needs scheme explicit, several per cell, and cut_cells: whole or subdivide)"""


class ShapeSettings(Settings):
    """A solid: a shape with its own keys, or a file. Which keys a shape takes: mpm_core.geometry.shapes."""

    shape: Literal["box", "tunnel", "cylinder", "sphere", "prism", "circle", "polygon"] = None
    file: str = None
    """STL, OBJ, PLY, DXF or OMF, relative to the mine file; with shape prism the outline of a DXF layer"""
    layer: str = None
    """of a DXF drawing, "*" all"""
    element: str = None
    """OMF surface, OBJ object or group, solid of a text STL; "*" all"""
    units: Literal["m", "cm", "mm", "km", "ft", "us_ft", "inch"] = None
    """of the file's coordinates, where it does not say them itself"""
    scale: real_number(ge=1e-6, le=1e6) = None
    """metres = coordinate x units x scale + offset"""
    offset: Annotated[tuple[Length, ...], Field(min_length=3, max_length=3), AsTuple] = None
    lower: choose(is_list, Point, Length) = None
    """box: corner; prism: elevation"""
    upper: choose(is_list, Point, Length) = None
    """box: corner; prism: elevation"""
    path: Annotated[tuple[Point, ...], Field(min_length=2), AsTuple] = None
    """tunnel: points along the middle of its floor"""
    width: Size = None
    """tunnel"""
    height: Size = None
    """tunnel; prism from a file: above each of its polylines"""
    profile: Literal["rectangular", "arched"] = None
    """tunnel"""
    start: Point = None
    """cylinder: middle of an end"""
    end: Point = None
    """cylinder: middle of the other end"""
    center: Point = None
    """sphere, circle"""
    radius: Size = None
    """cylinder, sphere, circle"""
    polygon: Annotated[tuple[Corner, ...], Field(min_length=3), AsTuple] = None
    """prism: its outline in plan"""
    points: Annotated[tuple[Point, ...], Field(min_length=3), AsTuple] = None
    """polygon"""
    base: Annotated[tuple[Length, ...], AsTuple] = None
    """prism: an elevation for each point of its polygon"""
    top: Annotated[tuple[Length, ...], AsTuple] = None
    """prism: an elevation for each point of its polygon"""


class SolidSettings(ShapeSettings):
    """A named solid."""

    name: Name
    outside: bool = False
    """what the shape or file leaves of the domain, not what it holds"""


class BodySettings(SolidSettings):
    """A volume of other rock."""

    refine: bool = False
    """whether cells are small along its surface"""


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

    coarse_cell: Size = 10.0
    levels: whole_number(ge=1, le=12) = 4
    resized_by: Literal["draft", "fine", "grid_convergence"] | None = None
    """what has made the finest cells larger or smaller than the mine's file says"""

    def told(self) -> str:
        """Size of the finest cells, and what made it so."""
        size = f"{self.coarse_cell / 2 ** (self.levels - 1):g} m"
        return size + (f" ({RESIZED[self.resized_by]})" if self.resized_by else "")


class GridFarField(Settings):
    """What is expected of a derived domain: as mpm_core.far_field.FarField has it."""

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
    excavations: Annotated[tuple[SolidSettings, ...], AsTuple]
    rock_bodies: Annotated[tuple[BodySettings, ...], AsTuple]
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
