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
    note, own = NOTES / name, Path(mine_file).resolve()
    if not note.is_file() or not Path("results", name).is_dir():
        return
    made_from, *named = note.read_text(encoding="utf-8").splitlines()
    other = Path(made_from)
    if other == own or not other.is_file() or other.read_bytes() == own.read_bytes():
        return
    try:
        claims = bool(named) or read_yaml(other).get("name") == name
    except InputError:
        return
    if claims:
        also = "with that name by --config" if named else "which has this name, too"
        raise InputError(
            f"{os.path.relpath(own)}: name: results/{name} was made from {other}, {also}; give one of them another "
            f"name, or move results/{name} away"
        )


def note_owner(name: str, mine_file: Path, is_overridden: bool = False) -> None:
    """Remember the file that results/<name> is made from; is_overridden: the name is of --config, not the file's."""
    NOTES.mkdir(parents=True, exist_ok=True)
    text = str(Path(mine_file).resolve()) + ("\nname of --config" if is_overridden else "")
    (NOTES / name).write_text(text, encoding="utf-8")
