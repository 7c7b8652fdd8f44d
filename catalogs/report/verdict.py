"""What the model says and how well it agrees with the record, in sentences for the first page."""

import numpy as np

from catalogs.report.catalogues_shown import compared_events, shown_catalogues
from catalogs.report.inputs import Evidence
from catalogs.report.largest_event import expected_range
from catalogs.report.step_lines import cut_of, shear_modulus
from catalogs.report.text import between, fixed, headline, magnitude, number, where, whole

SIGNIFICANCE = 0.05  # A difference with a smaller p-value is more than chance explains.
LEAST_AS_FRACTION = 0.2  # Smaller ratios are written as 1/n.
FAR = 3.0  # A factor by which potency is far off.


def verdict(evidence: Evidence) -> list[str]:
    """A sentence or two on each question that the report answers, and one on what it cannot say."""
    if evidence.catalog is None or not evidence.dated:
        return [headline(evidence)[0], *_no_dates(evidence)]
    recorded = 0 if evidence.record is None else evidence.record.sizes["event"]
    if not evidence.catalog.sizes["event"] and not recorded:
        return [headline(evidence)[0], *_unchecked(evidence)]
    if evidence.comparison is None:
        return [*_alone(evidence), *_unchecked(evidence), _cannot(evidence)]
    counts = [int(value) for value in evidence.comparison["events_above_cut"].values]
    if not all(counts):
        return [_one_sided(evidence, *counts), *_alone(evidence), _cannot(evidence)]
    return [
        *_potency(evidence),
        *_places(evidence),
        *_directions(evidence),
        *_largest(evidence),
        _cannot(evidence),
    ]


def as_ratio(value: float) -> str:
    """A ratio as a reader says it: 1.2, 0.43, 1/29."""
    if 0 < value < LEAST_AS_FRACTION:
        return f"1/{number(1 / value, 2)}"
    return number(value, 2)


def size_of_cut(evidence: Evidence) -> str:
    """The smallest size that counts, as Mw."""
    return f"Mw {fixed(magnitude(10.0 ** cut_of(evidence), shear_modulus(evidence)), 1)}"


def _no_dates(evidence: Evidence) -> list[str]:
    """That a record which is given is not compared."""
    if not evidence.steps or "record" not in evidence.config:
        return []
    return ["The record is not compared, since no step of this mine has dates."]


def _unchecked(evidence: Evidence) -> list[str]:
    """That nothing is compared."""
    if evidence.record is not None:
        return []
    return ["There is no record: nothing here is checked against events that happened."]


def _alone(evidence: Evidence) -> list[str]:
    """How much the model releases, where, and its largest event."""
    if not evidence.catalog.sizes["event"]:
        return []
    potency = float(evidence.catalog["potency"].values.sum())
    as_one = fixed(magnitude(potency, shear_modulus(evidence)), 1)
    text = f"The model releases {number(potency)} m³ of potency (slip times area), as much as one event of Mw {as_one}."
    return [text, *where(evidence), *_largest(evidence)]


def _one_sided(evidence: Evidence, modelled: int, recorded: int) -> str:
    """That one of the catalogues has no event to compare."""
    cut = size_of_cut(evidence) if np.isfinite(cut_of(evidence)) else ""
    sized = f" of {cut} and more" if cut and "nan" not in cut else ""
    if not modelled and not recorded:
        return f"Neither the model nor the record has an event{sized}: nothing can be compared."
    if not modelled:
        return f"The model makes no event{sized}, where the record has {whole(recorded)}."
    text = f"The record has no event{sized}, where the model makes {whole(modelled)}: "
    chance = float(evidence.comparison["event_ratio_p_value"])
    return text + (_by_chance(chance) if np.isfinite(chance) else "nothing can be compared") + "."


def _by_chance(p_value: float) -> str:
    return "more than chance explains" if p_value < SIGNIFICANCE else "no more than chance explains"


def _potency(evidence: Evidence) -> list[str]:
    """Ratios of potency and number with their intervals, and whether chance makes the difference."""
    comparison = evidence.comparison
    runs = int(comparison["model_runs"])
    who = f"The mean of {runs} runs of the model" if runs > 1 else "The model"
    (ratio, potency), (times, events) = (_ratio(evidence, name) for name in ("potency_ratio", "event_ratio"))
    small = 0 < ratio < LEAST_AS_FRACTION
    how = f"{as_ratio(ratio)} of" if small else f"{as_ratio(ratio)} times"
    text = f"{who} releases {how} the recorded potency{potency}, in {as_ratio(times)}"
    text += f"{' of' if 0 < times < LEAST_AS_FRACTION else ' times'} as many events{events}."
    return [f"{text} {_judged(evidence, ratio)}"]


def _ratio(evidence: Evidence, name: str) -> tuple[float, str]:
    """A ratio and its interval in brackets; empty where it has none."""
    interval = between(evidence.comparison[f"{name}_interval"].values, as_ratio)
    known = np.isfinite(evidence.comparison[f"{name}_interval"].values).any()
    return float(evidence.comparison[name]), f" (95 %: {interval})" if known else ""


def _judged(evidence: Evidence, ratio: float) -> str:
    """What the interval of the ratio of potencies says."""
    low, high = evidence.comparison["potency_ratio_interval"].values
    if not np.isfinite(low):
        return "Whether chance explains the difference is not known."
    if low <= 1 <= high:
        return "Chance explains the difference in potency."
    far = "far too" if max(ratio, 1 / ratio) >= FAR else "too"
    return f"That is {far} {'little' if ratio < 1 else 'much'}, and more than chance explains."


def _places(evidence: Evidence) -> list[str]:
    """How far apart modelled and recorded events are, against the error of location and the spacing of the record."""
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
    """Mw of the largest modelled event and how far chance moves it, and of the largest recorded one."""
    shown = shown_catalogues(evidence)
    chosen = compared_events(evidence, shown)
    sizes = [events["mw"].values[chosen[label]] for label, events in shown.items()]
    model = sizes[0][np.isfinite(sizes[0])]
    if not len(model):
        return []
    text = f"Its largest event has Mw {fixed(model.max(), 1)}"
    expected = expected_range(evidence)
    if expected is not None:
        bounds, source = expected
        low, high = (magnitude(10.0**bound, shear_modulus(evidence)) for bound in bounds)
        text += f"; {source} Mw {between((low, high), lambda value: fixed(value, 1))}"
    record = sizes[1][np.isfinite(sizes[1])] if len(sizes) > 1 else []
    return [text + (f". The largest recorded one has Mw {fixed(max(record), 1)}." if len(record) else ".")]


def _cannot(evidence: Evidence) -> str:
    """What the report does not know."""
    comparison = evidence.comparison
    found = ["when within its step an event happens"]
    if comparison is not None and np.isfinite(cut_of(evidence)):
        found.append(f"how many events below {size_of_cut(evidence)} there are")
    if comparison is not None and comparison["events_above_cut"].values.all():
        if not np.isfinite(comparison["energy_p_value"]):
            found.append("whether places and directions agree by more than chance")
        if not int(comparison.attrs.get("axes_present", 0)):
            found.append("in which direction rock moved, since the record has no mechanisms to compare with")
    return f"It cannot say {', '.join(found[:-1])}{' or ' if len(found) > 1 else ''}{found[-1]}."
