"""Which events of a record are seismicity, by their types and evaluation statuses.

Seismic is rock that breaks or slips, of any cause. All other events are left out and counted. Event types are those of
QuakeML 1.2 (Storchak et al. 2012) and words that mines' systems write. Types that say nothing count: "not reported" is
what QuakeML 1.2 made of the "null" of its forerunners. A word that is not known here, and one that holds blasts as well
as tremors ("anthropogenic event"), is refused until the configuration says which it is.
"""

import logging
import re
import unicodedata
from collections.abc import Mapping

import numpy as np
import yaml
from numpy.typing import NDArray

from catalogs.records.settings import RecordSlice
from common.errors import InputError

EVENT_TYPE, STATUS, MODE = "event_type", "evaluation_status", "evaluation_mode"  # kinds of text
SEISMIC_WORDS = {
    EVENT_TYPE: {
        "", "null", "not reported", "earthquake", "induced or triggered event", "rock burst", "reservoir loading",
        "fluid injection", "fluid extraction", "collapse", "cavity collapse", "mine collapse",
        "induced earthquake", "seismic event", "microseismic event", "tremor", "rockburst", "fall of ground",
    },
    STATUS: {"", "preliminary", "confirmed", "reviewed", "final", "automatic", "manual"},
}  # fmt: skip
NOT_SEISMIC_WORDS = {
    EVENT_TYPE: {
        "not existing", "building collapse", "explosion", "accidental explosion", "chemical explosion",
        "controlled explosion", "experimental explosion", "industrial explosion", "mining explosion", "quarry blast",
        "road cut", "blasting levee", "nuclear explosion", "crash", "plane crash", "train crash", "boat crash",
        "atmospheric event", "sonic boom", "sonic blast", "acoustic noise", "thunder", "avalanche", "snow avalanche",
        "debris avalanche", "hydroacoustic event", "ice quake", "slide", "landslide", "rockslide", "meteorite",
        "volcanic eruption", "duplicate", "not locatable", "outside of network interest",
    },
    STATUS: {"rejected", "deleted"},
}  # fmt: skip
# Last words of other types: production blast, electrical noise.
NOT_SEISMIC_ENDINGS = ("blast", "blasting", "explosion", "noise")
KIND_PREFIX = {EVENT_TYPE: "of type ", STATUS: ""}


def plain_word(text: str) -> str:
    """A word as it is compared: upper and lower case, _ and blanks are the same."""
    return re.sub(r"[\s_]+", " ", unicodedata.normalize("NFC", text)).strip().casefold()


def is_left_out(kind: str, word: str) -> bool:
    """True if a plain word of this kind (EVENT_TYPE, STATUS) says that an event is no seismicity."""
    ends = kind == EVENT_TYPE and word.split(" ")[-1] in NOT_SEISMIC_ENDINGS
    return word in NOT_SEISMIC_WORDS[kind] or ends


def kept_words(settings: RecordSlice) -> set[str]:
    """Plain words of the kinds that are compared although they are not seismic."""
    return {plain_word(text) for text in _listed(settings.filter.keep if settings.filter else None)}


def no_seismicity(kinds: Mapping[str, NDArray], settings: RecordSlice, source: str) -> dict[str, NDArray]:
    """Events that are no seismicity: {"of type quarry blast": (event,) bool, "rejected": ...}.

    kinds: of EVENT_TYPE and STATUS those that the record has, (event,) texts. settings.filter.keep, and what
    settings.filter.only names, count all the same. Raises InputError, naming all of them, for words of which nobody
    said what they mean.
    """
    limits, kept = settings.filter, kept_words(settings)
    found: dict[str, NDArray] = {}
    unknown: dict[str, dict[str, int]] = {}
    for kind, texts in kinds.items():
        names = settings.names_of_text(kind)
        only, without = (
            [plain_word(text) for name, listed in (getattr(limits, key, None) or {}).items() if name in names
             for text in _listed(listed)]
            for key in ("only", "without")
        )  # fmt: skip
        words = np.array([plain_word(text) for text in texts], dtype=object)
        for word in dict.fromkeys(words):
            here = words == word
            if word in kept or word in only:
                continue
            if is_left_out(kind, word):
                found[f"{KIND_PREFIX[kind]}{word}"] = here
            elif word not in SEISMIC_WORDS[kind] and word not in without and not only:
                written = " ".join(str(texts[int(np.argmax(here))]).split())
                unknown.setdefault(kind, {})[written] = int(here.sum())
    if unknown:
        raise InputError(f"{source}: {_question(unknown, len(next(iter(kinds.values()))), settings)}")
    if found:
        left_out = ", ".join(f"{int(here.sum())} {what}" for what, here in found.items())
        logging.warning("%s: left out: %s; record.filter.keep counts what it names", source, left_out)
    return found


def _question(unknown: Mapping[str, Mapping[str, int]], events: int, settings: RecordSlice) -> str:
    """The question that unknown words raise, with the lines that answer it. unknown: number of events by kind, word;
    events: of the file."""
    listed = [
        f"{count} of {events} events are {KIND_PREFIX[kind]}{word!r}"
        for kind, counts in unknown.items()
        for word, count in counts.items()
    ]
    kept = [*_listed(settings.filter.keep if settings.filter else None)]
    keep = flow_yaml({"keep": [*kept, *dict.fromkeys(word for counts in unknown.values() for word in counts)]})
    without = flow_yaml({"without": {kind: list(counts) for kind, counts in unknown.items()}})
    return (
        f"{', '.join(listed)}: is that rock that broke? Write under record those that are, filter: {keep}, and those "
        f"that are not, filter: {without} (record.filter.keep, record.filter.without)"
    )


def flow_yaml(value: Mapping | list) -> str:
    """A section or list of a mine file on one line, as it is pasted."""
    text = yaml.safe_dump(value, default_flow_style=True, allow_unicode=True, sort_keys=False, width=float("inf"))
    return text.strip()


def types_text(types: NDArray) -> str:
    """Numbers of events by type, most frequent first, in a list for a sentence; empty where no type is given.

    types (event,): types as the file has them.
    """
    words, counts = np.unique([plain_word(text) for text in types], return_counts=True)
    if not any(words):
        return ""
    order = np.argsort(-counts, kind="stable")
    return ", ".join(f"{counts[place]} {words[place] or 'without a type'}" for place in order)


def _listed(value: str | tuple[str, ...] | None) -> list[str]:
    return [value] if isinstance(value, str) else list(value or ())
