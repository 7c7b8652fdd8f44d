"""The law of sizes that all plans of a page share: that of the record, or of all events of all plans.

Plans share runs of steps, and each event counts once. Runs of a plan share events, so each counts as less than one.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from catalogs.sources.completeness import MIN_EVENTS_ABOVE_CUT
from catalogs.sources.jackknife import INTERVAL_95
from catalogs.sources.sizes import LN10, MIN_EVENTS_FOR_B, log_potency
from catalogs.sources.truncated_law import TruncatedLaw, draw_law
from plans.record import RecordedNumbers
from plans.runs import StepResult

# Least room for an upper end above the largest event seen, log10 m3, where all potency of the plans leaves less.
MIN_ROOM = 1.0
# Classes of size that runs are compared in: an event that two runs share has not quite the same size in each.
MAX_CLASSES = 8
MIN_EVENTS_OF_CLASS = 5  # of each run, on average


def size_law(
    plans: Sequence[Sequence[Sequence[StepResult]]],
    floor: float,
    recorded: RecordedNumbers | None,
    draws: int,
    generator: np.random.Generator,
) -> tuple[TruncatedLaw | None, dict[str, Any]]:
    """The law of sizes of the record where it has enough events, else of all plans, and its attributes; None without.

    plans: each with its own run and its members, by step; their order does not matter. floor: log10 m3.
    """
    steps = distinct_steps(plans)
    # in order of size: the sum of the same numbers in another order is rounded in another way
    modelled = np.sort(log_potency(np.concatenate([one.potency for step in steps for one in step])))
    x, width, weight, source = modelled, 0.0, independent_share(steps), "model"
    whole = max(sum(step.whole_potency for step in run) for plan in plans for run in plan)
    if recorded is not None:
        whole = max(whole, recorded.potency)
        if len(recorded.sizes) >= MIN_EVENTS_ABOVE_CUT:
            x, width, weight, source = recorded.sizes, recorded.width, 1.0, "record"
    if len(x) < MIN_EVENTS_FOR_B or not np.isfinite(floor):
        missing = {
            "law_b": np.nan,
            "law_bound": np.nan,
            "law_b_interval": [np.nan] * 2,
            "law_bound_interval": [np.nan] * 2,
        }
        return None, {"law_source": "none", "law_events": len(x), **missing}
    cap = max(np.log10(whole), float(max(x.max(), modelled.max(initial=-np.inf))) + MIN_ROOM)
    law = draw_law(x, floor, cap, draws, generator, width, weight)
    return law, {
        "law_source": source,
        "law_events": len(x),
        "law_b": float(np.median(law.rate) / LN10),
        "law_b_interval": _interval(law.rate / LN10),
        "law_bound": float(np.median(law.bound)),
        "law_bound_interval": _interval(law.bound),
    }


def _interval(draws: NDArray) -> NDArray:
    """95 % interval (2,) of draws (draw,)."""
    return np.quantile(draws, INTERVAL_95)


def distinct_steps(plans: Sequence[Sequence[Sequence[StepResult]]]) -> list[list[StepResult]]:
    """Results of the runs of each step of all plans, in order of their files; a file that plans share comes once.

    Steps that share a file are one, though a plan may lack runs of it that have collapsed later.
    """
    steps: list[list[StepResult]] = []
    known: dict[str, list[StepResult]] = {}  # by file
    for plan in plans:
        for step in zip(*plan, strict=True):
            same = next((known[one.file] for one in step if one.file in known), None)
            if same is None:
                same = []
                steps.append(same)
            for one in step:
                if not one.file or one.file not in known:
                    same.append(one)
                if one.file:
                    known[one.file] = same
    return sorted(steps, key=lambda step: step[0].file)


def independent_share(steps: Sequence[Sequence[StepResult]]) -> float:
    """Number of independent sizes that each event of these steps, by run, counts as: 1 for runs that share nothing, one
    over their number if all are the same.

    K runs that share a part rho of their events are worth K / (1 + (K - 1) rho) independent ones (Kish 1965). Numbers
    by class of size, given how many events each run has, differ between such runs by 1 - rho of what they do between
    independent ones. So Pearson's chi-square is that part of its degrees of freedom, whatever clusters the events make.
    """
    square, freedom = 0.0, 0
    for step in steps:
        sizes = [log_potency(one.potency) for one in step if len(one.potency)]
        every = np.concatenate([*sizes, np.empty(0)])
        classes = min(MAX_CLASSES, int(len(every) / (MIN_EVENTS_OF_CLASS * len(step))))
        if len(sizes) < 2 or classes < 2:
            continue
        # of equal numbers: classes of single events would be those that are not shared
        edges = np.quantile(every, np.arange(1, classes) / classes)
        counted = np.array([np.bincount(np.searchsorted(edges, one), minlength=classes) for one in sizes], float)
        expected = np.outer(counted.sum(axis=1), counted.sum(axis=0)) / counted.sum()
        square += float(np.sum((counted - expected) ** 2 / expected))
        freedom += (len(sizes) - 1) * (classes - 1)
    shared = float(np.clip(1.0 - square / freedom, 0.0, 1.0)) if freedom else 0.0
    number = np.array([sum(len(one.potency) for one in step) for step in steps], float)
    share = np.array([1.0 / (1.0 + (len(step) - 1) * shared) for step in steps])
    return float(np.average(share, weights=number)) if number.any() else 1.0
