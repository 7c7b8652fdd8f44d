"""Records in CSV: the configuration states the meaning of each column."""

import codecs
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Literal, Self

import numpy as np
import xarray as xr
from pydantic import model_validator

from catalogs.records.build import SIZE_NAMES, build_record, moment_magnitudes, sizes_text
from catalogs.records.csv_columns import (
    GLOBE_COORDINATES,
    LINEAR_SIZES,
    LOGARITHM_NAME,
    MAGNITUDE,
    MAGNITUDE_TYPE,
    MINE_COORDINATES,
    TENSOR_KINDS,
    TEXT_COLUMNS,
    UNITS,
    ColumnSettings,
)
from catalogs.records.csv_filters import (
    MISSING_VALUE_CODES,
    check_codes,
    check_other_codes,
    check_unnamed_kinds,
    filter_columns,
    filter_numbers,
)
from catalogs.records.csv_table import Table, read_table
from catalogs.records.csv_times import read_times
from catalogs.records.csv_units import check_angle, known_unit, unit_factor, unit_quantity
from catalogs.records.event_kinds import EVENT_TYPE, STATUS
from catalogs.records.excel_sheets import is_workbook
from catalogs.records.filters import filter_events
from catalogs.records.settings import EventFileSettings, EventFileSlice
from catalogs.records.times import check_zone
from common.errors import InputError
from common.event_table import RADIATED_ENERGY, SOURCE_RADIUS, STATIC_STRESS_DROP
from common.frame import grid_of
from common.setting_types import AsTuple, Settings, real_number, refusal, short
from common.source_tensors import potency_from_moment
from common.voigt import COMPONENTS

NAME = "csv"
READS_FOLDER = False
TENSOR_FRAMES = {  # axes (row) in east, north, up; up south east is the frame of moment tensor catalogues
    "ENU": np.eye(3),
    "NED": np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]]),
    "USE": np.array([[0.0, 0.0, 1.0], [0.0, -1.0, 0.0], [1.0, 0.0, 0.0]]),
}
MAX_LOG_MOMENT = 25.0  # log10 of the moment (N m) of an earthquake larger than any
MIN_SIZES_TO_JUDGE = 10  # fewer sizes may be alike by chance
MAX_CHANCE_OF_LIKENESS = 0.01  # numbers as alike as by a smaller chance are no sizes


class EnergyConversion(Settings):
    """Conversion of radiated energy: log10 moment (N m) = slope log10 energy (J) + offset."""

    slope: real_number(gt=0, le=10)
    """Slope of the relation."""
    offset: real_number(ge=-30, le=30)
    """Offset of the relation."""


