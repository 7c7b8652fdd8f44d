"""Declaration of a variable of a dataset: one form for all tables of variables, and one check."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr

from common.errors import InputError

TEXT = np.dtype(object)
FILE_REMEDY = "not a file of this version: delete it and run again"


@dataclass(frozen=True)
class Field:
    """One variable: its name, dimensions, type (TEXT for text), unit ("" for none) and meaning."""

    name: str
    dims: tuple[str, ...]
    dtype: Any  # whatever numpy accepts as a type; an np.dtype from then on
    unit: str
    meaning: str

    def __post_init__(self):
        object.__setattr__(self, "dtype", np.dtype(self.dtype))

    @property
    def attributes(self) -> dict[str, str]:
        """Attributes of the variable in a file."""
        return {"long_name": self.meaning} | ({"units": self.unit} if self.unit else {})

    def check(self, dataset: xr.Dataset, source: str, remedy: str = FILE_REMEDY) -> None:
        """Raise InputError, one line that names `source`, if the variable is missing or not as declared."""
        if self.name not in dataset.variables:
            raise InputError(f"{source}: {self.name} is missing; {remedy}")
        found = dataset.variables[self.name]
        for what, has, expected in (
            ("dimensions", ", ".join(map(str, found.dims)), ", ".join(self.dims)),
            ("type", _name(found.dtype), _name(self.dtype)),
            ("unit", found.attrs.get("units", ""), self.unit),
        ):
            if has != expected:
                raise InputError(f"{source}: {self.name}: {what} {has or 'none'}, not {expected or 'none'}; {remedy}")


def _name(dtype: np.dtype) -> str:
    """A type's name; text has several types."""
    return "text" if dtype.kind in "OUT" else str(dtype)
