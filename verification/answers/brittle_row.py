"""One row of brittle cells, in which failure cannot localise: failed depth, residual stress and closure.

A column of Coulomb rock between smooth rigid sides whose top is mined: failed depth, stress and closure by hand.

Uniaxial strain, x and y held, z down from the new free face as depth d (m). The virgin stress is linear in depth; its
gradient along z is the weight. Whatever fails, the vertical stress is the weight above: statically determined. So

    zz(d) = g_z d                                                                  all rock
    xx(d) = virgin + nu / (1 - nu) (zz - virgin zz), yy likewise                   elastic rock
    N zz - xx > sigma_c (intact)                                                   fails: linear in d, to one depth
    xx(d) = N zz - sigma_c, yy = virgin + nu (change of xx + change of zz)         failed on the face of x and z
                            yy = xx if both are virgin equals                      failed on the edge
    e_z = elastic e_z + N_psi (elastic e_x + elastic e_y)                          failed: e_x = e_y = 0 in total

(residual N and sigma_c in failed rock), and the face rises by the integral of e_z. Failure of one cell does not depend
on another, so it does not localise. Stress and strain are tension positive.
"""

from dataclasses import dataclass

import numpy as np
from matplotlib.figure import Figure

from catalogs.figures import style
from verification.cavities.coulomb import CoulombRock
from verification.comparisons import MPA, vanishing
from verification.plots import plot_series
from verification.results import Results, Variant
from verification.rows import Row


@dataclass(frozen=True)
class BrittleRow:
    """rock; face, gradient (3,) virgin xx, yy, zz at the new free face (Pa) and their change per metre of depth (Pa/m).

    xx is the most compressive after unloading; yy equals it in virgin rock, or stays intermediate throughout.
    """

    rock: CoulombRock
    face: np.ndarray
    gradient: np.ndarray

    @property
    def _aside(self) -> float:
        """nu / (1 - nu): change of side stress over that of vertical stress, elastic."""
        return self.rock.poisson_ratio / (1 - self.rock.poisson_ratio)

    @property
    def failed_depth(self) -> float:
        """Depth to which intact strength is exceeded, m; 0 where the face itself stands."""
        rock = self.rock
        at_face = -self.face[0] + self._aside * self.face[2] - rock.intact_strength  # N zz - xx - sigma_c at d = 0
        per_metre = rock.intact_friction * self.gradient[2] - self.gradient[0]
        return max(0.0, float(-at_face / per_metre))

    def stress(self, depth: np.ndarray) -> np.ndarray:
        """xx, yy, zz (3, point) Pa at depths (point,) m below the new face."""
        depth = np.asarray(depth, float)
        virgin = self.face[:, None] + self.gradient[:, None] * depth
        zz = self.gradient[2] * depth
        xx, yy = virgin[:2] + self._aside * (zz - virgin[2])
        failed = depth < self.failed_depth
        residual = self.rock.residual_friction * zz - self.rock.residual_strength
        if self.face[0] == self.face[1] and self.gradient[0] == self.gradient[1]:
            beside = residual
        else:
            beside = virgin[1] + self.rock.poisson_ratio * (residual - virgin[0] + zz - virgin[2])
        return np.array([np.where(failed, residual, xx), np.where(failed, beside, yy), zz])

    def vertical_strain(self, depth: np.ndarray) -> np.ndarray:
        """e_z (point,) since virgin."""
        depth = np.asarray(depth, float)
        change = self.stress(depth) - self.face[:, None] - self.gradient[:, None] * depth
        nu = self.rock.poisson_ratio
        elastic = ((1 + nu) * change - nu * change.sum(axis=0)) / self.rock.youngs_modulus
        plastic = self.rock.dilation * (elastic[0] + elastic[1])
        return elastic[2] + np.where(depth < self.failed_depth, plastic, 0.0)

    def rise(self, length: float) -> float:
        """Upward displacement of the free face, m, of a column of this length (m) on a rigid base.

        Strain is linear in depth within failed and within intact rock: the middle of each times its length is exact.
        """
        failed = min(self.failed_depth, length)
        middles = np.array([0.5 * failed, 0.5 * (failed + length)])
        return float(np.dot(self.vertical_strain(middles), [failed, length - failed]))


