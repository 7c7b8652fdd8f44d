"""The settings of a moving face, of the comparison, of an ensemble's spread and of the report."""

from typing import Annotated, Any, Literal, Self

from pydantic import Field, model_validator

from catalogs.records.times import parse_time
from common.errors import InputError
from common.mine_grid import MineGrid
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
    refusal,
    short,
    whole_number,
)

ALL_STEPS = "all"  # Name, in addition to those of the steps, of all dated steps together.

PlanPoint = Annotated[tuple[Length, ...], Field(min_length=2, max_length=2), AsTuple]


class FacePosition(Settings):
    """Where a face stands on a day."""

    date: Date
    """Day of the position, UTC."""
    ends: choose(
        lambda value: is_list(value) and len(value) > 0 and is_list(value[0]),
        Annotated[tuple[PlanPoint, ...], Field(min_length=2, max_length=2), AsTuple],
        PlanPoint,
    )
    """Both ends of the face in plan, x and y, such as the headgate and the tailgate. For a tunnel one point: the end
    of its centre line."""
    panel: str = None
    """Name of the panel. Between positions of one panel the face moves evenly; between panels there is none."""

    @model_validator(mode="after")
    def _has_date_and_length(self) -> Self:
        try:
            parse_time(self.date, "date")
        except InputError as error:
            raise refusal(f"{short(self.date)} is no date; give one such as 2019-08-31", "date") from error
        if is_list(self.ends[0]) and self.ends[0] == self.ends[1]:
            raise refusal("both ends are one point; give different ones, or the point alone", "ends")
        return self

    @property
    def is_line(self) -> bool:
        """Whether it has two ends."""
        return is_list(self.ends[0])

    @property
    def middle(self) -> tuple[float, ...]:
        """Middle of the ends, m."""
        if not self.is_line:
            return self.ends
        return tuple(0.5 * (one + other) for one, other in zip(*self.ends, strict=True))


class FaceSettings(Settings):
    """A face that moves, such as that of a longwall or a tunnel."""

    positions: Annotated[tuple[FacePosition, ...], Field(min_length=1), AsTuple] = None
    """Dated positions, for each panel in their order of time."""
    source: Literal["elk_creek"] = None
    """Kind of the recorded data that the positions are read from, in place of `positions`."""
    folder: str = None
    """Folder with these data, relative to the mine file."""

    @model_validator(mode="after")
    def _one_kind(self) -> Self:
        if (self.positions is None) == (self.source is None):
            raise refusal("give either positions, or source and folder")
        if (self.source is None) != (self.folder is None):
            raise refusal("stands without the other of source and folder; give both", "folder")
        for name, panel in by_panel(self.positions or ()).items():
            _check_panel(name, panel)
        return self


def by_panel(positions: tuple[FacePosition, ...]) -> dict[str, list[FacePosition]]:
    """The positions of each panel; "" is the one without a name."""
    found: dict[str, list[FacePosition]] = {}
    for position in positions:
        found.setdefault(position.panel or "", []).append(position)
    return found


def _check_panel(name: str, positions: list[FacePosition]) -> None:
    """Refuse a panel whose face has no direction, positions that are out of order, and both kinds in one panel."""
    named = f" of panel '{name}'" if name else ""
    dates = [parse_time(position.date, "face.positions") for position in positions]
    for position, before, date in zip(positions[1:], dates, dates[1:], strict=False):
        if not before < date:
            raise refusal(f"{position.date}{named} does not come after the position before it; order them", "positions")
    if len({position.is_line for position in positions}) > 1:
        raise refusal(f"some{named} have two ends and some are one point; give all in one form", "positions")
    if len({position.middle for position in positions}) < 2:
        raise refusal(f"those{named} do not move; give two places at least, which tell what lies ahead", "positions")


class ComparisonSettings(Settings):
    """How a modelled catalogue is compared with a recorded one."""

    resamplings: whole_number(ge=99, le=100_000) = 999
    """Number of resamplings of clusters of recorded events, and of the model's runs, for each interval and p-value."""
    seed: whole_number(ge=0, le=2**32 - 1) = 1
    """Seed of the random generator."""


