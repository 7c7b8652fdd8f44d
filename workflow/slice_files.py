"""Slices of the configuration as files: what a stage's result depends on, and nothing else.

A command line holds 128 KiB, some 500 excavations; a file holds any mine. A slice's name ends in a hash of its content,
so that a rule which has the name as a parameter depends on the content. One file per stage: an earlier one is removed.
"""

import json
from pathlib import Path

from common.datasets import atomic_path
from common.errors import InputError
from common.slices import content_hash

FOLDER = "slices"  # below results/<mine>


class SliceFiles:
    """Names of slices, and their files once the run has begun: a dry run, a lint or an unlock leaves none."""

    def __init__(self, at_once: bool = False):
        """at_once: write each as it is asked for, in a process that runs jobs which another one has planned."""
        self.at_once = at_once
        self._waiting: dict[Path, str] = {}

    def name(self, place: str, stage: str, values) -> str:
        """Path of the slice `values` (plain, as JSON) of a stage below results/<place>; written now or when begun."""
        text = json.dumps(values, sort_keys=True)
        path = Path("results", place, FOLDER, f"{stage}.{content_hash(text)}.json")
        if self.at_once:
            write(path, text)
        else:
            self._waiting[path] = text
        return path.as_posix()

    def begin(self) -> None:
        """Write all that were asked for, and from now on each as it is asked for. Raises InputError as `write`."""
        self.at_once = True
        while self._waiting:
            write(*self._waiting.popitem())


def write(path: Path, text: str) -> None:
    """Write a slice unless it stands there as it is, whole or not at all, and remove the stage's earlier one.

    Raises InputError where the disk is full or the folder takes no file.
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
