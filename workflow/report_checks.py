"""Checks of what the report is asked to show."""

import difflib

import numpy as np

from catalogs.sources.section_planes import Plane
from common.errors import InputError, Mistakes
from workflow.mine import Mine


def check_sections(mine: Mine, mistakes: Mistakes) -> None:
    """Check that planes cut the domain and that the excavations which they follow are there."""
    domain = mine.settings.domain
    for number, section in enumerate(mine.settings.report.sections):
        where = f"report.sections[{number}]"
        if mine.plane:
            mistakes.add(f"{where}: a scene with plane: {mine.plane} is a section itself; leave it out")
        elif section.excavation is not None:
            names = [entry.name for entry in mine.excavations]
            if section.excavation not in names:
                near = difflib.get_close_matches(section.excavation, names, n=1)
                meant = f"did you mean {near[0]}?" if near else f"there are {', '.join(names[:5]) or 'none'}"
                mistakes.add(f"{where}.excavation: no excavation {section.excavation!r}; {meant}")
        elif domain.lower is not None and domain.upper is not None:
            plane = Plane.of(section.point, section.strike, section.dip)
            apart = plane.misses(np.array(domain.lower), np.array(domain.upper))
            if apart > 0.0:
                with mistakes.gather():
                    raise InputError(
                        f"{where}.point: the plane passes the domain at a distance of {apart:.3g} m; give a point, "
                        "strike and dip of a plane through the mine"
                    )
