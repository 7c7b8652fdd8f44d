"""Columns of a CSV record: the kinds that it may have, their units, and which of them it needs."""

import re
from typing import Annotated, Self

from pydantic import Field, model_validator

from catalogs.records.build import SIZE_NAMES
from catalogs.records.event_kinds import EVENT_TYPE, STATUS
from catalogs.records.settings import normalized
from catalogs.records.times import DATE_PARTS
from common.setting_types import AsTuple, EachOnce, Settings, choose, is_list, refusal
from common.voigt import COMPONENTS

SIZE_COLUMNS = (*SIZE_NAMES, "log_moment", "energy", "log_energy")
NOT_MOMENT_MAGNITUDES = ("ml", "mlv", "mb", "mb_lg", "mblg", "md", "mc", "ms", "mn", "mr")
MINE_COORDINATES = ("x", "y", "z")
GLOBE_COORDINATES = ("latitude", "longitude", "depth")
TENSOR_KINDS = ("potency", "moment")
MAGNITUDE, MAGNITUDE_TYPE = "magnitude", "magnitude_type"
LINEAR_SIZES = ("potency", "moment", "energy")  # a column may also hold their logarithm: log_potency ...
UNITS = {**dict.fromkeys((*MINE_COORDINATES, "depth"), "m"), "potency": "m^3", "moment": "N m", "energy": "J"}
UNITS |= {"time_uncertainty": "s", "source_radius": "m", "static_stress_drop": "Pa"}
UNITS |= {f"{kind}_{name}": UNITS[kind] for kind in TENSOR_KINDS for name in COMPONENTS}
UNITS |= {f"log_{kind}": UNITS[kind] for kind in LINEAR_SIZES}
LOGARITHM_NAME = re.compile(r"(log|lg|ln)(_?10)?([\W_]|[MPE]0?\b|10\b)", re.IGNORECASE)  # start of a column's name
TEXT_COLUMNS = ("time", MAGNITUDE_TYPE, "step", EVENT_TYPE, STATUS)


