"""Checks of `loading_measures`: steps to measure, and planes in rock of the model."""

import difflib

import numpy as np

from common.errors import InputError, Mistakes
from mpm_core.constitutive.laws import plane_normals
from response.loading_settings import ShearPlane
from workflow.mine import Mine


def check_loading(mine: Mine, mistakes: Mistakes) -> None:
    """There are steps, and each plane is that of a rock with weak planes or has its point in rock of the model."""
    settings = mine.settings.loading_measures
    if settings is None:
        return
    if not mine.mined_steps:
        raise InputError("loading_measures: no step is listed, and measures are those of steps; give steps")
    for number, plane in enumerate(settings.planes):
        with mistakes.gather():
            where = f"loading_measures.planes[{number}]"
            if plane.material is not None:
                _check_material(mine, where, plane.material)
            else:
                _check_place(mine, where, plane)


def _check_material(mine: Mine, where: str, name: str) -> None:
    """The material has weak planes, and some rock is of it."""
    materials = mine.settings.materials
    if name not in materials:
        near = difflib.get_close_matches(name, materials, n=1)
        meant = f"did you mean {near[0]}?" if near else f"there are {', '.join(materials)}"
        raise InputError(f"{where}.material: no material {name!r}; {meant}")
    if name not in plane_normals({name: materials[name]}):
        raise InputError(f"{where}.material: {name} has no planes; name one with model: weak_planes, or give a point")
    if name not in {"host", *mine.body_materials()}:
        raise InputError(f"{where}.material: no rock body is of {name}, nor the host; give a point, strike and dip")


def _check_place(mine: Mine, where: str, plane: ShearPlane) -> None:
    """The point is within the domain, in rock that the first step leaves."""
    from mpm_core.geometry.inside import contains
    from mpm_core.scene.scene_solids import read_entry

    if mine.plane:
        raise InputError(
            f"{where}: a plane by point, strike and dip needs a mine in three dimensions, plane: none, not {mine.plane}"
        )
    domain, point = mine.settings.domain, np.array(plane.point)
    text = f"the point ({', '.join(f'{value:.10g}' for value in plane.point)}) m"
    if not ((point >= domain.lower) & (point <= domain.upper)).all():
        raise InputError(f"{where}.point: {text} is outside the domain; enlarge domain, or correct it")
    if plane.radius is not None:
        return  # the rest of the plane may lie in rock
    for entry in mine.excavations:
        first = mine.step_index(entry.step) == 0
        if first and contains(read_entry(mine.placed(entry), 3, "excavations"), point[None])[0]:
            raise InputError(f"{where}.point: {text} is inside {entry.name}; put it into rock, or give a radius")
