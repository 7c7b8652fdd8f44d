"""Inputs and outputs of the rules of the studies, and the mines that studies add to those of a run."""

import functools
import json
import os
import sys
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path

from snakemake.iocontainers import Wildcards

from common.errors import InputError
from verification.benchmarks.settings import Settings, read_settings
from verification.calibration_truth.settings import TERMS
from verification.foreseen import CASES as FORESEEN
from verification.foreseen import REQUESTS
from verification.scale import ARRAYS, DRAWN
from verification.stability import KEYS, SEVERAL_SEEDS
from verification.studies import Study, load_study
from workflow.folders import NAME
from workflow.mine import Mine
from workflow.result_files import stage_results
from workflow.stages import package_hash
from workflow.strict_yaml import read_yaml


class Studies:
    """The studies of a folder, each read when a rule first asks for it. Their variants are mines of their own."""

    pattern = f"verification/{NAME}/{NAME}"

    def __init__(self, folder: Path, default: dict):
        self.folder = folder
        self.default = default
        self.default_text = json.dumps(default, sort_keys=True)
        self.read = functools.cache(self._read)

    def _read(self, name: str) -> Study:
        """A study by its name. Ends the run in one line if its file is wrong."""
        try:
            return load_study(os.path.relpath(self.file(name)), self.default)
        except InputError as error:
            sys.exit(str(error))

    def file(self, name: str) -> str:
        """The file of a study."""
        return f"{self.folder}/{name}.yaml"

    def sources(self, name: str) -> list[str]:
        """Files that a study is read from: its own, and that of the mine that it takes its scene from."""
        mine = read_yaml(self.file(name)).get("scene_from")
        return [self.file(name), *([os.path.normpath(self.folder / mine)] if mine else [])]

    def mine_at(self, place: str) -> Mine:
        """Configuration of the variant whose folder is results/<place>. Ends the run in one line if there is none."""
        _, name, variant = place.split("/")
        mines = self.read(name).mines
        if variant not in mines:
            sys.exit(f"config/verification/{name}.yaml: variants: no '{variant}'; there are {', '.join(mines)}")
        return mines[variant]

    def threads_at(self, place: str) -> int:
        """Threads of the stages of the variant whose folder is results/<place>."""
        return self.read(place.split("/")[1]).threads

    def named(self, start: str) -> list[str]:
        """Names of all studies that begin like this, none of which is read."""
        return sorted(path.stem for path in self.folder.glob(f"{start}*.yaml"))

    def variants(self, start: str) -> list[str]:
        """Studies that begin like this, each with each of its variants, as names of cases: <study>-<variant>."""
        return [f"{name}-{variant}" for name in self.named(start) for variant in self.read(name).mines]

    def verified(self) -> list[str]:
        """Names of the studies that the target `verification` runs. Others may lack data, so they are not read."""
        return [name for name in self.named("") if not read_yaml(self.file(name)).get("on_request", False)]

    def tables(self, wildcards: Wildcards) -> list[str]:
        """Tables of these studies."""
        return [f"results/verification/{name}/table.csv" for name in self.verified()]

    def answer_sources(self, wildcards: Wildcards) -> str:
        """Hash of the sources of a study's answer.

        Ends the run in one line for a scene of a measuring study, whose rows stand in the table of that study.
        """
        answer = self.read(wildcards.study).answer
        if answer in MEASURING:
            sys.exit(f"config/verification/{wildcards.study}.yaml: its rows stand in results/{answer}/table.csv")
        return package_hash(*MODEL, "verification")

    def answer_threads(self, wildcards: Wildcards) -> int:
        """Threads of a study's answer: those of the study if it has no scenes, else one; 64 takes all there are."""
        study = self.read(wildcards.study)
        return 1 if study.mines else study.threads

    def results(self, wildcards: Wildcards) -> list[str]:
        """Results of all stages of all variants of a study."""
        return self.results_of([wildcards.study])

    def results_of(self, names: list[str]) -> list[str]:
        """Results of all stages of several studies, members of their ensembles included."""
        files = []
        for name in names:
            study = self.read(name)
            for key, mine in study.mines.items():
                files += stage_results(f"verification/{name}/{key}", mine, study.events)
        return files


# What results of events depend on beyond the mechanics. The report beside it shows them.
EVENTS = ("catalogs/compare", "catalogs/sources")


@dataclass(frozen=True)
class Measuring:
    """Description, for the rules, of a study that measures cases of its own; they do not load its package.

    Its package in verification has its name, and in it STUDY (verification.frame). names: names of its cases, in the
    order of its table. memory: of a case, MiB; 0 if its cases are not made by the rule `case`. uses: parts of
    verification that a case runs beside its package and SHARED. tables: names of the tables that it writes beside
    "table". numerics: folders and files with which its results may change, beside verification.made.NUMERICS.
    """

    names: Callable[["Cases"], list[str]]
    memory: int = 0
    uses: tuple[str, ...] = ()
    tables: tuple[str, ...] = ()
    numerics: tuple[str, ...] = ()


