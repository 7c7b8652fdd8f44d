"""Result of the model and its agreement with the record, in sentences for the first page."""

from collections.abc import Callable
from functools import partial

import numpy as np
import scipy
import xarray as xr
from numpy.typing import NDArray

from catalogs.compare.blocks import MIN_BLOCKS
from catalogs.compare.size_measures import fit
from catalogs.compare.spread import SPREAD_BIN_WIDTH
from catalogs.report.by_opening import where
from catalogs.report.evidence import Evidence
from catalogs.report.sections.steps import cut_of, headline, shear_modulus
from catalogs.report.text import (
    EXACT_DIGITS,
    MIN_RATIO_AS_DECIMAL,
    as_ratio,
    beside,
    between,
    fixed,
    hundredths,
    magnitude,
    number,
    percent,
    rounded_by,
    whole,
)
from catalogs.settings import ComparisonSettings
from catalogs.sources.jackknife import INTERVAL_95
from catalogs.sources.mechanisms import KAGAN_LIMIT
from catalogs.sources.significance import SIGNIFICANCE, TEST_LEVEL
from catalogs.sources.size_law import POWER, TRUNCATED
from catalogs.sources.sizes import log_potency
from catalogs.sources.truncated_law import largest_interval

MORE_THAN_CHANCE, WITHIN_CHANCE = "more than chance explains", "no more than chance explains"
MIN_SHARE_COMPARED = 0.5  # Of the recorded potency; where less is compared, all of it is named, too.
MAX_FEW = 5  # Events that potency is said to rest on.
MAX_RATIO_NOTICED = 1000.0  # A test that notices larger ratios only, or smaller than one over it, notices none.
MAX_NOTICED = {  # In the same way, larger differences only: of b, of places (m), of directions (degrees).
    "b_difference": 2.0,
    "shift": 1000.0,
    "mechanism_turn": KAGAN_LIMIT,
}
BLIND = {  # what no test would have noticed: on the lower side, and on the upper one
    "event_ratio": ("too few events", "too many events"),
    "potency_ratio": ("too little potency", "too much potency"),
    "b_difference": ("another b", "another b"),
    "shift": ("other places", "other places"),
    "mechanism_turn": ("another direction", "another direction"),
}
TESTS = ("event_ratio", "potency_ratio", "b_difference", "energy", "mechanism_turn")  # QUESTIONS of them at most
RANDOM_TURN, RARE_TURN = 75, 35  # degrees: mean and 0.05 quantile of the angle between random mechanisms (Kagan 1991)
SEED = 1


def verdict(evidence: Evidence) -> list[str]:
    """A sentence or two on each question that the report answers, and one on what it cannot say."""
    if evidence.catalog is None or not evidence.dated:
        return [headline(evidence)[0], *_no_dates(evidence)]
    recorded = 0 if evidence.record is None else evidence.record.sizes["event"]
    if not evidence.catalog.sizes["event"] and not recorded:
        return [headline(evidence)[0], *_unchecked(evidence)]
    if evidence.comparison is None:
        return [*_unchecked(evidence), *where(evidence), *_largest(evidence), _cannot(evidence)]
    counts = [int(value) for value in evidence.comparison["events_above_cut"].values]
    if not all(counts):
        return [_one_sided(evidence, *counts), *where(evidence), *_largest(evidence), _cannot(evidence)]
    return [
        *_potency(evidence),
        *_sizes(evidence),
        *_places(evidence),
        *_against_face(evidence),
        *_directions(evidence),
        *_noticed(evidence),
        *_largest(evidence),
        _cannot(evidence),
    ]


def size_of_cut(evidence: Evidence) -> str:
    """The smallest size that counts, as Mw."""
    return f"Mw {fixed(magnitude(10.0 ** cut_of(evidence), shear_modulus(evidence)), 1)}"


def _no_dates(evidence: Evidence) -> list[str]:
    """A sentence where a given record is not compared; else none."""
    if not evidence.steps or evidence.dated or "record" not in evidence.config:
        return []
    return ["The record is not compared, since no step of this mine has dates."]


def _unchecked(evidence: Evidence) -> list[str]:
    """A sentence where nothing is compared; else none."""
    if evidence.record is not None:
        return []
    return ["There is no record: nothing here is checked against events that happened."]


def _one_sided(evidence: Evidence, modelled: int, recorded: int) -> str:
    """A sentence that one of the catalogues has no event to compare."""
    if not modelled and not recorded:
        return "Neither the model nor the record has an event of a size that counts: nothing can be compared."
    text = "The record has events where the model makes none"
    text = text if recorded else "The model makes events where the record has none"
    chance = float(evidence.comparison["event_ratio_p_value"])
    return f"{text}, which is {_by_chance(chance)}." if np.isfinite(chance) else f"{text}."


