"""One row of brittle cells, in which failure cannot localise: failed depth, residual stress and closure."""

import numpy as np
from matplotlib.figure import Figure

from catalogs.figures import style
from verification.answers.brittle_row.closed_form import BrittleRow
from verification.cavities.coulomb import CoulombRock
from verification.results import Results, Variant
from verification.rows import Row

MPA = 1e-6


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
        exact, state = exact_row(variant), variant.step(variant.step_names[-1])
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
    rows = [
        Row(
            f"{name}: failed depth, m",
            exact.failed_depth,
            found,
            abs(found - exact.failed_depth) / cell,
            allowed["depth_cells"],
            f"error in cells of {cell:g} m; {block}",
        )
    ]
    error = state.stress.values[present][:, :3].T - exact.stress(depth)
    size = exact.rock.residual_strength
    for part, where in (("failed", failed), ("intact", ~failed)):
        worst = float(np.sqrt(np.mean(error[:, where] ** 2)) / size)
        quantity = f"{name}: stress of {part} rock, r.m.s. of xx, yy, zz, share of the residual uniaxial strength"
        rows.append(Row(quantity, 0.0, worst, worst, allowed["stress"]))
    nodes = variant.grid.node_position.values[:, 2]
    at_face = np.abs(nodes - face) < 1e-6 * cell
    rise = float(state.node_displacement.values[at_face, 2].mean())
    rows.append(Row.relative(f"{name}: rise of the face, mm", 1e3 * exact.rise(length), 1e3 * rise, allowed["closure"]))
    return rows


def contiguous(depth: np.ndarray, failed: np.ndarray) -> bool:
    """Whether all failed particles lie above all intact ones."""
    return bool(not failed.any() or failed.all() or depth[failed].max() < depth[~failed].min())


def draw(axes, name: str, variant: Variant, exact: BrittleRow, state) -> None:
    """Stress against depth with the exact lines."""
    present = state.volume.values > 0.0
    depth = face_elevation(variant) - state.position.values[present, 2]
    lines = np.linspace(0.0, depth.max(), 800)
    colours = (style.RECORDED, style.BOTH, style.MODELLED)
    parts = zip(("xx", "yy", "zz"), colours, exact.stress(lines), state.stress.values[present].T, strict=False)
    for component, colour, theory, found in parts:
        axes.plot(theory * MPA, lines, color=colour, linewidth=1.0, label=f"{component}, exact")
        axes.plot(found * MPA, depth, "o", color=colour, markersize=3.0)
    axes.axhline(exact.failed_depth, color=style.OUTLINE, linestyle=":", linewidth=0.8)
    axes.set(title=f"{name}: above the dotted line rock has failed", xlabel="stress (MPa)", ylabel="depth (m)")
    axes.invert_yaxis()
    axes.legend()
