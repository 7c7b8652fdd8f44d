"""Check of the command line before Snakemake reads it: Snakemake ends in tracebacks for what is refused here.

Snakemake's own reader of --config turns all numbers in a section, `solver={increments: 2}`, into text. Here they are
read as in a mine file.
"""

import argparse
import re
import tempfile
from collections.abc import Sequence
from pathlib import Path

from common.disk import NO_ROOM, disk_full
from common.errors import InputError
from common.setting_types import short
from workflow.strict_yaml import check_files, read_text

OPTION = re.compile(r"(--config|-C)(=|$)")
KEY = re.compile(r"[a-zA-Z_][\w-]*\w")  # of Snakemake; no key of a mine's file is another
WORD = re.compile(r"[\w-]+")
ROOM = 1 << 16  # Bytes that a run needs at least: its log, its notes and the files of its jobs.
ELSEWHERE = "start in another folder, or name one with --directory"
targets: list[str] = []
"""What Snakemake was asked for: `check_command_line` notes it, since Snakemake tells a Snakefile nothing of it."""
cores: int = 0
"""Cores that it was given; 0 for all there are."""


def check_command_line(arguments: argparse.Namespace, words: Sequence[str]) -> None:
    """Check Snakemake's arguments and the words that they were made from, and note the targets. Raises InputError."""
    global cores
    targets[:] = arguments.targets
    cores = int(arguments.cores) if str(arguments.cores).isdigit() else 0
    check_files(arguments.configfile)
    if sum(bool(OPTION.match(word)) for word in words) > 1:
        raise InputError(
            "--config stands twice, and Snakemake uses the last one alone; put all keys behind one: "
            "--config accuracy=draft ensemble=8"
        )
    read_overrides(arguments.config)
    check_folder(arguments.directory or ".")
    check_cache()


def draws_alone() -> bool:
    """True if Snakemake was asked for nothing but pictures of the scene."""
    return bool(targets) and all(target == "scene" or target.endswith("/scene.png") for target in targets)


def read_overrides(entries: Sequence[str] | None) -> dict:
    """Keys and values that --config sets, from entries key=value, values as in a mine's file.

    Raises InputError, which shows how to write it, for an entry that is malformed or whose key stands twice.
    """
    overrides = {}
    for entry in entries or ():
        key, equals, value = entry.partition("=")
        if not equals:
            raise InputError(
                f"--config {entry[:80]}: no key=value. --config takes all words up to the next option, so a target "
                f"stands before it: snakemake --cores all {entry[:80]} --config accuracy=draft"
            )
        if key in overrides:
            raise InputError(f"--config {entry[:80]}: {key} stands twice; the second would replace the first")
        if not KEY.fullmatch(key):
            raise InputError(f"--config {entry[:80]}: {_right_way(key, value)}")
        overrides[key] = read_text(f"--config {key}", value)
    return overrides


def _right_way(key: str, value: str) -> str:
    """The right form of a key that Snakemake does not accept."""
    section, *parts = key.split(".")
    if any(part.isdigit() for part in parts):
        return (
            f"entries of a list are changed in the mine's file, or the whole list is given: --config '{section}=[...]'"
        )
    if not parts or not all(WORD.fullmatch(part) for part in (section, *parts)):
        return f"{short(key)} is no key of a mine's file; config/README.md has them"
    inner = value or "null"
    for part in reversed(parts):
        inner = f"{{{part}: {inner}}}"
    return f"keys below a section are written in braces: --config '{section}={inner}'"


def check_folder(folder: str | Path) -> None:
    """Raise InputError for a working directory that cannot be written, or whose name Snakemake takes for a pattern.

    Snakemake keeps its notes and results in it.
    """
    folder = Path(folder).absolute()
    if "{" in str(folder):  # where it looks for its locks
        raise InputError(f"{folder}: Snakemake takes braces in the name of a folder for a wildcard; {ELSEWHERE}")
    _probe(folder / ".snakemake", folder, f"notes and results go there; {ELSEWHERE}")


def check_cache() -> None:
    """Raise InputError where Snakemake's cache, which is in the user's home by default, cannot be written."""
    from snakemake.common import get_appdirs

    cache = Path(get_appdirs().user_cache_dir)
    remedy = "name another folder in front of the command, XDG_CACHE_HOME=<folder>"
    _probe(cache, cache, f"Snakemake keeps its cache there; {remedy}")


def _probe(place: Path, shown: Path, purpose: str) -> None:
    """Write a file in a folder and delete it. Raises InputError, which names the folder `shown` and its purpose."""
    try:
        place.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=place) as probe:
            probe.write(bytes(ROOM))
    except OSError as error:
        if error.errno in NO_ROOM:
            raise InputError(disk_full(error.strerror or "", shown)) from error
        raise InputError(f"{shown}: cannot be written ({error.strerror}), and {purpose}") from error