MEASURING = {  # By the name of the target.
    # What each setting buys: speed against accuracy.
    "tradeoff": Measuring(
        lambda cases: cases.studies.named("tradeoff_"),
        memory=6000,
        uses=("answers/kirsch", "answers/sphere.py", "cavities"),
        tables=("prices", "truths"),
    ),
    # Variances of potency, number, b and the largest event by source; what an ensemble costs and buys. The smallest
    # scene is the first.
    "catalog_spread": Measuring(
        lambda cases: cases.studies.named("spread_")[::-1],
        memory=4000,
        uses=("tradeoff",),
        numerics=EVENTS,
    ),
    # Processor time and memory of shipped mines, by cells and steps.
    "mine_times": Measuring(lambda cases: cases.studies.named("times_")[::-1], memory=4000, tables=("steps",)),
    # Processor time and memory of all stages as cells, openings, steps and events grow.
    "scale": Measuring(
        lambda cases: [*cases.studies.named("scale_"), *DRAWN, ARRAYS],
        memory=12000,
        tables=("growth", ARRAYS),
        numerics=EVENTS,
    ),
    # What each economy saves, off against on, one at a time.
    "economies": Measuring(
        lambda cases: cases.studies.variants("economies_"),
        memory=12000,
        tables=("savings",),
        numerics=EVENTS,
    ),
    # What quotes foresee beside what runs take.
    "foreseen": Measuring(
        lambda cases: [*FORESEEN, *cases.studies.variants(REQUESTS)],
        memory=8000,
        tables=("held", "requested"),
        numerics=("catalogs/compare/cell_error.py", "workflow/pilot.py", "workflow/quote.py"),
    ),
    # Elastic and Coulomb equilibrium at growing size, both schemes beside other codes, and a brittle step.
    "benchmarks": Measuring(lambda cases: [case.name for case in cases.benchmarks().cases()], memory=21000),
    # The numerics driven until they break, one setting at a time.
    "stability": Measuring(
        lambda cases: list(KEYS), memory=2000, uses=("cavities", "extremes"), tables=("ranges", "settings")
    ),
    # Random mines at the extremes. Its cases are cases of stability, so that none runs for both.
    "extremes": Measuring(lambda cases: list(SEVERAL_SEEDS), tables=("ranges", "settings")),
    # Coverage and widths of a calibration's intervals, twins that come back, records that are flagged, another sampler.
    "calibration_truth": Measuring(lambda cases: list(TERMS), numerics=("calibration",)),
}
BY_RULE_CASE = [target for target, measuring in MEASURING.items() if measuring.memory]
# Packages that answers and cases measure.
MODEL = (
    *("common", "mpm_core", "seismic", "catalogs", "baselines", "calibration", "plans", "response", "shaking"),
    "workflow",
)
SHARED = ("comparisons.py", "results.py", "rows.py", "scenes.py", "studies.py")  # Modules of verification.


def case_sources(target: str) -> str:
    """Hash of what the cases of a target run. Its pages and figures are left out: they measure nothing."""
    parts = (target, *MEASURING[target].uses, *SHARED)
    return package_hash(*MODEL, *(f"verification/{part}" for part in parts))


class Cases:
    """Cases of the measuring studies: a file for each, and what its job needs. A target is the name of such a study.

    Benchmarks run one after the other: each case takes all threads and waits for the one before it.
    """

    studies: Studies
    benchmarks: Callable[[], Settings]

    def __init__(self, studies: Studies):
        self.studies = studies
        self.benchmarks = functools.cache(self._benchmarks)

    def _benchmarks(self) -> Settings:
        """Settings of the benchmarks. Ends the run in one line if their file is wrong."""
        try:
            return read_settings()
        except InputError as error:
            sys.exit(str(error))

    def names(self, target: str) -> list[str]:
        """Names of the cases of a target, in the order of its table."""
        return MEASURING[target].names(self)

    def files(self, target: str) -> list[str]:
        """Results of these cases."""
        folder = "stability" if target == "extremes" else target
        return [f"results/{folder}/cases/{name}.json" for name in self.names(target)]

    def inputs(self, wildcards: Wildcards) -> list[str]:
        """Files that a case waits for: results of a study's stages, or the benchmarks before it."""
        if wildcards.target == "benchmarks":
            names = self.names("benchmarks")
            if wildcards.case not in names:
                sys.exit(f"config/benchmarks.yaml: asks for no case {wildcards.case}; there are {', '.join(names)}")
            previous = self.files("benchmarks")[: names.index(wildcards.case)][-1:]
            return list(dict.fromkeys([*self.smaller(wildcards.case), *previous]))
        if "-" in wildcards.case:  # a variant that the case runs itself
            return self.studies.sources(wildcards.case.partition("-")[0])
        if wildcards.target in ("stability", "foreseen") or wildcards.case in (*DRAWN, ARRAYS):
            return []
        return [*self.studies.results_of([wildcards.case]), self.studies.file(wildcards.case)]

    def smaller(self, name: str) -> list[str]:
        """Results of the benchmarks of the same code and problem with fewer cells, in order."""
        cases = {case.name: case for case in self.benchmarks().cases()}
        this = cases[name]
        return [
            f"results/benchmarks/cases/{other.name}.json"
            for other in cases.values()
            if (other.problem, other.code) == (this.problem, this.code) and other.across < this.across
        ]

    def options(self, wildcards: Wildcards) -> str:
        """Options of the command that measures a case: the benchmarks whose costs foretell its own."""
        smaller = self.smaller(wildcards.case) if wildcards.target == "benchmarks" else []
        return f"--input earlier {' '.join(smaller)}" if smaller else ""

    def threads(self, wildcards: Wildcards) -> int:
        """Threads of a case; 64 takes all there are."""
        return 64 if wildcards.target == "benchmarks" else 1

    def settings(self, target: str) -> str:
        """Settings that all cases of a target depend on, as text."""
        if target == "benchmarks":
            return json.dumps(asdict(self.benchmarks()), sort_keys=True)
        return self.studies.default_text
