"""A mine's configuration: the packages' settings in one model, and the workflow's own, such as names of steps."""

from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from baselines.settings import BaselineSettings
from calibration.settings import CalibrationSettings
from catalogs.records import AnyRecord
from catalogs.settings import ComparisonSettings, FaceSettings, ReportSettings
from common.frame import Frame
from common.setting_types import (
    AsTuple,
    Date,
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
    whole_number,
)
from mpm_core.block_settings import BlockModel
from mpm_core.constitutive.laws import AnyMaterial
from mpm_core.insitu_settings import InsituSettings, SymmetricTensor
from mpm_core.settings import (
    MAX_PARTS,
    BodySettings,
    DomainSettings,
    FileSettings,
    GridSettings,
    ShapeSettings,
    SolidSettings,
    SolverSettings,
)
from plans.settings import HazardSettings
from response.loading_settings import LoadingSettings
from response.observation_settings import ObservationSettings
from response.settings import OpeningSettings
from seismic.event_settings import SeismicSettings
from shaking.settings import GroundMotionSettings, Support

MINE_FILE_PLAN = "mine_file"  # name of the plan that the mine file itself is
Strain = real_number(ge=-0.5, le=0.5)
Pressure = Annotated[float, Unit("Pa", ge=0, le=1e13)]
ForcePart = Annotated[float, Unit("N", ge=-1e20, le=1e20)]


class RockBody(BodySettings):
    """A volume of other rock, such as an intrusion or a seam. Where several overlap, the last one counts."""

    material: str
    """Name of one of the materials."""


class Excavation(SolidSettings):
    """A solid that is mined. Where several overlap, the earliest step mines the rock."""

    step: str
    """Step in which the excavation is mined. `planned`: it is part of the grid, but is not mined."""
    fill: str = None
    """Name of the material that fills the excavation. `none`: it stays open."""
    filled: str = None
    """Step in which the fill is placed, in every part of the solid that stands open after this step's mining. The
    fill supports the walls while the step unloads rock. Without the key the fill is in place while the excavation's own
    step unloads rock: it supports the walls from the start, and fewer events result."""
    pressure: choose(
        lambda value: not is_section(value), Pressure, Annotated[dict[str, Pressure], Field(min_length=1)]
    ) = None
    """Pressure on the walls from inside. It starts with the step that mines the excavation and ends when it is filled.
    Pressures by step, each until the next: {history: 5 MPa, "2019-08": 0 MPa}."""

    @property
    def fill_material(self) -> str | None:
        """Name of the material that fills it; None where it stays open."""
        return None if self.fill == "none" else self.fill

    @property
    def fill_step(self) -> str:
        """Name of the step in which its fill is placed."""
        return self.step if self.filled is None else self.filled


class ExcavationsFrom(Settings):
    """Steps and excavations that are made from recorded data: the dated faces of a longwall."""

    source: Literal["elk_creek"]
    """Kind of the data."""
    folder: str
    """Folder with the data, relative to the mine file."""
    start: Date
    """First date of the period that is divided into steps. What was mined before it belongs to the step `history`."""
    end: Date
    """First date after the period. What was mined later is left out."""
    slices: choose(
        lambda value: isinstance(value, str) and value.isalpha(),
        Literal["month", "week"],
        Annotated[float, Unit("m", ge=1, le=1e6)],
    ) = "month"
    """What one step mines. `month`: a calendar month; steps are named like 2010-09. `week`: seven days from `start` on;
    steps are named by their first day. A length: an advance of about this length, in equal parts of the whole advance;
    steps are named by the advance at their start. Between two dated faces the advance is taken as even."""
    gob_height: Size = None
    """Height of the caved ground. Default: 18 m."""
    floor: Length = None
    """Elevation of the floor of the caved ground, everywhere the same. In cells as large as the caved ground is high, a
    floor that dips has steps, at which rock supports the roof. Default: the floor is on the seam, which dips."""
    fill: str = None
    """Name of the material that fills the excavations. Default: `gob`."""


