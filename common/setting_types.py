"""Settings, declared once: frozen models with the type, unit, bounds, default and meaning of each key.

A package has the models of its own settings, `workflow` composes them into a mine's configuration. A user writes
quantities as text with a unit; a stage's slice holds the same keys as numbers in the model's unit (SI, angles in
degrees). JSON schema, default file and table of keys are generated from the models (workflow/generate.py).
"""

import ast
import difflib
import functools
import inspect
import math
import re
import sys
from collections.abc import Callable, Mapping, Sequence
from itertools import pairwise
from typing import Annotated, Any, ClassVar, Self, Union

from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Discriminator,
    Field,
    GetJsonSchemaHandler,
    Tag,
    ValidationError,
    ValidationInfo,
    ValidatorFunctionWrapHandler,
    model_validator,
)
from pydantic_core import InitErrorDetails, PydanticCustomError, core_schema

from common.errors import InputErrors
from common.quantities import parse_quantity

SI = "SI"  # context of a validation: quantities are numbers already
TAG = "="  # begins the tag of a choice, which is no key of the user's
MAX_LENGTH_SHOWN = 60  # Characters of a wrong value that its message shows.
MAX_INTEGER = 2**63 - 1
EXPONENT = re.compile(r"[-+]?(\d+\.?\d*|\.\d+)[eE][-+]?\d+")  # a number that YAML 1.1 may read as text
BOUNDS = {"minimum": "ge", "exclusiveMinimum": "gt", "maximum": "le", "exclusiveMaximum": "lt"}  # JSON's name, ours
KEY_PATTERN = r"^[A-Za-z0-9_-]+(\.[A-Za-z0-9_-]+)+$"
NAME_PATTERN = "^[A-Za-z0-9][A-Za-z0-9_-]{0,63}$"
DATE_PATTERN = "^[0-9]{4}-[0-9]{2}-[0-9]{2}([T ][0-9:.]+Z?)?$"
INSTANT_PATTERN = "^[0-9]{4}-[0-9]{2}-[0-9]{2}([T ][0-9:.]+ ?(Z|[-+][0-9:]+)?)?$"
EXPECTED = {
    KEY_PATTERN: "keys from the top of the mine file, joined by dots, such as materials.host.cohesion.residual",
    NAME_PATTERN: "up to 64 letters, digits, - and _, of which the first is a letter or digit",
    DATE_PATTERN: "a date such as 2019-08-31 or 2019-08-31T06:00:00",
    INSTANT_PATTERN: "a date such as 2019-08-31 or 2019-08-31T06:00:00+10:00",
}


class Settings(BaseModel):
    """Base of all settings: frozen, no key that is not declared, a docstring below each key says what it means.

    A key that may be left out and has no default is None then; nobody may write so.
    """

    renamed_keys: ClassVar[Mapping[str, str]] = {}
    """Keys of earlier versions, which are refused, and what they are called now."""

    # defer_build: a stage imports many models, and validates one.
    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False, defer_build=True)

    @classmethod
    def meanings(cls) -> dict[str, str]:
        """What keys mean: the docstring below each, in this model or the one that it inherits the key from."""
        found: dict[str, str] = {}
        for model in [model for model in reversed(cls.__mro__) if issubclass(model, Settings)]:
            found |= _docstrings_below(model.__module__).get(model.__qualname__, {})
        return {key: text for key, text in found.items() if key in cls.__pydantic_fields__}

    @classmethod
    def __get_pydantic_json_schema__(cls, schema: core_schema.CoreSchema, handler: GetJsonSchemaHandler) -> dict:
        """The JSON schema says what keys mean."""
        part = handler(schema)
        keys = handler.resolve_ref_schema(part).get("properties", {})
        for key, text in cls.meanings().items():
            keys[key] = {"description": text} | keys[key]
        return part

    @classmethod
    def of(cls, values: "Mapping | Self", where: str = "") -> Self:
        """The settings of a stage's slice: keys as declared, quantities as numbers in their unit.

        where: key of the section, for messages. Raises InputErrors, a line for each mistake, naming its key.
        """
        return values if isinstance(values, cls) else cls._checked(values, where, SI)

    @classmethod
    def read(cls, values: Mapping, where: str = "") -> Self:
        """The settings as a user writes them, quantities as text with a unit. Raises InputErrors as `of`."""
        return cls._checked(values, where, None)

    @classmethod
    def _checked(cls, values, where: str, context) -> Self:
        try:
            return cls.model_validate(values, context=context)
        except ValidationError as error:
            raise InputErrors(mistake_lines(error, where)) from error

    def given(self) -> dict:
        """What was given, as plain values for a slice: no default, quantities as numbers in their unit."""
        return self.model_dump(mode="json", exclude_unset=True)

    @model_validator(mode="wrap")
    @classmethod
    def _only_known_keys(cls, values: Any, handler: ValidatorFunctionWrapHandler) -> Self:
        known = cls.__pydantic_fields__
        foreign = sorted(str(key) for key in values if key not in known) if isinstance(values, Mapping) else []
        if not foreign:
            return handler(values)
        near = {key: difflib.get_close_matches(key, known, n=1) for key in foreign}
        near |= {key: [cls.renamed_keys[key]] for key in foreign if key in cls.renamed_keys}
        found = []
        for key, meant in near.items():
            hint = f"did you mean {meant[0]}?" if meant else f"known here: {', '.join(known)}"
            reason = f"is called {meant[0]} now; rename it" if key in cls.renamed_keys else f"unknown key; {hint}"
            found.append(InitErrorDetails(type=refusal(reason, key), input=None))
        try:
            handler({key: value for key, value in values.items() if key in known})
        except ValidationError as error:
            not_missing = [[key] for meant in near.values() for key in meant]  # it stands there, with a slip
            found += [_again(other) for other in error.errors() if _path_of(other) not in not_missing]
        raise ValidationError.from_exception_data(cls.__name__, found)


