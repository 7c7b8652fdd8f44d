"""Mine files with other values of the calibrated quantities."""

import copy
import difflib
from collections.abc import Sequence
from pathlib import Path

import yaml

from calibration.settings import CalibratedQuantity
from common.datasets import atomic_path
from common.errors import InputError

HEADER = "# {name}: a calibrated mine. These keys follow from a calibration, all others from the mine's own file:\n"


def with_values(text: dict, quantities: Sequence[CalibratedQuantity], shares: Sequence[float]) -> dict:
    """A copy of a mine's configuration with each quantity at a share of its range.

    Raises InputError where the configuration lacks a key: a slip in it must not add a key that nothing reads.
    """
    changed = copy.deepcopy(text)
    for number, (quantity, share) in enumerate(zip(quantities, shares, strict=True)):
        section, parts = changed, quantity.key.split(".")
        for depth, part in enumerate(parts):
            if not isinstance(section, dict) or part not in section:
                known = list(section) if isinstance(section, dict) else []
                near = difflib.get_close_matches(part, map(str, known), n=1)
                hint = f"; did you mean {'.'.join([*parts[:depth], near[0]])}?" if near else ""
                raise InputError(f"calibration.quantities[{number}].key: the mine file has no {quantity.key}{hint}")
            if depth < len(parts) - 1:
                section = section[part]
        section[parts[-1]] = quantity.written(float(share))
    return changed


def write_mine(path: Path, text: dict, quantities: Sequence[CalibratedQuantity], shares: Sequence[float]) -> None:
    """Write a mine file, whole or not at all; the mine's name takes that of the file, so that its results part."""
    changed = with_values(text, quantities, shares)
    changed["name"] = f"{text['name']}_{path.stem}"
    header = HEADER.format(name=path.stem) + "".join(
        f"#   {quantity.key}: {quantity.written(float(share))}\n"
        for quantity, share in zip(quantities, shares, strict=True)
    )
    with atomic_path(path) as temporary:
        temporary.write_text(header + yaml.safe_dump(changed, sort_keys=False, allow_unicode=True), encoding="utf-8")