def exact_row(variant: Variant) -> BrittleRow:
    """The closed form of a variant."""
    values = variant.values
    stress, depth = values["insitu_stress"], values["frame"]["surface"] - face_elevation(variant)
    constant, gradient = (
        np.array([stress[key].get(name, 0.0) for name in ("xx", "yy", "zz")]) for key in ("constant", "gradient")
    )
    return BrittleRow(CoulombRock.of(values["materials"]["host"]), constant + gradient * depth, gradient)


def face_elevation(variant: Variant) -> float:
    """Elevation of the new free face: the bottom of what is mined, m."""
    return variant.values["excavations"][0]["lower"][-1]


def answer(results: Results) -> tuple[list[Row], Figure]:
    """Rows and figure of the study."""
    rows = []
    figure = style.new_figure(height=4.2)
    panels = figure.subplots(1, len(results.variants), squeeze=False)[0]
    for axes, (name, variant) in zip(panels, results.variants.items(), strict=True):
        exact, state = exact_row(variant), variant.last
        rows += compare(name, variant, exact, state, results.allowed)
        draw(axes, name, variant, exact, state)
    return rows, figure


def compare(name: str, variant: Variant, exact: BrittleRow, state, allowed: dict[str, float]) -> list[Row]:
    """Failed depth, stress and rise of the face of one variant."""
    present = state.volume.values > 0.0
    face = face_elevation(variant)
    depth = face - state.position.values[present, 2]
    failed = state.failed.values[present] >= 0
    cell = float(variant.grid.attrs["fine_cell"])
    length = face - variant.values["domain"]["lower"][-1]
    volume = state.volume.values[present]
    found = float(volume[failed].sum() / volume.sum()) * length
    block = "one block below the face" if contiguous(depth, failed) else "NOT one block below the face"
    off, remark = abs(found - exact.failed_depth) / cell, f"error in cells of {cell:g} m; {block}"
    rows = [Row(f"{name}: failed depth, m", exact.failed_depth, found, off, allowed["depth_cells"], remark)]
    error = state.stress.values[present][:, :3].T - exact.stress(depth)
    size = exact.rock.residual_strength
    for part, where in (("failed", failed), ("intact", ~failed)):
        worst = float(np.sqrt(np.mean(error[:, where] ** 2)) / size)
        quantity = f"{name}: stress of {part} rock, r.m.s. of xx, yy, zz, share of the residual uniaxial strength"
        rows.append(vanishing(quantity, worst, allowed["stress"]))
    nodes = variant.grid.node_position.values[:, 2]
    at_face = np.abs(nodes - face) < 1e-6 * cell
    rise = float(state.node_displacement.values[at_face, 2].mean())
    rows.append(Row.relative(f"{name}: rise of the face, mm", 1e3 * exact.rise(length), 1e3 * rise, allowed["closure"]))
    return rows


def contiguous(depth: np.ndarray, failed: np.ndarray) -> bool:
    """True if all failed particles lie above all intact ones. depth (particle,) m, failed (particle,) bool."""
    return bool(not failed.any() or failed.all() or depth[failed].max() < depth[~failed].min())


def draw(axes, name: str, variant: Variant, exact: BrittleRow, state) -> None:
    """Stress against depth with the exact lines."""
    present = state.volume.values > 0.0
    depth = face_elevation(variant) - state.position.values[present, 2]
    lines = np.linspace(0.0, depth.max(), 800)
    theory, found, components = exact.stress(lines), state.stress.values[present].T, ("xx", "yy", "zz")
    axes.axhline(exact.failed_depth, color=style.OUTLINE, linestyle=":", linewidth=0.8)
    plot_series(
        axes,
        {component: (found[i] * MPA, depth) for i, component in enumerate(components)},
        {component: (theory[i] * MPA, lines) for i, component in enumerate(components)},
        title=f"{name}: above the dotted line rock has failed",
        xlabel="stress (MPa), lines exact",
        ylabel="depth (m)",
    )
    axes.invert_yaxis()
