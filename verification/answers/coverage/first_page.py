"""Sentences of the report's first page, of models that draw their events from the record's law, and of wrong ones.

Whole catalogues go through comparison and verdict. A right model has events of the law that the record's come from,
without location errors; a wrong one differs from it in one way, such as a shift. Both come in clusters, in steps that
lie apart.
"""

import re
from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from itertools import pairwise
from typing import Any

import numpy as np
import xarray as xr
from scipy.spatial.transform import Rotation

from catalogs.compare.comparison import compare
from catalogs.compare.spread import SPREAD_BIN_WIDTH
from catalogs.report.evidence import Evidence
from catalogs.report.verdict import MORE_THAN_CHANCE, WITHIN_CHANCE, expected_range, verdict
from catalogs.settings import ComparisonSlice, DatedStep
from catalogs.sources import sizes
from catalogs.sources.significance import POWER, SIGNIFICANCE
from common.event_table import new_catalog
from verification.answers.coverage.shares import Coverage, share_at_least, share_at_most
from verification.answers.statistics.samples import branching_events, burst_events, dated, simulated_sizes
from verification.rows import Row

SHEAR_MODULUS = 30e9  # Pa
STEP_APART = np.array([60.0, 0.0, 0.0])  # m, between the places of two steps
MINE = {"mine": "drawn", "shear_modulus": SHEAR_MODULUS, "potency_floor": 1.0}


QUESTION_WORDS = {  # words of the sentence on each
    "number and potency": "the recorded number of events",
    "sizes": "Its b of potency",
    "places": "Their places differ",
    "directions": "rock slips in a direction",
}
CLOSER = re.compile(r"(and|though) closer than random (directions|ones) come")
RANDOM = "random directions"


@dataclass(frozen=True)
class Wrong:
    """By how much a model differs from the record's law: shift (m), turn (degrees; random: any), factors of lengths and
    numbers, and what its b has more."""

    shift: float = 0.0
    turn: float = 0.0
    scale: float = 1.0
    times: float = 1.0
    b_more: float = 0.0
    random: bool = False


def answer(settings: dict, allowed: dict) -> tuple[list[Coverage], list[Row]]:
    """Coverage of the interval of the largest event; shares of right models that a page calls wrong, of wrong ones that
    it does, by as much as it says that it would notice, and of random directions that it calls close."""
    chosen, coverages, rows = settings["first_page"], [], []
    for number, case in enumerate(chosen["cases"]):
        seed = [settings["seed"], 7, number]
        right = pages(case, chosen, Wrong(), seed)
        coverages.append(_largest(case, chosen, right, seed))
        wrong_sums = case["events"] != case["modelled"]
        checked = [name for name in QUESTION_WORDS if not (wrong_sums and name == "number and potency")]
        share = float(np.mean([bool(condemned(sentences) & set(checked)) for _, sentences in right]))
        rows.append(_alarms(f"{case['name']}: right models called wrong", share, chosen["catalogues"]))
        for kind in (kind for kind in STATED if kind in case.get("wrong", ())):
            rows.append(_power(case, chosen, kind, right, [*seed, 1], allowed["power"]))
        if RANDOM in case.get("wrong", ()):
            turned = pages(case, chosen, Wrong(random=True), [*seed, 2])
            close = float(np.mean([bool(CLOSER.search(" ".join(sentences))) for _, sentences in turned]))
            rows.append(_alarms(f"{case['name']}: {RANDOM} called closer", close, chosen["catalogues"]))
    return coverages, rows


def _alarms(name: str, share: float, drawn: int) -> Row:
    """Row of a share that SIGNIFICANCE bounds."""
    quantity = f"{name} (error: above {SIGNIFICANCE:g})"
    return share_at_most(quantity, SIGNIFICANCE, share, SIGNIFICANCE, drawn, "first pages")


STATED: dict[str, tuple[str, str, Callable[[float], Wrong]]] = {  # by kind: question, variable, the model
    "shift": ("places", "shift_noticed", lambda value: Wrong(shift=value)),
    "turn": ("directions", "mechanism_turn_noticed", lambda value: Wrong(turn=value)),
    "b": ("sizes", "b_difference_noticed", lambda value: Wrong(b_more=value)),
    "number": ("number and potency", "event_ratio_noticed", lambda value: Wrong(times=value)),
}


