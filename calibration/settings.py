"""The section `calibration` of a mine file: what is calibrated within which ranges, and how many trials are run."""

import math
import re
from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from common.quantities import QUANTITY_PATTERN
from common.setting_types import KEY_PATTERN, AsTuple, Settings, Unit, choose, real_number, refusal, whole_number

Terms = Literal["potency", "number", "places", "sizes", "instruments"]
INSTRUMENTS = "instruments"  # The term that is no part of the catalogue.
EVENT_SECTION = "seismic."  # Keys that begin so change events, and not the rock: no run is needed for other values.
STRENGTH = re.compile(
    r"(?P<material>materials\.[A-Za-z0-9_-]+)\.cohesion\.(?P<state>intact|residual)"
)  # A cohesion and what belongs to it.


def friction_key(cohesion: str) -> str:
    """Key of the friction angle that belongs to a cohesion's key; empty where the key is of something else."""
    match = STRENGTH.fullmatch(cohesion)
    return f"{match['material']}.friction_angle.{match['state']}" if match else ""


def strength_under(confinement: float, cohesion: float, friction: float) -> float:
    """Largest compression (Pa) that Coulomb rock bears under a confinement (Pa): q p + 2 c sqrt(q).

    cohesion c in Pa; friction: angle in degrees, q = (1 + sin) / (1 - sin) of it.

    >>> strength_under(0.0, 2e6, 30.0) / 1e6  # 2 c sqrt(3)
    6.928203230275509
    """
    sine = math.sin(math.radians(friction))
    slope = (1.0 + sine) / (1.0 - sine)
    return slope * confinement + 2.0 * cohesion * math.sqrt(slope)


def cohesion_of(strength: float, confinement: float, friction: float) -> float:
    """Cohesion (Pa) of Coulomb rock with this strength (Pa) under a confinement (Pa): the inverse of `strength_under`.

    Negative where the friction alone bears more.
    """
    alone = strength_under(confinement, 0.0, friction)
    return (strength - alone) / strength_under(0.0, 1.0, friction)


RangeEnd = choose(lambda value: isinstance(value, str), str, float)


class CalibratedQuantity(Settings):
    """A quantity of the mine file that trials change within a range. Its prior is uniform."""

    key: Annotated[str, Field(pattern=KEY_PATTERN)]
    """Key of the quantity, from the top of the mine file: materials.host.cohesion.residual. An entry of a list is
    called by its name: rock_bodies.dyke.material."""
    range: Annotated[tuple[RangeEnd, ...], Field(min_length=2, max_length=2), AsTuple]
    """Smallest and largest value, both in the same unit."""
    confinement: Annotated[float, Unit("Pa", ge=0, le=1e10)] = None
    """With a cohesion only: the range is that of the largest principal stress (compression) at failure under this
    confinement. The cohesion follows from it and the friction angle. A record often tells this strength, and neither
    cohesion nor friction by itself."""
    scale: Literal["linear", "log"] = "linear"
    """`log`: the logarithm of the quantity is uniform under the prior."""
    source: Annotated[str, Field(min_length=1)]
    """Where the range comes from: a laboratory report, a paper, a judgement."""

    @model_validator(mode="after")
    def _ordered(self) -> Self:
        low, high = self.bounds
        if not low < high:
            raise refusal(f"{self.range[0]} to {self.range[1]} is empty; give the smaller value first", "range")
        if self.scale == "log" and low <= 0.0:
            raise refusal("a range with scale log must lie above 0", "range")
        if self.confinement is not None and not STRENGTH.fullmatch(self.key):
            raise refusal(
                "only a cohesion (materials.<name>.cohesion.<state>) can be given by a strength", "confinement"
            )
        return self

    @property
    def title(self) -> str:
        """Title of the quantity on the page: its key, or the strength that it stands for."""
        match = STRENGTH.fullmatch(self.key)
        if self.confinement is None or match is None:
            return self.key
        return f"{match['material']}: {match['state']} strength under {self.confinement / 1e6:g} MPa"

    @property
    def changes_events_only(self) -> bool:
        """True if the rock is the same for all values."""
        return self.key.startswith(EVENT_SECTION)

    def _parts(self) -> tuple[list[float], str]:
        """Numbers of both ends and their unit. Raises PydanticCustomError where the units differ."""
        numbers, units = [], []
        for end in self.range:
            match = QUANTITY_PATTERN.fullmatch(str(end).strip())
            if not match:
                raise refusal(f"{end!r} is not a number, with or without a unit", "range")
            numbers.append(float(match["number"]))
            units.append((match["unit"] or "").strip())
        if units[0] != units[1]:
            raise refusal(f"both ends need the same unit, here '{units[0]}' and '{units[1]}'", "range")
        return numbers, units[0]

    @property
    def bounds(self) -> tuple[float, float]:
        """Ends of the range, in `unit`."""
        low, high = self._parts()[0]
        return low, high

    @property
    def unit(self) -> str:
        """The unit of the range; empty for a number without one."""
        return self._parts()[1]

    def value(self, share: float) -> float:
        """Value, in `unit`, at a share of the range, 0 to 1."""
        low, high = self.bounds
        if self.scale == "log":
            return math.exp(math.log(low) + share * (math.log(high) - math.log(low)))
        return low + share * (high - low)

    def share(self, value: float) -> float:
        """Share of the range at which a value, in `unit`, lies: the inverse of `value`."""
        low, high = self.bounds
        if self.scale == "log":
            return math.log(value / low) / math.log(high / low)
        return (value - low) / (high - low)

    def written(self, share: float) -> str | float:
        """Value at a share of the range, as a mine file has it."""
        number = float(f"{self.value(share):.6g}")
        return f"{number:.6g} {self.unit}" if self.unit else number