class ScheduledSolids(FileSettings):
    """Files of solids whose bodies the table names."""

    file: str
    """DXF, OMF, GOCAD (`.ts`), OBJ, STL or PLY file, relative to the mine file. `*` in its name stands for any text.
    The bodies are the layers of a DXF, the surfaces of an OMF or GOCAD file, the objects of an OBJ (groups where it has
    none), the solids of a text STL. The table may call the only body of a file by the file's name without its
    ending."""
    layer: str = None
    """Layers of a DXF drawing that are bodies. `*` stands for any text. Default: all layers with faces. A layer that is
    off or frozen is a body only if the table names it."""
    element: str = None
    """Bodies of an OMF, GOCAD, OBJ or text STL file. `*` stands for any text. Default: all."""
    parts: whole_number(ge=2, le=MAX_PARTS) = None
    """Number of parts of equal volume into which advance cuts each body, so that several steps mine it: an even rate
    from the start to the end of its row, each part in the step in which it ends. Default: a body is one excavation."""
    advance: Annotated[float, Unit("deg", ge=-360, le=360)] = None
    """Direction in which bodies are mined, clockwise from the map's north. Needed with parts."""

    @model_validator(mode="after")
    def _has_direction(self) -> Self:
        if (self.parts is None) != (self.advance is None):
            given, missing = ("parts", "advance") if self.advance is None else ("advance", "parts")
            raise refusal(f"stands without {missing}; give both, or leave both out", given)
        return self


class ScheduleColumns(Settings):
    """Names of the table's columns, by what they hold. The columns of body and end are needed. Others that have the
    default name may be absent."""

    body: str = "body"
    """Column of the body's name. Capitals do not matter."""
    start: str = "start"
    """Column of the first day of mining. Needed with `period: table`."""
    end: str = "end"
    """Column of the day on which mining ends, or the word `history` or `planned`."""
    filled: str = "filled"
    """Column of the day on which the fill is placed, or the word `history` or `planned`. Empty: it is not placed yet.
    The fill acts from the first step that begins on this day or later, after the step that mines the body."""
    fill: str = "fill"
    """Column of the name of the material that fills the body, or `none`. Empty: see schedule.fill."""
    period: str = None
    """Column of the names of the steps, with `period: table`. Default: steps are named by their first day."""


class Schedule(Settings):
    """A table of dates and files of solids, from which excavations and steps are made. An excavation follows from each
    body, in the order of the files, whatever the order of the rows. Its name is that of the body, with `_` in place of
    what is no letter, digit, - or _. `excavations` may list further ones, which name the same steps."""

    file: str
    """The table, a CSV or an Excel file, relative to the mine file. It has one row for each body."""
    sheet: str = None
    """Sheet of an Excel file. Default: the first one."""
    solids: Annotated[tuple[ScheduledSolids, ...], Field(min_length=1), AsTuple]
    """Files of the solids. Each body in them needs a row."""
    columns: ScheduleColumns = None
    """Names of the table's columns. Default: body, start, end, filled, fill."""
    date_order: Literal["day", "month"] = None
    """What dates such as 03/04/2024 begin with. Default: found from days above 12. Dates such as 2024-04-03, 3-Apr-2024
    and those of Excel need no key."""
    ends: Literal["last_day", "day_after"] = "last_day"
    """What the end of a row is. `last_day`: the last day of mining. `day_after`: the first day after it."""
    period: Literal["month", "week", "quarter", "table"] = "month"
    """What one step mines. `month`: a calendar month, named like 2024-03. `quarter`: named like 2024-Q1. `week`: seven
    days from `start` on, named by the first day; without `start` weeks begin on Monday. `table`: rows with the same
    start and end are one step."""
    start: Date = None
    """First date that belongs to a dated step. Bodies that end before it are mined in `history`. Default: the beginning
    of the period in which the first body ends."""
    end: Date = None
    """First date after the last step. Bodies that end later are `planned`. Default: the end of the period in which the
    last body ends."""
    fill: str = None
    """Material of bodies whose row has a fill date and names no material."""


