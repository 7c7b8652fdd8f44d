"""The part of a record that is compared: complete events, a box, dates, sizes, quality columns, the model's domain.

Each keeps its count before and after, so that the report can say what was left out.
"""

import json
import logging
from collections.abc import Iterable, Mapping

import numpy as np
import xarray as xr

from catalogs.records.event_kinds import EVENT_TYPE, no_seismicity, plain_word, types_text
from catalogs.records.settings import DomainBox, RecordSlice
from catalogs.records.times import FIRST, LAST, parse_time, recorded_period
from common.errors import InputError

DOMAIN_FILTER = "domain"
MAX_WIDTHS_FROM_DOMAIN = 10.0  # Farther from the domain than so many of its widths, coordinates are not the mine's.
MAX_SHARE_OUTSIDE_UNTOLD = 0.1  # A larger share of events outside the domain is a warning.
MAX_SHARE_OTHER_TIME_UNTOLD = 0.9  # A larger share of events outside the modelled months is a warning.
MAX_TEXTS_SHOWN = 6  # Texts of a column that a message shows.
MAX_COORDINATE = 1e8  # m, more than twice the circumference of the Earth.


def limits_of(settings: RecordSlice) -> dict:
    """The filters of a record: what the configuration names, its dates within the modelled months."""
    chosen = settings.filter.given() if settings.filter else {}
    period = settings.period.given() if settings.period else {}
    for key, choose in (("start", max), ("end", min)):
        if period.get(key):
            own = [chosen[key]] if chosen.get(key) else []
            chosen[key] = choose([period[key], *own], key=lambda text: parse_time(text, "record.filter"))
    return chosen


def filter_events(
    events: xr.Dataset,
    settings: RecordSlice,
    columns: Mapping[str, np.ndarray] | None = None,
    source: str = "record",
    repeated: np.ndarray | None = None,
    words: Mapping[str, np.ndarray] | None = None,
    kinds: Mapping[str, np.ndarray] | None = None,
) -> xr.Dataset:
    """The complete events that pass every filter and lie in the domain; attrs["filter"]: what each left out (JSON).

    attrs["rows"]: events of the file; attrs["dropped"] (JSON): how many of them are no seismicity
    (`no_seismicity`), lack a time, a place or a size, or are `repeated` (event,) bool.
    attrs["types_text"]: how many of the others are of each type, where the file says it. Each entry of
    attrs["filter"] holds filter, value, before, after; the domain's, which is the last, also potency_before and
    potency_after (m3), nearest and farthest (m: of an event left out, from the domain; null if there is none).

    settings: filter (lower, upper: 3 numbers in m, a box, its faces included; start, end: ISO text, start <= time <
    end, UTC; minimum_potency in m3; maximum and minimum: {column: value}, quality columns of the file in its own
    units; only and without: {column: text or texts}); period (start and end of the modelled months); domain (lower,
    upper in m, plane: "xz", "xy" or null; absent: no crop). columns, words: name -> (event,) numbers, and texts, of the
    file; kinds: event types and evaluation statuses, which filters name so, too, where the file has no column of that
    name. A missing number passes no filter; of texts upper and lower case, _ and blanks are the same.

    Raises InputError naming `source` and the key for an unknown column, a bad date, when a filter of the configuration
    leaves no event, when all lie MAX_WIDTHS_FROM_DOMAIN times as far from the domain as it or the record is wide (such
    a record is of other ground), when it was recorded before or after the modelled months, or when no event is left and
    settings.quiet does not state so. A stated record without events is a result: nothing happened.
    attrs["period"] (JSON): modelled, recorded and common, each start and end, ISO, UTC. attrs["stated_end"]: the end
    that the configuration states.
    """
    where = f"{source}: record.filter"
    chosen = settings.filter.given() if settings.filter else {}
    check_places(events["location"].values, source)
    columns = columns or {}
    kinds = kinds or {}
    other = no_seismicity(kinds, settings, source)
    whole, dropped = _whole_events(events, other, repeated, source)
    if incomplete := [f"{count} {what}" for what, count in dropped.items() if what not in other]:
        logging.warning("%s: of %d events these are left out: %s", source, len(whole), ", ".join(incomplete))
    attributes = {"rows": events.sizes["event"], "dropped": json.dumps(dropped)}
    if types := types_text(kinds[EVENT_TYPE][whole]) if EVENT_TYPE in kinds else "":
        attributes["types_text"] = types
    events = events.isel(event=np.flatnonzero(whole))
    columns = {name: np.asarray(values)[whole] for name, values in columns.items()}
    words = {name: np.asarray(values)[whole] for name, values in {**kinds, **(words or {})}.items()}
    box = domain_box(settings.domain) if settings.domain else None
    beyond = distance_beyond(events["location"].values, *box) if box else np.zeros(events.sizes["event"])
    if (
        box
        and events.sizes["event"]
        and beyond.min() > MAX_WIDTHS_FROM_DOMAIN * _width(events["location"].values, *box)
    ):
        raise InputError(_other_ground(events, box, source, bool(settings.frame and settings.frame.grid)))
    kept = np.ones(events.sizes["event"], bool)
    if settings.period and settings.period.given():
        attributes["period"] = json.dumps(_periods(events["time"].values, settings, source))
    if chosen.get("end"):
        attributes["stated_end"] = str(chosen["end"])
    account = []
    limits = limits_of(settings)
    _check_columns(limits, columns, words, where)
    for key, value, passes in _conditions(events, limits, columns, words, where):
        before = int(kept.sum())
        if unknown := _without_value(key, kept, columns):
            logging.warning(
                "%s.%s: %d of %d events have no value in this column and are left out", where, key, unknown, before
            )
        kept &= passes
        after = int(kept.sum())
        account.append({"filter": key, "value": value, "before": before, "after": after})
        if after == 0 and before and key.partition(".")[0] in chosen:
            raise InputError(f"{where}.{key}: no event left ({before} before this filter); widen it")
    if box:
        potency, inside = events["potency"].values, kept & (beyond == 0)
        outside = beyond[kept & ~inside]
        account.append(
            {
                "filter": DOMAIN_FILTER,
                "value": [settings.domain.lower, settings.domain.upper],
                "before": int(kept.sum()),
                "after": int(inside.sum()),
                "potency_before": float(potency[kept].sum()),
                "potency_after": float(potency[inside].sum()),
                "nearest": float(outside.min()) if outside.size else None,
                "farthest": float(outside.max()) if outside.size else None,
            }
        )
        kept = inside
    _check_quiet(events["time"].values, int(kept.sum()), account, settings, source)
    filtered = events.isel(event=np.flatnonzero(kept))
    filtered.attrs |= attributes | {"filter": json.dumps(account)}
    return filtered


