"""The section `openings` of a mine file, and the slice of the stage of its table."""

from typing import Annotated, Literal

from pydantic import Field

from catalogs.settings import InsituStress
from common.setting_types import AsTuple, Point, Settings, Size

MIN_SLENDERNESS = 4.0  # Length over width from which an excavation counts as a drive.


class OpeningSettings(Settings):
    """What the table of openings gives."""

    chainage: Size = 5.0
    """Length of the stretches that a drive is divided into, along its centre line."""


class OpeningStep(Settings):
    """A step: its name, and its first date and the first one after it, empty where it has none."""

    name: str
    start: str
    end: str


class MinedOpening(Settings):
    """An excavation: its name, and the steps that mine and fill it, empty where none does."""

    name: str
    mined: str
    filled: str
    path: Annotated[tuple[Point, ...], Field(min_length=2), AsTuple] = None
    """points along it, m, if its shape has an axis"""


class OpeningSlice(Settings):
    """The slice of stage `openings`."""

    steps: Annotated[tuple[OpeningStep, ...], AsTuple]
    excavations: Annotated[tuple[MinedOpening, ...], AsTuple]
    insitu: InsituStress
    chainage: float
    """m"""


class OpeningRun(Settings):
    """A run of a plan: the files of its steps, in order."""

    kind: Literal["own", "member"]
    states: Annotated[tuple[str, ...], AsTuple]
    events: Annotated[tuple[str, ...], AsTuple]


class PlanOpeningSlice(OpeningSlice):
    """The slice of stage `plan_openings`."""

    plan: str
    runs: Annotated[tuple[OpeningRun, ...], Field(min_length=1), AsTuple]
    """the plan's own first"""
