"""The sections `ground_motion` and `support` of a mine file, and the slice of the stage."""

from itertools import pairwise
from typing import Annotated, Any, Literal, Self

from pydantic import Field, model_validator

from catalogs.settings import DatedStep
from common.opening_table import SIDES
from common.quantities import factor
from common.setting_types import (
    AsTuple,
    Name,
    Settings,
    Unit,
    choose,
    is_section,
    one_of,
    real_number,
    refusal,
    refuse,
    short,
)

SizeKind = Literal["mw", "log_potency", "log_moment"]
Distance = Annotated[float, Unit("m", gt=0, le=1e6)]
Scatter = real_number(ge=0, le=2)
Depth = Annotated[float, Unit("m", ge=0, le=1000)]


def _is_word(value: Any) -> bool:
    return isinstance(value, str) and value[:1].isalpha()


class Relation(Settings):
    """What all relations share."""

    scatter: Scatter
    """Standard deviation of log10 of the velocity about the relation, from event to event and from place to place."""
    nearest: Distance = None
    """Least distance that the relation is used with. A nearer event counts as if it were so far away."""


class Saturation(Settings):
    """Near the source the velocity no longer grows: a length R0 = length 10^(exponent size) is added to the
    distance."""

    length: Distance
    """R0 of an event of size 0: of magnitude 0, of a potency of 1 m3, or of a moment of 1 N m."""
    exponent: real_number(ge=0, le=2) = 0.0
    """Growth of log10 R0 with the size. Of sources that are alike it is 1/3 for log_potency and log_moment, 1/2 for
    mw."""


class SiteRelation(Relation):
    """The site's own coefficients: log10 v = a + b size - c log10(R + R0), v in m/s, R in m."""

    name: Literal["site"]
    """`site`: the coefficients follow."""
    size: SizeKind
    """What `size` is. `mw`: moment magnitude. `log_potency`: log10 of the potency in m3. `log_moment`: log10 of the
    moment in N m."""
    a: real_number(ge=-50, le=50)
    """log10 of the velocity in m/s for size 0 and R + R0 = 1 m."""
    b: real_number(gt=0, le=5)
    """Growth of log10 of the velocity with the size."""
    c: real_number(gt=0, le=5)
    """Decay of log10 of the velocity with log10 of the distance."""
    saturation: Saturation = None
    """Length R0 that is added to the distance. Default: none; `nearest` is needed then."""
    sizes: Annotated[tuple[real_number(ge=-20, le=40), ...], Field(min_length=2, max_length=2), AsTuple] = None
    """Smallest and largest size that the coefficients were found from. The report says how much of the shaking comes
    from other sizes."""
    distances: Annotated[tuple[Distance, ...], Field(min_length=2, max_length=2), AsTuple] = None
    """Smallest and largest distance that the coefficients were found from."""

    @model_validator(mode="after")
    def _is_limited(self) -> Self:
        found = []
        if self.saturation is None and self.nearest is None:
            found.append(refusal("a velocity without limit at the source; give nearest, or saturation"))
        for key in ("sizes", "distances"):
            ends = getattr(self, key)
            if ends is not None and not ends[0] < ends[1]:
                found.append(refusal(f"{ends[1]:g} is not larger than {ends[0]:g}; give the smaller one first", key))
        refuse(found)
        return self


class McGarrRelation(Relation):
    """Mine tremors in a gold mine (McGarr, Green and Spottiswoode 1981): log10(R v) = -4.68 + 0.49 log10 M0, R v in
    cm2/s, M0 in dyn cm. Twelve tremors of magnitudes -0.76 to 1.45, recorded underground 50 m to 1.6 km away."""

    name: Literal["mcgarr_1981"]
    """`mcgarr_1981`: the published coefficients. Default of nearest: 50 m, the least distance of the data."""


