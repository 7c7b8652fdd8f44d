"""Scanned voids in the section `observations` of a mine file, and the slice of the stage that compares them."""

from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from common.mine_grid import MineGrid
from common.setting_types import AsTuple, Date, Length, Point, Settings, Size, real_number, refusal
from response.settings import MinedOpening, OpeningStep

Text = Annotated[str, Field(min_length=1)]


class ObservedScan(Settings):
    """A scanned void: the closed surface of a cavity scan, beside the walls of the excavations that it shows."""

    name: Text
    """Name of the scan; no other instrument has it."""
    excavations: Annotated[tuple[Text, ...], Field(min_length=1), AsTuple]
    """Excavations whose walls it shows. All of them are mined when it is taken."""
    file: Text
    """File of its surface: STL, OBJ, PLY, DXF, OMF or GOCAD (`.ts`), relative to the mine file."""
    layer: Text = None
    """Layer of a DXF drawing. "*": all layers."""
    element: Text = None
    """OMF or GOCAD surface, OBJ object or group, or solid of a text STL. "*": all of them."""
    units: Literal["m", "cm", "mm", "km", "ft", "us_ft", "inch"] = None
    """Unit of the file's coordinates, where the file does not state it. Default: that of frame.grid, or m."""
    scale: real_number(ge=1e-6, le=1e6) = None
    """Scale factor: metres = coordinate x units x scale + offset."""
    offset: Annotated[tuple[Length, ...], Field(min_length=3, max_length=3), AsTuple] = None
    """Vector that is added to the scaled coordinates."""
    error: Size
    """Standard error of the place of the whole scan along any axis. No averaging over a wall reduces it."""
    date: Date = None
    """Date of the scan. It is compared with the end of the step whose dates hold it, or else of the last one before.
    Default: `step`."""
    step: Text = None
    """Step at whose end the scan is compared. Default: `date`."""
    stations: Annotated[tuple[Annotated[Point, Field(min_length=3)], ...], Field(min_length=1), AsTuple] = None
    """Places of the scanner. Surface along its lines of sight closes a shadow: walls behind it count as not seen.
    Default: all of the surface was seen."""

    @model_validator(mode="after")
    def _whole(self) -> Self:
        if (self.date is None) == (self.step is None):
            raise refusal("give either date or step", "date")
        if len(set(self.excavations)) < len(self.excavations):
            raise refusal("names an excavation twice", "excavations")
        return self


class PlacedScan(ObservedScan):
    """A scan in the slice: it has a step, and a file as a path from the working directory."""

    grid: MineGrid = None
    """grid of the coordinates of its file, if that is not the map's"""


class ScanSlice(Settings):
    """The slice of stage `scans`."""

    scans: Annotated[tuple[PlacedScan, ...], AsTuple]
    steps: Annotated[tuple[OpeningStep, ...], AsTuple]
    """all that are mined, in order"""
    excavations: Annotated[tuple[MinedOpening, ...], AsTuple]

    @property
    def compared(self) -> list[str]:
        """Steps at whose end there is a scan, in order."""
        wanted = {scan.step for scan in self.scans}
        return [step.name for step in self.steps if step.name in wanted]
