"""The section `observations` of a mine file: places at which the model is read, and what instruments measured there."""

from typing import Annotated, Literal, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from common.quantities import parse_quantity
from common.setting_types import AsTuple, Point, Settings, Size, Unit, refusal, short
from response.scan_settings import ObservedScan

STRESS, DISPLACEMENT, EXTENSION, CLOSURE = "stress", "displacement", "extension", "closure"
SI_UNIT = {STRESS: "Pa", DISPLACEMENT: "m", EXTENSION: "m", CLOSURE: "m"}
COMPONENTS = {STRESS: 9, DISPLACEMENT: 3}  # Of stress six, and three principal compressions.
MAX_STATIONS = 10_000  # Of a line.
Text = Annotated[str, Field(min_length=1)]
Anchors = Annotated[tuple[Size, ...], Field(min_length=1), AsTuple]


class InstrumentAxis(Settings):
    """Direction that an instrument measures along."""

    trend: Annotated[float, Unit("deg", ge=-360, le=360)]
    """Direction in plan, clockwise from the map's north."""
    plunge: Annotated[float, Unit("deg", ge=-90, le=90)] = 0.0
    """Angle below the horizontal, in the direction of the trend."""

    @property
    def vector(self) -> NDArray:
        """Unit vector (3,), x east, y north, z up."""
        trend, plunge = np.radians(self.trend), np.radians(self.plunge)
        return np.array([np.sin(trend) * np.cos(plunge), np.cos(trend) * np.cos(plunge), -np.sin(plunge)])


class Instrument(Settings):
    """What all instruments have in common."""

    name: Text
    """Name of the instrument; each has one of its own."""
    since: Text = None
    """Step at whose end the instrument was zeroed. The model is read relative to it, too. Default: virgin rock for
    displacement, and whole stress."""
    file: Text = None
    """CSV file of its readings. Default: none; the model is read alone."""
    units: Text = None
    """Unit of the readings: of stress or of length. Needed with `file`."""
    error: Text = None
    """Standard error of a reading, with its unit. Default: not known; a calibration then estimates it."""
    date: Text = "date"
    """Column with the date of each reading, ISO, UTC."""
    columns: Annotated[tuple[Text, ...], Field(min_length=1), AsTuple] = ("value",)
    """Columns with the readings: one, or one for each anchor of a line in the order of `anchors`."""

    @property
    def quantity(self) -> str:
        """What the instrument measures: a key of SI_UNIT."""
        raise NotImplementedError

    @property
    def places(self) -> int:
        """Number of places that the table of observations has of it."""
        return 1

    @property
    def components(self) -> int:
        """Number of quantities that the table has at each place: all of a tensor or vector without an axis."""
        return 1

    @model_validator(mode="after")
    def _whole(self) -> Self:
        if self.file is not None:
            if self.units is None:
                raise refusal("missing; readings need it", "units")
            self.factor()
            self.reading_error()
        if len(set(self.columns)) < len(self.columns):
            raise refusal("names a column twice", "columns")
        return self

    def factor(self) -> float:
        """SI value of one unit of the readings. Raises a refusal for a unit of another kind."""
        return _in_si(f"1 {self.units}", SI_UNIT[self.quantity], "units", self.quantity)

    def reading_error(self) -> float:
        """Standard error of a reading, in SI units; NaN if it is not known. Raises a refusal for a unit of another
        kind, and for an error of zero."""
        if self.error is None:
            return float("nan")
        found = _in_si(self.error, SI_UNIT[self.quantity], "error", self.quantity)
        if not found > 0.0:
            raise refusal(f"{short(self.error)}: a reading has an error above zero", "error")
        return found


def _in_si(text: str, unit: str, key: str, quantity: str) -> float:
    """A quantity as text in SI units. Raises a refusal of the key where it is of another kind."""
    try:
        return parse_quantity(text, unit)
    except ValueError as error:
        raise refusal(f"{short(text)} is no {quantity}; a unit such as {unit} is expected", key) from error


class ObservedPoint(Instrument):
    """A point: a stress cell, or a survey mark."""

    at: Annotated[Point, Field(min_length=3)]
    """Its place."""
    measures: Literal["stress", "displacement"] = STRESS
    """What is read there."""
    axis: InstrumentAxis = None
    """Direction of a cell or of a displacement. Stress along it is given as compression, positive. Needed with `file`.
    Default: all components."""

    @property
    def quantity(self) -> str:
        return self.measures

    @property
    def components(self) -> int:
        return 1 if self.axis is not None else COMPONENTS[self.measures]

    @model_validator(mode="after")
    def _has_axis(self) -> Self:
        if self.file is not None and self.axis is None:
            raise refusal("missing; a reading is a stress or displacement along an axis", "axis")
        if len(self.columns) != 1:
            raise refusal("a point has one column", "columns")
        return self