@functools.cache
def _docstrings_below(module: str) -> dict[str, dict[str, str]]:
    """By class at the top of a module, what stands below its annotated names; nothing where there is no source.

    Read where it is shown: as a model is made (use_attribute_docstrings), it would take longer than all the rest.
    """
    try:
        statements = ast.parse(inspect.getsource(sys.modules[module])).body
    except OSError:
        return {}
    found: dict[str, dict[str, str]] = {}
    for one in [statement for statement in statements if isinstance(statement, ast.ClassDef)]:
        for pair in pairwise(one.body):
            match pair:
                case ast.AnnAssign(target=ast.Name(id=key)), ast.Expr(value=ast.Constant(value=str(text))):
                    found.setdefault(one.name, {})[key] = inspect.cleandoc(text)
    return found


def refusal(reason: str, *keys: str | int) -> PydanticCustomError:
    """What a validator of settings raises: the reason, and the key below that which is validated."""
    return PydanticCustomError("refused", "{reason}", {"reason": reason, "keys": keys})


def refuse(refusals: Sequence[PydanticCustomError]) -> None:
    """Raise what a validator of settings has found, all of it."""
    if refusals:
        details = [InitErrorDetails(type=found, input=None) for found in refusals]
        raise ValidationError.from_exception_data("settings", details)


def _again(found: Mapping) -> InitErrorDetails:
    """An error that pydantic has reported, to be raised again by an outer model."""
    kind, context = found["type"], found.get("ctx", {})
    own = PydanticCustomError("refused", "{reason}", context) if kind == "refused" else kind
    return InitErrorDetails(type=own, loc=found["loc"], input=found["input"], ctx=context)


def _path_of(found: Mapping) -> list[str | int]:
    """The key that an error of pydantic is about, without the tags of choices."""
    path = [part for part in found["loc"] if not (isinstance(part, str) and part.startswith((TAG, "[key]")))]
    return [*path, *found.get("ctx", {}).get("keys", ())]


