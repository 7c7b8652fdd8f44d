"""Rock around the hole of Kirsch's scene, compared with the exact field of the boxed plate, and its convergence.

A cut wall disturbs the cells beside it in the same pattern whatever their size, so stress at the wall converges slowly
as cells are halved.
"""

from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
from scipy.spatial import cKDTree

from verification.answers.kirsch.closed_form import BoxedPlate, Field, InfinitePlate, PressedPlate, polar_stress
from verification.comparisons import bounded, convergence_orders, in_uncut_cell, mean_square_root, vanishing
from verification.results import Results, Variant
from verification.rows import Row

ANGLES = 2 * np.pi * (np.arange(360) + 0.5) / 360
CLEAR_CELLS = 1.0  # Cells next to the wall that the extrapolation leaves out.


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
        self.state = state
        present = state.volume.values > 0.0
        self.volume, self.cell = state.volume.values[present], state.cell.values[present]
        self.place = state.position.values[present, :2] @ np.array([1.0, 1.0j]) - self.hole.center
        self.stress = state.stress.values[present][:, [0, 1, 5]]
        self.moved = state.displacement.values[present, :2] @ np.array([1.0, 1.0j])
        self.cell_nodes = state.cell_nodes.values  # They include the phantom nodes of walls.
        self.node_moved = state.node_displacement.values[:, :2] @ np.array([1.0, 1.0j])
        size = self.grid.cell_size.values[self.cell] ** 2 * self.grid.attrs["thickness"]
        self.whole = in_uncut_cell(self.cell, self.volume, size)
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


@dataclass(frozen=True)
class Point:
    """R.m.s. errors of one grid around the hole. cell: the finest, m.

    closure: of the wall's inward displacement, over its mean. mean_closure: signed error of that mean. stress: of
    radial and hoop stress at a distance, over the far stress. wall: of the hoop stress in particles within a cell of
    the wall, each compared at its own place, over the mean at the wall. extrapolated: the same of a fit to particles
    farther out, at the wall.
    """

    cell: float
    closure: float
    mean_closure: float
    stress: float
    wall: float
    extrapolated: float


def interpolated(rock: Rock, points: np.ndarray) -> np.ndarray:
    """Polar stress (3, point), Pa, inside the rock: a plane fitted to the four cells around each point."""
    return rock.fitted_stress(points, degree=1, cells=4)


def extrapolated(rock: Rock, points: np.ndarray) -> np.ndarray:
    """Polar stress (3, point), Pa, at the wall: a quadratic fitted to fifteen cells beyond CLEAR_CELLS."""
    return rock.fitted_stress(points, degree=2, cells=15, clear=CLEAR_CELLS * rock.hole.cell)


def measure(rock: Rock, distance: float) -> Point:
    """Errors of a run. distance: at which stress is compared, radii."""
    hole, around = rock.hole, np.exp(1j * ANGLES)
    wall = hole.radius * around
    exact = hole.plate.at(wall)
    inward = -(rock.wall_displacement(ANGLES) / around).real
    true_inward = -exact.polar_displacement(ANGLES)[0]
    wall_hoop = exact.polar_stress(ANGLES)[1]
    hoop = np.abs(wall_hoop.mean())
    away = interpolated(rock, distance * wall) - hole.plate.at(distance * wall).polar_stress(ANGLES)
    beside = rock.between(0.0, hole.radius + hole.cell)
    error = rock.polar[1, beside] - rock.exact(beside).polar_stress(rock.angle[beside])[1]
    return Point(
        cell=hole.cell,
        closure=float(mean_square_root(inward - true_inward) / true_inward.mean()),
        mean_closure=float(inward.mean() / true_inward.mean() - 1.0),
        stress=float(mean_square_root(away[:2].ravel()) / hole.far_stress),
        wall=float(mean_square_root(error, rock.volume[beside]) / hoop),
        extrapolated=float(mean_square_root(extrapolated(rock, wall)[1] - wall_hoop) / hoop),
    )


def read_series(results: Results) -> dict[str, list[Point]]:
    """Points by treatment of cut cells, from coarse to fine."""
    distance = results.settings["stress_distance"]
    series = {
        method: [measure(Rock(results[name]), distance) for name in results.present(names)]
        for method, names in results.settings["series"].items()
    }
    return {method: sorted(points, key=lambda point: -point.cell) for method, points in series.items() if points}


def order(points: list[Point], name: str) -> float:
    """Order of convergence of an error over a series: slope of its logarithm by least squares."""
    return float(np.polyfit(np.log([p.cell for p in points]), np.log([getattr(p, name) for p in points]), 1)[0])


def order_rows(series: dict[str, list[Point]], least: float, distance: float) -> list[Row]:
    """Orders of closure and of stress at a distance, and the mean closure of the finest, for each treatment."""
    rows = []
    for method, points in series.items():
        span = f"h {points[0].cell:g} to {points[-1].cell:g} m"
        for name, what in (("closure", "closure of the wall"), ("stress", f"stress at r = {distance:g} a")):
            found = order(points, name)
            errors = [getattr(point, name) for point in points]
            orders = convergence_orders([point.cell for point in points], errors)
            halvings = ", ".join(f"{order:.2f}" for order in orders)
            remark = (
                f"r.m.s. errors {', '.join(f'{100 * error:.2f}' for error in errors)} %; halving by halving {halvings}"
            )
            quantity = f"{method}: order of convergence, {what}, {span}"
            rows.append(Row.at_least(quantity, found, least, remark))
        means = [point.mean_closure for point in points]
        remark = f"{', '.join(f'{100 * mean:+.2f}' for mean in means)} % from coarse to fine"
        quantity = f"{method}: mean closure over the exact one, h = {points[-1].cell:g} m"
        rows.append(Row(quantity, 1.0, 1.0 + means[-1], abs(means[-1]), remark=remark))
    return rows


def wall_rows(series: dict[str, list[Point]], cell: float, method: str, allowed: float) -> list[Row]:
    """Rows of the hoop stress at the wall on every grid; on those of one cell size it is extrapolated to the wall.

    method: treatment of cut cells that is extrapolated. allowed: extrapolated error over the least of the others.
    """
    rows = []
    for name, points in series.items():
        for point in points:
            quantity = f"{name}: hoop stress within a cell of the wall, h = {point.cell:g} m, r.m.s. share"
            rows.append(vanishing(quantity, point.wall))
    found = {name: point for name, points in series.items() for point in points if np.isclose(point.cell, cell)}
    if method in found:
        best = min(point.wall for point in found.values())
        error = found[method].extrapolated
        coarser = ", ".join(f"{100 * point.extrapolated:.1f} % at {point.cell:g} m" for point in series[method])
        quantity = f"{method}, extrapolated: hoop stress of the wall, h = {cell:g} m, r.m.s. share"
        rows.append(vanishing(quantity, error, remark=f"by cell: {coarser}"))
        quantity = f"{method}: extrapolated over the best error within a cell of the wall, h = {cell:g} m"
        rows.append(bounded(quantity, error / best, allowed))
    return rows