def _power(case: dict, chosen: dict, kind: str, right: list, seed: list[int], least: float) -> Row:
    """Row of the share of wrong models whose own sentence says so; they are as wrong as the median page says that it
    can notice, of those that say so."""
    question, variable, model = STATED[kind]
    values = np.array([float(evidence.comparison[variable]) for evidence, _ in right])
    if kind == "number":  # pages of models with fewer events than the record state a factor below 1
        values = values[values > 1.0]
    stated = float(np.nanmedian(values))
    wrong = model(stated)
    if kind == "b":  # as many events that count
        cut = float(np.nanmedian([float(evidence.comparison["cut"]) for evidence, _ in right]))
        wrong = replace(wrong, times=10.0 ** (stated * cut))
    drawn = max(chosen["catalogues"] // 2, 1)
    found = pages(case, chosen | {"catalogues": drawn}, wrong, seed)
    share = float(np.mean([question in condemned(sentences) for _, sentences in found]))
    name = f"{case['name']}: {kind} of the size that pages state, noticed (error: short of {least:g})"
    return share_at_least(name, POWER, share, least, drawn, f"first pages wrong by {stated:.3g}")


def _largest(case: dict, chosen: dict, right: list, seed: list[int]) -> Coverage:
    """Coverage of the interval of the largest event of another run."""
    generator, held, given = np.random.default_rng([*seed, 3]), 0, 0
    for evidence, _ in right:
        interval = expected_range(evidence)
        another = catalogue(generator, case, chosen, Wrong(), Rotation.identity())
        if interval is not None and another.sizes["event"]:
            given += 1
            held += interval[0] <= np.log10(another["potency"].values.max()) <= interval[1]
    drawn = len(right)
    return Coverage(f"{case['name']}: largest event of another run", drawn, given / drawn, held / max(given, 1))


def condemned(sentences: list[str]) -> set[str]:
    """Questions, of QUESTION_WORDS, in which a page says that the model is wrong."""
    return {
        name
        for name, words in QUESTION_WORDS.items()
        for sentence in sentences
        if words in sentence and MORE_THAN_CHANCE in sentence.replace(WITHIN_CHANCE, "")
    }


def pages(case: dict, chosen: dict, wrong: Wrong, seed: list[int]) -> list[tuple[Evidence, list[str]]]:
    """Evidence and sentences of chosen["catalogues"] first pages of a case."""
    generator = np.random.default_rng(seed)
    return [page(generator, case, chosen, wrong, index) for index in range(chosen["catalogues"])]


def catalogue(
    generator: np.random.Generator, case: dict, chosen: dict, wrong: Wrong | None, rotation: Rotation
) -> xr.Dataset:
    """Events of a case: of the model that is wrong so, or of the record (None), which has location errors.

    rotation: where a wrong model is shifted to, and what it is turned about, or by.

    The record expects case["events"], the model case["modelled"]. Events trigger each other (`branching`; 0:
    independent) or come in `bursts`, in proportion to their number.
    """
    expected = case["events"] if wrong is None else wrong.times * case["modelled"]
    if "bursts" in case:
        each = case["events"] / case["bursts"]
        time, place, cluster = burst_events(generator, chosen["days"], expected / each, each)
    else:
        time, place, cluster = branching_events(generator, chosen["days"], expected, case.get("branching", 0.0))
    step = (time // (chosen["days"] / chosen["steps"])).astype(int)
    turns = Rotation.from_rotvec(
        np.radians(chosen["spread"]) * generator.normal(size=(cluster.max(initial=-1) + 1, 3))[cluster]
    ) * Rotation.from_rotvec(np.radians(chosen["spread"]) * generator.normal(size=(len(time), 3)))
    b, attributes = case["b"], {"kind": "recorded", "location_error": case["error"]}
    if wrong is None:
        place = place + step[:, None] * STEP_APART
        place = place + generator.normal(size=place.shape) * case["error"] / np.sqrt(3.0)
    else:
        direction = rotation.apply([1.0, 0.0, 0.0])
        place = wrong.scale * place + step[:, None] * STEP_APART + wrong.shift * direction
        turns = (rotation if wrong.random else Rotation.from_rotvec(np.radians(wrong.turn) * direction)) * turns
        b, attributes = b + wrong.b_more, {"kind": "synthetic", "location_error": 0.0}
    size = simulated_sizes(generator, len(time), b, case.get("span", np.inf))
    frame = turns.as_matrix()
    axes = np.swapaxes(frame, 1, 2)
    shear = np.einsum("eij,jk,elk->eil", frame, np.diag([-1.0, 0.0, 1.0]), frame)
    values = {
        "time": dated(time),
        "location": place,
        "potency": 10.0**size,
        "potency_tensor": 0.5 * (10.0**size)[:, None, None] * shear,
        **{f"{name}_axis": axes[:, row] for row, name in enumerate("pbt")},
    }
    return new_catalog(len(time), MINE | attributes, **values)


def page(
    generator: np.random.Generator, case: dict, chosen: dict, wrong: Wrong, seed: int
) -> tuple[Evidence, list[str]]:
    """Evidence of a model, in case["runs"] runs, against a record, and the sentences of its first page."""
    rotation = Rotation.random(rng=generator)
    record = catalogue(generator, case, chosen, None, rotation)
    model, *members = (catalogue(generator, case, chosen, wrong, rotation) for _ in range(case.get("runs", 1)))
    edges = dated(np.linspace(0.0, chosen["days"], chosen["steps"] + 1))
    steps = tuple(
        DatedStep(name=f"step {number}", start=str(start), end=str(end))
        for number, (start, end) in enumerate(pairwise(edges))
    )
    settings = ComparisonSlice(resamplings=chosen["resamplings"], seed=seed, steps=steps, members=len(members))
    comparison = compare(model, record, settings, members)
    stages = [
        xr.Dataset(attrs={"stage": "step", "dated": 1, "step": step.name, "start": step.start, "end": step.end})
        for step in steps
    ]
    known: dict[str, Any] = dict.fromkeys(field.name for field in fields(Evidence))
    known |= {"config": {}, "stages": stages, "catalog": model, "record": record, "comparison": comparison}
    evidence = Evidence(**known | {"spread": _spread(model, members)})
    return evidence, verdict(evidence)


def _spread(model: xr.Dataset, members: list[xr.Dataset]) -> xr.Dataset | None:
    """Sizes of the runs as the first page reads them; None without members."""
    if not members:
        return None
    every = [sizes.log_potency(run["potency"].values) for run in (model, *members)]
    edges = sizes.cut_grid(np.concatenate(every), SPREAD_BIN_WIDTH)
    counts = np.array([sizes.counts(x, edges, SPREAD_BIN_WIDTH)[1] for x in every])
    return xr.Dataset(
        {"size_bin_lower": ("size_bin", edges), "cumulative": (("run", "size_bin"), counts)},
        attrs={"members": len(members)},
    )
