"""Response of the rock: place and time of failure, distance of intact rock from failure, displacement and energy.

The template is "rock.html.j2".
"""

from typing import Any

import numpy as np
import xarray as xr
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from catalogs.figures import panels, style, views
from catalogs.report.evidence import Evidence
from catalogs.report.gallery import Gallery
from catalogs.report.sections.scene import cut_planes
from catalogs.report.text import number, percent
from common.part_centers import part_centers

ENERGY_COLUMNS = {  # of a step's row: its heading, and the energies that are summed
    "work done on the rock": ("work",),
    "increase of stored energy": ("stored",),
    "taken up by the mined rock": ("support",),
    "seismic drop": ("seismic",),
    "overshoot": ("overshoot",),
    "later plastic flow": ("flow",),
    "hourglass": ("hourglass", "hourglass_released"),
    "motion": ("motion",),
    "unbalanced": ("unbalanced",),
}
GAIN_COLUMN, SPLIT_COLUMN = "gained", "refinement"
MIN_GAIN_SHARE = 1e-6  # Smaller gains, relative to the dissipated energy, are round-off.
NO_ENERGY = "no energy"
MAX_STRENGTH_FACTOR_SHOWN = 3.0  # Upper end of the colour scale.
FAILED, TOO_COARSE = "#b2182b", "#f4a582"
ARROWS_ALONG_SECTION = 22  # Displacement arrows along the longer side of a section.
MIN_ARROW_SHARE = 0.2  # Arrows shorter than this share of the longest are not drawn.


def section(evidence: Evidence, gallery: Gallery) -> dict | None:
    """Content of the section on rock: figures of failed rock (None if none failed), strength factor and displacement,
    tables of totals and energy, and the excavated share from which cells are drawn. None before any stage."""
    if evidence.state is None:
        return None
    grid, state, cuts, planned = evidence.grid, evidence.state, cut_planes(evidence), evidence.planned
    upright = [view for view in cuts if view.vertical == views.UP] or cuts
    shown: dict[str, Any] = {
        "failed": None,
        "table": totals(evidence),
        "energy": energy_table(evidence),
        "shown_excavated": views.MIN_EXCAVATED_SHARE_DRAWN,
    }
    if (state["failed"].values >= 0).any():
        last = max(int(step["step_index"]) for step in evidence.steps)
        names, dated = ["" for _ in range(last + 1)], [False] * (last + 1)
        for step in evidence.steps:
            names[int(step["step_index"])], dated[int(step["step_index"])] = step["step"], bool(int(step["dated"]))
        shown["failed"] = gallery.add("failed_rock", failed_rock(grid, state, cuts, names, dated, planned))
    shown["strength"] = gallery.add("strength_factor", strength_factor(grid, state, upright, planned))
    shown["displacement"] = gallery.add("displacement", displacement(grid, state, upright, planned))
    return shown


def energy_table(evidence: Evidence) -> dict | None:
    """Headings and rows (text, MJ); None without steps. What dilation above friction gains, if any, is a column."""
    steps = evidence.steps
    if not steps:
        return None
    gains = any(energy(step, "gained") > MIN_GAIN_SHARE * abs(energy(step, "dissipated")) for step in steps)
    splits = any(energy(step, "refined") for step in steps)
    columns = ENERGY_COLUMNS | ({SPLIT_COLUMN: ("refined",)} if splits else {})
    columns |= {GAIN_COLUMN: ("gained",)} if gains else {}
    rows = [_energy_row(step, columns) for step in steps]
    return {"columns": list(columns), "rows": rows, "gains": gains, "splits": splits, "unknown": _unknown(steps)}


def totals(evidence: Evidence) -> list[dict]:
    """The steps with what each released and dissipated, MJ."""
    return [step | {name: energy(step, name) / 1e6 for name in ("released", "dissipated")} for step in evidence.steps]


def energy(step: dict, *names: str) -> float:
    """Sum of a step's energies of these names, J; 0 where it is round-off of the energy that its rock holds."""
    value = sum(float(step[f"energy_{name}"]) for name in names)
    return 0.0 if abs(value) <= float(step["energy_round_off"]) else value


def _energy_row(step: dict, columns: dict[str, tuple[str, ...]]) -> dict:
    values = [energy(step, *names) for names in columns.values()]
    left = percent(step["energy_left_share"]) if any(values) else NO_ENERGY
    return {"name": step["step"], "values": [number(value / 1e6) for value in values], "left": left}


def _unknown(steps: list[dict]) -> bool:
    """True if the energy balance of one of the steps is not known, because its particles moved."""
    return any(not np.isfinite(float(step["energy_left_share"])) for step in steps)


