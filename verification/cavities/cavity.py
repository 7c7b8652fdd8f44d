"""Rock around a tunnel or a spherical cavity: a state in the coordinates of its closed form."""

from functools import cached_property

import numpy as np
import xarray as xr
from scipy.spatial import cKDTree

from common.voigt import tensor_from_voigt
from verification.cavities.coulomb import CoulombRock, PlasticRing, PlasticSphere, PlasticTunnel
from verification.cavities.hoek_brown import HoekBrownRock, HoekBrownTunnel
from verification.cavities.inclusion import Elastic, SphericalInclusion
from verification.results import Variant

WALL_ANGLES = 90  # Points on a quarter of a circle; its square on an eighth of a sphere.


def read_pressure(variant: Variant) -> float:
    """Largest virgin compression of a variant, Pa (positive)."""
    return -min(variant.values["insitu_stress"]["constant"].values())


def plastic_ring(variant: Variant) -> PlasticRing | HoekBrownTunnel:
    """The closed form of a variant under all-round stress: a tunnel in plane strain, a sphere in space."""
    hole, host = variant.values["excavations"][0], variant.values["materials"]["host"]
    if host["model"] == "hoek_brown":
        return HoekBrownTunnel(
            hole["radius"], read_pressure(variant), HoekBrownRock.of(host), hole.get("pressure", 0.0)
        )
    kind = PlasticTunnel if variant.mine.plane else PlasticSphere
    return kind(hole["radius"], read_pressure(variant), CoulombRock.of(host))


def inclusion_of(variant: Variant) -> SphericalInclusion:
    """The closed form of a variant with an elastic sphere, empty or filled."""
    values = variant.values
    hole, constant = values["excavations"][0], values["insitu_stress"]["constant"]
    materials = {
        name: Elastic(material["youngs_modulus"], material["poisson_ratio"])
        for name, material in values["materials"].items()
    }
    virgin = np.diag([constant.get(name, 0.0) for name in ("xx", "yy", "zz")])
    fill = hole.get("fill", "none")
    inclusion = {} if fill == "none" else {"inclusion": materials[fill]}
    return SphericalInclusion(hole["radius"], virgin, materials["host"], **inclusion)


class Cavity:
    """Particles and nodes around the first excavation, in the quarter or eighth above its centre.

    Arrays hold the particles with a volume: place (particle, 3) m from the centre, distance m, volume m3, stress
    (particle, 3, 3) Pa, failed and fill (bool). cell: edge of the finest cell, m. dimension: 2 or 3.
    """

    def __init__(self, variant: Variant, state: xr.Dataset):
        hole = variant.values["excavations"][0]
        self.radius, self.dimension = hole["radius"], variant.mine.dimension
        self.grid, self.state = variant.grid, state
        self.cell = float(self.grid.attrs["fine_cell"])
        center = np.zeros(3)
        center[: self.dimension] = hole["center"]
        self.center = center
        present = state.volume.values > 0.0
        self.place = state.position.values[present] - center
        self.distance = np.linalg.norm(self.place, axis=1)
        self.volume = state.volume.values[present]
        self.failed = state.failed.values[present] >= 0
        self.fill = state.excavation.values[present] >= 0
        self.particle_cell = state.cell.values[present]
        self.stress = tensor_from_voigt(state.stress.values[present])

    @cached_property
    def radial_hoop_third(self) -> np.ndarray:
        """Radial, hoop and third normal stress (3, particle), Pa. The third is axial in a tunnel, hoop at a sphere."""
        outward = self.place / self.distance[:, None]
        radial = np.einsum("pi,pij,pj->p", outward, self.stress, outward)
        rest = np.trace(self.stress, axis1=1, axis2=2) - radial
        if self.dimension == 2:
            axial = self.stress[:, 2, 2]
            return np.array([radial, rest - axial, axial])
        return np.array([radial, 0.5 * rest, 0.5 * rest])

    def ring(self, outer_radii: float) -> np.ndarray:
        """Indices of the rock particles between two cells off the wall and so many radii."""
        inner, outer = self.radius + 2 * self.cell, outer_radii * self.radius
        return np.flatnonzero(~self.fill & (self.distance >= inner) & (self.distance <= outer))

    def wall_directions(self) -> np.ndarray:
        """Unit vectors (point, 3) evenly over the wall of the quarter or eighth, none on its edges."""
        middle = (np.arange(WALL_ANGLES) + 0.5) / WALL_ANGLES
        if self.dimension == 2:
            angle = 0.5 * np.pi * middle
            return np.stack([np.cos(angle), np.sin(angle), np.zeros(WALL_ANGLES)], axis=1)
        height, angle = (axis.ravel() for axis in np.meshgrid(middle, 0.5 * np.pi * middle))
        across = np.sqrt(1 - height**2)  # Zones of equal height on a sphere have equal areas.
        return np.stack([across * np.cos(angle), across * np.sin(angle), height], axis=1)

    def displacement(self, points: np.ndarray) -> np.ndarray:
        """Displacement (point, 3) m at points (point, 3) m from the centre, by the shape functions of the nearest cell.

        Only finest cells with rock are taken. Where a point lies outside its cell, the functions are continued to it.
        """
        d, grid = self.dimension, self.grid
        cells = np.unique(self.particle_cell)
        cells = cells[grid.cell_size.values[cells] < 1.5 * self.cell]
        corner = grid.cell_origin.values[cells, :d]
        at = (points + self.center)[:, :d]
        found = cKDTree(corner + 0.5 * self.cell).query(at, p=np.inf)[1]
        local = (at - corner[found]) / self.cell
        nodes = self.state.cell_nodes.values[cells[found]]
        side = self.state.node_position.values[nodes][..., :d] > (corner[found] + 0.5 * self.cell)[:, None, :]
        shape = np.where(side, local[:, None, :], 1 - local[:, None, :]).prod(axis=2)
        return np.einsum("pc,pci->pi", shape, self.state.node_displacement.values[nodes])

    def wall_displacement(self, directions: np.ndarray) -> np.ndarray:
        """Outward displacement (point,) m of the wall in these directions (point, 3)."""
        return (self.displacement(self.radius * directions) * directions).sum(axis=1)

    @property
    def closure(self) -> float:
        """Mean inward displacement of the wall, m."""
        return -float(self.wall_displacement(self.wall_directions()).mean())

    @property
    def failed_radius(self) -> float:
        """Outer radius, m, of a full ring that has the failed volume."""
        d, share = self.dimension, 0.5**self.dimension
        unit = share * (np.pi if d == 2 else 4 / 3 * np.pi)
        volume = self.volume[self.failed].sum() / (self.grid.attrs["thickness"] if d == 2 else 1.0)
        return float((volume / unit + self.radius**d) ** (1 / d))

    def failed_percentile(self, percent: float) -> float:
        """Distance, m, within which so many percent of the failed volume lie; the wall's where nothing failed."""
        if not self.failed.any():
            return self.radius
        order = np.argsort(self.distance[self.failed])
        distance, volume = self.distance[self.failed][order], self.volume[self.failed][order]
        return float(np.interp(percent / 100 * volume.sum(), np.cumsum(volume) - 0.5 * volume, distance))

    def failed_share(self, outer: float) -> float:
        """Share of the rock within `outer` m of the centre that has failed."""
        inside = self.distance <= outer
        return float(self.volume[inside & self.failed].sum() / self.volume[inside].sum())