class ColumnSettings(Settings):
    """Names of the columns of a CSV file, by what they hold. The units are those given here, unless the file or
    record.units states others."""

    time: choose(is_list, Annotated[tuple[str, ...], Field(min_length=1, max_length=3), AsTuple, EachOnce], str) = None
    """Column of the time, or a list of up to three columns: date, time of day, offset from UTC. If it holds numbers,
    record.time_format gives their meaning."""
    year: str = None
    """Column of the year. Columns of year, month and day replace time; hour, minute and second may be added."""
    month: str = None
    """Column of the month, 1 to 12."""
    day: str = None
    """Column of the day of the month."""
    hour: str = None
    """Column of the hour."""
    minute: str = None
    """Column of the minute."""
    second: str = None
    """Column of the second; it may have decimals."""
    x: str = None
    """Column of x, east unless frame says otherwise, in mine coordinates (m, or frame.grid.units)."""
    y: str = None
    """Column of y, north unless frame says otherwise, in mine coordinates (m, or frame.grid.units)."""
    z: str = None
    """Column of z, up, in mine coordinates (m, or frame.grid.units)."""
    latitude: str = None
    """Column of the latitude, degrees (WGS 84)."""
    longitude: str = None
    """Column of the longitude, degrees (WGS 84)."""
    depth: str = None
    """Column of the depth below sea level (m)."""
    potency: str = None
    """Column of the scalar potency (m3)."""
    log_potency: str = None
    """Column of the logarithm to base 10 of the potency."""
    moment: str = None
    """Column of the scalar moment (N m)."""
    log_moment: str = None
    """Column of the logarithm to base 10 of the moment."""
    mw: str = None
    """Column of the moment magnitude."""
    energy: str = None
    """Column of the radiated energy (J). The report has apparent stress and energy index from it. Without another size
    record.energy_conversion converts it to a moment."""
    log_energy: str = None
    """Column of the logarithm to base 10 of the energy."""
    source_radius: str = None
    """Column of the source radius (m), for the report."""
    static_stress_drop: str = None
    """Column of the static stress drop (Pa), for the report."""
    magnitude: str = None
    """Column of magnitudes of any type. record.conversions converts them."""
    magnitude_type: str = None
    """Column of the type of each magnitude."""
    potency_xx: str = None
    """Column of component xx of the potency tensor (m3). A tensor needs all six."""
    potency_yy: str = None
    """Column of component yy of the potency tensor (m3). A tensor needs all six."""
    potency_zz: str = None
    """Column of component zz of the potency tensor (m3). A tensor needs all six."""
    potency_yz: str = None
    """Column of component yz of the potency tensor (m3). A tensor needs all six."""
    potency_xz: str = None
    """Column of component xz of the potency tensor (m3). A tensor needs all six."""
    potency_xy: str = None
    """Column of component xy of the potency tensor (m3). A tensor needs all six."""
    moment_xx: str = None
    """Column of component xx of the moment tensor (N m). A tensor needs all six."""
    moment_yy: str = None
    """Column of component yy of the moment tensor (N m). A tensor needs all six."""
    moment_zz: str = None
    """Column of component zz of the moment tensor (N m). A tensor needs all six."""
    moment_yz: str = None
    """Column of component yz of the moment tensor (N m). A tensor needs all six."""
    moment_xz: str = None
    """Column of component xz of the moment tensor (N m). A tensor needs all six."""
    moment_xy: str = None
    """Column of component xy of the moment tensor (N m). A tensor needs all six."""
    time_uncertainty: str = None
    """Column of the uncertainty of the time (s)."""
    step: str = None
    """Column of the step to which the event belongs. It is kept with the event. Comparison and report use the time."""
    event_type: str = None
    """Column of the event type. Events that are not seismic (quarry blast, explosion, noise, not existing) are left
    out; see record.filter.keep."""
    evaluation_status: str = None
    """Column of the evaluation status. Rejected and deleted events are left out."""

    @model_validator(mode="after")
    def _enough(self) -> Self:
        """A time, a location and a size among them, and a tensor whole."""
        named = self.model_fields_set
        parts = [part in named for part in DATE_PARTS]
        if "time" not in named and not any(parts):
            raise refusal("missing; name the column that holds the date and time", "time")
        if "time" in named and any(parts):
            raise refusal("the time stands in columns of its parts, or in one; leave either out", "time")
        if any(parts) and (not all(parts[:3]) or sorted(parts, reverse=True) != parts):
            raise refusal(f"name the columns of all parts of the time down to the last: {', '.join(DATE_PARTS)}")
        if not any(set(names) <= named for names in (MINE_COORDINATES, GLOBE_COORDINATES)):
            raise refusal("name the columns x, y and z, or latitude, longitude and depth")
        kinds = [kind for kind in TENSOR_KINDS if all(f"{kind}_{name}" in named for name in COMPONENTS)]
        if not kinds and not named & {*SIZE_COLUMNS, MAGNITUDE}:
            raise refusal(f"name a column of sizes: {', '.join((*SIZE_COLUMNS, MAGNITUDE))}, or six of a tensor")
        for kind in TENSOR_KINDS:
            if 0 < sum(f"{kind}_{name}" in named for name in COMPONENTS) < len(COMPONENTS):
                raise refusal(f"a tensor needs all six of {kind}_xx ... {kind}_xy")
        if MAGNITUDE_TYPE in named and not {MAGNITUDE, "mw"} & named:
            raise refusal("of which magnitude? name its column in record.columns.magnitude", MAGNITUDE_TYPE)
        words = {(self.mw or "").strip().lower(), *re.split(r"[\W_]+", (self.mw or "").lower())}
        if words & {*NOT_MOMENT_MAGNITUDES} and "mw" not in words:
            raise refusal(
                f"column {self.mw!r} is by its name no Mw; name it in record.columns.{MAGNITUDE}, and say how to "
                "convert it in record.conversions, untyped: {slope: ..., offset: ...}",
                "mw",
            )
        numeric = [(key, normalized(getattr(self, key))) for key in sorted(named - set(TEXT_COLUMNS))]
        for number, (key, name) in enumerate(numeric):
            if same := next((other for other, theirs in numeric[:number] if theirs == name), None):
                raise refusal(f"column {name!r} is named as {same}, too; each has a column of its own", key)
        return self

    def names(self) -> dict[str, str]:
        """Names of the columns by kind, but for those of the time, as they are compared."""
        return {key: normalized(name) for key, name in self.given().items() if key != "time"}

    def names_of_time(self) -> list[str]:
        """Names of the columns that together hold the time, as they are compared; none where its parts have columns."""
        given = self.given().get("time", [])
        return [normalized(name) for name in ([given] if isinstance(given, str) else given)]
