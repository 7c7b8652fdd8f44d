"""Rock of a pressed disc while it is elastic, compared with Hondros' field."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from verification.answers.brazilian_disc.closed_form import (
    Disc,
    FirstFailure,
    PeakStrength,
    first_failure,
    plane_strain,
)
from verification.comparisons import MIN_UNCUT_SHARE
from verification.results import Variant

MIN_SOUND_SHARE = 0.5  # Share of rock from which a cell fails by its own stress. Cells with less are crumbs.
IN_PLANE = [0, 1, 5]  # Places of xx, yy and xy among six components.
# Share of the radius within which stress is compared: the load acts on a layer of cells, the exact one on the rim.
COMPARED_RADIUS_SHARE = 0.9
CENTRAL_CELLS = 1.0  # Stress at the centre is the mean over so many cells in each direction.


@dataclass(frozen=True)
class Loading:
    """Resultant of the forces on each arc, N: that before the first step, and those added by step."""

    before: float
    added: dict[str, float]


def means_by(key: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Distinct keys (k,) in order, and the mean of the values (particle, n) of each: (k, n)."""
    keys, number = np.unique(key, return_inverse=True)
    count = np.bincount(number)
    return keys, np.stack([np.bincount(number, column) / count for column in values.T], axis=1)


class PressedDisc:
    """A variant of the study: the disc, its loading, and the elastic state of its particles of rock.

    place (particle, 2) m from the centre in the plane of the disc; volume (particle,) m3; stress (particle, 6) Pa;
    cell (particle,); whole, sound (particle,) bool: in an uncut cell, in a cell at least half rock.
    """

    def __init__(self, name: str, variant: Variant):
        self.name, self.variant = name, variant
        values = variant.values
        self.flat: bool = values["plane"] == "xy"
        space, rock = values["excavations"][0], values["materials"]["host"]
        self.center = np.array((space["center"] if self.flat else space["start"])[:2])
        thickness = values["thickness"] if self.flat else abs(space["end"][2] - space["start"][2])
        self.disc = Disc(space["radius"], thickness, self._half_arc(values["loads"]))
        self.youngs_modulus, self.poisson_ratio = rock["youngs_modulus"], rock["poisson_ratio"]
        self.strength = PeakStrength.of(rock)
        residual = np.sin(np.radians(rock["dilation_angle"]["residual"]))
        self.dilation_factor = (1.0 + residual) / (1.0 - residual)
        self.loading = self._loading(values["loads"])
        self.cell_size = values["grid"]["coarse_cell"] / 2 ** (values["grid"]["levels"] - 1)
        state = variant.elastic
        self.present = state.volume.values > 0.0
        self.place = state.position.values[self.present, :2] - self.center
        self.volume = state.volume.values[self.present]
        self.stress = state.stress.values[self.present]
        self.cell = state.cell.values[self.present]
        full = self.cell_size**2 * (thickness if self.flat else self.cell_size)
        share = np.bincount(self.cell, self.volume)[self.cell] / full
        self.whole, self.sound = share > MIN_UNCUT_SHARE, share >= MIN_SOUND_SHARE

    def text_of(self, step: str, share: float) -> str:
        """Load as text, after this share of a step's load."""
        return f"{1e-3 * (self.loading.before + self.loading.added[step] * share):.2f} kN"

    def _outline(self, load: dict) -> np.ndarray:
        return np.array(load["points" if self.flat else "polygon"])[:, :2] - self.center

    def _half_arc(self, loads: list[dict]) -> float:
        """Largest angle from the y axis that a loaded shape reaches, rad."""
        corners = np.abs(np.concatenate([self._outline(load) for load in loads]))
        return float(np.arctan2(*corners.T).max())

    def _loading(self, loads: list[dict]) -> Loading:
        """Forces on the lower arc (the upper one's are their images), summed along y."""
        resultant: dict[str, float] = {}
        for load in loads:
            if self._outline(load)[:, 1].mean() < 0.0:
                size = load["force"] / self.disc.size_of_load(1.0) if "toward" in load else load["force"][1]
                resultant[load["step"]] = resultant.get(load["step"], 0.0) + size
        first = self.variant.mine.steps[0].name
        return Loading(resultant.pop(first), resultant)

    @property
    def pressure(self) -> float:
        """Pressure on the arcs in the elastic state, Pa."""
        return self.disc.pressure(self.loading.before)

    @cached_property
    def exact(self) -> np.ndarray:
        """Hondros' in-plane stress (particle, 3) at the particles, Pa."""
        return self.disc.stress(self.place, self.pressure)

    def cell_means(self, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Means over uncut cells of particle values (particle, k): cells (cell,), means (cell, k), all of one size."""
        return means_by(self.cell[self.whole], values[self.whole])

    def centre_stress(self) -> tuple[np.ndarray, np.ndarray]:
        """Found and exact in-plane stress (3,), Pa: means over cells at the centre, in 3-D through the thickness."""
        near = (np.abs(self.place) < CENTRAL_CELLS * self.cell_size).all(axis=1)
        return self.stress[near][:, IN_PLANE].mean(axis=0), self.exact[near].mean(axis=0)

    def field_error(self) -> float:
        """R.m.s. error of cell means within COMPARED_RADIUS_SHARE of the radius, over the r.m.s. stress there."""
        found, exact, place = (
            self.cell_means(values)[1] for values in (self.stress[:, IN_PLANE], self.exact, self.place)
        )
        inside = np.hypot(*place.T) <= COMPARED_RADIUS_SHARE * self.disc.radius
        twice = np.array([1.0, 1.0, 2.0])  # Shear stands twice in a tensor.
        return float(np.sqrt(np.sum(twice * (found - exact)[inside] ** 2) / np.sum(twice * exact[inside] ** 2)))

    def widening(self) -> tuple[float, float]:
        """Found and exact growth of the diameter across the load, m; the exact one in plane strain."""
        moved = self.variant.elastic.node_displacement.values[:, 0]
        place = self.variant.grid.node_position.values[:, :2] - self.center
        ends = [moved[np.argmin(np.hypot(place[:, 0] - side * self.disc.radius, place[:, 1]))] for side in (1.0, -1.0)]
        return ends[0] - ends[1], self.disc.widening(self.pressure, self.youngs_modulus, self.poisson_ratio)

    def first_failure(self) -> tuple[FirstFailure, FirstFailure]:
        """Found and exact load and place of first failure. Elastic stress is proportional to the load."""
        factor = np.where(self.sound, self.strength.load_factor(self.stress), np.inf)
        first = int(np.argmin(factor))
        found = FirstFailure(float(self.loading.before * factor[first]), tuple(np.abs(self.place[first]).tolist()))
        return found, first_failure(self.disc, self.poisson_ratio, self.strength)

    def along_diameter(self) -> tuple[np.ndarray, np.ndarray]:
        """Particles of the two columns of cells at the loaded diameter, by height y (m): y (k,), stress (k, 6) Pa.

        Means over particles at one height, across the diameter and through the thickness.
        """
        near = np.flatnonzero(np.abs(self.place[:, 0]) < 1.01 * self.cell_size)
        return means_by(np.round(self.place[near, 1], 9), self.stress[near])

    def exact_along_diameter(self, height: np.ndarray) -> np.ndarray:
        """Exact stress (k, 6) Pa in plane strain on the loaded diameter at heights (k,) m."""
        place = np.stack([np.zeros_like(height), height], axis=1)
        return plane_strain(self.disc.stress(place, self.pressure), self.poisson_ratio)
