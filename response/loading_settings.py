"""The section `loading_measures` of a mine file, and the slice of its stage."""

from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from catalogs.settings import InsituStress
from common.setting_types import AsTuple, EachOnce, Name, Point, Settings, Size, Unit, refusal

ENERGY, PLASTIC, STIFFNESS, SHEAR = (
    "energy_release_rate",
    "plastic_work",
    "loading_stiffness",
    "excess_shear_stress",
)


class ShearPlane(Settings):
    """A plane on which excess shear stress is found: by a point, strike and dip, or as the weak planes of a rock."""

    name: Name
    """Name of the plane in the table."""
    point: Annotated[Point, Field(min_length=3)] = None
    """A point of the plane: x, y and z of the mine file."""
    strike: Annotated[float, Unit("deg", ge=-360, le=360)] = None
    """Direction of the plane's horizontal line, clockwise from the map's north. The plane dips to the right of it."""
    dip: Annotated[float, Unit("deg", ge=0, le=90)] = None
    """Angle between the plane and the horizontal: 90 deg is upright."""
    radius: Size = None
    """Radius of the part of the plane around the point that counts. Default: the point alone."""
    material: str = None
    """Name of a material with `model: weak_planes`, in place of point, strike and dip: all rock of it, with its own
    planes. So a fault is named that is a rock body."""

    @model_validator(mode="after")
    def _one_kind(self) -> Self:
        needed = ("point", "strike", "dip")
        given = [key for key in (*needed, "radius") if getattr(self, key) is not None]
        if self.material is not None and given:
            raise refusal("stands beside material, which has planes of its own; leave one of the two out", given[0])
        if self.material is None and (missing := [key for key in needed if key not in given]):
            raise refusal("missing key: give point, strike and dip, or material", missing[0])
        return self


class LoadingSettings(Settings):
    """Measures of how mining loads the rock, by step, opening and plane: energy that mining releases, plastic work,
    stiffness of the rock around what is mined, and excess shear stress."""

    measures: Annotated[
        tuple[Literal["energy_release_rate", "plastic_work", "loading_stiffness", "excess_shear_stress"], ...],
        Field(min_length=1),
        AsTuple,
        EachOnce,
    ] = None
    """Measures that are given. Default: all; excess shear stress only with `planes`."""
    dynamic_friction: Annotated[float, Unit("deg", ge=0, lt=90)] = 30.0
    """Angle of friction of planes that slip. Excess shear stress is what shear stress exceeds the normal stress times
    its tangent by (Ryder 1988)."""
    planes: Annotated[tuple[ShearPlane, ...], AsTuple] = ()
    """Planes on which excess shear stress is found."""

    @property
    def wanted(self) -> tuple[str, ...]:
        """Names of the measures that are given."""
        return self.measures or (ENERGY, PLASTIC, STIFFNESS, *((SHEAR,) if self.planes else ()))

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        if self.planes and SHEAR not in self.wanted:
            raise refusal(f"stand without {SHEAR}; name it in measures, or leave them out", "planes")
        if not self.planes and SHEAR in self.wanted:
            raise refusal(f"missing; {SHEAR} needs planes that it is found on", "planes")
        names = [plane.name.lower() for plane in self.planes]
        for number, name in enumerate(names):
            if name in names[:number]:
                raise refusal("stands twice; planes need names of their own", "planes", number, "name")
        return self


class LoadedOpening(Settings):
    """An excavation: its name, the step that mines it (empty where none does), whether this step fills it, too, and the
    pressure (Pa) on its walls at the end of the step."""

    name: str
    mined: str
    filled: bool
    pressure: float


class LoadingSlice(Settings):
    """The slice of stage `loading`."""

    loading_measures: LoadingSettings
    steps: Annotated[tuple[str, ...], AsTuple]
    """names, in order"""
    excavations: Annotated[tuple[LoadedOpening, ...], AsTuple]
    insitu: InsituStress
