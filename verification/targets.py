"""Which files the rules of the studies read, and the mines that studies add to those of a run."""

import functools
import json
import os
import sys
from pathlib import Path

from common.sources import source_hash
from snakemake.iocontainers import Wildcards

from common.errors import InputError
from verification.studies import Study, load_study
from workflow.folders import NAME
from workflow.mine import Mine
from workflow.result_files import stage_results


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

    def verified(self) -> list[str]:
        """Names of the studies that the target `verification` runs."""
        return [name for name in self.named("") if not self.read(name).on_request]

    def verified_files(self, wildcards: Wildcards) -> list[str]:
        """The files of these studies."""
        return [self.file(name) for name in self.verified()]

    def answers(self, wildcards: Wildcards) -> list[str]:
        """Rows and figures of these studies."""
        return [
            f"results/verification/{name}/{file}" for name in self.verified() for file in ("rows.csv", "figure.svg")
        ]

    def answer_sources(self, wildcards: Wildcards) -> str:
        """Hash of the sources of a study's answer: the stage, and the module that the study names."""
        return source_hash("verification answer", f"verification.answers.{self.read(wildcards.study).answer}")

    def results(self, wildcards: Wildcards) -> list[str]:
        """Results of all stages of all variants of a study."""
        return self.results_of([wildcards.study])

    def results_of(self, names: list[str]) -> list[str]:
        """Results of all stages of several studies, members of their ensembles included."""
        files = []
        for name in names:
            study = self.read(name)
            folders = ("steps", "events") if study.events else ("steps",)
            for key, mine in study.mines.items():
                files += stage_results(f"verification/{name}/{key}", mine, folders)
        return files
