"""A disc pressed from above and below over two opposite arcs (Brazilian test): Hondros 1959, summed in closed form.

An elastic disc of radius R, centre at the origin, loaded along y: uniform radial pressure p on the rim within an angle
a (half_arc) of the +y and of the -y direction, nothing elsewhere. The rim's pressure as a Fourier series in even
multiples of the angle t from the +y axis gives (Hondros 1959, Aust. J. Appl. Sci. 10, 243; here by its stress function)

    radial + hoop   = -4 p / pi [a + sum_m rho^(2 m) / m sin(2 m a) cos(2 m t)]
    hoop - radial   =  4 p / pi (1 - rho^2) sum_m rho^(2 m - 2) sin(2 m a) cos(2 m t)
    shear           =  2 p / pi (1 - rho^2) sum_m rho^(2 m - 2) sin(2 m a) sin(2 m t)

with rho = r / R and m = 1, 2, ... The sums are the imaginary part of -log(1 - z) and the parts of z / (1 - z) at
z = rho^2 exp(2 i (a + t)) and rho^2 exp(2 i (a - t)): no series is cut off. In-plane stresses are those of plane strain
and plane stress alike. Tension positive.
"""

from dataclasses import dataclass
from typing import Self

import numpy as np
from scipy.optimize import minimize

from common.voigt import tensor_from_voigt

QUADRATURE_POINTS = 64  # Gauss points on half a diameter, where the stress is smooth.
SEARCH_POINTS_PER_RADIUS = 160  # Grid on which first failure is looked for before its place is refined.
RIM_CLEARANCE = 1e-3  # Share of the radius. At the ends of the arcs the stress is discontinuous.


@dataclass(frozen=True)
class Disc:
    """Radius and thickness, m; half_arc: half the angle of each loaded arc, rad."""

    radius: float
    thickness: float
    half_arc: float

    def pressure(self, resultant: float) -> float:
        """Pressure on the arcs, Pa, whose resultant on each is this force, N."""
        return resultant / (2.0 * self.radius * np.sin(self.half_arc) * self.thickness)

    def size_of_load(self, resultant: float) -> float:
        """Sum of the sizes of all forces on one arc, N. They point to the centre, so their resultant is smaller."""
        return resultant * self.half_arc / np.sin(self.half_arc)

    def stress(self, position: np.ndarray, pressure: float = 1.0) -> np.ndarray:
        """In-plane stress xx, yy, xy (..., 3), Pa, at positions (..., 2) m from the centre, the disc loaded along y."""
        place = np.asarray(position, float) / self.radius
        square = np.sum(place**2, axis=-1)
        angle = np.arctan2(place[..., 0], place[..., 1])
        ends = [np.exp(2j * (self.half_arc + sign * angle)) for sign in (1.0, -1.0)]
        logarithms = sum(-np.log(1.0 - square * end).imag for end in ends)
        first, second = (end / (1.0 - square * end) for end in ends)  # z / (1 - z) over rho^2
        scale = pressure / np.pi
        mean = -2.0 * scale * self.half_arc - scale * logarithms
        half = scale * (1.0 - square) * (first + second).imag
        shear = scale * (1.0 - square) * (second - first).real
        # from (radial, hoop) at the angle from y to x and y: the radial direction is (sin, cos), the hoop (cos, -sin)
        cosine, sine = np.cos(2.0 * angle), np.sin(2.0 * angle)
        return np.stack([mean + half * cosine + shear * sine, mean - half * cosine - shear * sine,
                         shear * cosine - half * sine], axis=-1)  # fmt: skip

    def widening(self, pressure: float, youngs_modulus: float, poisson_ratio: float) -> float:
        """Growth of the diameter across the load in plane strain, m: the integral of its strain."""
        points, weights = np.polynomial.legendre.leggauss(QUADRATURE_POINTS)
        across = np.stack([0.5 * self.radius * (points + 1.0), np.zeros(QUADRATURE_POINTS)], axis=1)
        xx, yy, _ = self.stress(across, pressure).T
        strain = (1.0 + poisson_ratio) / youngs_modulus * ((1.0 - poisson_ratio) * xx - poisson_ratio * yy)
        return float(self.radius * np.sum(weights * strain))


def plane_strain(stress: np.ndarray, poisson_ratio: float) -> np.ndarray:
    """Six components xx, yy, zz, yz, xz, xy (..., 6) of in-plane stresses xx, yy, xy (..., 3) in plane strain."""
    xx, yy, xy = np.moveaxis(np.asarray(stress, float), -1, 0)
    zero = np.zeros_like(xx)
    return np.stack([xx, yy, poisson_ratio * (xx + yy), zero, zero, xy], axis=-1)


@dataclass(frozen=True)
class PeakStrength:
    """Coulomb strength: friction angle (rad), cohesion (Pa), tension cut-off (Pa; None without)."""

    friction_angle: float
    cohesion: float
    tension_cutoff: float | None = None

    @classmethod
    def of(cls, material: dict) -> Self:
        """Intact strength of a material of a configuration (degrees, Pa)."""
        friction, cohesion, cutoff = (material[key] for key in ("friction_angle", "cohesion", "tension_cutoff"))
        return cls(np.radians(friction["intact"]), cohesion["intact"], None if cutoff == "none" else cutoff["intact"])

    def load_factor(self, stress: np.ndarray) -> np.ndarray:
        """Factor (...,) by which a stress (..., 6) may grow until it fails; inf where it never fails."""
        values = np.linalg.eigvalsh(tensor_from_voigt(np.asarray(stress, float)))
        smallest, largest = values[..., 0], values[..., 2]
        sine, cosine = np.sin(self.friction_angle), np.cos(self.friction_angle)
        friction, unconfined = (1.0 + sine) / (1.0 - sine), 2.0 * self.cohesion * cosine / (1.0 - sine)
        with np.errstate(divide="ignore"):
            load = friction * largest - smallest
            factor = np.where(load > 0.0, unconfined / load, np.inf)
            if self.tension_cutoff is not None:
                factor = np.minimum(factor, np.where(largest > 0.0, self.tension_cutoff / largest, np.inf))
        return factor


@dataclass(frozen=True)
class FirstFailure:
    """Resultant of the load (N) at which some place first fails, and that place (x, y), m."""

    resultant: float
    place: tuple[float, float]


def first_failure(disc: Disc, poisson_ratio: float, strength: PeakStrength) -> FirstFailure:
    """Place and load at which a disc in plane strain fails first; of equal places that with x >= 0 and y >= 0."""
    unit = disc.pressure(1.0)

    def resultant(position: np.ndarray) -> np.ndarray:
        return strength.load_factor(plane_strain(disc.stress(position, unit), poisson_ratio))

    line = np.linspace(0.0, 1.0 - RIM_CLEARANCE, SEARCH_POINTS_PER_RADIUS) * disc.radius
    grid = np.stack(np.meshgrid(line, line, indexing="ij"), axis=-1).reshape(-1, 2)
    grid = grid[np.hypot(*grid.T) <= line[-1]]
    start = grid[np.argmin(resultant(grid))]
    step = line[1]

    def objective(shift: np.ndarray) -> float:
        return float(resultant(np.abs(start + step * shift)))  # The quadrants are images of each other.

    best = minimize(objective, np.zeros(2), method="Nelder-Mead", options={"xatol": 1e-6, "fatol": 1e-9})
    place = np.abs(start + step * best.x)
    return FirstFailure(float(best.fun), (float(place[0]), float(place[1])))