def _periods(time: np.ndarray, settings: RecordSlice, source: str) -> dict[str, list[str]]:
    """The modelled, the recorded and the common period. Raises InputError where there is no common one."""
    period, chosen = settings.period, settings.filter.given() if settings.filter else {}
    modelled = [parse_time(text, "record.period") for text in (period.start, period.end)]
    first, last = (FIRST, LAST) if settings.quiet else recorded_period(time)
    begun = parse_time(chosen["start"], f"{source}: record.filter.start") if chosen.get("start") else first
    ended = parse_time(chosen["end"], f"{source}: record.filter.end") if chosen.get("end") else last
    common = [max(modelled[0], begun, first), min(modelled[1], ended, last)]
    if common[0] >= common[1]:
        filtered = max(modelled[0], first) < min(modelled[1], last)
        key = "record.filter: start and end leave" if filtered else "the file has"
        run = f"its events run from {_day(time.min())} to {_day(time.max())}" if len(time) else "it has no events"
        raise InputError(
            f"{source}: {key} nothing of the modelled months, {_day(modelled[0])} to {_day(modelled[1])}: {run}; check "
            "the steps' dates and the record's times"
        )
    recorded = [time.min(), time.max()] if len(time) else common
    found = {"modelled": modelled, "recorded": recorded, "common": common}
    return {name: [str(moment)[:19] for moment in pair] for name, pair in found.items()}


def _day(moment: np.datetime64) -> str:
    return str(moment)[:10]


