"""Schema-driven reading of a configuration: units to SI numbers, and one-line errors that name the key."""

import contextlib
import datetime
import difflib
import math
import re
from functools import cache
from pathlib import Path

import jsonschema
import pint
import yaml

from pipeline.errors import InputError

SCHEMA = Path(__file__).parent / "schemas" / "config.schema.yaml"

QUANTITY = re.compile(r"(?P<number>[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?)\s*(?P<unit>[^\d\s].*)?")
POWER = r"(?:[^\W\d]\w*|°)(?:(?:\^|\*\*)[-+]?\d)?"  # m, m^3, s**-1
UNIT = re.compile(rf"{POWER}(?:(?:\s*[*/·]\s*|\s+){POWER})*")  # pint evaluates all it is given, 9**9**9 too
LONGEST = 100  # characters of a quantity
LARGEST_INTEGER = 2**63 - 1
SHOWN = 60  # characters of a wrong value that its message shows


@cache
def units() -> pint.UnitRegistry:
    """The unit registry (built once: that takes most of a second)."""
    return pint.UnitRegistry()


@cache
def schema() -> dict:
    """The configuration's JSON schema, with the keyword `unit` of ours."""
    return yaml.safe_load(SCHEMA.read_text())


def parse_quantity(text: str, unit: str) -> float:
    """The value of `text` ("57 GPa": a number, then its unit) in `unit`. Raises ValueError with the reason."""
    if len(text) > LONGEST:
        raise ValueError(f"{text[:30]!r}... is not a number with a unit: it has {len(text):,} characters")
    parts = QUANTITY.fullmatch(text.strip())
    if not parts:
        raise ValueError(f"{text!r} is not a number with a unit, for example '1.5 {unit}'")
    if not parts["unit"]:
        raise ValueError(f"{text!r} has no unit; write it as text with one, for example '{text} {unit}'")
    if not UNIT.fullmatch(parts["unit"]):
        raise ValueError(f"{text!r} has no unit that is known; expected one like {unit}, without arithmetic")
    try:
        number = float(units().Quantity(float(parts["number"]), parts["unit"]).to(unit).magnitude)
    except pint.DimensionalityError as error:
        raise ValueError(f"{text!r} is not convertible to {unit}") from error
    except Exception as error:  # pint raises a dozen kinds for text that is not a unit
        raise ValueError(f"{text!r} has no unit that is known; expected one like {unit} ({error})") from error
    if not math.isfinite(number):
        raise ValueError(f"{text!r} is not a finite number")
    return number


def _short(value) -> str:
    """A value as an error message shows it."""
    if isinstance(value, int) and abs(value) > LARGEST_INTEGER:
        return "an integer of 20 digits or more"  # of thousands of digits Python makes no text
    text = repr(value)
    return text if len(text) <= SHOWN else f"{text[:SHOWN]}..."


def _key(path) -> str:
    return "".join(f"[{part}]" if isinstance(part, int) else f".{part[:SHOWN]}" for part in path).lstrip(".")


def _with_yaml_habits(value, path=()):
    """Undo what YAML makes of dates and of 1e-5; refuse a number where a name is needed."""
    if isinstance(value, dict):
        return {str(key): _with_yaml_habits(entry, (*path, str(key))) for key, entry in value.items()}
    if isinstance(value, list):
        return [_with_yaml_habits(entry, (*path, index)) for index, entry in enumerate(value)]
    if isinstance(value, datetime.date | datetime.datetime):
        return value.isoformat()
    names = path and path[-1] in ("name", "step", "filled")
    if names and isinstance(value, int | float) and not isinstance(value, bool):
        raise InputError(
            f'{_key(path)}: {_short(value)} is a number to YAML; put the name in quotes: "{_short(value)}"'
        )
    if isinstance(value, str) and value[:1].isdigit() and "e" in value.lower() and not names:
        with contextlib.suppress(ValueError):
            value = float(value)  # YAML 1.1 reads 1e-5, without a point, as text
    endless = isinstance(value, float) and not math.isfinite(value)
    if endless or (isinstance(value, int) and abs(value) > LARGEST_INTEGER):
        raise InputError(f"{_key(path)}: {_short(value)} is not a finite number that can be computed with")
    return value


