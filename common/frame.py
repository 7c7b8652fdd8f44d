"""Place of a mine's coordinates on Earth, from its configuration."""

from typing import Self

from pydantic import model_validator

from common.mine_grid import SAME_AS_MAP, GridMap, MineGrid
from common.setting_types import Length, Settings, real_number, refusal


class Frame(Settings):
    """Place of the mine's coordinates on Earth: x east, y north, z up, unless grid or crs says otherwise. Give latitude
    and longitude of the origin, or crs. Without either, results are in mine coordinates only."""

    latitude: real_number(ge=-90, le=90) = None
    """Latitude of the origin of the coordinates, degrees (WGS 84)."""
    longitude: real_number(ge=-180, le=180) = None
    """Longitude of the origin of the coordinates, degrees (WGS 84)."""
    crs: str = None
    """Projected coordinate system, instead of latitude and longitude: EPSG code, PROJ text or WKT. One in feet needs
    grid.units. Where one of its axes runs west or south (EPSG:2053, EPSG:5513), x and y are its axes in their order;
    else x is east and y north."""
    grid: MineGrid = None
    surface: Length
    """Elevation of the ground. Depth, and so in-situ stress, is measured from it."""

    @model_validator(mode="after")
    def _one_place(self) -> Self:
        given = sorted(self.model_fields_set - {"surface", "grid"})
        if given not in ([], ["crs"], ["latitude", "longitude"]):
            raise refusal(
                f"{' and '.join(given)}: give latitude and longitude of its origin, or crs, or none of them (then "
                "results are in mine coordinates only)"
            )
        return self

    @property
    def has_place(self) -> bool:
        """Whether the mine has a place on Earth. Only QuakeML needs one."""
        return self.crs is not None or self.latitude is not None


def grid_of(frame: Frame | None) -> GridMap:
    """The transformation from the mine's grid to the map, of a frame in a stage's slice."""
    return frame.grid.map() if frame and frame.grid else SAME_AS_MAP
