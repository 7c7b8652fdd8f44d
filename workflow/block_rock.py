"""Rock from a block model in a mine's configuration: its file, its materials, and those that its values make."""

from typing import Any

from common.errors import InputError, Mistakes
from common.setting_types import Unit, is_section
from mpm_core.block_settings import BlockModel, Kind
from mpm_core.constitutive.laws import Materials
from mpm_core.settings import MaterialSettings
from workflow.mine import Mine
from workflow.shapes import is_file


def check_blocks_form(mine: Mine, mistakes: Mistakes) -> None:
    """Add a line for each file, material and property of a block model that does not exist."""
    model, materials = mine.settings.block_model, mine.settings.materials
    if model is None:
        return
    with mistakes.gather():
        if mine.dimension == 2:
            raise InputError("block_model: a plane strain scene has no block model; give rock_bodies")
    with mistakes.gather():
        if not is_file(mine.path(model.file)):
            raise InputError(f"block_model.file: {mine.path(model.file)} is missing; paths resolve from {mine.folder}")
    for name in model.materials():
        with mistakes.gather():
            if name not in materials:
                raise InputError(f"block_model: '{name}' is not one of the materials {', '.join(materials)}")
    known = [materials[name] for name in model.materials() if name in materials]
    for key in model.properties:
        with mistakes.gather():
            having = [material for material in known if _has(material, key)]
            if model.properties[key].unit is None and (units := {_unit(material, key) for material in having} - {None}):
                raise InputError(
                    f"block_model.properties.{key}.unit: missing key; its numbers are in {units.pop()}, or another unit"
                )
            if known and not any(_has(material, key) for material in known):
                keys = sorted({one for material in known for one in type(material).model_fields if _has(material, one)})
                raise InputError(
                    f"block_model.properties.{key}: is no number of {', '.join(model.materials())}; they have "
                    f"{', '.join(keys)}"
                )


def add_block_materials(mine: Mine, _: Mistakes) -> None:
    """Add the materials that the values of a block model make to those of the mine. Raises InputError for one that is
    no rock."""
    model, materials = mine.settings.block_model, dict(mine.settings.materials)
    if model is None:
        return
    for kind in model.kinds():
        name = model.kind_name(kind)
        if name not in materials:
            materials[name] = _made(model, kind, materials[kind.material], name)
    mine.settings = mine.settings.model_copy(update={"materials": materials})


def _has(material: MaterialSettings, key: str) -> bool:
    """Whether a material has a key whose value is a number, or one for intact and one for failed rock."""
    if key not in type(material).model_fields:
        return False
    value = getattr(material, key)
    return hasattr(value, "intact") or (isinstance(value, float) and not isinstance(value, bool))


def _unit(material: MaterialSettings, key: str) -> str | None:
    """SI unit of a key's number; None where it has none."""
    value, field = getattr(material, key), type(material).model_fields[key]
    if hasattr(value, "intact"):
        field = type(value).model_fields["intact"]
    return next((part.unit for part in field.metadata if isinstance(part, Unit)), None)


def _made(model: BlockModel, kind: Kind, material: MaterialSettings, name: str) -> MaterialSettings:
    """The material of a kind. Raises InputError."""
    values = material.given()
    for (key, one), value in zip(model.properties.items(), kind.values, strict=True):
        if value is not None and _has(material, key):
            values[key] = _replaced(values[key], value, one.unit)
    try:
        return Materials.of({"materials": {name: values}}).materials[name]
    except InputError as error:
        raise InputError(f"block_model.properties: {str(error).splitlines()[0]}") from error


def _replaced(old: Any, value: float, unit: str | None) -> Any:
    """A value in its unit in place of an old one, or of that of intact rock: the other keeps its share of it."""

    def quantity(number: float) -> str | float:
        return f"{number!r} {unit}" if unit else number

    if not is_section(old):
        return quantity(value)
    share = old["residual"] / old["intact"] if old["intact"] else 0.0
    return {"intact": quantity(value), "residual": quantity(share * value)}