def _by_chance(p_value: float) -> str:
    """Words for the only test of a page."""
    return MORE_THAN_CHANCE if p_value < SIGNIFICANCE else WITHIN_CHANCE


def _judged(p_value: float) -> str:
    """Words for one of the tests of a page, whose level is TEST_LEVEL: the page as a whole then calls a right model
    wrong with the chance SIGNIFICANCE at most."""
    return MORE_THAN_CHANCE if p_value <= TEST_LEVEL else WITHIN_CHANCE


def differs(evidence: Evidence, name: str) -> bool:
    """True if a test of the page says that the model differs from the record by more than chance.

    name: of the p-value, without its ending: "potency_ratio", "event_ratio", "b_difference", "energy",
    "mechanism_turn".
    """
    return bool(float(evidence.comparison[f"{name}_p_value"]) <= TEST_LEVEL)


def _potency(evidence: Evidence) -> list[str]:
    """Ratios of potency and number with their intervals, the few events that potency rests on, and the tests."""
    runs = int(evidence.comparison["model_runs"])
    who = f"The mean of {runs} runs of the model" if runs > 1 else "The model"
    potency, events = _ratio(evidence, "potency_ratio", "potency"), _ratio(evidence, "event_ratio", "number of events")
    small = _small_events(evidence)
    if small:
        who = f"Of events of {size_of_cut(evidence)} and more, {who[0].lower()}{who[1:]}"
    chances = [_judged(float(evidence.comparison[f"{name}_p_value"])) for name in ("potency_ratio", "event_ratio")]
    tested = f"The difference in potency is {chances[0]}, and that in number is {chances[1]}."
    if chances[0] == chances[1]:
        tested = f"Both differences are {chances[0]}."
    return [f"{who} releases {potency}, in {events}. {_few_large(evidence)}{tested}", *small]


def _few_large(evidence: Evidence) -> str:
    """Sentence on the few events that hold most potency, and the ratio without them; empty where they are many."""
    comparison = evidence.comparison
    ratio = float(comparison["potency_ratio"])
    of = "record" if ratio <= 1.0 else "model"
    here = comparison.sel(catalogue=of)
    count, without = int(here["large_events"]), float(here["potency_ratio_without_large"])
    if not 0 < count <= MAX_FEW or not 0.0 < without < np.inf:
        return ""
    whose = "recorded" if of == "record" else "modelled"
    among = " of all runs" if of == "model" and int(comparison["model_runs"]) > 1 else ""
    events, them = (f"{whole(count)} events{among} hold", "them") if count > 1 else (f"One event{among} holds", "it")
    return f"{events} 90 % of the {whose} potency; without {them} the ratio is {as_ratio(without)}. "


def _small_events(evidence: Evidence) -> list[str]:
    """The ratio of potency of all sizes, where most of the recorded potency is in events too small to be compared."""
    above, whole = (float(evidence.comparison[name].values[1]) for name in ("summed_potency", "summed_potency_all"))
    ratio = float(evidence.comparison["potency_ratio_all"])
    if not whole > 0.0 or above >= MIN_SHARE_COMPARED * whole or not np.isfinite(ratio):
        return []
    return [
        f"Smaller events hold {percent(1.0 - above / whole)} of the recorded potency. Of all sizes the model releases "
        f"{_multiple(ratio)} the recorded potency."
    ]


def _ratio(evidence: Evidence, name: str, of: str) -> str:
    """A ratio of what is modelled to what is recorded of a quantity, with its interval."""
    ratio, interval = float(evidence.comparison[name]), evidence.comparison[f"{name}_interval"].values
    text = f"{_multiple(ratio)} the recorded {of}"
    return text + (f" (95 %: {beside(1.0, interval, as_ratio)[1]})" if np.isfinite(interval).any() else "")


def _sizes(evidence: Evidence) -> list[str]:
    """Sentence on b of both catalogues; an empty list where their difference is not known."""
    comparison = evidence.comparison
    chance = float(comparison["b_difference_p_value"])
    if not np.isfinite(chance):
        return []
    ends = TRUNCATED in (comparison.attrs["law_model"], comparison.attrs["law_record"])
    model, record = comparison["b_truncated" if ends else "b"].values
    shown = ([hundredths(b, more=more) for b in (model, record)] for more in range(EXACT_DIGITS))
    texts = next((texts for texts in shown if texts[0] != texts[1]), None)
    if texts is None:
        return [f"Its b of potency, {hundredths(model)}, is the recorded one."]
    side = "higher" if model > record else "lower"
    return [f"Its b of potency, {texts[0]}, is {side} than the recorded one, {texts[1]}, by {_judged(chance)}."]


