"""Figure of the elastic sphere: stress against distance with theory, and sections of stress and of its error."""

import numpy as np
from matplotlib.colors import TwoSlopeNorm
from matplotlib.figure import Figure
from matplotlib.patches import Circle
from scipy.spatial import cKDTree

from catalogs.figures import style
from verification.cavities.cavity import Cavity
from verification.cavities.inclusion import SphericalInclusion

MPA = 1e-6
PROFILE_RADII = 3.5  # Length of the profiles in radii.
SECTION_RADII = 2.0  # Width of the sections in radii.
SECTION_PIXELS = 240
COLOURS = {"along z": style.RECORDED, "along x": style.MODELLED}
PROFILE_COMPONENTS = ((2, 2), (0, 0))  # zz and xx


def draw(fields: dict[str, tuple[Cavity, SphericalInclusion]], outer_radii: float) -> Figure:
    """One row of panels for each variant."""
    figure = style.new_figure(height=3.1 * len(fields))
    grid = figure.subplots(len(fields), 4, squeeze=False, width_ratios=[1.2, 1.2, 0.9, 0.9])
    for axes, (name, (cavity, exact)) in zip(grid, fields.items(), strict=True):
        profile(axes[0], name, cavity, exact, "along z", 2)
        profile(axes[1], name, cavity, exact, "along x", 0)
        section(figure, axes[2:], cavity, exact)
    for axes in grid[-1, :2]:
        axes.set_xlabel("distance from the centre (m)")
    figure.legend(*grid[0, 0].get_legend_handles_labels(), loc="outside upper left", ncols=4)
    return figure


def profile(axes, name: str, cavity: Cavity, exact: SphericalInclusion, title: str, axis: int) -> None:
    """zz and xx along an axis: particles of the first row of cells beside it, and the exact lines."""
    off = np.delete(cavity.place, axis, axis=1)
    size = cavity.grid.cell_size.values[cavity.particle_cell]
    shown = cavity.fill | (cavity.distance > cavity.radius)  # Particles of cut cells may lie in the void.
    near = np.flatnonzero((off < size[:, None]).all(axis=1) & shown & (cavity.distance < PROFILE_RADII * cavity.radius))
    line = np.zeros((500, 3))
    line[:, axis] = np.linspace(1e-3, PROFILE_RADII, 500) * cavity.radius
    line[np.abs(line[:, axis] - cavity.radius) < 0.005 * cavity.radius] = (
        np.nan
    )  # The lines break at the wall, where stress jumps.
    theory = exact.stress(np.nan_to_num(line, nan=cavity.radius))
    theory[np.isnan(line).any(axis=1)] = np.nan
    for (i, j), colour in zip(PROFILE_COMPONENTS, COLOURS.values(), strict=True):
        label = f"{'xyz'[i]}{'xyz'[j]}"
        axes.plot(line[:, axis], theory[:, i, j] * MPA, color=colour, linewidth=1.0, label=f"{label}, exact")
        axes.plot(
            cavity.distance[near], cavity.stress[near, i, j] * MPA, "o", color=colour, markersize=2.5, label=f"{label}"
        )
    axes.axvline(cavity.radius, color=style.OUTLINE, linewidth=0.6, linestyle=":")
    axes.set(title=f"{name}, {title}", ylabel="stress (MPa)")


def section(figure: Figure, both, cavity: Cavity, exact: SphericalInclusion) -> None:
    """zz in the plane y = 0, and its error."""
    reach = SECTION_RADII * cavity.radius
    axis = (np.arange(SECTION_PIXELS) + 0.5) / SECTION_PIXELS * reach
    x, z = np.meshgrid(axis, axis)
    points = np.stack([x, np.full_like(x, 0.5 * cavity.cell), z], axis=-1)
    nearest = cKDTree(cavity.place).query(points)[1]
    at_particles = cavity.stress[:, 2, 2] - exact.stress(cavity.place)[:, 2, 2]
    pressure = np.abs(exact.virgin_stress).max()
    void = (np.hypot(x, z) < cavity.radius) & ~cavity.fill.any()
    images: tuple[tuple[np.ndarray, dict, str, str], ...] = (
        (cavity.stress[:, 2, 2] * MPA, {"cmap": "cividis"}, "zz (MPa)", "neither"),
        (100 * at_particles / pressure, {"cmap": "RdBu_r", "norm": TwoSlopeNorm(0.0, -3.0, 3.0)}, "error (%)", "both"),
    )
    for axes, (values, look, title, extend) in zip(both, images, strict=True):
        image = np.where(void, np.nan, values[nearest])
        drawn = axes.imshow(image, origin="lower", extent=(0, reach, 0, reach), rasterized=True, **look)
        axes.add_patch(Circle((0.0, 0.0), cavity.radius, facecolor="none", edgecolor=style.OUTLINE, linewidth=0.8))
        axes.set(title=title, xlabel="x (m)", ylabel="z (m)")
        figure.colorbar(drawn, ax=axes, shrink=0.8, extend=extend)
