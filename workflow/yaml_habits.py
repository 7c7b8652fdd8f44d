"""A configuration as YAML reads it, made what its writer meant."""

import contextlib
import datetime
import math

from pipeline.errors import InputError
from pipeline.settings import LARGEST_INTEGER, key_of, short


def with_yaml_habits(value, path=()):
    """Undo what YAML makes of dates and of 1e-5. Raises InputError for a number where a name is needed."""
    if isinstance(value, dict):
        return {str(key): with_yaml_habits(entry, (*path, str(key))) for key, entry in value.items()}
    if isinstance(value, list):
        return [with_yaml_habits(entry, (*path, index)) for index, entry in enumerate(value)]
    if isinstance(value, datetime.date | datetime.datetime):
        return value.isoformat()
    names = path and path[-1] in ("name", "step", "filled")
    if names and isinstance(value, int | float) and not isinstance(value, bool):
        raise InputError(
            f'{key_of(path)}: {short(value)} is a number to YAML; put the name in quotes: "{short(value)}"'
        )
    if isinstance(value, str) and value[:1].isdigit() and "e" in value.lower() and not names:
        with contextlib.suppress(ValueError):
            value = float(value)  # YAML 1.1 reads 1e-5, without a point, as text
    endless = isinstance(value, float) and not math.isfinite(value)
    if endless or (isinstance(value, int) and abs(value) > LARGEST_INTEGER):
        raise InputError(f"{key_of(path)}: {short(value)} is not a finite number that can be computed with")
    return value
