"""The mine file that a folder results/<name> belongs to.

Two mine files of one name in one folder would replace each other's results, so the second one is refused.
"""

import os
from pathlib import Path

from common.errors import InputError
from workflow.strict_yaml import read_yaml

NOTES = Path(".snakemake/mine_files")  # next to Snakemake's own notes of what results were made from


def check_owner(name: str, mine_file: Path) -> None:
    """Raise InputError if results/<name> was made from another file, which is still there and has this name, too, in
    itself or by --config.

    The results of a file that was moved, renamed or copied as it is belong to the new one.
    """
    noted, own = _noted(name), Path(mine_file).resolve()
    if not noted or not Path("results", name).is_dir():
        return
    made_from, *named = noted
    other = Path(made_from)
    try:
        if other.resolve() == own or not other.is_file() or other.read_bytes() == own.read_bytes():
            return
        claims = bool(named) or read_yaml(other).get("name") == name
    except (InputError, OSError, ValueError):  # a note that names no file that can be read says nothing
        return
    if claims:
        also = "with that name by --config" if named else "which has this name, too"
        raise InputError(
            f"{os.path.relpath(own)}: name: results/{name} was made from {other}, {also}; give one of them another "
            f"name, or move results/{name} away"
        )


def note_owner(name: str, mine_file: Path, is_overridden: bool = False) -> None:
    """Remember the file that results/<name> is made from; is_overridden: the name is of --config, not the file's.

    Raises InputError if the disk is full.
    """
    from common.datasets import atomic_path  # here: a dry run need not wait for xarray

    path, folder = Path(mine_file).resolve(), Path.cwd().resolve()
    # relative below this folder: a copy of it is a project of its own
    text = str(path.relative_to(folder) if path.is_relative_to(folder) else path) + (
        "\nname of --config" if is_overridden else ""
    )
    with atomic_path(NOTES / name) as temporary:
        temporary.write_text(text, encoding="utf-8", errors="surrogateescape")


def _noted(name: str) -> list[str]:
    """Lines of the note on results/<name>; none without one, and of one that a full disk has left empty."""
    try:
        return (NOTES / name).read_text(encoding="utf-8", errors="surrogateescape").splitlines()
    except OSError:
        return []
