"""A mine's folder results/<name>: which mine file it belongs to, and which results in it are of an earlier plan.

Two mine files of one name in one folder would replace each other's results, so the second one is refused. Results of a
step, a member or a record that was removed from the plan are not deleted. If it returns to the plan, they are used
again where they match its settings (common.provenance).
"""

import os
from collections.abc import Iterable
from pathlib import Path

from common.errors import InputError
from workflow.strict_yaml import read_yaml

NOTES = Path(".snakemake/mine_files")  # next to Snakemake's own notes of what results were made from
VTK = "vtk"  # folder of what was made for ParaView: vtk/steps/2019-08.vtu of steps/2019-08.nc
BY_ITSELF = ("solids",)  # vtk/solids.vtm and its folder are of no result
KINDS = (".nc", ".csv", ".xml", ".html", ".vtu")
MAX_NAMED = 6  # Results of an earlier plan that the line names.


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


def leftovers(folder: Path, planned: Iterable[str]) -> list[str]:
    """Results below `folder` that no stage of the plan makes, relative to it, in order.

    planned: paths of the plan's results, relative to the working directory as `folder` is. One that ends in / is a
    folder, all of which is of the plan.
    """
    ours = [path for path in planned if Path(path).is_relative_to(folder)]
    whole = [Path(path).relative_to(folder) for path in ours if path.endswith("/")]
    planned_paths = {Path(path).relative_to(folder).as_posix() for path in ours}
    stages = {path.removesuffix(".nc") for path in planned_paths if path.endswith(".nc")}

    def is_planned(path: Path) -> bool:
        if any(path.is_relative_to(one) for one in whole):
            return True
        if VTK in path.parts:
            place = path.parts.index(VTK)
            of_stage = Path(*path.parts[:place], *path.parts[place + 1 :]).with_suffix("").as_posix()
            return path.parts[place + 1] in BY_ITSELF or of_stage in stages
        return path.as_posix() in planned_paths

    found = sorted(path.relative_to(folder) for path in folder.rglob("*") if path.suffix in KINDS and path.is_file())
    return [path.as_posix() for path in found if not is_planned(path)]


def leftovers_line(folder: Path, left: list[str]) -> str:
    """The line that names these results to the user."""
    more = f" and {len(left) - MAX_NAMED} more" if len(left) > MAX_NAMED else ""
    named = ", ".join(left[:MAX_NAMED])
    return f"{folder}: not part of the mine file's plan any more, and left as they are: {named}{more}"