class MendeckiRelation(Relation):
    """Underground mines (Mendecki 2019): v = 0.63 vS strain_drop (L / (R + L))^c_r, L = c_l P^(1/3), with the potency P
    in m3. c_l and c_r are to be found from the site's records."""

    name: Literal["mendecki_2019"]
    """`mendecki_2019`: the published form."""
    s_wave_velocity: Annotated[float, Unit("m/s", ge=100, le=10_000)]
    """Velocity of shear waves in the rock."""
    strain_drop: real_number(gt=0, le=0.1)
    """Change of the strain at the source, such as 1.0e-4: the stress drop over the shear modulus."""
    c_l: real_number(gt=0, le=1000)
    """Size of the source over the cube root of its potency."""
    c_r: real_number(gt=0, le=5)
    """Decay of log10 of the velocity with log10 of the distance."""


class VelocityColumns(Settings):
    """Columns of a file of recorded velocities. Either the distance has a column, or both places have three."""

    event: str = "event"
    """Column of the name or number of the event. Velocities of one event have the same one."""
    size: str = "size"
    """Column of the size of the event, of the kind that `size` says."""
    velocity: str = "velocity"
    """Column of the peak ground velocity."""
    distance: str = None
    """Column of the distance between event and sensor."""
    event_place: Annotated[tuple[str, ...], Field(min_length=3, max_length=3), AsTuple] = None
    """Columns of x, y and z of the event, in place of the distance."""
    station_place: Annotated[tuple[str, ...], Field(min_length=3, max_length=3), AsTuple] = None
    """Columns of x, y and z of the sensor, in place of the distance."""

    @model_validator(mode="after")
    def _one_distance(self) -> Self:
        places = [self.event_place is not None, self.station_place is not None]
        if any(places) if self.distance is not None else not all(places):
            raise refusal("give either distance, or event_place and station_place")
        return self


class FittedRelation(Relation):
    """Coefficients of log10 v = a + b size - c log10(R + R0) that are fitted to recorded velocities."""

    name: Literal["fitted"]
    """`fitted`: to the velocities of a file."""
    scatter: Scatter = None
    """Standard deviation of log10 of the velocity. Default: that of the fit."""
    file: str
    """CSV or Excel file of recorded velocities, relative to the mine file: a row for each sensor and event."""
    size: SizeKind
    """What the column of sizes holds: `mw`, `log_potency` (log10 m3) or `log_moment` (log10 N m)."""
    columns: VelocityColumns = None
    """Names of the columns. Default: event, size, velocity, distance."""
    velocity_unit: str
    """Unit of the velocities, such as mm/s."""
    distance_unit: str = "m"
    """Unit of distances and places, such as m."""
    saturation: Saturation = None
    """Length R0 that is added to the distance. It is not fitted. Default: none; `nearest` is needed then."""

    @model_validator(mode="after")
    def _has_units(self) -> Self:
        found = []
        for key, unit in (("velocity_unit", "m/s"), ("distance_unit", "m")):
            try:
                factor(getattr(self, key), unit)
            except ValueError as error:
                found.append(refusal(f"{short(getattr(self, key))} {error}", key))
        if self.saturation is None and self.nearest is None:
            found.append(refusal("a velocity without limit at the source; give nearest, or saturation"))
        refuse(found)
        return self

    @property
    def named_columns(self) -> VelocityColumns:
        """The columns, those of the default where none are given."""
        return self.columns or VelocityColumns(distance="distance")


RELATIONS: dict[str, type[Settings]] = {
    "site": SiteRelation,
    "mcgarr_1981": McGarrRelation,
    "mendecki_2019": MendeckiRelation,
    "fitted": FittedRelation,
}
AnyRelation = one_of("name", RELATIONS)


class DepthBySide(Settings):
    """Depth of the rock that shaking throws, by side of an opening. A side that is left out has that of its failed rock
    (`p90`)."""

    roof: Depth = None
    """Of the roof."""
    walls: Depth = None
    """Of the walls."""
    floor: Depth = None
    """Of the floor."""
    face: Depth = None
    """Of the face."""

    @model_validator(mode="after")
    def _some(self) -> Self:
        if not self.model_fields_set:
            raise refusal(f"gives no side; give one of {', '.join(SIDES)}, or leave it out")
        return self


