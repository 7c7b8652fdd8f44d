"""DXF drawings (R12, text) of triangles and points: 3DFACE and POINT on layers, as mine planning programs read them.

ezdxf writes six decimals of each coordinate, however far from the origin a mine is.
"""

import os
from collections.abc import Iterable, Mapping
from typing import TextIO

from ezdxf.addons import r12writer
from numpy.typing import NDArray

from common.datasets import atomic_path

UNIT_CODES = {"m": 6, "ft": 2, "us_ft": 21}  # $INSUNITS, by the unit of the mine's grid


def write_faces(vertices: NDArray, layers: Mapping[str, NDArray], unit: str, path: str | os.PathLike) -> None:
    """Write triangles as 3DFACE atomically.

    vertices (vertex, 3) in the unit, one of UNIT_CODES; layers: triangles (triangle, 3), rows of vertices, by layer.
    """
    with atomic_path(path) as temporary, temporary.open("w", encoding="cp1252", newline="\n") as file:
        _write_header(file, unit)
        with r12writer(file) as drawing:
            for layer, triangles in layers.items():
                for corners in vertices[triangles].tolist():
                    drawing.add_3dface(corners, layer=layer)


def write_points(points: NDArray, layers: Iterable[str], unit: str, path: str | os.PathLike) -> None:
    """Write points (point, 3), in the unit, each on a layer (point,), as POINT atomically."""
    with atomic_path(path) as temporary, temporary.open("w", encoding="cp1252", newline="\n") as file:
        _write_header(file, unit)
        with r12writer(file) as drawing:
            for place, layer in zip(points.tolist(), layers, strict=True):
                drawing.add_point(place, layer=layer)


def _write_header(file: TextIO, unit: str) -> None:
    """Write the section that says in which unit the drawing is; ezdxf's writer of R12 writes none."""
    tags = [(0, "SECTION"), (2, "HEADER"), (9, "$ACADVER"), (1, "AC1009"), (9, "$INSUNITS"), (70, UNIT_CODES[unit])]
    for code, value in [*tags, (0, "ENDSEC")]:
        file.write(f"{code:3d}\n{value}\n")