def failed_rock(
    grid: xr.Dataset,
    state: xr.Dataset,
    cut_views: list[views.View],
    names: list[str],
    dated: list[bool],
    planned: list[int],
) -> Figure:
    """Plan and sections of failed particles, coloured by the step of their first failure.

    state: the last step; names, dated: of all steps by step index, as `failed` counts them.
    """
    failed = state["failed"].values
    lower, upper = views.frame_limits(grid, [state["position"].values[failed >= 0]], margin=0.05)
    figure, array, _ = panels.panels(cut_views, lower, upper)
    colours = np.array(style.step_colours(dated))
    for axes, view in zip(array, cut_views, strict=True):
        views.draw_excavations(axes, grid, view, planned)
        chosen = views.cut_particles(state, view)
        chosen = chosen[failed[chosen] >= 0]
        corner, size = _squares(state, view, chosen)
        views.draw_squares(axes, corner, size, facecolors=colours[failed[chosen]], zorder=1)
        views.mark_cuts(axes, view, cut_views)
    present = style.thinned(np.unique(failed[failed >= 0]).tolist())
    label = [names[index] + ("" if dated[index] else " (before the record)") for index in present]
    handles = [Patch(color=colours[index], label=text) for index, text in zip(present, label, strict=True)]
    handles.append(Patch(facecolor=style.EXCAVATION, edgecolor=style.OUTLINE, label="excavated"))
    panels.key(figure, handles)
    return figure


def strength_factor(grid: xr.Dataset, state: xr.Dataset, cut_views: list[views.View], planned: list[int]) -> Figure:
    """Sections coloured by strength factor; rock that has failed, and what coarse cells keep from failing, apart."""
    finest = float(grid["cell_size"].values.min())
    figure, array, bar, *_ = _sections(grid, cut_views)
    for axes, view in zip(array, cut_views, strict=True):
        corner, size, chosen = _rock(axes, grid, state, view, planned)
        value = np.clip(state["strength_factor"].values[chosen], 0, MAX_STRENGTH_FACTOR_SHOWN)
        drawn = views.draw_squares(
            axes, corner, size, array=value, cmap="cividis", clim=(1, MAX_STRENGTH_FACTOR_SHOWN), zorder=1
        )
        failed = state["failed"].values[chosen] >= 0
        views.draw_squares(axes, corner[failed], size[failed], facecolors=FAILED, zorder=1.2)
        coarse = ~failed & (value < 1.0) & (grid["cell_size"].values[state["cell"].values[chosen]] > 1.01 * finest)
        views.draw_squares(axes, corner[coarse], size[coarse], facecolors=TOO_COARSE, zorder=1.2)
    figure.colorbar(drawn, cax=bar, label="strength factor (1)", extend="both")
    handles = [
        Patch(color=FAILED, label="has failed"),
        Patch(color=TOO_COARSE, label="above strength, in cells too coarse to fail"),
        Patch(color=style.FILL, label="fill"),
    ]
    panels.key(figure, handles)
    return figure


def displacement(grid: xr.Dataset, state: xr.Dataset, cut_views: list[views.View], planned: list[int]) -> Figure:
    """Sections coloured by the length of the displacement, arrows for its direction in the section."""
    figure, array, bar, lower, upper = _sections(grid, cut_views)
    length = 1e3 * np.linalg.norm(state["displacement"].values, axis=1)  # mm
    position, rock = state["position"].values, state["volume"].values > 0
    rock &= (state["excavation"].values < 0) & ((position >= lower) & (position <= upper)).all(axis=1)
    largest = float(np.quantile(length[rock], 0.998)) if rock.any() else 0.0
    largest = largest if largest > 0 else 1.0
    for axes, view in zip(array, cut_views, strict=True):
        corner, size, chosen = _rock(axes, grid, state, view, planned)
        drawn = views.draw_squares(
            axes, corner, size, array=length[chosen], cmap="viridis", norm=Normalize(0, largest), zorder=1
        )
        centre = corner + size[:, None] / 2
        framed = ((centre >= lower[view.axes]) & (centre <= upper[view.axes])).all(axis=1)
        spacing = (upper - lower)[view.axes].max() / ARROWS_ALONG_SECTION
        box = np.floor((centre[framed] - lower[view.axes]) / spacing).astype(int)
        _, first = np.unique(box, axis=0, return_index=True)
        point = centre[framed][first]
        arrow = 1e3 * state["displacement"].values[chosen][framed][first][:, view.axes]
        long = np.linalg.norm(arrow, axis=1) > MIN_ARROW_SHARE * largest
        point, arrow = point[long], arrow[long]
        axes.quiver(
            *point.T, *arrow.T, color="white", angles="xy", scale_units="xy", scale=largest / (1.3 * spacing),
            width=0.004, zorder=3,
        )  # fmt: skip
    figure.colorbar(drawn, cax=bar, label="displacement (mm)", extend="max")
    return figure


def _squares(state: xr.Dataset, view: views.View, chosen: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Lower corners (n, 2) and edges (n,) of the chosen particles' squares in a view, m."""
    size = state["spacing"].values[chosen]
    return part_centers(state)[chosen][:, view.axes] - size[:, None] / 2, size


def _sections(grid: xr.Dataset, cut_views: list[views.View]):
    """A figure with panels and a colour bar's axes for the surroundings of the excavations, and their limits."""
    lower, upper = views.frame_limits(grid, [], margin=0.2)
    return *panels.panels(cut_views, lower, upper, bar=True), lower, upper


def _rock(axes, grid: xr.Dataset, state: xr.Dataset, view: views.View, planned: list[int]):
    """Draw the fill; give the rock particles that remain to be coloured: lower corners, edges, indices."""
    chosen = views.cut_particles(state, view)
    fill = state["excavation"].values[chosen] >= 0
    views.draw_squares(axes, *_squares(state, view, chosen[fill]), facecolors=style.FILL, zorder=0.8)
    views.draw_excavations(axes, grid, view, planned, fill=False)
    return *_squares(state, view, chosen[~fill]), chosen[~fill]
