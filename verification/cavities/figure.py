"""Figure of the plastic rings: stress against distance with theory, maps of failed rock, spread of the members."""

import numpy as np
from matplotlib.figure import Figure, SubFigure

from catalogs.figures import style
from verification.cavities.runs import STRESSES, Run
from verification.comparisons import MPA
from verification.plots import add_circle, plot_cells, plot_errors, plot_series

DRAWN_RADII = 1.7  # Extent of profiles and maps in plastic radii.
MAX_PER_ROW = 4  # Columns of profile and map in a block.
BLOCK_HEIGHT = 5.4  # Height of a profile and its map, inches.
SPREAD_HEIGHT = 2.2  # Height of the row of spreads, inches.
MAX_PROFILE_PARTICLES = 1500  # Keeps the file small.


def draw(perfect: list[Run], groups: dict[str, list[Run]]) -> Figure:
    """Profiles above, maps of the same runs below, spread of the members last."""
    columns = [(run.name, [run]) for run in perfect]
    columns += [(f"{name}, first of {len(runs)}", runs) for name, runs in groups.items()]
    figure, rest = draw_blocks(columns, SPREAD_HEIGHT if groups else 0.0)
    if groups:
        spread(rest.subplots(1, 3, sharey=True), groups)
    return figure


def draw_blocks(columns: list[tuple[str, list[Run]]], height: float) -> tuple[Figure, SubFigure]:
    """A figure with columns (title, runs) in blocks, and its last part of this height, inches, for the caller.

    Without a height there is no such part: the last block is returned.
    """
    blocks = blocks_of(columns)
    heights = [BLOCK_HEIGHT] * len(blocks) + [height] * bool(height)
    figure = style.new_figure(height=sum(heights))
    parts = figure.subfigures(len(heights), 1, height_ratios=heights, squeeze=False)[:, 0]
    for part, block in zip(parts, blocks, strict=False):
        draw_block(part, block)
    return figure, parts[-1]


def blocks_of(columns: list) -> list[list]:
    """Columns in the fewest blocks of at most MAX_PER_ROW. All blocks but the last are equally long."""
    number = max(1, -(-len(columns) // MAX_PER_ROW))
    per_row = max(1, -(-len(columns) // number))
    return [columns[start : start + per_row] for start in range(0, len(columns), per_row)]


def draw_block(part, block: list[tuple[str, list[Run]]]) -> None:
    """Profiles above and maps below of pairs (title, runs), in a part of a figure BLOCK_HEIGHT inches high."""
    panels = part.subplots(2, len(block), squeeze=False)
    for (title, runs), above, below in zip(block, *panels, strict=True):
        profile(above, title, runs[0])
        where_failed(part, below, runs)


def profile(axes, title: str, run: Run) -> None:
    """Stresses of particles against distance, with theory as lines."""
    cavity, theory = run.cavity, run.theory
    reach = DRAWN_RADII * theory.plastic_radius
    near = np.flatnonzero((cavity.distance > theory.radius) & (cavity.distance < reach))
    near = near[:: len(near) // MAX_PROFILE_PARTICLES + 1]
    r = np.linspace(theory.radius, reach, 600)
    kinds, exact = STRESSES[cavity.dimension], theory.stress(r)
    axes.axvline(theory.plastic_radius, color=style.OUTLINE, linewidth=0.8, linestyle=":")
    plot_series(
        axes,
        {kind: (cavity.distance[near], cavity.radial_hoop_third[i, near] * MPA) for i, kind in enumerate(kinds)},
        {kind: (r, exact[i] * MPA) for i, kind in enumerate(kinds)},
        title=title,
        xlabel="distance from the centre (m)",
        ylabel="stress (MPa)",
    )


def where_failed(figure, axes, runs: list[Run]) -> None:
    """Cells at the plane of symmetry, coloured by the share of runs in which they failed, with theory's front."""
    cavity, theory = runs[0].cavity, runs[0].theory
    grid, reach = cavity.grid, DRAWN_RADII * theory.plastic_radius
    failed = np.zeros(grid.sizes["cell"])
    for run in runs:
        failed[np.unique(run.cavity.particle_cell[run.cavity.failed])] += 1 / len(runs)
    across = (0, 1) if cavity.dimension == 2 else (0, 2)
    origin, size = grid.cell_origin.values - cavity.center, grid.cell_size.values
    shown = (origin[:, across] < reach).all(axis=1) & (failed > 0)
    if cavity.dimension == 3:
        shown &= origin[:, 1] < 0.5 * cavity.cell
    drawn = plot_cells(axes, origin[shown][:, across], size[shown], failed[shown], cmap="viridis_r", clim=(0.0, 1.0))
    for radius, look in ((theory.radius, "-"), (theory.plastic_radius, "--")):
        add_circle(axes, radius, edgecolor=style.RECORDED, linestyle=look, linewidth=1.3)
    x, y = ("xyz"[axis] for axis in across)
    axes.set(xlim=(0, reach), ylim=(0, reach), aspect="equal", xlabel=f"{x} (m)", ylabel=f"{y} (m)")
    axes.set_title("failed (dashed: theory)")
    if len(runs) > 1:
        figure.colorbar(drawn, ax=axes, label=f"share of {len(runs)} runs", shrink=0.8)


def spread(panels, groups: dict[str, list[Run]]) -> None:
    """Radius, failed share of the ring and closure of each member as a dot, and their means."""
    measures = {
        "95 % radius minus theory (cells)": (lambda run: run.percentile / run.cavity.cell - front(run), 0.0),
        "share of theory's ring that failed": (lambda run: run.share, 1.0),
        "closure over theory": (lambda run: run.closure_share, 1.0),
    }
    names = [name.removeprefix("brittle, ") for name in groups]
    for axes, (label, (measure, truth)) in zip(panels, measures.items(), strict=True):
        values = [[measure(run) for run in runs] for runs in groups.values()]
        series = {"member": values, "mean": [np.mean(some) for some in values]}
        plot_errors(axes, names, series, truth=truth, marks="o|", legend=None, xlabel=label)
    panels[0].set_title("Members of each brittle group (dots) and their means")


def front(run: Run) -> float:
    """Plastic radius of theory, cells."""
    return run.theory.plastic_radius / run.cavity.cell
