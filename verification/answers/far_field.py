"""Derived domains against wider ones: change of wall stress by the boundary, and by the grading of cells."""

from functools import cached_property

import numpy as np
import xarray as xr
from matplotlib.figure import Figure
from scipy.spatial import cKDTree

from catalogs.figures import style
from common.voigt import tensor_from_voigt
from verification.answers.kirsch.closed_form import InfinitePlate
from verification.cavities.cavity import inclusion_of
from verification.comparisons import in_uncut_cell, tensor_error, vanishing
from verification.plots import plot_errors, plot_series
from verification.results import Results, Variant
from verification.rows import Row

MAX_PLACE_DIFFERENCE = 1e-3  # Particles of two grids closer than so many cells are the same.
DRAWN_BOUND = 0.5  # Of the boundary's share in wall stress, %.
CLEAR_CELLS = 2.0  # Cells next to the wall that the comparison with theory leaves out.


class Rock:
    """Particles of rock in uncut cells: place (particle, 3) m, stress (particle, 3, 3) Pa, volume m3, cell size m."""

    def __init__(self, variant: Variant):
        self.variant, self.grid = variant, variant.grid
        state, self.cell = variant.elastic, float(variant.grid.attrs["fine_cell"])
        self.dimension = variant.mine.dimension
        present = np.flatnonzero(state.volume.values > 0.0)
        cells = state.cell.values[present]
        size = self.grid.cell_size.values
        whole = size**self.dimension * (self.grid.attrs["thickness"] if self.dimension == 2 else 1.0)
        uncut = in_uncut_cell(cells, state.volume.values[present], whole[cells])
        present, cells = present[uncut], cells[uncut]
        self.place = state.position.values[present]
        self.stress = tensor_from_voigt(state.stress.values[present])
        self.volume, self.cells = state.volume.values[present], cells

    @cached_property
    def off_wall(self) -> np.ndarray:
        """Largest component (particle,) of the distance from each cell to the nearest mined or cut cell, m."""
        center = self.grid.cell_origin.values + 0.5 * self.grid.cell_size.values[:, None]
        mined = np.unique(self.grid.piece_origin.values, axis=0) + 0.5 * self.cell
        axes = self.variant.scene().axes
        return cKDTree(mined[:, axes]).query(center[self.cells][:, axes], p=np.inf)[0]

    def beside_wall(self, cells: float) -> np.ndarray:
        """Indices of particles in finest cells within so many cells from the wall."""
        finest = self.grid.cell_size.values[self.cells] < 1.5 * self.cell
        return np.flatnonzero(finest & (self.off_wall < (cells + 0.5) * self.cell))

    @property
    def far_stress(self) -> float:
        """Largest virgin stress, Pa."""
        return max(abs(value) for value in self.variant.values["insitu_stress"]["constant"].values())


def largest_difference(one: Rock, other: Rock, cells: float) -> tuple[float, int]:
    """Largest difference of a stress component beside the wall over the largest principal stress; count of particles.

    Raises ValueError where the two grids differ there.
    """
    beside = one.beside_wall(cells)
    distance, same = cKDTree(other.place).query(one.place[beside])
    if distance.max() > MAX_PLACE_DIFFERENCE * one.cell:
        raise ValueError(f"cells at the wall differ by {distance.max():g} m: the domains must be aligned")
    largest = np.abs(np.linalg.eigvalsh(one.stress[beside])).max()
    return float(np.abs(one.stress[beside] - other.stress[same]).max() / largest), len(beside)