class ObservedLine(Instrument):
    """A line: an extensometer with its anchors, or stress along a planned drive or borehole."""

    start: Annotated[Point, Field(min_length=3)]
    """Its collar, from which distances count."""
    end: Annotated[Point, Field(min_length=3)]
    """Its far end."""
    measures: Literal["extension", "stress"] = EXTENSION
    """What is read: how much farther each anchor is from the collar, or stress."""
    anchors: Anchors = None
    """Distances of the anchors from the collar. Default: `every`."""
    every: Size = None
    """Distance between points that are read, from the collar to the end. Default: `anchors`."""

    @property
    def quantity(self) -> str:
        return self.measures

    @property
    def places(self) -> int:
        return len(self.distances)

    @property
    def components(self) -> int:
        return COMPONENTS.get(self.measures, 1)

    @property
    def length(self) -> float:
        """Its length, m."""
        return float(np.linalg.norm(np.subtract(self.end, self.start)))

    @property
    def distances(self) -> NDArray:
        """Distances of its points from the collar, m."""
        if self.anchors is not None:
            return np.array(self.anchors)
        return np.arange(0.0, self.length * (1.0 + 1e-9), self.every)

    @property
    def vector(self) -> NDArray:
        """Unit vector (3,) from the collar to the end."""
        return np.subtract(self.end, self.start) / self.length

    @model_validator(mode="after")
    def _on_line(self) -> Self:
        if self.length == 0.0:
            raise refusal("the same point as where the line starts", "end")
        if (self.anchors is None) == (self.every is None):
            raise refusal("give either anchors or every", "anchors")
        if self.every is not None and self.length / self.every > MAX_STATIONS:
            raise refusal(f"more than {MAX_STATIONS} points; give a larger distance", "every")
        if self.anchors is not None and max(self.anchors) > self.length * (1.0 + 1e-6):
            raise refusal(f"an anchor at {max(self.anchors):g} m is beyond the end, {self.length:g} m", "anchors")
        if self.file is not None and (self.measures != EXTENSION or self.anchors is None):
            raise refusal("readings along a line are those of an extensometer with anchors", "file")
        if self.file is not None and len(self.columns) != len(self.anchors):
            raise refusal(f"{len(self.columns)} columns for {len(self.anchors)} anchors", "columns")
        return self


class ObservedClosure(Instrument):
    """A pair of marks on opposite walls, between which the closure is measured."""

    start: Annotated[Point, Field(min_length=3)]
    """One mark."""
    end: Annotated[Point, Field(min_length=3)]
    """The other mark."""

    @property
    def quantity(self) -> str:
        return CLOSURE

    @model_validator(mode="after")
    def _apart(self) -> Self:
        if tuple(self.start) == tuple(self.end):
            raise refusal("the same point as the other mark", "end")
        if len(self.columns) != 1:
            raise refusal("a closure has one column", "columns")
        return self


class ObservationSettings(Settings):
    """Places at which stress, displacement, extension and closure of each step are read, beside measured values, and
    scanned voids beside failed rock."""

    points: Annotated[tuple[ObservedPoint, ...], AsTuple] = ()
    """Stress cells and survey marks."""
    lines: Annotated[tuple[ObservedLine, ...], AsTuple] = ()
    """Extensometers, and lines along which stress is read."""
    closures: Annotated[tuple[ObservedClosure, ...], AsTuple] = ()
    """Pairs of marks on opposite walls."""
    scans: Annotated[tuple[ObservedScan, ...], AsTuple] = ()
    """Scanned voids, compared with the rock that the model has failed at the walls of their excavations."""

    @property
    def instruments(self) -> list[Instrument]:
        """Those that are read at points, in the order of the mine file."""
        return [*self.points, *self.lines, *self.closures]

    @model_validator(mode="after")
    def _own_names(self) -> Self:
        names = [*(one.name for one in self.instruments), *(one.name for one in self.scans)]
        for name in names:
            if names.count(name) > 1:
                raise refusal(f"two instruments are called {short(name)}")
        return self


class ObservationSlice(Settings):
    """The slice of stage `observations`."""

    observations: ObservationSettings
    steps: Annotated[tuple[dict, ...], AsTuple]
    """name, start and end of each, empty texts where it has none"""
    excavations: Annotated[tuple[dict, ...], AsTuple]
    """name and mined, the name of the step that mines it, empty where none does"""
