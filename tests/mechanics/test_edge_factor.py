"""The singular field at an edge, and the factor on stiffness that follows from it alone."""

import numpy as np
import pytest

from mpm_core.model.edge_factor import PATCH, SECTORS, SingularField, cell_stiffness, edge_factor, opening_exponent
from mpm_core.model.particles import MASSIVE_BENDING_SHARE

RIGHT_ANGLED = np.radians(270.0)


def stress_of(field, z, nu, step=1e-6):
    """Stress xx, yy, xy at z by differences of the displacement; shear modulus 1."""
    along_x = (field.displacement(z + step) - field.displacement(z - step)) / (2 * step)
    along_y = (field.displacement(z + 1j * step) - field.displacement(z - 1j * step)) / (2 * step)
    xx, yy, xy = along_x.real, along_y.imag, 0.5 * (along_x.imag + along_y.real)
    lame = 2 * nu / (1 - 2 * nu)
    return lame * (xx + yy) + 2 * xx, lame * (xx + yy) + 2 * yy, 2 * xy


@pytest.mark.parametrize(("degrees", "exponent"), [(270.0, 0.5444837), (240.0, 0.6157311), (360.0, 0.5)])
def test_exponents_are_those_of_williams(degrees, exponent):
    """Williams (1952): a crack 1/2, a right-angled opening 0.5445; 240 degrees by sin 240 l + l sin 240 = 0."""
    found = opening_exponent(np.radians(degrees))
    assert found == pytest.approx(exponent, abs=2e-7)


@pytest.mark.parametrize("nu", [0.05, 0.25, 0.45])
@pytest.mark.parametrize("degrees", [200.0, 270.0, 330.0])
def test_the_field_is_in_equilibrium_with_free_faces(degrees, nu):
    half = np.radians(degrees) / 2
    field = SingularField.of(2 * half, nu)
    for face in (half, -half):
        xx, yy, xy = stress_of(field, np.exp(1j * face * (1 - 1e-9)), nu)
        normal = np.array([-np.sin(face), np.cos(face)])
        traction = np.array([xx * normal[0] + xy * normal[1], xy * normal[0] + yy * normal[1]])
        assert np.abs(traction).max() < 1e-6 * np.abs([xx, yy, xy]).max() + 1e-6
    z, step = 0.7 * np.exp(0.4j * half), 1e-3
    right, left, up, down = (stress_of(field, z + shift, nu) for shift in (step, -step, 1j * step, -1j * step))
    balance = [right[0] - left[0] + up[2] - down[2], right[2] - left[2] + up[1] - down[1]]
    assert np.abs(balance).max() < 1e-4 * np.abs(np.subtract(right, left)).max()


def test_the_energy_of_a_rhombus_is_that_of_its_stress():
    """Against sums over 400 x 400 points, away from the edge by the known power of the size."""
    nu, start, width = 0.3, -0.2, 1.4
    field = SingularField.of(RIGHT_ANGLED, nu)
    share = (np.arange(400) + 0.5) / 400
    a, b = np.meshgrid(share, share)
    z = (a * np.exp(1j * start) + b * np.exp(1j * (start + width))).ravel()
    z = z[np.maximum(a, b).ravel() > 0.5]
    xx, yy, xy = stress_of(field, z, nu)
    zz = nu * (xx + yy)
    density = (xx**2 + yy**2 + zz**2 + 2 * xy**2 - nu / (1 + nu) * (xx + yy + zz) ** 2) / 4
    outer = density.sum() * np.sin(width) / 400**2
    assert field.energy(start, width, 1.0) - field.energy(start, width, 0.5) == pytest.approx(outer, rel=1e-4)


def test_a_cell_holds_no_rigid_motion_and_a_uniform_strain_as_rock_does():
    """A turn; a stretch of 1 along x in plane strain: (lambda + 2 mu) / 2 per area."""
    nu, start, width = 0.25, 0.3, 1.2
    matrix = cell_stiffness(start, width, nu)
    sides = np.exp(1j * np.array([start, start + width]))
    corners = np.array([[0, 0], [1, 0], [1, 1], [0, 1]]) @ sides
    for motion in (np.ones(4, complex), 1j * np.ones(4), 1j * corners):
        assert np.abs(matrix @ motion.view(float)).max() < 1e-14
    stretch = corners.real.astype(complex).view(float)
    assert 0.5 * stretch @ matrix @ stretch == pytest.approx(1.5 * np.sin(width))


