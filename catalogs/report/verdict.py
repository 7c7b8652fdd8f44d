"""Result of the model and its agreement with the record, in sentences for the first page."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from catalogs.compare.blocks import MIN_BLOCKS
from catalogs.compare.size_measures import fit
from catalogs.compare.spread import SPREAD_BIN_WIDTH
from catalogs.report.by_opening import where
from catalogs.report.evidence import Evidence
from catalogs.report.sections.steps import cut_of, headline, shear_modulus
from catalogs.report.text import between, fixed, magnitude, number, percent
from catalogs.settings import ComparisonSettings
from catalogs.sources.jackknife import INTERVAL_95
from catalogs.sources.size_law import POWER
from catalogs.sources.sizes import log_potency

SIGNIFICANCE = 0.05  # A difference with a smaller p-value is more than chance explains.
MIN_RATIO_AS_DECIMAL = 0.2  # Smaller ratios are written as 1/n.
MIN_SHARE_COMPARED = 0.5  # Of the recorded potency; where less is compared, all of it is named, too.
FAR = 3.0  # A factor by which potency is far off.


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
        *_places(evidence),
        *_against_face(evidence),
        *_directions(evidence),
        *_largest(evidence),
        _cannot(evidence),
    ]


def as_ratio(value: float) -> str:
    """A ratio as a reader says it: 1.2, 0.43, 1/29."""
    if 0 < value < MIN_RATIO_AS_DECIMAL:
        return f"1/{number(1 / value, 2)}"
    return number(value, 2)


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
    return "more than chance explains" if p_value < SIGNIFICANCE else "no more than chance explains"


def _potency(evidence: Evidence) -> list[str]:
    """Ratios of potency and number with their intervals, and whether chance can make the differences."""
    runs = int(evidence.comparison["model_runs"])
    who = f"The mean of {runs} runs of the model" if runs > 1 else "The model"
    potency, events = _ratio(evidence, "potency_ratio", "potency"), _ratio(evidence, "event_ratio", "number of events")
    small = _small_events(evidence)
    if small:
        who = f"Of events of {size_of_cut(evidence)} and more, {who[0].lower()}{who[1:]}"
    return [f"{who} releases {potency}, in {events}. {_judged(evidence)}", *small]


def _small_events(evidence: Evidence) -> list[str]:
    """The ratio of potency of all sizes, where most of the recorded potency is in events too small to be compared."""
    above, whole = (float(evidence.comparison[name].values[1]) for name in ("summed_potency", "summed_potency_all"))
    ratio = float(evidence.comparison["potency_ratio_all"])
    if not whole > 0.0 or above >= MIN_SHARE_COMPARED * whole or not np.isfinite(ratio):
        return []
    of = "of" if 0 < ratio < MIN_RATIO_AS_DECIMAL else "times"
    return [
        f"Smaller events hold {percent(1.0 - above / whole)} of the recorded potency. Of all sizes the model releases "
        f"{as_ratio(ratio)} {of} the recorded potency."
    ]


def _ratio(evidence: Evidence, name: str, of: str) -> str:
    """A ratio of what is modelled to what is recorded of a quantity, with its interval."""
    ratio, interval = float(evidence.comparison[name]), evidence.comparison[f"{name}_interval"].values
    text = f"{as_ratio(ratio)} {'of' if 0 < ratio < MIN_RATIO_AS_DECIMAL else 'times'} the recorded {of}"
    return text + (f" (95 %: {between(interval, as_ratio)})" if np.isfinite(interval).any() else "")


def _judged(evidence: Evidence) -> str:
    """Sentence that tells whether chance explains the differences in potency and in the number of events.

    Needs a comparison in which both catalogues have events.
    """
    potency, number_of_events = (differs(evidence, name) for name in ("potency_ratio", "event_ratio"))
    if potency:
        ratio = float(evidence.comparison["potency_ratio"])
        far = "far too" if max(ratio, 1 / ratio) >= FAR else "too"
        return f"That is {far} {'little' if ratio < 1 else 'much'} potency, more than chance explains."
    if number_of_events:
        return "Chance can explain the difference in potency, but not that in number."
    return "Chance can explain both differences."


def differs(evidence: Evidence, name: str) -> bool:
    """True if the 95 % interval of a ratio of the model to the record is known and excludes 1.

    name: "potency_ratio" or "event_ratio".
    """
    low, high = evidence.comparison[f"{name}_interval"].values
    return bool(np.isfinite(low) and not low <= 1 <= high)


def _against_face(evidence: Evidence) -> list[str]:
    """Sentence on the median distances of modelled and recorded events ahead of the face; an empty list without a face
    or without events there."""
    comparison = evidence.comparison
    if "face_measure" not in comparison or not comparison["face_events"].values.all():
        return []
    pick = {"weight": "number", "measure": "median ahead"}
    model, record = comparison["face_measure"].sel(pick).values
    low, high = comparison["face_measure_interval"].sel(pick).values[1]
    text = f"The middle of its events is {_from_face(model)}, that of recorded events {_from_face(record)}"
    if not np.isfinite([low, high]).all():
        return [f"{text}."]
    same = "no difference that the record shows" if low <= model <= high else "a difference that the record shows"
    return [f"{text} (95 %: {_from_face(low)} to {_from_face(high)}), {same}."]


def _from_face(ahead: float) -> str:
    """A distance from the face, m, in words."""
    return f"{number(abs(ahead), 2)} m {'behind' if ahead < 0 else 'ahead of'} the face"


def _places(evidence: Evidence) -> list[str]:
    """Sentences on the distance between modelled and recorded events, compared with the location error and the spacing
    of the record; an empty list where places are not compared."""
    comparison = evidence.comparison
    if not np.isfinite(comparison["energy_distance"]):
        return []
    to_record, to_model, within = (float(value) for value in comparison["nearest_distance"].values)
    apart, error = max(to_record, to_model), float(comparison.attrs["location_error"])
    text = f"It places events {number(apart, 2)} m from where they were recorded (median distance to the nearest), "
    if apart <= error:
        text += f"which is within the {number(error, 2)} m to which recorded places are known."
    elif apart <= within:
        text += f"no farther than recorded events are from each other ({number(within, 2)} m)."
    else:
        known = f"are known to {number(error, 2)} m" if error > 0 else "have no stated error"
        text += f"while recorded places {known}: it misses the places."
    chance = float(comparison["energy_p_value"])
    if np.isfinite(chance):
        text += f" The two clouds of events differ by {_by_chance(chance)}."
    return [text]


def _directions(evidence: Evidence) -> list[str]:
    """Angles between mechanisms of neighbours, against those of random orientations."""
    comparison = evidence.comparison
    if not int(comparison.attrs.get("axes_present", 0)):
        return []
    angle, random = (float(comparison["kagan_median"].sel(kagan_pair=pair)) for pair in ("nearest", "uniform"))
    high = float(comparison["kagan_median_interval"].sel(kagan_pair="nearest").values[1])
    if not np.isfinite([angle, random]).all():
        return []
    text = f"The direction in which rock slips differs by {number(angle, 2)}° from that of the nearest recorded event "
    text += f"(median; {number(random, 2)}° at random)"
    if not np.isfinite(high):
        return [f"{text}."]
    return [f"{text}, which is {'better' if high < random else 'no better'} than chance."]


def _largest(evidence: Evidence) -> list[str]:
    """Sentence on the range of Mw within which chance alone moves the largest modelled event; an empty list where that
    is not known."""
    expected = expected_range(evidence)
    if expected is None:
        return []
    bounds, source = expected
    low, high = (magnitude(10.0**bound, shear_modulus(evidence)) for bound in bounds)
    return [f"{source} Mw {between((low, high), lambda value: fixed(value, 1))}."]


def _cannot(evidence: Evidence) -> str:
    """Sentence on the questions that the report cannot answer."""
    comparison = evidence.comparison
    found = ["when within its step an event happens"]
    if comparison is not None and np.isfinite(cut_of(evidence)):
        found.append(f"how many events below {size_of_cut(evidence)} there are")
    if comparison is not None and comparison["events_above_cut"].values.all():
        oriented = bool(int(comparison.attrs.get("axes_present", 0)))
        if not np.isfinite(comparison["energy_p_value"]):
            found.append(f"whether places{' and directions' if oriented else ''} agree by more than chance")
        if not oriented:
            none = not np.isfinite(evidence.record["p_axis"].values).any()
            found.append("in which direction rock moved" + (" (the record has no mechanisms)" if none else ""))
    return f"It cannot say {', '.join(found[:-1])}{' or ' if len(found) > 1 else ''}{found[-1]}."


def largest_of(events: int, b: float, cut: float, share: ArrayLike, end: float = np.inf) -> NDArray:
    """log10 potency below which the largest of so many independent events of a power law lies with these chances.

    N(>= P) falls as P^-b from the cut to the end of the law (log10 m3), so that an event is below x with
    F(x) = (1 - 10^(-b (x - cut))) / (1 - 10^(-b (end - cut))), and the largest with F(x)^events.
    """
    beyond = 10.0 ** (-b * (end - cut))
    above = -np.expm1(np.log(np.asarray(share, float)) / events)  # 1 - F
    return cut - np.log10(above * (1.0 - beyond) + beyond) / b


def expected_range(evidence: Evidence) -> tuple[NDArray, str] | None:
    """log10 potency (lower, upper) between which the largest modelled event may lie by chance, and words for it.

    Of an ensemble the range of its runs; of one run the 95 % interval of the law of sizes, if they follow a power law:
    nothing says where it ends, but no event is larger than all that the model releases. None where neither is known.
    """
    runs = evidence.spread
    if runs is not None and int(runs.attrs["members"]) >= MIN_BLOCKS and runs.sizes["size_bin"]:
        filled = runs["cumulative"].values > 0
        middle = runs["size_bin_lower"].values + SPREAD_BIN_WIDTH / 2
        largest = np.where(filled, middle, -np.inf).max(axis=1)
        if np.isfinite(largest).all():
            return np.array(
                [largest.min(), largest.max()]
            ), f"In {len(largest)} equally valid runs the largest event has"
    law = _law(evidence)
    if law is None:
        return None
    events, b, cut = law
    end = float(np.log10(evidence.catalog["potency"].values.sum()))
    if not end > cut:
        return None
    return largest_of(events, b, cut, INTERVAL_95, end), (
        "If no event is larger than all potency that the model releases, chance alone (95 %) puts the largest event at"
    )


def _law(evidence: Evidence) -> tuple[int, float, float] | None:
    """Number of modelled events above the cut, b and the cut (log10 m3) of a power law; None where they follow none."""
    comparison = evidence.comparison
    if comparison is not None:
        if comparison.attrs["law_model"] != POWER:
            return None
        here = comparison.sel(catalogue="model")
        return int(here["events_above_cut"]), float(here["b"]), float(comparison["cut"])
    floor = float(evidence.catalog.attrs["potency_floor"])
    if not floor > 0:
        return None
    sizes, cut = log_potency(evidence.resolved["potency"].values), float(np.log10(floor))
    found = fit(sizes[np.isfinite(sizes)], cut, 0.0, False, ComparisonSettings())
    return None if found.law.name != POWER else (found.plain.events, found.plain.b, cut)
