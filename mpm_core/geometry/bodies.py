"""Several bodies of one file by name: layers of a drawing, elements of a project, objects of a mesh."""

from fnmatch import fnmatchcase
from typing import TypeVar

import numpy as np

from common.errors import InputError

ALL_NAMES = "*"  # As element or layer it stands for all of them, which are one solid together.
MAX_NAMES_SHOWN = 20
Part = TypeVar("Part")
Mesh = tuple[np.ndarray, np.ndarray]  # vertices (v, 3), triangles (f, 3)


def choose(parts: dict[str, list[Part]], named: str | None, what: str) -> list[Part]:
    """The parts of the layer or element `named`, "*" standing for any text; of the only one, if none is named.

    Raises InputError otherwise.
    """
    if not parts:
        raise InputError("holds no triangulated surface: export the solid as one")
    if named is None and len(parts) > 1:
        raise InputError(f'has {len(parts)} {what}s: name one by `{what}`, or "{ALL_NAMES}" for all: {_shown(parts)}')
    if named in parts:
        return parts[named]
    found = [part for name, some in parts.items() if named is None or fnmatchcase(name, named) for part in some]
    if not found:
        raise InputError(f"{what} {named!r} is not one of {_shown(parts)}")
    return found


def _shown(names) -> str:
    names = list(names)
    more = f" and {len(names) - MAX_NAMES_SHOWN} more" if len(names) > MAX_NAMES_SHOWN else ""
    return ", ".join(names[:MAX_NAMES_SHOWN]) + more


def join(meshes: list[Mesh]) -> Mesh:
    """Several meshes as one."""
    before = np.cumsum([0] + [len(vertices) for vertices, _ in meshes])
    facets = [facets + start for (_, facets), start in zip(meshes, before, strict=False)]
    return np.concatenate([vertices for vertices, _ in meshes]), np.concatenate(facets)


def triangles(faces: list) -> np.ndarray:
    """Faces of any number of corners, as triangles (f, 3) round their first: cancelling where a face is not convex."""
    fans = [(face[0], face[i], face[i + 1]) for face in faces for i in range(1, len(face) - 1)]
    return np.array(fans, dtype=np.int64).reshape(-1, 3)
