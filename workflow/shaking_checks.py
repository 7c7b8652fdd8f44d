"""Checks of the sections `ground_motion` and `support` that their models cannot express."""

from typing import Any

from common.errors import InputError, Mistakes
from shaking.settings import FittedRelation
from workflow.mine import Mine


def check_ground_motion(mine: Mine, mistakes: Mistakes) -> None:
    """Gather mistakes: a plane-strain mine, no dated step, no file of velocities, support without a demand."""
    motion, support = mine.settings.ground_motion, mine.settings.support
    if motion is None:
        if support:
            raise InputError("support: there is no demand to compare it with; give ground_motion, or leave it out")
        return
    if mine.plane:
        raise InputError(
            f"ground_motion: sources of a scene with plane: {mine.plane} are as long as its thickness, and a velocity "
            "at a distance does not follow from them; leave it out"
        )
    if not mine.dated_steps:
        raise InputError("ground_motion: no step has dates, and chances are those in a step; give steps start and end")
    relation: Any = motion.relation
    if isinstance(relation, FittedRelation):
        path = mine.path(relation.file)
        if not path.is_file():
            mistakes.add(f"ground_motion.relation.file: {path}: no such file")
    if support and motion.displacement is None:
        mistakes.add("support: there is no demand to compare it with; give ground_motion.displacement")
    seen: set[str] = set()
    for number, one in enumerate(support):
        if one.name in seen:
            mistakes.add(f"support[{number}].name: {one.name} stands twice; classes need names of their own")
        seen.add(one.name)
        if motion.displacement is not None and one.displacement > motion.displacement * (1.0 + 1e-9):
            mistakes.add(
                f"support[{number}].displacement: {one.displacement:g} mm is more than ground_motion.displacement "
                f"allows ({motion.displacement:g} mm); state the energy that {one.name} absorbs up to that"
            )
