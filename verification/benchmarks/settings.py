"""Checked settings of config/benchmarks.yaml: codes, problems, sizes, limits, and the scene of each case."""

from dataclasses import dataclass, field
from pathlib import Path

from common.errors import InputError
from common.quantities import parse_quantity
from verification.studies import default_settings, for_verification, merge
from workflow import BASE
from workflow.configuration import load
from workflow.mine import Mine
from workflow.strict_yaml import read_yaml

ROOT = Path(__file__).resolve().parents[2]
FILE = BASE / "config" / "benchmarks.yaml"
PEERS = ROOT / "verification" / "benchmarks" / "peers"
REFERENCE = "multigrid"  # Ratios are taken to this code.
QUANTITIES = {"time_limit": "s", "memory_limit": "GB", "repeat_below": "s"}
KEYS = (*QUANTITIES, "threads", "repetitions", "cells_across", "codes", "scene", "problems")
CODE_KEYS = ("title", "scene", "script", "requirements", "module", "agrees", "time_limit")
PROBLEM_KEYS = ("title", "codes", "scene", "cells_across")


@dataclass(frozen=True)
class Code:
    """A code that is measured. Ours: `scene` changes the configuration. A peer: `script` in peers/.

    requirements: file in peers/ of the packages of a peer's environment. module: what a peer without such a file needs
    in the system's Python. agrees_with, within: the code whose closure it must give on the same mesh, and the share by
    which it may differ.
    time_limit: its own, s, in place of that of all.
    """

    title: str
    scene: dict = field(default_factory=dict)
    script: str = ""
    requirements: str = ""
    module: str = ""
    agrees_with: str = ""
    within: float = 0.0
    time_limit: float | None = None


@dataclass(frozen=True)
class Problem:
    """What is solved: changes of the scene, the codes that solve it, and the sizes at which they do."""

    title: str
    codes: tuple[str, ...]
    scene: dict
    cells_across: tuple[int, ...]


@dataclass(frozen=True)
class Case:
    """One solution: names of code and problem, cells across the stope."""

    problem: str
    code: str
    across: int

    @property
    def name(self) -> str:
        """Name of its file, its log and its command."""
        return f"{self.problem}-{self.code}-{self.across}"


@dataclass(frozen=True)
class Settings:
    """The whole file; time_limit, repeat_below s, memory_limit GB."""

    threads: int
    time_limit: float
    memory_limit: float
    repetitions: int
    repeat_below: float
    codes: dict[str, Code]
    problems: dict[str, Problem]
    scene: dict

    def cases(self) -> list[Case]:
        """All cases in the order in which they run. Codes alternate, so that a slow minute affects all of them."""
        return [
            Case(name, code, across)
            for across in sorted({across for problem in self.problems.values() for across in problem.cells_across})
            for name, problem in self.problems.items()
            if across in problem.cells_across
            for code in problem.codes
        ]

    def case(self, name: str) -> Case:
        """The case of a name. Raises InputError if the file asks for none of this name."""
        for case in self.cases():
            if case.name == name:
                return case
        raise InputError(f"{FILE.name}: asks for no case {name}")

    def time_limit_of(self, code: str) -> float:
        """Seconds that a solution by this code may take."""
        return self.codes[code].time_limit or self.time_limit

    def mine(self, case: Case) -> Mine:
        """The checked configuration of a case; for a peer, that of the scene that it solves."""
        scene = merge(self.scene, self.problems[case.problem].scene)
        scene = merge(scene, self.codes[case.code].scene)
        first, last = (parse_quantity(scene["excavations"][0][corner][0], "m") for corner in ("lower", "upper"))
        changes = {
            "name": case.name,
            "grid": {"finest_cell": f"{(last - first) / case.across!r} m"},
        }
        default = default_settings()
        return load(merge(default, for_verification(merge(scene, changes))), FILE, default)

    def numbers(self, case: Case, threads: int) -> dict:
        """The case as peers/stope.py describes it: SI numbers, lengths in cells."""
        mine = self.mine(case)
        settings, host, stope = mine.settings, mine.settings.materials["host"], mine.excavations[0]
        cell, lower = mine.finest_cell, settings.domain.lower

        def in_cells(corner: tuple[float, ...]) -> list[int]:
            return [round((place - start) / cell) for place, start in zip(corner, lower, strict=True)]

        numbers = {
            "cells": in_cells(settings.domain.upper),
            "stope_lower": in_cells(stope.lower),
            "stope_upper": in_cells(stope.upper),
            "cell": cell,
            "stress": [getattr(settings.insitu_stress.constant, axes) for axes in ("xx", "yy", "zz")],
            "youngs_modulus": host.youngs_modulus,
            "poisson_ratio": host.poisson_ratio,
            "tolerance": settings.solver.tolerance,
            "threads": threads,
        }
        if host.model == "coulomb":
            numbers |= {key: getattr(host, key).intact for key in ("cohesion", "friction_angle", "dilation_angle")}
            numbers["increments"] = settings.solver.increments
        return numbers


