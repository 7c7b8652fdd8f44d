"""The slice of the configuration that each stage depends on, and whether its result still matches its inputs.

A slice is a file, since a command line holds 128 KiB, some 500 excavations; a file holds any mine. Its name ends in a
hash of its content, so that a rule which has the name as a parameter depends on the content. A stage has one such file:
an earlier one is removed.
"""

import functools
import json
import os
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from snakemake.io import unpack
from snakemake.iocontainers import Wildcards

from common.datasets import atomic_path
from common.errors import InputError
from common.provenance import config_hash, files_of, identity, made_from, read_made_from
from common.slices import content_hash
from workflow.result_files import ResultFiles

if TYPE_CHECKING:
    from snakemake.workflow import Workflow  # which cannot be imported before snakemake.api

Paths = str | list[str]
FOLDER = "slices"  # below results/<mine>


class SliceFiles:
    """Names of slices, and their files once the run has begun: a dry run, a lint or an unlock leaves none."""

    def __init__(self, at_once: bool = False):
        """at_once: write each as it is named, in a process that runs jobs which another one has planned."""
        self.at_once = at_once
        self._waiting: dict[Path, str] = {}

    def name(self, place: str, stage: str, values) -> str:
        """Path of the slice `values` (plain, as JSON) of a stage below results/<place>; written now or when begun."""
        text = json.dumps(values, sort_keys=True)
        path = Path("results", place, FOLDER, f"{stage}.{content_hash(text)}.json")
        if self.at_once:
            _write(path, text)
        else:
            self._waiting[path] = text
        return path.as_posix()

    def begin(self) -> None:
        """Write all that were named, and from now on each as it is named. Raises InputError as `_write`."""
        self.at_once = True
        while self._waiting:
            _write(*self._waiting.popitem())


def _write(path: Path, text: str) -> None:
    """Write a slice unless it stands there as it is, whole or not at all, and remove the stage's earlier one.

    Raises InputError where the disk is full or the folder cannot be written.
    """
    if path.exists() and path.read_text(encoding="utf-8", errors="replace") == text:
        return
    try:
        with atomic_path(path) as temporary:
            temporary.write_text(text, encoding="utf-8")
    except OSError as error:
        raise InputError(f"{path}: cannot be written ({error.strerror}); mend its folder, or move it away") from error
    stage = path.name.split(".")[0]
    for earlier in path.parent.glob(f"{stage}.*{path.suffix}"):
        if earlier != path:
            earlier.unlink(missing_ok=True)


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
        values = self.files.folders.mine_at(folder).slice_of(stage)
        file = self._write(folder, stage, values) if values else ""
        return file, config_hash(values), tuple(files_of(values))

    def _write(self, folder: str, stage: str, values: dict) -> str:
        """File of a slice, which is written now or when the run begins."""
        settings = self.workflow.execution_settings
        if settings and settings.no_hooks and not self.workflow.dryrun:
            self.slices.begin()
        return self.slices.name(folder, stage, values)

    def named_slice(
        self, folder: str, stage: Callable[[Wildcards], str], values: Callable[[Wildcards], dict]
    ) -> Callable[[Wildcards], str]:
        """Parameter of a rule whose stage is none of every mine: the file of a slice of these values."""
        written = functools.cache(lambda name, wildcards: self._write(folder, name, values(wildcards)))
        return lambda wildcards: written(stage(wildcards), wildcards)

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
        puts back a new time, so that it would use it as current.
        """

        def inputs(wildcards: Wildcards) -> dict[str, Paths]:
            found = {name: _filled(given, wildcards) for name, given in files.items()}
            made = stage.format(**wildcards)
            output = f"results/{wildcards.mine}/{result or f'{made}.nc'}"
            paths = [path for one in found.values() for path in _as_list(one)]
            if all(map(os.path.exists, [output, *paths])):
                results = [path for path in paths if path.endswith(".nc")]
                if read_made_from(output) != identity(*self.sliced(wildcards.mine, made)[1:], command, results):
                    self.workflow.dag.forcefiles.add(output)
            return found

        return unpack(inputs)

    def named_inputs(
        self,
        command: str,
        output: str,
        values: Callable[[Wildcards], dict],
        unread: tuple[str, ...] = (),
        **files: Paths | Callable[[Wildcards], Paths],
    ):
        """Inputs of a rule whose stage is none of every mine; `values`: its slice, `unread`: files that it does not
        read.

        The output is made again as in inputs_of. Snakemake keeps no note of a job on a cluster that ended while
        Snakemake was not running, and would use its result with any values.
        """

        def inputs(wildcards: Wildcards) -> dict[str, Paths]:
            found = {name: _filled(given, wildcards) for name, given in files.items()}
            path = output.format(**wildcards)
            results = [one for name, given in found.items() if name not in unread for one in _as_list(given)]
            if all(map(os.path.exists, [path, *results])):
                if read_made_from(path) != made_from(values(wildcards), command, results):
                    self.workflow.dag.forcefiles.add(path)
            return found

        return unpack(inputs)


def _as_list(paths: Paths) -> list[str]:
    return [paths] if isinstance(paths, str) else list(paths)


def _filled(given: Paths | Callable[[Wildcards], Paths], wildcards: Wildcards) -> Paths:
    """What a function gives, a name with the wildcards filled in, or a list as it is."""
    if callable(given):
        return given(wildcards)
    # One without a wildcard as it is: a text that is made from it is no longer marked as ancient.
    return given.format(**wildcards) if isinstance(given, str) and "{" in given else given
