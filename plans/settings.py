"""The section `hazard` of a mine file, and the slices of the stages."""

from itertools import pairwise
from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from catalogs.settings import DatedStep
from common.setting_types import AsTuple, Settings, Unit, real_number, refusal, refuse, whole_number

Label = Annotated[str, Field(min_length=1, max_length=40)]
Distance = Annotated[float, Unit("m", gt=0, le=1e5)]
Texts = Annotated[tuple[str, ...], AsTuple]
RunKind = Literal["own", "member", "coarse", "draw"]


class HazardSettings(Settings):
    """Classes of the mine's risk matrix: distances from openings, sizes of events, and chances per year."""

    distances: Annotated[tuple[Distance, ...], Field(min_length=1, max_length=6), AsTuple] = (20.0, 50.0)
    """Distances from an opening within which events count, the smallest first."""
    magnitudes: dict[Label, real_number(ge=-5, le=10)] = None
    """Moment magnitudes Mw of the classes of size, by name: {felt: 0.0, damaging: 1.0}. The seismic moment of a potency
    is that with the shear modulus of the host rock. Without them no chance is given."""
    likelihoods: dict[Label, real_number(ge=0, le=1)] = None
    """Least chance per year of the classes of likelihood, by name: {rare: 0, unlikely: 0.01, likely: 0.5}. One of them
    begins at 0."""

    runs: whole_number(ge=1, le=1001) = 5
    """Least number of runs of each plan: its own and those of an ensemble. `snakemake plans` adds runs where `ensemble`
    has fewer. Plans with fewer than 5 runs get no interval, no verdict and no chance."""
    rock: Literal["mine_file", "posterior"] = "mine_file"
    """Rock of the plans. `posterior`: each plan is also run in the rocks that the calibration has drawn, so that the
    intervals contain what the calibration leaves open. `snakemake calibrate` must have run before."""

    @model_validator(mode="after")
    def _in_order(self) -> Self:
        refusals = []
        for number, (first, second) in enumerate(pairwise(self.distances), 1):
            if not first < second:
                refusals.append(
                    refusal(f"{second:g} m is not larger than {first:g} m; give each distance once, in order",
                            "distances", number)
                )  # fmt: skip
        for key, least in (("magnitudes", None), ("likelihoods", 0.0)):
            classes = getattr(self, key)
            if classes is None:
                continue
            if not classes:
                refusals.append(refusal("there is no class; give one or leave the key out", key))
            elif least is not None and min(classes.values()) != least:
                refusals.append(refusal(f"no class begins at {least:g}; without one a small chance has no class", key))
            names: dict[float, str] = {}
            for name, value in classes.items():
                if value in names:
                    refusals.append(refusal(f"begins at {value:g} as {names[value]} does; leave one out", key, name))
                names[value] = name
        refuse(refusals)
        return self

    @property
    def sizes(self) -> dict[str, float]:
        """Magnitudes by name of their class, the smallest first; empty without any."""
        return dict(sorted((self.magnitudes or {}).items(), key=lambda one: one[1]))

    def likelihood(self, chance: float) -> str:
        """Name of the class of a chance per year; empty without classes or without a chance.

        >>> HazardSettings(likelihoods={"likely": 0.5, "rare": 0.0, "possible": 0.1}).likelihood(0.3)
        'possible'
        """
        reached = [(least, name) for name, least in (self.likelihoods or {}).items() if least <= chance]
        return max(reached)[1] if reached else ""


class Opening(Settings):
    """An excavation that the plan mines. One that it leaves planned is not listed."""

    name: str
    step: str = ""
    """the dated step that mines it; empty: mined before the first of them"""
    filled: str | None = None
    """the dated step that fills it; empty: filled before the first of them; None: not filled"""


class RunFiles(Settings):
    """The files of one run: those of the dated steps, in order."""

    kind: RunKind
    """own: the plan's run; member: of its ensemble; coarse: on cells of twice the size; draw: rock of the posterior"""
    events: Texts
    states: Texts = ()


class OutcomeSlice(Settings):
    """The slice of a plan's outcome.

    The runs of the mine itself, of its recorded steps, are compared with the record. Draws of the posterior stand in
    the same order in both lists, and in all plans; so do members.
    """

    mine: str
    plan: str
    steps: Annotated[tuple[DatedStep, ...], Field(min_length=1), AsTuple]
    openings: Annotated[tuple[Opening, ...], AsTuple]
    hazard: HazardSettings = HazardSettings()
    shear_modulus: Annotated[float, Field(gt=0)]
    """of the host rock, Pa"""
    runs: Annotated[tuple[RunFiles, ...], Field(min_length=1), AsTuple]
    """the plan's own first"""
    differs_in: Texts = ()
    """sections of the mine file in which the plan differs, apart from the sequence and its openings"""
    compared_runs: Annotated[tuple[RunFiles, ...], AsTuple] = ()
    """runs of the plans that it is compared with, each plan's own first: they share one floor and one law of sizes"""
    recorded_steps: Annotated[tuple[DatedStep, ...], AsTuple] = ()
    """the mine's own dated steps, with a record"""
    recorded_runs: Annotated[tuple[RunFiles, ...], AsTuple] = ()
    """the mine's own runs, its own first; their states are not read"""
    recorded_states: Texts = ()
    """states of the mine's own run in the recorded steps, whose measures the recorded numbers go by"""


class PlansReportSlice(Settings):
    """The slice of the page."""

    mine: str
    hazard: HazardSettings = HazardSettings()
    titles: dict[str, str] | None = None
    """by name of a plan"""


class ForecastFile(Settings):
    """A kept outcome.nc."""

    file: str


class ScoreSlice(Settings):
    """The slice of the scores of kept forecasts."""

    mine: str
    forecasts: Annotated[tuple[ForecastFile, ...], Field(min_length=1), AsTuple]
    steps: Annotated[tuple[DatedStep, ...], AsTuple] = ()
    """the mine's dated steps now"""
    openings: Annotated[tuple[Opening, ...], AsTuple] = ()
    """what the mine file now mines"""