class GroundMotionSettings(Settings):
    """Peak ground velocity at openings: the relation of velocity, size and distance, and the chances."""

    relation: AnyRelation
    """Relation between the peak ground velocity, the size of an event and its distance."""
    largest: Annotated[float, Unit("m/s", gt=0, le=100)] = None
    """Largest velocity that the rock can have. No event exceeds it, whatever the scatter. Default: none."""
    chances: Annotated[tuple[real_number(gt=0, lt=1), ...], Field(min_length=1, max_length=6), AsTuple] = (
        0.5,
        0.1,
        0.02,
    )
    """Chances in a step, the largest first. The report gives the velocity that is exceeded with each."""
    displacement: Annotated[float, Unit("mm", gt=0, le=5000)] = None
    """Displacement of the surface that is allowed while it is shaken. The demand on support needs it."""
    depth: choose(is_section, DepthBySide, choose(_is_word, Literal["p90", "largest"], Depth)) = "p90"
    """Depth of the rock that shaking throws into the opening. `p90`: the depth of the modelled failed rock that nine
    tenths of the side do not exceed (`openings.csv`). `largest`: its largest depth. One number for all sides, or
    {roof: 1 m, walls: 0.5 m}."""

    @model_validator(mode="after")
    def _is_whole(self) -> Self:
        found = []
        for number, (first, second) in enumerate(pairwise(self.chances), 1):
            if not second < first:
                found.append(
                    refusal(
                        f"{second:g} is not smaller than {first:g}; give each chance once, in order", "chances", number
                    )
                )
        if "depth" in self.model_fields_set and self.displacement is None:
            found.append(refusal("stands without displacement, which the demand needs; give both", "depth"))
        refuse(found)
        return self

    @property
    def failed_depth(self) -> str:
        """Column of the table of openings that a side without a stated depth has it from; empty where none needs it."""
        if self.displacement is None or len(self.depths) == len(SIDES):
            return ""
        return "depth_largest" if self.depth == "largest" else "depth_p90"

    @property
    def depths(self) -> dict[str, float]:
        """Stated depth by side, m, of the sides that have one."""
        if isinstance(self.depth, str):
            return {}
        if isinstance(self.depth, DepthBySide):
            return {side: getattr(self.depth, side) for side in SIDES if getattr(self.depth, side) is not None}
        return dict.fromkeys(SIDES, float(self.depth))


class SupportClass(Settings):
    """A class of support, with the capacity that the user states."""

    name: Annotated[str, Field(min_length=1, max_length=60)]
    """Name of the class."""
    energy: Annotated[float, Unit("kJ/m^2", gt=0, le=1e4)]
    """Energy that it absorbs, by area of the surface."""
    displacement: Annotated[float, Unit("mm", gt=0, le=5000)]
    """Displacement at which it has absorbed this energy; at most ground_motion.displacement."""


Support = Annotated[tuple[SupportClass, ...], AsTuple]


class ShakenOpening(Settings):
    """An excavation that is mined: index in grid.nc follows from its name."""

    name: Name
    step: str = ""
    """the dated step that mines it; empty: mined before the first of them"""
    filled: str | None = None
    """the dated step that fills it; empty: filled before the first of them; None: not filled"""


class ShakingSlice(Settings):
    """The slice of the stage."""

    mine: str
    ground_motion: GroundMotionSettings
    support: Support = ()
    density: Annotated[float, Field(gt=0)]
    """of the host rock, kg/m3"""
    steps: Annotated[tuple[DatedStep, ...], Field(min_length=1), AsTuple]
    openings: Annotated[tuple[ShakenOpening, ...], AsTuple]


def with_path(values: dict[str, Any], path: str) -> dict[str, Any]:
    """Given values of `ground_motion` in which the file of a fitted relation has this path."""
    return values | {"relation": values["relation"] | {"file": path}}
