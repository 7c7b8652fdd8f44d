"""A circular hole in elastic rock, plane strain: in an infinite plate (Kirsch 1898) and in the middle of a square box.

Tension positive. The virgin stress (xx, yy, xy) is uniform; displacement counts from the virgin state, so it vanishes
far away, and stress is the whole stress. Points are x + i y in metres from the centre of the hole.

The box. In plane strain every field is given by two functions of z = x + i y (Muskhelishvili 1953, sections 32 and 39):

    xx + yy           = 4 Re phi'
    yy - xx + 2 i xy  = 2 (conj(z) phi'' + psi')
    2 G (ux + i uy)   = kappa phi - z conj(phi') - conj(psi),    kappa = 3 - 4 nu

and the last line with kappa = -1 is, but for a factor, the force on an arc. A square is symmetric under half a turn, so
phi and psi are Laurent series of odd powers. No force on the hole r = a fixes psi term by term:

    phi = z^n  ->  psi = -a^(2 n) z^(-n) - n a^2 z^(n - 2)    (real coefficients; the first one conjugate otherwise)

so each term leaves the hole exactly free. The condition of the outer faces, no displacement (fixed) or no change of
force (traction), is met by least squares at points along them. `residual` is its largest misfit.
"""

from dataclasses import dataclass

import numpy as np

SERIES_TERMS = 40  # Odd powers of either sign.
FACE_POINTS = 200
POINTS_PER_CHUNK = 20_000  # Limits the memory of one evaluation.