class Record(EventFileSettings):
    """A record in a CSV file, or in a sheet of an Excel file."""

    reader: Literal["csv"]
    """Format of the record."""
    columns: ColumnSettings
    """Names of the columns of the file."""
    sheet: str = None
    """Sheet of an Excel file. Default: the first."""
    tensor_frame: Literal["ENU", "NED", "USE"] = None
    """Directions of x, y and z of the tensor columns: east north up (ENU), north east down (NED), or up south east
    (USE). Default: ENU."""
    units: dict[str, str] = None
    """Unit of a kind of column, where it is not m, m^3, N m, J or s and the file does not state it. It must not
    contradict a unit in the column's name or below the header."""
    missing: Annotated[tuple[real_number(), ...], AsTuple] = None
    """Numbers that stand for a missing value. Default: -99, -999, -9999."""
    decimal: Literal["point", "comma"] = None
    """Decimal mark. Default: found from the file."""
    date_order: Literal["day", "month"] = None
    """Which number comes first in 01/02/2019. Default: found from the file."""
    time_zone: str = None
    """Time zone of times without an offset: Australia/Hobart, +10:00, UTC. Abbreviations such as EST are refused.
    Default: UTC. Required if the name of a column of time says local, or states an offset. An hour that occurs twice,
    at the end of summer time, is read as the later one."""
    energy_conversion: EnergyConversion = None
    """Conversion of radiated energy: log10 moment (N m) = slope log10 energy (J) + offset. There is no default. Needed
    where energies are the only sizes."""
    encoding: str = None
    """Encoding of a file that is not in UTF-8 or UTF-16: gbk, shift_jis, cp1252. It is needed only if names of columns
    or texts depend on it."""
    time_format: Literal["excel", "excel_1904", "matlab", "unix", "unix_ms"] = None
    """Format of times that are numbers. `excel`, `excel_1904`: days of a worksheet since 1900 or 1904. `matlab`: days
    of MATLAB (datenum), since year 0. `unix`, `unix_ms`: seconds or milliseconds since 1970, UTC."""

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        self._check_columns()
        if self.sheet is not None and not is_workbook(Path(self.file)):
            raise refusal("a CSV file has no sheets; leave it out", "sheet")
        for key in ("decimal", "encoding"):
            if getattr(self, key) is not None and is_workbook(Path(self.file)):
                raise refusal("an Excel file needs none; leave it out", key)
        for kind, unit in (self.units or {}).items():
            if kind not in UNITS or kind not in self.columns.model_fields_set:
                raise refusal(f"not a named column with a unit; such are {', '.join(UNITS)}", "units", kind)
            quantity = known_unit(unit, UNITS[kind]) or unit_quantity(unit)
            if quantity is None:
                raise refusal(f"{short(unit)} is not a unit; expected one like {UNITS[kind]}", "units", kind)
            if not quantity.check(UNITS[kind]):
                raise refusal(f"{short(unit)} is not convertible to {UNITS[kind]}", "units", kind)
        if self.tensor_frame and not {f"{kind}_xx" for kind in TENSOR_KINDS} & self.columns.model_fields_set:
            raise refusal("of which tensor? name its six columns, or leave it out", "tensor_frame")
        if self.time_zone:
            try:
                check_zone(self.time_zone)
            except InputError as error:
                raise refusal(str(error).partition(": ")[2], "time_zone") from error
        return self

    def _check_columns(self) -> None:
        """Check the keys that the columns of a CSV file require."""
        named = self.columns.model_fields_set
        for kind in LINEAR_SIZES:
            name = getattr(self.columns, kind) or ""
            if LOGARITHM_NAME.match(name.strip()) and kind not in (self.units or {}):
                raise refusal(
                    f"column {name!r} is by its name a logarithm; name it in record.columns.log_{kind}, or give its "
                    f"unit in record.units.{kind} if it is none",
                    "columns",
                    kind,
                )
        sizes = {*SIZE_NAMES, "log_moment", MAGNITUDE}
        if named & {"energy", "log_energy"} and not self.energy_conversion and not named & sizes:
            raise refusal(
                "missing; an energy is no moment: say {slope: ..., offset: ...} for log10 moment (N m) = slope log10 "
                "energy (J) + offset",
                "energy_conversion",
            )
        if self.energy_conversion and not named & {"energy", "log_energy"}:
            raise refusal("of which energy? name its column in record.columns.energy", "energy_conversion")
        if self.conversions and not named & {MAGNITUDE, MAGNITUDE_TYPE}:
            raise refusal(
                f"of which magnitude? name its column in record.columns.{MAGNITUDE}, and that of its types in "
                f"record.columns.{MAGNITUDE_TYPE}",
                "conversions",
            )
        if self.time_format and "time" not in named:
            raise refusal("of which number? name its column in record.columns.time", "time_format")
        if self.time_format and self.date_order:
            raise refusal("a time that is a number has no order of day and month; leave it out", "date_order")
        if (self.time_format or "").startswith("unix") and self.time_zone:
            raise refusal("Unix time is UTC everywhere; leave it out", "time_zone")
        if self.encoding:
            try:
                known = codecs.lookup(self.encoding)._is_text_encoding
            except (LookupError, ValueError):
                known = False
            if not known:
                raise refusal(
                    f"{short(self.encoding)} is no encoding; such are utf-8, cp1252, gbk, shift_jis", "encoding"
                )


class RecordSlice(Record, EventFileSlice):
    """The slice of a record in a CSV file."""

    def names_of_text(self, kind: str) -> set[str]:
        """The kind itself, and its column in the file."""
        return {kind, getattr(self.columns, kind)}