def _against_face(evidence: Evidence) -> list[str]:
    """Sentence on the median distances of modelled and recorded events ahead of the face, with intervals; an empty list
    without a face or without events there. It has no verdict: the test of places stands for it."""
    comparison = evidence.comparison
    if "face_measure" not in comparison or not comparison["face_events"].values.all():
        return []
    pick = {"weight": "number", "measure": "median ahead"}
    ends = comparison["face_measure_interval"].sel(pick).values
    places = []
    for value, (low, high) in zip(comparison["face_measure"].sel(pick).values, ends, strict=True):
        known = f" (95 %: {_from_face(low)} to {_from_face(high)})" if np.isfinite([low, high]).all() else ""
        places.append(f"{_from_face(value)}{known}")
    return [f"The middle of its events is {places[0]}, that of recorded events {places[1]}."]


def _from_face(ahead: float) -> str:
    """A distance from the face, m, in words."""
    return f"{number(abs(ahead), 2)} m {'behind' if ahead < 0 else 'ahead of'} the face"


def _places(evidence: Evidence) -> list[str]:
    """Sentence on the distance between the middles of modelled and recorded events, and on the test of their places; an
    empty list where places are not compared."""
    comparison = evidence.comparison
    chance = float(comparison["energy_p_value"])
    if not np.isfinite(chance):
        return []
    apart, interval = float(comparison["centroid_distance"]), comparison["centroid_distance_interval"].values
    middle, ends = rounded_by(apart, interval)
    return [
        f"Step by step, the middle of its events is {middle} m from that of recorded ones (95 %: {ends} m). Their "
        f"places differ by {_judged(chance)}."
    ]


def _directions(evidence: Evidence) -> list[str]:
    """Sentence on the turn between the mean mechanisms, on what chance gives, and on the tests of both; an empty list
    where mechanisms are not compared."""
    comparison = evidence.comparison
    turn = float(comparison["mechanism_turn"])
    if not int(comparison.attrs.get("axes_present", 0)) or not np.isfinite(turn):
        return []
    interval = between(comparison["mechanism_turn_interval"].values, partial(fixed, decimals=0))
    text = (
        f"On average its rock slips in a direction {fixed(turn, 0)}° off the recorded one (95 %: {interval}°; a random "
        f"direction is off by {RANDOM_TURN}° on average, and in one of 20 cases by {RARE_TURN}° or less)"
    )
    chance, at_random = (float(comparison[f"mechanism_turn{of}_p_value"]) for of in ("", "_random"))
    closer = at_random <= SIGNIFICANCE
    if chance <= TEST_LEVEL:
        text += f", which is {_judged(chance)}"
        return [f"{text}, {'though' if closer else 'and no'} closer than random directions come."]
    if closer:
        return [f"{text}: the same direction, as far as chance tells, and closer than random ones come."]
    return [f"{text}: so few events tell neither a different direction nor one closer than random ones come."]


def _noticed(evidence: Evidence) -> list[str]:
    """Sentences on the differences that the page's tests would have noticed, and on their level; an empty list without
    any test."""
    comparison = evidence.comparison
    forms: dict[str, tuple[str, Callable[[float], str]]] = {
        "event_ratio": ("{} the number of events", _multiple),
        "potency_ratio": ("{} the potency", _multiple),
        "b_difference": ("{} more in b", partial(number, digits=2)),
        "shift": ("a shift of {} m", partial(number, digits=2)),
        "mechanism_turn": ("a turn of {}°", partial(fixed, decimals=0)),
    }
    values = {name: float(comparison[f"{name}_noticed"]) for name in forms}
    seen = {name: _is_noticeable(name, value) for name, value in values.items() if not np.isnan(value)}
    noticed = [words.format(form(values[name])) for name, (words, form) in forms.items() if seen.get(name)]
    blind = [BLIND[name][int(values[name] > 1.0)] for name in seen if not seen[name]]
    text = []
    if noticed:
        text.append(f"In 4 of 5 cases the tests would have noticed {_listed(noticed, 'or')}.")
    if blind:
        tests = "They" if noticed else "The tests"
        text.append(f"{tests} could not have noticed {_listed(blind, 'or')}: events, or clusters of them, are too few.")
    if not text:
        return []
    text.append(_levels(comparison))
    if not np.isfinite(comparison["energy_distance_interval"]).all():
        text.append("How far other runs of the model would differ is taken from the record.")
    return [" ".join(text)]


def _is_noticeable(name: str, value: float) -> bool:
    """True if a difference of this size says something of a test that notices it; name: of TESTS, or "shift" (m)."""
    return value < MAX_NOTICED[name] if name in MAX_NOTICED else 1.0 / MAX_RATIO_NOTICED < value < MAX_RATIO_NOTICED