class Load(ShapeSettings):
    """A force on the rock in a shape, distributed by volume. It acts from a step on. Laboratory specimens have
    loads."""

    name: Name
    """Name of the load."""
    step: str
    """Step from which the force acts."""
    force: choose(
        is_list,
        Annotated[tuple[ForcePart, ...], Field(min_length=3, max_length=3), AsTuple],
        Annotated[float, Unit("N", gt=0, le=1e20)],
    )
    """Total force: its components along x, y and z of the mine file, or with `toward` the sum of the magnitudes of its
    parts."""
    toward: choose(
        lambda value: is_list(value) and len(value) > 0 and is_list(value[0]),
        Annotated[tuple[Point, ...], Field(min_length=2, max_length=2), AsTuple],
        Point,
    ) = None
    """Point to which each part of the force points. With two points each part points to the line through them."""


class StrainComponents(SymmetricTensor[Strain]):
    """Components of a strain. Shear components are tensor shear."""

    @model_validator(mode="after")
    def _some(self) -> Self:
        if not self.model_fields_set:
            raise refusal("{} should be non-empty")
        return self


class BoundaryStrain(Settings):
    """A strain of the boundary: from a step on, fixed faces are displaced by strain . (x - domain.lower)."""

    name: Name
    """Name of the strain."""
    step: str
    """Step from which the strain acts."""
    strain: StrainComponents


class Step(Settings):
    """A mining step. Steps without dates are history and come first."""

    name: Name
    """Name of the step. Excavations name it."""
    start: Date = None
    """First date of the step."""
    end: Date = None
    """First date after the step."""

    @property
    def is_dated(self) -> bool:
        """Whether its events enter the catalogue."""
        return self.start is not None


class ExcavationChange(Settings):
    """What a plan changes of an excavation of the mine file. A key that is left out stays as it is."""

    step: str = None
    """Step in which the plan mines the excavation. `planned`: the plan leaves it."""
    fill: str = None
    """Name of the material that fills the excavation. `none`: it stays open."""
    filled: str = None
    """Step in which the fill is placed."""


class MiningPlan(Settings):
    """Another sequence of the mine, which `snakemake plans` lays beside that of the mine file."""

    title: Annotated[str, Field(min_length=1, max_length=80)] = None
    """Title of the plan on the page."""
    excavations: Annotated[dict[Name, ExcavationChange], Field(min_length=1)] = None
    """Changes by the name of the excavation. An excavation that a plan alone mines stands in the mine file with the
    step `planned`."""
    steps: Annotated[tuple[Step, ...], AsTuple] = None
    """Steps that differ from those of the mine file. One of the same name replaces that of the mine file; others
    follow after its last step."""
    file: str = None
    """Another mine file, relative to this one, in place of changes. Its `name` and its plans do not count."""

    @model_validator(mode="after")
    def _one_kind(self) -> Self:
        changes = [change for change in (self.excavations or {}).values() if change.model_fields_set]
        if self.file is None and not changes and not self.steps:
            raise refusal("changes nothing; give excavations, steps, or the file of another mine file")
        if self.file is not None and self.model_fields_set - {"file", "title"}:
            raise refusal("stands beside changes; write them into that file", "file")
        names = [step.name.lower() for step in self.steps or ()]
        for number, step in enumerate(self.steps or ()):
            if step.name.lower() in names[:number]:
                raise refusal(f"{step.name} stands twice; steps need names of their own", "steps", number, "name")
        return self


class AccuracyRequest(Settings):
    """What a run may cost, or how wrong it may be: cells follow from it (`snakemake quote`)."""

    error: Annotated[float, Unit("%", ge=1.0, le=60.0)] = None
    """Largest error of potency and of failed volume that the cells may leave, as study openings measures it."""
    time: Annotated[float, Unit("min", ge=0.1, le=1e6)] = None
    """Longest time that the run may take on this machine."""
    memory: Annotated[float, Unit("GB", ge=0.1, le=1e6)] = None
    """Largest memory that the run may take."""

    @model_validator(mode="after")
    def _asks(self) -> Self:
        if not self.given():
            raise refusal("asks for nothing; give error, time or memory")
        return self