def read(settings: RecordSlice) -> xr.Dataset:
    """The events of a CSV file in the form of common.event_table, filtered (catalogs.records.filters).

    settings.columns names the file's columns: time (one column, or a list of two or three: date, time of day, offset;
    see catalogs.records.csv_times), x, y, z (of the mine's grid, in its unit) or latitude, longitude (degrees), depth
    (m below sea level), at least one of potency (m3), log_potency, moment (N m), mw, or magnitude with magnitude_type,
    and optionally potency_xx, _yy, _zz, _yz, _xz, _xy (m3, tensor shear) or moment_xx ... (N m) in the axes of
    tensor_frame, time_uncertainty (s), step, event_type and evaluation_status (catalogs.records.event_kinds). units:
    {kind of column: unit}, where it is not the one above and not in the file; decimal, date_order, time_zone: what
    cannot be found from the file; conversions: catalogs.records.build; missing: numbers that stand for a missing value,
    else MISSING_VALUE_CODES. How the table is read: catalogs.records.csv_table.

    Events that are no seismicity or have no time, place or size are left out, and rows that are there twice. Raises
    InputError, naming file, column and event, for what is missing, not a number, or not a date.
    """
    path = Path(settings.file)
    columns = settings.columns.names()
    names = {key: name for key, name in columns.items() if key not in TEXT_COLUMNS}
    times = settings.columns.names_of_time()
    named = {name: f"record.columns.{key}" for key, name in columns.items()}
    named |= dict.fromkeys(times, "record.columns.time")
    named = filter_columns(settings) | named
    numeric = [*names.values(), *(times if settings.time_format else [])]
    table = read_table(path, named, numeric, settings.decimal, settings.encoding, sheet=settings.sheet)
    check_unnamed_kinds(table, named, settings)
    limits = settings.filter
    bounded = {name for key in ("maximum", "minimum") for name in (getattr(limits, key, None) or {})}
    table.decide_decimals([*numeric, *bounded])
    codes = MISSING_VALUE_CODES if settings.missing is None else settings.missing
    units, grid = settings.units or {}, grid_of(settings.frame)
    numbers: dict[str, np.ndarray] = {}
    for key, name in names.items():
        values = table.numbers(name)
        factor = 1.0
        if key in UNITS:
            usual = grid.metres_per_unit if key in MINE_COORDINATES else 1.0
            factor = unit_factor(str(path), key, name, UNITS[key], units.get(key), table.units.get(name), usual)
        elif key in ("latitude", "longitude"):
            check_angle(str(path), key, name)
        missing = np.isin(values, codes)
        if settings.missing is None:
            check_codes(key, values[missing], factor, settings)
            check_other_codes(str(path), name, values)
        values = np.where(missing, np.nan, values)
        if key in LINEAR_SIZES:
            _check_logarithm(key, name, values * factor, settings)
        numbers[key] = values + np.log10(factor) if key.startswith("log_") else values * factor
    time, times_said = read_times(table, settings.columns, numbers, settings, codes)
    place = _locations(table, columns, numbers, settings)
    tensor = _tensor(numbers, settings)
    sizes, sizes_said = _sizes(table, columns, numbers, tensor, settings)
    other = {key: numbers[key] for key in ("time_uncertainty",) if key in columns}
    if "step" in columns:
        other["step"] = table.words(columns["step"]).to_numpy(object)
    record = build_record(settings, time, place, sizes, tensor, source=str(path), **other)
    stated = {"energy": RADIATED_ENERGY, "source_radius": SOURCE_RADIUS, "static_stress_drop": STATIC_STRESS_DROP}
    for key, field in stated.items():
        if key in numbers:
            values = np.where(numbers[key] > 0, numbers[key], np.nan)  # 0: what was never computed
            record[field.name] = (field.dims, values, field.attributes)
    record.attrs |= {"sizes_text": sizes_said} if sizes_said else {}
    record.attrs |= {"times_text": times_said} if times_said else {}
    has_words = limits and (limits.only or limits.without)
    quality = filter_numbers(table, settings, codes)
    filtered = {*((limits and limits.only) or ()), *((limits and limits.without) or ())}
    words = {
        name: (table.words(name) if name in filtered else table.text(name)).to_numpy(object)
        for name in (table.rows if has_words else ())
    }
    kinds = {key: table.words(columns[key]).to_numpy(object) for key in (EVENT_TYPE, STATUS) if key in columns}
    return filter_events(record, settings, quality, str(path), table.repeated, words, kinds)


def _check_logarithm(key: str, name: str, values: np.ndarray, settings: RecordSlice) -> None:
    """Raise InputError where numbers can only be logarithms of sizes, unless record.units has their unit.

    values (event,): in SI units, if the file states a unit. A record whose moments all stay below MAX_LOG_MOMENT is
    one of Mw -5.1 and less, of grains. The chance that n sizes lie within a factor r is (1 - 1 / r)^n where as many as
    1 / size are larger, a steeper law than that of most records; below MAX_CHANCE_OF_LIKENESS they are no sizes.
    """
    if key in (settings.units or {}):
        return
    sizes = values[np.isfinite(values) & (values != 0)]
    if not sizes.size or sizes.min() < 0 or sizes.max() > MAX_LOG_MOMENT:
        return  # what is negative is refused by its event
    alike = sizes.size >= MIN_SIZES_TO_JUDGE and (1 - sizes.min() / sizes.max()) ** sizes.size < MAX_CHANCE_OF_LIKENESS
    if key == "moment" or alike:
        raise InputError(
            f"{settings.file}: column {name!r}: {sizes.min():g} to {sizes.max():g} {UNITS[key]} can hardly be all of a "
            f"record's sizes: name the column in record.columns.log_{key} if it holds their logarithm, or its unit in "
            f"record.units.{key} if it does not"
        )


