"""The settings of the comparison and of an ensemble's spread; those of a record: catalogs.record_settings."""

from typing import Annotated, Any, Literal

from pydantic import Field

from pipeline.settings import AsTuple, Settings, Size, whole_number


class ComparisonSettings(Settings):
    """How a modelled catalogue is compared with a recorded one."""

    blocks: Literal["day", "step", "cluster", "event"] = "day"
    """what of a record is resampled: day | step | cluster | event (clustered events are not independent)"""
    block_days: Annotated[float, Field(ge=0.001, le=100_000)] = 1.0
    """length of a block, with blocks: day"""
    cluster_radius: Size = 20.0
    """how near events of a block are, with blocks: cluster"""
    resamplings: whole_number(ge=99, le=100_000) = 999
    """of blocks, for each interval"""
    seed: whole_number(ge=0, le=2**32 - 1) = 1
    """of all that is drawn"""
    maximum_events: whole_number(ge=100, le=5000) = 3000
    """of each catalogue in the comparison of locations, drawn at random beyond it; 1.1 GB, and with their square"""
    size_bin: Annotated[float, Field(ge=0.01, le=2)] = 0.2
    """of log10 P, in plots"""
    cut_step: Annotated[float, Field(ge=0.01, le=1)] = 0.1
    """of log10 P, in searching completeness and in b against the cut"""


class DatedStep(Settings):
    """A step whose events are in the catalogue: ISO dates, UTC, start <= time < end."""

    name: str
    start: str
    end: str


class ComparisonSlice(ComparisonSettings):
    """The slice of the comparison: its settings, and the dated steps in order."""

    steps: Annotated[tuple[DatedStep, ...], AsTuple] = ()


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
    """step at whose end the fill is placed; empty: while it is mined"""


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
    expected_hashes: dict[str, str]
    """config_hash that each dataset should carry, by its path"""
    insitu: InsituStress


class SpreadSettings(Settings):
    """The slice of an ensemble's spread."""

    mine: str
    members: Annotated[int, Field(ge=1)]
    steps: Annotated[tuple[str, ...], AsTuple]
    """the dated ones"""