class SectionPlane(Settings):
    """A plane through the mine that the report shows: by point, strike and dip, or upright along an excavation."""

    name: Name
    """Name of the section in the report."""
    point: Annotated[Point, Field(min_length=3)] = None
    """A point of the plane: x, y and z of the mine file. Distances in the section count from it."""
    strike: Annotated[float, Unit("deg", ge=-360, le=360)] = None
    """Direction of the plane's horizontal line, clockwise from the map's north. The plane dips to the right of it."""
    dip: Annotated[float, Unit("deg", ge=0, le=90)] = None
    """Angle between the plane and the horizontal: 90 deg is upright."""
    excavation: str = None
    """Name of an excavation, in place of point, strike and dip: the plane is upright, through its middle, along the
    direction in plan in which it is longest."""
    within: Size = None
    """Largest distance from the plane of the events that are drawn. Default: five of the finest cells."""

    @model_validator(mode="after")
    def _one_kind(self) -> Self:
        keys = ("point", "strike", "dip")
        given = [key for key in keys if getattr(self, key) is not None]
        if self.excavation is not None and given:
            raise refusal("stands beside excavation, which gives the plane; leave one of the two out", given[0])
        if self.excavation is None and len(given) < len(keys):
            missing = next(key for key in keys if key not in given)
            raise refusal("missing key: give point, strike and dip, or excavation", missing)
        return self


class ReportSettings(Settings):
    """What the report shows beyond what it always has."""

    sections: Annotated[tuple[SectionPlane, ...], AsTuple] = ()
    """Planes that the report shows with failed rock, strength factor and the events near them."""

    @model_validator(mode="after")
    def _named(self) -> Self:
        names = [section.name.lower() for section in self.sections]
        for number, name in enumerate(names):
            if name in names[:number]:
                raise refusal("stands twice; sections need names of their own", "sections", number, "name")
        return self


class DatedStep(Settings):
    """A step whose events are in the catalogue: ISO dates, UTC, start <= time < end."""

    name: str
    start: str
    end: str


class ComparisonSlice(ComparisonSettings):
    """The slice of the comparison: its settings, the dated steps in order, how many members the ensemble has, and the
    positions of the face if the mine gives one."""

    steps: Annotated[tuple[DatedStep, ...], AsTuple] = ()
    members: Annotated[int, Field(ge=0)] = 0
    face: Annotated[tuple[FacePosition, ...], AsTuple] = ()


class MinedStep(Settings):
    """A step as the picture of the scene has it."""

    name: str
    dated: bool
    excavations: Annotated[tuple[str, ...], AsTuple]
    """names of what it mines"""


class PictureSlice(Settings):
    """The slice of the picture of the scene: the steps in order."""

    steps: Annotated[tuple[MinedStep, ...], AsTuple]


class Scheduled(Settings):
    """When an excavation is mined and filled."""

    name: str
    step: str = ""
    fill: str = "none"
    filled: str = ""
    """step that places the fill; empty: the step that mines the excavation"""


class InsituStress(Settings):
    """The stress before mining, linear in depth, for the report."""

    constant: Annotated[tuple[float, ...], AsTuple]
    """Voigt components at the surface, Pa, tension positive"""
    gradient: Annotated[tuple[float, ...], AsTuple]
    """of depth, Pa/m"""
    surface: float
    """elevation, m"""


class ReportSlice(Settings):
    """The slice of the report."""

    config: dict[str, Any]
    """as the user wrote it, defaults included"""
    default: dict[str, Any] = None
    """for the marks of what differs"""
    excavations: Annotated[tuple[Scheduled, ...], AsTuple] = None
    """when each is mined, if not as `config` says"""
    insitu: InsituStress = None
    mine_grid: MineGrid = None
    """grid of the mine's own coordinates, if it is not the map"""
    grid_text: str = ""
    """how that grid lies on the map, in words"""
    sections: Annotated[tuple[SectionPlane, ...], AsTuple] = ()
    """planes that are shown, on the map"""
    foreseen: dict[str, Any] = None
    """what a request (accuracy) was told before the run: quotes `own`, `half` for half of the error; for what run"""


class GridConvergenceSettings(Settings):
    """The slice of the comparison with a run on cells of twice the size."""

    mine: str
    steps: Annotated[tuple[str, ...], AsTuple]
    """the dated ones"""
    cells: Annotated[tuple[float, float], AsTuple]
    """edges of the finest cells of both runs, m, the mine's own first"""


class SpreadSettings(Settings):
    """The slice of an ensemble's spread."""

    mine: str
    members: Annotated[int, Field(ge=1)]
    variability: Annotated[float, Field(gt=0)]
    """largest coefficient of variation of the strength of a rock"""
    steps: Annotated[tuple[str, ...], AsTuple]
    """the dated ones"""
