"""Rock from a block model: which material and which values each block has, as a mine's file says it."""

import itertools
from typing import Annotated, Any, Literal, NamedTuple, Self

import numpy as np
from pydantic import BeforeValidator, Field, model_validator

from common.mine_grid import MineGrid
from common.setting_types import AsTuple, Settings, Size, Unit, is_section, real_number, refusal

MAX_KINDS = 1000  # A cell's rock is the number of its kind; each is a material of its own.
Sizes = Annotated[tuple[Size, ...], Field(min_length=3, max_length=3), AsTuple]


def class_text(value: Any) -> str:
    """A class as text: a number of a code without decimals, 3 for 3.0."""
    if isinstance(value, bool | np.bool_):
        return str(value).lower()
    return f"{value:.15g}" if isinstance(value, int | float) else str(value).strip()


def _by_class(value: Any) -> Any:
    return {class_text(key): material for key, material in value.items()} if is_section(value) else value


class BlockColumns(Settings):
    """Names of the columns of a CSV file. Common names, such as XC, x, centroid_x, dx, xinc or dim_x, need no key."""

    x: str = None
    """Column of x of the middle of a block."""
    y: str = None
    """Column of y of the middle of a block."""
    z: str = None
    """Column of z of the middle of a block."""
    dx: str = None
    """Column of the side of a block along x."""
    dy: str = None
    """Column of the side of a block along y."""
    dz: str = None
    """Column of the side of a block along z."""


class BlockClasses(Settings):
    """A column of classes, and the material of each class."""

    column: str
    """Name of the column, or of the data of an OMF element."""
    materials: Annotated[
        dict[Annotated[str, Field(max_length=200)], str], Field(min_length=1), BeforeValidator(_by_class)
    ]
    """Name of the material of each class: {ORE: ore, WASTE: host, 3: dyke}."""
    others: str = None
    """Name of the material of blocks of all other classes, and of blocks without a class. Without this key a class that
    is not named is an error."""


class BlockProperty(Settings):
    """A column of values, of which each block takes the nearest of some."""

    column: str
    """Name of the column, or of the data of an OMF element."""
    unit: str = None
    """Unit of the column and of values. Without a unit for numbers that have none."""
    values: Annotated[tuple[real_number(gt=0), ...], Field(min_length=1, max_length=50), AsTuple]
    """The values that rock may have, in ascending order. A block takes the one that differs by the smallest factor."""

    @model_validator(mode="after")
    def _ascending(self) -> Self:
        if any(one >= other for one, other in itertools.pairwise(self.values)):
            raise refusal("are not in ascending order", "values")
        return self


class Kind(NamedTuple):
    """One kind of rock of a block model: name of its material, and the value of each property, None for the
    material's own."""

    material: str
    values: tuple[float | None, ...]


class BlockModel(Settings):
    """Rock from a block model. A cell takes the rock of the block that its middle lies in. Rock outside of all blocks
    is `host`, and rock_bodies replace what they cover. The sides of blocks are parallel to x, y and z of the file, or
    turned by angle."""

    file: str
    """CSV file, with a row for each block, or OMF project, relative to the mine file. Coordinates are those of the
    mine's grid (frame.grid), if it has one."""
    element: str = None
    """Name of the block model in an OMF project that has several."""
    columns: BlockColumns = BlockColumns()
    size: Sizes = None
    """Sides of all blocks along x, y and z, for a CSV file that has no columns of them."""
    angle: Annotated[float, Unit("deg", ge=-360, le=360)] = None
    """Angle from y of a CSV file, towards its x, to the second axis of the blocks. The sides dx, dy and dz
    are along the axes of the blocks. Default: 0 deg."""
    units: Literal["m", "ft", "us_ft"] = None
    """Unit of the file's coordinates and sides. Default: that of an OMF project, that of frame.grid, or m."""
    counted_first: Literal["u", "w"] = None
    """Which index of its blocks an OMF 1 project counts first, u (as OMF 2 does) or w. The format does not say it, and
    programs differ. Compare the picture of target `scene` with that of your own program."""
    classes: BlockClasses = None
    """Materials by class."""
    material: str = None
    """Name of the material of all blocks, in place of classes."""
    properties: Annotated[dict[str, BlockProperty], Field(max_length=4)] = Field(default={})
    """Keys of the materials whose values the blocks give, such as youngs_modulus, cohesion or sigma_ci. Where the key
    has values of intact and of failed rock, the block gives that of intact rock, and the other one keeps its share of
    it. A material without the key stays as it is, and so does rock of a block without a number above 0."""

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        if (self.classes is None) == (self.material is None):
            raise refusal("give either classes or one material", "classes")
        kinds = len(self.kinds())
        if kinds > MAX_KINDS:
            raise refusal(f"make {kinds:,} kinds of rock; give fewer values ({MAX_KINDS:,} are possible)", "properties")
        return self

    def materials(self) -> tuple[str, ...]:
        """Names of the materials that blocks may have, each once."""
        if self.classes is None:
            return (str(self.material),)
        others = [self.classes.others] if self.classes.others else []
        return tuple(dict.fromkeys([*self.classes.materials.values(), *others]))

    def kinds(self) -> tuple[Kind, ...]:
        """All kinds of rock, in the order of their numbers: the last property changes first."""
        values = [(None, *one.values) for one in self.properties.values()]
        return tuple(Kind(name, chosen) for name in self.materials() for chosen in itertools.product(*values))

    def kind_name(self, kind: Kind) -> str:
        """Name of the material of a kind: that of the material, and the values that differ."""
        own = [
            f"{key} {value:g}{f' {one.unit}' if one.unit else ''}"
            for (key, one), value in zip(self.properties.items(), kind.values, strict=True)
            if value is not None
        ]
        return f"{kind.material} ({', '.join(own)})" if own else kind.material


class PlacedBlocks(BlockModel):
    """A block model in the slice of a stage. Its file has the coordinates of the mine's grid."""

    grid: MineGrid = None
    """grid of the coordinates of its file, if that is not the map's"""