class Unit:
    """Annotation of a float that a user writes as text with a unit, with bounds in that unit."""

    def __init__(self, unit: str, **bounds: float):
        """bounds: ge, gt, le, lt, as pydantic has them."""
        self.unit, self.bounds = unit, {name: bounds[ours] for name, ours in BOUNDS.items() if ours in bounds}
        self.low, self.high = bounds.get("ge", bounds.get("gt", -float("inf"))), bounds.get("le", bounds.get("lt"))
        self.open = [value for key, value in bounds.items() if key in ("gt", "lt")]

    def __get_pydantic_core_schema__(self, source, handler):
        """One call for each value: a large mine has 10^5 of them."""
        return core_schema.with_info_plain_validator_function(self.read)

    def __get_pydantic_json_schema__(self, schema, handler) -> dict:
        """Text, with this project's keyword `unit`; bounds are in that unit."""
        return {"type": "string", "unit": self.unit, **self.bounds}

    def read(self, value, info: ValidationInfo) -> float:
        """The number in the unit; a number as it is, where it comes from a slice."""
        is_number = isinstance(value, int | float) and not isinstance(value, bool)
        if info.context == SI and (is_number or hasattr(value, "dtype")):  # a number of numpy
            number = float(value)
        elif not isinstance(value, str):
            example = value if is_number else 1
            raise refusal(f"{short(value)} has no unit; write it as text with one, for example '{example} {self.unit}'")
        else:
            try:
                number = parse_quantity(value, self.unit)
            except ValueError as error:
                raise refusal(str(error)) from error
        above = self.high is not None and number > self.high
        if not number >= self.low or above or number in self.open:  # also refuses nan
            asked = ", ".join(f"{key} {bound:g} {self.unit}" for key, bound in self.bounds.items())
            raise refusal(f"{value} is out of range ({asked})")
        return number


def number(value: Any) -> Any:
    """The number of a text such as 1e-5, which YAML 1.1 reads as text: it expects a point and a sign, 1.0e-5."""
    return float(value) if isinstance(value, str) and EXPONENT.fullmatch(value) else value


def whole(value: Any) -> Any:
    """The same number as an integer, where it is one."""
    value = number(value)
    return int(value) if isinstance(value, float) and value.is_integer() else value  # 4.0 is an integer to JSON


def _plain_list(value: Any) -> Any:
    value = value.tolist() if hasattr(value, "tolist") else value  # an array of numpy
    return tuple(value) if isinstance(value, list) else value


def _without_repeats(values: tuple) -> tuple:
    for number, value in enumerate(values):
        if value in values[:number]:
            raise refusal(f"{short(value)} stands twice; leave one out", number)
    return values


def whole_number(**bounds: Any) -> Any:
    """The type of an integer within bounds, as pydantic has them (ge, le); 4.0 is one to JSON."""
    return Annotated[int, Field(**bounds), BeforeValidator(whole)]


def real_number(**bounds: Any) -> Any:
    """The type of a number without unit within bounds, as pydantic has them (ge, gt, le, lt)."""
    return Annotated[float, Field(**bounds), BeforeValidator(number)]


def choose(test: Callable[[Any], bool], first: Any, other: Any) -> Any:
    """A type that is `first` for values that pass the test, else `other`: mistakes are reported for the type meant."""
    return Annotated[
        Annotated[first, Tag(f"{TAG}first")] | Annotated[other, Tag(f"{TAG}other")],
        Discriminator(lambda value: f"{TAG}{'first' if test(value) else 'other'}"),
    ]


def one_of(key: str, models: Mapping[str, type[Settings]]) -> Any:
    """The type of a section whose `key` names the model that it is of; a key of other models is refused as such."""

    def of_a_model(values: Any) -> Any:
        if isinstance(values, Mapping):
            if key not in values:
                raise refusal(f"missing key: one of {', '.join(models)}", key)
            name = values[key]
            if name not in list(models):
                near = difflib.get_close_matches(str(name), models, n=1)
                hint = f"; did you mean {near[0]}?" if near else ""
                raise refusal(f"{short(name)} is not one of {', '.join(models)}{hint}", key)
            for other in values.keys() - models[name].model_fields.keys():
                users = [model for model, settings in models.items() if other in settings.model_fields]
                if users:
                    raise refusal(f"not used by {key} {name}, by {' and '.join(users)} only; leave it out", other)
        return values

    def tag(values: Any) -> str:
        return f"{TAG}{values.get(key) if isinstance(values, Mapping) else getattr(values, key, next(iter(models)))}"

    choices = tuple(Annotated[model, Tag(f"{TAG}{name}")] for name, model in models.items())
    return Annotated[Union[choices], Discriminator(tag), BeforeValidator(of_a_model)]  # noqa: UP007


def is_list(value: Any) -> bool:
    """Whether a value is a list, also as settings or a library hold it."""
    return (isinstance(value, Sequence) and not isinstance(value, str)) or bool(getattr(value, "ndim", 0))


def is_section(value: Any) -> bool:
    """Whether a value has keys."""
    return isinstance(value, Mapping | BaseModel)


