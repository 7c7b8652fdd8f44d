"""Kept forecasts: outcomes of plans that nothing can make again, since their months are recorded by now.

A message on one never asks to delete it.
"""

import json
import os

import numpy as np
import xarray as xr

from catalogs.settings import ALL_STEPS
from common.datasets import read_dataset
from common.errors import InputError
from plans.layout import ANY, check_outcome

LEAVE_OUT = "leave it out of `forecasts`"
RESTORE = f"a forecast cannot be made again: restore it from a copy, or {LEAVE_OUT}"
OTHER_VERSION = (
    f"not a forecast of this version of the program: keep it, since it cannot be made again, and {LEAVE_OUT}, or score "
    "it with the version that made it"
)


def read_forecast(path: str | os.PathLike, key: str) -> xr.Dataset:
    """The outcome of a kept forecast; key: of the mine file, for messages.

    Raises InputError for a file that is missing, damaged or of another version, and for one whose attributes or dates
    were changed into what no outcome has.
    """
    try:
        outcome = read_dataset(path, remedy=RESTORE)
        outcome = check_outcome(outcome, os.fspath(path), OTHER_VERSION)
    except InputError as error:
        raise InputError(f"{key}: {error}") from error
    if reason := _spoiled(outcome):
        raise InputError(f"{key}: {os.fspath(path)}: {reason}: the file was changed; {RESTORE}")
    return outcome


def _spoiled(outcome: xr.Dataset) -> str:
    """The first of its attributes, names and dates that no outcome has, in words; empty if all are sound."""
    attributes, steps = outcome.attrs, [str(name) for name in outcome["step"].values]
    for name in ("mine", "plan", "recorded_until", "steps_ahead"):
        if not isinstance(attributes[name], str):
            return f"attribute {name} is no text"
    for name in ("floor", "shared_floor"):
        if not isinstance(attributes[name], float | int | np.number):
            return f"attribute {name} is no number"
    if attributes["recorded_until"] and not _is_date(attributes["recorded_until"]):
        return "attribute recorded_until is no date"
    try:
        ahead = json.loads(attributes["steps_ahead"])
    except ValueError:
        return "attribute steps_ahead is no JSON"
    if not isinstance(ahead, list) or not all(name in steps for name in ahead):
        return "attribute steps_ahead does not list steps of it"
    if len(set(steps)) < len(steps) or [str(name) for name in outcome["period"].values] != [*steps, ALL_STEPS]:
        return "its periods are not its steps"
    if ANY not in outcome["opening"].values:
        return f"opening '{ANY}' is missing"
    for step, start, end in zip(steps, outcome["start"].values, outcome["end"].values, strict=True):
        if not (_is_date(start) and _is_date(end) and np.datetime64(start) < np.datetime64(end)):
            return f"the dates of step {step}, {start} to {end}, are no period"
    return ""


def _is_date(text: object) -> bool:
    """True for a date that numpy can read."""
    try:
        return not np.isnat(np.datetime64(str(text), "ns"))
    except ValueError:
        return False
