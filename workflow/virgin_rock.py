"""Virgin rock that would fail before anything is mined: each rock by its own strength, where it is.

The stresses that a law admits are convex, and stress is linear in depth: a rock between two elevations fails at one
of them if it fails at all.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Self

import numpy as np

from common.errors import InputError
from mpm_core.geometry.shapes import solid_of
from mpm_core.geometry.solids import Outside, Solid
from mpm_core.scene.scene import InsituStress, virgin_excess
from mpm_core.scene.scene_solids import bodies_at
from workflow.mine import Mine
from workflow.shapes import check_form

MAX_LAYERS = 32  # of points along each axis, at which the rock of a domain is looked up
INSET = 1e-6  # Share of the domain by which the outermost points lie within it: a rock body may end at its faces.


def insitu_stress(mine: Mine) -> InsituStress:
    """The virgin stress of a mine."""
    stress = mine.settings.insitu_stress
    constant, gradient = (np.array(stress.voigt(name)) for name in ("constant", "gradient"))
    return InsituStress(constant, gradient, mine.settings.frame.surface)


@dataclass(frozen=True)
class Rocks:
    """Host rock and rock bodies that have a shape. Bodies of a file are left out.

    bodies: their solids, in order. names: material of the host, then of each body.
    """

    names: np.ndarray
    bodies: list[Solid | Outside]

    @classmethod
    def of(cls, mine: Mine) -> Self:
        """Rocks of a mine whose rock bodies have been checked."""
        names, solids = ["host"], list[Solid | Outside]()
        for body in mine.settings.rock_bodies:
            shape = check_form(mine, f"rock_bodies.{body.name}", body)
            if shape is not None:
                solid = solid_of(shape, mine.dimension, f"rock_bodies.{body.name}")
                solids.append(Outside(solid, *solid.bounds) if body.outside else solid)
                names.append(body.material)
        return cls(np.array(names), solids)

    def at(self, points: np.ndarray) -> np.ndarray:
        """Name of the material at each point (k, d)."""
        return self.names[1 + bodies_at(self.bodies, points)]


def overstress(mine: Mine, rocks: Iterable[str], elevation: float) -> tuple[float, str]:
    """Largest excess of virgin stress over intact strength (Pa) at an elevation (m), and the rock that has it.

    0 or less if all of these rocks bear their stress.
    """
    insitu, materials = insitu_stress(mine), mine.settings.materials
    return max((virgin_excess(materials[rock], insitu, elevation), rock) for rock in rocks)


def check_virgin_stress(mine: Mine) -> None:
    """Raise InputError if virgin rock of the domain stands above its intact strength, first the host's.

    Where rock comes from a file, the elastic history checks that, particle by particle, as it does in any case.
    """
    settings, is_plan = mine.settings, mine.plane == "xy"
    if settings.block_model or any(body.file is not None for body in settings.rock_bodies):
        return
    lower, upper = (np.array(corner) for corner in (settings.domain.lower, settings.domain.upper))
    count = np.minimum(np.rint((upper - lower) / settings.grid.coarse_cell).astype(int) + 1, MAX_LAYERS)
    share = np.meshgrid(*(np.linspace(INSET, 1.0 - INSET, number) for number in count), indexing="ij")
    points = lower + np.stack([part.ravel() for part in share], axis=-1) * (upper - lower)
    rock, elevation = Rocks.of(mine).at(points), points[:, -1]
    first, last = elevation.min(), elevation.max()
    for name in ["host", *(body.material for body in settings.rock_bodies)]:
        own = elevation[rock == name]
        if not len(own):
            continue
        lowest = lower[-1] if own.min() == first else own.min()
        highest = upper[-1] if own.max() == last else own.max()
        for place in [settings.frame.surface] if is_plan else [lowest, highest]:
            excess, _ = overstress(mine, [name], place)
            if excess > 0.0:
                ends = {lower[-1]: " (domain.lower)", upper[-1]: " (domain.upper)"}
                raise InputError(
                    f"insitu_stress: at elevation {place:.7g} m{'' if is_plan else ends.get(place, '')} virgin stress "
                    f"is {excess / 1e6:.3g} MPa above the intact strength of materials.{name}: it would fail before "
                    "anything is mined; check stress, depth and strength"
                )