class CalibrationSettings(Settings):
    """How uncertain quantities of a mine are calibrated to its record (`snakemake calibrate`)."""

    quantities: Annotated[tuple[CalibratedQuantity, ...], Field(min_length=1, max_length=8), AsTuple]
    """What is calibrated."""
    trials: whole_number(ge=4, le=1000) = 40
    """Number of trials that fill the ranges evenly. Each is a run of the mine with other values of the quantities;
    about ten for each quantity are enough in most cases."""
    batches: whole_number(ge=0, le=20) = 0
    """Number of further batches of trials. Each batch is placed where the trials before it leave the prediction of the
    record most uncertain."""
    batch_trials: whole_number(ge=1, le=100) = 8
    """Number of trials of a further batch."""
    replicates: whole_number(ge=0, le=50) = 4
    """Number of further runs in the middle of the ranges that differ by chance only. They tell chance from effect."""
    cells: Literal["doubled", "own"] = "doubled"
    """`own`: trials have the mine's own cells. `doubled`: they have cells of twice the size, which is several times as
    fast."""
    pairs: whole_number(ge=2, le=50) = 4
    """Number of trials with doubled cells that are also run on the mine's own cells. They tell what the cells
    change."""
    terms: Annotated[tuple[Terms, ...], Field(min_length=1), AsTuple] = ("potency", "number")
    """What counts. Of the record, `potency` and `number`: the summed potency and the number of events of each step;
    `places`: where the events of each step are; `sizes`: the mean logarithm of their potency above the cut.
    `instruments`: readings of the instruments in `observations`, with the record or alone. By default they stay out, so
    that they can test the calibrated mine."""
    complete_above: Annotated[float, Unit("m^3", gt=0, le=1e20)] = None
    """Potency from which the record is complete: above it the network missed no event. Default: estimated from the
    recorded sizes, where they tell it."""
    model_error: real_number(ge=0, le=2) = 0.1
    """Standard deviation of the natural logarithm of potency and number that each step of the model has beside its
    cells and chance: errors of the plan, the stress and the law. What the model gives at an instrument has a factor
    with this deviation, too."""
    seed: whole_number(ge=0, le=2**32 - 1) = 1
    """Seed of the random generator."""

    @property
    def catalogue_terms(self) -> tuple[Terms, ...]:
        """The terms that need a record."""
        return tuple(term for term in self.terms if term != INSTRUMENTS)

    @property
    def uses_instruments(self) -> bool:
        """True if readings count."""
        return INSTRUMENTS in self.terms

    @model_validator(mode="after")
    def _different(self) -> Self:
        for number, term in enumerate(self.terms):
            if term in self.terms[:number]:
                raise refusal(f"{term} stands twice", "terms", number)
        keys = [quantity.key for quantity in self.quantities]
        for number, key in enumerate(keys):
            if key in keys[:number]:
                raise refusal(f"{key} stands twice", "quantities", number, "key")
        return self
