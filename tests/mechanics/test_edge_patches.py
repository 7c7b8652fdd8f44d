"""The factor on stiffness at an edge, against what the model's own cells need, wherever the edge lies among them."""

import numpy as np
import pytest
import scipy

from mechanics.scenes import HOST
from mechanics.test_edges import model_of
from mechanics.test_steps_with_edge_nodes import grid_of
from mpm_core.equilibrium.body import Body
from mpm_core.model.edge_factor import PATCH, PATCH_OF_SHARED_NODES, SingularField, edge_factor

ANGLE = np.radians(270.0)
LOW = np.array([8.0, 8.0])  # lattice place nearest to the edge at the opening's lower corner
TURN = np.exp(-0.25j * np.pi)  # from axes of the model to those of the field: its bisector points away from the opening


def energy_of_field(field, edge, low, high):
    """Energy of the field in the rock of a rectangle: its density goes with r^(2 l - 2)."""
    turn = -0.5 * ANGLE + ANGLE * (np.arange(20000) + 0.5) / 20000
    z = np.exp(1j * turn) * -np.conj(TURN)
    along = np.stack([z.real, z.imag], axis=1)
    reach = np.where(along > 0.0, high - edge, low - edge) / along
    power = 2.0 * field.exponent
    return np.sum(field.density(np.exp(1j * turn)) * np.abs(reach).min(axis=1) ** power) * ANGLE / 20000 / power


def factor_needed(shift):
    """The factor with which a patch of cells around an edge, moved by the singular field at its border, holds the
    energy of that field; whether a node lies on the edge; whether the model says that nodes there are shared."""
    nu = HOST["poisson_ratio"]
    edge = LOW + shift
    grid = grid_of(([edge[0], 0.0, edge[1]], [edge[0] + 8.0, 0.0, edge[1] + 8.0]), coarse_cell=4.0, buffer_cells=4)
    model = model_of(grid, "xz")
    particles, volume = model.particles, model.volumes(0)
    cells = np.flatnonzero((np.abs(model.grid.cell_center - model.grid.origin - edge) <= PATCH).all(axis=1))
    rock = np.bincount(particles.cell, volume, minlength=len(model.cell_nodes)) > 0.0
    inner, outer = cells[rock[cells]], np.flatnonzero(rock & ~np.isin(np.arange(len(rock)), cells))
    nodes = np.unique(model.cell_nodes[inner])
    free = np.repeat(~np.isin(nodes, model.cell_nodes[outer]), 2)
    shear = model.elastic_constants[particles.material, 1]
    softened = (shear < shear.max() * (1 - 1e-9)) & particles.is_rock & np.isin(particles.cell, inner)
    near = np.isin(particles.cell, particles.cell[softened])
    field = SingularField.of(ANGLE, nu)
    place = model.node_position[nodes] - model.grid.origin - edge
    z = -(place[:, 0] + 1j * place[:, 1]) * TURN
    motion = np.where(np.abs(z) > 0.0, -field.displacement(z) * np.conj(TURN), 0.0).view(float)

    def stiffness(chosen):
        matrix = np.empty((len(motion), len(motion)))
        for column, (node, axis) in enumerate((node, axis) for node in nodes for axis in range(2)):
            state = model.virgin_state()
            body = Body(model, state, np.where(chosen & np.isin(particles.cell, inner), volume, 0.0))
            state.stress[:] = 0.0
            state.velocity[node, axis] = 1.0
            body.update(1.0)
            body.advance(np.zeros_like(state.velocity), 0.0)
            matrix[:, column] = -body.unbalanced[nodes].ravel()
        return matrix / shear.max()

    at_edge, others = stiffness(near), stiffness(~near)
    at_edge /= shear[softened].min() / shear.max()
    corner = model.node_position[nodes] - model.grid.origin
    exact = energy_of_field(field, edge, corner.min(axis=0), corner.max(axis=0))

    def excess(factor):
        matrix, u = factor * at_edge + others, motion.copy()
        held = matrix[np.ix_(free, free)] + 1e-9 * np.eye(free.sum())  # nodes that no rock reaches
        u[free] = np.linalg.solve(held, -matrix[np.ix_(free, ~free)] @ u[~free])
        return 0.5 * u @ matrix @ u / exact - 1.0

    points = model.openings.points
    nearest = np.argmin(np.linalg.norm(points.place - edge, axis=1))
    has_node = np.linalg.norm(place, axis=1).min() < 1e-6
    return scipy.optimize.brentq(excess, 0.1, 2.0), has_node, points.shares_nodes[nearest]


@pytest.fixture(scope="module")
def needed():
    """What factor_needed returns, at sixteen places of a right-angled edge among its cells."""
    shares = (-0.4, -0.15, 0.1, 0.35)
    return [factor_needed(np.array([x, y])) for x in shares for y in shares]


def test_nodes_are_shared_where_none_lies_on_the_edge(needed):
    assert [shared for _, _, shared in needed] == [not has_node for _, has_node, _ in needed]


@pytest.mark.parametrize(("shared", "patch", "tolerance"), [(False, PATCH, 0.03), (True, PATCH_OF_SHARED_NODES, 0.05)])
def test_the_factor_is_what_edges_need_in_the_mean(needed, shared, patch, tolerance):
    own = [factor for factor, _, at_edge in needed if at_edge == shared]
    assert 5 <= len(own) <= 11
    assert np.mean(own) == pytest.approx(edge_factor(ANGLE, HOST["poisson_ratio"], patch), abs=tolerance)


def test_with_a_wall_on_faces_an_edge_needs_the_factor_of_one_with_a_node():
    """A node lies on one of the walls, next to the edge, and moves with that wall alone."""
    found = [factor_needed(np.array([0.0, share])) for share in (-0.4, -0.15, 0.1, 0.35)]
    assert not any(shared for _, _, shared in found)
    assert np.mean([factor for factor, _, _ in found]) == pytest.approx(
        edge_factor(ANGLE, HOST["poisson_ratio"]), abs=0.03
    )


def test_an_edge_on_the_lattice_needs_the_factor_itself():
    factor, has_node, shared = factor_needed(np.zeros(2))
    assert has_node
    assert not shared
    assert factor == pytest.approx(edge_factor(ANGLE, HOST["poisson_ratio"]), abs=1e-3)
