"""Numbers and words of a CSV file's columns that filters use, and numbers that stand for a missing value."""

import itertools
from collections.abc import Mapping, Sequence

import numpy as np

from catalogs.records.csv_columns import MINE_COORDINATES
from catalogs.records.csv_table import Table
from catalogs.records.event_kinds import EVENT_TYPE, STATUS, flow_yaml, is_left_out, kept_words, plain_word
from common.errors import InputError
from common.frame import grid_of

MISSING_VALUE_CODES = (-99.0, -999.0, -9999.0)  # unless record.missing names others
OTHER_CODES = (-999.25, -9999.25, -32768.0, 32767.0)  # of well logs and of 16-bit numbers
MIN_NINES = 3  # A single number of fewer nines is asked about only if it occurs again.


def filter_columns(settings) -> dict[str, str]:
    """Key of the filter by the name of each column that a filter of numbers or words uses."""
    limits = settings.filter
    named = {
        name: f"record.filter.{key}.{name}"
        for key in ("maximum", "minimum", "only", "without")
        for name in (getattr(limits, key, None) or {})
    }
    kinds = {kind for kind in (EVENT_TYPE, STATUS) if getattr(settings.columns, kind) is not None}
    return {name: key for name, key in named.items() if name not in kinds}


def filter_numbers(table: Table, settings, codes: Sequence[float]) -> dict[str, np.ndarray]:
    """Columns of numbers (event,) by name, NaN where they hold none; codes: numbers that stand for a missing value.

    Only columns of which record.filter.maximum or minimum asks are checked: raises InputError for one that holds text,
    unless record.filter.without leaves events with that text out, and for numbers that look like a missing value.
    """
    limits = settings.filter
    bounded = {name: key for key in ("maximum", "minimum") for name in (getattr(limits, key, None) or {})}
    for name, key in bounded.items():
        text, values = table.text(name), table.numbers(name, strict=False)
        listed = (limits.without or {}).get(name, ())
        left_out = {plain_word(word) for word in ([listed] if isinstance(listed, str) else listed)}
        wrong = text[np.isnan(values) & (text != "").to_numpy()]
        wrong = wrong[~wrong.map(plain_word).isin(left_out)]
        if len(wrong):
            shown = ", ".join(repr(word) for word in list(dict.fromkeys(wrong))[:3])
            raise InputError(
                f"{table.source}: record.filter.{key}.{name}: {len(wrong)} of {len(text)} values are no numbers "
                f"({shown}); correct them, leave these events out by their text with record.filter.without.{name}, or "
                f"filter by another column: {', '.join(column for column in table.rows if column != name)}"
            )
        if settings.missing is None:
            check_other_codes(table.source, name, values)
    numbers = {name: table.numbers(name, strict=False) for name in (table.rows if bounded else ())}
    return {name: np.where(np.isin(values, codes), np.nan, values) for name, values in numbers.items()}


def check_other_codes(source: str, name: str, values: np.ndarray) -> None:
    """Raise InputError for numbers (event,) of nines that lie apart from all others: -9.9, 999, 9999, 99999.

    Apart is farther from the others than they are from each other. MISSING_VALUE_CODES are missing values without a
    question.
    """
    numbers, counts = np.unique(values[np.isfinite(values) & ~np.isin(values, MISSING_VALUE_CODES)], return_counts=True)
    looks = np.array([_looks_like_code(value, count) for value, count in zip(numbers, counts, strict=True)], bool)
    others = numbers[~looks]
    if not looks.any() or not len(others):
        return
    low, high = others[0], others[-1]
    width = max(high - low, 1.0)
    apart = looks & ((numbers > high + width) | (numbers < low - width))
    if apart.any():
        code, count = numbers[apart][0], int(counts[apart][0])
        stated = ", ".join(f"{one:.10g}" for one in (code, *MISSING_VALUE_CODES))
        raise InputError(
            f"{source}: column {name!r}: is {code:.10g} a missing value ({count} such; the others run from {low:g} to "
            f"{high:g})? Say it with record.missing: [{stated}], or [] if no number stands for one"
        )


def _looks_like_code(value: float, count: int) -> bool:
    digits = f"{abs(value):.10g}".replace(".", "")
    nines = len(digits) if set(digits) == {"9"} else 0
    return value in OTHER_CODES or nines >= MIN_NINES or (nines > 0 and count > 1 and (nines > 1 or value < 0))


def check_codes(key: str, codes: np.ndarray, factor: float, settings) -> None:
    """Raise InputError where usual codes of a missing value may as well be coordinates, of this domain.

    Outside the domain the question does not arise: the event is left out either way.
    """
    axis, up = ("z", -1.0) if key == "depth" else (key, 1.0)
    domain = settings.domain
    axes = (domain.plane or "xyz") if domain else ""
    if axis not in MINE_COORDINATES or axis not in axes:
        return
    ends = np.array([domain.lower, domain.upper])
    if settings.frame and settings.frame.grid and key != "depth":  # in 3-D: the box around the domain, in the grid
        ends = grid_of(settings.frame).to_grid(np.array(list(itertools.product(*ends.T))))
    low, high = ends.min(axis=0)[axes.index(axis)], ends.max(axis=0)[axes.index(axis)]
    place = up * factor * codes
    inside = (low <= place) & (place <= high)
    if inside.any():
        raise InputError(
            f"{settings.file}: column {getattr(settings.columns, key)!r}: {codes[inside][0]:g} stands for a missing "
            f"value in many files, and lies in this domain ({int(inside.sum())} such); say it with record.missing: a "
            "list of the numbers that do, [] if none does"
        )


def check_unnamed_kinds(table: Table, named: Mapping[str, str], settings) -> None:
    """Raise InputError for columns that the settings do not name and whose cells mark events as not seismic."""
    kept = kept_words(settings)
    questions: list[str] = []
    columns: dict[str, str] = {}
    words: dict[str, None] = {}
    for name in table.rows:
        if name in named:
            continue
        cells = table.text(name).value_counts()
        for kind in (EVENT_TYPE, STATUS):
            found = [cell for cell in cells.index if is_left_out(kind, word := plain_word(cell)) and word not in kept]
            if found and getattr(settings.columns, kind) is None:
                questions.append(f"column {name!r}: {cells[found[0]]} of {len(table.rows)} rows are {found[0]!r}")
                columns.setdefault(kind, name)
                words |= dict.fromkeys(found)
    if questions:
        keys = ", ".join(f"record.columns.{kind}: {name}" for kind, name in columns.items())
        raise InputError(
            f"{table.source}: {', '.join(questions)}, no seismicity: say {keys} to leave such out, or record.filter."
            f"keep: {flow_yaml(list(words))} to count them"
        )