def _message(error: jsonschema.ValidationError) -> str:
    key = _key(error.absolute_path)
    value = error.instance
    if error.validator == "not":
        return f"{key}: not a key of this model"
    if error.validator == "additionalProperties":
        known = list(error.schema.get("properties", {}))
        unknown = sorted(set(value) - set(known))[0]
        near = difflib.get_close_matches(unknown, known, n=1)
        hint = f"did you mean {near[0]}?" if near else f"known here: {', '.join(known)}"
        return f"{_key((*error.absolute_path, unknown))}: unknown key; {hint}"
    if error.validator == "required":
        missing = next(name for name in error.validator_value if name not in value)
        return f"{_key((*error.absolute_path, missing))}: missing key"
    if "unit" in error.schema and error.validator == "type":
        number = value if isinstance(value, int | float) and not isinstance(value, bool) else 1
        unit = error.schema["unit"]
        return f"{key}: {_short(value)} has no unit; write it as text with one, for example '{number} {unit}'"
    if error.validator == "enum":
        return f"{key}: {_short(value)} is not one of {', '.join(map(str, error.validator_value))}"
    if error.validator == "pattern":
        return f"{key}: {_short(value)} does not match: expected {error.schema['description']}"
    return f"{key}: {error.message.replace(repr(value), _short(value))}"


def _leaves(error: jsonschema.ValidationError):
    return [leaf for part in error.context for leaf in _leaves(part)] if error.context else [error]


def check(config: dict) -> dict:
    """The configuration with YAML's habits undone. Raises InputError at the first thing the schema refuses."""
    config = _with_yaml_habits(config)
    errors = jsonschema.Draft202012Validator(schema()).iter_errors(config)
    leaves = [leaf for error in errors for leaf in _leaves(error)]
    if leaves:
        raise InputError(
            _message(max(leaves, key=lambda error: (len(error.absolute_path), error.validator != "const")))
        )
    return config


def to_si(value, part: dict | None = None, path=()):
    """A checked configuration with every quantity as a number in the schema's unit."""
    part = schema() if part is None else part
    if "$ref" in part:
        target = schema()
        for name in part["$ref"].removeprefix("#/").split("/"):
            target = target[name]
        part = {**target, **{key: entry for key, entry in part.items() if key != "$ref"}}
    if "anyOf" in part:
        validator = jsonschema.Draft202012Validator
        fits = (choice for choice in part["anyOf"] if validator({**choice, "$defs": schema()["$defs"]}).is_valid(value))
        return to_si(value, next(fits), path)
    if isinstance(value, dict):
        known, other = part.get("properties", {}), part.get("additionalProperties") or {}
        return {key: to_si(entry, known.get(key, other), (*path, key)) for key, entry in value.items()}
    if isinstance(value, list):
        return [to_si(entry, part.get("items", {}), (*path, index)) for index, entry in enumerate(value)]
    if "unit" not in part:
        return int(value) if part.get("type") == "integer" else value  # 4.0 is an integer to JSON
    try:
        number = parse_quantity(value, part["unit"])
    except ValueError as error:
        raise InputError(f"{_key(path)}: {error}") from error
    bounds = {key: part[key] for key in ("minimum", "maximum", "exclusiveMinimum", "exclusiveMaximum") if key in part}
    if not jsonschema.Draft202012Validator(bounds).is_valid(number):
        asked = ", ".join(f"{key} {bound:g} {part['unit']}" for key, bound in bounds.items())
        raise InputError(f"{_key(path)}: {value} is out of range ({asked})")
    return number
