"""Anderson acceleration on a linear problem, where it takes the smallest residual there is."""

import numpy as np
import pytest
from scipy.sparse.linalg import minres

from mpm_core.multigrid.anderson import Anderson

UNKNOWNS, ELEMENTS = 30, 50


def problem():
    """(matrix, forces, where the unknowns lie among all elements)."""
    random = np.random.default_rng(6)
    turned = np.linalg.qr(random.standard_normal((UNKNOWNS, UNKNOWNS)))[0]
    matrix = turned * np.geomspace(1.0, 30.0, UNKNOWNS) @ turned.T
    free = np.sort(random.choice(ELEMENTS, UNKNOWNS, replace=False)).astype(np.int32)
    return matrix, random.standard_normal(UNKNOWNS), free


def walk(matrix, forces, free, depth, turns):
    """Displacements after each turn, (turn, unknown); the preconditioner is a multiple of the identity."""
    anderson = Anderson(free, depth)
    displacement, step, residual, correction = np.zeros((4, ELEMENTS))
    way = []
    for _ in range(turns):
        residual[free] = forces - matrix @ displacement[free]
        size = np.linalg.norm(residual[free])
        correction[free] = 0.1 * residual[free] / size
        anderson.next_step(residual, correction.astype(np.float32), size, step)
        displacement += step
        way.append(displacement[free])
    assert not np.delete(displacement, free).any()
    return np.array(way)


def test_linear_problem_is_solved_with_the_smallest_residuals():
    """Turn n is one plain step beyond the displacement that has the smallest residual of n steps' combinations."""
    matrix, forces, free = problem()
    exact = np.linalg.solve(matrix, forces)
    way = walk(matrix, forces, free, depth=20, turns=13)
    for steps in (4, 8, 12):
        best = minres(matrix, forces, rtol=0.0, maxiter=steps)[0]
        plain = best + 0.1 * (forces - matrix @ best)
        np.testing.assert_allclose(way[steps], plain, rtol=0, atol=2e-3 * np.abs(plain - exact).max())


def test_what_was_forgotten_does_not_count():
    _, forces, free = problem()
    anderson = Anderson(free, 5)
    fresh = Anderson(free, 5)
    steps = []
    for one in (anderson, fresh):
        if one is anderson:
            for residual in np.random.default_rng(7).standard_normal((4, ELEMENTS)):
                one.next_step(residual, residual.astype(np.float32), 2.0, np.ones(ELEMENTS))
            one.reset()
        step, residual = np.zeros((2, ELEMENTS))
        for next_step in range(1, 4):
            residual[free] = forces / next_step**2
            one.next_step(residual, residual.astype(np.float32), 1.0, step)
        steps.append(step)
    np.testing.assert_array_equal(*steps)


@pytest.mark.parametrize("depth", [2, 6])
def test_more_turns_than_are_remembered_come_closer(depth):
    matrix, forces, free = problem()
    exact = np.linalg.solve(matrix, forces)
    way = walk(matrix, forces, free, depth, 100)
    assert np.linalg.norm(way[-1] - exact) < 1e-3 * np.linalg.norm(exact)


def test_many_unknowns_go_the_way_of_few():
    """A problem beside copies of itself, in more elements than one thread takes at once, walks as it does alone."""
    matrix, forces, free = problem()
    anderson = Anderson(free, 6), Anderson((free + ELEMENTS * np.arange(900)[:, None]).ravel().astype(np.int32), 6)
    steps = np.zeros(ELEMENTS), np.zeros(900 * ELEMENTS)
    displacement, residual = np.zeros((2, ELEMENTS))
    for _ in range(9):
        residual[free] = forces - matrix @ displacement[free]
        for one, step, copies in zip(anderson, steps, (1, 900), strict=True):
            values = np.tile(residual, copies)
            one.next_step(values, 0.1 * values.astype(np.float32), 1.0, step)
        np.testing.assert_allclose(steps[1].reshape(900, -1), np.tile(steps[0], (900, 1)), rtol=1e-9, atol=1e-12)
        displacement += steps[0]
