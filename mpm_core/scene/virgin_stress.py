"""Virgin stress and body force of a scene, in the computation's axes."""

from dataclasses import replace

import numpy as np

from mpm_core.scene.scene import Scene


def virgin_stress(scene: Scene, position: np.ndarray) -> np.ndarray:
    """Virgin stress (n, 6) Pa in the computation's axes at positions (n, d)."""
    axes, insitu = list(scene.axes), scene.insitu
    elevation = position[:, axes.index(2)] if 2 in axes else np.full(len(position), insitu.surface)
    own = replace(insitu, constant=insitu.constant[scene.voigt], gradient=insitu.gradient[scene.voigt])
    return own.at(elevation)


def virgin_body_force(scene: Scene) -> np.ndarray:
    """b = -div sigma0 (d,) N/m3 in the computation's axes; a plan section ("xy") is uniform and weightless."""
    axes = list(scene.axes)
    return scene.insitu.body_force[axes] if 2 in axes else np.zeros(len(axes))
