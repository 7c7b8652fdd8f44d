"""Rock around the hole of Kirsch's scene, compared with the exact field of the boxed plate."""

from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
from scipy.spatial import cKDTree

from verification.answers.kirsch.closed_form import BoxedPlate, Field, InfinitePlate, PressedPlate, polar_stress
from verification.results import Variant

MIN_UNCUT_SHARE = 0.999  # Share of rock from which a cell counts as uncut.


@dataclass(frozen=True)
class Hole:
    """The scene's hole. radius m; center x + i y m; far_stress: largest virgin stress, Pa; cell: the finest, m."""

    radius: float
    center: complex
    far_stress: float
    cell: float
    particles_per_cell: int
    plate: PressedPlate | InfinitePlate


solved_plate = lru_cache(BoxedPlate)  # Most variants share one.


def read_hole(variant: Variant) -> Hole:
    """The hole of a variant, from its configuration."""
    values = variant.values
    hole, rock = values["excavations"][0], values["materials"]["host"]
    constant = values["insitu_stress"]["constant"]
    stress = tuple(constant.get(name, 0.0) for name in ("xx", "yy", "xy"))
    shear_modulus = rock["youngs_modulus"] / (2 * (1 + rock["poisson_ratio"]))
    half_width = 0.5 * (values["domain"]["upper"][0] - values["domain"]["lower"][0])
    pressure = hole.get("pressure", 0.0)
    pressed = (stress[0] + pressure, stress[1] + pressure, stress[2])
    plate = solved_plate(
        hole["radius"], pressed, shear_modulus, rock["poisson_ratio"], half_width, values["domain"]["boundary"]
    )
    grid = values["grid"]
    return Hole(
        radius=hole["radius"],
        center=complex(*hole["center"]),
        far_stress=float(np.abs(stress).max()),
        cell=grid["coarse_cell"] / 2 ** (grid["levels"] - 1),
        particles_per_cell=grid["particles_per_cell"],
        plate=PressedPlate(plate, pressure),
    )


class Rock:
    """Particles of rock around the hole.

    place (particle,) x + i y m from its centre; volume (particle,) m3; stress (particle, 3) xx, yy, xy, whole stress in
    Pa; moved (particle,) ux + i uy m; whole (particle,) bool: in an uncut cell.
    """

    def __init__(self, variant: Variant):
        self.hole = read_hole(variant)
        self.grid, state = variant.grid, variant.elastic
        present = state.volume.values > 0.0
        self.volume, self.cell = state.volume.values[present], state.cell.values[present]
        self.place = state.position.values[present, :2] @ np.array([1.0, 1.0j]) - self.hole.center
        self.stress = state.stress.values[present][:, [0, 1, 5]]
        self.moved = state.displacement.values[present, :2] @ np.array([1.0, 1.0j])
        self.cell_nodes = state.cell_nodes.values  # They include the phantom nodes of walls.
        self.node_moved = state.node_displacement.values[:, :2] @ np.array([1.0, 1.0j])
        size = self.grid.cell_size.values[self.cell] ** 2 * self.grid.attrs["thickness"]
        self.whole = np.bincount(self.cell, self.volume)[self.cell] > MIN_UNCUT_SHARE * size
        self.distance, self.angle = np.abs(self.place), np.angle(self.place)

    @cached_property
    def polar(self) -> np.ndarray:
        """Radial, hoop and shear stress (3, particle), Pa."""
        xx, yy, xy = self.stress.T
        return np.array(polar_stress(xx, yy, xy, self.angle))

    def exact(self, chosen: np.ndarray) -> Field:
        """The exact field at chosen particles."""
        return self.hole.plate.at(self.place[chosen])

    def between(self, inner: float, outer: float) -> np.ndarray:
        """Particles at these distances from the centre (m)."""
        return np.flatnonzero((self.distance >= inner) & (self.distance <= outer))

    def stress_error(self, inner: float, outer: float) -> np.ndarray:
        """Root mean square error of radial, hoop and shear stress (3,), by volume, as a share of the far stress."""
        chosen = self.between(inner, outer)
        error = self.polar[:, chosen] - self.exact(chosen).polar_stress(self.angle[chosen])
        return mean_square_root(error, self.volume[chosen]) / self.hole.far_stress

    def displacement_error(self, inner: float, outer: float) -> float:
        """Root mean square error of the displacement, by volume, m."""
        chosen = self.between(inner, outer)
        return float(mean_square_root(np.abs(self.moved[chosen] - self.exact(chosen).moved), self.volume[chosen]))

    def wall_displacement(self, angle: np.ndarray) -> np.ndarray:
        """Displacement (angle,) ux + i uy, m, of the wall at these angles, by the shape functions of the nearest cell.

        Only finest cells with rock are taken. Where the wall lies outside its cell, the functions are continued to it.
        """
        wall = self.hole.radius * np.exp(1j * angle) + self.hole.center
        cells = np.unique(self.cell)
        size = self.grid.cell_size.values[cells]
        cells = cells[size < 1.5 * self.hole.cell]
        corner = self.grid.cell_origin.values[cells, :2]
        at = np.stack([wall.real, wall.imag], axis=1)
        found = cKDTree(corner + 0.5 * self.hole.cell).query(at, p=np.inf)[1]
        x, y = ((at - corner[found]) / self.hole.cell).T
        shape = np.stack([(1 - x) * (1 - y), x * (1 - y), x * y, (1 - x) * y], axis=1)
        return np.sum(shape * self.node_moved[self.cell_nodes[cells[found]]], axis=1)

    def fitted_stress(self, points: np.ndarray, degree: int, cells: int, clear: float = 0.0) -> np.ndarray:
        """Polar stress (3, point), Pa, at points (complex, from the centre) from the particles around each.

        A polynomial in x and y of this degree is fitted by least squares to the particles of so many nearest uncut
        cells, at least `clear` metres from the wall. The fit uses neither the hole's shape nor the exact field, so a
        user can do it at any wall.
        """
        usable = np.flatnonzero(self.whole & (self.distance >= self.hole.radius + clear))
        tree = cKDTree(np.stack([self.place[usable].real, self.place[usable].imag], axis=1))
        count = cells * self.hole.particles_per_cell
        near = usable[tree.query(np.stack([points.real, points.imag], axis=1), k=count)[1]]
        away = (self.place[near] - points[:, None]) / self.hole.cell
        powers = [(i, j) for i in range(degree + 1) for j in range(degree + 1 - i)]  # The constant term stands first.
        terms = np.stack([away.real**i * away.imag**j for i, j in powers], axis=2)
        at_point = np.linalg.pinv(terms)[:, 0, :]
        xx, yy, xy = np.einsum("pk,pkc->cp", at_point, self.stress[near])
        return np.array(polar_stress(xx, yy, xy, np.angle(points)))


def mean_square_root(error: np.ndarray, weights: np.ndarray | None = None) -> np.ndarray:
    """Weighted root mean square along the last axis."""
    return np.sqrt(np.average(np.square(error), axis=-1, weights=weights))
