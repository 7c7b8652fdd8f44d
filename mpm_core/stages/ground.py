"""The ground of a scene, independent of its cells: the pieces that excavations remove, and the rock bodies.

A step reads its rock on cells that it names. Excavations are known as pieces of finest cells (grid.nc), rock bodies
as solids.
"""

from dataclasses import dataclass

import numpy as np
import xarray as xr

from common.errors import InputError
from mpm_core.files.state_datasets import read_edge_nodes, read_edge_points, read_origin, read_pieces
from mpm_core.grid.adjacency import holding_cells
from mpm_core.grid.distorted_cells import distorted_cells
from mpm_core.grid.domain import Domain
from mpm_core.grid.edge_nodes import EdgeNodes
from mpm_core.grid.mesh import MultiLevelGrid
from mpm_core.grid.splitting import split
from mpm_core.model.model import Model, build_model
from mpm_core.model.occupancy import FinestPieces, Pieces, Unsupported
from mpm_core.model.openings import Openings
from mpm_core.scene.rock_blocks import read_blocks
from mpm_core.scene.scene import Refinement, Scene
from mpm_core.scene.scene_solids import bodies_at, read_solids
from mpm_core.stages.state_transfer import transfer_unsupported


@dataclass(frozen=True)
class Ground:
    """A scene, the pieces of finest cells inside its excavations, the nodes that lie on edges of these, and which cells
    those are: lower corner of the domain (d,) m, edge of a finest cell m."""

    scene: Scene
    pieces: FinestPieces
    edge_nodes: EdgeNodes
    openings: Openings
    origin: np.ndarray
    fine_cell: float

    @classmethod
    def of(cls, scene: Scene, grid: xr.Dataset) -> "Ground":
        """The ground of a scene and the dataset of its grid. Raises InputError for one that an earlier version made."""
        if "edge_point_shares_nodes" not in grid:
            raise InputError("grid.nc was made by an earlier version; run the pipeline from the grid")
        pieces = read_pieces(grid)
        mined = np.array([excavation.mined for excavation in scene.excavations] or [-1])
        openings = Openings.of(read_edge_points(grid), pieces.place, pieces.samples, pieces.excavation, mined)
        return cls(scene, pieces, read_edge_nodes(grid), openings, *read_origin(grid))

    @property
    def refinement(self) -> Refinement:
        """The way in which cells are split in a step: only a scene that says so has its cells split."""
        assert self.scene.refinement is not None
        return self.scene.refinement

    def model(
        self,
        grid: MultiLevelGrid,
        body: np.ndarray,
        unsupported: Unsupported,
        all_fallen: bool = False,
        at: int | None = None,
    ) -> Model:
        """The scene on a grid; body (cell,): rock body of each cell; unsupported, all_fallen, at: see build_model."""
        distorted = distorted_cells(grid, self.edge_nodes.place, self.edge_nodes.shift)
        return build_model(
            self.scene, grid, body, self.pieces_on(grid), unsupported, all_fallen, distorted, at, self.openings
        )

    def pieces_on(self, grid: MultiLevelGrid) -> Pieces:
        """Pieces of the cells of a grid inside excavations: of finest cells, as no other is mined."""
        cell = holding_cells(grid, self.pieces.place)
        finest = grid.cell_level[cell] == grid.levels - 1
        return Pieces(cell[finest], self.pieces.excavation[finest], self.pieces.samples[finest])

    def refuse_other(self, grid: MultiLevelGrid, step: int) -> None:
        """Raise InputError if this grid is not of the ground: of another domain, or too coarse where it is mined by a
        step."""
        same = grid.fine_cell == self.fine_cell and np.array_equal(grid.origin, self.origin)
        places = self.pieces.place[self._mined(step)]
        if not same or (grid.cell_level[holding_cells(grid, places)] < grid.levels - 1).any():
            raise InputError("the state of the step before belongs to another grid; run the pipeline from the grid")

    def _mined(self, step: int) -> np.ndarray:
        """(piece,) bool: True for pieces of excavations that are mined up to a step."""
        mined = np.array([0 <= excavation.mined <= step for excavation in self.scene.excavations] or [False])
        return mined[self.pieces.excavation]

    def opened(self, grid: MultiLevelGrid, step: int) -> MultiLevelGrid:
        """The grid with finest cells, and rings of them, around all that is mined up to a step."""
        places = np.unique(self.pieces.place[self._mined(step)] >> 1, axis=0)
        rings = self.refinement.rings
        return split(grid, places, rings, rings) if len(places) else grid

    def on(self, grid: MultiLevelGrid, model: Model, all_fallen: bool = True, at: int | None = None) -> Model:
        """The scene on another grid, whose cells are those of a model or parts of them."""
        unsupported = transfer_unsupported(model, grid.cell_index)
        return self.model(grid, self._bodies(grid, model), unsupported, all_fallen, at)

    def _bodies(self, grid: MultiLevelGrid, model: Model) -> np.ndarray:
        """Rock body of each cell: of those that stay theirs, of parts that which holds their centre."""
        origin = holding_cells(model.grid, grid.cell_index)
        body = model.body[origin]
        parts = np.flatnonzero(grid.cell_level != model.grid.cell_level[origin])
        refinement = self.refinement
        if len(parts) and (refinement.bodies or refinement.blocks):
            finest = grid.levels - 1
            domain = Domain(grid.origin, grid.shape >> finest, grid.fine_cell * 2**finest, grid.levels)
            bodies = read_solids(refinement.bodies, "rock_bodies", domain, may_miss=True)
            blocks = read_blocks(refinement.blocks) if refinement.blocks else None
            body[parts] = bodies_at(bodies, grid.centers(parts), blocks)
        return body
