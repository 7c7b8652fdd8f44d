"""Inputs of the rules: the file of each job, and the results that the job reads."""

import functools
import sys
from collections.abc import Callable

from snakemake.iocontainers import Wildcards

from common.errors import InputError
from common.job import write_job
from workflow.folders import Folders
from workflow.stages import stages

Paths = str | list[str]
Given = Paths | Callable[[Wildcards], Paths]


class RuleInputs:
    """Inputs of the rules of any mine."""

    def __init__(self, folders: Folders):
        self.folders = folders
        self.own = folders.mine.name

    def of(
        self,
        stage: str,
        part: str = "",
        settings: Callable[[Wildcards], dict] | None = None,
        **reads: Given,
    ) -> dict[str, Given]:
        """Inputs of the rule of a stage: `job`, the file that says all that the stage depends on, and what it reads.

        part: of a stage with several jobs in a folder, by wildcards ("{step}"). settings: those of a stage that
        declares none itself. reads: paths, or functions of wildcards, by name; an empty list: the scene has none.
        The job's file stands in the folder of the wildcard `mine`, else in that of the run's own mine.
        """

        @functools.cache
        def written(wildcards: tuple[tuple[str, str], ...], inputs: tuple[tuple[str, tuple[str, ...]], ...]) -> str:
            known = dict(wildcards)
            folder = known.get("mine", self.own)
            declared = stages()[stage]
            if settings is not None:
                values = settings(Wildcards(fromdict=known))
            else:
                assert declared.settings_of is not None, f"the rule of {stage} gives its settings"
                values = declared.settings_of(self.folders.mine_at(folder), known)
            paths = {name: list(found) for name, found in inputs if found}
            try:
                code = declared.source_hash()
                return write_job(f"results/{folder}", stage, part.format(**known), values, paths, code)
            except InputError as error:
                sys.exit(str(error))

        def job(wildcards: Wildcards) -> str:
            found = ((name, tuple(_as_list(_filled(given, wildcards)))) for name, given in reads.items())
            return written(tuple(sorted(wildcards.items())), tuple(found))

        return {"job": job, **reads}


def _as_list(paths: Paths) -> list[str]:
    return [paths] if isinstance(paths, str) else list(paths)


def _filled(given: Given, wildcards: Wildcards) -> Paths:
    """Paths of an input: a function's result for the wildcards, a name with wildcards filled in, or a list as it is."""
    if callable(given):
        return given(wildcards)
    return given.format(**wildcards) if isinstance(given, str) else given