Name = Annotated[str, Field(pattern=NAME_PATTERN)]
"""of files and folders, too"""
Date = Annotated[str, Field(pattern=DATE_PATTERN)]
Instant = Annotated[str, Field(pattern=INSTANT_PATTERN)]
"""a date that may have an offset from UTC"""
AsTuple = BeforeValidator(_plain_list)
"""JSON knows no tuples"""
EachOnce = AfterValidator(_without_repeats)
"""of a list in which a repeated entry has no meaning"""
# Bounds that are not physics keep slips of the keyboard out (radius 1e300): no mine or specimen comes near them.
Length = Annotated[float, Unit("m", ge=-1e8, le=1e8)]
Size = Annotated[float, Unit("m", ge=1e-6, le=1e8)]
Point = Annotated[tuple[Length, ...], Field(min_length=2, max_length=3), AsTuple]


def short(value) -> str:
    """A value as an error message shows it."""
    if isinstance(value, int) and abs(value) > MAX_INTEGER:
        return "an integer of 20 digits or more"  # of thousands of digits Python makes no text
    text = repr(list(value) if isinstance(value, tuple) else value)  # a user writes lists
    return text if len(text) <= MAX_LENGTH_SHOWN else f"{text[:MAX_LENGTH_SHOWN]}..."


def key_of(path) -> str:
    """A place in a configuration as a message names it: excavations[2].lower."""
    return "".join(
        f"[{part}]" if isinstance(part, int) else f".{str(part)[:MAX_LENGTH_SHOWN]}" for part in path if part != ""
    ).lstrip(".")


TYPES = {
    "model": "object",
    "dict": "object",
    "tuple": "array",
    "list": "array",
    "string": "string",
    "int": "integer",
    "float": "number",
    "bool": "boolean",
}


def mistake_lines(error: ValidationError, where: str = "") -> list[str]:
    """A configuration's mistakes, a line each: the key and what was expected."""
    lines = []
    for found in filter(_is_true, error.errors(include_url=False)):
        key, reason = key_of([*([where] if where else []), *_path_of(found)]), _reason(found)
        lines.append(f"{key}: {reason}" if key else reason)
    return list(dict.fromkeys(lines))


def _is_true(found: Mapping) -> bool:
    """False for a list or section that pydantic calls too short because it does not count entries with mistakes."""
    return found["type"] != "too_short" or len(found["input"]) < found["ctx"]["min_length"]


def _reason(found: Mapping) -> str:
    """The mistake in a value, in the form of JSON schema's messages."""
    kind, context, value = found["type"], found.get("ctx", {}), short(found["input"])
    if kind == "missing":
        return "missing key"
    if kind == "refused":
        return context["reason"]
    if kind == "literal_error":
        return f"{value} is not one of {context['expected'].replace(chr(39), '').replace(' or ', ', ')}"
    if kind == "string_pattern_mismatch":
        return f"{value} does not match: expected {EXPECTED[context['pattern']]}"
    if kind == "string_too_short":
        return f"{value} is an empty text"
    if kind == "string_too_long":
        return f"{value} has {len(found['input'])} characters; give at most {context['max_length']}"
    if kind in ("too_short", "too_long"):
        least = context.get("min_length")
        if least == 1:
            return f"{value} should be non-empty"
        needed = f"short; give at least {least}" if least else f"long; give at most {context['max_length']}"
        return f"{value} is too {needed}"
    for limit, words in (
        ("ge", "less than the minimum"),
        ("gt", "not above the minimum"),
        ("le", "greater than the maximum"),
        ("lt", "not below the maximum"),
    ):
        if limit in context:
            return f"{value} is {words} of {context[limit]:g}"
    if isinstance(found["input"], float) and not math.isfinite(found["input"]):
        return f"{value} is not a finite number that can be computed with"
    if kind == "string_type" and isinstance(found["input"], bool | int | float):
        what = "true or false" if isinstance(found["input"], bool) else "a number"
        return f"{value} is {what} to YAML; put the text in quotes"
    expected = next((name for part, name in TYPES.items() if kind.startswith(part)), None)
    if found["input"] is None and expected in ("object", "array"):
        return f"nothing stands below it; give it {'keys' if expected == 'object' else 'entries'}, or leave it out"
    return f"{value} is not of type '{expected}'" if expected else f"{value}: {found['msg']}"
