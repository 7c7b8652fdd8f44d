"""Runs of the cases, and the kinds of their ends. A fault is what must never happen."""

import functools
import json
import logging
import math
import tempfile
import time
import traceback
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from common.errors import InputError
from verification.extremes.outcomes import FAULTS, RESTS, Outcome
from verification.extremes.outcomes import run as run_stages
from verification.extremes.tiny_mine import write_mine
from verification.rows import KNOWN_MISS, VERDICTS
from verification.stability.balances import broken, lacking
from verification.stability.cases import Case, Knob
from verification.studies import default_settings, merge
from workflow.configuration import load

RIGHT, SOUND, WRONG, ENDED, REFUSED, FAULT = (
    "converged and right",
    "converged and sound",
    "converged and wrong",
    "not converged and said so",
    "refused and said why",
    "fault",
)
BALANCES = ("mass", "momentum_error", "net_force", "energy_left_share")
MAX_RUNS_KEPT = 8  # Judges ask for the same run again.


@dataclass(frozen=True)
class Point:
    """A case and its result.

    error: by its judge, NaN where there is none or nothing to judge. known: why the case is wrong, where that is known.
    passed: "no" where the target must fail for it, "known miss" where neither its error nor the energy that its balance
    leaves over is more than is known. seconds: processor time. mass (kg), momentum_error (share), net_force (N),
    energy_left_share: the largest of all states.
    """

    knob: str
    series: str
    value: float | str
    kind: str
    error: float
    allowed: float
    message: str
    known: str
    passed: str
    seconds: float
    mass: float
    momentum_error: float
    net_force: float
    energy_left_share: float


class Runner:
    """Runs scenes through their stages in a folder, and keeps the last MAX_RUNS_KEPT outcomes."""

    def __init__(self, folder: Path):
        self.folder = folder
        self.kept = functools.lru_cache(MAX_RUNS_KEPT)(lambda text: run_stages(json.loads(text), folder))

    def __call__(self, values: dict) -> Outcome:
        """Outcome of a scene."""
        return self.kept(json.dumps(values))


def measure(knob: Knob) -> list[Point]:
    """Run all cases of a knob."""
    with tempfile.TemporaryDirectory() as folder:
        run = Runner(Path(folder))
        points = []
        for case in knob.cases():
            began = time.process_time()
            kind, error, message, facts = _mistake(case, run) if case.refused else _judged(case, run)
            points.append(_point(knob, case, kind, error, message, facts, time.process_time() - began))
            logging.info("%s, %s, %s: %s %.3g %s", knob.key, case.series, case.value, kind, error, message)
    return points


def _judged(case: Case, run: Runner) -> tuple[str, float, str, dict]:
    """Kind, error, message and balances of a case that is run."""
    with case.under():
        outcome = run_stages(case.values, run.folder)
    facts = balances_of(outcome)
    if outcome.kind in FAULTS:
        return FAULT, math.nan, f"{outcome.kind}: {outcome.message}", facts
    if outcome.kind != RESTS:
        return ENDED if outcome.has_begun else REFUSED, math.nan, _without_folder(outcome.message, run), facts
    values = merge(default_settings(), case.values)
    faults = broken(values, outcome)
    if faults:
        return FAULT, math.nan, faults[0], facts
    lacks, line = lacking(outcome)
    facts["energy_left_share"] = lacks
    if case.judge is None:
        return (WRONG, lacks, line, facts) if line else (SOUND, math.nan, "", facts)
    error = case.judge(values, outcome, run)
    attributes = [state.attrs for state in outcome.states.values()]
    cut = [f"labelled truncated: {state['truncated_where']}" for state in attributes if state["truncated"]]
    is_right = error <= case.allowed and not line
    # The label says that rock was kept from failing, which explains no energy that is lacking.
    kind = RIGHT if is_right else ENDED if cut and not line else WRONG
    return kind, float(error), line or (cut[0] if cut else ""), facts


def _without_folder(message: str, run: Runner) -> str:
    """A message without the folder of the run."""
    return message.removeprefix(f"{run.folder / 'mine.yaml'}: ").replace(str(run.folder), "...")


def _mistake(case: Case, run: Runner) -> tuple[str, float, str, dict]:
    """Kind, error, message and no balances of a mistake in a mine's file, which must be refused in the right words."""
    assert case.refused is not None
    begins, says = case.refused
    file = write_mine(case.values, run.folder / "mine.yaml")
    try:
        default = default_settings()
        load(merge(default, case.values), file, default)
    except InputError as error:
        told = _without_folder(str(error), run)
        if told.startswith(begins) and says in told and "\n" not in told:
            return REFUSED, math.nan, told, {}
        return FAULT, math.nan, f"refused in other words: {told}", {}
    except Exception:  # A traceback that a user would see is a finding here.
        return FAULT, math.nan, traceback.format_exc().strip().replace("\n", " | "), {}
    return WRONG, math.inf, "not refused", {}


def balances_of(outcome: Outcome) -> dict[str, float]:
    """Largest value of each balance over the states of a run."""
    states = [state.attrs for state in outcome.states.values()]
    return {name: float(np.max([state[name] for state in states])) for name in BALANCES} if states else {}


def _point(knob: Knob, case: Case, kind: str, error: float, message: str, facts: dict, seconds: float) -> Point:
    facts = dict.fromkeys(BALANCES, math.nan) | facts
    lacks = facts["energy_left_share"]  # NaN where there is none
    known = case.known.cause if case.known and kind == WRONG else ""
    passed = VERDICTS[kind not in (WRONG, FAULT)]
    if kind == WRONG and case.known and error <= case.known.at_most and not lacks > case.known.at_most:
        passed = KNOWN_MISS
    return Point(
        knob.key, case.series, case.value, kind, error, case.allowed, message, known, passed, round(seconds, 2), **facts
    )