def _check_quiet(time: np.ndarray, left: int, account: list[dict], settings: RecordSlice, source: str) -> None:
    """Raise InputError where no event is compared and settings.quiet does not state so; warn where few are.

    time (event,): of all whole events; left: number of events that are compared; account: of the filters.
    """
    run = f"{len(time)} events run from {_day(time.min())} to {_day(time.max())}" if len(time) else "it has no events"
    crop = account[-1] if account and account[-1]["filter"] == DOMAIN_FILTER else None
    months, other_time = "", 0
    if settings.period and settings.period.given():
        start, end = (parse_time(text, "record.period") for text in (settings.period.start, settings.period.end))
        other_time = int(((time < start) | (time >= end)).sum())
        months = f"the modelled months, {_day(start)} to {_day(end)}"
    if left and settings.quiet:
        logging.warning("%s: record.quiet is stated, and %d events are compared: leave it out", source, left)
    if not left and not settings.quiet:
        place = " in the domain" if crop else ""
        near = "" if crop is None or crop["nearest"] is None else f"; the nearest lies {crop['nearest']:.0f} m away"
        check = "the record's times and their format, and the steps' dates" if len(time) else "the export"
        check = "record.columns, their units, and frame" if near else check
        raise InputError(
            f"{source}: no event{place}{' in ' if months else ''}{months}: {run}{near}; check {check}, or state "
            "record.quiet: true if nothing was recorded there"
        )
    if other_time > MAX_SHARE_OTHER_TIME_UNTOLD * len(time):
        logging.warning("%s: %d of %d events lie outside of %s: %s", source, other_time, len(time), months, run)
    if crop and left and crop["before"] - left > MAX_SHARE_OUTSIDE_UNTOLD * crop["before"]:
        logging.warning(
            "%s: %d of %d events lie outside the domain, up to %.0f m away, and are not compared",
            source, crop["before"] - left, crop["before"], crop["farthest"],
        )  # fmt: skip


def check_places(location: np.ndarray, source: str) -> None:
    """Raise InputError for a coordinate (event, 3) m that can be none."""
    absurd = np.abs(location) > MAX_COORDINATE
    if absurd.any():
        event, axis = np.argwhere(absurd)[0]
        raise InputError(
            f"{source}: event {event + 1}: {'xyz'[axis]} = {location[event, axis]:g} m is no place on Earth "
            f"({int(absurd.any(axis=1).sum())} such); check the columns and their units"
        )


def _whole_events(
    events: xr.Dataset, other: Mapping[str, np.ndarray], repeated: np.ndarray | None, source: str
) -> tuple[np.ndarray, dict[str, int]]:
    """Events that are kept (event,) bool, and the number of dropped ones by reason.

    Kept events are seismicity, have a time, a place and a size, and are not repeated. other: by reason, the events
    (event,) bool that are no seismicity; repeated (event,) bool: events that occur before, None: not looked for. An
    event is counted at its first reason. Raises InputError if there is seismicity and none of it is kept.
    """
    has = {
        **{what: ~here for what, here in other.items()},
        "without a time": ~np.isnat(events["time"].values),
        "without a place": np.isfinite(events["location"].values).all(axis=1),
        "without a size": np.isfinite(events["potency"].values),
        "there twice": np.ones(events.sizes["event"], bool) if repeated is None else ~repeated,
    }
    kept = np.ones(events.sizes["event"], bool)
    dropped = {}
    for what, there in has.items():
        if count := int((kept & ~there).sum()):
            dropped[what] = count
        kept &= there
    seismic = len(kept) - sum(dropped.get(what, 0) for what in other)
    if seismic and not kept.any():  # blasts alone are a record of a quiet volume
        causes = ", ".join(f"{count} {what}" for what, count in dropped.items())
        keep = "; record.filter.keep counts what it names" if other else ""
        raise InputError(f"{source}: no event of {len(kept)} has a time, a place and a size ({causes}){keep}")
    return kept, dropped


def distance_beyond(location: np.ndarray, lower: np.ndarray, upper: np.ndarray) -> np.ndarray:
    """Distance (event,) m of locations (event, 3) m from a box; 0 on its faces and inside."""
    return np.linalg.norm(np.maximum(np.maximum(lower - location, location - upper), 0.0), axis=1)


def domain_box(domain: DomainBox) -> tuple[np.ndarray, np.ndarray]:
    """Lower and upper corner (3,) m of a domain; a section reaches through all of the direction that it has not."""
    box = np.array([[-np.inf] * 3, [np.inf] * 3])
    axes = {"xz": [0, 2], "xy": [0, 1]}.get(domain.plane or "", [0, 1, 2])
    box[:, axes] = domain.lower, domain.upper
    return box[0], box[1]


def _width(location: np.ndarray, lower: np.ndarray, upper: np.ndarray) -> float:
    """The longest edge, m, of the box around all events (event, 3), or of the domain, whichever is longer."""
    edges = np.append(np.ptp(location, axis=0), upper - lower)
    return float(edges[np.isfinite(edges)].max())