def _levels(comparison: xr.Dataset) -> str:
    """Sentence on the share of right models that fails any of the tests of a difference that were made."""
    made = sum(bool(np.isfinite(comparison[f"{name}_p_value"])) for name in TESTS)
    tests = f"one of these {made} tests" if made > 1 else "this test"
    return f"At most one right model in {round(1 / (made * TEST_LEVEL))} fails {tests}."


def _multiple(ratio: float) -> str:
    """A ratio before what it multiplies."""
    return f"{as_ratio(ratio)} {'of' if 0 < ratio < MIN_RATIO_AS_DECIMAL else 'times'}"


def _listed(words: list[str], last: str) -> str:
    """Words in a row: a, b or c."""
    return words[0] if len(words) == 1 else f"{', '.join(words[:-1])} {last} {words[-1]}"


def _largest(evidence: Evidence) -> list[str]:
    """Sentence on the interval of Mw of the largest event of another run; an empty list where that is not known."""
    bounds = expected_range(evidence)
    if bounds is None:
        return []
    ends = [magnitude(10.0**bound, shear_modulus(evidence)) for bound in bounds]
    interval = between(ends, partial(fixed, decimals=1))
    return [f"By chance alone, the largest event of another run would have Mw {interval} (95 %)."]


def _cannot(evidence: Evidence) -> str:
    """Sentence on the questions that the report cannot answer."""
    comparison = evidence.comparison
    found = ["when within its step an event happens"]
    if comparison is not None and np.isfinite(cut_of(evidence)):
        found.append(f"how many events below {size_of_cut(evidence)} there are")
    if comparison is not None and comparison["events_above_cut"].values.all():
        oriented = bool(int(comparison.attrs.get("axes_present", 0)))
        if not np.isfinite(comparison["b_difference_p_value"]):
            found.append("whether its b of potency is the recorded one")
        if not np.isfinite(comparison["energy_p_value"]):
            found.append("whether places agree")
        if oriented and not np.isfinite(comparison["mechanism_turn"]):
            found.append("whether directions agree")
        if not oriented:
            none = not np.isfinite(evidence.record["p_axis"].values).any()
            found.append("in which direction rock moved" + (" (the record has no mechanisms)" if none else ""))
    return f"It cannot say {_listed(found, 'or')}."


def expected_range(evidence: Evidence) -> NDArray | None:
    """log10 potency (lower, upper), 95 %, of the largest event of another run; None where it is not known.

    Of an ensemble Student's t of the largest of its runs, which says nothing of the law of sizes and holds where runs
    share events, too. Of one run that of the law of sizes, `sources.truncated_law.largest_interval`.
    """
    runs = evidence.spread
    if runs is not None and int(runs.attrs["members"]) >= MIN_BLOCKS and runs.sizes["size_bin"]:
        filled = runs["cumulative"].values > 0
        if filled.any(axis=1).all():
            middle = runs["size_bin_lower"].values + SPREAD_BIN_WIDTH / 2
            return another_run(np.where(filled, middle, -np.inf).max(axis=1), SPREAD_BIN_WIDTH / 2)
    law = _law(evidence)
    if law is None:
        return None
    x, cut, name, dispersion_index = law
    return largest_interval(x, cut, name, dispersion_index, np.random.default_rng(SEED))


def another_run(values: NDArray, rounding: float = 0.0) -> NDArray:
    """95 % interval (2,) of one more value, by Student's t, of values (run,) known to within this rounding."""
    count = len(values)
    half = scipy.stats.t.ppf(INTERVAL_95[1], count - 1) * values.std(ddof=1) * np.sqrt(1.0 + 1.0 / count) + rounding
    return values.mean() + half * np.array([-1.0, 1.0])


def _law(evidence: Evidence) -> tuple[NDArray, float, str, float] | None:
    """Modelled sizes (event,) from the cut on and the cut, log10 m3, the law that they follow, and the dispersion index
    of their number; None where they follow none."""
    comparison, sizes = evidence.comparison, log_potency(evidence.resolved["potency"].values)
    if comparison is not None:
        used = comparison["model_used"].values[evidence.catalog["resolved"].values == 1] == 1
        x, cut, name = sizes[used], float(comparison["cut"]), comparison.attrs["law_model"]
        dispersion_index = float(comparison["dispersion_index"])
    else:
        floor = float(evidence.catalog.attrs["potency_floor"])
        if not floor > 0:
            return None
        cut, dispersion_index = float(np.log10(floor)), 1.0
        x = sizes[np.isfinite(sizes) & (sizes >= cut)]
        name = fit(x, cut, 0.0, False, ComparisonSettings()).law.name
    return (x, cut, name, dispersion_index) if name in (POWER, TRUNCATED) else None
