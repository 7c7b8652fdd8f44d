"""The slice of the configuration that each stage depends on, and whether its result still matches its inputs."""

import functools
import os
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from snakemake.io import unpack
from snakemake.iocontainers import Wildcards

from common.provenance import config_hash, files_of, identity, read_made_from
from workflow.result_files import ResultFiles
from workflow.slice_files import SliceFiles

if TYPE_CHECKING:
    from snakemake.workflow import Workflow  # which cannot be imported before snakemake.api

Paths = str | list[str]


class StageInputs:
    """Slices and inputs of the stages, for the rules."""

    def __init__(self, files: ResultFiles, workflow: "Workflow"):
        self.files = files
        self.workflow = workflow
        # Written by `onstart`, which processes that run a job of another one's plan do not call.
        self.slices = SliceFiles(at_once=not workflow.is_main_process)
        self.sliced = functools.cache(self._sliced)

    def _sliced(self, folder: str, stage: str) -> tuple[str, str, tuple[Path, ...]]:
        """Of the slice that a stage of results/<folder> depends on: its file, its hash and the files that it names.

        stage: by its result's name without ending. A stage without settings has no file.
        """
        settings = self.workflow.execution_settings
        if settings and settings.no_hooks and not self.workflow.dryrun:
            self.slices.begin()
        values = self.files.folders.mine_at(folder).slice_of(stage)
        file = self.slices.name(folder, stage, values) if values else ""
        return file, config_hash(values), tuple(files_of(values))

    def slice_of(self, stage: str) -> Callable[[Wildcards], str]:
        """Parameter of a rule: the file of the slice that its stage depends on."""
        return lambda wildcards: self.sliced(getattr(wildcards, "mine", self.files.mine.name), stage)[0]

    def step_slice(self, wildcards: Wildcards) -> str:
        """The same of the configuration up to this step."""
        return self.sliced(wildcards.mine, f"steps/{self.files.step_of(wildcards)}")[0]

    def event_slice(self, wildcards: Wildcards) -> str:
        """The same of what the events of a step depend on, its dates included."""
        return self.sliced(wildcards.mine, f"events/{self.files.step_of(wildcards)}")[0]

    def inputs_of(self, command: str, stage: str, result: str = "", **files: Paths | Callable[[Wildcards], Paths]):
        """Inputs of the stage that makes results/{mine}/<result>, or <stage>.nc.

        files: names, or functions of wildcards. Where that result stands, but says that it was made from another
        configuration, other sources or other inputs than these, it is made again (common.provenance). Snakemake
        compares times and its own notes: it drops the notes of a job that fails, and gives the earlier result that it
        puts back a new time, so that it would take it as current.
        """

        def inputs(wildcards: Wildcards) -> dict[str, Paths]:
            found = {name: _filled(given, wildcards) for name, given in files.items()}
            made = stage.format(**wildcards)
            output = f"results/{wildcards.mine}/{result or f'{made}.nc'}"
            paths = [path for one in found.values() for path in ([one] if isinstance(one, str) else one)]
            if all(map(os.path.exists, [output, *paths])):
                results = [path for path in paths if path.endswith(".nc")]
                if read_made_from(output) != identity(*self.sliced(wildcards.mine, made)[1:], command, results):
                    self.workflow.dag.forcefiles.add(output)
            return found

        return unpack(inputs)


def _filled(given: Paths | Callable[[Wildcards], Paths], wildcards: Wildcards) -> Paths:
    """What a function gives, a name with the wildcards filled in, or a list as it is."""
    if callable(given):
        return given(wildcards)
    return given.format(**wildcards) if isinstance(given, str) else given
