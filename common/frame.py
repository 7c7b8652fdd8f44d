"""Where on Earth a mine's coordinates lie, as its configuration says it."""

from typing import Self

from pydantic import model_validator

from common.setting_types import Length, Settings, real_number, refusal


class Frame(Settings):
    """Place of x east, y north, z up (m): latitude and longitude of the origin, or crs, or none (local only)."""

    latitude: real_number(ge=-90, le=90) = None
    """of the frame's origin, degrees (WGS 84)"""
    longitude: real_number(ge=-180, le=180) = None
    """of the frame's origin, degrees (WGS 84)"""
    crs: str = None
    """instead: EPSG code, PROJ text or WKT of a projected system in metres"""
    surface: Length
    """elevation of the ground, from which the depth of in-situ stress counts"""

    @model_validator(mode="after")
    def _one_place(self) -> Self:
        given = sorted(self.model_fields_set - {"surface"})
        if given not in ([], ["crs"], ["latitude", "longitude"]):
            raise refusal(
                f"{' and '.join(given)}: give latitude and longitude of its origin, or crs, or none of them (then "
                "results are in mine coordinates only)"
            )
        return self

    @property
    def has_place(self) -> bool:
        """Whether it says where on Earth the mine is: QuakeML cannot do without, all else can."""
        return self.crs is not None or self.latitude is not None
