"""Inputs and outputs of the rules of verification/rules/benchmarks.smk. Cases run one after the other."""

import functools
import json
import sys
from dataclasses import asdict

from common.errors import InputError
from verification.benchmarks.settings import Case, Settings, read_settings

RESULTS = "results/benchmarks"
RUN = f"{RESULTS}/runs/{{problem}}/{{code}}/{{across}}.json"


@functools.cache
def settings() -> Settings:
    """The settings, read when a rule first asks for them."""
    try:
        return read_settings()
    except InputError as error:
        sys.exit(str(error))


def file_of(case: Case) -> str:
    """Result of a case."""
    return RUN.format(**asdict(case))


def all_runs(wildcards=None) -> list[str]:
    """Results of all cases, in order."""
    return [file_of(case) for case in settings().cases()]


def case_of(wildcards) -> Case:
    """The case of a file."""
    case = Case(wildcards.problem, wildcards.code, int(wildcards.across))
    if case not in settings().cases():
        sys.exit(f"config/benchmarks.yaml: asks for no case {case.problem}, {case.code}, {case.across}")
    return case


def earlier_of(case: Case) -> list[Case]:
    """The cases of the same code and problem with fewer cells, in order."""
    return [
        other
        for other in settings().cases()
        if (other.problem, other.code) == (case.problem, case.code) and other.across < case.across
    ]


def runs_before(wildcards) -> list[str]:
    """Results that a case waits for: the previous case's, and those of smaller cases, which show its costs."""
    case = case_of(wildcards)
    cases = settings().cases()
    previous = cases[: cases.index(case)][-1:]
    return [file_of(other) for other in dict.fromkeys([*earlier_of(case), *previous])]


def smaller_runs(wildcards) -> list[str]:
    """Results of the smaller cases alone."""
    return [file_of(other) for other in earlier_of(case_of(wildcards))]


def settings_slice(wildcards=None) -> str:
    """The settings as text: what all results depend on."""
    return json.dumps(asdict(settings()), sort_keys=True)
