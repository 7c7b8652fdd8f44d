"""Dates of a configuration."""

import datetime

from catalogs.records.times import FIRST_YEAR, LAST_YEAR, check_offset
from common.errors import InputError


def read_date(where: str, text: str) -> datetime.datetime:
    """The instant that a date of the configuration means, UTC. Raises InputError for what is no date."""
    check_offset(text, where)
    try:
        date = datetime.datetime.fromisoformat(text)
    except ValueError as error:
        raise InputError(f"{where}: {text!r} is not a date ({error})") from error
    if not FIRST_YEAR <= date.year <= LAST_YEAR:
        raise InputError(f"{where}: {text}: give a year from {FIRST_YEAR} to {LAST_YEAR}")
    return date if date.tzinfo else date.replace(tzinfo=datetime.UTC)


def is_date(text: str) -> bool:
    """True if a text is a date that read_date accepts."""
    try:
        read_date("", text)
    except InputError:
        return False
    return True
