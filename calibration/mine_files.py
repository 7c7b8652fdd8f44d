"""Mine files with other values of the calibrated quantities."""

import copy
import difflib
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import yaml

from calibration.settings import EVENT_SECTION, CalibratedQuantity, cohesion_of, friction_key, strength_under
from common.datasets import atomic_path
from common.errors import InputError
from common.job import content_hash
from common.quantities import parse_quantity

STAMP = "# posterior: "
HEADER = "# {name}: a calibrated mine. These keys follow from a calibration, all others from the mine's own file:\n"


class _Key:
    """A value of a configuration by its key: the section that holds it and its name there."""

    def __init__(self, text: dict, key: str, where: str):
        """Raises InputError where the configuration lacks a part of the key: a slip in it must not add a key that
        nothing reads. where: what names the key, for messages."""
        section: Any = text
        parts = key.split(".")
        for depth, part in enumerate(parts):
            known = _names_in(section)
            if part not in known and key.startswith(EVENT_SECTION) and isinstance(section, dict):
                section[part] = {} if depth < len(parts) - 1 else None  # left at its default; checked with the mine
            elif part not in known:
                near = difflib.get_close_matches(part, known, n=1)
                meant = f"did you mean {'.'.join([*parts[:depth], near[0]])}?" if near else "write it there first"
                raise InputError(f"{where}: the mine file has no {key}; {meant}")
            self.section, self.name = section, known.get(part, part)
            section = section[self.name]

    @property
    def value(self) -> Any:
        """The value that the configuration has there."""
        return self.section[self.name]

    def write(self, value: str | float) -> None:
        """Put another value there."""
        self.section[self.name] = value


def _names_in(section: Any) -> dict[str, Any]:
    """Names by which a key finds the entries of a section, and how each is stored: those of a list have a `name`."""
    if isinstance(section, dict):
        return {str(name): name for name in section}
    if isinstance(section, list):
        return {
            str(entry["name"]): number
            for number, entry in enumerate(section)
            if isinstance(entry, dict) and "name" in entry
        }
    return {}


def with_values(text: dict, quantities: Sequence[CalibratedQuantity], shares: Iterable[float]) -> dict:
    """A copy of a mine's configuration with each quantity at a share of its range.

    A cohesion that is given by a strength follows from the friction angle that the copy has. Raises InputError where
    the configuration lacks a key, or no cohesion has the strength.
    """
    changed = copy.deepcopy(text)
    by_strength = []
    for number, (quantity, share) in enumerate(zip(quantities, shares, strict=True)):
        where = f"calibration.quantities[{number}]"
        key = _Key(changed, quantity.key, f"{where}.key")
        if quantity.confinement is None:
            key.write(quantity.written(float(share)))
        else:
            by_strength.append((where, key, quantity, float(share)))
    for where, key, quantity, share in by_strength:
        key.write(_cohesion(changed, quantity, share, where))
    return changed


def copied_values(text: dict, source: dict, quantities: Sequence[CalibratedQuantity]) -> dict:
    """A copy of a mine's configuration with the quantities as another one has them. Raises InputError where either
    lacks a key."""
    changed = copy.deepcopy(text)
    for number, quantity in enumerate(quantities):
        where = f"calibration.quantities[{number}].key"
        _Key(changed, quantity.key, where).write(_Key(source, quantity.key, where).value)
    return changed


def given_share(text: dict, quantity: CalibratedQuantity, where: str) -> float:
    """Value of a quantity in the configuration itself, as a share of its range. Raises InputError as `with_values`."""
    written = _Key(text, quantity.key, f"{where}.key").value
    try:
        if quantity.confinement is None:
            return quantity.share(parse_quantity(str(written), quantity.unit) if quantity.unit else float(str(written)))
        friction = _Key(text, friction_key(quantity.key), f"{where}.confinement").value
        cohesion = parse_quantity(str(written), "Pa")
        strength = strength_under(quantity.confinement, cohesion, parse_quantity(str(friction), "deg"))
        return quantity.share(strength / parse_quantity(f"1 {quantity.unit}", "Pa"))
    except ValueError as error:
        raise InputError(f"{where}.range: {error}") from error


def _cohesion(text: dict, quantity: CalibratedQuantity, share: float, where: str) -> str:
    """The cohesion, as a mine file has it, of rock with this strength and the friction angle of the configuration."""
    written = _Key(text, friction_key(quantity.key), f"{where}.confinement").value
    try:
        friction = parse_quantity(str(written), "deg")
        strength = parse_quantity(str(quantity.written(share)), "Pa")
    except ValueError as error:
        raise InputError(f"{where}.range: {error}") from error
    cohesion = cohesion_of(strength, quantity.confinement, friction)
    if cohesion < 0.0:
        raise InputError(
            f"{where}.range: a strength of {quantity.written(share)} under {quantity.confinement / 1e6:g} MPa is less "
            f"than friction of {written} alone gives; raise the range's lower end, or lower the confinement"
        )
    return f"{float(f'{cohesion:.6g}'):.6g} Pa"


def write_mine(
    path: Path, text: dict, quantities: Sequence[CalibratedQuantity], shares: Iterable[float], posterior: str
) -> None:
    """Write a mine file, whole or not at all; the mine's name takes that of the file, so that its results part.

    posterior: hash of what the calibration depends on, by which `is_draw_of` knows the file.
    """
    changed = with_values(text, quantities, shares)
    changed["name"] = f"{text['name']}_{path.stem}"
    header = HEADER.format(name=path.stem) + "".join(
        f"#   {quantity.title}: {quantity.written(float(share))}\n"
        for quantity, share in zip(quantities, shares, strict=True)
    )
    with atomic_path(path) as temporary:
        body = header + yaml.safe_dump(changed, sort_keys=False, allow_unicode=True)
        temporary.write_text(stamped(body, posterior), encoding="utf-8")


def stamped(body: str, posterior: str) -> str:
    """Text of a mine file with a first line that names posterior and content together."""
    return f"{STAMP}{content_hash(posterior + body)}\n{body}"


def is_draw_of(path: Path, posterior: str) -> bool:
    """True if a mine file is one that the calibration with this hash wrote, and is as it was written."""
    text = path.read_text(encoding="utf-8", errors="replace")
    return text == stamped(text.partition("\n")[2], posterior)