def answer(results: Results) -> tuple[list[Row], Figure]:
    """Rows and figure of the study."""
    allowed, settings = results.allowed, results.settings
    cells, wider, graded = settings["wall_cells"], settings["wider"], settings["graded"]
    rocks = {name: Rock(variant) for name, variant in results.variants.items()}
    rows, shares = [], {}
    for name, rock in rocks.items():
        if f"{name}{wider}" in rocks:
            wide = rocks[f"{name}{wider}"]
            widths = [np.subtract(one.variant.values["domain"]["upper"], one.variant.values["domain"]["lower"])
                      for one in (rock, wide)]  # fmt: skip
            twice = float((widths[1] / widths[0]).min())
            rows.append(Row.absolute(f"{name}: width of the wider domain over the derived one", 2.0, twice, 0.0))
            difference, count = largest_difference(rock, wide, cells)
            moved = difference / (1 - 0.5**rock.dimension)
            attributes = rock.grid.attrs
            expected = float(attributes["far_field_error"]) / 100
            shares[name] = (moved, expected)
            remark = (
                f"{count} particles; boundary {attributes['far_field_distance']:g} m off, {rock.grid.sizes['cell']} "
                f"cells, {wide.grid.sizes['cell']} in the wider one"
            )
            quantity = f"{name}: what the boundary moves of the wall's stress, share of the largest"
            rows.append(vanishing(quantity, moved, allowed["boundary"], remark))
            quantity = f"{name}: the same over what the rule expects of this domain"
            rows.append(Row(quantity, 1.0, moved / expected, moved / expected, allowed["over_estimate"]))
        if f"{name}{graded}" in rocks:
            fine = rocks[f"{name}{graded}"]
            difference, count = largest_difference(rock, fine, cells)
            remark = f"{rock.grid.sizes['cell']} and {fine.grid.sizes['cell']} cells"
            quantity = f"{name}: wall stress against twice the rings on each level, largest difference, share"
            rows.append(vanishing(quantity, difference, allowed["rings"], remark))
    for name, rock in rocks.items():
        if is_round(rock.variant) and not name.endswith(graded):
            rows.append(theory_row(name, rock, settings["outer_radii"], allowed["stress"]))
    return rows, draw(rocks, shares)


def is_round(variant: Variant) -> bool:
    """True if the variant has a closed form: its opening is one circle or one sphere."""
    return len(variant.values["excavations"]) == 1 and "radius" in variant.values["excavations"][0]


def theory_row(name: str, rock: Rock, outer_radii: float, allowed: float) -> Row:
    """R.m.s. error of the stress against that of infinite rock, beyond CLEAR_CELLS of the wall, by volume."""
    radius = rock.variant.values["excavations"][0]["radius"]
    distance = np.linalg.norm(rock.place, axis=1)
    ring = (distance > radius + CLEAR_CELLS * rock.cell) & (distance < outer_radii * radius)
    place, stress, weights = rock.place[ring], rock.stress[ring], rock.volume[ring]
    if rock.dimension == 3:
        error = tensor_error(stress - inclusion_of(rock.variant).stress(place), weights)
    else:
        constant = rock.variant.values["insitu_stress"]["constant"]
        virgin = tuple(constant.get(component, 0.0) for component in ("xx", "yy", "xy"))
        exact = InfinitePlate(radius, virgin, 1.0, 0.25).at(place[:, 0] + 1j * place[:, 1])
        found = stress[:, [0, 1, 0], [0, 1, 1]].T
        square = np.square(found - np.array([exact.xx, exact.yy, exact.xy])).sum(axis=0) / 3
        error = float(np.sqrt(np.average(square, weights=weights)))
    span = f"a + 2 h to {outer_radii:g} a"
    quantity = f"{name}: stress beside that of infinite rock, {span}, r.m.s. share of the far stress"
    return vanishing(quantity, error / rock.far_stress, allowed)


def draw(rocks: dict[str, Rock], shares: dict[str, tuple[float, float]]) -> Figure:
    """Change of wall stress by the boundaries with the expected change, and number of cells by size."""
    figure = style.new_figure(height=3.8)
    left, right = figure.subplots(1, 2)
    moved, expected = (100 * np.array(column) for column in zip(*shares.values(), strict=True))
    names = [name.replace("_", " ") for name in shares]
    series = {"moved, largest of any component": moved, "expected by the rule": expected}
    labels: dict = {
        "title": "What the boundary moves of wall stress",
        "xlabel": "share of the largest (%; line: bound)",
    }
    plot_errors(left, names, series, truth=DRAWN_BOUND, legend="upper center", **labels)
    left.set(xlim=(0.0, 1.3 * DRAWN_BOUND), ylim=(len(names) - 0.5, -0.4 * len(names)))  # The legend stands above.
    drawn: dict[str, xr.Dataset] = {}
    for name in shares:  # Variants that differ in stress share their cells.
        drawn.setdefault(name.split("_")[0], rocks[name].grid)
    counts = {name: np.unique(grid.cell_size.values, return_counts=True) for name, grid in drawn.items()}
    labels = {"title": "Cells by their size", "xlabel": "edge (m)", "ylabel": "cells"}
    plot_series(right, counts, marks="o-", xscale="log", yscale="log", **labels)
    return figure
