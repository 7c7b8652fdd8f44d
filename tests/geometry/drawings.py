"""Drawings (DXF) that tests make, and solids of mine files that name them."""

import ezdxf
import numpy as np

from mpm_core.geometry import Solid, build_shape
from mpm_core.grid.domain import Domain
from mpm_core.stages.grid_stage import read_solids

BOX = build_shape({"name": "b", "shape": "box", "lower": [0, 0, 0], "upper": [8, 4, 2]}, 3)
OTHER = Solid("o", BOX.vertices * 2 + [100, 0, 0], BOX.facets)
DOMAIN = Domain(np.zeros(3), np.array([10, 10, 10]), 20.0, 3)


def drawing(path, add, units=None, version="R2018"):
    """A DXF whose model space `add` fills."""
    document = ezdxf.new(version)
    if units is not None:
        document.header["$INSUNITS"] = units
    add(document, document.modelspace())
    document.saveas(path)
    return path


def solid_of(entry: dict) -> Solid:
    """By the way of a configuration."""
    return read_solids([{"name": "stope", **entry}], "excavations", DOMAIN)[0]


def add_box(document, space):
    for facet in BOX.facets:
        space.add_3dface(BOX.vertices[facet])


def square(x, y, width, height=None):
    return [(x, y), (x + width, y), (x + width, y + (height or width)), (x, y + (height or width))]