@dataclass(frozen=True)
class Field:
    """In-plane stress and displacement at points: xx, yy, xy in Pa, ux, uy in m, each (point,)."""

    xx: np.ndarray
    yy: np.ndarray
    xy: np.ndarray
    ux: np.ndarray
    uy: np.ndarray

    def polar_stress(self, angle: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Radial, hoop and shear stress, Pa, at polar angles (point,) rad."""
        return polar_stress(self.xx, self.yy, self.xy, angle)

    @property
    def moved(self) -> np.ndarray:
        """Displacement as ux + i uy, m."""
        return self.ux + 1j * self.uy

    def polar_displacement(self, angle: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Radial (outward) and hoop displacement, m."""
        turned = self.moved * np.exp(-1j * angle)
        return turned.real, turned.imag


def polar_stress(xx, yy, xy, angle) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Radial, hoop and shear stress from Cartesian components; all arrays of one shape, angle in rad."""
    mean, turned = 0.5 * (xx + yy), (0.5 * (xx - yy) + 1j * xy) * np.exp(-2j * angle)
    return mean + turned.real, mean - turned.real, turned.imag


@dataclass(frozen=True)
class InfinitePlate:
    """Kirsch's solution. radius m; stress (xx, yy, xy) Pa, virgin; shear_modulus Pa; poisson_ratio."""

    radius: float
    stress: tuple[float, float, float]
    shear_modulus: float
    poisson_ratio: float

    def polar(self, r: np.ndarray, angle: np.ndarray) -> tuple[np.ndarray, ...]:
        """Radial, hoop, shear stress (Pa), radial and hoop displacement (m) at r >= radius (m) and angle (rad).

        Kirsch (1898); displacements: Brady and Brown (2004, chapter 7), for any orientation of the virgin stress.
        """
        xx, yy, xy = self.stress
        mean = 0.5 * (xx + yy)
        along = 0.5 * (xx - yy) * np.cos(2 * angle) + xy * np.sin(2 * angle)
        across = xy * np.cos(2 * angle) - 0.5 * (xx - yy) * np.sin(2 * angle)
        q = (self.radius / r) ** 2
        reach = self.radius**2 / (2 * self.shear_modulus * r)
        return (
            mean * (1 - q) + (1 - 4 * q + 3 * q**2) * along,
            mean * (1 + q) - (1 + 3 * q**2) * along,
            (1 + 2 * q - 3 * q**2) * across,
            reach * (mean + (4 * (1 - self.poisson_ratio) - q) * along),
            reach * (2 * (1 - 2 * self.poisson_ratio) + q) * across,
        )

    def at(self, points: np.ndarray) -> Field:
        """Field at points (point,) complex."""
        angle = np.angle(points)
        radial, hoop, shear, outward, around = self.polar(np.abs(points), angle)
        xx, yy, xy = polar_stress(radial, hoop, shear, -angle)
        moved = (outward + 1j * around) * np.exp(1j * angle)
        return Field(xx, yy, xy, moved.real, moved.imag)


@dataclass(frozen=True)
class PressedPlate:
    """A hole with pressure (Pa) inside: `plate` under virgin stress plus that pressure, less the pressure all round."""

    plate: "InfinitePlate | BoxedPlate"
    pressure: float

    def at(self, points: np.ndarray) -> Field:
        """Field at points (point,) complex."""
        field = self.plate.at(points)
        return Field(field.xx - self.pressure, field.yy - self.pressure, field.xy, field.ux, field.uy)


class BoxedPlate:
    """A hole in the middle of a square box whose faces are fixed, or keep their virgin traction.

    half_width: from the centre to a face, m. boundary: "fixed" or "traction". Other arguments as in InfinitePlate.
    `residual` is the largest misfit on the faces between the points of the fit: that of 2 G u (fixed) or of the force
    on an arc (traction), over the largest virgin stress times the radius.
    """

    def __init__(self, radius, stress, shear_modulus, poisson_ratio, half_width, boundary, terms=SERIES_TERMS):
        self.radius, self.shear_modulus = radius, shear_modulus
        self.kappa = 3 - 4 * poisson_ratio
        self.size = np.sqrt(2.0) * half_width  # Distance of a corner: powers of z over it are at most 1.
        self.power = 2 * np.arange(terms) + 1
        self.virgin = 0.25 * (stress[0] + stress[1]), 0.5 * (stress[1] - stress[0]) + 1j * stress[2]  # phi', psi'
        kappa = {"fixed": self.kappa, "traction": -1.0}[boundary]
        # Points are denser towards the corners, where the field is least smooth.
        fit, between = (half_width * np.cos(np.pi * (np.arange(FACE_POINTS) + at) / FACE_POINTS) for at in (0.5, 0.0))
        matrix, wanted = self._conditions(half_width, fit, kappa)
        # The term phi = i z is left out. It turns the box, which free faces would allow.
        solved = np.delete(np.arange(4 * terms), terms)
        unknown = np.zeros((4, terms))
        unknown.flat[solved] = np.linalg.lstsq(matrix[:, solved], wanted, rcond=1e-15)[0]
        self.grow, self.decay = unknown[0] + 1j * unknown[1], unknown[2] + 1j * unknown[3]
        matrix, wanted = self._conditions(half_width, between, kappa)
        self.residual = np.abs(matrix @ unknown.ravel() - wanted).max() / (np.abs(stress).max() * radius)

    def _conditions(self, half_width: float, place: np.ndarray, kappa: float) -> tuple[np.ndarray, np.ndarray]:
        """Matrix and right side of the conditions at places along a face: real parts above imaginary ones.

        Two neighbouring faces; half a turn gives the others. Unknowns: real and imaginary parts of the growing, then of
        the decaying terms.
        """
        z = np.concatenate([half_width + 1j * place, place + 1j * half_width])
        columns = []
        for amplitudes in ((1, 0), (1j, 0), (0, 1), (0, 1j)):
            phi, slope, _, psi, _ = self._terms(z, *amplitudes)
            columns.append(kappa * phi - z[:, None] * np.conj(slope) - np.conj(psi))
        matrix = np.concatenate(columns, axis=1)
        slope, psi_slope = self.virgin
        wanted = (kappa - 1) * slope * z - np.conj(psi_slope * z)
        return np.concatenate([matrix.real, matrix.imag]), np.append(wanted.real, wanted.imag)

    def _terms(self, z: np.ndarray, grow, decay) -> tuple[np.ndarray, ...]:
        """phi, phi', phi'', psi, psi' of each pair of terms, (point, term), for their amplitudes (term,) or scalar."""
        n, z, square = self.power, z[:, None], self.radius**2
        up, down = (z / self.size) ** n, (square / (self.size * z)) ** n
        a, b, a_, b_ = grow * up, decay * down, np.conj(grow) * down, np.conj(decay) * up
        return (
            a + b,
            n * (a - b) / z,
            n * ((n - 1) * a + (n + 1) * b) / z**2,
            -a_ - b_ - n * (a - b) * square / z**2,
            n * (a_ - b_) / z - n * ((n - 2) * a + (n + 2) * b) * square / z**3,
        )

    def at(self, points: np.ndarray) -> Field:
        """Field at points (point,) complex, r >= radius, inside the box."""
        parts = [self._at(part) for part in np.array_split(points, len(points) // POINTS_PER_CHUNK + 1)]
        return Field(*(np.concatenate(column) for column in zip(*parts, strict=True)))

    def _at(self, z: np.ndarray) -> tuple[np.ndarray, ...]:
        phi, slope, bend, psi, psi_slope = (term.sum(axis=1) for term in self._terms(z, self.grow, self.decay))
        mean, half = 2 * slope.real, np.conj(z) * bend + psi_slope
        slope, psi_rate = slope - self.virgin[0], self.virgin[1]
        moved = self.kappa * (phi - self.virgin[0] * z) - z * np.conj(slope) - np.conj(psi - psi_rate * z)
        moved /= 2 * self.shear_modulus
        return mean - half.real, mean + half.real, half.imag, moved.real, moved.imag
