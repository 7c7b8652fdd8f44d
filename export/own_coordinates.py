"""Places, vectors and tensors in the mine's own coordinates, as its files have them."""

import os
from dataclasses import dataclass

import meshio
import numpy as np
from numpy.typing import NDArray

from common.frame import Frame, grid_of
from common.mine_grid import SAME_AS_MAP, GridMap
from common.voigt import tensor_from_voigt, voigt_from_tensor
from common.vtk import TENSOR_ORDER, write_mesh

MIRRORED = {  # order of a cell's corners that keeps its volume positive where space is mirrored, by meshio's name
    "hexahedron": [4, 5, 6, 7, 0, 1, 2, 3],
    "quad": [0, 3, 2, 1],
}


@dataclass(frozen=True)
class OwnCoordinates:
    """The mine's grid; the map where it has none."""

    grid: GridMap

    @classmethod
    def of(cls, frame: dict) -> "OwnCoordinates":
        """Those of the settings of a frame."""
        return cls(grid_of(Frame.of(frame, "frame")))

    @property
    def unit(self) -> str:
        """Unit of the coordinates: m, ft or us_ft."""
        return self.grid.units

    @property
    def is_map(self) -> bool:
        """True if the mine's coordinates are those of the map in m."""
        return self.grid == SAME_AS_MAP

    def points(self, points: NDArray) -> NDArray:
        """Coordinates (..., 3) in the unit, of places on the map (..., 3) m."""
        return self.grid.to_grid(points) / self.grid.metres_per_unit

    def triangles(self, triangles: NDArray) -> NDArray:
        """Triangles (triangle, 3) that look outward on the map, so that they do in these coordinates."""
        return triangles[:, ::-1] if self.grid.is_mirrored else triangles

    def vectors(self, vectors: NDArray) -> NDArray:
        """Components (..., 3) along the axes of the grid, of vectors (..., 3) east, north, up."""
        return vectors @ self.grid.turn

    def tensors(self, tensors: NDArray) -> NDArray:
        """Components (..., 6) along the axes of the grid (Voigt order, tensor shear), of tensors (..., 6)."""
        return voigt_from_tensor(self.grid.turn.T @ tensor_from_voigt(tensors) @ self.grid.turn)

    def cubic_metres(self, volume: float) -> float:
        """Volume m3 on the map of one in these coordinates."""
        return volume * self.grid.metres_per_unit**3 * self.grid.scale**2

    def convert_vtu(self, path: str | os.PathLike) -> None:
        """Replace a VTU file in coordinates of the map by one in these: places in the unit, vectors and tensors along
        the axes of the grid, displacement in m."""
        if self.is_map:
            return
        mesh = meshio.read(path)
        (block,) = mesh.cells
        back = np.argsort(TENSOR_ORDER)

        def turned(values: NDArray) -> NDArray:
            if values.ndim == 2 and values.shape[1] == 6:
                return self.tensors(values[:, back])[:, TENSOR_ORDER]
            return self.vectors(values) if values.ndim == 2 and values.shape[1] == 3 else values

        cells = block.data[:, MIRRORED[block.type]] if self.grid.is_mirrored else block.data
        write_mesh(
            path,
            self.points(mesh.points),
            block.type,
            cells,
            {name: turned(values) for name, values in mesh.point_data.items()},
            {name: turned(values) for name, (values,) in mesh.cell_data.items()},
        )