def _quantity(text: dict, key: str, where: str = "") -> float:
    try:
        return parse_quantity(text[key], QUANTITIES[key])
    except ValueError as error:
        raise InputError(f"{FILE.name}: {where}{key}: {error}") from error


def _check_keys(text: dict, where: str, keys: tuple[str, ...], needed: tuple[str, ...]) -> None:
    """Raises InputError, one line, where a part of the file has an unknown key or lacks one that it needs."""
    unknown, missing = sorted(set(text) - set(keys)), sorted(set(needed) - set(text))
    if unknown or missing:
        wrong = f"{unknown[0]}: unknown key" if unknown else f"{missing[0]}: missing"
        raise InputError(f"{FILE.name}: {where}{wrong}; there are {', '.join(keys)}")


def _code(name: str, text: dict) -> Code:
    _check_keys(text, f"codes.{name}.", CODE_KEYS, ())
    if "title" not in text or ("scene" in text) == ("script" in text):
        raise InputError(f"{FILE.name}: codes.{name}: needs a title, and scene (a code of ours) or script (a peer)")
    if "script" in text and ("requirements" in text) == ("module" in text):
        raise InputError(f"{FILE.name}: codes.{name}: a peer needs requirements, or a module of the system's Python")
    partner = text.get("agrees", {"with": "", "within": 0.0})
    given = {key: text[key] for key in text if key != "agrees"}
    if "time_limit" in text:
        given["time_limit"] = _quantity(text, "time_limit", f"codes.{name}.")
    return Code(**given, agrees_with=partner["with"], within=float(partner["within"]))


def _problem(name: str, text: dict, codes: dict[str, Code], cells_across: list[int]) -> Problem:
    _check_keys(text, f"problems.{name}.", PROBLEM_KEYS, PROBLEM_KEYS[:3])
    strangers = [code for code in text["codes"] if code not in codes]
    if strangers:
        raise InputError(f"{FILE.name}: problems.{name}.codes: no '{strangers[0]}'; there are {', '.join(codes)}")
    sizes = tuple(sorted(text.get("cells_across", cells_across)))
    return Problem(text["title"], tuple(text["codes"]), text["scene"], sizes)


def parse(text: dict) -> Settings:
    """Settings from the file's content. Raises InputError, one line, naming the key."""
    _check_keys(text, "", KEYS, KEYS)
    codes = {name: _code(name, entry) for name, entry in text["codes"].items()}
    for partner in (REFERENCE, *(code.agrees_with for code in codes.values())):
        if partner and partner not in codes:
            raise InputError(f"{FILE.name}: codes: no '{partner}'; there are {', '.join(codes)}")
    problems = {name: _problem(name, entry, codes, text["cells_across"]) for name, entry in text["problems"].items()}
    checked: dict = {"codes": codes, "problems": problems}
    checked |= {key: text[key] for key in ("threads", "repetitions", "scene")}
    checked |= {key: _quantity(text, key) for key in QUANTITIES}
    return Settings(**checked)


def read_settings(path: Path = FILE) -> Settings:
    """The settings of a file."""
    return parse(read_yaml(path))
