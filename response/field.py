"""Stress and displacement at any point of the rock, with their errors.

Displacement is the scheme's own field: nodes and shape functions. Stress is known at particles, each of which stands
for its part of a cell. At a point it is that of the plane which fits the particles of the nearest cells best, so it is
no step function and reaches the wall. Particles beyond an opening do not count, nor those in another rock body: stress
along a contact jumps there. The errors are at a level of 95 %: in
the closed forms of studies `kirsch` and `sphere` so many points are within them.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from response.rock import MINED, OUTSIDE, Rock

CELLS_FITTED = {2: 9, 3: 27}  # By dimension: a cell and those around it.
FARTHEST = 3.0  # Edges of its own cell within which a particle counts.
BETWEEN = (0.25, 0.5, 0.75)  # Places between point and particle that must not lie in an opening.
MIN_FITTED = 4  # Particles more than coefficients that a plane needs; with fewer the mean is taken.
MIN_SPREAD = 1e-6  # Of the particles along a direction, over the largest: with less they show no slope along it.
STRESS_ERROR = 0.8  # Of the gradient times how one-sided the particles lie, and their scatter about the plane.
WALL = 1.25  # Edges of a finest cell from a particle within which a point in an opening is one of its wall.
DISPLACEMENT_ERROR = 0.15  # Of the difference of displacement across a cell.


@dataclass(frozen=True)
class Values:
    """Fields at points, NaN where there is no rock: outside of the domain, and in openings farther than WALL from rock.

    stress (n, 6) Pa, its error (n,) Pa in the norm of the tensor; displacement (n, xyz) m since virgin rock, its error
    (n,) m; cell (n,) m: edge of the cell there; failed (n,) bool; what (n,): see rock.Rock.what.
    """

    stress: NDArray
    stress_error: NDArray
    displacement: NDArray
    displacement_error: NDArray
    cell: NDArray
    failed: NDArray
    what: NDArray

    @classmethod
    def unknown(cls, count: int) -> "Values":
        """Of so many points nothing is known."""
        one, three, six = (np.full((count, *shape), np.nan) for shape in ((), (3,), (6,)))
        return cls(six, one, three, one, one, np.zeros(count, bool), np.full(count, OUTSIDE))


def values_at(rock: Rock, points: NDArray) -> Values:
    """Fields at points (n, xyz) m."""
    what, particle = rock.what(points)
    own, tree = rock.particle_tree
    lacking = np.flatnonzero((what == MINED) | (particle < 0))
    apart, near = tree.query(points[lacking][:, rock.axes])
    at_wall = (what[lacking] != OUTSIDE) & (apart <= WALL * rock.edge)
    particle[lacking] = np.where(at_wall, own[np.minimum(near, len(own) - 1)], -1)
    here = np.flatnonzero((particle >= 0) & (what != OUTSIDE))
    stress, stress_error = np.full((len(points), 6), np.nan), np.full(len(points), np.nan)
    moved, moved_error = np.full((len(points), 3), np.nan), np.full(len(points), np.nan)
    cell = np.full(len(points), np.nan)
    if len(here):
        cell[here] = rock.grid.cell_size[rock.state["cell"].values[particle[here]]]
        stress[here], stress_error[here] = fitted_stress(rock, points[here], particle[here])
        inside = np.where(np.isin(here, lacking)[:, None], rock.state["position"].values[particle[here]], points[here])
        moved[here] = rock.displacement(points[here], inside)
        moved_error[here] = DISPLACEMENT_ERROR * rock.difference_across(inside)
    failed = np.zeros(len(points), bool)
    failed[here] = rock.failed[particle[here]]
    return Values(stress, stress_error, moved, moved_error, cell, failed, what)


def fitted_stress(rock: Rock, points: NDArray, own_particle: NDArray) -> tuple[NDArray, NDArray]:
    """Stress (n, 6) Pa at points (n, xyz) m in rock, and its error (n,) Pa; own_particle (n,): one of their rock.

    Weighted least squares: a particle at r cells has the weight 1 / (1 + r^2), and 0 in another rock body. The error
    grows with how one-sided the particles lie, as they do at walls, times the gradient, and with their scatter about
    the plane.
    """
    state, dimension = rock.state, len(rock.axes)
    own, tree = rock.particle_tree
    per_cell = max(1, round(len(own) / max(len(np.unique(state["cell"].values[own])), 1)))
    count = min(CELLS_FITTED[dimension] * per_cell, len(own))
    distance, near = tree.query(points[:, rock.axes], k=count)
    distance, near = distance.reshape(len(points), count), near.reshape(len(points), count)
    particle = own[near]
    size = rock.grid.cell_size[state["cell"].values[particle]]
    edge = size[:, :1]  # of the nearest
    away = (state["position"].values[particle][:, :, rock.axes] - points[:, None, rock.axes]) / edge[:, :, None]
    weight = np.where(distance <= FARTHEST * np.maximum(size, edge), 1.0 / np.sqrt(1.0 + (distance / edge) ** 2), 0.0)
    for share in BETWEEN:
        between = points[:, None] + share * (state["position"].values[particle] - points[:, None])
        mined = rock.voids.hold(rock.in_cells(between.reshape(-1, 3))).reshape(weight.shape)
        weight[mined] = 0.0
    body = state["cell_body"].values[state["cell"].values]
    weight[body[particle] != body[own_particle][:, None]] = 0.0
    alone = np.flatnonzero(~(weight > 0.0).any(axis=1))  # none of its rock is near: its own is taken as it is
    particle[alone, 0] = own_particle[alone]
    weight[:, 0] = np.where((weight > 0.0).any(axis=1), weight[:, 0], 1.0)
    values = state["stress"].values[particle]
    squares = (weight**2).sum(axis=1)
    middle = np.einsum("nk,nki->ni", weight**2, away) / squares[:, None]  # a slope that nothing shows is then 0
    terms = np.concatenate([np.ones((*away.shape[:2], 1)), away - middle[:, None]], axis=2)
    few = (weight > 0.0).sum(axis=1) < dimension + 1 + MIN_FITTED
    terms[few, :, 1:] = 0.0
    fitted = np.einsum("nmk,nk,nkc->nmc", np.linalg.pinv(terms * weight[:, :, None], rcond=MIN_SPREAD), weight, values)
    left = values - np.einsum("nkm,nmc->nkc", terms, fitted)
    multiplicity = np.array([1.0, 1.0, 1.0, 2.0, 2.0, 2.0])
    scatter = np.sqrt(np.einsum("nk,nkc,c->n", weight**2, left**2, multiplicity) / squares)
    gradient = np.sqrt(np.einsum("nmc,c->n", fitted[:, 1:] ** 2, multiplicity))
    one_sided = np.linalg.norm(np.einsum("nk,nki->ni", weight, away), axis=1) / weight.sum(axis=1)
    at_point = fitted[:, 0] - np.einsum("ni,nic->nc", middle, fitted[:, 1:])
    return at_point, STRESS_ERROR * (gradient * one_sided + scatter)
