"""A configuration as YAML reads it, converted to what its writer meant."""

import datetime
import math

from common.setting_types import LARGEST_INTEGER, key_of, short


def with_yaml_habits(value, odd: dict[str, str], path=()):
    """The value with dates as they are meant. odd: receives numbers that nothing can be computed with, by their keys.

    A text that looks like a number stays text: what a key wants is for its model to say (common.setting_types.number).
    """
    if isinstance(value, dict):
        return {str(key): with_yaml_habits(entry, odd, (*path, str(key))) for key, entry in value.items()}
    if isinstance(value, list):
        return [with_yaml_habits(entry, odd, (*path, index)) for index, entry in enumerate(value)]
    if isinstance(value, datetime.date | datetime.datetime):
        return value.isoformat()
    endless = isinstance(value, float) and not math.isfinite(value)
    if endless or (isinstance(value, int) and abs(value) > LARGEST_INTEGER):
        odd[key_of(path)] = f"{short(value)} is not a finite number that can be computed with"
    return value