class MineSettings(Settings):
    """All of a mine's configuration."""

    name: Name
    """Name of the mine. Results go to the folder of this name in `results`."""
    plane: Literal["none", "xz", "xy"] = "none"
    """`none`: the scene is three-dimensional. `xz`, `xy`: plane strain, in a vertical section with depth along z, or in
    plan without weight."""
    thickness: Size = 1.0
    """Thickness of a plane-strain scene, for volumes and potency."""
    accuracy: choose(is_section, AccuracyRequest, Literal["draft", "standard", "fine"]) = "standard"
    """`standard`: the mine file is used unchanged. `draft`: cells of twice the size, unless an excavation would have
    almost no whole cells then; tolerances three times as large; an allowed overshoot twice as large. `fine`: cells of
    half the size, an allowed overshoot half as large. `{error: 10 %}`, `{time: 20 min}`, `{memory: 8 GB}`, or several
    of them: the cells that this needs; the cells of the file are where the search begins."""
    ensemble: whole_number(ge=0, le=1000) = 0
    """Number of runs in addition to the mine's own run, each with another random strength. Each takes as long. They
    show how much chance changes the catalogue."""
    grid_convergence: bool = None
    """Whether the mine is also run on cells of twice the size, so that the report can state how uncertain the cells
    leave its numbers. Default: true in 3-D if steps have dates. A draft has no such run."""
    frame: Frame
    domain: DomainSettings = DomainSettings()
    grid: GridSettings = GridSettings()
    insitu_stress: InsituSettings
    materials: dict[Name, AnyMaterial]
    """Rocks and fills by name. `host` is all rock outside of rock_bodies and of the blocks of block_model."""
    rock_bodies: Annotated[tuple[RockBody, ...], AsTuple] = ()
    block_model: BlockModel = None
    excavations: Annotated[tuple[Excavation, ...], AsTuple] = ()
    excavations_from: ExcavationsFrom = None
    schedule: Schedule = None
    loads: Annotated[tuple[Load, ...], AsTuple] = ()
    strains: Annotated[tuple[BoundaryStrain, ...], AsTuple] = ()
    steps: Annotated[tuple[Step, ...], AsTuple] = ()
    solver: SolverSettings = SolverSettings()
    seismic: SeismicSettings = SeismicSettings()
    face: FaceSettings = None
    """The dated face of a longwall or a tunnel. Events of model and record are then also compared by their place
    relative to it, and recorded months are moved with it as a baseline."""
    comparison: ComparisonSettings = ComparisonSettings()
    report: ReportSettings = ReportSettings()
    """Planes through the mine that the report shows."""
    record: AnyRecord = None
    """The recorded catalogue: its file, and the meaning of its contents."""
    calibration: CalibrationSettings = None
    """What `snakemake calibrate` fits to the record."""
    baselines: BaselineSettings = BaselineSettings()
    """What `snakemake baselines` assumes of flaws in the rock."""
    plans: dict[Name, MiningPlan] = Field(default={})
    """Other mining sequences by name. `snakemake plans` computes them and compares them with that of the mine file."""
    forecasts: Annotated[tuple[str, ...], AsTuple] = ()
    """Kept forecasts, relative to the mine file: files of `results/<mine>/forecasts`, made before their months were
    recorded. The report scores them once these are recorded."""
    openings: OpeningSettings = OpeningSettings()
    """What the table of openings gives."""
    observations: ObservationSettings = None
    """Places at which the model is read, and what instruments measured there."""
    loading_measures: LoadingSettings = None
    """Energy that mining releases, plastic work, loading stiffness and excess shear stress, by step, opening and plane.
    With it the run makes `loading.csv`, and a section of the report."""
    hazard: HazardSettings = HazardSettings()
    """Classes of sizes, distances and chances that the plans are judged by."""
    ground_motion: GroundMotionSettings = None
    """Peak ground velocity at openings. With it the run makes `shaking.csv`, and a section of the report."""
    support: Support = ()
    """Classes of support with the capacities that you state. The report names the weakest one that carries the demand
    of ground_motion."""

    @model_validator(mode="after")
    def _host(self) -> Self:
        if "host" not in self.materials:
            raise refusal("missing key", "materials", "host")
        return self

    @model_validator(mode="after")
    def _one_plan(self) -> Self:
        sources = [name for name in ("excavations_from", "schedule") if getattr(self, name)]
        if len(sources) == 2:
            raise refusal("steps follow from excavations_from already; leave one of the two out", "schedule")
        if sources and self.steps:
            raise refusal(f"follow from {sources[0]}; leave them out", "steps")
        return self
