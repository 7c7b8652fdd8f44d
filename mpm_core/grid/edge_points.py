"""Points along the sharp edges of openings."""

from typing import NamedTuple

import numpy as np

from mpm_core.geometry.solids import Outside, Solid
from mpm_core.grid.edge_nodes import is_edge, sharp_edges

SPACING = 0.5  # finest cells; largest distance of two points of an edge


class EdgePoints(NamedTuple):
    """Points along edges: place (k, d) in finest cells from the domain's lower corner; angle (k,) that rock fills
    around the edge, radians; excavation (k,) whose edge it is."""

    place: np.ndarray
    angle: np.ndarray
    excavation: np.ndarray

    @classmethod
    def none(cls, dimension: int) -> "EdgePoints":
        """No edge."""
        return cls(np.empty((0, dimension)), np.empty(0), np.empty(0, np.int16))


def edge_points(solids: list[Solid | Outside], origin: np.ndarray, fine_cell: float, shape: np.ndarray) -> EdgePoints:
    """Points along the edges of these excavations; shape (d,) finest cells of the domain."""
    found = [EdgePoints.none(len(shape))]
    for number, solid in enumerate(solids):
        edges = sharp_edges(solid.solid if isinstance(solid, Outside) else solid)
        segments = (edges.segments - origin) / fine_cell
        chosen = is_edge(solid, segments.mean(axis=1), origin, fine_cell)
        segments, turn = segments[chosen], edges.turn[chosen]
        along = segments[:, 1] - segments[:, 0]
        steps = np.maximum(1, np.ceil(np.linalg.norm(along, axis=1) / SPACING).astype(np.int64))
        row = np.repeat(np.arange(len(steps)), steps)
        share = (np.arange(len(row)) - np.repeat(np.cumsum(steps) - steps, steps) + 0.5) / steps[row]
        place = segments[row, 0] + share[:, None] * along[row]
        within = ((place > 0.0) & (place < shape)).all(axis=1)
        place, turn = place[within], turn[row[within]]
        found.append(EdgePoints(place, np.pi + turn, np.full(len(place), number, np.int16)))
    return EdgePoints(*(np.concatenate(columns) for columns in zip(*found, strict=True)))
