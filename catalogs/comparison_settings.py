"""The settings of the comparison and of an ensemble's spread; those of a record: catalogs.record_settings."""

from typing import Annotated, Any

from pydantic import Field

from catalogs.face_settings import FacePosition
from common.setting_types import AsTuple, Settings, whole_number


class ComparisonSettings(Settings):
    """How a modelled catalogue is compared with a recorded one."""

    resamplings: whole_number(ge=99, le=100_000) = 999
    """Number of resamplings of clusters of recorded events, and of the model's runs, for each interval and p-value."""
    seed: whole_number(ge=0, le=2**32 - 1) = 1
    """Seed of the random generator."""


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
    default: dict[str, Any]
    excavations: Annotated[tuple[Scheduled, ...], AsTuple]
    insitu: InsituStress


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
    largest_overstress: Annotated[float, Field(ge=0)]
    """that rock of a member may bear before it fails, as a share of its cohesion"""
    steps: Annotated[tuple[str, ...], AsTuple]
    """the dated ones"""