def _locations(table: Table, columns: Mapping, numbers: Mapping, settings: RecordSlice) -> np.ndarray:
    """Map coordinates (event, 3) m, NaN where one is missing. Raises InputError for degrees off the globe."""
    if set(MINE_COORDINATES) <= set(columns):
        return grid_of(settings.frame).to_map(np.column_stack([numbers[key] for key in MINE_COORDINATES]))
    for key, most in (("latitude", 90.0), ("longitude", 180.0)):
        table.refuse(
            np.abs(numbers[key]) > most, columns[key], f"is no {key}, which ends at {most:g} degrees", "correct it"
        )
    globe = np.column_stack([numbers[key] for key in GLOBE_COORDINATES])
    from catalogs.sources.geographic_frame import MineFrame  # here: to check a mine file must not wait for PROJ

    location = np.full(globe.shape, np.nan)
    known = np.isfinite(globe).all(axis=1)
    location[known] = MineFrame(settings.frame).to_map(*globe[known].T)
    return location


def _sizes(
    table: Table, columns: Mapping, numbers: dict, tensor: np.ndarray | None, settings: RecordSlice
) -> tuple[dict[str, np.ndarray], str]:
    """Sizes of every kind (event,), NaN where unknown, and in words which magnitudes and energies were converted."""
    sizes = {key: numbers[key] for key in SIZE_NAMES if key in columns}
    for key in LINEAR_SIZES:
        if key in columns:
            numbers[key] = np.where(numbers[key] == 0, np.nan, numbers[key])  # what was never computed
            table.refuse(
                numbers[key] < 0,
                columns[key],
                "is not positive",
                f"if it is a logarithm, name it in record.columns.log_{key}; else correct it",
            )
    for key in ("moment", "energy"):
        if f"log_{key}" in columns:
            with np.errstate(over="ignore"):
                from_logarithm = 10.0 ** numbers[f"log_{key}"]
            numbers[key] = _first(numbers.get(key), from_logarithm)
    sizes |= {key: numbers[key] for key in ("potency", "moment") if key in numbers}
    text = ""
    tensors = np.zeros(len(table.rows), bool) if tensor is None else np.isfinite(tensor).all(axis=(1, 2))
    if MAGNITUDE in columns or MAGNITUDE_TYPE in columns:
        source = MAGNITUDE if MAGNITUDE in columns else "mw"
        needed = ~tensors
        for key, values in sizes.items():
            needed = needed & (np.isnan(values) | (key == source))
        kinds = table.words(columns[MAGNITUDE_TYPE]) if MAGNITUDE_TYPE in columns else [""] * len(table.rows)
        conversions = settings.conversions or {}
        mw, used = moment_magnitudes(numbers[source], list(kinds), conversions, needed, table.source)
        sizes["mw"] = _first(mw, sizes.get("mw")) if source == MAGNITUDE else mw
        text = sizes_text(used, conversions)
    if "energy" in numbers and settings.energy_conversion:
        needed = ~tensors & np.all([np.isnan(values) for values in sizes.values()] or [True], axis=0)
        slope, offset = settings.energy_conversion.slope, settings.energy_conversion.offset
        with np.errstate(over="ignore"):
            moment = 10.0 ** (slope * np.log10(np.where(needed, numbers["energy"], np.nan)) + offset)
        sizes["moment"] = _first(sizes.get("moment"), moment)
        sign = "-" if offset < 0 else "+"
        how = f"as log10 M0 = {slope:g} log10 E {sign} {abs(offset):g}"
        text = ", ".join([*([text] if text else []), f"{int(np.isfinite(moment).sum())} of energy {how}"])
    return sizes, text


def _first(values: np.ndarray | None, other: np.ndarray | None) -> Any:
    """The values (event,), and the others where they are unknown; either may be absent."""
    if values is None or other is None:
        return other if values is None else values
    return np.where(np.isnan(values), other, values)


def _tensor(numbers: Mapping, settings: RecordSlice) -> np.ndarray | None:
    """Potency tensors (event, 3, 3) m3, east north up, NaN where a component is empty; None without columns."""
    axes = TENSOR_FRAMES[settings.tensor_frame or "ENU"]
    for kind in TENSOR_KINDS:
        if f"{kind}_xx" not in numbers:
            continue
        tensor = np.empty((len(numbers[f"{kind}_xx"]), 3, 3))
        for name, (i, j) in COMPONENTS.items():
            tensor[:, i, j] = tensor[:, j, i] = numbers[f"{kind}_{name}"]
        tensor = axes.T @ tensor @ axes
        tensor[~np.isfinite(tensor).all(axis=(1, 2)) | ~tensor.any(axis=(1, 2))] = np.nan  # zero: never computed
        if kind == "potency":
            return tensor
        moduli = [settings.lame_lambda, settings.shear_modulus]
        if None in moduli:
            raise InputError("record: moment tensors need lame_lambda and shear_modulus of the host rock, in Pa")
        return potency_from_moment(tensor, *map(float, moduli))
    return None
