"""Figure of the plastic rings: stress against distance with theory, maps of failed rock, spread of the members."""

import numpy as np
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure
from matplotlib.patches import Circle

from catalogs.figures import style

MPA = 1e-6
DRAWN_RADII = 1.7  # Extent of profiles and maps in plastic radii.
COLOURS = (style.MODELLED, style.RECORDED, style.BOTH)
STRESSES = {2: ("radial", "hoop", "axial"), 3: ("radial", "hoop")}
MAX_PER_ROW = 4  # Columns of profile and map in a block.
BLOCK_HEIGHT = 5.4  # Height of a profile and its map, inches.
MAX_PROFILE_PARTICLES = 1500  # Keeps the file small.


def draw(perfect: list, groups: dict[str, list]) -> Figure:
    """Profiles above, maps of the same runs below, spread of the members last. Runs are plastic.answer.Run."""
    columns = [(run.name, [run]) for run in perfect]
    columns += [(f"{name}, first of {len(runs)}", runs) for name, runs in groups.items()]
    blocks = blocks_of(columns)
    heights = [BLOCK_HEIGHT] * len(blocks) + [2.2] * bool(groups)
    figure = style.new_figure(height=sum(heights))
    parts = figure.subfigures(len(heights), 1, height_ratios=heights, squeeze=False)[:, 0]
    for part, block in zip(parts, blocks, strict=False):
        draw_block(part, block)
    if groups:
        spread(parts[-1].subplots(1, 3), groups)
    return figure


def blocks_of(columns: list) -> list[list]:
    """Columns in the fewest blocks of at most MAX_PER_ROW. All blocks but the last are equally long."""
    number = max(1, -(-len(columns) // MAX_PER_ROW))
    per_row = max(1, -(-len(columns) // number))
    return [columns[start : start + per_row] for start in range(0, len(columns), per_row)]


def draw_block(part, block: list[tuple[str, list]]) -> None:
    """Profiles above and maps below of pairs (title, runs), in a part of a figure BLOCK_HEIGHT inches high."""
    panels = part.subplots(2, len(block), squeeze=False)
    for (title, runs), above, below in zip(block, *panels, strict=True):
        profile(above, title, runs[0])
        where_failed(part, below, runs)


def profile(axes, title: str, run) -> None:
    """Stresses of particles against distance, with theory as lines."""
    cavity, theory = run.cavity, run.theory
    reach = DRAWN_RADII * theory.plastic_radius
    near = np.flatnonzero((cavity.distance > theory.radius) & (cavity.distance < reach))
    near = near[:: len(near) // MAX_PROFILE_PARTICLES + 1]
    r = np.linspace(theory.radius, reach, 600)
    kinds = STRESSES[cavity.dimension]
    for number, (kind, exact) in enumerate(zip(kinds, theory.stress(r), strict=False)):
        values = cavity.radial_hoop_third[number, near] * MPA
        look = {"color": COLOURS[number], "markersize": 1.6, "alpha": 0.5, "rasterized": True}
        axes.plot(cavity.distance[near], values, "o", **look)
        axes.plot(r, exact * MPA, color="black", linewidth=2.2)
        axes.plot(r, exact * MPA, color=COLOURS[number], linewidth=1.2)
        end = {"xytext": (3, 0), "textcoords": "offset points", "va": "center", "color": COLOURS[number]}
        axes.annotate(kind, (reach, exact[-1] * MPA), annotation_clip=False, fontsize=8, **end)
    axes.axvline(theory.plastic_radius, color=style.OUTLINE, linewidth=0.8, linestyle=":")
    axes.set(title=title, xlabel="distance from the centre (m)", ylabel="stress (MPa)")


def where_failed(figure, axes, runs: list) -> None:
    """Cells at the plane of symmetry, coloured by the share of runs in which they failed, with theory's front."""
    first = runs[0]
    cavity, theory = first.cavity, first.theory
    grid, reach = cavity.grid, DRAWN_RADII * theory.plastic_radius
    failed = np.zeros(grid.sizes["cell"])
    for run in runs:
        cells = np.unique(run.cavity.particle_cell[run.cavity.failed])
        failed[cells] += 1 / len(runs)
    across = (0, 1) if cavity.dimension == 2 else (0, 2)
    origin, size = grid.cell_origin.values - cavity.center, grid.cell_size.values
    shown = (origin[:, across] < reach).all(axis=1) & (failed > 0)
    if cavity.dimension == 3:
        shown &= origin[:, 1] < 0.5 * cavity.cell
    corner = origin[shown][:, across]
    square = np.array([[0, 0], [1, 0], [1, 1], [0, 1]])
    drawn = PolyCollection(
        corner[:, None] + size[shown, None, None] * square,
        array=failed[shown],
        cmap="viridis_r",
        clim=(0.0, 1.0),
        rasterized=True,
    )
    axes.add_collection(drawn)
    for radius, look in ((theory.radius, "-"), (theory.plastic_radius, "--")):
        axes.add_patch(
            Circle((0, 0), radius, facecolor="none", edgecolor=style.RECORDED, linestyle=look, linewidth=1.3)
        )
    names = "xyz"[across[0]], "xyz"[across[1]]
    axes.set(xlim=(0, reach), ylim=(0, reach), aspect="equal", xlabel=f"{names[0]} (m)", ylabel=f"{names[1]} (m)")
    axes.set_title("failed (dashed: theory)")
    if len(runs) > 1:
        figure.colorbar(drawn, ax=axes, label=f"share of {len(runs)} runs", shrink=0.8)


def spread(panels, groups: dict[str, list]) -> None:
    """Radius, failed share of the ring and closure of each member as a dot."""
    measures = (
        (
            "95 % radius minus theory (cells)",
            lambda run: (run.percentile - run.theory.plastic_radius) / run.cavity.cell,
        ),
        ("share of theory's ring that failed", lambda run: run.share),
        ("closure over theory", lambda run: run.closure / run.expected_closure),
    )
    for axes, (label, measure) in zip(panels, measures, strict=True):
        for number, runs in enumerate(groups.values()):
            values = [measure(run) for run in runs]
            axes.plot(values, [number] * len(values), "o", color=style.MODELLED, alpha=0.6)
            axes.plot(np.mean(values), number, "|", color=style.RECORDED, markersize=18, markeredgewidth=2)
        axes.axvline(0.0 if "minus" in label else 1.0, color=style.OUTLINE, linestyle="--", linewidth=0.8)
        axes.set(xlabel=label, ylim=(-0.6, len(groups) - 0.4))
        axes.set_yticks(range(len(groups)), [name.removeprefix("brittle, ") for name in groups])
    panels[0].set_title("Members of each brittle group; bar: their mean")