def _other_ground(events: xr.Dataset, box: tuple[np.ndarray, np.ndarray], source: str, has_grid: bool) -> str:
    """The line for a record of which no event lies in the domain; has_grid: whether files have a grid of their own."""
    location = events["location"].values
    ranges = [
        f"{axis} {low:.0f} to {high:.0f}"
        for axis, low, high in zip("xyz", location.min(axis=0), location.max(axis=0), strict=True)
    ]
    model = [f"{axis} {low:.0f} to {high:.0f}" for axis, low, high in zip("xyz", *box, strict=True) if low > -np.inf]
    return (
        f"{source}: no event of {len(location)} lies in the model's domain ({', '.join(model)} m): they lie at "
        f"{', '.join(ranges)} m{' on the map, by frame.grid' * has_grid}; check record.columns, their units, and frame"
    )


def _conditions(events: xr.Dataset, settings: Mapping, columns: Mapping, words: Mapping, where: str):
    """Yield (key, value, (event,) bool) for each filter named, always in the same order."""
    location = events["location"].values
    for key, inside in (("lower", np.greater_equal), ("upper", np.less_equal)):
        if settings.get(key) is not None:
            corner = np.asarray(settings[key], float)
            if corner.shape != (3,):
                raise InputError(f"{where}.{key}: expected three coordinates, got {settings[key]}")
            yield key, corner.tolist(), inside(location, corner).all(axis=1)
    time = events["time"].values
    for key, within in (("start", np.greater_equal), ("end", np.less)):
        if settings.get(key):
            yield key, str(settings[key]), within(time, parse_time(settings[key], f"{where}.{key}"))
    if settings.get("minimum_potency") is not None:
        smallest = float(settings["minimum_potency"])
        yield "minimum_potency", smallest, events["potency"].values >= smallest
    for key, inside in (("maximum", np.less_equal), ("minimum", np.greater_equal)):
        for column, bound in (settings.get(key) or {}).items():
            yield f"{key}.{column}", float(bound), inside(np.asarray(columns[column], float), float(bound))
    for key in ("only", "without"):
        for column, listed in (settings.get(key) or {}).items():
            texts = [listed] if isinstance(listed, str) else list(listed)
            there = np.array([plain_word(word) for word in words[column]], dtype=object)
            if absent := [text for text in texts if plain_word(text) not in there]:
                logging.warning(
                    "%s.%s.%s: no event has %s; there are %s",
                    where, key, column, _quoted(absent), _quoted(dict.fromkeys(words[column])),
                )  # fmt: skip
            found = np.isin(there, [plain_word(text) for text in texts])
            yield f"{key}.{column}", texts, found if key == "only" else ~found


def _check_columns(settings: Mapping, columns: Mapping, words: Mapping, where: str) -> None:
    """Raise InputError, naming all of them at once, for columns that filters name and the file does not have."""
    for kinds, there, what in ((("maximum", "minimum"), columns, " of numbers"), (("only", "without"), words, "")):
        named = [(f"{where}.{key}.{name}", name) for key in kinds for name in settings.get(key) or {}]
        absent = [(key, name) for key, name in named if name not in there]
        if text := next((key for key, name in absent if name in words), None):
            values = words[text.removeprefix(where).split(".", 2)[2]]
            raise InputError(
                f"{text}: no column{what}, but of text: {_quoted(dict.fromkeys(values))}; filter it by "
                f"record.filter.only or record.filter.without. Columns of numbers are {', '.join(columns)}"
            )
        if absent:
            many = "columns" if len(absent) > 1 else "column"
            keys = ", ".join(key if number == 0 else key.removeprefix(where) for number, (key, _) in enumerate(absent))
            raise InputError(f"{keys}: no such {many}{what}; the file has {', '.join(there)}")


def _without_value(key: str, kept: np.ndarray, columns: Mapping) -> int:
    """Number of the events kept so far (event,) bool that have no number in the column of a filter, maximum.q."""
    kind, _, column = key.partition(".")
    return int(np.isnan(np.asarray(columns[column], float))[kept].sum()) if kind in ("maximum", "minimum") else 0


def _quoted(texts: Iterable[str]) -> str:
    """The first few of some texts in quotation marks, separated by commas."""
    listed = list(texts)
    shown = ", ".join(repr(text) for text in listed[:MAX_TEXTS_SHOWN])
    return shown + (f" and {len(listed) - MAX_TEXTS_SHOWN} more" if len(listed) > MAX_TEXTS_SHOWN else "")
