"""A configuration as YAML reads it, made what its writer meant."""

import contextlib
import datetime
import math

from pipeline.settings import LARGEST_INTEGER, key_of, short


def with_yaml_habits(value, odd: dict[str, str], path=()):
    """The value with dates and 1e-5 as they are meant. odd: receives what cannot be meant, by its key: a number where a
    name is needed, and one that is not finite."""
    if isinstance(value, dict):
        return {str(key): with_yaml_habits(entry, odd, (*path, str(key))) for key, entry in value.items()}
    if isinstance(value, list):
        return [with_yaml_habits(entry, odd, (*path, index)) for index, entry in enumerate(value)]
    if isinstance(value, datetime.date | datetime.datetime):
        return value.isoformat()
    names = path and path[-1] in ("name", "step", "filled")
    if names and isinstance(value, int | float) and not isinstance(value, bool):
        odd[key_of(path)] = f'{short(value)} is a number to YAML; put the name in quotes: "{short(value)}"'
        return value
    if isinstance(value, str) and value[:1].isdigit() and "e" in value.lower() and not names:
        with contextlib.suppress(ValueError):
            value = float(value)  # YAML 1.1 reads 1e-5, without a point, as text
    endless = isinstance(value, float) and not math.isfinite(value)
    if endless or (isinstance(value, int) and abs(value) > LARGEST_INTEGER):
        odd[key_of(path)] = f"{short(value)} is not a finite number that can be computed with"
    return value