def test_a_flat_wall_needs_none_and_sharper_edges_need_more():
    angles = np.radians([180.01, 200, 220, 240, 270, 300, 330, 350])
    for nu in (0.05, 0.25, 0.4):
        factors = [edge_factor(angle, nu) for angle in angles]
        assert factors[0] == pytest.approx(1.0, abs=0.005)
        assert (np.diff(factors) < 0.0).all()


def test_fewer_cells_around_an_edge_need_a_smaller_factor():
    for angle in np.radians([200, 270, 330]):
        factors = [edge_factor(angle, 0.25, patch) for patch in (1, 2, 3)]
        assert (np.diff(factors) > 0.0).all()


def test_a_lattice_of_squares_gives_the_same_factor():
    """Slow twin for 270 degrees: a lattice of squares around the edge, one quadrant missing, a system of all nodes."""
    nu, lame = 0.25, 1.0
    field = SingularField.of(RIGHT_ANGLED, nu)
    number = {place: k for k, place in enumerate(np.ndindex(2 * PATCH + 1, 2 * PATCH + 1))}
    # the middle of the missing quadrant lies in the direction of -x of the field
    places = np.array([(i - PATCH + 1j * (j - PATCH)) * np.exp(0.75j * np.pi) for i, j in number])
    slope = 0.5 * np.array([[-1, 1, 1, -1], [-1, -1, 1, 1]])
    frame = places[number[1, 0]] - places[number[0, 0]]
    bending = MASSIVE_BENDING_SHARE * 16 / 3 * (lame + 1) / (lame + 2)
    energy = sum(field.energy(-RIGHT_ANGLED / 2 + k * np.pi / 2, np.pi / 2, PATCH) for k in range(SECTORS))
    motion = field.displacement(places)

    def excess(factor):
        total = np.zeros((2 * len(number), 2 * len(number)))
        for i, j in np.ndindex(2 * PATCH, 2 * PATCH):
            if i >= PATCH and j >= PATCH:
                continue
            nodes = [number[i, j], number[i + 1, j], number[i + 1, j + 1], number[i, j + 1]]
            strain = np.zeros((3, 8))
            strain[0, 0::2], strain[1, 1::2], strain[2, 0::2], strain[2, 1::2] = slope[0], slope[1], slope[1], slope[0]
            elastic = np.array([[lame + 2, lame, 0], [lame, lame + 2, 0], [0, 0, 1]])
            mode = np.kron([0.25, -0.25, 0.25, -0.25], np.eye(2))
            near = i in (PATCH - 1, PATCH) and j in (PATCH - 1, PATCH)
            own = (factor if near else 1.0) * (strain.T @ elastic @ strain + bending * mode.T @ mode)
            rows = np.array([[2 * n, 2 * n + 1] for n in nodes]).ravel()
            total[np.ix_(rows, rows)] += own
        there = np.array([not (i > PATCH and j > PATCH) for i, j in number])
        outer = np.array([max(abs(i - PATCH), abs(j - PATCH)) == PATCH for i, j in number])
        u = (motion / frame).view(float) * there.repeat(2)  # in the axes of the lattice
        free = (there & ~outer).repeat(2)
        u[free] = np.linalg.solve(total[np.ix_(free, free)], -total[np.ix_(free, ~free)] @ u[~free])
        return 0.5 * u @ total @ u - energy

    assert abs(excess(edge_factor(RIGHT_ANGLED, nu))) < 1e-9 * energy
    assert excess(1.0) > 0.05 * energy


def test_rock_that_keeps_its_volume_has_a_factor():
    """No factor takes away that corners of cells cannot move so; at 0.4999 none was found, and a fill ended the run."""
    for patch in (1, PATCH):
        factors = [edge_factor(RIGHT_ANGLED, nu, patch) for nu in (0.25, 0.4, 0.45, 0.4999)]
        assert factors[1] == factors[2] == factors[3]
        assert factors[0] > factors[1] > 0.5
