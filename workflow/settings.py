"""A mine's configuration: the packages' settings in one model, and what the workflow adds, names of steps above all."""

from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from catalogs.record_settings import RecordSettings
from catalogs.settings import ComparisonSettings
from mpm_core.constitutive.laws import AnyMaterial
from mpm_core.settings import (
    BodySettings,
    DomainSettings,
    GridSettings,
    InsituSettings,
    ShapeSettings,
    SolidSettings,
    SolverSettings,
)
from pipeline.frame import Frame
from pipeline.settings import (
    AsTuple,
    Date,
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
    whole_number,
)
from seismic.settings import SeismicSettings

Strain = real_number(ge=-0.5, le=0.5)
Pressure = Annotated[float, Unit("Pa", ge=0, le=1e13)]
ForcePart = Annotated[float, Unit("N", ge=-1e20, le=1e20)]


class RockBody(BodySettings):
    """A volume of other rock (an intrusion, a seam); of overlapping ones the later counts."""

    material: str
    """one of materials"""


class Excavation(SolidSettings):
    """A solid that is mined; where they overlap the earliest step mines."""

    step: str
    """that mines it, or planned: it shapes the grid now and is mined when it gets a step"""
    fill: str = None
    """one of materials, or none: it stays a void"""
    filled: str = None
    """step at whose end the fill is placed, in all that then stands open within the solid; without it the fill stands
    in the opening while the same step unloads the rock: walls lean on it from the start, and fewer events come of it"""
    pressure: choose(
        lambda value: not is_section(value), Pressure, Annotated[dict[str, Pressure], Field(min_length=1)]
    ) = None
    """on its walls, from inside: from the step that mines it until it is filled; or from each of several steps on,
    until the next of them: {history: 5 MPa, "2019-08": 0 MPa}"""


class ExcavationsFrom(Settings):
    """Excavations that are made from recorded data."""

    source: Literal["elk_creek"]
    folder: str
    """with the data, relative to the mine file"""
    gob_height: Size = None
    """of caved ground, 18 m unless given"""
    fill: str = None
    """one of materials; gob unless given"""


class Load(ShapeSettings):
    """A force on the rock in a shape, shared by volume, from a step on: laboratory specimens."""

    name: Name
    step: str
    force: choose(
        is_list,
        Annotated[tuple[ForcePart, ...], Field(min_length=3, max_length=3), AsTuple],
        Annotated[float, Unit("N", gt=0, le=1e20)],
    )
    """in all: its components, or with toward the sum of its parts' sizes"""
    toward: choose(
        lambda value: is_list(value) and len(value) > 0 and is_list(value[0]),
        Annotated[tuple[Point, ...], Field(min_length=2, max_length=2), AsTuple],
        Point,
    ) = None
    """a point that each part of the force points to, or two points: to their line"""


class StrainComponents(Settings):
    """Components of a strain, tensor shear."""

    xx: Strain = None
    yy: Strain = None
    zz: Strain = None
    yz: Strain = None
    xz: Strain = None
    xy: Strain = None

    @model_validator(mode="after")
    def _some(self) -> Self:
        if not self.model_fields_set:
            raise refusal("{} should be non-empty")
        return self


class BoundaryStrain(Settings):
    """Held faces move by strain . (x - domain.lower) from a step on."""

    name: Name
    step: str
    strain: StrainComponents


class Step(Settings):
    """A time in which mining goes on; steps without dates are history and come first."""

    name: Name
    start: Date = None
    end: Date = None


class MineSettings(Settings):
    """All of a mine's configuration."""

    name: Name
    """results go to the folder of this name in `results`"""
    plane: Literal["none", "xz", "xy"] = "none"
    """none: 3-D. Plane strain: xz (a section, depth along z) or xy (a plan, weightless)"""
    thickness: Size = 1.0
    """of a plane strain scene, for volumes and potency"""
    accuracy: Literal["draft", "standard", "fine"] = "standard"
    """standard: as the mine file says; draft: cells of twice the size, unless hardly any of them would lie in some
    excavation, tolerances three times as loose, overshoot of increments doubled; fine: cells of half the size,
    overshoot halved"""
    ensemble: whole_number(ge=0, le=1000) = 0
    """perturbed runs beside the mine's own, each as long: how far brittle failure spreads by itself"""
    grid_convergence: bool = None
    """the same run on cells of twice the size beside the mine's own: the report says from both what cells leave
    uncertain; unless given, in 3-D where steps have dates; a draft has none"""
    frame: Frame
    domain: DomainSettings = None
    grid: GridSettings = GridSettings()
    insitu_stress: InsituSettings
    materials: dict[Name, AnyMaterial]
    """rocks and fills; host is all rock that is in no body"""
    rock_bodies: Annotated[tuple[RockBody, ...], AsTuple] = ()
    excavations: Annotated[tuple[Excavation, ...], AsTuple] = ()
    excavations_from: ExcavationsFrom = None
    loads: Annotated[tuple[Load, ...], AsTuple] = ()
    strains: Annotated[tuple[BoundaryStrain, ...], AsTuple] = ()
    steps: Annotated[tuple[Step, ...], AsTuple] = ()
    solver: SolverSettings = SolverSettings()
    seismic: SeismicSettings = SeismicSettings()
    comparison: ComparisonSettings = ComparisonSettings()
    record: RecordSettings = None

    @model_validator(mode="after")
    def _host(self) -> Self:
        if "host" not in self.materials:
            raise refusal("missing key", "materials", "host")
        return self
