"""The section `baselines` of a mine file, and the slices of the stages."""

from typing import Annotated, Self

from pydantic import Field, model_validator

from catalogs.settings import ComparisonSlice, DatedStep
from common.frame import Frame
from common.setting_types import AsTuple, Date, Settings, Size, Unit, real_number, refusal, whole_number
from mpm_core.settings import Angle, StrengthPart

Radii = Annotated[tuple[Size, ...], Field(min_length=2, max_length=2), AsTuple]
Corner = Annotated[tuple[float, ...], Field(min_length=3, max_length=3), AsTuple]
PlanCorner = Annotated[tuple[float, ...], Field(min_length=2, max_length=2), AsTuple]
Exponent = real_number(gt=0, le=10)
Seed = whole_number(ge=0, le=2**32 - 1)


class BaselineSettings(Settings):
    """What `snakemake baselines` assumes of the flaws in the rock."""

    radii: Radii = None
    """Smallest and largest radius of the seeded flaws. Default: half of the finest cell, and six times the finest
    cell."""
    exponent: Exponent = 2.0
    """Exponent D of the seeded flaws: the number with a radius above a falls as a^-D. It sets b of their sizes,
    D / 3 in log P."""
    friction_angle: Angle = None
    """Friction angle of flaws. Shear stress above this friction counts as excess. Default: the residual one of the
    rock; needed where a rock that can fail has none."""
    cohesion: StrengthPart = None
    """Mean cohesion of flaws before they slip; slip takes it. Default: the residual one of the rock; needed where a
    rock that can fail has none."""
    seed: Seed = 1
    """Seed of the random generator."""
    since: Date = None
    """First date of the record that earlier months are taken from, UTC. Default: the first dated step. Give an earlier
    one if the record begins before the dated steps."""

    complete_above: Annotated[float, Unit("m^3", gt=0, le=1e20)] = None
    """Potency from which recorded events count in maps, alarms and numbers of earlier months: above it the network
    missed no event. Default: the cut of the comparison, which events of the model have to reach, too."""

    @model_validator(mode="after")
    def _in_order(self) -> Self:
        if self.radii is not None and not self.radii[0] < self.radii[1]:
            raise refusal(
                f"{self.radii[0]:g} m to {self.radii[1]:g} m is empty; give the smaller radius first", "radii"
            )
        return self


class FlawStrength(Settings):
    """Coulomb strength of the flaws in one rock: friction angle, degrees, and cohesion before slip, Pa."""

    friction_angle: Angle
    cohesion: StrengthPart


class StressSlice(Settings):
    """The slice of excess shear stress; states, record and comparison are inputs of their own."""

    mine: str
    strength: dict[str, FlawStrength]
    """by name of the rock; in others nothing slips"""
    steps: Annotated[tuple[DatedStep, ...], AsTuple]
    """the dated ones, whose states are the last ones given"""
    lower: Corner = None
    """corner of the box that the record is taken from, m; absent: the whole domain"""
    upper: Corner = None
    seed: Seed


class FlawSlice(StressSlice):
    """The slice of the seeded flaws."""

    radii: Radii
    exponent: Exponent


class Drive(Settings):
    """An excavation that is mined, which may be a drive."""

    name: str
    step: str = ""
    """the dated step that mines it; empty: mined before the first of them"""
    filled: str | None = None
    """the dated step that fills it; empty: filled before the first of them; None: not filled"""
    path: Annotated[tuple[Annotated[tuple[float, ...], AsTuple], ...], AsTuple] = None
    """points along it, m, if its shape has an axis"""


class BaselineReportSlice(Settings):
    """The slice of the page."""

    mine: str
    comparison: ComparisonSlice
    """as the mine's own comparison has it"""
    planned: Annotated[tuple[str, ...], AsTuple] = ()
    """names of the excavations that no step mines"""
    drives: Annotated[tuple[Drive, ...], AsTuple] = ()
    """excavations that are mined; those that are drives follow from their axes or cells"""
    flaws: FlawSlice
    box: Annotated[tuple[PlanCorner, ...], Field(min_length=2, max_length=2), AsTuple]
    """lower and upper corner in plan, m, of the box of the uniform rate that maps are compared with"""
    since: str = ""
    """first date of the earlier record; empty: the first dated step"""
    complete_above: Annotated[float, Field(gt=0)] | None = None
    """potency from which recorded events count in maps, alarms and numbers, m3; absent: the cut of the comparison"""
    frame: Frame | None = None
    """place of the mine on Earth, for forecasts that pyCSEP reads; absent: it has none"""
    depths: Annotated[tuple[float, ...], Field(min_length=2, max_length=2), AsTuple] = (0.0, 0.0)
    """top and bottom of the domain, m below sea level"""
