"""Results of an earlier plan in the mine's folder: of a step, a member or a record that was removed from the plan.

They are not deleted. If the step, member or record returns to the plan, they are used again where they match its
settings (common.provenance).
"""

from collections.abc import Iterable
from pathlib import Path

VTK = "vtk"  # folder of what was made for ParaView: vtk/steps/2019-08.vtu of steps/2019-08.nc
BY_ITSELF = ("solids",)  # vtk/solids.vtm and its folder are of no result
KINDS = (".nc", ".csv", ".xml", ".html", ".vtu")
MAX_NAMED = 6


def leftovers(folder: Path, planned: Iterable[str]) -> list[str]:
    """Results below `folder` that no stage of the plan makes, relative to it, in order.

    planned: paths of the plan's results, relative to the working directory as `folder` is.
    """
    wanted = {Path(path).relative_to(folder).as_posix() for path in planned if Path(path).is_relative_to(folder)}
    stages = {path.removesuffix(".nc") for path in wanted if path.endswith(".nc")}

    def is_wanted(path: Path) -> bool:
        if VTK in path.parts:
            place = path.parts.index(VTK)
            of_stage = Path(*path.parts[:place], *path.parts[place + 1 :]).with_suffix("").as_posix()
            return path.parts[place + 1] in BY_ITSELF or of_stage in stages
        return path.as_posix() in wanted

    found = sorted(path.relative_to(folder) for path in folder.rglob("*") if path.suffix in KINDS and path.is_file())
    return [path.as_posix() for path in found if not is_wanted(path)]


def message(folder: Path, left: list[str]) -> str:
    """The line that a user reads."""
    more = f" and {len(left) - MAX_NAMED} more" if len(left) > MAX_NAMED else ""
    named = ", ".join(left[:MAX_NAMED])
    return f"{folder}: not part of the mine file's plan any more, and left as they are: {named}{more}"
